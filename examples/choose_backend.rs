//! Runs a scene of the catalogue on a backend: auto, gpu, cpu or reference.
//!
//!     cargo run --release --example choose_backend -- gpu

use drystone::backend::{BackendChoice, choose};
use drystone::{Result, Simulation, SolverConfig};
use drystone_scenes::Scene;

fn main() -> Result<()> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "auto".into());
    let choice: BackendChoice = name.parse()?;

    let scene = Scene::find("pile", &["n=200".into()])?;
    let (backend, why) = choose(choice, scene.world.dynamic_count(), false)?;
    println!("{why}");
    let mut simulation = Simulation::with(scene.world, SolverConfig::default(), backend)?;
    for _ in 0..60 {
        let stats = simulation.step(scene.dt)?;
        if let Some(body) = stats.first_non_finite {
            println!("body {} left the finite range", body.index());
        }
    }
    println!("kinetic energy after 1 s: {:.1} J", simulation.world.kinetic_energy());
    Ok(())
}
