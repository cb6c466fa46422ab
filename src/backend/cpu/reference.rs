//! The CPU reference: one thread runs one constraint at a time, in the order of the plan.

use super::super::{Backend, CheckedStep};
use super::constraint::{Constraint, sweep_contact, sweep_joint};
use crate::error::Result;
use crate::kernels::contact::{begin_bounces, clear_impulse, end_bounces, sum_impulse, summed};
use crate::kernels::convergence::begin_sweep;
use crate::kernels::integrate::{
    begin_changes, damp_velocities, end_changes, integrate_gyroscopic, integrate_positions, integrate_torque,
    integrate_velocities, start_of,
};
use crate::kernels::joint_system::{JointFactors, SystemRows, begin_system, solve_system, turned_inertia};
use crate::kernels::momentum::{StepLength, chunked_sum, extrapolate, extrapolated, step_length};
use crate::kernels::{Axis, Body, Free, Impulse, ImpulseStep, Joint, KernelRows, Mass, Pair, Rules, Sym3};
use crate::math::{Scalar, Vec3};
use crate::plan::{Kernel, Pass};
use crate::problem::{ConvergenceRow, ImpulseNumber, JointRow, NodeRow, StepProblem};

/// Runs the Rust twins of the kernels over `S`: `f32` for the reference, `f64` to measure the effect of rounding.
///
/// ```
/// use drystone::{Backend, Reference};
///
/// assert_eq!(Reference::<f32>::new().name(), "reference");
/// // The same kernels in double precision, to measure the effect of rounding.
/// assert!(Reference::<f64>::new().rows().bodies.is_empty());
/// ```
#[derive(Debug, Default)]
pub struct Reference<S> {
    rows: KernelRows<S>,
    free: Vec<Free<S>>,
    convergence: ConvergenceRow,
    /// Factors of the joint systems.
    factors: JointFactors<S>,
    /// Their corrections, in the order of impulses.
    joint_changes: Vec<Vec3<S>>,
    /// State of accelerated sweeps: velocities of the previous sweep, impulses of points and joints, and the change of
    /// the impulses in a sweep.
    velocities_before: Vec<[Vec3<S>; 2]>,
    point_steps: Vec<ImpulseStep<S>>,
    joint_steps: Vec<ImpulseStep<S>>,
    lengths: Vec<StepLength<S>>,
}

impl<S: Scalar> Reference<S> {
    /// A reference without rows.
    pub fn new() -> Self {
        Self::default()
    }

    /// A reference with these rows, for [`Reference::advance`].
    pub fn holding(rows: KernelRows<S>) -> Self {
        Self { rows, ..Self::default() }
    }

    /// The rows after the last passes.
    pub fn rows(&self) -> &KernelRows<S> {
        &self.rows
    }

    /// The rows, mutable between passes.
    pub fn rows_mut(&mut self) -> &mut KernelRows<S> {
        &mut self.rows
    }

    /// Runs passes over the loaded rows in the precision of `S`; `problem` has the indices between rows.
    pub fn advance(&mut self, problem: &StepProblem, passes: &[Pass]) {
        for pass in passes {
            self.run_pass(problem, pass);
        }
    }

    fn run_pass(&mut self, problem: &StepProblem, pass: &Pass) {
        if self.convergence.done != 0 && pass.kernel.is_measured() {
            return;
        }
        let params = self.rows.params[pass.block as usize];
        self.free.resize(self.rows.bodies.len(), Free::default());
        match pass.kernel {
            Kernel::IntegrateVelocities { warm_start, from_start } => {
                for i in places(problem, pass) {
                    let (mass, body, free) = (&self.rows.masses[i], &mut self.rows.bodies[i], &mut self.free[i]);
                    integrate_velocities(warm_start, from_start, &params, mass, body, free);
                }
            }
            Kernel::BeginChanges => {
                for i in places(problem, pass) {
                    begin_changes(&self.rows.masses[i], &mut self.rows.bodies[i], &mut self.free[i]);
                }
            }
            Kernel::EndChanges => {
                for i in places(problem, pass) {
                    end_changes(&mut self.rows.bodies[i], &self.free[i]);
                }
            }
            Kernel::IntegrateTorques { from_start } => {
                for i in places(problem, pass) {
                    let (body, free) = (&mut self.rows.bodies[i], &mut self.free[i]);
                    integrate_torque(from_start, &params, self.rows.torques[i], body, free);
                }
            }
            Kernel::DampVelocities { from_start } => {
                for i in places(problem, pass) {
                    let (body, free) = (&mut self.rows.bodies[i], &mut self.free[i]);
                    damp_velocities(from_start, &self.rows.dampings[i], body, free);
                }
            }
            Kernel::IntegrateGyroscopic { from_start } => {
                for row in places(problem, pass) {
                    let i = problem.inertias[row].body as usize;
                    let (body, free) = (&mut self.rows.bodies[i], &mut self.free[i]);
                    integrate_gyroscopic(from_start, &params, &self.rows.inertias[row], body, free);
                }
            }
            Kernel::IntegratePositions { from_start } => {
                for i in places(problem, pass) {
                    integrate_positions(from_start, &params, &mut self.rows.bodies[i], &self.free[i]);
                }
            }
            Kernel::ClearImpulses => {
                let patch = usize::from(problem.has_patches());
                for i in places(problem, pass) {
                    let row = &problem.contacts[i];
                    let first = row.first_point as usize;
                    let own = &mut self.rows.impulses[first..first + row.point_count as usize + patch];
                    own.iter_mut().for_each(clear_impulse);
                }
            }
            Kernel::SumImpulses { first } => {
                let patch = usize::from(problem.has_patches());
                for i in places(problem, pass) {
                    let row = &problem.contacts[i];
                    let own = row.first_point as usize..(row.first_point + row.point_count) as usize + patch;
                    let totals = self.rows.totals[own.clone()].iter_mut();
                    self.rows.impulses[own].iter().zip(totals).for_each(|(now, total)| sum_impulse(first, now, total));
                }
            }
            Kernel::SumJointImpulses { first } => {
                for i in places(problem, pass) {
                    let JointRow { first_axis, axis_count, .. } = problem.joints[i];
                    let axes = (first_axis..first_axis + axis_count).map(|axis| problem.joints.len() + axis as usize);
                    for k in std::iter::once(i).chain(axes) {
                        self.rows.joint_totals[k] =
                            summed(first, self.rows.joint_totals[k], self.rows.joint_impulses[k]);
                    }
                }
            }
            Kernel::BeginSweep { first } => begin_sweep(first, &mut self.convergence),
            Kernel::Extrapolate { first, .. } => self.extrapolate(first),
            Kernel::MeasureStep => {
                let points = self.rows.impulses.iter().map(Impulse::components).zip(&self.point_steps);
                let joints = self.rows.joint_impulses.iter().copied().zip(&self.joint_steps);
                self.lengths.clear();
                self.lengths.extend(points.chain(joints).map(|(now, step)| step_length(now, step)));
            }
            Kernel::UpdateMomentum => self.rows.momentum.update(chunked_sum(&self.lengths)),
            Kernel::TurnInertias => {
                for row in places(problem, pass).map(|i| &problem.turning[i]) {
                    let (x, yz) = (Vec3::load(row.inv_inertia_x), Vec3::load(row.inv_inertia_yz));
                    let q = self.rows.bodies[row.body as usize].dq;
                    self.rows.masses[row.body as usize].inv_inertia = turned_inertia(Sym3 { x, yz }, q);
                }
            }
            Kernel::BeginSystems | Kernel::SolveJointSystems(_) => self.over_systems(problem, pass),
            Kernel::WarmStartJoints { .. }
            | Kernel::SolveJoints(_)
            | Kernel::SolveAxes(_)
            | Kernel::MeasureJoints(_)
            | Kernel::ApplyJointChanges(_) => {
                let are_changes = matches!(pass.kernel, Kernel::MeasureJoints(_) | Kernel::ApplyJointChanges(_));
                self.joint_changes.resize(self.rows.joint_impulses.len(), Vec3::default());
                for i in places(problem, pass) {
                    let bodies = problem.joints[i].bodies();
                    let (mut pair, rows) = (self.load_pair(bodies), &mut self.rows);
                    let numbers = if are_changes { &mut self.joint_changes } else { &mut rows.joint_impulses };
                    let JointRow { first_axis, axis_count, .. } = problem.joints[i];
                    let (first, count) = (first_axis as usize, axis_count as usize);
                    let (joint, axes) = (&rows.joints[i], &rows.axes[first..first + count]);
                    let (own, of_axes) = numbers.split_at_mut(problem.joints.len());
                    let of_axes = of_axes.get_mut(first..first + count).unwrap_or_default();
                    sweep_joint(pass.kernel, &params, &mut pair, joint, &mut own[i], &mut (axes, of_axes));
                    self.store_pair(bodies, &pair);
                }
            }
            Kernel::WarmStart(rules) | Kernel::SolveContacts(rules) | Kernel::ApplyRestitution(rules) => {
                for i in places(problem, pass) {
                    let row = &problem.contacts[i];
                    let first = row.first_point as usize;
                    let own = first..first + row.point_count as usize + usize::from(rules.patch);
                    let mut pair = self.load_pair(row.bodies());
                    let moves_bodies = pass.kernel.moves_bodies();
                    if moves_bodies {
                        self.begin_bounces(rules, row.bodies(), &mut pair);
                    }
                    let rows = &mut self.rows;
                    let mut own = (&rows.points[own.clone()], &mut rows.impulses[own]);
                    sweep_contact(
                        pass.kernel,
                        pass.kernel.presses_as_one(),
                        &params,
                        &mut pair,
                        &rows.contacts[i],
                        &mut own,
                    );
                    if moves_bodies {
                        self.end_bounces(rules, row.bodies(), &mut pair);
                    }
                    self.store_pair(row.bodies(), &pair);
                }
            }
        }
    }

    fn extrapolate(&mut self, first: bool) {
        if first {
            self.rows.momentum.begin();
        }
        self.velocities_before.resize(self.rows.bodies.len(), Default::default());
        self.point_steps.resize(self.rows.impulses.len(), ImpulseStep::default());
        self.joint_steps.resize(self.rows.joint_impulses.len(), ImpulseStep::default());
        let factor = self.rows.momentum.factor;
        for (body, before) in self.rows.bodies.iter_mut().zip(&mut self.velocities_before) {
            let now = [body.v, body.w];
            if !first {
                (body.v, body.w) = (extrapolated(now[0], before[0], factor), extrapolated(now[1], before[1], factor));
            }
            *before = now;
        }
        for (impulse, step) in self.rows.impulses.iter_mut().zip(&mut self.point_steps) {
            impulse.set_components(extrapolate(first, factor, impulse.components(), step));
        }
        for (impulse, step) in self.rows.joint_impulses.iter_mut().zip(&mut self.joint_steps) {
            *impulse = extrapolate(first, factor, *impulse, step);
        }
    }

    /// One system of joints after another.
    fn over_systems(&mut self, problem: &StepProblem, pass: &Pass) {
        let (systems, mut factors) = (&problem.systems, std::mem::take(&mut self.factors));
        factors.reset(systems);
        self.joint_changes.resize(self.rows.joint_impulses.len(), Vec3::default());
        for system in places(problem, pass) {
            let own = factors.of(systems, system);
            let mut rows = OneSystem { reference: self, problem, system };
            if pass.kernel == Kernel::BeginSystems {
                begin_system(systems, system, &rows, own);
            } else {
                solve_system(systems, system, &mut rows, own);
            }
        }
        self.factors = factors;
    }

    fn load_pair(&self, bodies: [u32; 2]) -> Pair<S> {
        let [a, b] = bodies.map(|body| body as usize);
        let (mass_a, mass_b) = (self.rows.masses[a], self.rows.masses[b]);
        let [start_a, start_b] = [(a, &mass_a), (b, &mass_b)].map(|(i, mass)| start_of(mass, &self.free[i]));
        let moving = S::constant(0.0);
        Pair { a: self.rows.bodies[a], b: self.rows.bodies[b], mass_a, mass_b, start_a, start_b, moving }
    }

    /// A body that cannot move is never written, and one with locked axes does not move along them.
    fn store_pair(&mut self, bodies: [u32; 2], pair: &Pair<S>) {
        let [a, b] = bodies.map(|body| body as usize);
        let zero = S::constant(0.0);
        if pair.mass_a.inv_mass > zero {
            (self.rows.bodies[a].v, self.rows.bodies[a].w) = (pair.mass_a.unlocked(pair.a.v), pair.a.w);
        }
        if pair.mass_b.inv_mass > zero {
            (self.rows.bodies[b].v, self.rows.bodies[b].w) = (pair.mass_b.unlocked(pair.b.v), pair.b.w);
        }
        if pair.moving > zero {
            self.convergence.moving = 1;
        }
    }

    fn begin_bounces(&self, rules: Rules, bodies: [u32; 2], pair: &mut Pair<S>) {
        for (i, body, mass) in sides(bodies, pair) {
            // An immovable body has no row of `free`.
            if !rules.from_start && mass.inv_mass > S::constant(0.0) {
                begin_bounces(&mass, body, &self.free[i]);
            }
        }
    }

    /// Stores the movements of a pair that may have bounced, and the bounces in the velocities without impulses.
    fn end_bounces(&mut self, rules: Rules, bodies: [u32; 2], pair: &mut Pair<S>) {
        for (i, body, mass) in sides(bodies, pair) {
            if mass.inv_mass > S::constant(0.0) {
                let row = &mut self.rows.bodies[i];
                (row.dp, row.dq) = (body.dp, body.dq);
                if !rules.from_start {
                    end_bounces([row.v, row.w], body, &mut self.free[i]);
                }
            }
        }
    }
}

/// The two bodies of a pair, each with its number and its mass.
fn sides<S: Scalar>([a, b]: [u32; 2], pair: &mut Pair<S>) -> [(usize, &mut Body<S>, Mass<S>); 2] {
    [(a as usize, &mut pair.a, pair.mass_a), (b as usize, &mut pair.b, pair.mass_b)]
}

/// The rows of a pass.
fn places(problem: &StepProblem, pass: &Pass) -> impl Iterator<Item = usize> {
    problem.rows_of(&pass.colors).iter().map(|&row| row as usize)
}

/// The joints of one system.
struct OneSystem<'a, S> {
    reference: &'a mut Reference<S>,
    problem: &'a StepProblem,
    system: usize,
}

impl<S> OneSystem<'_, S> {
    fn node(&self, node: usize) -> &NodeRow {
        let systems = &self.problem.systems;
        &systems.nodes[systems.nodes_of(self.system).start + node]
    }

    fn number(&self, node: usize, row: usize) -> ImpulseNumber {
        self.problem.numbers_of(self.node(node))[row].expect("a row that is there")
    }
}

/// A component of one of some rows.
fn component<S>(rows: &mut [Vec3<S>], at: ImpulseNumber) -> &mut S {
    let Vec3 { x, y, z } = &mut rows[at.row];
    [x, y, z].into_iter().nth(at.component).expect("one of three")
}

/// A component of one of some rows.
fn component_of<S: Copy>(rows: &[Vec3<S>], at: ImpulseNumber) -> S {
    let Vec3 { x, y, z } = rows[at.row];
    [x, y, z][at.component]
}

impl<S: Scalar> SystemRows<S> for OneSystem<'_, S> {
    fn joint(&self, node: usize) -> (Joint<S>, Pair<S>) {
        let joint = self.node(node).joint as usize;
        (self.reference.rows.joints[joint], self.reference.load_pair(self.problem.joints[joint].bodies()))
    }

    fn axis(&self, node: usize, k: usize) -> Axis<S> {
        let joint = self.node(node).joint as usize;
        self.reference.rows.axes[self.problem.joints[joint].first_axis as usize + k]
    }

    fn softness(&self) -> S {
        S::from(self.problem.systems.softness[self.system])
    }

    fn impulse(&self, node: usize, row: usize) -> S {
        component_of(&self.reference.rows.joint_impulses, self.number(node, row))
    }

    fn lacking(&self, node: usize, row: usize) -> S {
        component_of(&self.reference.joint_changes, self.number(node, row))
    }

    fn set_lacking(&mut self, node: usize, row: usize, lacking: S) {
        let at = self.number(node, row);
        *component(&mut self.reference.joint_changes, at) = lacking;
    }

    fn change(&mut self, node: usize, row: usize, change: S) {
        let at = self.number(node, row);
        *component(&mut self.reference.joint_changes, at) = change;
        let impulse = component(&mut self.reference.rows.joint_impulses, at);
        *impulse = *impulse + change;
    }
}

/// For each number, and not for all: a program that uses the crate would otherwise compile the kernels again.
macro_rules! backend {
    ($($Number:ty),*) => {
        $(
        impl Backend for Reference<$Number> {
            fn name(&self) -> &'static str {
                "reference"
            }

            fn adapter(&self) -> String {
                format!("one thread, scalar f{}", 8 * size_of::<$Number>())
            }

            fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
                let (problem, passes) = step.into_parts();
                self.rows.load(problem);
                self.convergence = problem.convergence;
                self.advance(problem, passes);
                self.rows.store(problem);
                problem.convergence = self.convergence;
                Ok(())
            }
        }
        )*
    };
}

backend!(f32, f64);
