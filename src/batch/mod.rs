//! Many worlds at once. Each has its own scene, settings, start state, time, step count, error and hash.
//!
//! The bits of a world depend only on its scene, settings and inputs. They do not depend on the number of worlds, the
//! other worlds, the order of calls to others, the number of threads, or the machine. (On a GPU without exact mode,
//! rounding may depend on the number of worlds, too.) A call does not change worlds that it does not name. If a world fails, only that world stops, in the state before the failed step; the others
//! finish.
//!
//! ```
//! use drystone::batch::Batch;
//! use drystone::{Listen, SolverConfig};
//! use drystone_scenes::Scene;
//!
//! let scene = Scene::find("tower", &["n=3".into()])?;
//! let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 4)?;
//! assert!(batch.step(10, &[0, 2])?.is_empty(), "none fails");
//! assert_eq!((batch.world(0).steps(), batch.world(1).steps()), (10, 0));
//! // A state can be restored in other worlds, and a reset goes back to the start.
//! let state = batch.world(2).state();
//! batch.restore(1, &state)?;
//! batch.reset(&[2])?;
//! batch.step(5, &[0, 1])?;
//! assert_eq!(batch.world(0).hash(), batch.world(1).hash());
//! assert_eq!(batch.world(2).hash(), batch.world(3).hash());
//! // Single worlds can be changed, can listen to events, and can start from states.
//! let mut again = Batch::of_states([state])?.on_threads(1)?;
//! again.world_mut(0).simulation_mut().listen(Listen { contacts: true, ..Listen::default() })?;
//! again.worlds_mut()[0].simulation_mut().world.gravity.x = 0.1;
//! again.step(1, &[0])?;
//! assert_eq!((again.threads(), again.events(&[0])?.len(), again.contacts(&[0])?.bodies.len()), (1, 3, 3));
//! # Ok::<(), drystone::Error>(())
//! ```

mod column;
mod contacts;
mod group;
mod member;
mod state;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::backend::Backend;
use crate::config::SolverConfig;
use crate::error::{Result, ensure, input};
use crate::world::World;

pub use column::{Column, DriveOf, drives, write};
pub use contacts::{Contacts, EventRow};
use group::{Group, Job};
pub use member::Member;
use member::RunLength;
pub use state::State;

/// Interval between calls of [`Run::stop`].
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Many worlds: see the [module](self).
pub struct Batch {
    members: Vec<Member>,
    /// Thread pools. With one pool for each thread, a world does not divide its work, which makes its steps faster. If
    /// there are fewer worlds than threads, there is one pool.
    pools: Vec<ThreadPool>,
    threads: usize,
    /// Memory for groups of worlds.
    groups: Mutex<Vec<Group>>,
    /// The group of all worlds on a backend of the caller's choice.
    chosen: Option<Group>,
}

/// The length of a run of [`Batch::run`].
///
/// ```
/// use drystone::batch::Run;
///
/// let run = Run { steps: 60, ..Run::default() };
/// assert!(run.dt.is_none() && run.stop.is_none());
/// ```
#[derive(Clone, Copy, Default)]
pub struct Run<'a> {
    /// Number of steps of each world.
    pub steps: u64,
    /// Length of a step (s), in place of that of each world.
    pub dt: Option<f32>,
    /// Called every 50 ms on the caller's thread. If it returns true, each world stops after its present step.
    pub stop: Option<&'a dyn Fn() -> bool>,
}

impl Batch {
    /// A batch of worlds, each with its length of a step (s) and its settings.
    ///
    /// ```
    /// use drystone::batch::Batch;
    /// use drystone_scenes::Scene;
    /// use drystone::{SolverConfig, preset::Preset};
    ///
    /// let scene = Scene::find("tower", &["n=3".into()])?;
    /// let batch = Batch::new([Preset::Fast, Preset::Accurate].map(|preset| (&scene.world, scene.dt, preset.config())))?;
    /// assert_eq!((batch.len(), batch.world(1).simulation().config().substeps), (2, 32));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is no world; [`Simulation::with`](crate::Simulation::with) refuses a world or settings; a [`World`] holds
    /// several worlds beside each other; or a step is too short or too long.
    pub fn new<'a>(worlds: impl IntoIterator<Item = (&'a World, f32, SolverConfig)>) -> Result<Self> {
        let member = |(k, (world, dt, config))| Member::new(world, dt, config).map_err(|error| of_world(k, error));
        Self::of_members(worlds.into_iter().enumerate().map(member).collect::<Result<_>>()?)
    }

    /// A batch of `count` equal worlds with steps of `dt` seconds.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn of(world: &World, dt: f32, config: &SolverConfig, count: usize) -> Result<Self> {
        let first = Member::new(world, dt, config.clone())?;
        let start = first.start().clone();
        let others = (1..count).map(|_| Member::of(start.clone()));
        Self::of_members(std::iter::once(first).take(count).chain(others).collect())
    }

    /// A batch with one world for each state. A reset restores that state.
    ///
    /// # Errors
    /// There is no state.
    pub fn of_states(states: impl IntoIterator<Item = State>) -> Result<Self> {
        Self::of_members(states.into_iter().map(|state| Member::of(Arc::new(state))).collect())
    }

    fn of_members(members: Vec<Member>) -> Result<Self> {
        ensure(!members.is_empty(), || "a batch of 0 worlds: must be at least one".to_owned())?;
        Self { members, pools: Vec::new(), threads: 0, groups: Mutex::default(), chosen: None }.on_threads(0)
    }

    /// Sets the number of threads, or 0 for the size of the caller's pool. No result depends on it.
    ///
    /// # Errors
    /// The system cannot start that many threads.
    pub fn on_threads(mut self, threads: usize) -> Result<Self> {
        self.threads = if threads == 0 { rayon::current_num_threads() } else { threads };
        // On one backend, all threads assemble and store the steps of all worlds.
        let is_enough = self.members.len() >= self.threads && self.chosen.is_none();
        let (pools, each) = if is_enough { (self.threads, 1) } else { (1, self.threads) };
        let pool = |_| ThreadPoolBuilder::new().num_threads(each).build();
        let made: std::result::Result<_, _> = (0..pools).map(pool).collect();
        self.pools = made.map_err(|error| input!("threads = {threads}: {error}"))?;
        Ok(self)
    }

    /// Runs the steps of all worlds on one backend, such as a GPU: in each step, worlds with equal settings and rules are
    /// one problem. Without this call, each group of up to sixteen worlds runs on one thread of the CPU. Each step sends
    /// all rows to a device; a [`Simulation`](crate::Simulation) of worlds [beside](World::beside) each other keeps them
    /// there, but steps all of its worlds.
    ///
    /// On a GPU in exact mode, every world has the bits of the CPU. A world that fails repeats the earlier steps of the
    /// run on the CPU. If the backend fails, because its device is lost or the problem is too large for it, each world
    /// repeats the step on the CPU, and the batch continues on another backend, whatever the options of the first:
    /// [`Self::fault`] and [`StepStats::fault`] say so.
    ///
    /// ```
    /// use drystone::batch::Batch;
    /// use drystone::{Reference, SolverConfig};
    /// use drystone_scenes::Scene;
    ///
    /// let scene = Scene::find("tower", &["n=3".into()])?;
    /// let batch = || Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 4);
    /// let mut on_reference = batch()?.on_backend(Box::new(Reference::<f32>::new()))?;
    /// let mut on_cpu = batch()?;
    /// assert_eq!((on_reference.backend(), on_cpu.backend()), ("reference", "cpu"));
    /// on_reference.step(10, &[0, 2])?;
    /// on_cpu.step(10, &[0, 1, 2, 3])?;
    /// assert!(on_reference.fault().is_none() && on_reference.world(2).hash() == on_cpu.world(2).hash());
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// [`StepStats::fault`]: crate::StepStats::fault
    ///
    /// # Errors
    /// Those of [`Self::on_threads`].
    pub fn on_backend(mut self, backend: Box<dyn Backend>) -> Result<Self> {
        self.chosen = Some(Group::on(backend));
        let threads = self.threads;
        self.on_threads(threads)
    }

    /// The name of the backend: `cpu`, or that of the backend that [`Self::on_backend`] chose.
    pub fn backend(&self) -> &'static str {
        self.chosen.as_ref().map_or("cpu", |group| group.backend().name())
    }

    /// One line if the chosen backend failed in the last run: the reason, and the backend that continues. It is `None` if
    /// there was no failure.
    pub fn fault(&self) -> Option<&str> {
        self.chosen.as_ref().and_then(|group| group.last_fault.as_deref())
    }

    /// The number of worlds.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether there is no world; always false.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The number of threads.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// A world.
    ///
    /// # Panics
    /// The index is out of range.
    pub fn world(&self, world: usize) -> &Member {
        &self.members[world]
    }

    /// A world, for the changes between two steps that a [`Simulation`](crate::Simulation) allows.
    ///
    /// # Panics
    /// The index is out of range.
    pub fn world_mut(&mut self, world: usize) -> &mut Member {
        &mut self.members[world]
    }

    /// All worlds in order.
    pub fn worlds(&self) -> &[Member] {
        &self.members
    }

    /// All worlds in order, mutable.
    pub fn worlds_mut(&mut self) -> &mut [Member] {
        &mut self.members
    }

    /// Advances some worlds by `steps` steps. Returns the worlds that failed, in ascending order: [`Member::error`] has
    /// the reason.
    ///
    /// # Errors
    /// The worlds are not in ascending order, or an index is out of range. No world changes then.
    pub fn step(&mut self, steps: u64, worlds: &[usize]) -> Result<Vec<usize>> {
        let tasks = worlds.iter().map(|&world| (world, ())).collect();
        self.run(Run { steps, ..Run::default() }, tasks, |_, _, _| Ok(()), |_, _, _| {})
    }

    /// Advances some worlds, each with a value of the caller. `before` can change a world before each step, and `after`
    /// can read it after each step. Both get the number of the step, from 0. Returns the worlds that failed, in
    /// ascending order.
    ///
    /// Up to sixteen worlds run as a group on one thread, and wait for no other world; on a chosen backend, all worlds
    /// wait for each other. If a step fails, `before` is
    /// called again for the steps before it, and has to make the same changes again.
    ///
    /// ```
    /// use drystone::batch::{Batch, Run};
    /// use drystone_scenes::Scene;
    /// use drystone::{SolverConfig, glam::Vec3};
    ///
    /// let scene = Scene::find("sphere-plane", &[])?;
    /// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 2)?;
    /// // Each ball has its own force, and the run keeps the paths of both.
    /// let tasks = vec![(0, (0.0, Vec::new())), (1, (500.0, Vec::new()))];
    /// let mut ways = [0.0, 0.0];
    /// let failed = batch.run(
    ///     Run { steps: 30, ..Run::default() },
    ///     tasks,
    ///     |(push, _), _, world| Ok(world.bodies[1].force = Vec3::X * *push),
    ///     |(_, way), _, member| way.push(member.simulation().world.bodies[1].position.x),
    /// )?;
    /// ways.iter_mut().zip(batch.worlds()).for_each(|(x, member)| *x = member.simulation().world.bodies[1].position.x);
    /// assert!(failed.is_empty() && ways[0] == 0.0 && ways[1] > 0.01, "{ways:?}");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn run<T: Send>(
        &mut self,
        run: Run,
        mut tasks: Vec<(usize, T)>,
        before: impl Fn(&T, u64, &mut World) -> Result<()> + Sync,
        after: impl Fn(&mut T, u64, &Member) + Sync,
    ) -> Result<Vec<usize>> {
        let is_over = AtomicBool::new(false);
        let way = RunLength { steps: run.steps, dt: run.dt, is_over: &is_over };
        // A request to stop lasts: `stop` may report it once.
        let meanwhile = || {
            if run.stop.is_some_and(|stop| stop()) {
                is_over.store(true, Ordering::Relaxed);
            }
        };
        let chosen: Vec<usize> = tasks.iter().map(|task| task.0).collect();
        self.check(chosen.iter().copied())?;
        // As many worlds in a group as fill the lanes, and at least one group for each thread.
        let Self { members, pools, threads, groups, chosen: on_one } = self;
        let each = if on_one.is_some() { chosen.len() } else { chosen.len().div_ceil(*threads).min(group::WORLDS) };
        let mut jobs: Vec<_> =
            named(members, &mut tasks).into_iter().map(|(own, member)| Job::new(own, member)).collect();
        on_one.iter_mut().for_each(|group| group.last_fault = None);
        let on_one = on_one.as_mut().map(Mutex::new);
        let work = |jobs: &mut [Job<T>]| match &on_one {
            Some(group) => lock(group).run(jobs, way, &before, &after),
            None => {
                let mut group = lock(groups).pop().unwrap_or_else(Group::in_lanes);
                group.run(jobs, way, &before, &after);
                lock(groups).push(group);
            }
        };
        spread(pools, jobs.chunks_mut(each.max(1)).collect(), &work, &meanwhile);
        Ok(chosen.into_iter().filter(|&world| self.members[world].error().is_some()).collect())
    }

    /// Calls a function on some worlds between two steps, each with a value of the caller, on the threads of the batch.
    ///
    /// ```
    /// use drystone::batch::Batch;
    /// use drystone_scenes::Scene;
    /// use drystone::SolverConfig;
    ///
    /// let scene = Scene::find("pile", &["n=8".into()])?;
    /// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 3)?;
    /// let mut overlaps = [0.0; 3];
    /// let tasks = overlaps.iter_mut().enumerate().collect();
    /// batch.each(tasks, |overlap, member| **overlap = member.simulation().penetration().max)?;
    /// assert!(overlaps.iter().all(|overlap| *overlap == overlaps[0]));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn each<T: Send>(
        &mut self,
        mut tasks: Vec<(usize, T)>,
        work: impl Fn(&mut T, &mut Member) + Sync,
    ) -> Result<()> {
        self.check(tasks.iter().map(|task| task.0))?;
        let jobs = named(&mut self.members, &mut tasks);
        spread(&self.pools, jobs, &|(own, member): (&mut T, &mut Member)| work(own, member), &|| {});
        Ok(())
    }

    /// Resets worlds to their start, with the settings and [listeners](crate::Simulation::listen) of that time. Each has
    /// the bits of a world that never ran.
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn reset(&mut self, worlds: &[usize]) -> Result<()> {
        self.check(worlds.iter().copied())?;
        worlds.iter().for_each(|&world| self.members[world].reset());
        Ok(())
    }

    /// Sets a world to a state of any world. It continues with the bits of a world that continued from that state.
    ///
    /// # Errors
    /// The index is out of range.
    pub fn restore(&mut self, world: usize, state: &State) -> Result<()> {
        self.check([world])?;
        self.members[world].restore(state);
        Ok(())
    }

    /// The events of the last step of some worlds, in the order of the worlds. Within each world they are in the order
    /// of [`Simulation::events`](crate::Simulation::events).
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn events(&self, worlds: &[usize]) -> Result<Vec<EventRow>> {
        self.check(worlds.iter().copied())?;
        Ok(worlds.iter().flat_map(|&world| contacts::events(world, &self.members[world])).collect())
    }

    /// The contacts of some worlds after the last step, sorted by worlds, then by pairs of bodies.
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn contacts(&self, worlds: &[usize]) -> Result<Contacts> {
        self.check(worlds.iter().copied())?;
        Ok(Contacts::of(worlds.iter().map(|&world| &self.members[world])))
    }

    /// Refuses worlds that are out of range or not in ascending order.
    fn check(&self, worlds: impl IntoIterator<Item = usize>) -> Result<()> {
        let (count, mut last) = (self.members.len(), None);
        for world in worlds {
            ensure(world < count, || format!("world {world}: must be less than {count}"))?;
            ensure(last.is_none_or(|last| last < world), || format!("world {world}: worlds must be ascending"))?;
            last = Some(world);
        }
        Ok(())
    }
}

/// Runs jobs on pools, the first job first. Meanwhile this thread calls `meanwhile` at intervals until all jobs are
/// done.
fn spread<J: Send>(pools: &[ThreadPool], jobs: Vec<J>, work: &(impl Fn(J) + Sync), meanwhile: &dyn Fn()) {
    let (is_running, all_done) = mpsc::channel::<()>();
    let wait = || {
        while all_done.recv_timeout(BETWEEN_LOOKS) == Err(mpsc::RecvTimeoutError::Timeout) {
            meanwhile();
        }
    };
    if let [one] = pools {
        return one.in_place_scope(|scope| {
            scope.spawn(move |_| {
                jobs.into_par_iter().with_max_len(1).for_each(work);
                drop(is_running);
            });
            wait();
        });
    }
    let jobs = Mutex::new(jobs.into_iter());
    let next = || lock(&jobs).next();
    let drain = || {
        while let Some(job) = next() {
            work(job);
        }
    };
    on_each(pools, is_running, &drain, &wait);
}

/// Runs `drain` on every pool, and `wait` on this thread. The last pool to finish drops the last copy of `is_running`.
fn on_each(pools: &[ThreadPool], is_running: Sender<()>, drain: &(dyn Fn() + Sync), wait: &dyn Fn()) {
    let [first, others @ ..] = pools else {
        drop(is_running);
        return wait();
    };
    first.in_place_scope(|scope| {
        let own = is_running.clone();
        scope.spawn(move |_| {
            drain();
            drop(own);
        });
        on_each(others, is_running, drain, wait);
    });
}

/// The named worlds, each with its task.
fn named<'a, T>(members: &'a mut [Member], tasks: &'a mut [(usize, T)]) -> Vec<(&'a mut T, &'a mut Member)> {
    let mut tasks = tasks.iter_mut().peekable();
    let of_task = |(k, member)| tasks.next_if(|task| task.0 == k).map(|task| (&mut task.1, member));
    members.iter_mut().enumerate().filter_map(of_task).collect()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds the index of a world to an error.
fn of_world(world: usize, error: crate::Error) -> crate::Error {
    match error {
        crate::Error::Input(line) => input!("world {world}: {line}"),
        other => other,
    }
}
