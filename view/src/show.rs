//! A world that runs and is looked at: what a window or a page asks of it.

use std::pin::Pin;

use drystone::{Result, World};
use glam::{Vec2, Vec3};

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::colors::Rgba;
use crate::overlay::LineEnd;

/// Where a mouse or a finger points.
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
    /// A pointer at a place of the picture that `camera` takes, -1 to 1, in a picture of width `aspect` times its height.
    pub fn through(camera: &Camera, at: Vec2, aspect: f32) -> Self {
        let (origin, direction) = camera.ray(at, aspect);
        Self { at, origin, direction }
    }
}

/// A key that a show can understand.
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
    /// The key of a name in the standard for keyboard events (`KeyboardEvent.key`); none if no show has a use for it.
    pub fn named(name: &str) -> Option<Self> {
        let mut characters = name.chars();
        match (name, characters.next(), characters.next()) {
            ("Delete", ..) => Some(Self::Delete),
            ("ArrowLeft", ..) => Some(Self::Left),
            ("ArrowRight", ..) => Some(Self::Right),
            ("ArrowUp", ..) => Some(Self::Up),
            ("ArrowDown", ..) => Some(Self::Down),
            // Keys are independent of shift and caps lock.
            (_, Some(character), None) => Some(Self::Character(character.to_lowercase().next().unwrap_or(character))),
            _ => None,
        }
    }
}

/// Time that passes in a show. A page awaits it, since a page cannot wait for a device; other programs block on it.
pub type Passing<'a> = Pin<Box<dyn Future<Output = Result<()>> + 'a>>;

/// A world that runs, and how it is looked at. Nothing but [`Show::advance`] makes a step.
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
    /// The first camera, in a picture of width `aspect` times its height.
    fn camera(&self, aspect: f32) -> Camera;
    fn colors(&mut self) -> Vec<Rgba>;
    fn lines(&mut self) -> Vec<LineEnd> {
        Vec::new()
    }
    /// Carries out what keys asked for, and lets the time pass.
    fn advance(&mut self, seconds: f32) -> Passing<'_>;
    /// Notes where the pointer is, before a key.
    fn point(&mut self, _pointer: &Pointer) {}
    /// Notes a key; the next [`Show::advance`] makes the steps that it asks for.
    fn key(&mut self, key: Key, down: bool);
    /// Handles the press of a button or a finger; returns whether drags go here instead of to the camera.
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
