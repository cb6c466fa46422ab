//! Every kind of joint.

use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, Joint, MassProperties, Material, Shape, SolverConfig, World};

use super::Golden;

pub fn all() -> Vec<Golden> {
    vec![
        Golden::of_catalogue("chain", "chain:links=12,ratio=100", 90),
        Golden::of_catalogue("bridge", "bridge:planks=8,boxes=3", 90),
        Golden::of_catalogue("joint-grid", "joint-grid:n=5", 90),
        Golden::of_catalogue("four-bar", "four-bar", 90),
        Golden::of_catalogue("drawbridge", "drawbridge", 90),
        Golden::of_catalogue("car", "car", 120),
        Golden::of_catalogue("ragdoll", "ragdoll", 120),
        Golden::new("joint-kinds", 120, || (kinds(), SolverConfig::default())),
        Golden::of_catalogue("vehicle", "vehicle:steering=10", 90),
        Golden::new("held", 120, || (held(), SolverConfig::default())),
    ]
}

/// A block on each kind of joint, above a floor that the longest ropes reach.
fn kinds() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let post = world.insert(Body::fixed().shape(Shape::cuboid(20.0, 0.1, 0.1)).position(0.0, 4.0, 0.0));
    let slanted = Vec3::new(0.6, 0.0, 0.8);
    let ways: [fn(Joint) -> Joint; 12] = [
        |joint| joint,
        |joint| joint.hinge(Vec3::Z).limited(-0.4, 0.7),
        |joint| joint.hinge(Vec3::X).motor(3.0, 2000.0),
        |joint| joint.hinge(Vec3::Z).spring(0.5, 2.0, 0.3),
        |joint| joint.slider(Vec3::X).limited(-0.2, 0.3),
        |joint| joint.slider(Vec3::Y).spring(-0.3, 1.5, 0.2),
        |joint| joint.fixed(),
        |joint| joint.rope(1.5),
        |joint| joint.rod(1.2),
        |joint| joint.elastic(1.0, 1.5, 0.1),
        |joint| {
            let linear = [Axis::limited(-0.1, 0.2), Axis::LOCKED, Axis::FREE.spring(0.1, 2.0, 0.5, 5000.0)];
            let angular = [Axis::limited(-0.3, 0.5), Axis::FREE.motor(1.0, 50.0), Axis::limited(-0.2, 0.2)];
            joint.generic(linear, angular)
        },
        |joint| joint.breaking_at(5000.0).colliding(),
    ];
    for (k, way) in ways.into_iter().enumerate() {
        let x = 1.5 * k as f32 - 8.0;
        let block = Body::dynamic().shape(Shape::cuboid(0.3, 0.25, 0.4)).density(500.0);
        let block = block.position(x + 0.4, 3.2, 0.1).velocity(slanted, Vec3::new(0.2, 1.0, -0.5));
        let block =
            world.insert(block.rotation(if k == 7 { Quat::from_xyzw(0.0, 0.28, 0.0, 0.96) } else { Quat::IDENTITY }));
        world.insert_joint(way(Joint::new(block, Vec3::new(-0.4, 0.6, -0.1), post, Vec3::new(x, -0.2, 0.0))));
        // A ball that hangs on the block, and swings against it.
        let ball = world.insert(Body::dynamic().shape(Shape::ball(0.2)).position(x + 0.4, 2.2, 0.1));
        world.insert_joint(Joint::new(ball, Vec3::new(0.0, 0.5, 0.0), block, Vec3::new(0.0, -0.5, 0.0)));
    }
    world
}

/// Cones, constant loads, springs of a stiffness and joints that are off; and bodies with damping, locked axes, largest
/// speeds, rolling friction and added mass, which fall on each other.
fn held() -> World {
    let mut world = World::new();
    let floor = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.8));
    let spin = Vec3::new(1.0, -2.0, 3.0);
    let cube = |x: f32, y: f32| Body::dynamic().shape(Shape::cuboid(0.3, 0.2, 0.25)).position(x, y, 0.1 * y);
    let damped = cube(0.0, 1.0).linear_damping(1.5).angular_damping(0.5);
    let flat = cube(0.1, 1.6).locked_translations([false, false, true]);
    let upright = cube(-0.1, 2.2).locked_rotations([true, false, true]);
    let slow = cube(0.0, 2.8).max_speeds(2.0, 1.5);
    let heavy = cube(0.05, 3.4).additional_mass(MassProperties::point(40.0, Vec3::new(0.1, 0.2, 0.0)));
    for body in [damped, flat, upright, slow, heavy] {
        world.insert(body.velocity(Vec3::ZERO, spin));
    }
    let rolls = Material { rolling_friction: 0.02, spinning_friction: 0.01, ..Material::default() };
    let ball = Body::dynamic().shape(Shape::ball(0.25)).material(rolls).position(2.0, 0.25, 0.0);
    world.insert(ball.velocity(Vec3::X * 2.0, spin));
    for (k, x) in [-4.0, -6.0, -8.0, -10.0].into_iter().enumerate() {
        let anchor = Vec3::new(x, 3.0, 0.0);
        let body = world.insert(cube(x, 2.5).velocity(Vec3::X * 3.0, spin));
        let joint = Joint::new(body, anchor, floor, anchor).in_world(&world);
        world.insert_joint(match k {
            0 => joint.along(Vec3::Y),
            1 => joint.hinge(Vec3::Z).constant_load(200.0),
            2 => joint.slider(Vec3::X).spring_damper(0.1, 3000.0, 200.0),
            _ => joint.fixed().enabled(false),
        });
        if k == 0 {
            world.insert_joint(joint.along(Vec3::Y).cone(0.4));
        }
    }
    world
}
