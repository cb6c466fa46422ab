//! Bodies and distances that several scenes use.

use glam::Vec3;

use drystone::{Body, Shape, World};

/// A world with a fixed floor, 1 m thick, with its top at y = 0.
pub(super) fn floor(half_x: f32, half_z: f32) -> World {
    let mut world = World::new();
    let shape = Shape::cuboid(half_x, 0.5, half_z);
    world.insert(Body::fixed().named("floor").shape(shape).position(0.0, -0.5, 0.0));
    world
}

/// A fixed half-space that descends towards x at `angle` (rad).
pub(super) fn slope(angle: f32) -> Body {
    Body::fixed().named("slope").shape(Shape::half_space(Vec3::new(libm::sinf(angle), libm::cosf(angle), 0.0)))
}

/// A cube of 1 m and 1000 kg.
pub(super) fn unit_box() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5))
}

/// Position of the k-th of `n` evenly spaced items relative to their middle, in pitches.
pub(super) fn centered(k: usize, n: usize) -> f64 {
    k as f64 - (n as f64 - 1.0) / 2.0
}

/// Lift of the k-th row by gaps, in heights of a row, if a gap of `gap` heights is below each row.
pub(super) fn lifted(k: usize, gap: f32) -> f32 {
    (k + 1) as f32 * gap
}
