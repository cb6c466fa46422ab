//! Changes of the rows of contacts since the step before, for a backend that keeps the rows on a device.
//!
//! The rows of a step stay on the device, with their impulses and preloads. The host sends only the manifolds that it
//! computed since, the former points of their impulses, and the present separations of all contacts. The device
//! computes the rows from them. The host computes the same rows, so that nothing is lost with the device.

use bytemuck::{Pod, Zeroable};

use crate::constants::LARGEST_PRELOAD;
use crate::math::{Lane, smaller};

/// The changes since the last step, for a backend that has the rows of that step.
#[derive(Debug, Default, PartialEq)]
pub struct Carry {
    /// Whether the device continues from the rows of the step before. If not, the other fields mean nothing. The
    /// problem is complete either way, so a backend without these rows can run the step.
    pub on_device: bool,
    /// The contacts whose rows were written again since, in ascending order.
    pub written: Vec<Written>,
    /// Whether relative accelerations and slips of reused points also follow the bodies, besides their separations.
    pub pull_or_slip: bool,
    /// Whether points have surface velocities, patches resist rolling, or bodies have locked translations. The device
    /// cannot compute such rows.
    pub surfaces: bool,
    /// Whether friction at points has two directions.
    pub tangents: bool,
    /// The coefficients of the preloads.
    pub preload: Preload,
}

crate::saved::cloned!(Carry { on_device, written, pull_or_slip, surfaces, tangents, preload });

impl Carry {
    /// Whether the host sends all points in each step, since the device cannot compute them.
    pub fn sends_points(&self) -> bool {
        self.pull_or_slip || self.surfaces
    }
}

/// A contact whose rows were written again, 8 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Written {
    /// Its row.
    pub row: u32,
    /// For each point, the index that it had in the row before, or `NO_POINT` for a new point; [`Written::NEW`] if
    /// the row begins without impulses.
    pub points_before: [u8; 4],
}

/// The index of a new point.
pub const NO_POINT: u8 = 4;

impl Written {
    /// The points of a row that begins without impulses and preload.
    pub const NEW: [u8; 4] = [u8::MAX; 4];
}

/// The coefficients of the preloads of a step, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Preload {
    /// Ratio of the overlap at rest to the impulse of a substep, times the effective mass, for contacts between movable
    /// bodies (s).
    pub movable_compliance: f32,
    /// The same for contacts with bodies that cannot move (s).
    pub fixed_compliance: f32,
    /// Share of the missing preload that is added in this step.
    pub share: f32,
    /// 1 if impulses are carried over, 0 if every step begins without them.
    pub warm_start: u32,
}

impl Preload {
    /// Compression of the springs of a contact at rest under the normal impulses `pressed`, times their effective mass
    /// (kg m). `both_movable`: both bodies can move. `share` is the length of the contact's substeps over that of class
    /// 0. Twin of the function of the same name in `shaders/resident/begin_contacts.wgsl`.
    #[inline(always)]
    pub(crate) fn yielding<L: Lane>(&self, share: L, both_movable: L::Mask, pressed: L) -> L {
        let [movable, fixed] = [self.movable_compliance, self.fixed_compliance].map(|c| L::constant(c.into()));
        // The stiffness falls with the square of the length of a substep, and impulses grow with the length.
        pressed * (L::select(fixed, movable, both_movable) * share)
    }
}

/// The new preload of a contact that had the preload `before`, when its load compresses its springs by `sag`. Twin of
/// the function of the same name in `shaders/resident/begin_contacts.wgsl`.
///
/// The contact treats its surfaces as thicker by the preload. The preload grows step by step until the overlap
/// vanishes, while the springs stay soft against everything fast. This is the method of multipliers with one multiplier
/// for each manifold; one for each point makes towers rock.
#[inline(always)]
pub(super) fn preloaded<L: Lane>(by: &Preload, before: L, sag: L) -> L {
    // The preload ends with the load.
    smaller(before + L::constant(by.share.into()) * (sag - before), L::constant(LARGEST_PRELOAD) * sag)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BY: Preload = Preload { movable_compliance: 0.5, fixed_compliance: 0.25, share: 0.5, warm_start: 1 };

    /// The overlap of parallel springs.
    fn sag(share: f32, both_movable: bool, pressed: f32, mass: f32) -> f32 {
        BY.yielding(share, both_movable, pressed) / mass
    }

    fn near(x: f32, y: f32) {
        assert!((x - y).abs() < 1e-6, "{x}, not {y}");
    }

    /// An impulse of 8 N s on 2 kg sags by 8 / 2 times the compliance.
    #[test]
    fn a_preload_takes_its_share_of_what_is_missing_to_the_overlap_of_what_is_borne() {
        near(preloaded(&BY, 0.0, sag(1.0, true, 8.0, 2.0)), 1.0);
        near(preloaded(&BY, 1.0, sag(1.0, true, 8.0, 2.0)), 1.5);
        near(preloaded(&BY, 0.0, sag(1.0, false, 8.0, 2.0)), 0.5);
        near(preloaded(&BY, 3.0, sag(1.0, true, 8.0, 2.0)), 2.5);
    }

    #[test]
    fn half_a_substep_makes_a_quarter_of_the_sag() {
        assert_eq!(4.0 * sag(0.5, true, 4.0, 2.0), sag(1.0, true, 8.0, 2.0));
    }

    #[test]
    fn a_preload_is_at_most_twice_the_overlap_of_what_is_borne() {
        near(preloaded(&BY, 100.0, sag(1.0, true, 8.0, 2.0)), 4.0);
        near(preloaded(&BY, 100.0, sag(1.0, false, 8.0, 2.0)), 2.0);
        near(preloaded(&BY, 100.0, sag(1.0, true, 0.0, 2.0)), 0.0);
    }
}
