//! Joints that begin, end, take the place of others, or move their anchors.

use crate::common::state::joint_impulses;
use drystone::config::JointSolver;
use drystone::glam::Vec3;
use drystone::{Body, BodyHandle, Joint, Shape, Simulation, SolverConfig, World};

use super::{BOTH, DT, cpu, cube, net, reference, run, simulation, standing};

/// Joints are known by their bodies and anchors: the same number of other joints are other joints.
#[test]
fn joints_that_take_the_place_of_others_hold_what_they_tie() {
    let mut gaps = Vec::new();
    for backend in BOTH {
        let mut simulation = simulation(&net(), &SolverConfig::default().without_sleep(), backend);
        run(&mut simulation, 60);
        // The balls of the first row hang from other points now, and the rest hangs from them the other way round.
        let joints = &mut simulation.world.joints;
        let reversed: Vec<Joint> = joints.iter().rev().copied().collect();
        joints.iter_mut().zip(reversed).for_each(|(joint, other)| *joint = other);
        let count = joints.len();
        joints.retain(|j| j.body_b.is_some());
        for corner in [0, 3] {
            let ball = simulation.world.bodies.handle(corner + 12).expect("a ball");
            let at = simulation.world.bodies[ball].position;
            simulation.world.insert_joint(Joint::to_world(ball, Vec3::ZERO, at));
        }
        assert_eq!(simulation.world.joints.len(), count);
        for step in 0..120 {
            simulation.step(DT).expect("a step");
            simulation.problem().check().unwrap_or_else(|e| panic!("step {step}: {e}"));
        }
        gaps.push(simulation.world.joint_gap());
    }
    println!("{gaps:?}");
    assert!(gaps[0] < 0.02 && gaps[0] == gaps[1], "{gaps:?}");
}

#[test]
fn a_joint_that_ends_leaves_the_impulses_of_the_others_alone() {
    for solver in [JointSolver::Direct, JointSolver::Sweeps] {
        ends(solver);
    }
}

fn ends(solver: JointSolver) {
    let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = solver);
    let mut simulation = simulation(&standing(), &config, reference);
    run(&mut simulation, 120);
    // The top of a tower is held where it is.
    let top = simulation.world.bodies.handle(5).expect("a cube");
    let at = simulation.world.bodies[top].position;
    let held = simulation.world.insert_joint(Joint::to_world(top, Vec3::ZERO, at));
    run(&mut simulation, 60);
    let mut before = joint_impulses(&simulation).to_vec();
    before.rotate_right(1);
    assert!(before.iter().skip(1).all(|carried| carried.distance(before[0]) > 0.1 * carried.length()), "{before:?}");
    let heights: Vec<f32> = simulation.world.bodies.iter().map(|b| b.position.y).collect();
    simulation.world.remove_joint(held);
    simulation.step(DT).expect("a step");
    for (now, before) in joint_impulses(&simulation).iter().zip(&before[1..]) {
        assert!(now.distance(*before) < 1e-3 * before.length(), "{now} and not {before}");
    }
    run(&mut simulation, 20);
    for (body, before) in simulation.world.bodies.iter().zip(heights) {
        assert!((body.position.y - before).abs() < 1e-3);
    }
}

#[test]
fn whether_jointed_bodies_collide_may_change() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    // Two balls that overlap, tied at their centers by a joint of no length.
    let a = world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    let b = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.6, 0.0, 0.0));
    world.insert_joint(Joint::new(a, Vec3::new(0.3, 0.0, 0.0), b, Vec3::new(-0.3, 0.0, 0.0)));
    for backend in BOTH {
        let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), backend);
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
        simulation.world.joints[0].collide = true;
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
        simulation.world.joints[0].collide = false;
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
        simulation.world.joints.clear();
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
        run(&mut simulation, 60);
        let apart = simulation.world.bodies[a].position.distance(simulation.world.bodies[b].position);
        assert!(apart > 0.99, "{apart} m");
    }
}

#[test]
fn a_changed_joint_wakes_what_it_held() {
    let config = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    let mut simulation = simulation(&standing(), &config, cpu);
    run(&mut simulation, 240);
    let rod = simulation.world.bodies.handle(18).expect("a rod");
    assert!(simulation.is_asleep(rod), "the chain hangs still");
    simulation.world.joints.retain(|j| j.body_b.is_some());
    run(&mut simulation, 30);
    let fallen = simulation.world.bodies[rod].linear_velocity.y;
    assert!((fallen + 9.81 * 30.0 * DT).abs() < 0.1, "{fallen} m/s");
}

/// Two chains hang still. What changes of one wakes that one.
#[test]
fn a_changed_joint_wakes_only_what_it_holds() {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut world = World::new();
    for x in [0.0, 5.0] {
        let upper = world.insert(cube(x, -1.0, 0.0));
        let lower = world.insert(cube(x, -2.5, 0.0));
        world.insert_joint(Joint::to_world(upper, Vec3::Y, Vec3::new(x, 0.0, 0.0)));
        world.insert_joint(Joint::new(upper, -0.75 * Vec3::Y, lower, 0.75 * Vec3::Y));
    }
    let mut simulation = simulation(&world, &config, cpu);
    let asleep = |s: &Simulation| s.world.bodies.handles().map(|body| s.is_asleep(body)).collect::<Vec<_>>();
    run(&mut simulation, 300);
    assert_eq!(asleep(&simulation), [true; 4]);
    // An anchor that moves wakes its chain.
    simulation.world.joints[3].anchor_a.y -= 0.1;
    run(&mut simulation, 1);
    assert_eq!(asleep(&simulation), [true, true, false, false]);
    run(&mut simulation, 300);
    assert_eq!(asleep(&simulation), [true; 4]);
    // So does the end of a joint.
    simulation.world.remove_joint(simulation.world.joints.handles()[1]);
    run(&mut simulation, 1);
    assert_eq!(asleep(&simulation), [false, false, true, true]);
}

#[test]
fn a_new_joint_wakes_both_of_its_bodies() {
    let config = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    for swap in [false, true] {
        let mut simulation = simulation(&standing(), &config, cpu);
        run(&mut simulation, 240);
        let [one, other] = [5, 10].map(|i| simulation.world.bodies.handle(i).expect("a cube"));
        assert!(simulation.is_asleep(one) && simulation.is_asleep(other));
        let [a, b] = if swap { [other, one] } else { [one, other] };
        let at = |body: BodyHandle| simulation.world.bodies[body].position;
        let half = 0.5 * (at(b) - at(a));
        simulation.world.insert_joint(Joint::new(a, half, b, -half));
        run(&mut simulation, 1);
        assert!(!simulation.is_asleep(one) && !simulation.is_asleep(other));
    }
}

#[test]
fn a_body_that_is_untied_rests_on_a_half_space() {
    let mut world = World::new();
    let ground = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    // It moves while it is tied, so that its box was below the surface before as well.
    let ball = Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.49, 0.0).velocity(Vec3::X, Vec3::ZERO);
    let ball = world.insert(ball);
    world.insert_joint(Joint::new(ball, Vec3::ZERO, ground, 0.49 * Vec3::Y).slider(Vec3::X));
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), cpu);
    run(&mut simulation, 10);
    assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
    simulation.world.joints.clear();
    assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
    run(&mut simulation, 60);
    let height = simulation.world.bodies[ball].position.y;
    assert!((height - 0.5).abs() < 0.01, "{height} m");
}
