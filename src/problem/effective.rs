//! Effective masses of constraints: entries of S = G M⁻¹ Gᵀ at one contact point, from rows.
//! `src/math/effective_mass.rs` has the arithmetic. Derivation: docs/derivation.md.

use glam::{Mat3, Vec3};

use super::rows::{ContactRow, MassRow};
use crate::math;
use crate::math::effective_mass::{self, inverse_or_zero, tangent_mass, twist_mass};
use crate::math::effective_mass::{Mass, Sym3};

/// Inverse mass (1/kg) and inverse inertia in world axes (1/(kg m²)) of one body.
#[derive(Clone, Copy, Debug)]
pub struct InverseMass {
    /// Inverse mass; 0 if nothing moves the body.
    pub mass: f32,
    /// The axes along which nothing moves the body: [`MassRow::locks`].
    pub locks: f32,
    /// Inverse of the inertia about the center of mass.
    pub inertia: Mat3,
}

impl InverseMass {
    /// The inverse mass and inertia of a row.
    pub fn of(row: &MassRow) -> Self {
        let ([xx, xy, xz], [yy, yz, zz]) = (row.inv_inertia_x, row.inv_inertia_yz);
        Self {
            mass: row.inv_mass,
            locks: row.locks,
            inertia: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
        }
    }

    /// Inverse mass along a unit vector, which locked axes reduce.
    pub fn along(&self, direction: Vec3) -> f32 {
        if self.locks == 0.0 {
            return self.mass;
        }
        let moved = self.lane().unlocked(math::Vec3::load(direction.to_array()));
        self.mass * math::dot3(moved, moved)
    }

    /// The same in the form of the kernels.
    fn lane(&self) -> Mass<f32> {
        let Mat3 { x_axis: x, y_axis: y, z_axis: z } = self.inertia;
        let inv_inertia = Sym3 { x: math::vec3(x.x, y.x, z.x), yz: math::vec3(y.y, z.y, z.z) };
        Mass { inv_inertia, inv_mass: self.mass, locks: self.locks, ..Mass::default() }
    }
}

/// The effective masses of the points of one manifold.
#[derive(Clone, Copy, Debug)]
pub struct EffectiveMass<'a> {
    /// The inverse masses of a and b.
    pub inverse: &'a [InverseMass; 2],
    /// The row with the normal and tangent of the manifold.
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
        tangent_mass(entry(t_1, t_1), entry(t_2, t_2), entry(t_1, t_2))
    }

    /// One over the entry of the tangential direction `d`.
    pub fn along(&self, r_a: Vec3, r_b: Vec3, d: Vec3) -> f32 {
        inverse_or_zero(self.entry(r_a, r_b, d, d))
    }

    /// One over the sum of the inverse inertias about the normal.
    pub fn twist(&self) -> f32 {
        let n = math::Vec3::load(self.row.normal);
        twist_mass(n, &self.inverse[0].lane(), &self.inverse[1].lane())
    }

    /// One over the largest eigenvalue of the inverse inertias about the tangents.
    pub fn rolling(&self) -> f32 {
        let (t_1, t_2) = self.row.tangents();
        let inertia = self.inverse[0].inertia + self.inverse[1].inertia;
        tangent_mass(t_1.dot(inertia * t_1), t_2.dot(inertia * t_2), t_1.dot(inertia * t_2))
    }

    /// How strongly friction jams a point: `jamming` in `src/math/effective_mass.rs`.
    pub fn jamming(&self, r_a: Vec3, r_b: Vec3) -> f32 {
        let n = Vec3::from_array(self.row.normal);
        let (t_1, t_2) = self.row.tangents();
        let [parted, pressed_1, pressed_2] = [n, t_1, t_2].map(|d| self.entry(r_a, r_b, n, d));
        effective_mass::jamming(self.row.friction, parted, pressed_1, pressed_2)
    }

    /// The entry of the directions `d` and `e` at arms `r_a`, `r_b`.
    pub fn entry(&self, r_a: Vec3, r_b: Vec3, d: Vec3, e: Vec3) -> f32 {
        let [r_a, r_b, d, e] = [r_a, r_b, d, e].map(|v| math::Vec3::load(v.to_array()));
        effective_mass::entry(true, [&self.inverse[0].lane(), &self.inverse[1].lane()], [r_a, r_b], d, e)
    }
}
