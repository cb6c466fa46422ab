//! Bodies and distances that many scenes share.

use glam::Vec3;

use crate::world::{Body, Shape, World};

/// A world with a fixed floor, 1 m thick, whose top is at y = 0.
pub(super) fn floor(half_x: f32, half_z: f32) -> World {
    let mut world = World::new();
    let shape = Shape::cuboid(half_x, 0.5, half_z);
    world.add(Body::fixed().named("floor").shape(shape).position(0.0, -0.5, 0.0));
    world
}

/// A fixed half-space that falls towards x by `angle` (rad).
pub(super) fn slope(angle: f32) -> Body {
    Body::fixed().named("slope").shape(Shape::half_space(Vec3::new(libm::sinf(angle), libm::cosf(angle), 0.0)))
}

/// A cube of 1 m and 1000 kg.
pub(super) fn unit_box() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5))
}

/// Distance of the k-th of `n` things from their middle, in pitches.
pub(super) fn centered(k: usize, n: usize) -> f64 {
    k as f64 - (n as f64 - 1.0) / 2.0
}

/// How far gaps lift the k-th row, in heights of a row, if each row has `gap` of a height below it.
pub(super) fn lifted(k: usize, gap: f32) -> f32 {
    (k + 1) as f32 * gap
}
