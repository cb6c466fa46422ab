//! Contacts and joints as lanes see them, and the kernels over one of either.

use std::ops::Range;

use crate::kernels::contact::{restitute_contact, solve_contact, warm_start};
use crate::kernels::joint::{solve_joint, warm_start_joint};
use crate::kernels::joint_system::{apply_joint_change, measure_joint};
use crate::kernels::{Contact, Impulse, Joint, Pair, Point, StepParams};
use crate::math::{Lane, Vec3};
use crate::plan::Kernel;
use crate::problem::{Block, ContactRow, JointRow, StepProblem};

/// A kind of constraint: contacts or joints.
pub(super) trait Constraint: bytemuck::Pod + Sync {
    /// Whether each impulse has a row of `points`.
    const HAS_POINTS: bool;
    /// Which numbers of its row stand in lanes, in the order of the kernels' struct; those of a joint end before the padding.
    const HEADER: [usize; 11];
    fn colors(problem: &StepProblem) -> Range<u32>;
    fn own_colors(block: &Block) -> Range<u32>;
    fn rows(problem: &StepProblem) -> &[Self];
    fn impulses(problem: &StepProblem) -> &[[f32; 4]];
    fn impulses_mut(problem: &mut StepProblem) -> (&[Self], &mut [[f32; 4]]);
    fn bodies(&self) -> [u32; 2];
    /// Contact points, 1 to 4; 1 of a joint.
    fn points(&self) -> u32;
    /// Its first row of impulses and points; `row` is its own row.
    fn first(&self, row: u32) -> u32;
}

impl Constraint for ContactRow {
    const HAS_POINTS: bool = true;
    /// Normal, tangent, friction, restitution, radii, preload.
    const HEADER: [usize; 11] = [0, 1, 2, 4, 5, 6, 3, 7, 12, 13, 14];
    fn colors(problem: &StepProblem) -> Range<u32> {
        problem.contact_colors()
    }
    fn own_colors(block: &Block) -> Range<u32> {
        block.contacts[0]..block.contacts[1]
    }
    fn rows(problem: &StepProblem) -> &[Self] {
        &problem.contacts
    }
    fn impulses(problem: &StepProblem) -> &[[f32; 4]] {
        bytemuck::cast_slice(&problem.impulses)
    }
    fn impulses_mut(problem: &mut StepProblem) -> (&[Self], &mut [[f32; 4]]) {
        (&problem.contacts, bytemuck::cast_slice_mut(&mut problem.impulses))
    }
    fn bodies(&self) -> [u32; 2] {
        [self.body_a, self.body_b]
    }
    fn points(&self) -> u32 {
        self.point_count
    }
    fn first(&self, _: u32) -> u32 {
        self.first_point
    }
}

impl Constraint for JointRow {
    const HAS_POINTS: bool = false;
    /// Arms and gap.
    const HEADER: [usize; 11] = [0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 11];
    fn colors(problem: &StepProblem) -> Range<u32> {
        problem.joint_colors()
    }
    fn own_colors(block: &Block) -> Range<u32> {
        block.joints[0]..block.joints[1]
    }
    fn rows(problem: &StepProblem) -> &[Self] {
        &problem.joints
    }
    fn impulses(problem: &StepProblem) -> &[[f32; 4]] {
        bytemuck::cast_slice(&problem.joint_impulses)
    }
    fn impulses_mut(problem: &mut StepProblem) -> (&[Self], &mut [[f32; 4]]) {
        (&problem.joints, bytemuck::cast_slice_mut(&mut problem.joint_impulses))
    }
    fn bodies(&self) -> [u32; 2] {
        [self.body_a, self.body_b]
    }
    fn points(&self) -> u32 {
        1
    }
    fn first(&self, row: u32) -> u32 {
        row
    }
}

/// Applies a kernel to a contact of a lane.
#[inline(always)]
pub(super) fn sweep_contact<L: Lane>(
    kernel: Kernel,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    points: &[Point<L>],
    impulses: &mut [Impulse<L>],
) {
    match kernel {
        Kernel::WarmStart(rules) => warm_start(rules, pair, contact, points, impulses),
        Kernel::SolveContacts(rules) => solve_contact(rules, params, pair, contact, points, impulses),
        Kernel::ApplyRestitution(rules) => restitute_contact(rules, params, pair, contact, points, impulses),
        _ => unreachable!("a kernel over other rows"),
    }
}

/// Applies a kernel to a joint of a lane, and to its impulse; where it is solved at once with others, to its correction.
#[inline(always)]
pub(super) fn sweep_joint<L: Lane>(
    kernel: Kernel,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    joint: &Joint<L>,
    impulse: &mut Vec3<L>,
) {
    match kernel {
        Kernel::WarmStartJoints => warm_start_joint(pair, joint, *impulse),
        Kernel::SolveJoints(rules) => solve_joint(rules, params, pair, joint, impulse),
        Kernel::MeasureJoints(rules) => *impulse = measure_joint(rules, params, pair, joint),
        Kernel::ApplyJointChanges(_) => apply_joint_change(pair, joint, *impulse),
        _ => unreachable!("a kernel over other rows"),
    }
}
