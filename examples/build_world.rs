//! Builds a world by hand, lets it come to rest and prints where everything lies.
//!
//!     cargo run --release --example build_world

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Result, Shape, Simulation, World};

fn main() -> Result<()> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).named("floor"));

    // Bricks of 2000 kg/m³, one on the other, and a dumbbell of two balls and a rod that falls beside them.
    for i in 0..3 {
        let brick = Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.25)).density(2000.0);
        world.insert(brick.position(0.0, 0.25 + 0.5 * i as f32, 0.0).named(format!("brick {i}")));
    }
    let across = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let dumbbell = Body::dynamic()
        .shape_at(Shape::ball(0.3), Vec3::new(-0.6, 0.0, 0.0), Quat::IDENTITY)
        .shape_at(Shape::ball(0.3), Vec3::new(0.6, 0.0, 0.0), Quat::IDENTITY)
        .shape_at(Shape::cylinder(0.6, 0.1), Vec3::ZERO, across);
    world.insert(dumbbell.position(0.0, 2.0, 2.0).friction(0.8).named("dumbbell"));

    let mut simulation = Simulation::new(world)?;
    for _ in 0..180 {
        simulation.step(1.0 / 60.0)?;
    }
    for body in &simulation.world.bodies {
        println!("{:10} {:.4}  moving at {:.4} m/s", body.name, body.position, body.linear_velocity.length());
    }
    Ok(())
}
