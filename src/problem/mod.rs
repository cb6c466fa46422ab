//! One step as a value: plain rows in color order, whose names are the names of the WGSL bindings.

pub mod carry;
mod check;
mod contacts;
pub mod effective;
mod follow;
mod layout;
mod prepare;
pub mod softness;
mod store;

pub use layout::{
    BodyRow, ContactRow, ConvergenceRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow,
    MomentumRow, Params, PassColors, PointRow, Softness,
};
pub use prepare::Prepared;

use std::ops::Range;

/// Everything that a backend needs for one step, and everything that it gives back (`bodies`, `impulses`,
/// `joint_impulses`, `convergence`, `momentum`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepProblem {
    /// The same for all.
    pub params: Params,
    /// State, one row a body of the world.
    pub bodies: Vec<BodyRow>,
    /// Masses, one row a body.
    pub masses: Vec<MassRow>,
    /// Principal inertia of the bodies whose moments differ; empty where the scene has none.
    pub inertias: Vec<InertiaRow>,
    /// Manifolds in color order.
    pub contacts: Vec<ContactRow>,
    /// Points of the manifolds, one manifold after another.
    pub points: Vec<PointRow>,
    /// Impulses of the points.
    pub impulses: Vec<ImpulseRow>,
    /// Where each color begins in `contacts`, and where the last ends; then the same for `joints`.
    pub colors: Vec<u32>,
    /// Which of `colors` is the first of the joints.
    pub first_joint_color: u32,
    /// Ball joints in color order.
    pub joints: Vec<JointRow>,
    /// Impulses of the joints.
    pub joint_impulses: Vec<JointImpulseRow>,
    /// Whether the sweeps still move anything.
    pub convergence: ConvergenceRow,
    /// How far the sweeps extrapolate.
    pub momentum: MomentumRow,
}

impl StepProblem {
    /// Colors of the contacts.
    pub fn contact_colors(&self) -> Range<u32> {
        0..self.first_joint_color.saturating_sub(1)
    }

    /// Colors of the joints.
    pub fn joint_colors(&self) -> Range<u32> {
        self.first_joint_color..(self.colors.len() as u32).saturating_sub(1).max(self.first_joint_color)
    }

    /// The contacts, or joints, of some neighboring colors.
    pub fn rows_of(&self, colors: &Range<u32>) -> Range<usize> {
        if colors.is_empty() {
            return 0..0;
        }
        self.colors[colors.start as usize] as usize..self.colors[colors.end as usize] as usize
    }

    /// Whether a patch follows the points of every contact.
    pub fn has_patches(&self) -> bool {
        self.contacts.last().is_some_and(|c| ((c.first_point + c.point_count) as usize) < self.points.len())
    }

    /// Number of points of some neighboring contacts, patches left out.
    pub fn point_count(&self, contacts: Range<usize>) -> usize {
        let begins = |contact: usize| self.contacts.get(contact).map_or(self.points.len(), |c| c.first_point as usize);
        let patches = if self.has_patches() { contacts.len() } else { 0 };
        begins(contacts.end) - begins(contacts.start) - patches
    }

    /// Number of impulses, those of patches and joints included.
    pub fn impulse_count(&self) -> usize {
        self.impulses.len() + self.joint_impulses.len()
    }

    /// Begins without impulses and preloads.
    pub fn forget_impulses(&mut self) {
        self.impulses.fill(ImpulseRow::default());
        self.contacts.iter_mut().for_each(|contact| contact.preload = 0.0);
    }

    /// Whether any contact has friction.
    pub fn has_friction(&self) -> bool {
        self.contacts.iter().any(|c| c.friction > 0.0)
    }

    /// Whether any contact can bounce.
    pub fn has_restitution(&self) -> bool {
        self.contacts.iter().any(|c| c.restitution > 0.0)
    }

    /// Whether any contact is made by a round surface, whose radius its rows carry.
    pub fn has_round_shapes(&self) -> bool {
        self.contacts.iter().any(|c| c.radius_a > 0.0 || c.radius_b > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_without_patches() {
        for patch in [0, 1] {
            let counts = [3, 1, 4, 2];
            let mut problem = StepProblem::default();
            let mut next = 0;
            for point_count in counts {
                problem.contacts.push(ContactRow { first_point: next, point_count, ..ContactRow::default() });
                next += point_count + patch;
            }
            problem.points.resize(next as usize, PointRow::default());
            assert_eq!(problem.has_patches(), patch == 1);
            assert_eq!([0..4, 1..3, 2..4, 4..4].map(|rows| problem.point_count(rows)), [10, 5, 6, 0]);
        }
    }
}
