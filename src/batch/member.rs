//! One world of a batch.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::State;
use crate::backend::cpu::Cpu;
use crate::config::{SolverConfig, check_step_length};
use crate::error::{Error, Result, ensure, input};
use crate::panics;
use crate::scenes::Scene;
use crate::simulation::Simulation;
use crate::stats::StepStats;
use crate::world::World;

/// A world of a [`Batch`](super::Batch).
///
/// ```
/// use drystone::batch::{Batch, Member, State};
/// use drystone::{Scene, SolverConfig, glam::Vec3};
///
/// let scene = Scene::find("tower", &["n=2".into()])?;
/// let mut batch = Batch::of(&scene, &SolverConfig::default(), 2)?.on_threads(1)?;
/// batch.world_mut(0).simulation_mut().world.bodies[1].force = Vec3::X * 50.0;
/// batch.worlds_mut()[1].simulation_mut().world.bodies[1].force.x = f32::NAN;
/// assert_eq!((batch.step(6, &[0, 1])?, batch.threads()), (vec![1], 1));
/// let member: &Member = batch.world(0);
/// assert_eq!((member.dt(), member.steps(), member.time()), (scene.dt, 6, 6.0 * f64::from(scene.dt)));
/// assert!(member.error().is_none() && member.stats().manifolds == 2);
/// assert_eq!(member.hash(), member.simulation().hash());
/// let state: State = member.state();
/// assert_eq!((state.time(), state.to_simulation().hash()), (member.time(), member.hash()));
/// // The other one stopped before its first step, and says why.
/// let failed = batch.world(1);
/// assert!(failed.steps() == 0 && failed.error().is_some_and(|line| line.contains("force")));
/// assert_eq!(failed.start().hash(), failed.hash());
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Member {
    simulation: Simulation,
    dt: f32,
    steps: u64,
    time: f64,
    start: Arc<State>,
    /// The state before the last run, in memory that stands.
    before: State,
    error: Option<String>,
    stats: StepStats,
}

/// How far a run goes.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub steps: u64,
    pub dt: Option<f32>,
    pub is_over: &'a AtomicBool,
}

impl Member {
    pub(super) fn new(scene: &Scene, config: &SolverConfig) -> Result<Self> {
        let comes_and_goes = !scene.spawners.is_empty() || !scene.leaving.is_empty();
        ensure(!comes_and_goes, || {
            format!("{}: bodies come or leave by themselves, and a batch has worlds of constant bodies", scene.name)
        })?;
        let worlds = scene.world.world_count();
        ensure(worlds == 1, || format!("{}: {worlds} worlds beside each other: must be one", scene.name))?;
        check_step_length(scene.dt)?;
        let simulation = Simulation::new(scene.world.clone(), config.clone(), Box::new(Cpu::new()))?;
        let state = State { simulation: simulation.snapshot(), dt: scene.dt, steps: 0, time: 0.0 };
        Ok(Self::of(Arc::new(state)))
    }

    pub(super) fn of(start: Arc<State>) -> Self {
        let State { dt, steps, time, .. } = *start;
        let (simulation, before) = (start.to_simulation(), State::clone(&start));
        Self { simulation, dt, steps, time, start, before, error: None, stats: StepStats::default() }
    }

    /// The world and all that the next step goes on from.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The same, to change between two steps.
    pub fn simulation_mut(&mut self) -> &mut Simulation {
        &mut self.simulation
    }

    /// Length of a step (s) where a run gives none.
    pub fn dt(&self) -> f32 {
        self.dt
    }

    /// Steps since the start.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Time since the start (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state that a reset goes back to.
    pub fn start(&self) -> &Arc<State> {
        &self.start
    }

    /// Why the last run of this world ended before its last step; none if it did not, and after a reset or a restore.
    pub fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }

    /// The figures of the last step of this world; those of no step before the first one, and after a reset or a restore.
    pub fn stats(&self) -> &StepStats {
        &self.stats
    }

    /// [`Simulation::hash`]: that of the world alone.
    pub fn hash(&self) -> u64 {
        self.simulation.hash()
    }

    /// The state between two steps.
    pub fn state(&self) -> State {
        let Self { dt, steps, time, .. } = *self;
        State { simulation: self.simulation.snapshot(), dt, steps, time }
    }

    pub(super) fn reset(&mut self) {
        let start = Arc::clone(&self.start);
        self.restore(&start);
    }

    pub(super) fn restore(&mut self, state: &State) {
        self.simulation.restore(&state.simulation);
        (self.dt, self.steps, self.time) = (state.dt, state.steps, state.time);
        self.error = None;
        self.stats = StepStats::default();
    }

    /// Begins a run: a step that fails goes back to where it began.
    pub(super) fn begin_run(&mut self) {
        self.error = None;
        self.keep();
    }

    /// Assembles a step; false if nothing moves in it.
    pub(super) fn begin_step(
        &mut self,
        dt: Option<f32>,
        before: impl FnOnce(&mut World) -> Result<()>,
    ) -> Result<bool> {
        let (dt, simulation) = (dt.unwrap_or(self.dt), &mut self.simulation);
        let mut stats = StepStats::default();
        let begun = guarded(|| before(&mut simulation.world).and_then(|()| simulation.begin_step(dt, &mut stats)))?;
        self.stats = stats;
        Ok(begun)
    }

    /// Runs what is assembled, unless it ran, and stores it.
    pub(super) fn end_step(&mut self, dt: Option<f32>, ran: bool) -> Result<()> {
        let Self { simulation, stats, .. } = self;
        let length = dt.unwrap_or(self.dt);
        guarded(|| {
            if ran {
                simulation.store_step(length, stats);
                return Ok(());
            }
            simulation.end_step(length, stats)
        })?;
        self.note_step(dt)
    }

    /// Counts a step that is done.
    ///
    /// # Errors
    /// It left numbers that are none.
    pub(super) fn note_step(&mut self, dt: Option<f32>) -> Result<()> {
        if let Some(body) = self.stats.first_non_finite {
            return Err(input!("{}: is no longer finite after a step", self.simulation.world.name_of(body)));
        }
        self.steps += 1;
        self.time += f64::from(dt.unwrap_or(self.dt));
        Ok(())
    }

    /// Goes back to before the step that failed, and says why it did.
    pub(super) fn fail(
        &mut self,
        error: Error,
        steps: u64,
        dt: Option<f32>,
        before: impl Fn(u64, &mut World) -> Result<()>,
    ) {
        // A panic may have left the backend half done.
        self.simulation.set_backend(Box::new(Cpu::new()));
        self.simulation.restore(&self.before.simulation);
        (self.dt, self.steps, self.time) = (self.before.dt, self.before.steps, self.before.time);
        // Through the same steps again: after one that failed, contacts are not as they were.
        for step in 0..steps {
            let begun = self.begin_step(dt, |world| before(step, world));
            let again = begun.and_then(|begun| if begun { self.end_step(dt, false) } else { self.note_step(dt) });
            debug_assert!(again.is_ok(), "{again:?}");
        }
        self.error = Some(error.to_string());
    }

    /// Keeps the state of now.
    fn keep(&mut self) {
        self.simulation.snapshot_into(&mut self.before.simulation);
        (self.before.dt, self.before.steps, self.before.time) = (self.dt, self.steps, self.time);
    }
}

/// A step that may panic.
fn guarded<R>(step: impl FnOnce() -> Result<R>) -> Result<R> {
    panics::caught(step).unwrap_or_else(|panic| Err(Error::Panicked(panic.text)))
}
