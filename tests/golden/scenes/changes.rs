//! Sleep, worlds beside each other, bodies that come and go, and states that are saved and loaded.

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Groups, Joint, Listen, Reference, Shape, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

use super::Golden;

pub fn all() -> Vec<Golden> {
    vec![
        Golden::of_catalogue("asleep", "pyramid:base=4", 200),
        Golden::of_catalogue("woken", "throw:n=4", 150),
        Golden::new("worlds", 90, || (worlds(), SolverConfig::default())),
        Golden::new("coming-and-going", 120, || (table(), SolverConfig::default())).before_step(come_and_go),
        Golden::new("changed", 120, || (table(), SolverConfig::default())).before_step(change),
        Golden::of_catalogue("saved-and-loaded", "pile:n=30,seed=3", 120).before_step(|simulation, step| {
            if step % 25 == 10 {
                through_bytes(simulation);
            }
        }),
        Golden::of_catalogue("restored", "ragdoll", 60).before_step(|simulation, step| {
            if step % 20 == 10 {
                let before = simulation.snapshot();
                for _ in 0..5 {
                    simulation.step(1.0 / 60.0).expect("a step");
                }
                simulation.restore(&before);
            }
        }),
        Golden::new("kinematic", 120, || (mixer(), SolverConfig::default())).before_step(move_plate),
    ]
}

/// Goes on from the state as it is in bytes.
fn through_bytes(simulation: &mut Simulation) {
    let backend = simulation.set_backend(Box::new(Reference::<f32>::new()));
    let bytes = simulation.save();
    *simulation = Simulation::load(&bytes, backend).expect("it was just saved");
}

/// Three scenes, each with its own gravity.
fn worlds() -> World {
    let find = |spec: &str| Scene::find_spec(spec).expect("a scene of the catalogue").world;
    let mut worlds = find("tower:n=4");
    worlds.beside(&World { gravity: Vec3::new(0.0, -1.62, 0.0), ..find("pile:n=12") });
    worlds.beside(&World { gravity: Vec3::new(1.0, -9.0, 0.5), ..find("chain:links=4") });
    worlds
}

/// A few boxes on a floor.
fn table() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for k in 0..9_u8 {
        let [i, j] = [k % 3, k / 3].map(f32::from);
        world.insert(Body::dynamic().shape(Shape::cuboid(0.4, 0.3, 0.4)).position(i, 0.3 + 0.65 * j, 0.1 * j));
    }
    world
}

/// A body comes every sixth step, and the oldest ones go; a joint comes and goes likewise.
fn come_and_go(simulation: &mut Simulation, step: u32) {
    let world = &mut simulation.world;
    if step.is_multiple_of(6) {
        let x = 0.25 * (step % 13) as f32;
        let shape = if step.is_multiple_of(12) { Shape::ball(0.3) } else { Shape::capsule(0.2, 0.2) };
        let body = Body::dynamic().shape(shape).position(x, 3.0, 0.1).velocity(Vec3::new(0.0, -2.0, 0.3), Vec3::X);
        let body = world.insert(body);
        if step.is_multiple_of(18) {
            let other = world.bodies.handles().nth(3).expect("boxes are left");
            world.insert_joint(Joint::new(body, Vec3::Y, other, Vec3::Y).rope(4.0));
        }
    }
    if step % 10 == 9 {
        let oldest = world.bodies.handles().nth(1).expect("boxes are left");
        world.remove(oldest);
    }
    if step % 40 == 39 {
        let joint = world.joints.handles().first().copied();
        joint.and_then(|joint| world.remove_joint(joint)).expect("a joint is left");
    }
}

/// Poses, velocities, masses, kinds, materials, groups, forces, gravity, settings: each changes once.
fn change(simulation: &mut Simulation, step: u32) {
    let bodies = &mut simulation.world.bodies;
    match step {
        10 => bodies[1].position.y += 0.5,
        15 => bodies[2].apply_impulse_at(Vec3::new(300.0, 200.0, 0.0), Vec3::new(1.0, 0.5, 0.2)),
        20 => bodies[3] = bodies[3].clone().total_mass(50.0),
        25 => bodies[4].kind = drystone::BodyKind::Fixed,
        30 => bodies[5].material.friction = 0.05,
        35 => bodies[6].groups = Groups { membership: 2, filter: 1 },
        40 => bodies[7].force = Vec3::new(500.0, 0.0, 100.0),
        45 => bodies[4].kind = drystone::BodyKind::Dynamic,
        50 => simulation.world.gravity = Vec3::new(1.0, -9.0, 0.0),
        55 => {
            simulation.listen(Listen { contacts: true, hits_above: Some(0.5), impulses: true }).expect("good numbers")
        }
        60 => bodies[8].rotation = Quat::from_xyzw(0.0, 0.6, 0.0, 0.8),
        65 => {
            let config = simulation.config().clone().with(|c| c.substeps = 12);
            simulation.set_config(config).expect("good settings");
        }
        70 => bodies[9].apply_torque(Vec3::new(0.0, 3000.0, 0.0)),
        _ => {}
    }
}

/// Boxes on a plate that is moved, beside a sensor.
fn mixer() -> World {
    let mut world = World::new();
    world.insert(Body::kinematic().shape(Shape::cuboid(4.0, 0.2, 4.0)).friction(0.9));
    for k in 0..6_u8 {
        let x = 0.9 * f32::from(k) - 2.2;
        let shape = if k % 2 == 0 { Shape::cuboid(0.3, 0.3, 0.3) } else { Shape::cylinder(0.3, 0.3) };
        world.insert(Body::dynamic().shape(shape).position(x, 0.55, 0.2 * x));
    }
    world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 1.0, 1.0)));
    world
}

/// The plate rocks, slides, and jumps once.
fn move_plate(simulation: &mut Simulation, step: u32) {
    let plate = &mut simulation.world.bodies[0];
    let swing = if step % 40 < 20 { 1.0 } else { -1.0 };
    plate.linear_velocity = Vec3::new(0.8 * swing, 0.1 * swing, 0.0);
    plate.angular_velocity = Vec3::new(0.0, 0.5 * swing, 0.2 * swing);
    if step == 80 {
        plate.move_to(Vec3::new(0.3, 0.05, -0.2), Quat::from_xyzw(0.0, 0.28, 0.0, 0.96), 1.0 / 60.0);
    }
}
