//! Loads a scene file, runs it and prints where its bodies end.
//!
//!     cargo run --release --example load_scene -- examples/two_boxes.json

use drystone::{BodyKind, Result, Simulation};
use drystone_scenes::Scene;

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "examples/two_boxes.json".into());
    let scene = Scene::find(&path, &[])?;
    let mut simulation = Simulation::new(scene.world)?;
    for _ in 0..scene.steps {
        simulation.step(scene.dt)?;
    }
    for body in simulation.world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic) {
        println!("{:10} {:.4}", body.name, body.center_of_mass());
    }
    Ok(())
}
