//! Saved states of a world of a batch.

use crate::backend::cpu::Cpu;
use crate::config::check_step_length;
use crate::error::{Error, Result, input};
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

/// The first bytes of a saved world of a batch.
const MAGIC: [u8; 8] = *b"drybatch";
/// Size of the header (bytes): the magic, the length of a step, steps and time, and the hash of the three.
const HEADER: usize = 8 + 4 + 8 + 8 + 8;

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
        let numbers = [self.dt.to_le_bytes().as_slice(), &self.steps.to_le_bytes(), &self.time.to_le_bytes()].concat();
        let hash = crate::saved::hash_of(&numbers).to_le_bytes();
        [MAGIC.as_slice(), &numbers, &hash, &self.to_simulation().save()].concat()
    }

    /// Loads a saved state.
    ///
    /// # Errors
    /// The bytes are not a saved world of a batch, have another version, or are damaged or cut short.
    pub fn load(bytes: &[u8]) -> Result<Self> {
        let (header, simulation) = bytes.split_first_chunk::<HEADER>().ok_or_else(|| refused("cut short"))?;
        let (magic, numbers, hash) = (&header[..8], &header[8..28], &header[28..]);
        if magic != MAGIC {
            return Err(refused("these bytes are not a saved world of a batch"));
        }
        if crate::saved::hash_of(numbers).to_le_bytes() != *hash {
            return Err(refused("damaged: the hash of its time differs"));
        }
        let eight = |from: usize| numbers[from..from + 8].try_into().unwrap_or_default();
        let dt = f32::from_le_bytes(numbers[..4].try_into().unwrap_or_default());
        check_step_length(dt).map_err(|error| error.within("a saved world of a batch"))?;
        let simulation = Simulation::load(simulation, Box::new(Cpu::new()))?.snapshot();
        Ok(Self { simulation, dt, steps: u64::from_le_bytes(eight(4)), time: f64::from_le_bytes(eight(12)) })
    }
}

fn refused(why: &str) -> Error {
    input!("a saved world of a batch cannot be loaded: {why}")
}
