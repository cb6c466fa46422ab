//! A character walks the course of the catalogue: up stairs, down a ramp, over a turntable, through crates, to a slope
//! that is too steep.
//!
//!     cargo run --release --example character

use drystone::glam::Vec3;
use drystone::{Character, Result, Simulation};
use drystone_scenes::Scene;

fn main() -> Result<()> {
    run(|line| println!("{line}"))
}

pub fn run(mut print: impl FnMut(String)) -> Result<()> {
    let scene = Scene::find("course", &[])?;
    let mut simulation = Simulation::new(scene.world)?;
    let capsule = simulation.world.bodies.iter().position(|body| body.name == "character");
    let Some(body) = capsule.and_then(|index| simulation.world.bodies.handle(index)) else { return Ok(()) };
    let mut character = Character::new(body);
    for step in 0..scene.steps {
        let Some(place) = simulation.world.body(body).map(|body| body.position) else { break };
        // Along x at 2 m/s, and back to the middle of the course, from which the turntable takes it.
        let velocity = Vec3::new(2.0, 0.0, -place.z.clamp(-1.0, 1.0));
        let movement = character.walk(&mut simulation, velocity, scene.dt)?;
        simulation.step(scene.dt)?;
        if step % 60 == 59 {
            let ground = movement.ground.map(|ground| &*simulation.world.bodies[ground.body.index()].name);
            let touched = movement.contacts.len();
            let Vec3 { x, y, z } = place + movement.translation;
            print(format!(
                "{:2} s: x {x:5.2} m, y {y:4.2} m, z {z:5.2} m, on {}, touches {touched}",
                (step + 1) / 60,
                ground.unwrap_or("nothing")
            ));
        }
    }
    Ok(())
}
