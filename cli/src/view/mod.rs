//! Pictures of a world, with or without a window.
//!
//! ```text
//! mesh      world -> one mesh a geometry, one instance a collider
//! colors    bodies -> colors by material, batch, speed or impulse
//! camera    frames a scene by itself; orbit, pan, zoom; the ray under the cursor
//! renderer  poses, colors, camera -> a texture: light, shadow map, lines on top
//! canvas    the same, read back: pictures on whatever adapter there is
//! film      a run or a recorded motion as frames -> pictures -> png, gif, frames, mp4 (output)
//! window    events in, pictures out, for anything that can be shown: a scene that runs (live, panel), the maze (labyrinth)
//! ```

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
pub use live::Live;
pub use mesh::{Meshes, Poses, poses};
pub use output::Output;
pub use overlay::{LineEnd, Overlay, lines};
pub use pipeline::Quality;
pub use renderer::{Renderer, Shot};
pub use show::{Pointer, Show};
