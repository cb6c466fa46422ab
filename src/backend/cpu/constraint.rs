//! Contacts and joints in the layout of the lanes, and the kernels over one constraint.

use std::ops::Range;

use crate::kernels::axis::{Frames, solve_axis, warm_start_axis};
use crate::kernels::contact::{PointRows, restitute_contact, solve_contact, warm_start};
use crate::kernels::joint::{solve_joint, warm_start_joint};
use crate::kernels::joint_system::{measure_axis, measure_joint};
use crate::kernels::{Axis, Contact, Joint, Pair, Rules, StepParams};
use crate::math::{Lane, Vec3};
use crate::plan::Kernel;
use crate::problem::{Block, ContactRow, JointRow, MAX_AXES, StepProblem};

/// Largest number of impulses of a constraint without the patch: a joint and its axes.
pub(super) const MAX_IMPULSES: usize = 1 + MAX_AXES;

/// A kind of constraint: contacts or joints.
pub(super) trait Constraint: bytemuck::Pod + Sync {
    /// Whether its points are stored like its impulses, so that both begin at the same index.
    const HAS_POINTS: bool;
    /// Indices of the row's numbers that the lanes hold, in the order of the kernels' struct. The last one of a joint
    /// is padding.
    const HEADER: [usize; 11];
    fn own_colors(block: &Block) -> Range<u32>;
    fn rows(problem: &StepProblem) -> &[Self];
    fn impulses(problem: &StepProblem) -> &[[f32; 4]];
    fn bodies(&self) -> [u32; 2];
    /// Number of contact points, 1 to 4; for a joint, its anchors and its axes.
    fn points(&self) -> u32;
    /// The row of its impulse `k`. `row` is the constraint's own row in `rows`.
    fn impulse(rows: &[Self], row: u32, k: usize) -> usize;
    /// Whether lanes hold points of the rows of a problem.
    fn are_with_points(problem: &StepProblem) -> bool;
    /// The numbers of the point, of the axis, or of the frames of a joint, for its impulse `k`.
    fn point<'a>(&'a self, problem: &'a StepProblem, k: usize) -> Option<&'a [f32; 12]>;
}

impl Constraint for ContactRow {
    const HAS_POINTS: bool = true;
    /// Normal, tangent, friction, restitution, radii, preload.
    const HEADER: [usize; 11] = [0, 1, 2, 4, 5, 6, 3, 7, 12, 13, 14];
    fn own_colors(block: &Block) -> Range<u32> {
        block.contacts[0]..block.contacts[1]
    }
    fn rows(problem: &StepProblem) -> &[Self] {
        &problem.contacts
    }
    fn impulses(problem: &StepProblem) -> &[[f32; 4]] {
        bytemuck::cast_slice(&problem.impulses)
    }
    fn bodies(&self) -> [u32; 2] {
        [self.body_a, self.body_b]
    }
    fn points(&self) -> u32 {
        self.point_count
    }
    fn impulse(rows: &[Self], row: u32, k: usize) -> usize {
        rows[row as usize].first_point as usize + k
    }
    fn are_with_points(_: &StepProblem) -> bool {
        true
    }
    fn point<'a>(&'a self, problem: &'a StepProblem, k: usize) -> Option<&'a [f32; 12]> {
        problem.points.get(self.first_point as usize + k).map(bytemuck::cast_ref)
    }
}

impl Constraint for JointRow {
    const HAS_POINTS: bool = false;
    /// Arms, gap, and whether the anchors are free.
    const HEADER: [usize; 11] = [0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 15];
    fn own_colors(block: &Block) -> Range<u32> {
        block.joints[0]..block.joints[1]
    }
    fn rows(problem: &StepProblem) -> &[Self] {
        &problem.joints
    }
    fn impulses(problem: &StepProblem) -> &[[f32; 4]] {
        bytemuck::cast_slice(&problem.joint_impulses)
    }
    fn bodies(&self) -> [u32; 2] {
        [self.body_a, self.body_b]
    }
    fn points(&self) -> u32 {
        1 + self.axis_count
    }
    fn impulse(rows: &[Self], row: u32, k: usize) -> usize {
        if k == 0 { row as usize } else { rows.len() + rows[row as usize].first_axis as usize + k - 1 }
    }
    fn are_with_points(problem: &StepProblem) -> bool {
        !problem.axes.is_empty()
    }
    fn point<'a>(&'a self, problem: &'a StepProblem, k: usize) -> Option<&'a [f32; 12]> {
        if k == 0 {
            // The place of the anchors holds the frames, after four numbers that nothing reads.
            let numbers: &[f32; 24] = bytemuck::cast_ref(self);
            return numbers.last_chunk();
        }
        problem.axes.get(self.first_axis as usize + k - 1).map(bytemuck::cast_ref)
    }
}

/// Applies a kernel to a contact of a lane. `as_one` is the value of [`Kernel::presses_as_one`].
#[inline(always)]
pub(super) fn sweep_contact<L: Lane>(
    kernel: Kernel,
    as_one: bool,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &mut impl PointRows<L>,
) {
    match kernel {
        Kernel::WarmStart(rules) if !as_one => warm_start(rules, pair, contact, rows),
        Kernel::SolveContacts(rules) => solve_contact(Rules { as_one, ..rules }, params, pair, contact, rows),
        Kernel::ApplyRestitution(rules) if as_one => restitute_contact(rules, params, pair, contact, rows),
        _ => unreachable!("a kernel over other rows"),
    }
}

/// Access to the axes of a joint and their impulses, in any storage.
pub(super) trait AxisRows<L> {
    fn count(&self) -> usize;
    fn axis(&self, k: usize) -> Axis<L>;
    fn impulse(&self, k: usize) -> L;
    fn set_impulse(&mut self, k: usize, impulse: L);
}

impl<L: Lane> AxisRows<L> for (&[Axis<L>], &mut [Vec3<L>]) {
    fn count(&self) -> usize {
        self.0.len()
    }
    fn axis(&self, k: usize) -> Axis<L> {
        self.0[k]
    }
    fn impulse(&self, k: usize) -> L {
        self.1[k].x
    }
    fn set_impulse(&mut self, k: usize, impulse: L) {
        self.1[k].x = impulse;
    }
}

/// Applies a kernel to a joint of a lane, its axes and their impulses. If a system solves the joint, the kernel applies
/// to their corrections.
#[inline(always)]
pub(super) fn sweep_joint<L: Lane>(
    kernel: Kernel,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    joint: &Joint<L>,
    impulse: &mut Vec3<L>,
    axes: &mut impl AxisRows<L>,
) {
    let frames = Frames::of(pair, joint);
    match kernel {
        // Corrections are applied like warm-start impulses.
        Kernel::WarmStartJoints { axes: has_axes } | Kernel::ApplyJointChanges(Rules { axes: has_axes, .. }) => {
            if has_axes {
                for k in 0..axes.count() {
                    warm_start_axis(pair, &frames, &axes.axis(k), axes.impulse(k));
                }
            }
            warm_start_joint(pair, joint, *impulse);
        }
        Kernel::SolveJoints(rules) => {
            if rules.axes {
                for k in 0..axes.count() {
                    let mut impulse = axes.impulse(k);
                    solve_axis(rules, false, params, pair, &frames, &axes.axis(k), &mut impulse);
                    axes.set_impulse(k, impulse);
                }
            }
            solve_joint(rules, params, pair, joint, impulse);
        }
        Kernel::SolveAxes(rules) => {
            for k in 0..axes.count() {
                let mut impulse = axes.impulse(k);
                solve_axis(rules, true, params, pair, &frames, &axes.axis(k), &mut impulse);
                axes.set_impulse(k, impulse);
            }
        }
        Kernel::MeasureJoints(rules) => {
            for k in 0..axes.count() {
                axes.set_impulse(k, measure_axis(rules, params, pair, &frames, &axes.axis(k)));
            }
            *impulse = measure_joint(rules, params, pair, joint);
        }
        _ => unreachable!("a kernel over other rows"),
    }
}
