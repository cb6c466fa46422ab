//! Valid ranges of the numbers of a world.

use glam::{Quat, Vec3};

use crate::error::{Result, ensure};
use crate::math::rotation::squared_length;

/// Largest coordinate and size (m). Its cube is still finite in single precision.
pub const MAX_LENGTH: f32 = 1e9;
/// Largest speed that a caller can set (m/s, rad/s).
pub const MAX_SPEED: f32 = 1e9;
/// Largest acceleration along an axis: by gravity (m/s²), by the force on a body (m/s²), and by the torque on a body
/// (rad/s²).
pub const MAX_GRAVITY: f32 = 1e9;
/// Largest rate of damping (1/s).
pub const MAX_DAMPING: f32 = 1e9;

/// Whether every coordinate of a point is at most [`MAX_LENGTH`] in size; false for NaN.
pub(super) fn is_place(point: Vec3) -> bool {
    is_within(point, MAX_LENGTH)
}

/// Whether every component is at most `most` in size; false for NaN.
pub(super) fn is_within(x: Vec3, most: f32) -> bool {
    x.abs().cmple(Vec3::splat(most)).all()
}

/// Whether a quaternion is near unit length.
pub(super) fn is_rotation(q: Quat) -> bool {
    (squared_length(q).sqrt() - 1.0).abs() <= 1e-3
}

/// Refuses a point out of range.
pub(super) fn check_place(name: &str, point: Vec3) -> Result<()> {
    ensure(is_place(point), || format!("{name} = {point}: must be at most {MAX_LENGTH:e} m in size"))
}

/// Refuses a quaternion that is not a rotation.
pub(super) fn check_rotation(name: &str, q: Quat) -> Result<()> {
    ensure(is_rotation(q), || format!("{name} = {q}: must have unit length"))
}
