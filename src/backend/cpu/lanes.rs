//! The kernels over sixteen lanes and all threads: sixteen constraints of one color at a time.
//!
//! The same kernel text as the reference, over another lane type, so the results are the reference's to the last bit.
//! Contacts of one color and one number of points stand in groups of sixteen, lane by lane; what does not fill a group is
//! filled up with contacts of nothing with nothing. The instruction set is chosen at run time. Color order makes the
//! order inside a pass irrelevant, so a pass can be cut into as many tasks as there are threads.

use std::sync::atomic::{AtomicBool, Ordering};

use super::super::Backend;
use super::begin_sweep;
use super::crew::Crew;
use super::groups::Groups;
use super::joints::JointGroups;
use super::shared::Shared;
use super::sweep::{
    BodyWork, ContactWork, InstructionSet, JointWork, State, Work, extrapolate_velocities, velocity_row,
};
use super::wide::{Row8, WIDTH, Wide};
use crate::error::Result;
use crate::kernels::integrate::integrate_gyroscopic;
use crate::kernels::momentum::{StepLength, chunked_sum, extrapolate, step_length};
use crate::kernels::{Free, Inertia, Momentum, Step, StepParams};
use crate::math::{Vec3, vec3};
use crate::plan::{Kernel, Pass};
use crate::problem::{BodyRow, ConvergenceRow, MassRow, StepProblem};

/// The backend of the processor.
pub struct Cpu {
    instructions: InstructionSet,
    bodies: Vec<State>,
    accelerations: Vec<Row8>,
    groups: Groups,
    convergence: ConvergenceRow,
    inertias: Vec<Inertia<f32>>,
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

    fn on(instructions: InstructionSet) -> Self {
        Self {
            instructions,
            bodies: Vec::new(),
            accelerations: Vec::new(),
            groups: Groups::default(),
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
        let state = |(body, mass): (&BodyRow, &MassRow)| {
            let (body, mass): (&[f32; 16], &[f32; 12]) = (bytemuck::cast_ref(body), bytemuck::cast_ref(mass));
            let row = |from: &[f32]| Row8(std::array::from_fn(|i| from[i]));
            State { velocity: row(&body[..8]), movement: row(&body[8..]), mass: row(&mass[..8]), free: Row8::default() }
        };
        self.bodies.clear();
        self.bodies.extend(problem.bodies.iter().zip(&problem.masses).map(state));
        // One more that nothing moves, for lanes without a contact, and some to fill the last group of bodies.
        self.bodies.resize((problem.bodies.len() + 1).next_multiple_of(WIDTH), State::default());
        self.accelerations.clear();
        self.accelerations.extend(problem.masses.iter().map(|row| {
            let [x, y, z] = row.acceleration;
            Row8([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0])
        }));
        self.accelerations.resize(self.bodies.len(), Row8::default());
        self.inertias.clear();
        self.inertias.extend(problem.inertias.iter().map(Inertia::load));
        self.joints.load(problem);
        self.joint_impulses.clear();
        self.joint_impulses.extend(problem.joint_impulses.iter().map(|r| Vec3::load(r.linear)));
        self.convergence = problem.convergence;
        self.momentum = Momentum::load(&problem.momentum);
        self.groups.load(problem, crew);
    }

    fn store(&self, problem: &mut StepProblem, crew: &Crew) {
        self.store_bodies(problem);
        self.groups.store(problem, crew);
        for (row, impulse) in problem.joint_impulses.iter_mut().zip(&self.joint_impulses) {
            row.linear = impulse.store();
        }
        problem.convergence = self.convergence;
        problem.momentum = self.momentum.store();
    }

    fn store_bodies(&self, problem: &mut StepProblem) {
        for (row, state) in problem.bodies.iter_mut().zip(&self.bodies) {
            let all: &mut [f32; 16] = bytemuck::cast_mut(row);
            all[..8].copy_from_slice(&state.velocity.0);
            all[8..].copy_from_slice(&state.movement.0);
        }
    }

    fn run_pass(&mut self, problem: &StepProblem, pass: &Pass, crew: &Crew) {
        match pass.kernel {
            Kernel::BeginSweep { first } => begin_sweep(first, &mut self.convergence),
            Kernel::ClearImpulses => {
                for impulse in &mut self.groups.impulses {
                    impulse[..3].fill(Wide::default());
                }
            }
            Kernel::IntegrateVelocities { .. } | Kernel::IntegratePositions => {
                let groups = 0..self.bodies.len() / WIDTH;
                let (kernel, params) = (pass.kernel, &problem.params);
                let bodies = Shared::new(&mut self.bodies);
                let (instructions, accelerations) = (self.instructions, &self.accelerations);
                let work = BodyWork { kernel, params, bodies, accelerations };
                crew.spread(groups, &|range| instructions.run(&work, range));
            }
            Kernel::WarmStart(_)
            | Kernel::SolveContacts(_)
            | Kernel::ApplyRestitution(_)
            | Kernel::WarmStartJoints
            | Kernel::SolveJoints(_) => {
                if !(pass.kernel.rules().is_some_and(|r| r.measured) && self.convergence.done != 0) {
                    self.sweep(problem, pass, crew);
                }
            }
            Kernel::IntegrateGyroscopic => {
                let params = StepParams::load(&problem.params);
                for (row, inertia) in problem.inertias.iter().zip(&self.inertias) {
                    let i = row.body as usize;
                    let mut body = self.bodies[i].load();
                    let [vx, vy, vz, _, wx, wy, wz, _] = self.bodies[i].free.0;
                    let mut free = Free { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz) };
                    integrate_gyroscopic(&params, inertia, &mut body, &mut free);
                    self.bodies[i].store_velocity(&body);
                    self.bodies[i].free = velocity_row(free.v, free.w);
                }
            }
            Kernel::Extrapolate { first, measured } => {
                if !(measured && self.convergence.done != 0) {
                    self.extrapolate(first, crew);
                }
            }
            Kernel::MeasureStep => {
                self.lengths.resize(problem.impulse_count(), StepLength::default());
                self.groups.measure_step(problem, &mut self.lengths, crew);
                let joints = self.joint_impulses.iter().zip(&self.joint_steps);
                for (length, (now, step)) in self.lengths[problem.impulses.len()..].iter_mut().zip(joints) {
                    *length = step_length(*now, step);
                }
            }
            Kernel::UpdateMomentum => self.momentum.update(chunked_sum(&self.lengths)),
        }
    }

    /// The contacts, or joints, of the colors of a pass.
    fn sweep(&mut self, problem: &StepProblem, pass: &Pass, crew: &Crew) {
        let (kernel, params, moving) = (pass.kernel, &problem.params, &AtomicBool::new(false));
        let (instructions, bodies) = (self.instructions, Shared::new(&mut self.bodies));
        if matches!(kernel, Kernel::WarmStartJoints | Kernel::SolveJoints(_)) {
            let impulses = Shared::new(&mut self.joint_impulses);
            let work = JointWork { kernel, params, bodies, groups: &self.joints.all, impulses, moving };
            let colors = pass.colors.clone().map(|color| color - problem.first_joint_color);
            over_colors(instructions, &work, &self.joints.colors, colors, crew);
        } else {
            let Groups { all: groups, colors, points, impulses, .. } = &mut self.groups;
            let work = ContactWork { kernel, params, bodies, groups, points, impulses: Shared::new(impulses), moving };
            over_colors(instructions, &work, colors, pass.colors.clone(), crew);
        }
        self.convergence.moving |= u32::from(moving.load(Ordering::Relaxed));
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
        self.groups.extrapolate(first, factor, crew);
        self.joint_steps.resize(self.joint_impulses.len(), Step::default());
        for (impulse, step) in self.joint_impulses.iter_mut().zip(&mut self.joint_steps) {
            *impulse = extrapolate(first, factor, *impulse, step);
        }
    }
}

/// Does one color after another; where the groups of each begin, and where the last ends, say `begins`.
fn over_colors(
    instructions: InstructionSet,
    work: &impl Work,
    begins: &[u32],
    colors: impl Iterator<Item = u32>,
    crew: &Crew,
) {
    for color in colors.map(|color| color as usize) {
        let groups = begins[color] as usize..begins[color + 1] as usize;
        crew.spread(groups, &|range| instructions.run(work, range));
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

    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()> {
        let widest = problem.bodies.len().max(problem.contacts.len()).max(problem.joints.len()).div_ceil(WIDTH);
        Crew::lead(widest, |crew| {
            self.load(problem, crew);
            for pass in passes {
                self.run_pass(problem, pass, crew);
            }
            self.store(problem, crew);
        });
        Ok(())
    }
}
