//! An engine with a scene in it, and how it is set.

use drystone::{Cpu, Error, Result, Scene, Simulation, SolverConfig, World};

use crate::{box3d::Box3d, rapier::Rapier};

/// A scene in the hands of an engine.
pub trait Contender {
    /// Moves the bodies by the scene's step: what is timed.
    ///
    /// # Errors
    /// The engine cannot do the step.
    fn step(&mut self) -> Result<()>;

    /// The bodies as they are after the last step.
    fn world(&mut self) -> &World;
}

/// Who steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Engine {
    /// drystone's CPU lanes.
    Drystone,
    /// The crate rapier3d.
    Rapier,
    /// Box3D, by the crate box3d-sys.
    Box3d,
}

/// An engine and the two settings that all three have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// The engine.
    pub engine: Engine,
    /// Substeps of a step; Rapier calls them iterations.
    pub substeps: u32,
    /// Frequency of the contact spring times the length of a substep; none is the engine's own: 0.125 for drystone, 30 Hz for the
    /// others whatever the substeps. Box3D takes 0.125 for anything above.
    pub frequency: Option<f32>,
}

impl Setting {
    /// What an engine does unless told otherwise.
    pub fn default_of(engine: Engine) -> Self {
        let substeps = match engine {
            Engine::Drystone => SolverConfig::default().substeps,
            Engine::Rapier | Engine::Box3d => 4,
        };
        Self { engine, substeps, frequency: None }
    }

    /// Frequency of the contact spring between two bodies that move [Hz], for steps of `dt` seconds.
    pub fn hertz(&self, dt: f32) -> f32 {
        let own = SolverConfig::default().contact_frequency;
        let at = |frequency: f32| frequency * self.substeps as f32 / dt;
        match (self.engine, self.frequency) {
            (Engine::Drystone, frequency) => at(frequency.unwrap_or(own)),
            (_, None) => 30.0,
            (Engine::Rapier, Some(frequency)) => at(frequency),
            (Engine::Box3d, Some(frequency)) => at(frequency.min(0.125)),
        }
    }

    /// What a row of a table is called.
    pub fn label(&self, dt: f32) -> String {
        let engine = format!("{:?}", self.engine).to_lowercase();
        format!("{engine} {} x {:.0} Hz", self.substeps, self.hertz(dt))
    }

    /// The scene in the hands of the engine. drystone takes the threads of rayon's global pool, the others `threads`.
    ///
    /// # Errors
    /// The scene or the setting is not fit for the engine; several threads for a Rapier that was built without.
    pub fn build(&self, scene: &Scene, threads: usize) -> Result<Box<dyn Contender>> {
        scene.world.check()?;
        let hertz = self.hertz(scene.dt);
        let contender: Box<dyn Contender> = match self.engine {
            Engine::Drystone => Box::new(Drystone::new(scene, self)?),
            Engine::Rapier => Box::new(Rapier::new(scene, self.substeps, hertz, threads)?),
            Engine::Box3d => Box::new(Box3d::new(scene, self.substeps, hertz, threads)?),
        };
        Ok(contender)
    }
}

struct Drystone {
    simulation: Simulation,
    dt: f32,
}

impl Drystone {
    fn new(scene: &Scene, setting: &Setting) -> Result<Self> {
        let mut config = SolverConfig { substeps: setting.substeps, ..SolverConfig::default() };
        config.contact_frequency = setting.frequency.unwrap_or(config.contact_frequency);
        let simulation = Simulation::new(scene.world.clone(), config, Box::new(Cpu::new()))?;
        Ok(Self { simulation, dt: scene.dt })
    }
}

impl Contender for Drystone {
    fn step(&mut self) -> Result<()> {
        self.simulation.step(self.dt).map(drop)
    }

    fn world(&mut self) -> &World {
        &self.simulation.world
    }
}

/// One line for a shape that an engine does not have.
pub(crate) fn unknown_shape(engine: &str, body: usize, shape: &drystone::Shape) -> Error {
    Error::input(format!("{engine} has no shape like {shape:?} of body {body}"))
}
