//! Bounces, joints, forces and free rotation.

use std::f32::consts::PI;

use drystone::config::JointSolver;
use drystone::stages::problem::StepProblem;
use drystone::{Body, Joint, Shape, SolverConfig, World};
use glam::{Quat, Vec3};

use super::{DT, ball, bounced, empty, floor, near, run, simulation};

#[test]
fn a_ball_bounces_only_if_it_comes_faster_than_the_threshold() {
    let threshold = SolverConfig::default().restitution_threshold;
    near("just above", bounced(1.1 * threshold, [0.5; 2]), 0.55 * threshold, 1e-5);
    near("just below", bounced(0.9 * threshold, [0.5; 2]), 0.0, 1e-5);
}

/// Implicit Euler on a spring m w² with damper 2 z m w. One joint that nothing else touches is solved exactly by one sweep.
#[test]
fn a_joint_is_the_damped_spring_that_its_settings_say() {
    for (frequency, damping) in [(0.02, 0.3), (0.02, 3.0), (0.1, 0.1)] {
        let mut world = empty();
        let hung = world.insert(ball().position(0.1, 0.0, 0.0));
        world.insert_joint(Joint::to_world(hung, Vec3::ZERO, Vec3::ZERO));
        let h = DT / 4.0;
        let config = SolverConfig::default().without_sleep().with(|c| {
            c.substeps = 4;
            c.relax = 0;
            c.joint_solver = JointSolver::Sweeps;
            c.joint_frequency = frequency;
            c.joint_damping = damping;
            // The limit bounds the energy of a body that begins away from its joint.
            c.push_limit = 100.0;
        });
        let mut simulation = simulation(world, config);
        let (w, mut x, mut v) = (2.0 * PI * frequency / h, 0.1_f32, 0.0_f32);
        for step in 1..=20 {
            run(&mut simulation, 1, DT);
            for _ in 0..4 {
                v = (v - h * w * w * x) / (1.0 + 2.0 * damping * w * h + (w * h) * (w * h));
                x += h * v;
            }
            let body = &simulation.world.bodies[hung];
            near(&format!("{frequency}, {damping}, step {step} [m]"), body.position.x, x, 2e-5);
        }
    }
}

/// Dropped from 2 m above its height at rest: up again to e² of that. Measured 2e-3 of it.
#[test]
fn a_ball_bounces_to_the_square_of_its_restitution() {
    for e in [0.5, 0.9] {
        let mut world = World::new();
        world.insert(floor());
        world.insert(ball().restitution(e).position(0.0, 2.5, 0.0));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        let (mut highest, mut bounced) = (0.0_f32, false);
        for _ in 0..600 {
            run(&mut simulation, 1, 1.0 / 240.0);
            let body = &simulation.world.bodies[1];
            if bounced && body.linear_velocity.y < 0.0 {
                break;
            }
            bounced |= body.linear_velocity.y > 0.0;
            highest = if bounced { highest.max(body.position.y - 0.5) } else { 0.0 };
        }
        near(&format!("height of the bounce of {e} [m]"), highest, 2.0 * e * e, 2e-3 * e * e);
    }
}

/// Of sixteen balls that fall from different heights some bounce in the last substep of a step. They bounce so low that
/// their contacts stay.
#[test]
fn a_step_begins_without_the_bounces_of_the_step_before() {
    let mut world = World::new();
    world.insert(floor().restitution(0.95));
    for i in 0..16 {
        world.insert(ball().restitution(0.95).position(3.0 * i as f32, 0.504 + 3e-4 * i as f32, 0.0));
    }
    let config = SolverConfig::default().without_sleep().with(|c| c.restitution_threshold = 0.1);
    let mut simulation = simulation(world, config);
    let bounces = |problem: &StepProblem| problem.impulses.iter().filter(|impulse| impulse.bounce > 0.0).count();
    let mut found = 0;
    for _ in 0..60 {
        simulation.step(DT).expect("a step");
        found += bounces(simulation.problem());
        assert_eq!(bounces(&simulation.next_problem(DT).expect("a step").0), 0);
    }
    assert!(found > 0);
}

/// A ball with its middle of mass 0.3 m off its origin. Hung there it does not turn, nor swing.
#[test]
fn a_body_hung_by_its_center_of_mass_does_not_turn() {
    let mut world = World::new();
    let mut body = ball().position(1.0, 2.0, 3.0);
    body.mass.center = Vec3::new(0.3, 0.0, 0.0);
    let hung = world.insert(body);
    world.insert_joint(Joint::to_world(hung, Vec3::new(0.3, 0.0, 0.0), Vec3::new(1.3, 2.0, 3.0)));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let body = &simulation.world.bodies[hung];
    near("spin [rad/s]", body.angular_velocity.length(), 0.0, 1e-5);
    assert!(body.position.distance(Vec3::new(1.0, 2.0, 3.0)) < 1e-3, "{}", body.position);
}

/// Two bricks: one as it is, and one that is the same about axes that are turned in its body.
#[test]
fn a_body_tumbles_about_its_principal_axes_wherever_they_lie_in_it() {
    let mut world = empty();
    let spin = Vec3::new(0.5, 4.0, 0.3);
    let frame = Quat::from_rotation_z(0.7) * Quat::from_rotation_y(-0.4);
    for (x, frame) in [(0.0, Quat::IDENTITY), (10.0, frame)] {
        let mut brick = Body::dynamic().shape(Shape::cuboid(0.5, 0.3, 0.2)).position(x, 0.0, 0.0);
        brick.mass.principal_frame = frame;
        // Turned back, so that the axes lie alike in the world.
        world.insert(brick.rotation(frame.inverse()).velocity(Vec3::ZERO, spin));
    }
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let [one, other] = &simulation.world.bodies[..] else { panic!("two bodies") };
    let apart = one.angular_velocity.distance(other.angular_velocity);
    assert!(one.angular_velocity.distance(spin) > 0.5, "it tumbles: {}", one.angular_velocity);
    assert!(apart < 1e-4 * spin.length(), "{} and {}", one.angular_velocity, other.angular_velocity);
}

#[test]
fn a_force_accelerates_by_its_share_of_the_mass() {
    let mut world = empty();
    let pushed = world.insert(ball().total_mass(4.0));
    world.bodies[pushed].force = Vec3::new(2.0, -8.0, 0.0);
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let velocity = simulation.world.bodies[pushed].linear_velocity;
    assert!(velocity.distance(Vec3::new(0.5, -2.0, 0.0)) < 1e-4, "{velocity}");
}
