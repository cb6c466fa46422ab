//! What takes part in a comparison: an engine with its settings.

use serde::{Deserialize, Serialize};

use crate::settings;
use drystone::backend::BackendKind;
use drystone::config::{Friction, Method};
use drystone::{Result, Scene, Simulation, SolverConfig, World};

/// An engine with its settings, stepping one scene.
pub trait Contender {
    /// What it is.
    fn setting(&self) -> Setting;

    /// One step of the scene's length; the only call that is timed.
    fn step(&mut self) -> Result<()>;

    /// The world after the last step: the bodies of the scene in their order, with their poses and velocities.
    fn world(&mut self) -> &World;
}

/// Who takes part in a scene, with each of their settings.
pub type Team<'a> = dyn Fn(&Scene, Extent) -> Result<Vec<Box<dyn Contender>>> + 'a;

/// How much is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// The main settings.
    Quick,
    /// All of them.
    Full,
}

/// An engine and its settings, as text and numbers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Setting {
    /// Name of the engine.
    pub engine: String,
    /// What it runs on: `reference`, `cpu`, `gpu`.
    pub backend: String,
    /// Substeps of a step.
    pub substeps: u32,
    /// Sweeps of a substep.
    pub sweeps: u32,
    /// What is done with the sweeps.
    pub method: String,
    /// Friction rule.
    pub friction: String,
    /// What else is not at its default.
    pub more: String,
}

impl Setting {
    /// A point of drystone's own grid.
    pub fn drystone(backend: &str, config: &SolverConfig) -> Self {
        Self {
            engine: "drystone".into(),
            backend: backend.into(),
            substeps: config.substeps,
            sweeps: config.iterations,
            method: if config.method == Method::Plain { "plain" } else { "accelerated" }.into(),
            friction: if config.friction == Friction::Box { "box" } else { "disc" }.into(),
            more: unusual(config).join(" "),
        }
    }

    /// One line for people.
    pub fn label(&self) -> String {
        let Self { engine, backend, substeps, sweeps, method, friction, more } = self;
        let mut label = format!("{engine} {backend} {substeps}x{sweeps}");
        for (word, usual) in [(method, "plain"), (friction, "disc"), (more, "")] {
            if word != usual {
                label = format!("{label} {word}");
            }
        }
        label
    }
}

/// What a setting has no place for. As many relax sweeps as biased ones are what is expected.
fn unusual(config: &SolverConfig) -> Vec<String> {
    let said = ["substeps", "iterations", "method", "friction", "sleep_after"];
    let mut more = settings::unusual(config, &said);
    more.retain(|text| !text.starts_with("relax="));
    if config.relax != config.iterations {
        more.push(format!("relax={}", config.relax));
    }
    more
}

/// Drystone itself.
pub struct Drystone {
    simulation: Simulation,
    dt: f32,
}

impl Drystone {
    /// On a backend by its name.
    pub fn new(scene: &Scene, backend: &str, config: &SolverConfig) -> Result<Self> {
        let backend = backend.parse::<BackendKind>()?.open(false)?;
        Ok(Self { simulation: Simulation::new(scene.world.clone(), config.clone(), backend)?, dt: scene.dt })
    }
}

impl Contender for Drystone {
    fn setting(&self) -> Setting {
        Setting::drystone(self.simulation.backend().name(), self.simulation.config())
    }

    fn step(&mut self) -> Result<()> {
        self.simulation.step(self.dt).map(drop)
    }

    fn world(&mut self) -> &World {
        &self.simulation.world
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_says_what_is_not_at_its_default() {
        let mut config = SolverConfig::default().without_sleep().with(|c| {
            c.substeps = 4;
            c.friction = Friction::Box;
        });
        assert_eq!(Setting::drystone("cpu", &config).label(), "drystone cpu 4x1 box");
        settings::set(&mut config, "contact_frequency=0.25").unwrap();
        settings::set(&mut config, "relax=2").unwrap();
        assert_eq!(Setting::drystone("cpu", &config).more, "contact_frequency=0.25 relax=2");
        settings::set(&mut config, "iterations=2").unwrap();
        assert_eq!(Setting::drystone("cpu", &config).label(), "drystone cpu 4x2 box contact_frequency=0.25");
    }
}
