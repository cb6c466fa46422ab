//! Runs one pass over one part of a step, on one thread or on all.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::bodies::{BodyWork, SpinWork, State, TurningWork};
use super::constraint::Constraint;
use super::joint_systems::{SharedFactors, SystemLayout, SystemWork};
use super::lane_layout::LaneLayout;
use super::lane_rows::{SharedImpulses, SharedPoints};
use super::partition::Partition;
use super::sweep::{Sums, Sweep, clear_impulses};
use crate::lanes::{InstructionSet, Row8, Shared, WIDTH};
use crate::plan::{Kernel, Pass};
use crate::problem::{Block, ContactRow, JointRow, Params, StepProblem};

/// The data of a step, shared by threads that work on different parts of it.
pub(super) struct SharedStep<'a> {
    pub instructions: InstructionSet,
    pub params: &'a Params,
    pub blocks: &'a [Block],
    pub partition: &'a Partition,
    pub bodies: Shared<'a, State>,
    pub free: Shared<'a, Row8>,
    pub accelerations: &'a [Row8],
    pub dampings: &'a [Row8],
    pub inertias: &'a [(u32, [Row8; 2])],
    pub contacts: &'a LaneLayout<ContactRow>,
    pub contact_points: SharedPoints<'a>,
    pub contact_impulses: SharedImpulses<'a>,
    pub contact_totals: SharedImpulses<'a>,
    pub joints: &'a LaneLayout<JointRow>,
    pub joint_axes: SharedPoints<'a>,
    pub joint_impulses: SharedImpulses<'a>,
    pub joint_totals: SharedImpulses<'a>,
    pub problem: &'a StepProblem,
    pub systems: &'a SystemLayout,
    pub turning: &'a [(u32, Row8)],
    pub factors: SharedFactors<'a>,
    pub joint_changes: SharedImpulses<'a>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

/// Runs work over groups, on one thread or on many.
pub(super) type Spread<'a> = &'a dyn Fn(Range<usize>, &(dyn Fn(Range<usize>) + Sync));

impl SharedStep<'_> {
    /// Runs a pass over a part. Each task has its own part.
    pub fn run(&self, pass: &Pass, part: usize, spread: Spread, spread_each: Spread) {
        let (kernel, params, bodies) = (pass.kernel, self.params, self.bodies);
        let substep = &self.blocks[pass.block as usize].substep;
        match kernel {
            Kernel::IntegrateVelocities { .. }
            | Kernel::IntegrateTorques { .. }
            | Kernel::DampVelocities { .. }
            | Kernel::BeginChanges
            | Kernel::EndChanges
            | Kernel::IntegratePositions { .. } => {
                let Self { free, accelerations, dampings, .. } = *self;
                let work = BodyWork { kernel, params, substep, bodies, free, accelerations, dampings };
                spread(self.partition.bodies(part), &|range| self.instructions.run(&work, range));
            }
            Kernel::IntegrateGyroscopic { from_start } => {
                let rows = self.of_part(self.inertias, part);
                let work = SpinWork { from_start, params, substep, rows, bodies, free: self.free };
                spread(0..rows.len().div_ceil(WIDTH), &|range| self.instructions.run(&work, range));
            }
            Kernel::ClearImpulses => {
                for color in pass.colors.clone() {
                    let groups = self.contacts.ranges.of(part, color);
                    clear_impulses(&self.contact_impulses, self.contacts.impulses_of(groups));
                }
            }
            Kernel::SumImpulses { first } => {
                let sums = Sums { is_first: first, impulses: self.contact_impulses, totals: self.contact_totals };
                self.sum(pass, part, self.contacts, &sums, spread);
            }
            Kernel::SumJointImpulses { first } => {
                let sums = Sums { is_first: first, impulses: self.joint_impulses, totals: self.joint_totals };
                self.sum(pass, part, self.joints, &sums, spread);
            }
            Kernel::WarmStart(_) | Kernel::SolveContacts(_) | Kernel::ApplyRestitution(_) => {
                let rows = (self.contact_points, self.contact_impulses);
                if kernel.presses_as_one() {
                    self.sweep::<_, true>(pass, part, self.contacts, rows, spread);
                } else {
                    self.sweep::<_, false>(pass, part, self.contacts, rows, spread);
                }
            }
            Kernel::WarmStartJoints { .. } | Kernel::SolveJoints(_) | Kernel::SolveAxes(_) => {
                self.sweep::<_, false>(pass, part, self.joints, (self.joint_axes, self.joint_impulses), spread);
            }
            Kernel::MeasureJoints(_) | Kernel::ApplyJointChanges(_) => {
                self.sweep::<_, false>(pass, part, self.joints, (self.joint_axes, self.joint_changes), spread);
            }
            Kernel::TurnInertias => {
                let rows = self.of_part(self.turning, part);
                let work = TurningWork { rows, bodies };
                spread(0..rows.len().div_ceil(WIDTH), &|range| self.instructions.run(&work, range));
            }
            Kernel::BeginSystems | Kernel::SolveJointSystems(_) => {
                let work = SystemWork {
                    begins: kernel == Kernel::BeginSystems,
                    problem: self.problem,
                    layout: self.systems,
                    slots: &self.partition.slots,
                    bodies,
                    factors: self.factors,
                    changes: self.joint_changes,
                    impulses: self.joint_impulses,
                };
                for color in pass.colors.clone() {
                    spread_each(self.systems.ranges().of(part, color), &|range| self.instructions.run(&work, range));
                }
            }
            Kernel::BeginSweep { .. } | Kernel::Extrapolate { .. } | Kernel::MeasureStep | Kernel::UpdateMomentum => {
                unreachable!("{kernel} does not stay on islands")
            }
        }
    }

    /// The rows of the bodies of a part. `rows` has the slots of all bodies with such a row, in ascending order.
    fn of_part<'a, T>(&self, rows: &'a [(u32, T)], part: usize) -> &'a [(u32, T)] {
        let Range { start, end } = self.partition.bodies(part);
        let [first, end] = [start, end].map(|group| rows.partition_point(|row| (row.0 as usize) < group * WIDTH));
        &rows[first..end]
    }

    fn sum<C: Constraint>(&self, pass: &Pass, part: usize, layout: &LaneLayout<C>, sums: &Sums, spread: Spread) {
        for color in pass.colors.clone() {
            let groups = layout.ranges.of(part, color);
            spread(layout.impulses_of(groups), &|range| self.instructions.run(sums, range));
        }
    }

    fn sweep<C: Constraint, const AS_ONE: bool>(
        &self,
        pass: &Pass,
        part: usize,
        layout: &LaneLayout<C>,
        (points, impulses): (SharedPoints, SharedImpulses),
        spread: Spread,
    ) {
        let (kernel, params, bodies, free, moving) = (pass.kernel, self.params, self.bodies, self.free, self.moving);
        let substep = &self.blocks[pass.block as usize].substep;
        let (groups, constraint) = (&layout.groups[..], PhantomData::<C>);
        let work =
            Sweep::<C, AS_ONE> { kernel, params, substep, bodies, free, groups, points, impulses, constraint, moving };
        for color in pass.colors.clone() {
            spread(layout.ranges.of(part, color), &|range| self.instructions.run(&work, range));
        }
    }
}
