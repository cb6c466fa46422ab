//! What single rules and settings do, each in a world that is small enough to be followed by hand.
//!
//! They run on the reference: the other backends have its bits, which `lanes` and `gpu` hold, and the last of these for what a
//! device carries from step to step.

mod detection;
mod friction;
mod motion;
mod rows;

use std::f32::consts::FRAC_PI_6;

use drystone::{Body, Reference, Shape, Simulation, SolverConfig, StepStats, World};
use glam::{Quat, Vec3};

const G: f32 = 9.81;
const DT: f32 = 1.0 / 60.0;

fn simulation(world: World, config: SolverConfig) -> Simulation {
    Simulation::with(world, config, Box::new(Reference::<f32>::new())).expect("good settings")
}

fn run(simulation: &mut Simulation, steps: u32, dt: f32) -> StepStats {
    let mut stats = StepStats::default();
    for _ in 0..steps {
        stats = simulation.step(dt).expect("a step");
    }
    stats
}

/// A world without gravity and without bodies.
fn empty() -> World {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world
}

fn floor() -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y))
}

/// A cube of 1 m and 1000 kg that lies on y = 0.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0)
}

fn ball() -> Body {
    Body::dynamic().shape(Shape::ball(0.5))
}

#[track_caller]
fn near(what: &str, measured: f32, expected: f32, tolerance: f32) {
    println!("{what}: {measured} measured, {expected} expected");
    assert!((measured - expected).abs() <= tolerance, "{what}: {measured}, not {expected}");
}

/// Velocity of a ball upwards after it met the floor at `speed`; `restitution` of the ball and of the floor.
fn bounced(speed: f32, restitution: [f32; 2]) -> f32 {
    let mut world = empty();
    world.insert(floor().restitution(restitution[1]));
    let approach = Vec3::NEG_Y * speed;
    let thrown = ball().restitution(restitution[0]).position(0.0, 0.51, 0.0).velocity(approach, Vec3::ZERO);
    world.insert(thrown);
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 6, DT);
    simulation.world.bodies[1].linear_velocity.y
}

/// A cube on a slope of 30 degrees that friction holds, after a second.
fn on_a_slope(config: SolverConfig) -> Simulation {
    on_a_slope_that_falls(Quat::IDENTITY, config)
}

/// The same with the slope turned about the vertical.
fn on_a_slope_that_falls(turn: Quat, config: SolverConfig) -> Simulation {
    let mut world = World::new();
    world.gravity = turn * Quat::from_rotation_z(FRAC_PI_6) * Vec3::NEG_Y * G;
    world.insert(floor().friction(0.7));
    world.insert(cube().friction(0.7));
    let mut simulation = simulation(world, config);
    run(&mut simulation, 60, DT);
    simulation
}

#[test]
fn settings_that_contradict_each_other_are_refused_together() {
    use drystone::config::{Clamping, Method, Stabilization};
    let hard = || {
        SolverConfig::default().without_sleep().with(|c| {
            c.stabilization = Stabilization::None;
            c.relax = 0;
        })
    };
    let refused = |config: SolverConfig, words: [&str; 2]| {
        let line = config.check().expect_err(words[0]).to_string();
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    };
    hard().check().expect("good settings");
    refused(hard().with(|c| c.relax = 1), ["stabilization = none", "relax = 1"]);
    let single = Clamping::PerCorrection;
    refused(
        SolverConfig::default().without_sleep().with(|c| c.rules.clamping = single),
        ["rules.clamping = per-correction", "soft"],
    );
    let both = hard().with(|c| {
        c.rules.clamping = single;
        c.method = Method::Accelerated;
    });
    refused(both, ["rules.clamping = per-correction", "method = accelerated"]);
}
