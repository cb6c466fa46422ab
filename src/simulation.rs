//! Stepping a world: detect, color, prepare, plan, run, store.

#[cfg(test)]
mod bad_shape;
mod by_body;
mod contacts;
mod events;
mod hash;
mod manifolds;
mod rollback;
mod saved;
mod stages;

use std::sync::atomic::{AtomicU64, Ordering};

use crate::backend::cpu::Reference;
use crate::backend::{Backend, CheckedStep};
use crate::config::{SolverConfig, check_step_length};
use crate::contacts::ContactProblem;
use crate::error::{Error, Result};
use crate::metrics::Penetration;
use crate::panics::{self, Panic};
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::carry::Carry;
use crate::problem::{ContactRow, StepProblem};
use crate::queries::Queries;
use crate::residuals::Residuals;
use crate::stats::{StepStats, Stopwatch, timed};
#[cfg(doc)]
use crate::world::Body;
use crate::world::{BodyHandle, World};
use stages::{Changes, Stages};

pub use contacts::{Contact, ContactPoint};
pub use events::{ColliderOf, Event, Hit, Listen};
pub(crate) use hash::hashes;
pub use manifolds::{SolvedManifold, SolvedPoint, Summed};
pub use rollback::Rollback;
pub use saved::Snapshot;

/// A step that is assembled and did not run. It is not assembled again if the caller changes nothing, because preloads and efforts follow
/// the impulses of the step before only once.
struct Unfinished {
    dt: f32,
    /// The world and the settings, as bytes.
    state: Vec<u8>,
    stats: StepStats,
}

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
///
/// ```
/// use drystone::{Body, Joint, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let brick = world.add(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
/// let lamp = world.add(Body::dynamic().shape(Shape::ball(0.1)).total_mass(2.0).position(3.0, 2.0, 0.0));
/// world.join(Joint::to_world(lamp, Vec3::Y, Vec3::new(3.0, 3.0, 0.0)).hinge(Vec3::Z));
/// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// assert!(simulation.listening().impulses);
/// for _ in 0..60 {
///     simulation.step(1.0 / 60.0)?;
/// }
/// // Contacts as the last step left them, and how deep bodies overlap: as the step began, and now.
/// let borne: f32 = simulation.manifolds().map(|manifold| manifold.normal_impulse()).sum();
/// assert!((borne * 480.0 - 9810.0).abs() < 100.0, "{borne} N s in a substep of 1/480 s");
/// assert!(simulation.solved_penetration().max < 1e-3 && simulation.penetration().max < 1e-3);
/// assert_eq!((simulation.contacts().count(), simulation.overlaps().len()), (1, 0));
/// // Joints: the lamp hangs on its hinge.
/// assert!((simulation.joint_impulses()[0].length() * 480.0 - 19.62).abs() < 0.1);
/// assert!(simulation.joint_angular_impulses()[0].length() < 1e-3);
/// // What rests sleeps, and takes the substeps of the settings.
/// assert!(simulation.is_asleep(brick) && simulation.substeps_of(brick) == simulation.config().substeps);
/// simulation.wake(brick);
/// assert!(!simulation.is_asleep(brick));
/// // Settings and backend may change. The next step is a value.
/// simulation.set_config(SolverConfig::default().with(|c| c.substeps = 4))?;
/// let before = simulation.set_backend(Box::new(drystone::Cpu::new()));
/// assert_eq!((before.name(), simulation.backend().name()), ("reference", "cpu"));
/// let (problem, plan) = simulation.next_problem(1.0 / 60.0)?;
/// assert_eq!((problem.contacts.len(), problem.joints.len()), (simulation.problem().contacts.len(), 1));
/// assert!(plan.passes.len() < simulation.plan().passes.len(), "fewer substeps");
/// assert_eq!(simulation.into_world().dynamic_count(), 2);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Simulation {
    /// The bodies, with their moments of inertia raised where they are too small ([`MassProperties::MOST_LEVERAGE`](crate::MassProperties::MOST_LEVERAGE)).
    /// Between steps, all of it may change: bodies and joints may come and go, and gravity, poses, velocities, forces, masses, materials, kinds and
    /// shapes may become others. The next step finds the changes, and refuses what [`World::check`] refuses. Contacts of bodies
    /// that stay keep their impulses, but for those of a
    /// body that changed its kind or shapes.
    pub world: World,
    config: SolverConfig,
    backend: Box<dyn Backend>,
    /// All state that lasts from step to step, except the copy of a device.
    stages: Stages,
    /// Whether the backend keeps the rows of the last step on a device.
    on_device: bool,
    /// The step that is assembled and did not run, because the backend failed.
    unfinished: Option<Box<Unfinished>>,
    /// The number of the state that the last step, `load` or `restore` left. No other state of the process has it.
    state: u64,
    /// Whether the future of a step is pending, or was dropped before its end.
    is_pending: bool,
}

/// A number that no state has yet.
fn next_state() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
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
        let stages = Stages::new(&world, &config);
        Ok(Self::between_steps(world, config, stages, backend))
    }

    /// The simulation of a state between two steps.
    fn between_steps(world: World, config: SolverConfig, stages: Stages, backend: Box<dyn Backend>) -> Self {
        // The threads of a process begin here, and not within its first step.
        rayon::current_num_threads();
        Self {
            world,
            config,
            backend,
            stages,
            on_device: false,
            unfinished: None,
            state: next_state(),
            is_pending: false,
        }
    }

    /// Moves the world by `dt` seconds. If all bodies sleep, it computes nothing.
    ///
    /// # Errors
    /// `dt` is not from [`SHORTEST_STEP`](crate::config::SHORTEST_STEP) to [`LONGEST_STEP`](crate::config::LONGEST_STEP); a body
    /// that came or changed, a joint or a mass is not fit to be simulated; the caller gave a body a pose, a velocity, a force or a torque
    /// that [`World::check`] refuses; the backend cannot run the step; a contact cannot be computed ([`Error::Panicked`]). The world
    /// is then as it was. After a contact that cannot be computed all bodies are awake, and contacts begin without impulses.
    pub fn step(&mut self, dt: f32) -> Result<StepStats> {
        let mut stats = StepStats::default();
        if self.begin_step(dt, &mut stats)? {
            self.end_step(dt, &mut stats)?;
        }
        Ok(stats)
    }

    /// As [`Self::step`], for a page: other tasks go on while a device works. On the CPU the step ends before the first wait.
    ///
    /// ```
    /// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World};
    ///
    /// let mut world = World::new();
    /// let ball = world.add(Body::dynamic().shape(Shape::ball(0.5)));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// pollster::block_on(simulation.step_async(0.01))?;
    /// assert!(simulation.world.bodies[ball].linear_velocity.y < -0.09);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Self::step`]; and of each step after one whose future was dropped before its end, until the simulation goes back to a snapshot.
    pub async fn step_async(&mut self, dt: f32) -> Result<StepStats> {
        let mut stats = StepStats::default();
        if self.begin_step(dt, &mut stats)? {
            self.is_pending = true;
            let ended = self.end_step_async(dt, &mut stats).await;
            self.is_pending = false;
            ended?;
        }
        Ok(stats)
    }

    /// Lets the steps from now on tell of contacts and hits, and add up impulses over their substeps. The first step after that tells of all
    /// contacts that touch already.
    ///
    /// # Errors
    /// The approach speed is no number, or below 0; what the simulation listens to is then as it was.
    pub fn listen(&mut self, listen: Listen) -> Result<()> {
        listen.check()?;
        self.on_device = false;
        self.stages.events.listen(listen);
        Ok(())
    }

    /// What the simulation listens to.
    pub fn listening(&self) -> Listen {
        self.stages.events.listen
    }

    /// The sensors of the world, each with the colliders that overlapped it after the last step: first the sensor, then the other one.
    /// Ascending by the indices of both bodies.
    pub fn overlaps(&self) -> &[[ColliderOf; 2]] {
        self.stages.events.inside()
    }

    /// What happened in the last step: contacts that ended or began, then hits, then what entered or left sensors ([`Body::sensor`]), then what flew through them, each
    /// ascending by the pairs of bodies, then joints that broke, ascending. Contacts and hits are told of where the simulation [listens](Self::listen). Empty after a step that
    /// failed. The order and the numbers are the same for any backend with the same bits.
    ///
    /// Two colliders touch in a step where their surfaces press on each other in the course of the step, or overlap when it begins. A contact
    /// that is only near does not touch. Bodies that sleep go on touching. Where a body goes, the next step tells that its contacts ended.
    ///
    /// ```
    /// use drystone::{Body, Event, Listen, Reference, Shape, Simulation, SolverConfig, World};
    ///
    /// let mut world = World::new();
    /// let floor = world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 1.0, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// simulation.listen(Listen { contacts: true, hits_above: Some(1.0), ..Listen::default() })?;
    /// let mut told = Vec::new();
    /// for _ in 0..60 {
    ///     simulation.step(1.0 / 60.0)?;
    ///     told.extend_from_slice(simulation.events());
    /// }
    /// let [Event::Began { a, b }, Event::Hit(hit)] = told[..] else { panic!("{told:?}") };
    /// assert_eq!((a.body, b.body), (floor, ball));
    /// assert!((hit.speed - 3.13).abs() < 0.01, "{} m/s", hit.speed);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn events(&self) -> &[Event] {
        &self.stages.events.all
    }

    /// Moves the world by `dt` seconds, and gives what the first substep asked of the velocities as a contact problem by
    /// itself: [`ContactProblem::of_step`]. Without contacts where nothing touches that is awake.
    ///
    /// ```
    /// # use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World};
    /// # let mut world = World::new();
    /// # world.add(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// # world.add(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// let (problem, _) = simulation.step_with_contacts("a ball", 1.0 / 60.0)?;
    /// assert_eq!((problem.name.as_str(), problem.contacts.len()), ("a ball", 1));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::step`], or the world has joints: a contact problem has none.
    pub fn step_with_contacts(&mut self, name: &str, dt: f32) -> Result<(ContactProblem, StepStats)> {
        if !self.world.joints.is_empty() {
            let joints = self.world.joints.len();
            return Err(Error::input(format!("{name} has {joints} joints: a contact problem has none")));
        }
        self.on_device = false;
        let mut stats = StepStats::default();
        if !self.begin_step(dt, &mut stats)? {
            return Ok((ContactProblem { name: name.into(), ..ContactProblem::default() }, stats));
        }
        use Kernel::{BeginChanges, EndChanges, IntegrateGyroscopic, IntegrateTorques, IntegrateVelocities};
        let forces = |p: &&Pass| {
            let Pass { kernel, .. } = p;
            matches!(
                kernel,
                BeginChanges | IntegrateVelocities { .. } | IntegrateTorques { .. } | IntegrateGyroscopic { .. }
            )
        };
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

    /// Moves the world by `dt` seconds, and gives the errors of the impulses after the first substep, which [`Reference`] computes once more.
    /// Zero where nothing touches that is awake.
    ///
    /// ```
    /// # use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World};
    /// # let mut world = World::new();
    /// # world.add(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// # world.add(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// assert!(simulation.step_with_residuals(1.0 / 60.0)?.e_vel < 1e-3);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::step_with_contacts`].
    pub fn step_with_residuals(&mut self, dt: f32) -> Result<Residuals> {
        let (mut problem, plan) = self.next_problem(dt)?;
        let begins = |p: &Pass| matches!(p.kernel, Kernel::IntegrateVelocities { .. });
        let end = plan.passes.iter().skip(1).position(begins).map_or(plan.passes.len(), |i| i + 1);
        Reference::<f32>::new().run(&mut problem, &plan.passes[..end])?;
        let of_contact = |row: &ContactRow| {
            let own = row.first_point as usize..(row.first_point + row.point_count) as usize;
            problem.impulses[own].iter().map(|i| glam::Vec3::new(i.normal, i.tangent_1, i.tangent_2).as_dvec3())
        };
        let mut impulses: Vec<_> = problem.swept_contacts().flat_map(of_contact).collect();
        let (contacts, _) = self.step_with_contacts("the world", dt)?;
        // There are none of a step in which all sleep.
        impulses.truncate(contacts.contacts.len());
        Ok(Residuals::of(&contacts, &impulses))
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
    pub(crate) fn begin_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<bool> {
        self.stages.events.all.clear();
        check_step_length(dt)?;
        if self.is_pending {
            return Err(Error::input("a step was dropped before its end: go back to a snapshot"));
        }
        if let Some(unfinished) = self.unfinished.take()
            && unfinished.dt == dt
            && unfinished.state == self.world_and_settings()
        {
            *stats = unfinished.stats;
            return Ok(true);
        }
        let changes = timed(&mut stats.times.detect, || self.changes(dt))?;
        if changes.all_rows() || self.stages.contacts.are_unsorted() {
            self.on_device = false;
        }
        let Self { world, config, stages, on_device, .. } = self;
        let assembled = panics::caught(|| {
            stages.follow(world, config, dt, &changes);
            if stages.is_everything_still(world, stats) {
                return false;
            }
            if stages.find(world, config, dt, stats) {
                *on_device = false;
            }
            stages.prepare(world, config, dt, *on_device, stats);
            true
        });
        let is_assembled = assembled.map_err(|panic| {
            self.begin_anew();
            self.panicked(panic)
        })?;
        if is_assembled && self.stages.is_foreign {
            self.check_foreign()?;
        }
        Ok(is_assembled)
    }

    /// Gives up the state between steps, which a panic left half done: the next step finds all contacts anew.
    fn begin_anew(&mut self) {
        let (listen, astray) = (self.stages.events.listen, std::mem::take(&mut self.stages.astray));
        self.stages = Stages::new(&World::new(), &self.config);
        self.stages.events.listen(listen);
        self.stages.astray = astray;
        self.on_device = false;
    }

    fn panicked(&self, Panic { bodies, text }: Panic) -> Error {
        let name = |body: u32| self.world.name_of(body as usize);
        let what = bodies.map_or("the contacts".into(), |[a, b]| format!("the contact of {} and {}", name(a), name(b)));
        Error::Panicked(format!("{what} cannot be computed: {text}"))
    }

    /// Runs and stores what is assembled.
    pub(crate) fn end_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        loop {
            let (step, carry) = assembled(&mut self.stages);
            let ran = timed(&mut stats.times.run, || self.backend.step(step, carry));
            let Err(error) = ran else { break };
            let successor = if is_lost(&error) { self.backend.successor() } else { None };
            self.repeat_step(error, successor, dt, stats)?;
        }
        self.store_step(dt, stats);
        Ok(())
    }

    /// The same, while other tasks go on.
    async fn end_step_async(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        loop {
            let (step, carry) = assembled(&mut self.stages);
            let start = Stopwatch::start();
            let ran = self.backend.step_async(step, carry).await;
            stats.times.run += start.elapsed();
            let Err(error) = ran else { break };
            let successor = if is_lost(&error) { self.backend.successor_async().await } else { None };
            self.repeat_step(error, successor, dt, stats)?;
        }
        self.store_step(dt, stats);
        Ok(())
    }

    /// Stores what ran.
    pub(crate) fn store_step(&mut self, dt: f32, stats: &mut StepStats) {
        let stages = &mut self.stages;
        self.on_device = self.backend.keeps_rows();
        stats.traffic = self.backend.traffic();
        stats.kernels.extend_from_slice(self.backend.kernel_times());
        let taken = timed(&mut stats.times.store, || stages.store(&mut self.world, dt));
        (stats.energy_taken, stats.refused) = (taken.energy, taken.refused);
        self.state = next_state();
        let convergence = &self.stages.problem.convergence;
        (stats.sweeps, stats.planned_sweeps) = (convergence.sweeps, convergence.planned);
        stats.asleep = self.stages.sleep.count();
        self.stages.is_foreign &= stats.asleep > 0;
        let is_finite = |&&i: &&usize| self.world.bodies[i].is_finite();
        stats.first_non_finite = self.stages.astray.iter().find(|i| !is_finite(i)).copied();
    }

    /// Refuses rows that follow from state which someone forged.
    fn check_foreign(&mut self) -> Result<()> {
        let checked = CheckedStep::new(&mut self.stages.problem, &self.stages.plan.passes).map(drop);
        checked.map_err(|error| {
            self.begin_anew();
            error.within("the state that was loaded")
        })
    }

    /// Lets another backend repeat a step whose device was lost. Without one the step is left to the caller.
    fn repeat_step(
        &mut self,
        error: Error,
        successor: Option<Box<dyn Backend>>,
        dt: f32,
        stats: &mut StepStats,
    ) -> Result<()> {
        self.on_device = false;
        self.stages.contacts.carry.on_device = false;
        let Some(successor) = successor else {
            let state = self.world_and_settings();
            self.unfinished = Some(Box::new(Unfinished { dt, state, stats: stats.clone() }));
            return Err(error);
        };
        let before = stats.fault.take().map_or(String::new(), |line| format!("{line}; "));
        let (name, adapter) = (successor.name(), successor.adapter());
        stats.fault = Some(format!("{before}{error}; {name} ({adapter}) repeats the step and goes on"));
        self.backend = successor;
        Ok(())
    }

    /// The next step of `dt` seconds as values, the problem and its plan. The call changes nothing of the run.
    ///
    /// # Errors
    /// As [`Simulation::step`], the backend apart.
    pub fn next_problem(&mut self, dt: f32) -> Result<(StepProblem, StepPlan)> {
        check_step_length(dt)?;
        let changes = self.changes(dt)?;
        let assembled = panics::caught(|| {
            let mut next = self.stages.clone();
            next.follow(&self.world, &self.config, dt, &changes);
            next.is_everything_still(&self.world, &mut StepStats::default());
            next.find(&self.world, &self.config, dt, &mut StepStats::default());
            next.prepare(&self.world, &self.config, dt, false, &mut StepStats::default());
            (next.problem, next.plan)
        });
        assembled.map_err(|panic| self.panicked(panic))
    }

    /// The bodies as they are now, for questions: rays, shapes that move, points, boxes. In the tree of the last step, so that this costs
    /// as much as a look at each body. Keep the answer for many questions.
    ///
    /// ```
    /// use drystone::queries::Filter;
    /// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// simulation.step(1.0 / 60.0)?;
    /// let hit = simulation.queries().ray(Vec3::new(-5.0, 0.5, 0.0), Vec3::X, 10.0, &Filter::default()).expect("the ball");
    /// assert_eq!(hit.body, ball);
    /// assert!((hit.distance - 4.5).abs() < 1e-3 && (hit.normal + Vec3::X).length() < 1e-3);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn queries(&self) -> Queries<'_> {
        Queries::standing(&self.world, &self.stages.detector)
    }

    /// The world, without all that the next step would begin from.
    pub fn into_world(self) -> World {
        self.world
    }

    /// Whether a body sleeps; see [`SolverConfig::sleep_after`]. False for an index without a body.
    pub fn is_asleep(&self, body: usize) -> bool {
        self.stages.sleep.asleep().get(body) == Some(&true)
    }

    /// The number of the state that the last step, `load` or `restore` left: no other state of the process has it. Steps in which all sleep
    /// leave the state as it was.
    pub(crate) fn state(&self) -> u64 {
        self.state
    }

    /// Whether each body sleeps; empty if none ever does.
    pub(crate) fn asleep(&self) -> &[bool] {
        self.stages.sleep.asleep()
    }

    /// The substeps that a body takes in a step; see [`SolverConfig::max_substeps`]. The least for an index without a body.
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
    pub fn manifolds(&self) -> impl Iterator<Item = SolvedManifold> + Clone {
        let Stages { detector, contacts, problem, .. } = &self.stages;
        manifolds::of(detector, contacts, problem, self.stages.least_substeps())
    }

    /// The contacts that the last step found, near ones included, in no particular order that holds from step to step. No device is asked:
    /// impulses are there where the simulation [listens](Self::listen). Those of bodies that went since are left out.
    pub fn contacts(&self) -> impl Iterator<Item = Contact> + '_ {
        self.stages.contacts.taken().filter_map(|row| contacts::contact(&self.stages, &self.world, row))
    }

    /// The contacts of a body, likewise; none if it is gone. Where the simulation listens, the cost is that of the contacts of the body, and
    /// else that of all contacts.
    ///
    /// ```
    /// use drystone::{Body, Listen, Reference, Shape, Simulation, SolverConfig, World};
    ///
    /// let mut world = World::new();
    /// world.add(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// simulation.listen(Listen { impulses: true, ..Listen::default() })?;
    /// for _ in 0..20 {
    ///     simulation.step(1.0 / 60.0)?;
    /// }
    /// let borne: f32 = simulation.contacts_of(brick).map(|contact| contact.impulse.y).sum();
    /// assert!((borne - 1000.0 * 9.81 / 60.0).abs() < 1.0, "{borne} N s");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn contacts_of(&self, body: BodyHandle) -> impl Iterator<Item = Contact> + '_ {
        let is_there = self.world.bodies.contains(body);
        let rows = self.stages.by_body.of(body.index());
        let listed = rows.unwrap_or_default().iter().map(|&row| row as usize);
        let names = move |row: &usize| self.stages.problem.contacts.get(*row).is_some_and(|c| c.holds(body.index()));
        let all = self.stages.contacts.taken().filter(move |row| rows.is_none() && names(row));
        let own = listed.chain(all).filter(move |_| is_there);
        let contacts = own.filter_map(|row| contacts::contact(&self.stages, &self.world, row));
        contacts.filter(move |contact| contact.a.body == body || contact.b.body == body)
    }

    /// Overlap when the last step began, from the contacts that it went by.
    pub fn solved_penetration(&self) -> Penetration {
        let separations = |m: SolvedManifold| (0..m.points().len()).map(move |k| m.points()[k].separation);
        Penetration::of(self.manifolds().map(separations))
    }

    /// Impulse of each joint of the world on its body b, in the last of the substeps ([`Self::substeps_of`]), world axes (N s).
    pub fn joint_impulses(&self) -> Vec<glam::Vec3> {
        let problem = &self.stages.problem;
        (0..problem.joints.len()).map(|joint| problem.joint_impulse(&problem.joint_impulses, joint)).collect()
    }

    /// Angular impulse of each joint of the world on its body b about the anchor, in the last of the substeps, world axes (N m s): that of
    /// locks, limits, motors and springs of angles. A torque (N m) is that over the length of the substep.
    pub fn joint_angular_impulses(&self) -> Vec<glam::Vec3> {
        let problem = &self.stages.problem;
        (0..problem.joints.len()).map(|joint| problem.axis_impulse(&problem.joint_impulses, joint, false)).collect()
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
        self.on_device = false;
        std::mem::replace(&mut self.backend, backend)
    }

    /// The settings.
    pub fn config(&self) -> &SolverConfig {
        &self.config
    }

    /// The last step's problem, with the impulses that solved it.
    pub fn problem(&self) -> &StepProblem {
        &self.stages.problem
    }

    /// The step that is assembled, for others to run.
    pub(crate) fn problem_mut(&mut self) -> &mut StepProblem {
        &mut self.stages.problem
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

/// What is assembled, for a backend.
fn assembled(stages: &mut Stages) -> (CheckedStep<'_>, &Carry) {
    (CheckedStep::built(&mut stages.problem, &stages.plan.passes), &stages.contacts.carry)
}

fn is_lost(error: &Error) -> bool {
    matches!(error, Error::Lost(_))
}
