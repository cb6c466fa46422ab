//! Pictures of drystone's worlds, and worlds that run while they are looked at.
//!
//! [`Renderer`] draws a world with wgpu on any adapter: into a texture that `Canvas` reads back, or by [`Sight`] on a window or a canvas of
//! a browser. A [`Show`] is a world that runs: [`Live`] a scene or a recording, [`Labyrinth`] the maze game. Windows, panels and files
//! are the command's.

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
/// The version of wgpu whose devices and surfaces this package takes.
pub use wgpu;
