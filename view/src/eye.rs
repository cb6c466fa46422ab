//! The camera of a running show.

use glam::Vec2;

use crate::camera::Camera;
use crate::show::Show;

/// A camera that follows the movable bodies of a show until the user moves it.
pub struct Eye {
    pub camera: Camera,
    is_by_hand: bool,
}

impl Eye {
    /// An eye that shows all of `show` in a picture of width `aspect` times its height.
    pub fn new(show: &dyn Show, aspect: f32) -> Self {
        Self { camera: show.camera(aspect), is_by_hand: false }
    }

    /// Frames the movable bodies beside a panel at the right of the picture, `panel` heights wide.
    pub fn follow(&mut self, show: &dyn Show, aspect: f32, panel: f32) {
        if !self.is_by_hand {
            self.camera = show.camera(aspect - panel);
            self.camera.pan(Vec2::new(-0.5 * panel, 0.0));
        }
    }

    /// Stops following.
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
