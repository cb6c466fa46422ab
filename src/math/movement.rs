//! How what touches moves along its normal. Double of `normal_movement` and of what `current_separation` makes of it, in
//! `shaders/lib/contact.wgsl`.

use super::{Lane, Quat, Vec3, conjugate, dot3, turned};

/// How two bodies moved along a normal: a separation is linear in the arms.
///
/// Where body b is rotated by q, its arm r moves by n . (q r - r) = (q⁻¹ n - n) . r along the normal n.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalMovement<L> {
    /// Of the centre of b relative to that of a.
    shift: L,
    /// Of an arm of a, per length.
    turn_a: Vec3<L>,
    /// Of an arm of b, per length.
    turn_b: Vec3<L>,
}

impl<L: Lane> NormalMovement<L> {
    /// Along `normal`, where the centre of b moved by `drift` as seen from that of a and each body turned.
    #[inline(always)]
    pub fn new(normal: Vec3<L>, drift: Vec3<L>, turn_a: Quat<L>, turn_b: Quat<L>) -> Self {
        let shift = dot3(drift, normal);
        Self { shift, turn_a: turned(conjugate(turn_a), normal), turn_b: turned(conjugate(turn_b), normal) }
    }

    /// The same for surfaces with these radii of curvature: a round surface turns under its contact, and what is carried
    /// along is the centre of its curvature.
    #[inline(always)]
    pub fn round(self, normal: Vec3<L>, radius_a: L, radius_b: L) -> Self {
        let shift = self.shift + radius_a * dot3(self.turn_a, normal) + radius_b * dot3(self.turn_b, normal);
        Self { shift, ..self }
    }

    /// How far the arm r_b of b moved away from the arm r_a of a.
    #[inline(always)]
    pub fn between(&self, r_a: Vec3<L>, r_b: Vec3<L>) -> L {
        self.shift + (dot3(self.turn_b, r_b) - dot3(self.turn_a, r_a))
    }
}
