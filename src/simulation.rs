//! Stepping a world: detect, color, prepare, plan, run, store.

use crate::backend::Backend;
use crate::backend::cpu::Reference;
use crate::collide::{Detector, Pair};
use crate::config::SolverConfig;
use crate::contacts::ContactProblem;
use crate::error::{Error, Result};
use crate::graph::ConstraintGraph;
use crate::metrics::Penetration;
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::{Prepared, StepProblem};
use crate::sleep::Sleep;
use crate::stats::{StepStats, timed};
use crate::world::World;

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
    /// The bodies. Poses, velocities, forces and joints may be changed between steps; number, shapes and kinds of bodies may
    /// not, and which bodies joints keep from colliding.
    pub world: World,
    config: SolverConfig,
    backend: Box<dyn Backend>,
    detector: Detector,
    sleep: Sleep,
    /// Joints of the problem that the plan is for.
    planned_joints: usize,
    graph: ConstraintGraph,
    joint_graph: ConstraintGraph,
    prepared: Prepared,
    problem: StepProblem,
    plan: StepPlan,
    /// Whether the backend keeps the rows of the last step on a device.
    on_device: bool,
}

impl Simulation {
    /// A simulation of `world` that has not moved yet.
    ///
    /// # Errors
    /// A setting is out of range or contradicts another; a body or joint of the world is not fit to be simulated.
    pub fn new(world: World, config: SolverConfig, backend: Box<dyn Backend>) -> Result<Self> {
        config.check()?;
        world.check()?;
        Ok(Self {
            detector: Detector::new(&world),
            sleep: Sleep::new(&world, &config),
            planned_joints: 0,
            world,
            config,
            backend,
            graph: ConstraintGraph::default(),
            joint_graph: ConstraintGraph::default(),
            prepared: Prepared::default(),
            problem: StepProblem::default(),
            plan: StepPlan::default(),
            on_device: false,
        })
    }

    /// Moves the world by `dt` seconds. Where everything sleeps that can, nothing is done.
    ///
    /// # Errors
    /// The backend cannot run the step; the world is then as it was.
    pub fn step(&mut self, dt: f32) -> Result<StepStats> {
        let mut stats = StepStats::default();
        if self.begin_step(dt, &mut stats) {
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
        if !self.begin_step(dt, &mut stats) {
            return Ok((ContactProblem { name: name.into(), ..ContactProblem::default() }, stats));
        }
        let forces = |p: &&Pass| matches!(p.kernel, Kernel::IntegrateVelocities { .. } | Kernel::IntegrateGyroscopic);
        let first: Vec<_> = self.plan.passes.iter().take_while(forces).cloned().collect();
        let mut problem = self.problem.clone();
        Reference::<f32>::new().run(&mut problem, &first)?;
        let contacts = ContactProblem::of_step(name.into(), &problem);
        self.end_step(dt, &mut stats)?;
        Ok((contacts, stats))
    }

    /// Assembles a step; false if there is nothing to do in it.
    fn begin_step(&mut self, dt: f32, stats: &mut StepStats) -> bool {
        timed(&mut stats.times.detect, || self.sleep.before_step(&self.world, &self.detector));
        if self.sleep.is_everything_still() {
            stats.asleep = self.sleep.count();
            return false;
        }
        self.assemble(dt, stats);
        true
    }

    /// Runs and stores what is assembled.
    fn end_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        let (carry, passes) = (&self.prepared.carry, &self.plan.passes);
        let ran = timed(&mut stats.times.run, || self.backend.step(&mut self.problem, passes, carry));
        if let Err(error) = ran {
            self.on_device = false;
            if carry.on_device {
                self.problem.forget_impulses();
            }
            return Err(error);
        }
        self.on_device = self.backend.keeps_rows();
        stats.traffic = self.backend.traffic();
        stats.kernels.extend_from_slice(self.backend.kernel_times());
        timed(&mut stats.times.store, || self.prepared.store(&self.problem, self.sleep.asleep(), &mut self.world));
        stats.sweeps = self.problem.convergence.sweeps;
        stats.planned_sweeps = self.problem.convergence.planned;
        let store = &mut stats.times.store;
        if timed(store, || self.sleep.after_step(&mut self.world, &self.detector, dt)) {
            // Who sleeps has its impulses in its manifolds.
            timed(store, || self.fetch());
        }
        stats.asleep = self.sleep.count();
        stats.first_non_finite = self.world.first_non_finite();
        Ok(())
    }

    /// Assembles the next step of `dt` seconds without running it: the problem as a value, and its plan.
    pub fn next_problem(&mut self, dt: f32) -> (&StepProblem, &StepPlan) {
        self.leave_device();
        self.sleep.before_step(&self.world, &self.detector);
        self.assemble(dt, &mut StepStats::default());
        (&self.problem, &self.plan)
    }

    /// Brings what only the backend has of the last step to the problem. What a lost device had is forgotten.
    fn fetch(&mut self) {
        if self.on_device && self.backend.fetch(&mut self.problem).is_err() {
            self.on_device = false;
            self.problem.forget_impulses();
        }
    }

    /// Lets the next step begin from the problem as it is here.
    fn leave_device(&mut self) {
        self.fetch();
        self.on_device = false;
    }

    /// Detects, colors, prepares and plans.
    fn assemble(&mut self, dt: f32, stats: &mut StepStats) {
        let times = &mut stats.times;
        let give_back = |pair: &mut Pair| self.prepared.give_back(&self.problem, pair);
        let found = timed(&mut times.detect, || {
            let (detector, sleep) = (&mut self.detector, &mut self.sleep);
            let mut found = detector.detect(&self.world, &self.config, dt, sleep.activity(), &give_back);
            // Who wakes takes part in this step already.
            while sleep.wake_touched(detector) {
                let reshaped = found.reshaped;
                found = detector.detect(&self.world, &self.config, dt, sleep.activity(), &give_back);
                found.reshaped |= reshaped;
            }
            found
        });
        timed(&mut times.color, || {
            self.prepared.color(&self.world, &mut self.detector, &mut self.graph, self.config.max_colors);
            self.prepared.color_joints(&self.world, &mut self.joint_graph, self.config.max_colors);
        });
        timed(&mut times.prepare, || {
            self.prepared.carry.on_device = self.on_device;
            self.prepared.prepare(
                &self.world,
                self.sleep.asleep(),
                &self.detector,
                &self.config,
                dt,
                &mut self.problem,
            );
            // Where nothing was computed, the plan of the last step is the plan of this one.
            let joints = self.problem.joints.len();
            let same = found.computed == 0 && !found.reshaped && joints == self.planned_joints;
            if !same || self.plan.passes.is_empty() {
                self.planned_joints = joints;
                self.plan = StepPlan::new(&self.config, &self.problem);
            }
        });
        stats.pairs = found.pairs;
        stats.computed = found.computed;
        stats.manifolds = self.problem.contacts.len();
        stats.points = self.problem.point_count(0..stats.manifolds);
        stats.joints = self.problem.joints.len();
        stats.colors = self.prepared.coloring.color_count();
        stats.overflow = self.prepared.coloring.overflow as usize;
        stats.dispatches = self.plan.passes.len();
        stats.bytes_moved = self.plan.bytes_moved(&self.problem);
    }

    /// Whether a body sleeps; see [`SolverConfig::sleep_after`].
    pub fn is_asleep(&self, body: usize) -> bool {
        self.sleep.asleep().get(body) == Some(&true)
    }

    /// Wakes a body, if it sleeps, and all that lies still with it: for those who change what the next step cannot see, such as a
    /// joint to the world.
    pub fn wake(&mut self, body: usize) {
        self.sleep.wake(body);
    }

    /// Overlap of the world as it is now, from contacts computed anew. The next step is as if nobody had asked: towers of 60
    /// that stand for 20 s fall if their contacts are recomputed now and then, since reused contacts do not creep.
    pub fn penetration(&self) -> Penetration {
        Penetration::of_world(&self.world, &self.config)
    }

    /// Contacts and impulses of the last step.
    pub fn pairs(&mut self) -> impl Iterator<Item = &Pair> + Clone {
        self.world_and_pairs().1
    }

    /// The bodies, and contacts and impulses of the last step.
    pub fn world_and_pairs(&mut self) -> (&World, impl Iterator<Item = &Pair> + Clone) {
        self.fetch();
        let pairs = self.detector.pairs_mut().flatten();
        pairs.for_each(|pair| self.prepared.give_back(&self.problem, pair));
        (&self.world, self.detector.pairs())
    }

    /// Impulse of each joint of the world on its body b, in the last substep, world axes [N s].
    pub fn joint_impulses(&self) -> &[glam::Vec3] {
        self.prepared.joint_impulses()
    }

    /// Changes the settings from the next step on.
    ///
    /// # Errors
    /// One is out of range or contradicts another; they are then as they were.
    pub fn set_config(&mut self, config: SolverConfig) -> Result<()> {
        config.check()?;
        self.leave_device();
        self.config = config;
        self.plan = StepPlan::default();
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
        &self.problem
    }

    /// The last step's plan.
    pub fn plan(&self) -> &StepPlan {
        &self.plan
    }

    /// What runs the steps.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }
}
