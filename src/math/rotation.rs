//! Products, lengths and angles of rotations in a fixed order, and sines of angles with the same bits on every
//! platform.
//!
//! glam multiplies and normalizes quaternions in a different order on each instruction set (SSE2, NEON, simd128, none),
//! and uses the platform's sine. A step and all its inputs use these functions instead. glam's product of a rotation
//! and a vector has only one order.

use glam::{Quat, Vec3};

use super::{Lane, Quat as Rotation, vec3};

/// b first, then a: the sum of two pairs of terms. The order is that of glam with SSE2.
#[inline(always)]
pub fn paired_product<L: Lane>(a: Rotation<L>, b: Rotation<L>) -> Rotation<L> {
    let (p, q) = (a.axis, b.axis);
    Rotation {
        axis: vec3(
            (p.x * b.w + a.w * q.x) + (p.y * q.z - p.z * q.y),
            (a.w * q.y - p.x * q.z) + (p.z * q.x + p.y * b.w),
            (p.x * q.y + a.w * q.z) + (p.z * b.w - p.y * q.x),
        ),
        w: (a.w * b.w - p.x * q.x) + (-(p.z * q.z) - p.y * q.y),
    }
}

/// `second` first, then `first`, like `first * second`.
#[inline]
pub fn product(first: Quat, second: Quat) -> Quat {
    let [a, b] = [first, second].map(|q| Rotation::<f32>::load(q.to_array()));
    Quat::from_array(paired_product(a, b).store())
}

/// The squared length of a quaternion.
#[inline]
pub fn squared_length(q: Quat) -> f32 {
    (q.x * q.x + q.z * q.z) + (q.y * q.y + q.w * q.w)
}

/// The quaternion at unit length; NaN for a zero quaternion.
#[inline]
pub fn unit(q: Quat) -> Quat {
    let length = squared_length(q).sqrt();
    Quat::from_array(q.to_array().map(|x| x / length))
}

/// The shortest rotation from one unit vector to another.
pub fn arc(from: Vec3, to: Vec3) -> Quat {
    const NEARLY: f32 = 1.0 - 2.0 * f32::EPSILON;
    let cosine = from.dot(to);
    if cosine > NEARLY {
        return Quat::IDENTITY;
    }
    if cosine < -NEARLY {
        return about(from.any_orthonormal_vector(), std::f32::consts::PI);
    }
    let axis = from.cross(to);
    unit(Quat::from_xyzw(axis.x, axis.y, axis.z, 1.0 + cosine))
}

/// The rotation vector: axis times angle (rad).
pub fn vector_of(q: Quat) -> Vec3 {
    let axis = q.xyz();
    let length = axis.length();
    if length < 1e-8 { Vec3::ZERO } else { axis / length * (2.0 * libm::atan2f(length, q.w)) }
}

/// The rotation by an angle (rad) about a coordinate axis or another unit vector.
pub fn about(axis: Vec3, angle: f32) -> Quat {
    let (sine, cosine) = libm::sincosf(0.5 * angle);
    let v = axis * sine;
    Quat::from_xyzw(v.x, v.y, v.z, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    fn random_rotations() -> impl Iterator<Item = Quat> {
        let mut random = SplitMix64::new(16);
        std::iter::repeat_with(move || {
            let numbers = [0; 4].map(|_| random.symmetric() as f32);
            unit(Quat::from_array(numbers))
        })
    }

    #[test]
    fn a_unit_quaternion_has_unit_length_and_its_direction() {
        for q in random_rotations().take(1000) {
            let longer = unit(Quat::from_array(q.to_array().map(|x| 3.7 * x)));
            assert!((squared_length(longer) - 1.0).abs() < 3e-7 && longer.dot(q) > 1.0 - 3e-7, "{q}");
        }
    }

    #[test]
    fn the_functions_agree_with_those_of_glam() {
        let rotations: Vec<Quat> = random_rotations().take(1000).collect();
        let near = |a: Quat, b: Quat| a.to_array().into_iter().zip(b.to_array()).all(|(x, y)| (x - y).abs() < 1e-6);
        for two in rotations.windows(2) {
            assert!(near(product(two[0], two[1]), two[0] * two[1]), "{two:?}");
            let [from, to] = [two[0] * Vec3::X, two[1] * Vec3::X].map(Vec3::normalize);
            assert!(near(arc(from, to), Quat::from_rotation_arc(from, to)), "{from} {to}");
            assert!((vector_of(two[0]) - two[0].to_scaled_axis()).length() < 1e-5, "{two:?}");
        }
        for k in -40_i8..40 {
            let angle = 0.17 * f32::from(k);
            assert!(near(about(Vec3::Z, angle), Quat::from_rotation_z(angle)), "{angle}");
        }
        assert_eq!(vector_of(Quat::IDENTITY), Vec3::ZERO);
        assert!((arc(Vec3::X, Vec3::NEG_X) * Vec3::X + Vec3::X).length() < 1e-6);
    }

    /// Steps of earlier versions had these orders; their bits stay the same.
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    #[test]
    fn the_order_is_that_of_glam_with_sse2() {
        let rotations: Vec<Quat> = random_rotations().take(1000).collect();
        for two in rotations.windows(2) {
            assert_eq!(product(two[0], two[1]), two[0] * two[1]);
            let longer = Quat::from_array(two[0].to_array().map(|x| 1.3 * x));
            assert_eq!((unit(longer), squared_length(longer)), (longer.normalize(), longer.length_squared()));
        }
    }
}
