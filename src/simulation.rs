//! Stepping a world: detect, color, prepare, plan, run, store.

mod manifolds;
mod stages;

use crate::backend::cpu::Reference;
use crate::backend::{Backend, CheckedStep};
use crate::config::{SolverConfig, check_step_length};
use crate::contacts::ContactProblem;
use crate::error::{Error, Result};
use crate::metrics::Penetration;
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::StepProblem;
use crate::stats::{StepStats, timed};
use crate::world::World;
use stages::{Changes, Stages};

pub use manifolds::{SolvedManifold, SolvedPoint};

/// A world that moves.
///
/// ```
/// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World};
///
/// let mut world = World::new();
/// world.add(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
/// let brick = world.add(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 1.0, 0.0));
/// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// for _ in 0..60 {
///     simulation.step(1.0 / 60.0)?;
/// }
/// assert!((simulation.world.bodies[brick].position.y - 0.5).abs() < 0.01);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Simulation {
    /// The bodies, with their moments of inertia raised where they are too small ([`MassProperties::MOST_LEVERAGE`](crate::MassProperties::MOST_LEVERAGE)).
    /// Between steps, all of it may change: bodies and joints may come and go, and gravity, poses, velocities, forces, masses, materials, kinds and
    /// shapes may become others. The next step finds the changes. Contacts of bodies that stay keep their impulses, but for those of a
    /// body that changed its kind or shapes.
    pub world: World,
    config: SolverConfig,
    backend: Box<dyn Backend>,
    /// All state that lasts from step to step, except the copy of a device.
    stages: Stages,
    /// Whether the backend keeps the rows of the last step on a device.
    on_device: bool,
}

impl Simulation {
    /// A simulation of `world` that has not moved yet.
    ///
    /// # Errors
    /// A setting is out of range or contradicts another; a body or joint of the world is not fit to be simulated.
    pub fn new(mut world: World, config: SolverConfig, backend: Box<dyn Backend>) -> Result<Self> {
        config.check()?;
        world.check()?;
        world.raise_inertias();
        Ok(Self { stages: Stages::new(&world, &config), world, config, backend, on_device: false })
    }

    /// Moves the world by `dt` seconds. Where everything sleeps that can, nothing is done.
    ///
    /// # Errors
    /// `dt` is not from [`SHORTEST_STEP`](crate::config::SHORTEST_STEP) to [`LONGEST_STEP`](crate::config::LONGEST_STEP); a body that came or changed, a
    /// joint or a mass is not fit to be simulated; the backend cannot run the step. The world is then as it was.
    pub fn step(&mut self, dt: f32) -> Result<StepStats> {
        let mut stats = StepStats::default();
        if self.begin_step(dt, &mut stats)? {
            self.end_step(dt, &mut stats)?;
        }
        Ok(stats)
    }

    /// Moves the world by `dt` seconds, and gives what the first substep asked of the velocities as a contact problem by
    /// itself: [`ContactProblem::of_step`]. Without contacts where nothing touches that is awake.
    ///
    /// # Errors
    /// As [`Simulation::step`], or the world has joints, which a contact problem has not.
    pub fn step_with_contacts(&mut self, name: &str, dt: f32) -> Result<(ContactProblem, StepStats)> {
        if !self.world.joints.is_empty() {
            let joints = self.world.joints.len();
            return Err(Error::input(format!("{name} has {joints} joints: a contact problem has none")));
        }
        self.leave_device();
        let mut stats = StepStats::default();
        if !self.begin_step(dt, &mut stats)? {
            return Ok((ContactProblem { name: name.into(), ..ContactProblem::default() }, stats));
        }
        use Kernel::{BeginChanges, EndChanges, IntegrateGyroscopic, IntegrateVelocities};
        let forces =
            |p: &&Pass| matches!(p.kernel, BeginChanges | IntegrateVelocities { .. } | IntegrateGyroscopic { .. });
        let blocks = self.stages.plan.passes.chunk_by(|p, q| p.block == q.block);
        let first: Vec<_> = blocks
            .flat_map(|own| own.iter().take_while(forces).chain(own.iter().filter(|p| p.kernel == EndChanges)))
            .cloned()
            .collect();
        let mut problem = self.stages.problem.clone();
        Reference::<f32>::new().run(&mut problem, &first)?;
        let contacts = ContactProblem::of_step(name.into(), &problem);
        self.end_step(dt, &mut stats)?;
        Ok((contacts, stats))
    }

    /// The changes of the caller since the last step.
    fn changes(&mut self, dt: f32) -> Result<Changes> {
        let changes = self.stages.changes(&self.world, &self.config, dt)?;
        if changes.surfaces() {
            self.world.raise_inertias();
        }
        Ok(changes)
    }

    /// Assembles a step; false if there is nothing to do in it.
    fn begin_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<bool> {
        check_step_length(dt)?;
        let changes = timed(&mut stats.times.detect, || self.changes(dt))?;
        if changes.all_rows() || self.stages.contacts.are_unsorted() {
            self.leave_device();
        }
        self.stages.follow(&self.world, &self.config, dt, &changes);
        if self.stages.is_everything_still(&self.world, stats) {
            return Ok(false);
        }
        if self.stages.find(&self.world, &self.config, dt, stats) {
            self.leave_device();
        }
        self.stages.prepare(&self.world, &self.config, dt, self.on_device, stats);
        Ok(true)
    }

    /// Runs and stores what is assembled.
    fn end_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        let stages = &mut self.stages;
        let (carry, passes) = (&stages.contacts.carry, &stages.plan.passes);
        let step = CheckedStep::built(&mut stages.problem, passes);
        let ran = timed(&mut stats.times.run, || self.backend.step(step, carry));
        if let Err(error) = ran {
            self.on_device = false;
            if carry.on_device {
                stages.problem.forget_impulses();
            }
            return Err(error);
        }
        self.on_device = self.backend.keeps_rows();
        stats.traffic = self.backend.traffic();
        stats.kernels.extend_from_slice(self.backend.kernel_times());
        timed(&mut stats.times.store, || stages.store(&mut self.world, dt));
        let convergence = &self.stages.problem.convergence;
        (stats.sweeps, stats.planned_sweeps) = (convergence.sweeps, convergence.planned);
        stats.asleep = self.stages.sleep.count();
        stats.first_non_finite = self.world.first_non_finite();
        Ok(())
    }

    /// The next step of `dt` seconds as values, the problem and its plan. The call changes nothing of the run.
    ///
    /// # Errors
    /// As [`Simulation::step`], the backend apart.
    pub fn next_problem(&mut self, dt: f32) -> Result<(StepProblem, StepPlan)> {
        check_step_length(dt)?;
        self.fetch();
        let changes = self.changes(dt)?;
        let mut next = self.stages.clone();
        next.follow(&self.world, &self.config, dt, &changes);
        next.is_everything_still(&self.world, &mut StepStats::default());
        next.find(&self.world, &self.config, dt, &mut StepStats::default());
        next.prepare(&self.world, &self.config, dt, false, &mut StepStats::default());
        Ok((next.problem, next.plan))
    }

    /// Brings impulses and preloads that only the backend has to the problem. The problem forgets those of a lost device.
    fn fetch(&mut self) {
        if self.on_device && self.backend.fetch(&mut self.stages.problem).is_err() {
            self.on_device = false;
            self.stages.problem.forget_impulses();
        }
    }

    /// Lets the next step begin from the problem as it is here.
    fn leave_device(&mut self) {
        self.fetch();
        self.on_device = false;
    }

    /// The world, without all that the next step would begin from.
    pub fn into_world(self) -> World {
        self.world
    }

    /// Whether a body sleeps; see [`SolverConfig::sleep_after`].
    pub fn is_asleep(&self, body: usize) -> bool {
        self.stages.sleep.asleep().get(body) == Some(&true)
    }

    /// The substeps that a body takes in a step; see [`SolverConfig::max_substeps`].
    pub fn substeps_of(&self, body: usize) -> u32 {
        self.config.substeps << self.stages.effort.class_of(body)
    }

    /// Wakes the island of a body, if the body sleeps. A change of a sleeping body itself, of gravity or of a
    /// joint wakes it anyway.
    pub fn wake(&mut self, body: usize) {
        self.stages.sleep.wake(body);
    }

    /// Overlap of the world as it is now, from contacts computed anew. The call does not change the next step: towers of 60
    /// that stand for 20 s fall if their contacts are recomputed now and then, since reused contacts do not creep.
    pub fn penetration(&self) -> Penetration {
        Penetration::of_world(&self.world, &self.config)
    }

    /// The manifolds of the last step, with their impulses.
    pub fn manifolds(&mut self) -> impl Iterator<Item = SolvedManifold> + Clone {
        self.fetch();
        let Stages { detector, contacts, problem, .. } = &self.stages;
        manifolds::of(detector, contacts, problem, self.stages.least_substeps())
    }

    /// Overlap when the last step began, from the contacts that it went by.
    pub fn solved_penetration(&mut self) -> Penetration {
        let separations = |m: SolvedManifold| (0..m.points().len()).map(move |k| m.points()[k].separation);
        Penetration::of(self.manifolds().map(separations))
    }

    /// Impulse of each joint of the world on its body b, in the last of the substeps ([`Self::substeps_of`]), world axes (N s).
    pub fn joint_impulses(&self) -> Vec<glam::Vec3> {
        let problem = &self.stages.problem;
        let of_anchors = |i: usize| glam::Vec3::from(problem.joint_impulses[i].linear);
        (0..problem.joints.len()).map(|i| of_anchors(i) + problem.axis_impulse(i, true)).collect()
    }

    /// Angular impulse of each joint of the world on its body b about the anchor, in the last of the substeps, world axes (N m s): that of
    /// locks, limits, motors and springs of angles. A torque (N m) is that over the length of the substep.
    pub fn joint_angular_impulses(&self) -> Vec<glam::Vec3> {
        let problem = &self.stages.problem;
        (0..problem.joints.len()).map(|i| problem.axis_impulse(i, false)).collect()
    }

    /// Changes the settings from the next step on.
    ///
    /// # Errors
    /// One is out of range or contradicts another; they are then as they were.
    pub fn set_config(&mut self, config: SolverConfig) -> Result<()> {
        config.check()?;
        self.config = config;
        Ok(())
    }

    /// Changes what runs the steps, from the next one on; returns what ran them so far.
    pub fn set_backend(&mut self, backend: Box<dyn Backend>) -> Box<dyn Backend> {
        self.leave_device();
        std::mem::replace(&mut self.backend, backend)
    }

    /// The settings.
    pub fn config(&self) -> &SolverConfig {
        &self.config
    }

    /// The last step's problem, with the impulses that solved it.
    pub fn problem(&mut self) -> &StepProblem {
        self.fetch();
        &self.stages.problem
    }

    /// The last step's plan.
    pub fn plan(&self) -> &StepPlan {
        &self.stages.plan
    }

    /// The backend.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }
}
