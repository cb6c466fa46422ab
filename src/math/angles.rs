//! Angles of the frames of a joint. Twins of `shaders/lib/angles.wgsl`.

use super::{Lane, Quat, Vec3, dot3, larger, reciprocal, select3, vec3};

/// The number of the twist about the first axis, from -pi to pi.
pub const TWIST: usize = 0;
/// The number of the first of the two components of s n, along the second axis and the third.
pub const SWING: usize = 1;
/// The number of the first of twice the components of q along the three axes. q and -q are one rotation; the sign of
/// these depends on it.
pub const HALVES: usize = 3;
/// The number of the first of the heights of the first axis of a above the plane of the first axis of b and the third,
/// and of b and the second.
pub const HEIGHT: usize = 6;
/// How many [`Angles`] has.
pub const COUNT: usize = 8;
/// The number of the first of the angles of the two heights: see [`elevation`].
pub const ELEVATION: usize = COUNT;

/// Coordinates of a rotation q of frame a in frame b, and the directions whose products with the spin of a against b, in
/// frame b, are their rates.
///
/// The rotation is a twist about the first axis, and after it a swing of this axis by the angle s about an axis n across
/// it. Near s = pi the twist and n jump while q moves a little, so a lock on one of them would push without bound. Locks
/// use other coordinates, which are zero in the same places and smooth everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Angles<L> {
    /// Values by their numbers (rad, at least near zero).
    pub values: [L; COUNT],
    /// Directions by the same numbers.
    pub directions: [Vec3<L>; COUNT],
}

/// Least squared cosine of half a swing, and least cosine of half a twist. Beyond that their tangents are constant.
const MIN_COSINE: f64 = 1e-8;
/// The largest squared tangent of half a swing with a direction of the twist across the first axis.
const MAX_TANGENT_SQUARE: f64 = 2e3;
/// The smallest value of s cot(s).
const MIN_COTANGENT: f64 = -30.0;
/// Below this square of a swing (rad²), (1 - s cot(s))/s² is 1/3.
const SMALL_SWING: f64 = 1e-6;

impl<L: Lane> Angles<L> {
    /// The coordinates of a unit quaternion.
    #[inline(always)]
    pub fn of(q: Quat<L>) -> Self {
        let (zero, one, two) = (L::constant(0.0), L::constant(1.0), L::constant(2.0));
        let (Vec3 { x, y, z }, w) = (q.axis, q.w);
        let sign = L::select(one, L::constant(-1.0), zero.gt(w));
        let tangent = x * sign * reciprocal(larger(w * sign, L::constant(MIN_COSINE)));
        let twist = tangent * arc_over_tangent(tangent * tangent) * two;

        // n tan(s/2), where q is a swing after a twist.
        let (across_y, across_z) = (w * y - x * z, w * z + x * y);
        let per_cosine = reciprocal(larger(w * w + x * x, L::constant(MIN_COSINE)));
        let (t_y, t_z) = (across_y * per_cosine, across_z * per_cosine);
        let square = t_y * t_y + t_z * t_z;
        let per_tangent = arc_over_tangent(square) * two;
        let (a, b) = (t_y * per_tangent, t_z * per_tangent);
        let across = larger(per_tangent * (one - square) * L::constant(0.5), L::constant(MIN_COTANGENT));
        let squared_angle = a * a + b * b;
        let curved = (one - across) * reciprocal(squared_angle);
        let bend = L::select(L::constant(1.0 / 3.0), curved, squared_angle.gt(L::constant(SMALL_SWING)));
        let has_twist = L::constant(MAX_TANGENT_SQUARE).gt(square);

        // The first axis of a, in frame b.
        let first = vec3(one - (y * y + z * z) * two, across_z * two, -(across_y * two));
        Self {
            values: [twist, a, b, x * two, y * two, z * two, across_y * two, across_z * two],
            directions: [
                vec3(one, L::select(zero, t_z, has_twist), L::select(zero, -t_y, has_twist)),
                vec3(-b, across + a * a * bend, a * b * bend),
                vec3(a, a * b * bend, across + b * b * bend),
                vec3(w, z, -y),
                vec3(-z, w, x),
                vec3(y, -x, w),
                vec3(-first.y, first.x, zero),
                vec3(-first.z, zero, first.x),
            ],
        }
    }
}

/// The angle of a height, from -pi/2 to pi/2, and the direction of its rate, from the direction of the height. At a pole
/// the direction is `axis`.
#[inline(always)]
pub fn elevation<L: Lane>(height: L, direction: Vec3<L>, axis: Vec3<L>) -> (L, Vec3<L>) {
    // The direction of a height is as long as the cosine of its angle.
    let square = dot3(direction, direction);
    let least = L::constant(MIN_COSINE);
    let inverse = larger(square, least).inverse_sqrt();
    let tangent = height * inverse;
    (tangent * arc_over_tangent(tangent * tangent), select3(axis, direction * inverse, square.gt(least)))
}

/// atan(t)/t from the square of t, to 4e-7.
#[inline(always)]
fn arc_over_tangent<L: Lane>(square: L) -> L {
    const SERIES: [f64; 7] =
        [-6.343974e-3, 2.9852263e-2, -6.6890806e-2, 0.10394262, -0.1417643, 0.19993468, -0.33333267];
    let one = L::constant(1.0);
    let inverse = square.inverse_sqrt();
    let is_steep = square.gt(one);
    let v = L::select(square, inverse * inverse, is_steep);
    let mut sum = L::constant(SERIES[0]);
    for &term in &SERIES[1..] {
        sum = sum * v + L::constant(term);
    }
    let arc = sum * v + one;
    L::select(arc, (L::constant(std::f64::consts::FRAC_PI_2) - inverse * arc) * inverse, is_steep)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation(swing: [f64; 2], twist: f64) -> glam::DQuat {
        glam::DQuat::from_scaled_axis(glam::DVec3::new(0.0, swing[0], swing[1])) * glam::DQuat::from_rotation_x(twist)
    }

    fn lane(q: glam::DQuat) -> Quat<f64> {
        Quat { axis: vec3(q.x, q.y, q.z), w: q.w }
    }

    #[test]
    fn twist_and_swing_are_those_that_a_rotation_is_made_of() {
        for (swing, twist) in [([0.3, -0.2], 0.4), ([0.0; 2], -3.0), ([-1.0, 0.5], 2.0), ([2.0, 2.3], -1.0)] {
            for q in [rotation(swing, twist), -rotation(swing, twist)] {
                let [found, y, z, ..] = Angles::of(lane(q)).values;
                let off = [found - twist, y - swing[0], z - swing[1]];
                assert!(off.iter().all(|off| off.abs() < 2e-6), "{swing:?} {twist}: {off:?}");
            }
        }
    }

    #[test]
    fn the_elevation_of_an_axis_is_its_angle_above_a_plane() {
        for (y, z, twist) in [(0.3, -0.2, 0.4), (2.8, 0.4, -1.0), (-3.1, -0.6, 2.0), (0.5, 1.57, 0.0)] {
            let q =
                glam::DQuat::from_rotation_y(y) * glam::DQuat::from_rotation_z(z) * glam::DQuat::from_rotation_x(twist);
            let Angles { values, directions } = Angles::of(lane(q));
            let (found, d) = elevation(values[HEIGHT + 1], directions[HEIGHT + 1], vec3(0.0, 0.0, 1.0));
            assert!((found - z).abs() < 1e-4, "{y} {z}: {found}");
            assert!((dot3(d, d) - 1.0).abs() < 1e-6 && (d.y * d.y) < 1e-9, "{y} {z}: {d:?}");
        }
    }

    /// The check compares directions with the changes of the values across two small rotations, for all coordinates.
    #[test]
    fn directions_are_the_changes_of_the_values() {
        let swings = [[0.0, 0.0], [0.3, -0.2], [-1.0, 1.5], [2.0, -2.0], [3.0, 0.4], [-0.6, 2.8]];
        for (swing, twist) in swings.into_iter().zip([0.5, -0.1, 1.0, -2.0, 0.2, 0.0]) {
            let q = rotation(swing, twist);
            let directions = Angles::of(lane(q)).directions;
            for spin in [glam::DVec3::X, glam::DVec3::Y, glam::DVec3::Z] {
                let at = |turn: f64| Angles::of(lane(glam::DQuat::from_scaled_axis(spin * turn) * q)).values;
                for (i, (after, before)) in at(1e-3).into_iter().zip(at(-1e-3)).enumerate() {
                    let d = directions[i];
                    let (rate, expected) = (glam::DVec3::new(d.x, d.y, d.z).dot(spin), (after - before) / 2e-3);
                    assert!((rate - expected).abs() < 1e-3 * (1.0 + rate.abs()), "{swing:?} {i}: {rate} {expected}");
                }
            }
        }
    }
}
