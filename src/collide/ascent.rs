//! Finds the direction along which two solids are furthest apart, with a shrinking ellipse around that direction.
//!
//! Directions near a given one are points of the plane across it. Let w range over all vectors from a point of one
//! solid to a point of the other. The least of w · d is concave on that plane, so the vector between the furthest
//! points halves the ellipse at each direction.

use glam::{Mat2, Vec2, Vec3};

/// Tangent of the largest angle between the first direction and the tested ones.
const REACH: f32 = 1.0;
/// Largest number of tested directions. Each one reduces the area of the ellipse to 0.77 of its value.
const MOST: u32 = 80;

/// The direction near `start` along which two solids are furthest apart, and their distance (m), with an error of
/// `exact`. `gap` returns the vector from the support point of the first solid in a direction to the support point of
/// the second in the opposite direction.
pub(super) fn ascend(start: Vec3, exact: f32, gap: impl Fn(Vec3) -> Vec3) -> (f32, Vec3) {
    let (across, along) = start.any_orthonormal_pair();
    let (mut center, mut ellipse) = (Vec2::ZERO, Mat2::from_diagonal(Vec2::splat(REACH * REACH)));
    let mut best = (f32::NEG_INFINITY, start);
    for _ in 0..MOST {
        let d = start + center.x * across + center.y * along;
        let (length, d) = (d.length(), d.normalize());
        let w = gap(d);
        let distance = w.dot(d);
        if distance > best.0 {
            best = (distance, d);
        }
        let rise = w - distance * d;
        let rise = Vec2::new(rise.dot(across), rise.dot(along));
        let turn = ellipse * rise;
        // Upper bound of the gain within the ellipse.
        let most = rise.dot(turn).max(0.0).sqrt();
        if most <= exact * length {
            break;
        }
        let step = turn / most;
        center += step / 3.0;
        let outer = Mat2::from_cols(step * step.x, step * step.y);
        ellipse = (ellipse - outer * (2.0 / 3.0)) * (4.0 / 3.0);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two segments that cross, with 1 cm between them: a ridge.
    #[test]
    fn the_direction_across_two_edges_is_found_from_far_off() {
        let gap = |d: Vec3| {
            let end = |axis: Vec3| axis.dot(d).signum() * axis;
            0.01 * Vec3::Y - end(Vec3::X) - end(Vec3::Z)
        };
        for start in [Vec3::new(0.3, 1.0, -0.4), Vec3::new(-0.5, 1.0, 0.5), Vec3::Y] {
            let (distance, d) = ascend(start.normalize(), 1e-5, gap);
            assert!((distance - 0.01).abs() < 2e-5 && d.distance(Vec3::Y) < 1e-3, "{distance} m along {d}");
        }
    }
}
