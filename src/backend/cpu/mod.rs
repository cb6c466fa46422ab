//! The CPU backends: [`Reference`] runs one constraint at a time, and [`Cpu`] runs the same kernels with sixteen lanes
//! and all threads.
//!
//! Both run the same kernel text over different lane types, so their results have the same bits. Contacts of one color
//! with the same number of points form groups of sixteen, one for each lane. Contacts of a placeholder body fill the
//! unused lanes. The instruction set is chosen at run time. The order inside a color does not matter, so a pass can be
//! cut into as many tasks as there are threads. If there are many islands, each thread runs all passes over some of
//! them before it takes the next (`partition.rs`).

mod bodies;
mod constraint;
mod joint_systems;
mod lane_group;
mod lane_layout;
mod lane_rows;
mod partition;
mod reference;
mod shared_step;
mod sweep;
#[cfg(test)]
mod tests;
mod threads;
mod traffic;
mod transfer;

pub use reference::Reference;

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::{Backend, CheckedStep};
use crate::error::Result;
use crate::kernels::Momentum;
use crate::kernels::convergence::begin_sweep;
use crate::kernels::momentum::{StepLength, chunked_sum};
use crate::lanes::{InstructionSet, Row8, Shared, WIDTH};
use crate::plan::{Kernel, Pass};
use crate::problem::{ContactRow, ConvergenceRow, JointRow, MassRow, StepProblem};
use bodies::{State, extrapolate_velocities, load_bodies, place, spin_rows, store_bodies};
use joint_systems::{SharedFactors, SystemLayout, SystemsFactors};
use lane_layout::{LaneLayout, Uses};
use lane_rows::{LaneImpulses, LanePoints};
use partition::Partition;
use shared_step::{SharedStep, Spread};
use threads::Threads;
use transfer::BodyPlace;

/// Number of bodies and constraints up to which division does not pay: about 20 MB. For 128 and 256 worlds with a pile
/// of 100 (51,000 and 102,000), a divided step took 0.87 and 0.60 of the time on one thread, and 1.1 and 0.75 on two.
/// For 64 worlds it took 1.05 and 0.9.
const UNDIVIDED: usize = 60_000;

/// The backend of the processor.
#[derive(Default)]
pub struct Cpu {
    instructions: InstructionSet,
    /// Problems with fewer bodies and constraints are one part; `None` means [`UNDIVIDED`].
    undivided: Option<usize>,
    partition: Partition,
    places: Vec<BodyPlace>,
    bodies: Vec<State>,
    free: Vec<Row8>,
    accelerations: Vec<Row8>,
    /// Rows of damping; empty if no body is damped.
    dampings: Vec<Row8>,
    /// Unequal moments of inertia, in the order of slots.
    inertias: Vec<(u32, [Row8; 2])>,
    contacts: LaneLayout<ContactRow>,
    contact_points: LanePoints,
    contact_impulses: LaneImpulses,
    /// Their sums over the substeps.
    contact_totals: LaneImpulses,
    joints: LaneLayout<JointRow>,
    joint_axes: LanePoints,
    joint_impulses: LaneImpulses,
    /// Their sums over the substeps.
    joint_totals: LaneImpulses,
    /// Joints in systems: their places, factors and corrections.
    systems: SystemLayout,
    factors: SystemsFactors,
    /// Inertia of their bodies at the start of the step, in the order of slots.
    turning: Vec<(u32, Row8)>,
    joint_changes: LaneImpulses,
    convergence: ConvergenceRow,
    momentum: Momentum<f32>,
    /// Velocities of the previous accelerated sweep.
    velocities_before: Vec<Row8>,
    lengths: Vec<StepLength<f32>>,
}

impl Cpu {
    /// A backend with the best instruction set of the processor.
    pub fn new() -> Self {
        Self::default()
    }

    /// A backend for each instruction set of the processor, for comparisons: the portable one first, the best one last.
    pub fn each() -> impl Iterator<Item = Self> {
        InstructionSet::each().map(|instructions| Self { instructions, ..Self::default() })
    }

    /// The same, but a problem with small islands and more than `size` bodies and constraints is divided into parts
    /// that fit into a core's cache. No result depends on `size`.
    pub fn dividing_above(self, size: usize) -> Self {
        Self { undivided: Some(size), ..self }
    }

    fn load(&mut self, problem: &StepProblem, passes: &[Pass], threads: &Threads) {
        self.partition.update(problem, self.undivided.unwrap_or(UNDIVIDED));
        let slots = &self.partition.slots;
        let len = self.partition.all_bodies().len() * WIDTH;
        reset(&mut self.bodies, len);
        reset(&mut self.free, len);
        reset(&mut self.accelerations, len);
        let (bodies, accelerations) = (Shared::new(&mut self.bodies), Shared::new(&mut self.accelerations));
        in_groups(problem.bodies.len(), threads, &|range| load_bodies(problem, slots, range, &bodies, &accelerations));
        self.dampings.clear();
        if !problem.dampings.is_empty() {
            self.dampings.resize(len, Row8::default());
            for (&slot, row) in slots.iter().zip(&problem.dampings) {
                self.dampings[slot as usize] = Row8(bytemuck::cast(*row));
            }
        }
        self.inertias.clear();
        self.inertias.extend(problem.inertias.iter().map(|row| (slots[row.body as usize], spin_rows(row))));
        self.inertias.sort_unstable_by_key(|inertia| inertia.0);
        self.places.clear();
        self.places.extend(slots.iter().enumerate().map(|(body, &slot)| {
            let MassRow { inv_mass, locks, .. } = problem.masses.get(body).copied().unwrap_or_default();
            BodyPlace { place: place(slot as usize), is_movable: inv_mass > 0.0, has_locks: locks > 0.0 }
        }));
        let on = (self.instructions, threads);
        let is_any = |uses: fn(Kernel) -> bool| passes.iter().any(|pass| uses(pass.kernel));
        let uses = Uses { bounces: is_any(Kernel::keeps_bounces), pull_or_slip: is_any(Kernel::reads_pull_or_slip) };
        let rows = (&mut self.contact_points, &mut self.contact_impulses);
        self.contacts.load(problem, &self.partition, &self.places, rows, uses, on);
        self.contact_totals.resize(0, false);
        if !problem.totals.is_empty() {
            let totals = bytemuck::cast_slice(&problem.totals);
            self.contacts.load_sums(problem, totals, &mut self.contact_totals, threads);
        }
        // The last numbers of axes are stored in the places of those of points.
        let uses = Uses { bounces: false, pull_or_slip: true };
        let rows = (&mut self.joint_axes, &mut self.joint_impulses);
        self.joints.load(problem, &self.partition, &self.places, rows, uses, on);
        self.joint_totals.resize(0, false);
        if !problem.joint_totals.is_empty() {
            let totals = bytemuck::cast_slice(&problem.joint_totals);
            self.joints.load_sums(problem, totals, &mut self.joint_totals, threads);
        }
        self.systems.load(problem, &self.partition, &self.joints, &mut self.factors);
        self.turning.clear();
        self.turning.extend(problem.turning.iter().map(|row| {
            let mass: &[f32; 12] = bytemuck::cast_ref(&problem.masses[row.body as usize]);
            let mut begin = Row8(std::array::from_fn(|i| mass[i]));
            begin.0[..3].copy_from_slice(&row.inv_inertia_x);
            begin.0[4..7].copy_from_slice(&row.inv_inertia_yz);
            (slots[row.body as usize], begin)
        }));
        self.turning.sort_unstable_by_key(|row| row.0);
        self.joint_changes.resize(self.joint_impulses.normals.len(), false);
        self.convergence = problem.convergence;
        self.momentum = Momentum::load(&problem.momentum);
    }

    fn store(&self, problem: &mut StepProblem, threads: &Threads) {
        let (rows, slots) = (Shared::new(&mut problem.bodies), &self.partition.slots);
        in_groups(slots.len() - 1, threads, &|range| store_bodies(&self.bodies, slots, range, &rows));
        let on = (self.instructions, threads);
        let impulses = bytemuck::cast_slice_mut(&mut problem.impulses);
        self.contacts.store(&problem.contacts, &self.contact_impulses, impulses, on);
        if !problem.totals.is_empty() {
            let totals = bytemuck::cast_slice_mut(&mut problem.totals);
            self.contacts.store(&problem.contacts, &self.contact_totals, totals, on);
        }
        let impulses = bytemuck::cast_slice_mut(&mut problem.joint_impulses);
        self.joints.store(&problem.joints, &self.joint_impulses, impulses, on);
        if !problem.joint_totals.is_empty() {
            let totals = bytemuck::cast_slice_mut(&mut problem.joint_totals);
            self.joints.store(&problem.joints, &self.joint_totals, totals, on);
        }
        problem.convergence = self.convergence;
        problem.momentum = self.momentum.store();
    }

    /// Runs consecutive passes that all stay on islands, or one that does not.
    fn run_passes(&mut self, problem: &StepProblem, passes: &[Pass], threads: &Threads) {
        match passes[0].kernel {
            Kernel::BeginSweep { first } => begin_sweep(first, &mut self.convergence),
            Kernel::Extrapolate { measured: true, .. } if self.convergence.done != 0 => {}
            Kernel::Extrapolate { first, .. } => self.extrapolate(first, threads),
            Kernel::MeasureStep => {
                // Rows that are not part of the sweep do not move.
                reset(&mut self.lengths, problem.impulse_count());
                let (contacts, joints) = self.lengths.split_at_mut(problem.impulses.len());
                self.contacts.measure_step(problem, &self.contact_impulses, contacts, threads);
                self.joints.measure_step(problem, &self.joint_impulses, joints, threads);
            }
            Kernel::UpdateMomentum => self.momentum.update(chunked_sum(&self.lengths)),
            _ => self.run_on_islands(problem, passes, threads),
        }
    }

    /// Runs small islands part by part, from the first pass to the last, then large islands pass by pass.
    fn run_on_islands(&mut self, problem: &StepProblem, passes: &[Pass], threads: &Threads) {
        let moving = AtomicBool::new(false);
        let shared = SharedStep {
            instructions: self.instructions,
            params: &problem.params,
            blocks: &problem.blocks,
            partition: &self.partition,
            bodies: Shared::new(&mut self.bodies),
            free: Shared::new(&mut self.free),
            accelerations: &self.accelerations,
            dampings: &self.dampings,
            inertias: &self.inertias,
            contacts: &self.contacts,
            contact_points: self.contact_points.shared(),
            contact_impulses: self.contact_impulses.shared(),
            contact_totals: self.contact_totals.shared(),
            joints: &self.joints,
            joint_axes: self.joint_axes.shared(),
            joint_impulses: self.joint_impulses.shared(),
            joint_totals: self.joint_totals.shared(),
            problem,
            systems: &self.systems,
            turning: &self.turning,
            factors: SharedFactors::new(&mut self.factors),
            joint_changes: self.joint_changes.shared(),
            moving: &moving,
        };
        let is_needed = |pass: &&Pass| self.convergence.done == 0 || !pass.kernel.is_measured();
        let for_one = &self.partition.blocks;
        threads.spread_each(0..for_one.len(), &|parts| {
            for part in parts {
                for pass in passes.iter().filter(is_needed).filter(|pass| pass.block == for_one[part]) {
                    let alone: Spread = &|groups, work| work(groups);
                    shared.run(pass, part, alone, alone);
                }
            }
        });
        for pass in passes.iter().filter(is_needed) {
            let part = for_one.len() + pass.block as usize;
            shared.run(pass, part, &|groups, work| threads.spread(groups, work), &|systems, work| {
                threads.spread_each(systems, work);
            });
        }
        self.convergence.moving |= u32::from(moving.into_inner());
    }

    fn extrapolate(&mut self, first: bool, threads: &Threads) {
        if first {
            self.momentum.begin();
        }
        let factor = self.momentum.factor;
        let len = self.bodies.len();
        self.velocities_before.resize(len, Row8::default());
        let (bodies, before) = (Shared::new(&mut self.bodies), Shared::new(&mut self.velocities_before));
        threads.spread(0..len, &|range| extrapolate_velocities(first, factor, &bodies, &before, range));
        self.contacts.extrapolate(first, factor, &mut self.contact_impulses, threads);
        self.joints.extrapolate(first, factor, &mut self.joint_impulses, threads);
    }
}

/// Fills a list with `len` default values.
fn reset<T: Clone + Default>(rows: &mut Vec<T>, len: usize) {
    rows.clear();
    rows.resize(len, T::default());
}

/// Spreads work over bodies, in groups of sixteen.
fn in_groups(bodies: usize, threads: &Threads, work: &(dyn Fn(Range<usize>) + Sync)) {
    threads.spread(0..bodies.div_ceil(WIDTH), &|groups| work(WIDTH * groups.start..bodies.min(WIDTH * groups.end)));
}

/// Whether the effect of a kernel on an island does not depend on other islands.
fn stays_on_islands(kernel: Kernel) -> bool {
    use Kernel::{BeginSweep, Extrapolate, MeasureStep, UpdateMomentum};
    !matches!(kernel, BeginSweep { .. } | Extrapolate { .. } | MeasureStep | UpdateMomentum)
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
        Threads::lead(widest, |threads| {
            self.load(problem, passes, threads);
            for passes in passes.chunk_by(|p, q| stays_on_islands(p.kernel) && stays_on_islands(q.kernel)) {
                self.run_passes(problem, passes, threads);
            }
            self.store(problem, threads);
        });
        Ok(())
    }
}
