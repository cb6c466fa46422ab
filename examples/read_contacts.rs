//! Reads contacts and impulses after a step: bodies, depths, forces.
//!
//!     cargo run --release --example read_contacts

use drystone::{Result, Simulation};
use drystone_scenes::Scene;

fn main() -> Result<()> {
    let scene = Scene::find("tower", &["n=3".into()])?;
    let mut simulation = Simulation::new(scene.world)?;
    for _ in 0..300 {
        simulation.step(scene.dt)?;
    }
    for manifold in simulation.manifolds() {
        let [a, b] = [manifold.a, manifold.b].map(|side| side.body.index());
        println!("body {b} on body {a}, normal {:.2}", manifold.normal);
        // Impulses are those of the last substep: over its length they are forces.
        let substep = scene.dt / manifold.substeps as f32;
        for point in manifold.points() {
            let force = point.normal_impulse / substep;
            println!("    {:.3} mm apart, {force:.0} N", point.separation * 1e3);
        }
    }
    Ok(())
}
