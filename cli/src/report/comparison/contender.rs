//! Contenders of a comparison: engines with their settings.

use crate::settings;
use drystone::backend::BackendKind;
use drystone::config::{Friction, Method};
use drystone::{Result, Simulation, SolverConfig, World};
use drystone_scenes::{Scene, Spawners};

/// An engine with its settings, which steps one scene.
pub trait Contender {
    fn setting(&self) -> Setting;

    /// Makes one step of the scene's length. Only this call is timed.
    fn step(&mut self) -> Result<()>;

    /// The bodies of the scene after the last step, in their order.
    fn world(&mut self) -> &World;
}

/// Makes the contenders of an engine for a scene, one for each setting.
pub type Team<'a> = dyn Fn(&Scene, Extent) -> Result<Vec<Box<dyn Contender>>> + 'a;

/// Scenes and settings of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Few small scenes with few settings.
    Quick,
    /// All kinds of scenes with at most 1,000 bodies, with the settings that matter at equal error.
    Brief,
    Full,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    pub engine: String,
    /// `reference`, `cpu` or `gpu`.
    pub backend: String,
    /// Substeps per step, and sweeps per substep.
    pub substeps: u32,
    pub sweeps: u32,
    pub method: String,
    pub friction: String,
    /// Other settings that are not at their defaults.
    pub more: String,
}

impl Setting {
    pub fn drystone(backend: &str, config: &SolverConfig) -> Self {
        let mut more =
            settings::unusual(config, &["substeps", "iterations", "method", "friction", "sleep_after", "relax"]);
        // By default the number of relax sweeps equals that of the biased sweeps.
        more.extend((config.relax != config.iterations).then(|| format!("relax={}", config.relax)));
        Self {
            engine: "drystone".into(),
            backend: backend.into(),
            substeps: config.substeps,
            sweeps: config.iterations,
            method: if config.method == Method::Plain { "plain" } else { "accelerated" }.into(),
            friction: if config.friction == Friction::Box { "box" } else { "disc" }.into(),
            more: more.join(" "),
        }
    }

    pub fn label(&self) -> String {
        let Self { engine, backend, substeps, sweeps, method, friction, more } = self;
        let words =
            [(method, "plain"), (friction, "disc"), (more, "")].into_iter().filter(|(word, usual)| word != usual);
        let words: String = words.map(|(word, _)| format!(" {word}")).collect();
        format!("{engine} {backend} {substeps}x{sweeps}{words}")
    }
}

pub struct Drystone {
    simulation: Simulation,
    spawners: Spawners,
    dt: f32,
}

impl Drystone {
    pub fn new(scene: &Scene, backend: &str, config: &SolverConfig) -> Result<Self> {
        let backend = backend.parse::<BackendKind>()?.open(false)?;
        let simulation = Simulation::with(scene.world.clone(), config.clone(), backend)?;
        Ok(Self { simulation, spawners: Spawners::new(scene), dt: scene.dt })
    }
}

impl Contender for Drystone {
    fn setting(&self) -> Setting {
        Setting::drystone(self.simulation.backend().name(), self.simulation.config())
    }

    fn step(&mut self) -> Result<()> {
        self.spawners.before_step(&mut self.simulation.world, self.dt);
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
    fn a_label_names_the_settings_that_are_not_at_their_defaults() {
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
