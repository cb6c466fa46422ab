//! The content of a window.

use glam::{Vec2, Vec3};
use winit::keyboard::Key;

use super::camera::{Bounds, Camera};
use super::colors::Rgba;
use super::overlay::LineEnd;
use drystone::{Result, World};

#[derive(Clone, Copy, Debug)]
pub struct Pointer {
    /// Position in the picture, -1 to 1 from left to right and from bottom to top.
    pub at: Vec2,
    pub origin: Vec3,
    /// Unit vector from the eye to the point under the mouse.
    pub direction: Vec3,
}

pub trait Show {
    fn title(&self) -> String;
    /// The world. Bodies may come and go; the shapes of a body must not change.
    fn world(&self) -> &World;
    /// Bounds of the bodies that cast shadows.
    fn bounds(&self) -> Bounds;
    /// A space whose near walls are hidden.
    fn container(&self) -> Option<Bounds> {
        None
    }
    /// The first camera, in a window of width `aspect` times its height.
    fn camera(&self, aspect: f32) -> Camera;
    fn colors(&mut self) -> Vec<Rgba>;
    fn lines(&mut self) -> Vec<LineEnd> {
        Vec::new()
    }
    fn advance(&mut self, seconds: f32) -> Result<()>;
    /// Notes where the mouse points, before a key.
    fn point(&mut self, _pointer: &Pointer) {}
    fn key(&mut self, key: &Key, down: bool) -> Result<()>;
    /// Handles a press of the left button; returns whether drags go here instead of to the camera.
    fn grab(&mut self, pointer: &Pointer) -> bool;
    fn drag(&mut self, pointer: &Pointer);
    fn release(&mut self);
    fn panel(&mut self, ui: &mut egui::Ui);
}
