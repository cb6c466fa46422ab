//! A running world, in the form that a window or a page uses.

use std::pin::Pin;

use drystone::{Result, World};
use glam::{Vec2, Vec3};

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::colors::Rgba;
use crate::overlay::LineEnd;

/// The place under a mouse or a finger.
#[derive(Clone, Copy, Debug)]
pub struct Pointer {
    /// Position in the picture, -1 to 1 from left to right and from bottom to top.
    pub at: Vec2,
    /// The eye (m).
    pub origin: Vec3,
    /// Unit vector from the eye to the point under the pointer.
    pub direction: Vec3,
}

impl Pointer {
    /// A pointer at a place of the picture of `camera`, -1 to 1, in a picture of width `aspect` times its height.
    pub fn through(camera: &Camera, at: Vec2, aspect: f32) -> Self {
        let (origin, direction) = camera.ray(at, aspect);
        Self { at, origin, direction }
    }
}

/// A key that a show can handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A letter in lower case, a digit, a sign, or a space.
    Character(char),
    Delete,
    Left,
    Right,
    Up,
    Down,
}

impl Key {
    /// The key with a name of the standard for keyboard events (`KeyboardEvent.key`), or `None` if no show uses it.
    pub fn named(name: &str) -> Option<Self> {
        let mut characters = name.chars();
        match (name, characters.next(), characters.next()) {
            ("Delete", ..) => Some(Self::Delete),
            ("ArrowLeft", ..) => Some(Self::Left),
            ("ArrowRight", ..) => Some(Self::Right),
            ("ArrowUp", ..) => Some(Self::Up),
            ("ArrowDown", ..) => Some(Self::Down),
            // Keys are independent of Shift and Caps Lock.
            (_, Some(character), None) => Some(Self::Character(character.to_lowercase().next().unwrap_or(character))),
            _ => None,
        }
    }
}

/// The future of an advance. A page awaits it, since it cannot block; other programs block on it.
pub type Passing<'a> = Pin<Box<dyn Future<Output = Result<()>> + 'a>>;

/// A running world and its view. Only [`Show::advance`] makes steps.
pub trait Show {
    fn title(&self) -> String;
    /// The world. Bodies can be added and removed; the shapes of a body must not change.
    fn world(&self) -> &World;
    /// Bounds of the bodies that cast shadows.
    fn bounds(&self) -> Bounds;
    /// A space whose near walls are hidden.
    fn container(&self) -> Option<Bounds> {
        None
    }
    /// The first camera, for a picture of width `aspect` times its height.
    fn camera(&self, aspect: f32) -> Camera;
    fn colors(&mut self) -> Vec<Rgba>;
    fn lines(&mut self) -> Vec<LineEnd> {
        Vec::new()
    }
    /// Carries out the orders of keys, and advances the time.
    fn advance(&mut self, seconds: f32) -> Passing<'_>;
    /// Sets the place of the pointer, before a key.
    fn point(&mut self, _pointer: &Pointer) {}
    /// Handles a key. The next [`Show::advance`] makes the steps that it requests.
    fn key(&mut self, key: Key, down: bool);
    /// Handles the press of a button or a finger. Returns whether drags go to the show instead of the camera.
    fn grab(&mut self, pointer: &Pointer) -> bool;
    fn drag(&mut self, pointer: &Pointer);
    fn release(&mut self);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_the_names_of_the_standard() {
        assert_eq!(Key::named("ArrowLeft"), Some(Key::Left));
        assert_eq!((Key::named("N"), Key::named(" ")), (Some(Key::Character('n')), Some(Key::Character(' '))));
        assert_eq!((Key::named("F5"), Key::named("")), (None, None));
    }
}
