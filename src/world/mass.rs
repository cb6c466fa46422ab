//! Mass, center of mass and inertia.

use std::ops::RangeInclusive;

use glam::{Mat3, Quat, Vec3};
use parry3d::mass_properties::MassProperties as ParryMass;

use super::limits::{is_place, is_rotation};
use crate::error::{Result, ensure};

/// Mass, center of mass and inertia of a body, in its own frame. All zero for a body that cannot be pushed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass (kg).
    pub mass: f32,
    /// Centre of mass in the body's frame (m).
    pub center: Vec3,
    /// Moments of inertia about the principal axes (kg m²).
    pub principal_inertia: Vec3,
    /// Rotation from the principal axes to the body's frame.
    pub principal_frame: Quat,
}

impl MassProperties {
    /// Infinite mass.
    pub const IMMOVABLE: Self =
        Self { mass: 0.0, center: Vec3::ZERO, principal_inertia: Vec3::ZERO, principal_frame: Quat::IDENTITY };

    /// Masses that can be simulated (kg): squares of impulses and of inverse masses stay numbers in single precision.
    pub const MASSES: RangeInclusive<f32> = 1e-15..=1e15;
    /// Moments of inertia that can be simulated (kg m²).
    pub const MOMENTS: RangeInclusive<f32> = 1e-30..=1e30;
    /// Largest ratio of two moments of a body; that of a rod is a sixth of the square of its length over its radius.
    pub const MOST_RATIO: f32 = 1e12;

    /// Refuses a mass or an inertia that no dynamic body can have.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_frame()?;
        let Self { mass, principal_inertia, .. } = *self;
        let moments = principal_inertia.to_array();
        let fits = Self::MASSES.contains(&mass)
            && moments.iter().all(|i| Self::MOMENTS.contains(i))
            && principal_inertia.max_element() <= Self::MOST_RATIO * principal_inertia.min_element();
        ensure(fits, || {
            format!(
                "mass = {mass:e} kg, inertia = {moments:?} kg m²: must be 1e-15 to 1e15 kg, 1e-30 to 1e30 kg m² and moments within \
                 1e12 of each other"
            )
        })
    }

    /// Refuses a center out of range, and a frame that is no rotation.
    pub(super) fn check_frame(&self) -> Result<()> {
        let Self { center, principal_frame, .. } = *self;
        let message = || {
            format!("center of mass = {center}, principal frame = {principal_frame}: must be a place and a rotation")
        };
        ensure(is_place(center) && is_rotation(principal_frame), message)
    }

    /// Parry keeps inverses: taken at density 1 and scaled here, a box of 1 m³ weighs its density to the last bit.
    pub(super) fn from_parry(m: &ParryMass, density: f32) -> Self {
        Self {
            mass: m.mass() * density,
            center: m.local_com,
            principal_inertia: m.principal_inertia() * density,
            principal_frame: m.principal_inertia_local_frame,
        }
    }

    /// Inverse inertia about the center of mass in world axes, for a body with rotation `rotation` (1/(kg m²)).
    pub fn world_inverse_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia.map(|i| if i > 0.0 { 1.0 / i } else { 0.0 }))
    }

    /// Inertia about the center of mass in world axes (kg m²).
    pub fn world_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia)
    }

    fn world_tensor(&self, rotation: Quat, principal: Vec3) -> Mat3 {
        // Turning an isotropic tensor only adds rounding.
        if principal.x == principal.y && principal.y == principal.z {
            return Mat3::from_diagonal(principal);
        }
        let axes = Mat3::from_quat(rotation * self.principal_frame);
        axes * Mat3::from_diagonal(principal) * axes.transpose()
    }

    /// Whether the moments differ, so that a free rotation changes its axis (gyroscopic term).
    pub fn is_anisotropic(&self) -> bool {
        let i = self.principal_inertia;
        i.max_element() - i.min_element() > 1e-6 * i.max_element()
    }
}
