//! The caller's part in a run: the length of each step, and the changes since the step before. Recordings keep it.

use super::Simulation;
#[cfg(doc)]
use super::hashes;
use crate::config::SolverConfig;
use crate::error::Result;
use crate::saved::{Reader, Saved, Writer};
use crate::world::{World, WorldChange};

/// The caller's part in one step, and a hash of the bodies after it.
pub struct StepInput {
    /// Length of the step (s).
    pub dt: f32,
    change: WorldChange,
    /// The settings, if they changed.
    config: Option<SolverConfig>,
    /// Bodies that the caller woke.
    woken: Vec<u32>,
    /// [`hashes`] of the bodies after the step, or `None`.
    pub hash: Option<(u64, Vec<u8>)>,
}

crate::saved::fields!(StepInput { dt, change, config, woken, hash });

impl StepInput {
    /// Makes the caller's changes in a simulation before the step.
    ///
    /// # Errors
    /// The settings contradict each other.
    pub fn make(&self, simulation: &mut Simulation) -> Result<()> {
        self.change.make(&mut simulation.world);
        if let Some(config) = &self.config {
            simulation.set_config(config.clone())?;
        }
        self.woken.iter().for_each(|&body| simulation.stages.sleep.wake(body as usize));
        Ok(())
    }
}

/// Finds the caller's changes of a simulation by comparison, and writes them as bytes.
pub struct InputWriter {
    /// The world after the last step.
    world: World,
    config: SolverConfig,
    asleep: Vec<bool>,
    /// The number of the state after the last step: [`Simulation::state`].
    state: u64,
    /// The shapes that are already written.
    shapes: Writer,
}

impl InputWriter {
    /// A writer that knows the present state of a simulation.
    pub fn new(simulation: &Simulation) -> Self {
        Self {
            world: simulation.world.clone(),
            config: simulation.config().clone(),
            asleep: simulation.asleep().to_vec(),
            state: simulation.state(),
            shapes: Writer::default(),
        }
    }

    /// The world in the state that the writer knows.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Whether the simulation left the known state by a step or by a jump to another state, and not only by changes of
    /// the caller.
    pub fn is_behind(&self, simulation: &Simulation) -> bool {
        self.state != simulation.state()
    }

    /// Takes over the present state of a simulation.
    pub fn follow(&mut self, simulation: &Simulation) {
        self.world.clone_from(&simulation.world);
        self.config.clone_from(simulation.config());
        self.asleep.clear();
        self.asleep.extend_from_slice(simulation.asleep());
        self.state = simulation.state();
    }

    /// The caller's changes since the known state, for a step of `dt` seconds.
    pub fn changes(&self, simulation: &Simulation, dt: f32) -> StepInput {
        let change = WorldChange::between(&self.world, &simulation.world);
        let woken = self.asleep.iter().zip(simulation.asleep()).enumerate().filter(|(_, (was, is))| **was && !**is);
        let woken = woken.map(|(i, _)| i as u32).collect();
        let config = (*simulation.config() != self.config).then(|| simulation.config().clone());
        StepInput { dt, change, config, woken, hash: None }
    }

    /// The bytes of an input. They name shapes of earlier inputs by number.
    ///
    /// # Errors
    /// No error is possible: writing to memory never fails.
    pub fn write(&mut self, input: &mut StepInput) -> Result<Vec<u8>> {
        self.shapes = Writer::behind(std::mem::take(&mut self.shapes));
        input.walk(&mut self.shapes)?;
        Ok(std::mem::take(&mut self.shapes.bytes))
    }
}

/// Reads the inputs of a run, in their order.
pub struct InputReader<'a>(Reader<'a>);

impl Default for InputReader<'_> {
    fn default() -> Self {
        Self(Reader::new(&[]))
    }
}

impl<'a> InputReader<'a> {
    /// The next input.
    ///
    /// # Errors
    /// The bytes are damaged or cut short.
    pub fn read(&mut self, bytes: &'a [u8]) -> Result<StepInput> {
        let before = std::mem::replace(&mut self.0, Reader::new(&[]));
        self.0 = Reader::behind(before, bytes);
        let mut input = StepInput::blank();
        input.walk(&mut self.0)?;
        Ok(input)
    }
}
