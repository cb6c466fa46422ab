//! An engine and how it is set, before it has a scene.

use drystone::{Result, Scene, SolverConfig};
use drystone_cli::report::comparison::{Contender, Drystone};
use drystone_cli::settings;

use crate::{box3d::Box3d, rapier::Rapier};

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
#[derive(Clone, Debug, PartialEq)]
pub struct Entrant {
    /// The engine.
    pub engine: Engine,
    /// Substeps of a step; Rapier calls them iterations.
    pub substeps: u32,
    /// Frequency of the contact spring times the length of a substep; none is the engine's own: 0.125 for drystone, 30 Hz for the
    /// others whatever the substeps. Box3D takes 0.125 for anything above.
    pub frequency: Option<f32>,
    /// Other settings of drystone, as `key=value`.
    pub set: Vec<String>,
}

impl Entrant {
    /// What an engine does unless told otherwise.
    pub fn default_of(engine: Engine) -> Self {
        let substeps = match engine {
            Engine::Drystone => SolverConfig::default().substeps,
            Engine::Rapier | Engine::Box3d => 4,
        };
        Self { engine, substeps, frequency: None, set: Vec::new() }
    }

    /// Frequency of the contact spring between two bodies that move [Hz], for steps of `dt` seconds.
    pub fn hertz(&self, dt: f32) -> f32 {
        let at = |frequency: f32| frequency * self.substeps as f32 / dt;
        match (self.engine, self.frequency) {
            (Engine::Drystone, frequency) => at(frequency.unwrap_or(SolverConfig::default().contact_frequency)),
            (_, None) => 30.0,
            (Engine::Rapier, Some(frequency)) => at(frequency),
            (Engine::Box3d, Some(frequency)) => at(frequency.min(0.125)),
        }
    }

    /// The scene in the hands of the engine. drystone takes the threads of rayon's global pool, the others `threads`.
    ///
    /// # Errors
    /// The scene or the setting is not fit for the engine; several threads for a Rapier that was built for one.
    pub fn build(&self, scene: &Scene, threads: usize) -> Result<Box<dyn Contender>> {
        scene.world.check()?;
        let hertz = self.hertz(scene.dt);
        Ok(match self.engine {
            Engine::Drystone => {
                let mut config = SolverConfig::default().without_sleep().with(|c| c.substeps = self.substeps);
                config.contact_frequency = self.frequency.unwrap_or(config.contact_frequency);
                self.set.iter().try_for_each(|assignment| settings::set(&mut config, assignment))?;
                Box::new(Drystone::new(scene, "cpu", &config)?)
            }
            Engine::Rapier => Box::new(Rapier::new(scene, self.substeps, hertz, threads)?),
            Engine::Box3d => Box::new(Box3d::new(scene, self.substeps, hertz, threads)?),
        })
    }
}
