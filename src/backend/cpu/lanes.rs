//! The kernels over sixteen lanes and all threads: sixteen constraints of one color at a time.
//!
//! The same kernel text as the reference, over another lane type, so the results are the reference's to the last bit.
//! Contacts of one color and one number of points stand in groups of sixteen, lane by lane; what does not fill a group is
//! filled up with contacts of nothing with nothing. The instruction set is chosen at run time. Color order makes the
//! order inside a pass irrelevant, so a pass can be cut into as many tasks as there are threads. Where there are many islands, each
//! thread does all passes to some of them before it goes on (`parts`).

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::super::{Backend, CheckedStep};
use super::begin_sweep;
use super::crew::Crew;
use super::groups::Groups;
use super::joints::JointGroups;
use super::parts::Parts;
use super::shared::Shared;
use super::sweep::{
    BodyWork, ContactWork, InstructionSet, JointWork, State, clear_impulses, extrapolate_velocities, integrate_spins,
    load_bodies, store_bodies,
};
use super::wide::{Row8, WIDTH, Wide};
use crate::error::Result;
use crate::kernels::momentum::{StepLength, chunked_sum, extrapolate, step_length};
use crate::kernels::{Inertia, Momentum, Step};
use crate::math::Vec3;
use crate::plan::{Kernel, Pass};
use crate::problem::{ConvergenceRow, Params, StepProblem};

/// Bodies and constraints that are not worth dividing: about 20 MB. Of 128 and 256 worlds with a pile of 100 (51,000 and 102,000)
/// a step took 0.87 and 0.60 of the time on one thread if divided, 1.1 and 0.75 on two; of 64 worlds 1.05 and 0.9.
const UNDIVIDED: usize = 60_000;

/// The backend of the processor.
pub struct Cpu {
    instructions: InstructionSet,
    /// Problems with fewer bodies and constraints are one part.
    undivided: usize,
    parts: Parts,
    bodies: Vec<State>,
    free: Vec<Row8>,
    accelerations: Vec<Row8>,
    groups: Groups,
    /// Of the points of the groups.
    impulses: Vec<[Wide; 4]>,
    convergence: ConvergenceRow,
    /// Unequal moments of inertia, and the slots of those who have them, in their order.
    inertias: Vec<(usize, Inertia<f32>)>,
    joints: JointGroups,
    joint_impulses: Vec<Vec3<f32>>,
    momentum: Momentum<f32>,
    /// What accelerated sweeps leave for each other: velocities of the sweep before, and what the joints' impulses were.
    velocities_before: Vec<Row8>,
    joint_steps: Vec<Step<f32>>,
    lengths: Vec<StepLength<f32>>,
}

impl Default for Cpu {
    fn default() -> Self {
        Self::new()
    }
}

impl Cpu {
    /// A backend on the best instruction set that the processor has.
    pub fn new() -> Self {
        Self::on(InstructionSet::best())
    }

    /// A backend on each instruction set that the processor has, to compare: first on what every processor has, last the best.
    pub fn each() -> impl Iterator<Item = Self> {
        InstructionSet::each().map(Self::on)
    }

    /// The same, but problems of more than `size` bodies and constraints are worked on in parts that fit in a core's cache, if they
    /// have small islands. No result depends on it.
    pub fn dividing_above(self, size: usize) -> Self {
        Self { undivided: size, ..self }
    }

    fn on(instructions: InstructionSet) -> Self {
        Self {
            instructions,
            undivided: UNDIVIDED,
            parts: Parts::default(),
            bodies: Vec::new(),
            free: Vec::new(),
            accelerations: Vec::new(),
            groups: Groups::default(),
            impulses: Vec::new(),
            convergence: ConvergenceRow::default(),
            inertias: Vec::new(),
            joints: JointGroups::default(),
            joint_impulses: Vec::new(),
            momentum: Momentum::default(),
            velocities_before: Vec::new(),
            joint_steps: Vec::new(),
            lengths: Vec::new(),
        }
    }

    fn load(&mut self, problem: &StepProblem, crew: &Crew) {
        self.parts.update(problem, self.undivided);
        let slots = &self.parts.slots;
        let len = self.parts.all_bodies().len() * WIDTH;
        self.bodies.clear();
        self.bodies.resize(len, State::default());
        self.free.clear();
        self.free.resize(len, Row8::default());
        self.accelerations.clear();
        self.accelerations.resize(len, Row8::default());
        let (bodies, accelerations) = (Shared::new(&mut self.bodies), Shared::new(&mut self.accelerations));
        in_groups(problem.bodies.len(), crew, &|range| load_bodies(problem, slots, range, &bodies, &accelerations));
        self.inertias.clear();
        self.inertias
            .extend(problem.inertias.iter().map(|row| (slots[row.body as usize] as usize, Inertia::load(row))));
        self.inertias.sort_unstable_by_key(|inertia| inertia.0);
        self.groups.load(problem, &self.parts, &mut self.impulses, crew);
        self.joints.load(problem, &self.parts);
        self.joint_impulses.clear();
        self.joint_impulses.extend(problem.joint_impulses.iter().map(|r| Vec3::load(r.linear)));
        self.convergence = problem.convergence;
        self.momentum = Momentum::load(&problem.momentum);
    }

    fn store(&self, problem: &mut StepProblem, crew: &Crew) {
        let (rows, slots) = (Shared::new(&mut problem.bodies), &self.parts.slots);
        in_groups(slots.len() - 1, crew, &|range| store_bodies(&self.bodies, slots, range, &rows));
        self.groups.store(problem, &self.impulses, crew);
        for (row, impulse) in problem.joint_impulses.iter_mut().zip(&self.joint_impulses) {
            row.linear = impulse.store();
        }
        problem.convergence = self.convergence;
        problem.momentum = self.momentum.store();
    }

    /// Runs neighboring passes that are [`stays_on_islands`], or one that is not.
    fn run_passes(&mut self, problem: &StepProblem, passes: &[Pass], crew: &Crew) {
        match passes[0].kernel {
            Kernel::BeginSweep { first } => begin_sweep(first, &mut self.convergence),
            Kernel::Extrapolate { first, measured } => {
                if !(measured && self.convergence.done != 0) {
                    self.extrapolate(first, crew);
                }
            }
            Kernel::MeasureStep => {
                // Rows that take no part do not move.
                self.lengths.clear();
                self.lengths.resize(problem.impulse_count(), StepLength::default());
                self.groups.measure_step(problem, &self.impulses, &mut self.lengths, crew);
                let joints = self.joint_impulses.iter().zip(&self.joint_steps);
                for (length, (now, step)) in self.lengths[problem.impulses.len()..].iter_mut().zip(joints) {
                    *length = step_length(*now, step);
                }
            }
            Kernel::UpdateMomentum => self.momentum.update(chunked_sum(&self.lengths)),
            _ => self.run_on_islands(problem, passes, crew),
        }
    }

    /// Small islands part by part, from the first of the passes to the last, then large ones pass by pass.
    fn run_on_islands(&mut self, problem: &StepProblem, passes: &[Pass], crew: &Crew) {
        let moving = AtomicBool::new(false);
        let field = Field {
            instructions: self.instructions,
            params: &problem.params,
            first_joint_color: problem.first_joint_color,
            parts: &self.parts,
            bodies: Shared::new(&mut self.bodies),
            free: Shared::new(&mut self.free),
            accelerations: &self.accelerations,
            inertias: &self.inertias,
            groups: &self.groups,
            impulses: Shared::new(&mut self.impulses),
            joints: &self.joints,
            joint_impulses: Shared::new(&mut self.joint_impulses),
            moving: &moving,
        };
        let is_needed = |pass: &&Pass| self.convergence.done == 0 || !pass.kernel.rules().is_some_and(|r| r.measured);
        let last = self.parts.count - 1;
        crew.spread_parts(0..last, &|parts| {
            for part in parts {
                for pass in passes.iter().filter(is_needed) {
                    field.run(pass, part, &|groups, work| work(groups));
                }
            }
        });
        for pass in passes.iter().filter(is_needed) {
            field.run(pass, last, &|groups, work| crew.spread(groups, work));
        }
        self.convergence.moving |= u32::from(moving.into_inner());
    }

    fn extrapolate(&mut self, first: bool, crew: &Crew) {
        if first {
            self.momentum.begin();
        }
        let factor = self.momentum.factor;
        let len = self.bodies.len();
        self.velocities_before.resize(len, Row8::default());
        let (bodies, before) = (Shared::new(&mut self.bodies), Shared::new(&mut self.velocities_before));
        crew.spread(0..len, &|range| extrapolate_velocities(first, factor, &bodies, &before, range));
        self.groups.extrapolate(first, factor, &mut self.impulses, crew);
        self.joint_steps.resize(self.joint_impulses.len(), Step::default());
        for (impulse, step) in self.joint_impulses.iter_mut().zip(&mut self.joint_steps) {
            *impulse = extrapolate(first, factor, *impulse, step);
        }
    }
}

/// Spreads work over bodies, sixteen of them as one.
fn in_groups(bodies: usize, crew: &Crew, work: &(dyn Fn(Range<usize>) + Sync)) {
    crew.spread(0..bodies.div_ceil(WIDTH), &|groups| work(WIDTH * groups.start..bodies.min(WIDTH * groups.end)));
}

/// Whether what a kernel does to an island depends on no other.
fn stays_on_islands(kernel: Kernel) -> bool {
    use Kernel::{BeginSweep, Extrapolate, MeasureStep, UpdateMomentum};
    !matches!(kernel, BeginSweep { .. } | Extrapolate { .. } | MeasureStep | UpdateMomentum)
}

/// All that passes work on, shared by threads that have different parts of it.
struct Field<'a> {
    instructions: InstructionSet,
    params: &'a Params,
    first_joint_color: u32,
    parts: &'a Parts,
    bodies: Shared<'a, State>,
    free: Shared<'a, Row8>,
    accelerations: &'a [Row8],
    inertias: &'a [(usize, Inertia<f32>)],
    groups: &'a Groups,
    impulses: Shared<'a, [Wide; 4]>,
    joints: &'a JointGroups,
    joint_impulses: Shared<'a, Vec3<f32>>,
    /// Set if a correction was above the tolerance.
    moving: &'a AtomicBool,
}

/// Has some work done to some groups, by one thread or by many.
type Spread<'a> = &'a dyn Fn(Range<usize>, &(dyn Fn(Range<usize>) + Sync));

impl Field<'_> {
    /// Does a pass to a part; no other task has the same.
    fn run(&self, pass: &Pass, part: usize, spread: Spread) {
        let (kernel, params, bodies, moving) = (pass.kernel, self.params, self.bodies, self.moving);
        match kernel {
            Kernel::IntegrateVelocities { .. } | Kernel::IntegratePositions => {
                let work = BodyWork { kernel, params, bodies, free: self.free, accelerations: self.accelerations };
                spread(self.parts.bodies(part), &|range| self.instructions.run(&work, range));
            }
            Kernel::IntegrateGyroscopic => {
                let slots = self.parts.bodies(part).start * WIDTH..self.parts.bodies(part).end * WIDTH;
                let [first, end] = [slots.start, slots.end].map(|slot| self.inertias.partition_point(|i| i.0 < slot));
                integrate_spins(params, &self.inertias[first..end], &bodies, &self.free);
            }
            Kernel::ClearImpulses => {
                for color in pass.colors.clone() {
                    let groups = self.groups.begins.of_color(part, color as usize);
                    clear_impulses(&self.impulses, self.groups.points_of(groups));
                }
            }
            Kernel::WarmStart(_) | Kernel::SolveContacts(_) | Kernel::ApplyRestitution(_) => {
                let (groups, points, impulses) = (&self.groups.all, &self.groups.points, self.impulses);
                let work = ContactWork { kernel, params, bodies, groups, points, impulses, moving };
                for color in pass.colors.clone() {
                    let groups = self.groups.begins.of_color(part, color as usize);
                    spread(groups, &|range| self.instructions.run(&work, range));
                }
            }
            Kernel::WarmStartJoints | Kernel::SolveJoints(_) => {
                let (groups, impulses) = (&self.joints.all, self.joint_impulses);
                let work = JointWork { kernel, params, bodies, groups, impulses, moving };
                for color in pass.colors.clone() {
                    let groups = self.joints.begins.of_color(part, (color - self.first_joint_color) as usize);
                    spread(groups, &|range| self.instructions.run(&work, range));
                }
            }
            Kernel::BeginSweep { .. } | Kernel::Extrapolate { .. } | Kernel::MeasureStep | Kernel::UpdateMomentum => {
                unreachable!("{kernel} does not stay on islands")
            }
        }
    }
}

impl Backend for Cpu {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> String {
        let threads = rayon::current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        format!("{threads} thread{plural}, {WIDTH} lanes, {}", self.instructions.name())
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        let widest = problem.bodies.len().max(problem.order.len()).div_ceil(WIDTH);
        Crew::lead(widest, |crew| {
            self.load(problem, crew);
            for passes in passes.chunk_by(|p, q| stays_on_islands(p.kernel) && stays_on_islands(q.kernel)) {
                self.run_passes(problem, passes, crew);
            }
            self.store(problem, crew);
        });
        Ok(())
    }
}
