//! The scenes whose hashes stand in `hashes.txt`. No scene takes a sine or a cosine of the platform: rotations are written as quaternions,
//! or come from the catalogue, which has its own.

mod changes;
mod jointed;
mod rules;
mod shapes;

use drystone::{Backend, Reference, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

use super::table::Row;

/// A scene, and how it runs.
pub struct Golden {
    pub name: &'static str,
    pub steps: u32,
    /// Length of a step (s).
    pub dt: f32,
    start: Box<dyn Fn() -> (World, SolverConfig)>,
    /// Called before each step with its number, from 0.
    before_step: fn(&mut Simulation, u32),
}

impl Golden {
    fn new(name: &'static str, steps: u32, start: impl Fn() -> (World, SolverConfig) + 'static) -> Self {
        Self { name, steps, dt: 1.0 / 60.0, start: Box::new(start), before_step: |_, _| {} }
    }

    /// A scene of the catalogue with the default settings.
    fn of_catalogue(name: &'static str, spec: &'static str, steps: u32) -> Self {
        Self::with_settings(name, spec, steps, |_| {})
    }

    /// A scene of the catalogue with some settings changed.
    fn with_settings(name: &'static str, spec: &'static str, steps: u32, change: fn(&mut SolverConfig)) -> Self {
        let world = move || Scene::find_spec(spec).expect("a scene of the catalogue").world;
        Self::new(name, steps, move || (world(), SolverConfig::default().with(change)))
    }

    fn before_step(self, before_step: fn(&mut Simulation, u32)) -> Self {
        Self { before_step, ..self }
    }

    /// Runs the scene, calls `after` after each step, and gives the row of the table and the backend.
    pub fn run(&self, backend: Box<dyn Backend>, mut after: impl FnMut(&Simulation)) -> (Row, Box<dyn Backend>) {
        let (world, config) = (self.start)();
        let mut simulation = Simulation::with(world, config, backend).expect("a fit world");
        for step in 0..self.steps {
            (self.before_step)(&mut simulation, step);
            simulation.step(self.dt).expect("a step");
            after(&simulation);
        }
        let row = Row { scene: self.name.into(), steps: self.steps, hash: simulation.hash() };
        (row, simulation.set_backend(Box::new(Reference::<f32>::new())))
    }
}

/// All of them, in the order of the table.
pub fn all() -> Vec<Golden> {
    [shapes::all(), rules::all(), jointed::all(), changes::all()].into_iter().flatten().collect()
}
