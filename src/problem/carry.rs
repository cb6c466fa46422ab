//! How the rows of contacts follow from those of the step before, for a backend that keeps them on a device.
//!
//! The rows that a step leaves behind stay where they are, impulses and preloads with them, and nothing of that travels. Only manifolds
//! that were computed since are sent, with the points that their impulses belonged to, and how far the surfaces of all are apart now. The
//! device computes the rows from them. The host computes the same rows, so that nothing is lost with the device.

use bytemuck::{Pod, Zeroable};

use crate::math::{Lane, smaller};

/// The changes since the last step, for a backend that has the rows of that step.
#[derive(Debug, Default, PartialEq)]
pub struct Carry {
    /// Whether the device goes on from the rows of the step before. Else nothing else here counts. The problem is complete either way, so
    /// that a backend without these rows can run the step instead.
    pub on_device: bool,
    /// The contacts whose rows were written again since, ascending.
    pub written: Vec<Written>,
    /// Whether more than the separations of reused points follows the bodies: the velocity of an approach, the slip.
    pub approach: bool,
    /// Whether friction at points has two directions.
    pub tangents: bool,
    /// The coefficients of the preloads.
    pub preload: Preload,
}

crate::saved::cloned!(Carry { on_device, written, approach, tangents, preload });

/// A contact whose rows were written again, 8 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Written {
    /// Its row.
    pub row: u32,
    /// Which of the points that the row had each point is, [`NO_POINT`] for none; [`Written::NEW`] if the row begins without impulses.
    pub points_before: [u8; 4],
}

/// A point that is new.
pub const NO_POINT: u8 = 4;

impl Written {
    /// The points of a row that begins without impulses and preload.
    pub const NEW: [u8; 4] = [u8::MAX; 4];
}

/// The coefficients of the preloads of a step, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Preload {
    /// Overlap at rest per impulse of a substep, times the effective mass, of contacts between bodies that can move (s).
    pub movable_compliance: f32,
    /// The same of contacts with bodies that cannot (s).
    pub fixed_compliance: f32,
    /// Share of what is missing that preloads gain in this step.
    pub share: f32,
    /// 1 if impulses are carried over, 0 if every step begins without.
    pub warm_start: u32,
}

/// Most that a contact is preloaded, relative to the overlap at rest of what it bears.
pub(super) const LARGEST_PRELOAD: f64 = 2.0;

impl Preload {
    /// How deep the springs of a contact are compressed at rest by the normal impulses `pressed`, times the mass that they feel (kg m). The
    /// contact is one of two bodies that can move, or of one that cannot with one that can; the length of its substeps over that of
    /// class 0 is `share`. Double of the function of the same name in `shaders/resident/begin_contacts.wgsl`.
    #[inline(always)]
    pub(crate) fn yielding<L: Lane>(&self, share: L, both_movable: L::Mask, pressed: L) -> L {
        let [movable, fixed] = [self.movable_compliance, self.fixed_compliance].map(|c| L::constant(c.into()));
        // The stiffness falls with the square of the length of a substep, and impulses grow with the length.
        pressed * (L::select(fixed, movable, both_movable) * share)
    }
}

/// How much a contact is preloaded that was so by `before`, when what it bears compresses its springs by `sag`. Double of the function of
/// the same name in `shaders/resident/begin_contacts.wgsl`.
///
/// That much its surfaces are taken to be thicker, little by little, so that the overlap vanishes while the springs stay as soft as they
/// are for everything that is fast: the method of multipliers, with a multiplier for each manifold. One for each point rocks towers.
#[inline(always)]
pub(super) fn preloaded<L: Lane>(by: &Preload, before: L, sag: L) -> L {
    // Where the load ends, the preload ends too.
    smaller(before + L::constant(by.share.into()) * (sag - before), L::constant(LARGEST_PRELOAD) * sag)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BY: Preload = Preload { movable_compliance: 0.5, fixed_compliance: 0.25, share: 0.5, warm_start: 1 };

    /// The overlap of springs side by side.
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
