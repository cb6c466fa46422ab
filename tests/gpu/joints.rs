//! Ball joints against closed forms.

use drystone::config::JointSolver;
use drystone::glam::{Quat, Vec3};
use drystone::{Body, Joint, Shape, Simulation, SolverConfig, World};

use crate::common::Open;
use crate::common::state::joint_impulses;

const G: f32 = 9.81;

tests! {
    every_backend {
        a_kinematic_board_reaches_the_pose_that_it_is_sent_to,
        a_rod_swings_with_the_period_of_a_physical_pendulum,
        every_joint_of_a_hanging_chain_carries_what_hangs_on_it,
        tied_bodies_pass_through_each_other_unless_asked_not_to,
    }
}

fn simulate(world: World, config: SolverConfig, open: Open) -> Simulation {
    Simulation::with(world, config, open()).unwrap()
}

/// Period of a rod of length 1 m hung by its end, from the times at which it passes the vertical [s].
fn rod_period(dt: f32, open: Open) -> f64 {
    let mut world = World::new();
    let angle = 0.05;
    let turn = Quat::from_rotation_z(angle);
    let rod = Body::dynamic().shape(Shape::cuboid(0.01, 0.5, 0.01)).rotation(turn);
    let center = turn * Vec3::new(0.0, -0.5, 0.0);
    let rod = world.insert(rod.position(center.x, center.y, center.z));
    world.insert_joint(Joint::to_world(rod, Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO));
    let mut simulation = simulate(world, SolverConfig::default().without_sleep(), open);
    let (mut crossings, mut before) = (Vec::new(), center.x);
    for step in 1.. {
        simulation.step(dt).unwrap();
        let x = simulation.world.bodies[rod].position.x;
        if before.signum() != x.signum() {
            // Linear between the two steps.
            crossings.push((f64::from(step) - f64::from(x / (x - before))) * f64::from(dt));
            if crossings.len() == 9 {
                break;
            }
        }
        before = x;
        assert!(step < 100_000);
    }
    (crossings[8] - crossings[0]) / 4.0
}

fn a_rod_swings_with_the_period_of_a_physical_pendulum(open: Open) {
    // I / (m l): a thin box of half width 0.01 about its end, over half a length; small-angle period to 0.2 %.
    let inertia = (1.0 + 0.02_f64.powi(2)) / 12.0 + 0.25;
    let exact = 2.0 * std::f64::consts::PI * (inertia / (0.5 * f64::from(G))).sqrt() * (1.0 + 0.05_f64.powi(2) / 16.0);
    let measured = rod_period(1.0 / 240.0, open);
    assert!((measured / exact - 1.0).abs() < 2e-3, "period {measured:.5} s, exact {exact:.5} s");
}

fn every_joint_of_a_hanging_chain_carries_what_hangs_on_it(open: Open) {
    let mut world = World::new();
    let links = 10;
    let mut above = None;
    for i in 0..links {
        let mass = if i + 1 == links { 50.0 } else { 1.0 };
        let link = Body::dynamic().shape(Shape::cuboid(0.05, 0.25, 0.05)).total_mass(mass);
        let link = world.insert(link.position(0.0, -0.25 - 0.5 * i as f32, 0.0));
        let top = Vec3::new(0.0, 0.25, 0.0);
        match above {
            None => world.insert_joint(Joint::to_world(link, top, Vec3::ZERO)),
            Some(a) => world.insert_joint(Joint::new(a, -top, link, top)),
        };
        above = Some(link);
    }
    // The static law is that of sweeps.
    let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = JointSolver::Sweeps);
    let substep = 1.0 / 60.0 / config.substeps as f32;
    let mut simulation = simulate(world, config, open);
    for _ in 0..1200 {
        simulation.step(1.0 / 60.0).unwrap();
    }
    for (i, impulse) in joint_impulses(&simulation).iter().enumerate() {
        let hanging = 50.0 + (links - 1 - i) as f32;
        // A joint to the world has its body first: the impulse on the world points down.
        let tension = impulse.y.abs() / substep;
        let exact = hanging * G;
        assert!((tension / exact - 1.0).abs() < 0.01, "joint {i}: {tension} N, {exact} N hang on it");
    }
    // The static law: gap = T / (m_eff w^2), worst between the two highest links, m_eff half a link.
    let omega = std::f32::consts::TAU * simulation.config().joint_frequency / substep;
    let law = (50.0 + (links - 2) as f32) * G / (0.5 * omega * omega);
    let gap = simulation.world.joint_gap();
    assert!((gap / law - 1.0).abs() < 0.05, "gap {gap} m, the law says {law} m");
}

fn tied_bodies_pass_through_each_other_unless_asked_not_to(open: Open) {
    let overlap_after = |collide: bool| {
        let mut world = World::new();
        world.gravity = Vec3::ZERO;
        let cube = || Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
        let a = world.insert(cube());
        let b = world.insert(cube().position(0.9, 0.0, 0.0));
        let mut joint = Joint::new(a, Vec3::new(0.45, 0.0, 0.0), b, Vec3::new(-0.45, 0.0, 0.0));
        joint.collide = collide;
        world.insert_joint(joint);
        let mut simulation = simulate(world, SolverConfig::default().without_sleep(), open);
        let stats = simulation.step(1.0 / 60.0).unwrap();
        stats.manifolds
    };
    assert_eq!(overlap_after(false), 0);
    assert_eq!(overlap_after(true), 1);
}

fn a_kinematic_board_reaches_the_pose_that_it_is_sent_to(open: Open) {
    let mut world = World::new();
    let board = world.insert(Body::kinematic().shape(Shape::cuboid(1.0, 0.1, 1.0)));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.2)).position(0.0, 0.3, 0.0));
    let mut simulation = simulate(world, SolverConfig::default().without_sleep(), open);
    let target = Quat::from_rotation_z(0.2);
    for step in 1..=60 {
        let part = Quat::IDENTITY.slerp(target, step as f32 / 60.0);
        simulation.world.bodies[board].move_to(Vec3::new(0.0, 0.001 * step as f32, 0.0), part, 1.0 / 60.0);
        simulation.step(1.0 / 60.0).unwrap();
    }
    let body = &simulation.world.bodies[board];
    assert!(body.position.distance(Vec3::new(0.0, 0.06, 0.0)) < 1e-5, "{}", body.position);
    assert!(body.rotation.angle_between(target) < 1e-3, "{}", body.rotation);
    // Tilted to the left, it lets the ball roll there.
    assert!(simulation.world.bodies[ball].position.x < -0.1);
}
