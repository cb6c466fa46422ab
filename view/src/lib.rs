//! Pictures of drystone's worlds, and worlds that run while they are looked at.
//!
//! [`Renderer`] draws a world with wgpu on any adapter. [`Canvas`] draws without a display and reads the picture back. A [`Show`] is
//! a world that runs: [`Live`] a scene or a recording, [`Labyrinth`] the maze game. Windows, panels and files are the command's.

#![forbid(unsafe_code)]

mod bounds;
mod camera;
mod canvas;
mod colors;
mod film;
mod labyrinth;
mod live;
mod live_show;
mod mesh;
mod overlay;
mod pipeline;
mod poses;
mod renderer;
mod show;

pub use bounds::Bounds;
pub use camera::Camera;
pub use canvas::{Canvas, Picture};
pub use colors::{ColorBy, Rgba, batch_color};
pub use film::{Film, Frame, Look, evenly};
pub use labyrinth::{Labyrinth, draw_game};
pub use live::{Live, scene_of};
pub use mesh::Meshes;
pub use overlay::{LineEnd, Overlay, lines};
pub use pipeline::Quality;
pub use poses::{Poses, poses};
pub use renderer::{Renderer, Shot};
pub use show::{Key, Pointer, Show};
