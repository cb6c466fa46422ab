//! The camera of a show that runs.

use glam::Vec2;

use crate::camera::Camera;
use crate::show::Show;

/// A camera that follows what moves in a show, until somebody moves it.
pub struct Eye {
    pub camera: Camera,
    is_by_hand: bool,
}

impl Eye {
    /// An eye that sees all of `show` in a picture of width `aspect` times its height.
    pub fn new(show: &dyn Show, aspect: f32) -> Self {
        Self { camera: show.camera(aspect), is_by_hand: false }
    }

    /// Frames what moves beside a panel that covers the right of the picture, `panel` heights wide.
    pub fn follow(&mut self, show: &dyn Show, aspect: f32, panel: f32) {
        if !self.is_by_hand {
            self.camera = show.camera(aspect - panel);
            self.camera.pan(Vec2::new(-0.5 * panel, 0.0));
        }
    }

    /// Leaves the camera where it is.
    pub fn stay(&mut self) {
        self.is_by_hand = true;
    }

    /// Follows again.
    pub fn go_along(&mut self) {
        self.is_by_hand = false;
    }

    /// See [`Camera::orbit`].
    pub fn orbit(&mut self, drag: Vec2) {
        self.stay();
        self.camera.orbit(drag);
    }

    /// See [`Camera::pan`].
    pub fn pan(&mut self, drag: Vec2) {
        self.stay();
        self.camera.pan(drag);
    }

    /// See [`Camera::zoom`].
    pub fn zoom(&mut self, notches: f32) {
        self.stay();
        self.camera.zoom(notches);
    }
}
