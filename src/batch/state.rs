//! Saved states of a world of a batch.

use crate::backend::cpu::Cpu;
use crate::config::check_step_length;
use crate::error::Result;
use crate::saved::{Format, Saved};
use crate::simulation::{Simulation, Snapshot};
use crate::world::World;

/// The state of a world of a [`Batch`](super::Batch) between two steps, with its time and step count.
///
/// ```
/// use drystone::batch::{Batch, State};
/// use drystone_scenes::Scene;
/// use drystone::SolverConfig;
///
/// let scene = Scene::find("tower", &[])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 1)?;
/// batch.step(7, &[0])?;
/// let state = batch.world(0).state();
/// assert_eq!((state.time(), state.to_simulation().hash()), (batch.world(0).time(), state.hash()));
/// let bytes: Vec<u8> = state.save();
/// let mut again = Batch::of_states([State::load(&bytes)?])?;
/// batch.step(7, &[0])?;
/// again.step(7, &[0])?;
/// assert_eq!((again.world(0).hash(), again.world(0).steps()), (batch.world(0).hash(), 14));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone)]
pub struct State {
    pub(super) simulation: Snapshot,
    pub(super) dt: f32,
    pub(super) steps: u64,
    pub(super) time: f64,
}

const WORLD_OF_BATCH: Format = Format { name: "a saved world of a batch", mark: *b"drybatch" };

impl State {
    /// Number of steps since the start.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Time since the start (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The bodies and joints.
    pub fn world(&self) -> &World {
        self.simulation.world()
    }

    /// [`Simulation::hash`] of the state.
    pub fn hash(&self) -> u64 {
        self.simulation.hash()
    }

    /// A simulation that continues from the state.
    pub fn to_simulation(&self) -> Simulation {
        Simulation::of_snapshot(self.simulation.clone(), Box::new(Cpu::new()))
    }

    /// The state as bytes, the same on every machine.
    pub fn save(&self) -> Vec<u8> {
        let (mut dt, mut steps, mut time) = (self.dt, self.steps, self.time);
        WORLD_OF_BATCH.seal(|writer| {
            dt.walk(writer)?;
            steps.walk(writer)?;
            time.walk(writer)?;
            self.to_simulation().walk(writer)
        })
    }

    /// Loads a saved state.
    ///
    /// # Errors
    /// The bytes are not a saved world of a batch, have another version, or are damaged or cut short.
    pub fn load(bytes: &[u8]) -> Result<Self> {
        WORLD_OF_BATCH.open(bytes, |reader| {
            let (mut dt, mut steps, mut time) = (0.0, 0, 0.0);
            dt.walk(reader)?;
            check_step_length(dt)?;
            steps.walk(reader)?;
            time.walk(reader)?;
            Ok(Self { simulation: Simulation::read(reader, Box::new(Cpu::new()))?.snapshot(), dt, steps, time })
        })
    }
}
