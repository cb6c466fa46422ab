//! One world of a batch.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::State;
use crate::backend::cpu::Cpu;
use crate::config::{SolverConfig, check_step_length};
use crate::error::{Error, Result, ensure, input};
use crate::panics;
use crate::simulation::Simulation;
use crate::stats::StepStats;
use crate::world::World;

/// A world of a [`Batch`](super::Batch).
///
/// ```
/// use drystone::batch::{Batch, Member, State};
/// use drystone_scenes::Scene;
/// use drystone::{SolverConfig, glam::Vec3};
///
/// let scene = Scene::find("tower", &["n=2".into()])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 2)?.on_threads(1)?;
/// batch.world_mut(0).simulation_mut().world.bodies[1].force = Vec3::X * 50.0;
/// batch.worlds_mut()[1].simulation_mut().world.bodies[1].force.x = f32::NAN;
/// assert_eq!((batch.step(6, &[0, 1])?, batch.threads()), (vec![1], 1));
/// let member: &Member = batch.world(0);
/// assert_eq!((member.dt(), member.steps(), member.time()), (scene.dt, 6, 6.0 * f64::from(scene.dt)));
/// assert!(member.error().is_none() && member.stats().manifolds == 2);
/// assert_eq!(member.hash(), member.simulation().hash());
/// let state: State = member.state();
/// assert_eq!((state.time(), state.to_simulation().hash()), (member.time(), member.hash()));
/// // The other world stopped before its first step, with an error.
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
    /// The state before the last run, in reusable memory.
    before: State,
    error: Option<String>,
    stats: StepStats,
}

/// The length of a run.
#[derive(Clone, Copy)]
pub(super) struct RunLength<'a> {
    pub steps: u64,
    pub dt: Option<f32>,
    pub is_over: &'a AtomicBool,
}

impl Member {
    pub(super) fn new(world: &World, dt: f32, config: SolverConfig) -> Result<Self> {
        let worlds = world.world_count();
        ensure(worlds == 1, || format!("{worlds} worlds beside each other: must be one"))?;
        check_step_length(dt)?;
        let simulation = Simulation::with(world.clone(), config, Box::new(Cpu::new()))?;
        let state = State { simulation: simulation.snapshot(), dt, steps: 0, time: 0.0 };
        Ok(Self::of(Arc::new(state)))
    }

    pub(super) fn of(start: Arc<State>) -> Self {
        let State { dt, steps, time, .. } = *start;
        let (simulation, before) = (start.to_simulation(), State::clone(&start));
        Self { simulation, dt, steps, time, start, before, error: None, stats: StepStats::default() }
    }

    /// The simulation of this world.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The simulation of this world, for changes between two steps.
    pub fn simulation_mut(&mut self) -> &mut Simulation {
        &mut self.simulation
    }

    /// Default length of a step (s).
    pub fn dt(&self) -> f32 {
        self.dt
    }

    /// Number of steps since the start.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Time since the start (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state that a reset restores.
    pub fn start(&self) -> &Arc<State> {
        &self.start
    }

    /// The error that ended the last run of this world early. It is `None` if there was none, and after a reset or a
    /// restore.
    pub fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }

    /// The statistics of the last step of this world. They are empty before the first step, and after a reset or a
    /// restore. A step that ran together with those of other worlds has no time of its own for the sweeps, and no
    /// traffic.
    pub fn stats(&self) -> &StepStats {
        &self.stats
    }

    /// [`Simulation::hash`] of this world alone.
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

    /// Begins a run. A failed step restores the state at its start.
    pub(super) fn begin_run(&mut self) {
        self.error = None;
        self.keep();
    }

    /// Assembles a step. Returns false if nothing moves in it.
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

    /// Runs the assembled step, unless it already ran, and stores it.
    pub(super) fn end_step(&mut self, dt: Option<f32>, ran: bool) -> Result<()> {
        let Self { simulation, stats, .. } = self;
        let length = dt.unwrap_or(self.dt);
        guarded(|| {
            if ran {
                return simulation.end_joined_step(length, stats);
            }
            simulation.end_step(length, stats)
        })?;
        self.note_step(dt)
    }

    /// Counts a completed step.
    ///
    /// # Errors
    /// The step left a number that is not finite.
    pub(super) fn note_step(&mut self, dt: Option<f32>) -> Result<()> {
        if let Some(body) = self.stats.first_non_finite {
            return Err(input!("{}: is no longer finite after a step", self.simulation.world.name_of(body.index())));
        }
        self.steps += 1;
        self.time += f64::from(dt.unwrap_or(self.dt));
        Ok(())
    }

    /// Records the fault of a device that the last step shared with others.
    pub(super) fn note_fault(&mut self, fault: Option<&String>) {
        if fault.is_some() {
            self.stats.fault = fault.cloned();
        }
    }

    /// Restores the state before the failed step, and records the error.
    pub(super) fn fail(
        &mut self,
        error: Error,
        steps: u64,
        dt: Option<f32>,
        before: impl Fn(u64, &mut World) -> Result<()>,
    ) {
        let mut steps = steps;
        // Repeat the same steps: a failed step changes the contacts. A device without the bits of the CPU can get further.
        while let Some(failed) = self.repeat(steps, dt, &before) {
            steps = failed;
        }
        self.error = Some(error.to_string());
    }

    /// Repeats the first steps of a run on the CPU. Returns the first step that fails.
    fn repeat(&mut self, steps: u64, dt: Option<f32>, before: &impl Fn(u64, &mut World) -> Result<()>) -> Option<u64> {
        // A panic can leave the backend in an incomplete state.
        self.simulation.set_backend(Box::new(Cpu::new()));
        self.simulation.restore(&self.before.simulation);
        (self.dt, self.steps, self.time) = (self.before.dt, self.before.steps, self.before.time);
        (0..steps).find(|&step| {
            let begun = self.begin_step(dt, |world| before(step, world));
            begun.and_then(|begun| if begun { self.end_step(dt, false) } else { self.note_step(dt) }).is_err()
        })
    }

    /// Keeps the present state.
    fn keep(&mut self) {
        self.simulation.snapshot_into(&mut self.before.simulation);
        (self.before.dt, self.before.steps, self.before.time) = (self.dt, self.steps, self.time);
    }
}

/// Runs a step that can panic.
fn guarded<R>(step: impl FnOnce() -> Result<R>) -> Result<R> {
    panics::caught(step).unwrap_or_else(|panic| Err(Error::Panicked(panic.text)))
}
