//! Pictures of drystone's worlds, and interactive worlds.
//!
//! [`Renderer`] draws a world with wgpu on any adapter: into a texture that `Canvas` reads back, or through [`Sight`]
//! on a window or a browser canvas. A [`Show`] is a running world: [`Live`] is a scene or a recording, and
//! [`Labyrinth`] is the maze game. The command has the windows, panels and files.

#![forbid(unsafe_code)]

mod bounds;
mod camera;
#[cfg(not(target_family = "wasm"))]
mod canvas;
mod colors;
mod eye;
#[cfg(not(target_family = "wasm"))]
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
mod sight;

pub use bounds::Bounds;
pub use camera::Camera;
#[cfg(not(target_family = "wasm"))]
pub use canvas::{Canvas, Picture};
pub use colors::{ColorBy, Rgba, batch_color};
pub use eye::Eye;
#[cfg(not(target_family = "wasm"))]
pub use film::{Film, Look, Moment, draw_game, evenly};
pub use labyrinth::Labyrinth;
pub use live::{Live, Order, scene_of};
pub use mesh::Meshes;
pub use overlay::{LineEnd, Overlay, lines, ropes};
pub use pipeline::Quality;
pub use poses::{Poses, poses};
pub use renderer::{Renderer, Shades, Shot};
pub use show::{Key, Passing, Pointer, Show};
pub use sight::{Frame, Next, Sight};
/// The version of wgpu for the devices and surfaces of this package.
pub use wgpu;
