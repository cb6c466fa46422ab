//! Joints that are solved at once, on the states of the lanes: each system by one thread, one joint after another.

#![allow(unsafe_code)]

use std::ops::Range;

use super::bodies::State;
use super::lane_layout::{ImpulsePlace, LaneLayout};
use super::lane_rows::SharedImpulses;
use super::partition::{ColorRanges, Partition, PartitionedRows};
use crate::kernels::joint_system::{
    Block, JointChanges, JointFactors, JointNode, SystemFactors, begin_system, places, solve_system,
};
use crate::kernels::{Axis, Joint, Mass, Pair, Sym3};
use crate::lanes::{Lanes, Shared, Work};
use crate::math::{Vec3, vec3};
use crate::problem::{ImpulseNumber, JointRow, JointSystems, StepProblem};

/// The systems of a step, and the places of their joints.
#[derive(Default)]
pub(super) struct SystemLayout {
    rows: PartitionedRows,
    /// In the order of impulses: joints, then axes.
    impulses: Vec<ImpulsePlace>,
}

impl SystemLayout {
    /// Takes over the systems of a problem.
    pub fn load(&mut self, problem: &StepProblem, partition: &Partition, joints: &LaneLayout<JointRow>) {
        let part_of = |system: u32| {
            let first = problem.systems.nodes_of(system as usize).start;
            let JointRow { body_a, body_b, .. } = problem.joints[problem.systems.nodes[first].joint as usize];
            partition.of(body_a, body_b)
        };
        self.rows.update(problem, partition, |block| block.systems..block.systems + 1, part_of);
        if problem.has_systems() {
            joints.impulse_places(problem, &mut self.impulses);
        }
    }

    /// Where the systems of each color of each part stand: places for [`SystemWork`].
    pub fn ranges(&self) -> &ColorRanges {
        &self.rows.ranges
    }
}

/// The factors of all systems, shared by threads that have different systems.
#[derive(Clone, Copy)]
pub(super) struct SharedFactors<'a> {
    nodes: Shared<'a, JointNode<f32>>,
    lower: Shared<'a, Block<f32>>,
    upper: Shared<'a, Block<f32>>,
}

impl<'a> SharedFactors<'a> {
    pub fn new(factors: &'a mut JointFactors<f32>) -> Self {
        let (nodes, lower, upper) = factors.all();
        Self { nodes: Shared::new(nodes), lower: Shared::new(lower), upper: Shared::new(upper) }
    }

    /// Those of one system.
    ///
    /// # Safety
    /// No other thread has the same system.
    #[inline(always)]
    unsafe fn of(&self, systems: &JointSystems, system: usize) -> SystemFactors<'a, f32> {
        let [nodes, blocks] = places(systems, system);
        // SAFETY: the caller's promise; systems have nodes and blocks of their own.
        unsafe {
            let (lower, upper) = (self.lower.slice(blocks.clone()), self.upper.slice(blocks));
            SystemFactors { nodes: self.nodes.slice(nodes), lower, upper }
        }
    }
}

/// A pass over systems.
pub(super) struct SystemWork<'a> {
    /// Whether systems begin, and are not solved.
    pub begins: bool,
    pub problem: &'a StepProblem,
    pub layout: &'a SystemLayout,
    /// The slots of the bodies of the problem.
    pub slots: &'a [u32],
    pub bodies: Shared<'a, State>,
    pub factors: SharedFactors<'a>,
    pub changes: SharedImpulses<'a>,
    pub impulses: SharedImpulses<'a>,
}

impl Work for SystemWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, range: Range<usize>) {
        let systems = &self.problem.systems;
        for system in self.layout.rows.rows[range].iter().map(|&system| system as usize) {
            // SAFETY: tasks have different systems: `Threads::spread_each` cuts their range.
            let factors = unsafe { self.factors.of(systems, system) };
            if self.begins {
                begin_system(systems, system, |joint| self.load(joint), |joint, k| self.axis(joint, k), factors);
            } else {
                solve_system(self.problem, system, &mut Changes(self), factors);
            }
        }
    }
}

impl SystemWork<'_> {
    #[inline(always)]
    fn load(&self, joint: usize) -> (Joint<f32>, Pair<f32>) {
        let row = &self.problem.joints[joint];
        let [(a, mass_a), (b, mass_b)] = [row.body_a, row.body_b].map(|body| {
            let slot = self.slots[body as usize] as usize;
            // SAFETY: a factorization writes no body, and no other pass runs beside it.
            let state = unsafe { &*self.bodies.slice(slot..slot + 1).as_ptr() };
            let [xx, xy, xz, inv_mass, yy, yz, zz, _] = state.mass.0;
            let inv_inertia = Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) };
            (state.load(), Mass { inv_inertia, inv_mass, acceleration: Vec3::default() })
        });
        // A factorization reads no velocity.
        (Joint::load(row), Pair { a, b, mass_a, mass_b, ..Pair::default() })
    }

    #[inline(always)]
    fn axis(&self, joint: usize, k: usize) -> Axis<f32> {
        Axis::load(&self.problem.axes[self.problem.joints[joint].first_axis as usize + k])
    }
}

/// Corrections and impulses of joints among the lanes.
struct Changes<'a, 'b>(&'a SystemWork<'b>);

impl Changes<'_, '_> {
    /// SAFETY: `check` holds that a joint is in one system, and tasks have different systems.
    #[inline(always)]
    fn number<'c>(&mut self, rows: &SharedImpulses<'c>, at: ImpulseNumber) -> &'c mut f32 {
        let ImpulsePlace { row, lane } = self.0.layout.impulses[at.row];
        // SAFETY: this reaches one lane of the row, and no other task the same lane.
        unsafe { rows.number(row as usize, at.component, lane as usize) }
    }
}

impl JointChanges<f32> for Changes<'_, '_> {
    #[inline(always)]
    fn impulse(&mut self, at: ImpulseNumber) -> f32 {
        *self.number(&self.0.impulses, at)
    }

    #[inline(always)]
    fn lacking(&mut self, at: ImpulseNumber) -> f32 {
        *self.number(&self.0.changes, at)
    }

    #[inline(always)]
    fn change(&mut self, at: ImpulseNumber, change: f32) {
        *self.number(&self.0.changes, at) = change;
        *self.number(&self.0.impulses, at) += change;
    }
}
