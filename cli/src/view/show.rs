//! What a window shows.

use glam::{Vec2, Vec3};
use winit::keyboard::Key;

use super::camera::{Bounds, Camera};
use super::colors::Rgba;
use super::overlay::LineEnd;
use drystone::{Result, World};

/// Where the mouse is.
#[derive(Clone, Copy, Debug)]
pub struct Pointer {
    /// Place in the picture, -1 to 1 from left to right and from bottom to top.
    pub at: Vec2,
    /// The eye (m).
    pub origin: Vec3,
    /// Unit vector from the eye to what is under the mouse.
    pub direction: Vec3,
}

/// Something that a window shows.
pub trait Show {
    /// What the window is called.
    fn title(&self) -> String;
    /// The bodies; which ones and their shapes stay as they are.
    fn world(&self) -> &World;
    /// What casts shadows.
    fn bounds(&self) -> Bounds;
    /// A space whose near walls are left out.
    fn container(&self) -> Option<Bounds> {
        None
    }
    /// Where it is seen from at first, in a window whose width is `aspect` times its height.
    fn camera(&self, aspect: f32) -> Camera;
    /// Color of each body.
    fn colors(&mut self) -> Vec<Rgba>;
    /// Lines on top.
    fn lines(&mut self) -> Vec<LineEnd> {
        Vec::new()
    }
    /// Lets `seconds` of real time pass.
    fn advance(&mut self, seconds: f32) -> Result<()>;
    /// A key was pressed or let go.
    fn key(&mut self, key: &Key, down: bool) -> Result<()>;
    /// The left button was pressed: whether the mouse now moves something here, instead of the camera.
    fn grab(&mut self, pointer: &Pointer) -> bool;
    /// The mouse moved with the button held.
    fn drag(&mut self, pointer: &Pointer);
    /// The button was let go.
    fn release(&mut self);
    /// The panel.
    fn panel(&mut self, ui: &mut egui::Ui);
}
