//! Snapshots, forks and saved runs.

use super::{Simulation, Stages, next_state};
use crate::backend::Backend;
use crate::config::SolverConfig;
use crate::error::{Result, ensure};
use crate::saved::{Archive, Format, Reader, Saved, Writer};
use crate::world::World;

/// The state of a simulation between two steps, in memory: [`Simulation::snapshot`].
///
/// ```
/// # use drystone::{Body, Shape, Simulation, World};
/// # let mut world = World::new();
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
/// # let mut simulation = Simulation::new(world)?;
/// let mut state: drystone::Snapshot = simulation.snapshot();
/// simulation.step(1.0 / 60.0)?;
/// simulation.snapshot_into(&mut state);
/// let hash = simulation.hash();
/// simulation.step(1.0 / 60.0)?;
/// simulation.restore(&state);
/// assert_eq!(simulation.hash(), hash);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Snapshot {
    world: World,
    config: SolverConfig,
    stages: Box<Stages>,
}

crate::saved::cloned!(Snapshot { world, config, stages });

impl Snapshot {
    /// The world of the state.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// [`Simulation::hash`] of the state.
    pub fn hash(&self) -> u64 {
        super::hashes(&self.world.bodies).0
    }
}

const RUN: Format = Format { name: "a saved run", mark: *b"drystone" };

impl Simulation {
    /// A second simulation that continues from this state on its own backend. Both reach the same bits if both get the
    /// same calls.
    ///
    /// ```
    /// use drystone::{Body, Cpu, Shape, Simulation, World};
    ///
    /// let mut world = World::new();
    /// world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
    /// world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 2.0, 0.0));
    /// let mut one = Simulation::new(world)?;
    /// one.step(1.0 / 60.0)?;
    /// let mut other = one.fork(Box::new(Cpu::new()));
    /// one.step(1.0 / 60.0)?;
    /// other.step(1.0 / 60.0)?;
    /// assert_eq!(one.hash(), other.hash());
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn fork(&self, backend: Box<dyn Backend>) -> Self {
        Self::of_snapshot(self.snapshot(), backend)
    }

    /// The simulation of a state.
    pub(crate) fn of_snapshot(snapshot: Snapshot, backend: Box<dyn Backend>) -> Self {
        let Snapshot { world, config, stages } = snapshot;
        Self::between_steps(world, config, *stages, backend)
    }

    /// A snapshot of the state between two steps.
    ///
    /// ```
    /// # use drystone::{Body, Shape, Simulation, World};
    /// # let mut world = World::new();
    /// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// # let mut simulation = Simulation::new(world)?;
    /// let before = simulation.snapshot();
    /// simulation.step(1.0 / 60.0)?;
    /// let after = simulation.hash();
    /// simulation.restore(&before);
    /// simulation.step(1.0 / 60.0)?;
    /// assert_eq!(simulation.hash(), after);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn snapshot(&self) -> Snapshot {
        let Self { world, config, stages, .. } = self;
        Snapshot { world: world.clone(), config: config.clone(), stages: Box::new(stages.clone()) }
    }

    /// The same, but reuses the memory of another snapshot.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.world.clone_from(&self.world);
        snapshot.config.clone_from(&self.config);
        (*snapshot.stages).clone_from(&self.stages);
    }

    /// Restores a snapshot of this simulation or of another one: the world, the settings, and all solver state for the
    /// next step. The backend stays.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.world.clone_from(&snapshot.world);
        self.config.clone_from(&snapshot.config);
        self.stages.clone_from(&*snapshot.stages);
        self.on_device = false;
        self.unfinished = None;
        self.is_pending = false;
        self.state = next_state();
    }

    /// The state between two steps as bytes, for [`Simulation::load`]. The bytes are the same on every machine. They
    /// begin with a version and a hash of the content. The hash detects damage, but not a deliberate forgery.
    ///
    /// A loaded run has the same bits as an uninterrupted run. Before its first step, [`Simulation::problem`] and
    /// [`Simulation::plan`] lack the parts that each step rewrites, and [`Simulation::manifolds`] gives the separations
    /// from the time when the manifolds were computed.
    pub fn save(&mut self) -> Vec<u8> {
        RUN.seal(|writer| self.walk(writer))
    }

    /// Loads a saved simulation, with its own backend.
    ///
    /// # Errors
    /// The bytes are not a saved run, have another version, or are damaged or cut short. If the bytes are forged, the
    /// first steps can fail.
    ///
    /// ```
    /// # use drystone::{Body, Cpu, Shape, Simulation, World};
    /// # let mut world = World::new();
    /// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// # let mut simulation = Simulation::new(world)?;
    /// let bytes = simulation.save();
    /// let mut again = Simulation::load(&bytes, Box::new(Cpu::new()))?;
    /// simulation.step(1.0 / 60.0)?;
    /// again.step(1.0 / 60.0)?;
    /// assert_eq!(again.hash(), simulation.hash());
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn load(bytes: &[u8], backend: Box<dyn Backend>) -> Result<Self> {
        RUN.open(bytes, |reader| Self::read(reader, backend))
    }

    /// Reads a simulation that [`Self::walk`] has written.
    pub(crate) fn read(reader: &mut Reader, backend: Box<dyn Backend>) -> Result<Self> {
        let (world, config) = (World::blank(), SolverConfig::default());
        let stages = Stages::new(&world, &config);
        let mut simulation = Self::between_steps(world, config, stages, backend);
        simulation.walk(reader)?;
        Ok(simulation)
    }

    /// The world and the settings as bytes, for comparison.
    pub(super) fn world_and_settings(&mut self) -> Vec<u8> {
        let mut writer = Writer::default();
        let written = self.world.walk(&mut writer).and_then(|()| self.config.walk(&mut writer));
        debug_assert!(written.is_ok(), "{written:?}");
        writer.bytes
    }

    pub(crate) fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { world, config, backend: _, stages, on_device: _, unfinished: _, state: _, is_pending: _, hooks: _ } =
            self;
        world.walk(archive)?;
        config.walk(archive)?;
        if A::READS {
            let are_consistent = world.bodies.are_consistent() && world.joints.are_consistent();
            ensure(are_consistent, || "a body or a joint has no place".to_owned())?;
            config.check()?;
        }
        stages.walk(world, archive)
    }
}
