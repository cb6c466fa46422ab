//! Vectors and rotations of sixteen pairs side by side. The order of operations is that of one pair, so the bits are
//! the same.

use crate::lanes::Lanes;
pub(super) use crate::math::rotation::paired_product as product;
use crate::math::{Quat, Vec3, dot3, vec3};

/// A pose of each pair.
#[derive(Clone, Copy)]
pub(super) struct Pose<L> {
    pub rotation: Quat<L>,
    pub at: Vec3<L>,
}

impl<L: Lanes> Pose<L> {
    /// From columns: x, y, z, w of the rotation, then the position.
    #[inline(always)]
    pub fn of(c: [L; 8]) -> Self {
        Self { rotation: Quat { axis: vec3(c[0], c[1], c[2]), w: c[3] }, at: vec3(c[4], c[5], c[6]) }
    }

    /// First `other`, then `self`.
    #[inline(always)]
    pub fn after(self, other: Self) -> Self {
        Self {
            rotation: product(self.rotation, other.rotation),
            at: self.at + Turn::of(self.rotation).of_vector(other.at),
        }
    }

    /// `other` in the frame of `self`.
    #[inline(always)]
    pub fn sees(self, other: Self) -> Self {
        let back = backwards(self.rotation);
        Self { at: Turn::of(back).of_vector(other.at - self.at), rotation: product(back, other.rotation) }
    }

    /// The inverse pose.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let back = backwards(self.rotation);
        Self { at: Turn::of(back).of_vector(negative(self.at)), rotation: back }
    }
}

/// A rotation in the form that transforms vectors.
#[derive(Clone, Copy)]
pub(super) struct Turn<L> {
    axis: Vec3<L>,
    along: L,
    across: L,
}

impl<L: Lanes> Turn<L> {
    #[inline(always)]
    pub fn of(q: Quat<L>) -> Self {
        let square = dot3(q.axis, q.axis);
        Self { axis: q.axis, along: q.w * q.w - square, across: q.w * L::constant(2.0) }
    }

    #[inline(always)]
    pub fn of_vector(self, v: Vec3<L>) -> Vec3<L> {
        let (b, twice) = (self.axis, dot3(v, self.axis) * L::constant(2.0));
        v * self.along + b * twice + crate::math::cross3(b, v) * self.across
    }
}

#[inline(always)]
pub(super) fn backwards<L: Lanes>(q: Quat<L>) -> Quat<L> {
    Quat { axis: negative(q.axis), w: q.w }
}

#[inline(always)]
pub(super) fn negative<L: Lanes>(v: Vec3<L>) -> Vec3<L> {
    vec3(-v.x, -v.y, -v.z)
}

#[inline(always)]
pub(super) fn length<L: Lanes>(v: Vec3<L>) -> L {
    dot3(v, v).sqrt()
}

#[inline(always)]
pub(super) fn magnitude<L: Lanes>(x: L) -> L {
    x.with_sign(L::constant(1.0))
}

/// The corner of a cuboid that is furthest in a direction.
#[inline(always)]
pub(super) fn corner<L: Lanes>(half: Vec3<L>, direction: Vec3<L>) -> Vec3<L> {
    vec3(half.x.with_sign(direction.x), half.y.with_sign(direction.y), half.z.with_sign(direction.z))
}
