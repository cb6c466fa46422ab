//! How hard a constraint is to move: entries of S = G M⁻¹ Gᵀ at one contact point. Derivation: docs/derivation.md.

use std::ops::Div;

use glam::{Mat3, Vec2, Vec3};

use super::rows::{ContactRow, MassRow};
use crate::math::Scalar;

/// Friction up to which no solid of even density jams. A point at the lever r from the center of such a solid has m r²/I <= 15, and friction
/// below 2/√14 jams no point with that (docs/derivation.md, section 6).
pub const LEAST_JAMMING: f32 = 0.53;

/// Inverse mass (1/kg) and inverse inertia in world axes (1/(kg m²)) of one body.
#[derive(Clone, Copy, Debug)]
pub struct InverseMass {
    /// One over the mass; 0 if nothing moves it.
    pub mass: f32,
    /// Inverse of the inertia about the centre of mass.
    pub inertia: Mat3,
}

impl InverseMass {
    /// From a row.
    pub fn of(row: &MassRow) -> Self {
        let ([xx, xy, xz], [yy, yz, zz]) = (row.inv_inertia_x, row.inv_inertia_yz);
        Self { mass: row.inv_mass, inertia: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]) }
    }

    /// Share of this body in the entry (d, e) of G M⁻¹ Gᵀ at arm `r`.
    fn entry(&self, r: Vec3, d: Vec3, e: Vec3) -> f32 {
        self.mass * d.dot(e) + r.cross(d).dot(self.inertia * r.cross(e))
    }
}

/// The effective masses of the points of one manifold.
#[derive(Clone, Copy, Debug)]
pub struct EffectiveMass<'a> {
    /// Of a and b.
    pub inverse: &'a [InverseMass; 2],
    /// Normal and tangent of the manifold.
    pub row: &'a ContactRow,
}

impl EffectiveMass<'_> {
    /// One over the normal entry at arms `r_a`, `r_b`; 0 if nothing can move.
    pub fn normal(&self, r_a: Vec3, r_b: Vec3) -> f32 {
        let n = Vec3::from_array(self.row.normal);
        inverse_or_zero(self.entry(r_a, r_b, n, n))
    }

    /// One over the largest eigenvalue of the tangential block.
    pub fn tangent(&self, r_a: Vec3, r_b: Vec3) -> f32 {
        let (t_1, t_2) = self.row.tangents();
        let entry = |d, e| self.entry(r_a, r_b, d, e);
        tangent_mass([entry(t_1, t_1), entry(t_2, t_2), entry(t_1, t_2)], f32::sqrt)
    }

    /// One over the entry of the tangential direction `d`.
    pub fn along(&self, r_a: Vec3, r_b: Vec3, d: Vec3) -> f32 {
        inverse_or_zero(self.entry(r_a, r_b, d, d))
    }

    /// One over the inverse inertia about the normal.
    pub fn twist(&self) -> f32 {
        let n = Vec3::from_array(self.row.normal);
        inverse_or_zero(self.inverse.iter().map(|i| n.dot(i.inertia * n)).sum())
    }

    /// The largest change of the normal velocity by friction, for a normal impulse of 1, over that by the impulse itself. Where the ratio is above
    /// 1, friction that slides can press the surfaces together faster than the normal impulse parts them (Painlevé).
    pub fn jamming(&self, r_a: Vec3, r_b: Vec3) -> f32 {
        if self.row.friction <= LEAST_JAMMING {
            return 0.0;
        }
        let n = Vec3::from_array(self.row.normal);
        let (t_1, t_2) = self.row.tangents();
        let [parted, pressed_1, pressed_2] = [n, t_1, t_2].map(|d| self.entry(r_a, r_b, n, d));
        self.row.friction * Vec2::new(pressed_1, pressed_2).length() * inverse_or_zero(parted)
    }

    /// The entry of the directions `d` and `e` at arms `r_a`, `r_b`.
    pub fn entry(&self, r_a: Vec3, r_b: Vec3, d: Vec3, e: Vec3) -> f32 {
        let [a, b] = self.inverse;
        a.entry(r_a, d, e) + b.entry(r_b, d, e)
    }
}

/// One over the largest eigenvalue of the tangential block with the entries s_11, s_22 and s_12; 0 for no block.
pub fn tangent_mass<S: Scalar + Div<Output = S>>([s_11, s_22, s_12]: [S; 3], sqrt: fn(S) -> S) -> S {
    // Squares of a light body's entries would leave single precision.
    let scale = (s_11 + s_22).inverse_power();
    let (s_11, s_22, s_12) = (s_11 * scale, s_22 * scale, s_12 * scale);
    let apart = s_11 - s_22;
    let root = sqrt(apart * apart + S::constant(4.0) * s_12 * s_12);
    scale * inverse_or_zero(S::constant(0.5) * (s_11 + s_22 + root))
}

fn inverse_or_zero<S: Scalar + Div<Output = S>>(x: S) -> S {
    if x > S::default() { S::constant(1.0) / x } else { S::default() }
}
