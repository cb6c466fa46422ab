//! Stepping a world: detect, color, prepare, plan, run, store.

#[cfg(test)]
mod bad_shape;
mod by_body;
mod contacts;
mod events;
mod hash;
mod hooks;
pub(crate) mod input;
mod manifolds;
mod rollback;
mod saved;
mod stages;

use std::sync::atomic::{AtomicU64, Ordering};

use crate::backend::cpu::Cpu;
use crate::backend::{Backend, CheckedStep};
use crate::config::{SolverConfig, check_step_length};
use crate::error::{Error, Result};
use crate::metrics::Penetration;
use crate::panics::{self, Panic};
use crate::plan::StepPlan;
use crate::problem::StepProblem;
use crate::problem::carry::Carry;
use crate::queries::Queries;
use crate::stats::{StepStats, Stopwatch, timed};
#[cfg(doc)]
use crate::world::Body;
use crate::world::{BodyHandle, JointHandle, World};
use stages::{Changes, Stages, check_materials};

pub use contacts::{Contact, ContactPoint};
pub use events::{ColliderOf, Event, Hit, Listen};
pub use hash::hashes;
pub use hooks::{ContactHooks, PendingContact, PendingPoint};
pub use manifolds::{SolvedManifold, SolvedPoint, Summed};
pub use rollback::Rollback;
pub use saved::Snapshot;

/// A step that is assembled but did not run. If the caller changes nothing, the next call does not assemble it again:
/// preloads and substep levels may follow the impulses of the step before only once.
struct Unfinished {
    dt: f32,
    /// The world and the settings, as bytes.
    state: Vec<u8>,
    stats: StepStats,
}

/// Steps a world.
///
/// ```
/// use drystone::{Body, Shape, Simulation, World};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
/// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 1.0, 0.0));
/// let mut simulation = Simulation::new(world)?;
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
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
/// let lamp = world.insert(Body::dynamic().shape(Shape::ball(0.1)).total_mass(2.0).position(3.0, 2.0, 0.0));
/// let hinge = world.insert_joint(Joint::to_world(lamp, Vec3::Y, Vec3::new(3.0, 3.0, 0.0)).hinge(Vec3::Z));
/// let mut simulation = Simulation::with(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// assert!(simulation.listening().impulses);
/// for _ in 0..60 {
///     simulation.step(1.0 / 60.0)?;
/// }
/// // Contacts of the last step, and the overlap of bodies: at its start, and now.
/// let borne: f32 = simulation.manifolds().map(|manifold| manifold.normal_impulse()).sum();
/// assert!((borne * 480.0 - 9810.0).abs() < 100.0, "{borne} N s in a substep of 1/480 s");
/// assert!(simulation.solved_penetration().max < 1e-3 && simulation.penetration().max < 1e-3);
/// assert_eq!((simulation.contacts().count(), simulation.overlaps().len()), (1, 0));
/// // Joints: the lamp hangs on its hinge.
/// assert!((simulation.joint_impulse(hinge).expect("it hangs").length() * 480.0 - 19.62).abs() < 0.1);
/// assert!(simulation.joint_angular_impulse(hinge).expect("it hangs").length() < 1e-3);
/// // Bodies at rest sleep, and take the substeps of the settings.
/// assert!(simulation.is_asleep(brick) && simulation.substeps_of(brick) == simulation.config().substeps);
/// simulation.wake(brick);
/// assert!(!simulation.is_asleep(brick));
/// // Settings and backend can change. The next step is available as a value.
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
    /// The bodies, with moments of inertia raised if they are too small
    /// ([`MassProperties::MAX_LEVERAGE`](crate::MassProperties::MAX_LEVERAGE)). The caller can change all of it
    /// between steps: insert and remove bodies and joints, and set gravity, poses, velocities, forces, masses,
    /// materials, kinds and shapes. The next step finds the changes, and refuses a world that [`World::check`] refuses.
    /// Contacts keep their impulses, except those of a body that changed its kind or shapes.
    pub world: World,
    config: SolverConfig,
    backend: Box<dyn Backend>,
    /// All state that lasts from step to step, except the copy on a device.
    stages: Stages,
    /// Whether the backend keeps the rows of the last step on a device.
    on_device: bool,
    /// A step that is assembled but did not run, because the backend failed.
    unfinished: Option<Box<Unfinished>>,
    /// The number of the state after the last step, `load` or `restore`. No other state of this process has the same
    /// number.
    state: u64,
    /// Whether the future of a step is pending, or was dropped before it completed.
    is_pending: bool,
    hooks: Option<Box<dyn ContactHooks>>,
}

/// A new state number.
fn next_state() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl Simulation {
    /// A simulation of `world` before its first step, with the default settings on the CPU.
    ///
    /// # Errors
    /// [`World::check`] refuses the world.
    pub fn new(world: World) -> Result<Self> {
        Self::with(world, SolverConfig::default(), Box::new(Cpu::new()))
    }

    /// The same, with settings and a backend of the caller.
    ///
    /// # Errors
    /// A setting is out of range or contradicts another, or [`World::check`] refuses the world.
    pub fn with(mut world: World, config: SolverConfig, backend: Box<dyn Backend>) -> Result<Self> {
        config.check()?;
        world.check()?;
        check_materials(&world, &config)?;
        world.raise_inertias();
        let stages = Stages::new(&world, &config);
        Ok(Self::between_steps(world, config, stages, backend))
    }

    /// The simulation of a state between two steps.
    fn between_steps(world: World, config: SolverConfig, stages: Stages, backend: Box<dyn Backend>) -> Self {
        // Start the threads of the process here, not within its first step.
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
            hooks: None,
        }
    }

    /// Advances the world by `dt` seconds. If all bodies sleep, the step computes nothing.
    ///
    /// # Errors
    /// - `dt` is not from [`SHORTEST_STEP`](crate::config::SHORTEST_STEP) to
    ///   [`LONGEST_STEP`](crate::config::LONGEST_STEP).
    /// - [`World::check`] refuses a new or changed body, a joint, a mass, or a pose, velocity, force or torque that the
    ///   caller set.
    /// - The backend cannot run the step.
    /// - A contact cannot be computed ([`Error::Panicked`]).
    ///
    /// The world is then unchanged. If a contact cannot be computed, all bodies wake, and contacts start without
    /// impulses.
    pub fn step(&mut self, dt: f32) -> Result<StepStats> {
        let mut stats = StepStats::default();
        if self.begin_step(dt, &mut stats)? {
            self.end_step(dt, &mut stats)?;
        }
        Ok(stats)
    }

    /// Like [`Self::step`], for a web page: other tasks continue while a device works. On the CPU the step completes
    /// before the first await.
    ///
    /// ```
    /// use drystone::{Body, Shape, Simulation, World};
    ///
    /// let mut world = World::new();
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// let mut simulation = Simulation::new(world)?;
    /// pollster::block_on(simulation.step_async(0.01))?;
    /// assert!(simulation.world.bodies[ball].linear_velocity.y < -0.09);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Self::step`]. If the future of a step is dropped before it completes, each later step fails until the
    /// simulation restores a snapshot.
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

    /// Makes later steps report contacts and hits, and sum impulses over their substeps. The first such step reports
    /// every contact that already touches.
    ///
    /// # Errors
    /// The approach speed is NaN or below 0. The simulation then listens to the same events as before.
    pub fn listen(&mut self, listen: Listen) -> Result<()> {
        listen.check()?;
        self.on_device = false;
        self.stages.events.listen(listen);
        Ok(())
    }

    /// Sets the hooks that refuse pairs and change contacts from the next step on, or removes them. Sleeping bodies are
    /// not asked: [wake](Self::wake) those whose contacts change. Hooks belong to this simulation, and not to its
    /// state: a fork or a loaded run has none.
    ///
    /// ```
    /// use drystone::{ContactHooks, Simulation, World};
    ///
    /// /// All pairs touch, and no contact changes.
    /// struct Idle;
    ///
    /// impl ContactHooks for Idle {}
    ///
    /// let mut simulation = Simulation::new(World::new())?;
    /// simulation.set_hooks(Some(Box::new(Idle)));
    /// simulation.step(1.0 / 60.0)?;
    /// simulation.set_hooks(None);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn set_hooks(&mut self, hooks: Option<Box<dyn ContactHooks>>) {
        self.unfinished = None;
        self.hooks = hooks;
    }

    /// The events and sums that the simulation reports.
    pub fn listening(&self) -> Listen {
        self.stages.events.listen
    }

    /// Pairs of a sensor and a collider that overlapped it after the last step. The sensor comes first. Pairs are
    /// sorted by the indices of both bodies.
    pub fn overlaps(&self) -> &[[ColliderOf; 2]] {
        self.stages.events.inside()
    }

    /// The events of the last step: contacts that ended or began, then hits, then colliders that entered or left
    /// sensors ([`Body::sensor`]), then colliders that flew through sensors, and then joints that broke. Each group is
    /// sorted by pairs of bodies, and joints by index. The simulation reports contacts and hits only if it
    /// [listens](Self::listen) to them. The list is empty after a step that failed. Backends that compute the same bits
    /// report the same events in the same order.
    ///
    /// Two colliders touch in a step if their surfaces press on each other during the step, or overlap at its start. A
    /// contact that is only near does not touch. Sleeping bodies keep touching. If a body is removed, the next step
    /// reports that its contacts ended.
    ///
    /// ```
    /// use drystone::{Body, Event, Listen, Shape, Simulation, World};
    ///
    /// let mut world = World::new();
    /// let floor = world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 1.0, 0.0));
    /// let mut simulation = Simulation::new(world)?;
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

    /// The caller's changes since the last step.
    fn changes(&mut self, dt: f32) -> Result<Changes> {
        let changes = self.stages.changes(&self.world, &self.config, dt)?;
        if changes.surfaces() {
            self.world.raise_inertias();
        }
        Ok(changes)
    }

    /// Assembles a step. Returns false if the step has nothing to do.
    pub(crate) fn begin_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<bool> {
        self.stages.events.all.clear();
        check_step_length(dt)?;
        if self.is_pending {
            return Err(Error::input("the future of a step was dropped before it completed: restore a snapshot"));
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
        let Self { world, config, stages, on_device, hooks, .. } = self;
        let assembled = panics::caught(|| {
            stages.follow(world, config, dt, &changes);
            if stages.is_everything_still(world, stats) {
                return Ok(false);
            }
            if stages.find(world, config, dt, hooks.as_deref_mut(), stats)? {
                *on_device = false;
            }
            stages.prepare(world, config, dt, *on_device, stats);
            Ok(true)
        });
        let assembled = assembled.unwrap_or_else(|panic| Err(self.panicked(panic)));
        let is_assembled = assembled.inspect_err(|_| self.begin_anew())?;
        if is_assembled && self.stages.is_foreign {
            self.check_foreign()?;
        }
        Ok(is_assembled)
    }

    /// Discards the state between steps after a panic left it incomplete. The next step finds all contacts anew.
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

    /// Runs the assembled step and stores its results.
    pub(crate) fn end_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        loop {
            let (step, carry) = assembled(&mut self.stages);
            let ran = timed(&mut stats.times.run, || self.backend.step(step, carry));
            if let Err(error) = ran {
                let successor = if error.is_lost() { self.backend.successor() } else { None };
                self.repeat_step(error, successor, dt, stats)?;
            } else if !self.stages.prepare_again(&self.world, &self.config, dt, stats) {
                break;
            }
        }
        self.store_step(dt, stats, true);
        Ok(())
    }

    /// Stores the results of the assembled step that ran on another backend. A step that has to be taken again runs on
    /// the backend of this simulation.
    pub(crate) fn end_joined_step(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        if self.stages.prepare_again(&self.world, &self.config, dt, stats) {
            return self.end_step(dt, stats);
        }
        self.store_step(dt, stats, false);
        Ok(())
    }

    /// The same, while other tasks continue.
    async fn end_step_async(&mut self, dt: f32, stats: &mut StepStats) -> Result<()> {
        loop {
            let (step, carry) = assembled(&mut self.stages);
            let start = Stopwatch::start();
            let ran = self.backend.step_async(step, carry).await;
            stats.times.run += start.elapsed();
            if let Err(error) = ran {
                let successor = if error.is_lost() { self.backend.successor_async().await } else { None };
                self.repeat_step(error, successor, dt, stats)?;
            } else if !self.stages.prepare_again(&self.world, &self.config, dt, stats) {
                break;
            }
        }
        self.store_step(dt, stats, true);
        Ok(())
    }

    /// Stores the results of the step that ran, on the backend of this simulation or on another one.
    fn store_step(&mut self, dt: f32, stats: &mut StepStats, on_own_backend: bool) {
        let stages = &mut self.stages;
        self.on_device = on_own_backend && self.backend.keeps_rows();
        if on_own_backend {
            stats.traffic = self.backend.traffic();
            stats.kernels.extend_from_slice(self.backend.kernel_times());
        }
        let taken = timed(&mut stats.times.store, || stages.store(&mut self.world, dt));
        (stats.energy_taken, stats.refused) = (taken.energy, taken.refused);
        self.state = next_state();
        let convergence = &self.stages.problem.convergence;
        (stats.sweeps, stats.planned_sweeps) = (convergence.sweeps, convergence.planned);
        stats.asleep = self.stages.sleep.count();
        self.stages.is_foreign &= stats.asleep > 0;
        let first = self.stages.astray.iter().find(|&&i| !self.world.bodies[i].is_finite());
        stats.first_non_finite = first.and_then(|&i| self.world.bodies.handle(i));
    }

    /// Refuses rows that follow from forged state.
    fn check_foreign(&mut self) -> Result<()> {
        let checked = CheckedStep::new(&mut self.stages.problem, &self.stages.plan.passes).map(drop);
        checked.map_err(|error| {
            self.begin_anew();
            error.within("the loaded state")
        })
    }

    /// Repeats the step on another backend after its device was lost. Without another backend, the caller has to handle
    /// the loss.
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
        stats.fault = Some(format!("{before}{error}; {name} ({adapter}) repeats the step and continues"));
        self.backend = successor;
        Ok(())
    }

    /// The problem and the plan of the next step of `dt` seconds. The call does not change the run.
    ///
    /// # Errors
    /// Those of [`Simulation::step`], except errors of the backend.
    pub fn next_problem(&mut self, dt: f32) -> Result<(StepProblem, StepPlan)> {
        check_step_length(dt)?;
        let changes = self.changes(dt)?;
        let assembled = panics::caught(|| {
            let mut next = self.stages.clone();
            next.follow(&self.world, &self.config, dt, &changes);
            next.is_everything_still(&self.world, &mut StepStats::default());
            next.find(&self.world, &self.config, dt, self.hooks.as_deref_mut(), &mut StepStats::default())?;
            next.prepare(&self.world, &self.config, dt, false, &mut StepStats::default());
            Ok((next.problem, next.plan))
        });
        assembled.unwrap_or_else(|panic| Err(self.panicked(panic)))
    }

    /// A view of the bodies at their present poses, for rays, shape casts, points and boxes. It uses the tree of the
    /// last step, so its cost is proportional to the number of bodies. Keep the view for many queries.
    ///
    /// ```
    /// use drystone::queries::Filter;
    /// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(1.0 / 60.0)?;
    /// let hit = simulation.queries().ray(Vec3::new(-5.0, 0.5, 0.0), Vec3::X, 10.0, &Filter::default()).expect("the ball");
    /// assert_eq!(hit.body, ball);
    /// assert!((hit.distance - 4.5).abs() < 1e-3 && (hit.normal + Vec3::X).length() < 1e-3);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn queries(&self) -> Queries<'_> {
        Queries::standing(&self.world, &self.stages.detector)
    }

    /// The world, without the solver state for the next step.
    pub fn into_world(self) -> World {
        self.world
    }

    /// Whether a body sleeps; see [`SolverConfig::sleep_after`]. False if the body is gone.
    pub fn is_asleep(&self, body: BodyHandle) -> bool {
        self.world.bodies.index_of(body).is_some_and(|index| self.asleep().get(index) == Some(&true))
    }

    /// The number of the state after the last step, `load` or `restore`. No other state of this process has the same
    /// number. A step in which all bodies sleep keeps the number.
    pub(crate) fn state(&self) -> u64 {
        self.state
    }

    /// Whether each body sleeps; empty if sleep is off.
    pub(crate) fn asleep(&self) -> &[bool] {
        self.stages.sleep.asleep()
    }

    /// The number of substeps that a body takes in a step; see [`SolverConfig::max_substeps`]. If the body is gone, the
    /// smallest number of the world.
    pub fn substeps_of(&self, body: BodyHandle) -> u32 {
        let index = self.world.bodies.index_of(body);
        self.config.substeps << index.map_or(0, |index| self.stages.effort.class_of(index))
    }

    /// Wakes the island of a body, if the body sleeps. A change of a sleeping body, of gravity or of a joint wakes it
    /// without this call.
    pub fn wake(&mut self, body: BodyHandle) {
        if let Some(index) = self.world.bodies.index_of(body) {
            self.stages.sleep.wake(index);
        }
    }

    /// Overlap of the world at its present poses, from contacts that are computed anew. The call does not change the
    /// next step: a reused contact does not creep, and towers of 60 that stand for 20 s fall if their contacts are
    /// recomputed now and then.
    pub fn penetration(&self) -> Penetration {
        Penetration::of_world(&self.world, &self.config)
    }

    /// The manifolds of the last step, with their impulses. It leaves out those of bodies that were removed since.
    pub fn manifolds(&self) -> impl Iterator<Item = SolvedManifold> + Clone {
        manifolds::of(&self.stages, &self.world)
    }

    /// The contacts that the last step found, also near ones, in an order that can change from step to step. The call
    /// reads nothing from a device: impulses are available if the simulation [listens](Self::listen). It leaves out
    /// contacts of bodies that were removed since.
    pub fn contacts(&self) -> impl Iterator<Item = Contact> + '_ {
        self.stages.contacts.taken().filter_map(|row| contacts::contact(&self.stages, &self.world, row))
    }

    /// The contacts of a body; no contacts if the body is gone. If the simulation listens, the call looks only at the
    /// contacts of the body, else at all contacts.
    ///
    /// ```
    /// use drystone::{Body, Listen, Shape, Simulation, World};
    ///
    /// let mut world = World::new();
    /// world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
    /// let mut simulation = Simulation::new(world)?;
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

    /// Overlap at the start of the last step, from the contacts of that step.
    pub fn solved_penetration(&self) -> Penetration {
        let separations = |m: SolvedManifold| (0..m.points().len()).map(move |k| m.points()[k].separation);
        Penetration::of(self.manifolds().map(separations))
    }

    /// Force of a joint on its body b in the last step, in world axes (N). It is the mean over the step if the
    /// simulation [listens](Self::listen), or if the world has a joint with a break force, a motor or a spring. Else,
    /// and for sleeping bodies, it is the force of the last substep. `None` if the joint is gone, or took part in no
    /// step since it was inserted or since the state was loaded.
    ///
    /// ```
    /// use drystone::{Body, Joint, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// let wall = world.insert(Body::fixed());
    /// let beam = Body::dynamic().shape(Shape::cuboid(0.5, 0.05, 0.05)).total_mass(2.0);
    /// let beam = world.insert(beam.position(0.5, 0.0, 0.0));
    /// let weld = world.insert_joint(Joint::new(wall, Vec3::ZERO, beam, Vec3::X * -0.5).fixed());
    /// let mut simulation = Simulation::new(world)?;
    /// assert_eq!(simulation.joint_force(weld), None);
    /// (0..120).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
    /// // The wall bears the weight of 2 kg at 0.5 m.
    /// let [force, torque] = [simulation.joint_force(weld), simulation.joint_torque(weld)].map(Option::unwrap);
    /// assert!((force - 19.62 * Vec3::Y).length() < 0.1, "{force} N");
    /// assert!((torque - 9.81 * Vec3::Z).length() < 0.1, "{torque} N m");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn joint_force(&self, joint: JointHandle) -> Option<glam::Vec3> {
        self.stages.joint_load(&self.world, joint).map(|[force, _]| force)
    }

    /// Torque of a joint on its body b about the anchor on body a, in world axes (N m). It sums the locks, limits,
    /// motors and springs of angles, over the same time as [`Self::joint_force`], and is `None` where that is.
    pub fn joint_torque(&self, joint: JointHandle) -> Option<glam::Vec3> {
        self.stages.joint_load(&self.world, joint).map(|[_, torque]| torque)
    }

    /// Impulse of a joint on its body b in the last substep ([`Self::substeps_of`]), in world axes (N s). `None` where
    /// [`Self::joint_force`] is.
    pub fn joint_impulse(&self, joint: JointHandle) -> Option<glam::Vec3> {
        self.stages.joint_impulse(&self.world, joint).map(|[impulse, _]| impulse)
    }

    /// Angular impulse of a joint on its body b about the anchor in the last substep, in world axes (N m s). It sums the
    /// locks, limits, motors and springs of angles. Divide by the length of the substep for a torque (N m).
    pub fn joint_angular_impulse(&self, joint: JointHandle) -> Option<glam::Vec3> {
        self.stages.joint_impulse(&self.world, joint).map(|[_, angular]| angular)
    }

    /// Sets the settings for the next step and later ones.
    ///
    /// # Errors
    /// A setting is out of range or contradicts another. The settings are then unchanged.
    pub fn set_config(&mut self, config: SolverConfig) -> Result<()> {
        config.check()?;
        check_materials(&self.world, &config)?;
        self.config = config;
        Ok(())
    }

    /// Sets the backend for the next step and later ones. Returns the previous backend.
    pub fn set_backend(&mut self, backend: Box<dyn Backend>) -> Box<dyn Backend> {
        self.on_device = false;
        std::mem::replace(&mut self.backend, backend)
    }

    /// The settings.
    pub fn config(&self) -> &SolverConfig {
        &self.config
    }

    /// The problem of the last step, with the impulses that solved it.
    pub fn problem(&self) -> &StepProblem {
        &self.stages.problem
    }

    /// The assembled step, for another program part to run.
    pub(crate) fn problem_mut(&mut self) -> &mut StepProblem {
        &mut self.stages.problem
    }

    /// The plan of the last step.
    pub fn plan(&self) -> &StepPlan {
        &self.stages.plan
    }

    /// The backend.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }
}

/// The assembled step, for a backend.
fn assembled(stages: &mut Stages) -> (CheckedStep<'_>, &Carry) {
    (CheckedStep::built(&mut stages.problem, &stages.plan.passes), &stages.contacts.carry)
}
