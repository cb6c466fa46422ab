//! An engine and how it is set, before it has a scene.

use clap::ValueEnum;
#[cfg(not(all(feature = "physx", feature = "bullet")))]
use drystone::Error;
use drystone::{Result, SolverConfig};
use drystone_cli::report::comparison::{Contender, Drystone};
use drystone_cli::settings;
use drystone_scenes::Scene;

use crate::{box3d::Box3d, rapier::Rapier};

/// Who steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// drystone's CPU lanes.
    Drystone,
    /// The crate rapier3d.
    Rapier,
    /// Box3D, by the crate box3d-sys.
    Box3d,
    /// PhysX with its TGS solver, by the crate physx-sys; only with the feature `physx`.
    Physx,
    /// Bullet 3.24, by Debian's library; only with the feature `bullet`, and on one thread.
    Bullet,
}

/// How Bullet solves the contacts of a substep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
#[repr(i32)]
pub enum BulletSolver {
    /// Sequential impulses: Bullet's default.
    #[default]
    Sequential,
    /// A nonlinear conjugate gradient over sequential impulses.
    Nncg,
    /// Dantzig's pivots over a dense matrix of all contacts: for few bodies.
    Dantzig,
}

impl BulletSolver {
    /// As a setting names it; the default has no name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sequential => "",
            Self::Nncg => "NNCG",
            Self::Dantzig => "Dantzig",
        }
    }
}

/// The error of a build without Bullet.
#[cfg(not(feature = "bullet"))]
pub(crate) fn no_bullet() -> Error {
    Error::input("Bullet is not in this build; build with --features bullet")
}

impl Engine {
    /// The engines of this build.
    pub fn built() -> Vec<Self> {
        let is_built = |engine| match engine {
            Self::Physx => cfg!(feature = "physx"),
            Self::Bullet => cfg!(feature = "bullet"),
            Self::Drystone | Self::Rapier | Self::Box3d => true,
        };
        Self::value_variants().iter().copied().filter(|&engine| is_built(engine)).collect()
    }

    /// The engines of this build that run on so many threads.
    pub fn on(threads: usize) -> Vec<Self> {
        Self::built().into_iter().filter(|&engine| threads == 1 || engine != Self::Bullet).collect()
    }
}

/// An engine and its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Entrant {
    /// The engine.
    pub engine: Engine,
    /// Substeps of a step; Rapier calls them iterations, and PhysX position iterations.
    pub substeps: u32,
    /// Frequency of the contact spring times the length of a substep; none is the engine's own: 0.125 for drystone, 30 Hz for Rapier and
    /// Box3D whatever the substeps. Box3D takes 0.125 for anything above. PhysX and Bullet have no contact spring.
    pub frequency: Option<f32>,
    /// Bullet's solver, and its iterations in a substep.
    pub solver: BulletSolver,
    pub iterations: u32,
    /// Other settings of drystone, as `key=value`.
    pub set: Vec<String>,
}

impl Entrant {
    /// What an engine does unless told otherwise.
    pub fn default_of(engine: Engine) -> Self {
        let substeps = match engine {
            Engine::Drystone => SolverConfig::default().substeps,
            Engine::Rapier | Engine::Box3d | Engine::Physx => 4,
            Engine::Bullet => 1,
        };
        Self { engine, substeps, frequency: None, solver: BulletSolver::default(), iterations: 10, set: Vec::new() }
    }

    /// Frequency of the contact spring between two bodies that move [Hz], for steps of `dt` seconds; 0 without a spring.
    pub fn hertz(&self, dt: f32) -> f32 {
        let at = |frequency: f32| frequency * self.substeps as f32 / dt;
        match (self.engine, self.frequency) {
            (Engine::Drystone, frequency) => at(frequency.unwrap_or(SolverConfig::default().contact_frequency)),
            (Engine::Physx | Engine::Bullet, _) => 0.0,
            (_, None) => 30.0,
            (Engine::Rapier, Some(frequency)) => at(frequency),
            (Engine::Box3d, Some(frequency)) => at(frequency.min(0.125)),
        }
    }

    /// The scene in the hands of the engine. drystone takes the threads of rayon's global pool, the others `threads`.
    ///
    /// # Errors
    /// The scene or the setting is not fit for the engine; several threads for a Rapier that was built for one, or for Bullet.
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
            #[cfg(feature = "physx")]
            Engine::Physx => Box::new(crate::physx::Physx::new(scene, self.substeps, threads)?),
            #[cfg(not(feature = "physx"))]
            Engine::Physx => return Err(Error::input("PhysX is not in this build; build with --features physx")),
            #[cfg(feature = "bullet")]
            Engine::Bullet => {
                let solver = (self.solver, self.iterations);
                Box::new(crate::bullet::Bullet::new(scene, self.substeps, solver, threads, 1.0)?)
            }
            #[cfg(not(feature = "bullet"))]
            Engine::Bullet => return Err(no_bullet()),
        })
    }
}
