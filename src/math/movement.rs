//! Displacement of contact points along the normal. Twin of `normal_movement` and its use in `current_separation`, in
//! `shaders/lib/contact.wgsl`.

use super::{Lane, Quat, Vec3, conjugate, dot3, turned};

/// Displacement of two bodies along a normal: a separation is linear in the arms.
///
/// If body b rotates by q, its arm r moves by n . (q r - r) = (q⁻¹ n - n) . r along the normal n.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalMovement<L> {
    /// Displacement of the center of b relative to that of a.
    shift: L,
    /// Displacement per length of an arm of a.
    turn_a: Vec3<L>,
    /// Displacement per length of an arm of b.
    turn_b: Vec3<L>,
}

impl<L: Lane> NormalMovement<L> {
    /// Along `normal`, if the center of b moved by `drift` relative to that of a and each body rotated.
    #[inline(always)]
    pub fn new(normal: Vec3<L>, drift: Vec3<L>, turn_a: Quat<L>, turn_b: Quat<L>) -> Self {
        let shift = dot3(drift, normal);
        Self { shift, turn_a: turned(conjugate(turn_a), normal), turn_b: turned(conjugate(turn_b), normal) }
    }

    /// The same for surfaces with these radii of curvature: a round surface turns under its contact, so the center of
    /// its curvature moves with the body.
    #[inline(always)]
    pub fn round(self, normal: Vec3<L>, radius_a: L, radius_b: L) -> Self {
        let shift = self.shift + radius_a * dot3(self.turn_a, normal) + radius_b * dot3(self.turn_b, normal);
        Self { shift, ..self }
    }

    /// Displacement of the arm r_b of b away from the arm r_a of a.
    #[inline(always)]
    pub fn between(&self, r_a: Vec3<L>, r_b: Vec3<L>) -> L {
        self.shift + (dot3(self.turn_b, r_b) - dot3(self.turn_a, r_a))
    }
}
