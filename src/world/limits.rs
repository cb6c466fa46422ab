//! Ranges of the numbers of a world.

use glam::{Quat, Vec3};

use crate::error::{Result, ensure};
use crate::math::rotation::squared_length;

/// Largest coordinate and size (m): its cube is still a number in single precision.
pub const MOST_LENGTH: f32 = 1e9;
/// Largest speed that a caller gives (m/s), (rad/s).
pub const MOST_SPEED: f32 = 1e9;
/// Largest acceleration along an axis, of gravity (m/s²) and by the force (m/s²) and the torque (rad/s²) on a body.
pub const MOST_GRAVITY: f32 = 1e9;
/// Largest rate of damping (1/s).
pub const MOST_DAMPING: f32 = 1e9;

/// Whether every coordinate of a point is a number of at most [`MOST_LENGTH`].
pub(super) fn is_place(point: Vec3) -> bool {
    is_within(point, MOST_LENGTH)
}

/// Whether every component is a number of at most `most` in size.
pub(super) fn is_within(x: Vec3, most: f32) -> bool {
    x.abs().cmple(Vec3::splat(most)).all()
}

/// Whether a quaternion is near unit length.
pub(super) fn is_rotation(q: Quat) -> bool {
    (squared_length(q).sqrt() - 1.0).abs() <= 1e-3
}

/// Refuses a point that is no place.
pub(super) fn check_place(name: &str, point: Vec3) -> Result<()> {
    ensure(is_place(point), || format!("{name} = {point}: must be at most {MOST_LENGTH:e} m in size"))
}

/// Refuses a quaternion that is no rotation.
pub(super) fn check_rotation(name: &str, q: Quat) -> Result<()> {
    ensure(is_rotation(q), || format!("{name} = {q}: must have unit length"))
}
