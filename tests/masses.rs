//! Closed forms at the ends of the masses that are taken, and between.

#[macro_use]
mod common;

use std::f64::consts::PI;

use common::Open;
use drystone::glam::{Quat, Vec3};
use drystone::{Backend, BallJoint, Body, Cpu, Reference, Shape, Simulation, SolverConfig, World};

const G: f64 = 9.81;
/// [kg]
const MASSES: [f32; 6] = [1e-15, 1e-9, 1.0, 1e3, 1e7, 1e15];

on_every_backend! {
    a_light_ball_hangs_on_a_heavy_one,
    cubes_of_all_masses_slide_as_far,
    pendulums_of_all_masses_have_one_period,
}

fn simulate(world: World, config: SolverConfig, open: Open) -> Simulation {
    Simulation::new(world, config, open()).expect("good settings")
}

/// A pendulum for each mass, side by side: a ball of radius 0.1 m at the end of 1 m, out by `angle`.
fn pendulums(angle: f32) -> World {
    let mut world = World::new();
    for (k, mass) in MASSES.into_iter().enumerate() {
        let pivot = Vec3::X * 5.0 * k as f32;
        let turn = Quat::from_rotation_z(angle);
        let center = pivot - turn * Vec3::Y;
        let ball = Body::dynamic().shape(Shape::ball(0.1)).total_mass(mass).rotation(turn);
        let ball = world.add(ball.position(center.x, center.y, center.z));
        world.join(BallJoint::to_world(ball, Vec3::Y, pivot));
    }
    world
}

/// Five passes of the vertical are two periods. Measured 2.7e-5 off.
fn pendulums_of_all_masses_have_one_period(open: Open) {
    const DT: f32 = 1.0 / 240.0;
    let out = |world: &World, k: usize| f64::from(world.bodies[k].position.x - 5.0 * k as f32);
    let mut simulation = simulate(pendulums(0.05), SolverConfig::default(), open);
    let mut passes = vec![Vec::new(); MASSES.len()];
    let mut before: Vec<f64> = (0..MASSES.len()).map(|k| out(&simulation.world, k)).collect();
    for step in 1..=1150 {
        simulation.step(DT).expect("a step");
        for (k, passes) in passes.iter_mut().enumerate() {
            let x = out(&simulation.world, k);
            if before[k].signum() != x.signum() {
                // Linear between the two steps.
                passes.push((f64::from(step) - x / (x - before[k])) * f64::from(DT));
            }
            before[k] = x;
        }
    }
    let length = 1.0 + 0.4 * 0.1 * 0.1;
    let exact = 2.0 * PI * (length / G).sqrt() * (1.0 + 0.05 * 0.05 / 16.0);
    for (mass, passes) in MASSES.into_iter().zip(passes) {
        assert_eq!(passes.len(), 5, "{mass:e} kg passes at {passes:?}");
        let period = (passes[4] - passes[0]) / 2.0;
        println!("{mass:e} kg: {period:.5} s, {:.1e} off", period / exact - 1.0);
        assert!((period / exact - 1.0).abs() < 2e-3, "{mass:e} kg: {period} s, not {exact} s");
    }
    assert!(simulation.world.joint_gap() < 1e-4, "{} m", simulation.world.joint_gap());
}

/// A joint bears what hangs on it, where the upper ball is up to 1e30 times as heavy as the lower.
fn a_light_ball_hangs_on_a_heavy_one(open: Open) {
    let pairs = [[1e7_f32, 1e-9], [1e7, 1.0], [1.0, 1e-9], [1e15, 1e-15]];
    let mut world = World::new();
    for (k, masses) in pairs.into_iter().enumerate() {
        let [upper, lower] = [0, 1].map(|i| {
            let ball = Body::dynamic().shape(Shape::ball(0.2)).total_mass(masses[i]);
            world.add(ball.position(5.0 * k as f32, -0.5 - i as f32, 0.0))
        });
        world.join(BallJoint::to_world(upper, 0.5 * Vec3::Y, 5.0 * k as f32 * Vec3::X));
        world.join(BallJoint::new(upper, -0.5 * Vec3::Y, lower, 0.5 * Vec3::Y));
    }
    let config = SolverConfig::default();
    let substep = 1.0 / 60.0 / f64::from(config.substeps as f32);
    let mut simulation = simulate(world, config, open);
    for _ in 0..600 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    let gap = simulation.world.joint_gap();
    assert!(gap > 0.0 && gap < 1e-4, "{gap} m");
    for (k, impulses) in simulation.joint_impulses().chunks(2).enumerate() {
        let [upper, lower] = pairs[k].map(f64::from);
        for (impulse, hangs) in impulses.iter().zip([upper + lower, lower]) {
            let tension = f64::from(impulse.y.abs()) / substep;
            assert!((tension / (hangs * G) - 1.0).abs() < 0.01, "{upper:e} over {lower:e} kg: {tension:e} N");
        }
    }
}

/// A cube that slides at 4 m/s: v²/(2 mu g). Measured 2.1e-3 off, of all masses alike.
fn cubes_of_all_masses_slide_as_far(open: Open) {
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.4));
    for (k, mass) in MASSES.into_iter().enumerate() {
        let cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(mass).friction(0.4);
        world.add(cube.position(0.0, 0.5, 3.0 * k as f32).velocity(4.0 * Vec3::X, Vec3::ZERO));
    }
    let mut simulation = simulate(world, SolverConfig::default(), open);
    for _ in 0..120 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    for (body, mass) in simulation.world.bodies[1..].iter().zip(MASSES) {
        let exact = 16.0 / (2.0 * 0.4 * G);
        let slid = f64::from(body.position.x);
        println!("{mass:e} kg: {slid:.5} m, {:.1e} off", slid / exact - 1.0);
        assert!((slid / exact - 1.0).abs() < 5e-3, "{mass:e} kg: {slid} m, not {exact} m");
        assert!(body.linear_velocity.length() < 1e-3, "{mass:e} kg: {} m/s", body.linear_velocity);
    }
}

#[test]
fn lanes_have_the_bits_of_the_reference_at_all_masses() {
    let run = |backend: Box<dyn Backend>| {
        let mut simulation = Simulation::new(pendulums(0.7), SolverConfig::default(), backend).expect("good settings");
        for _ in 0..60 {
            simulation.step(1.0 / 60.0).expect("a step");
        }
        let bits = |v: Vec3| v.to_array().map(f32::to_bits);
        let bodies = &simulation.world.bodies;
        bodies.iter().map(|b| [b.position, b.linear_velocity, b.angular_velocity].map(bits)).collect::<Vec<_>>()
    };
    let reference = run(Box::new(Reference::<f32>::new()));
    assert!(reference.as_flattened().as_flattened().iter().all(|&x| f32::from_bits(x).is_finite()));
    for i in 0..Cpu::each().count() {
        let lanes = Cpu::each().nth(i).expect("counted");
        let name = lanes.adapter();
        assert_eq!(reference, run(Box::new(lanes)), "{name}");
    }
}
