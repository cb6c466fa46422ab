//! Box tests of queries, four boxes at once.

use glam::{Vec3, Vec4};
use parry3d::math::Pose;

use crate::world::{MAX_LENGTH, Shape};

/// A ray against boxes that are enlarged by `grow` on every side.
pub(super) struct BoxRay {
    pub origin: Vec3,
    /// Unit length.
    pub direction: Vec3,
    inverse: Vec3,
    grow: Vec3,
}

/// Smallest component of a direction. The inverse of a smaller one, times a length, could be infinite.
const LEAST: f32 = 1e-18;

impl BoxRay {
    /// Returns `None` for a zero direction or numbers out of range.
    pub fn new(origin: Vec3, direction: Vec3, grow: Vec3) -> Option<Self> {
        let is_place = origin.abs().cmple(Vec3::splat(MAX_LENGTH)).all();
        // Scale first: the square of a direction can overflow even if the direction does not.
        let direction = (direction / direction.abs().max_element()).try_normalize().filter(|_| is_place)?;
        let component = |x: f32| 1.0 / if x.abs() < LEAST { LEAST.copysign(x) } else { x };
        let inverse = Vec3::from_array(direction.to_array().map(component));
        Some(Self { origin, direction, inverse, grow })
    }

    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + distance * self.direction
    }

    /// The distances at which the ray enters four boxes; infinite for a box that it misses.
    pub fn enters(&self, mins: &[Vec4; 3], maxs: &[Vec4; 3]) -> Vec4 {
        let (mut near, mut far) = (Vec4::ZERO, Vec4::MAX);
        for axis in 0..3 {
            let (lower, upper) = (mins[axis] - self.grow[axis], maxs[axis] + self.grow[axis]);
            let inverse = self.inverse[axis];
            // The lower corner of an empty box is above its upper corner, so every ray misses it.
            let (first, last) = if inverse > 0.0 { (lower, upper) } else { (upper, lower) };
            near = near.max((first - self.origin[axis]) * inverse);
            far = far.min((last - self.origin[axis]) * inverse);
        }
        // Allow for rounding.
        Vec4::select(near.cmple(far * (1.0 + 4.0 * f32::EPSILON)), near, Vec4::INFINITY)
    }
}

/// The distances from a point to four boxes.
pub(super) fn distance(mins: &[Vec4; 3], maxs: &[Vec4; 3], point: Vec3) -> Vec4 {
    let axis = |k: usize| (mins[k] - point[k]).max(point[k] - maxs[k]).max(Vec4::ZERO);
    let [x, y, z] = [0, 1, 2].map(axis);
    let squared = x * x + y * y + z * z;
    Vec4::from_array(squared.to_array().map(f32::sqrt)) * (1.0 - 4.0 * f32::EPSILON)
}

/// Zero for each of four boxes that overlaps a given box, and infinite for the others.
pub(super) fn overlap(mins: &[Vec4; 3], maxs: &[Vec4; 3], lower: Vec3, upper: Vec3) -> Vec4 {
    let axis = |k: usize| mins[k].cmple(Vec4::splat(upper[k])) & maxs[k].cmpge(Vec4::splat(lower[k]));
    Vec4::select(axis(0) & axis(1) & axis(2), Vec4::ZERO, Vec4::INFINITY)
}

/// Whether a half-space and a box overlap.
pub(super) fn reaches(plane: &Shape, pose: &Pose, lower: Vec3, upper: Vec3) -> bool {
    let Some(normal) = plane.as_half_space().map(|normal| pose.rotation * normal) else { return false };
    let deepest = Vec3::select(normal.cmpgt(Vec3::ZERO), lower, upper);
    (deepest - pose.translation).dot(normal) <= 0.0
}
