//! Scales impulses and preloads when the length of a substep or the stiffness of contacts changes.

use super::StepProblem;
use super::rows::{ContactRow, ImpulseRow, PointRow, Substep};
use crate::config::SolverConfig;
use crate::constants::LARGEST_PRELOAD;
use crate::world::{BodyKind, World};

/// The numbers that scale the impulses and preloads of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepScale {
    /// Length of a substep (s). The impulse of a contact in a substep is its force times this length.
    substep: f32,
    /// Ratio of the overlap at rest to the impulse, times the effective mass, for contacts between movable bodies (s).
    movable_compliance: f32,
    /// The same for contacts with bodies that cannot move (s).
    fixed_compliance: f32,
}

crate::saved::fields!(StepScale { substep, movable_compliance, fixed_compliance });

impl StepScale {
    /// The length of a step with this number of substeps (s).
    pub fn step(&self, substeps: u32) -> f32 {
        self.substep * substeps as f32
    }

    /// Compression of the springs of a contact at rest under the normal impulses `pressed`, times their effective mass
    /// (kg m).
    pub(super) fn yielding(&self, both_movable: bool, pressed: f32) -> f32 {
        pressed * if both_movable { self.movable_compliance } else { self.fixed_compliance }
    }

    /// The scale of steps of `dt` seconds.
    pub fn new(config: &SolverConfig, dt: f32) -> Self {
        let Substep { length, movable, fixed, .. } = Substep::new(config, dt / config.substeps as f32);
        Self { substep: length, movable_compliance: movable.compliance(), fixed_compliance: fixed.compliance() }
    }
}

/// Changes the length of a contact's substeps, as a share of those of class 0, without a change of its force. The
/// springs become stiffer by the square of the ratio, so the same load compresses them less, and the preload makes up
/// the difference. Without that, a tower of alternating masses of 1 and 1000 jumped up at 0.9 m/s when its substeps
/// were doubled. `sag` is the compression of the former springs by the load of the contact.
///
/// A deeper overlap is a push and not a load. A preload that took it up would hold a deeply overlapping body in place
/// and keep it from being pushed out.
pub(super) fn change_share(
    contact: &mut ContactRow,
    share: f32,
    sag: f32,
    points: &[PointRow],
    impulses: &mut [ImpulseRow],
) {
    let ratio = ratio(share, contact.substep_share);
    contact.substep_share = share;
    let points = &points[..contact.point_count as usize];
    let separation = points.iter().map(|point| point.separation).sum::<f32>() / points.len() as f32;
    let compression = (contact.preload - separation).max(0.0).min(LARGEST_PRELOAD as f32 * sag);
    contact.preload += (ratio * ratio - 1.0) * compression;
    impulses.iter_mut().for_each(|impulse| scale_impulse(impulse, ratio));
}

fn scale_impulse(impulse: &mut ImpulseRow, factor: f32) {
    impulse.normal *= factor;
    impulse.tangent_1 *= factor;
    impulse.tangent_2 *= factor;
}

/// The quotient, or 1 without a divisor.
fn ratio(now: f32, before: f32) -> f32 {
    if before > 0.0 { now / before } else { 1.0 }
}

impl StepScale {
    /// Rescales the impulses and preloads of a step with the scale `before`, so that all contacts and joints have the
    /// same forces in a step with this scale. Without it, a pile that came to rest with 32 substeps rattled at 0.8 m/s
    /// when it continued with 8.
    pub fn rescale(&self, before: &Self, world: &World, problem: &mut StepProblem) {
        let forces = ratio(self.substep, before.substep);
        let movable = forces * ratio(self.movable_compliance, before.movable_compliance);
        let fixed = forces * ratio(self.fixed_compliance, before.fixed_compliance);
        let is_dynamic = |body: u32| world.bodies[body as usize].kind == BodyKind::Dynamic;
        for contact in &mut problem.contacts {
            contact.preload *= if is_dynamic(contact.body_a) && is_dynamic(contact.body_b) { movable } else { fixed };
        }
        problem.impulses.iter_mut().for_each(|impulse| scale_impulse(impulse, forces));
        for impulse in &mut problem.joint_impulses {
            impulse.linear = impulse.linear.map(|x| x * forces);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Substeps of half the length are four times as stiff: the compression of 0.5 m shrinks to a quarter, and impulses
    /// shrink to a half.
    #[test]
    fn a_contact_bears_the_same_force_with_substeps_of_another_length() {
        let mut contact =
            ContactRow { preload: 0.25, substep_share: 1.0, point_count: 1, ..ContactRow::framed(glam::Vec3::Y) };
        let points = [PointRow { separation: -0.25, ..PointRow::default() }];
        let mut impulses = [ImpulseRow { normal: 8.0, tangent_1: 4.0, tangent_2: -2.0, bounce: 1.0 }];
        change_share(&mut contact, 0.5, 0.5, &points, &mut impulses);
        assert_eq!((contact.substep_share, contact.preload), (0.5, -0.125));
        assert_eq!(impulses, [ImpulseRow { normal: 4.0, tangent_1: 2.0, tangent_2: -1.0, bounce: 1.0 }]);
        change_share(&mut contact, 1.0, 0.125, &points, &mut impulses);
        assert_eq!((contact.substep_share, contact.preload), (1.0, 0.25));
        assert_eq!(impulses, [ImpulseRow { normal: 8.0, tangent_1: 4.0, tangent_2: -2.0, bounce: 1.0 }]);
    }

    /// A contact without a load that is 0.25 m deep is pushed out as before. Under a load, the overlap counts up to
    /// twice the overlap at rest.
    #[test]
    fn an_overlap_that_bears_no_load_stays_an_overlap() {
        let points = [PointRow { separation: -0.25, ..PointRow::default() }];
        for (sag, preload) in [(0.0, 0.0), (0.0625, -0.09375), (0.125, -0.1875), (0.5, -0.1875)] {
            let mut contact = ContactRow { substep_share: 1.0, point_count: 1, ..ContactRow::framed(glam::Vec3::Y) };
            change_share(&mut contact, 0.5, sag, &points, &mut []);
            assert_eq!(contact.preload, preload, "{sag} m");
        }
    }
}
