//! Changes by the caller between two steps: the next step follows each of them, or its error says why not.

mod bodies;
mod joints;
mod plan;
mod settings;

use crate::common::state::reference;
use drystone::glam::{Quat, Vec3};
use drystone::{Backend, Body, BodyHandle, BodyKind, Cpu, Joint, Shape, Simulation, SolverConfig, World};

const DT: f32 = 1.0 / 60.0;

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

const BOTH: [fn() -> Box<dyn Backend>; 2] = [reference, cpu];

fn simulation(world: &World, config: &SolverConfig, backend: fn() -> Box<dyn Backend>) -> Simulation {
    Simulation::with(world.clone(), config.clone(), backend()).expect("a good world")
}

fn run(simulation: &mut Simulation, steps: u32) {
    for _ in 0..steps {
        simulation.step(DT).expect("a step");
    }
}

fn fastest(world: &World) -> f32 {
    world.bodies.iter().map(|b| b.linear_velocity.length() + b.angular_velocity.length()).fold(0.0, f32::max)
}

fn ground() -> Body {
    Body::fixed().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0)
}

fn cube(x: f32, y: f32, z: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, z)
}

/// Three towers of cubes, a block on a slope and a chain of rods: contacts of every kind and joints. All bodies move at first, so that they
/// begin without impulses and settle: faces of towers that begin at rest stay aligned to the bit, and contacts that are computed anew then lose
/// points.
fn standing() -> World {
    let mut world = World::new();
    world.insert(ground());
    for tower in 0..3 {
        for level in 0..5 {
            let offset = 0.05 * ((tower + level) % 2) as f32;
            world.insert(cube(3.0 * tower as f32 + offset, 0.5 + level as f32, 0.0));
        }
    }
    let tilt = Quat::from_rotation_z(0.2);
    let up = tilt * Vec3::Y;
    let at = Vec3::new(-8.0, 3.0, 0.0);
    world.insert(Body::fixed().shape(Shape::cuboid(3.0, 0.5, 3.0)).position(at.x, at.y, at.z).rotation(tilt));
    let block = at + up * 0.75;
    world.insert(
        Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.5)).position(block.x, block.y, block.z).rotation(tilt),
    );
    let mut above = None;
    for i in 0..6 {
        let rod =
            world.insert(Body::dynamic().shape(Shape::cuboid(0.25, 0.5, 0.25)).position(12.0, 8.0 - i as f32, 0.0));
        let end = Vec3::new(0.0, 0.5, 0.0);
        world.insert_joint(match above {
            None => Joint::to_world(rod, end, Vec3::new(12.0, 8.5, 0.0)),
            Some(above) => Joint::new(above, -end, rod, end),
        });
        above = Some(rod);
    }
    for body in world.bodies.iter_mut().filter(|body| body.kind == BodyKind::Dynamic) {
        body.linear_velocity = 1e-9 * Vec3::NEG_Y;
    }
    world
}

/// A square of balls that are tied to their neighbors, and pulled out of shape.
fn net() -> World {
    let mut world = World::new();
    let ball = |x: u32, z: u32| Body::dynamic().shape(Shape::ball(0.2)).position(x as f32, 0.0, z as f32);
    let balls: Vec<BodyHandle> = (0..16).map(|i| world.insert(ball(i % 4, i / 4))).collect();
    let half = 0.5 * Vec3::X;
    for i in 0..16 {
        if i % 4 < 3 {
            world.insert_joint(Joint::new(balls[i], half, balls[i + 1], -half));
        }
        if i < 12 {
            world.insert_joint(Joint::new(balls[i], 0.5 * Vec3::Z, balls[i + 4], -0.5 * Vec3::Z));
        }
    }
    world.insert_joint(Joint::to_world(balls[0], Vec3::ZERO, Vec3::ZERO));
    world.insert_joint(Joint::to_world(balls[3], Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0)));
    world
}
