//! Pictures of a world, with or without a window.

mod camera;
mod canvas;
mod colors;
mod film;
mod labyrinth;
mod live;
mod live_window;
mod mesh;
mod open;
mod output;
mod overlay;
mod panel;
mod pipeline;
mod renderer;
mod show;
pub mod window;

pub use camera::{Bounds, Camera};
pub use canvas::{Canvas, Picture};
pub use colors::{ColorBy, Rgba, batch_color};
pub use film::{Film, Frame, Look, evenly};
pub use labyrinth::{Labyrinth, draw_game};
pub use live::{Live, scene_of};
pub use mesh::{Meshes, Poses, poses};
pub use output::Output;
pub use overlay::{LineEnd, Overlay, lines};
pub use pipeline::Quality;
pub use renderer::{Renderer, Shot};
pub use show::{Pointer, Show};
