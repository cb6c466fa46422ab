//! Corners of hulls that stand for round shapes in engines that lack these.

use std::f32::consts::TAU;

use drystone::glam::{Quat, Vec3};

/// Sides of a hull.
const SIDES: u16 = 32;

/// A cylinder along Y.
pub(crate) fn cylinder(radius: f32, half_height: f32) -> Vec<Vec3> {
    ring(radius).flat_map(|p| [p + half_height * Vec3::Y, p - half_height * Vec3::Y]).collect()
}

/// A cone along Y with its apex up.
pub(crate) fn cone(radius: f32, half_height: f32) -> Vec<Vec3> {
    ring(radius).map(|p| p - half_height * Vec3::Y).chain([half_height * Vec3::Y]).collect()
}

/// The corners of a polygon around Y that has the area of the circle of `radius`.
fn ring(radius: f32) -> impl Iterator<Item = Vec3> {
    let turn = TAU / f32::from(SIDES);
    let corner = radius * (turn / turn.sin()).sqrt();
    (0..SIDES).map(move |i| Quat::from_rotation_y(turn * f32::from(i)) * Vec3::new(corner, 0.0, 0.0))
}
