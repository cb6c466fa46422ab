//! Listens to a world: balls fall through a sensor that counts them, and hit a plate.
//!
//!     cargo run --release --example events

use drystone::glam::Vec3;
use drystone::{Body, Event, Listen, Result, Shape, Simulation, World};

pub fn main() -> Result<()> {
    let mut world = World::new();
    let plate = world.insert(Body::fixed().shape(Shape::cuboid(3.0, 0.1, 3.0)).position(0.0, -0.1, 0.0));
    let gate = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 0.05, 1.0)).position(0.0, 1.5, 0.0));
    for i in 0..5 {
        let (x, z) = (0.3 * i as f32 - 0.6, 0.1 * i as f32);
        let velocity = Vec3::new(0.1 * (i as f32 - 2.0), 0.0, 0.0);
        world.insert(
            Body::dynamic().shape(Shape::ball(0.1)).position(x, 2.0 + 0.4 * i as f32, z).velocity(velocity, Vec3::ZERO),
        );
    }
    let mut simulation = Simulation::new(world)?;
    simulation.listen(Listen { contacts: true, hits_above: Some(2.0), ..Listen::default() })?;
    let mut count = 0;
    for step in 0..240 {
        simulation.step(1.0 / 60.0)?;
        for event in simulation.events() {
            match event {
                Event::Entered { sensor, visitor } if sensor.body == gate => {
                    count += 1;
                    println!("step {step}: ball {} is number {count} through the gate", visitor.body.index());
                }
                Event::Hit(hit) => {
                    let [a, b] = [hit.a, hit.b].map(|side| side.body.index());
                    println!(
                        "step {step}: {b} hits {a} at {:.1} with {:.2} m/s and {:.0} N s",
                        hit.point, hit.speed, hit.impulse
                    );
                }
                Event::Began { a, b } => println!("step {step}: {} touches {}", b.body.index(), a.body.index()),
                Event::Ended { a, b } => println!("step {step}: {} leaves {}", b.body.index(), a.body.index()),
                _ => {}
            }
        }
    }
    let borne: f32 = simulation.contacts_of(plate).map(|contact| contact.impulse.y).sum();
    println!("the plate bears {:.1} N", 60.0 * borne);
    assert_eq!(count, 5, "five balls fell through the gate");
    Ok(())
}
