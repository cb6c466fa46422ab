//! Joints that keep the first axes of two bodies in a cone, with any solver of joints.

use drystone::config::JointSolver;
use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, BodyHandle, Cpu, Joint, Shape, Simulation, SolverConfig, World};

use crate::common::state::{all_bits, reference};
use crate::common::{Open, gpu};

tests! {
    every_backend {
        an_arm_that_is_pushed_rests_on_its_cone_on_every_side,
        a_cone_with_a_limited_twist_holds_both,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_cones,
    }
    no_gpu {
        arms_that_whirl_stay_in_their_cones_and_make_no_energy,
        two_bodies_in_a_cone_keep_their_momenta,
        lanes_have_the_bits_of_the_reference_with_cones,
        a_cone_out_of_range_is_an_error,
    }
}

const DT: f32 = 1.0 / 60.0;
const SOLVERS: [JointSolver; 2] = [JointSolver::Auto, JointSolver::Direct];

fn simulation(world: World, solver: JointSolver, open: Open) -> Simulation {
    let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = solver);
    Simulation::with(world, config, open()).expect("a good world")
}

fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

/// An arm of 2 kg with its center 0.5 m below the joint.
fn arm(turn: Quat) -> Body {
    let at = turn * Vec3::NEG_Y * 0.5;
    Body::dynamic().shape(Shape::cuboid(0.1, 0.4, 0.15)).total_mass(2.0).position(at.x, at.y, at.z).rotation(turn)
}

/// The joint of an arm, and its cone.
fn shoulder(world: &mut World, body: BodyHandle, cone: f32) {
    let of = &world.bodies[body];
    let shoulder = Joint::to_world(body, Vec3::Y * 0.5, of.position + of.rotation * Vec3::Y * 0.5).along(Vec3::Y);
    world.insert_joint(shoulder);
    world.insert_joint(shoulder.cone(cone));
}

/// The angle between the first axes.
fn swing(body: &Body) -> f32 {
    (body.rotation * Vec3::Y).angle_between(Vec3::Y)
}

fn an_arm_that_is_pushed_rests_on_its_cone_on_every_side(open: Open) {
    for solver in SOLVERS {
        for (cone, side) in [(0.3, 0.0_f32), (0.3, 2.0), (1.2, 4.0), (2.0, 5.5)] {
            let mut world = World { gravity: Vec3::ZERO, ..World::new() };
            let body = world.insert(arm(Quat::IDENTITY).angular_damping(4.0).linear_damping(4.0));
            shoulder(&mut world, body, cone);
            let mut simulation = simulation(world, solver, open);
            let (sine, cosine) = side.sin_cos();
            // A force across pulls the arm to its side until the cone holds it.
            simulation.world.bodies[body].force = Vec3::new(cosine, -1.0, sine) * 9.0;
            if cone > 1.0 {
                simulation.world.bodies[body].force = Vec3::new(cosine, 2.0, sine) * 9.0;
            }
            steps(&mut simulation, 300);
            let body = &simulation.world.bodies[body];
            assert!((swing(body) - cone).abs() < 2e-3, "{solver:?}, {side}: {} rad, not {cone}", swing(body));
            assert!(body.angular_velocity.length() < 1e-3, "{solver:?}: {}", body.angular_velocity);
        }
    }
}

fn a_cone_with_a_limited_twist_holds_both(open: Open) {
    for solver in SOLVERS {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let body = world.insert(arm(Quat::IDENTITY).angular_damping(4.0).linear_damping(4.0));
        let shoulder = Joint::to_world(body, Vec3::Y * 0.5, Vec3::ZERO).along(Vec3::Y);
        let twist = [Axis::limited(-0.2, 0.4), Axis::FREE, Axis::FREE];
        world.insert_joint(shoulder.generic([Axis::LOCKED; 3], twist));
        world.insert_joint(shoulder.cone(0.5));
        let mut simulation = simulation(world, solver, open);
        simulation.world.bodies[body].force = Vec3::new(9.0, -9.0, 0.0);
        simulation.world.bodies[body].torque = Vec3::Y;
        steps(&mut simulation, 180);
        let motion = simulation.world.joint_motion(&simulation.world.joints[0]);
        let angle = swing(&simulation.world.bodies[body]);
        assert!((angle - 0.5).abs() < 2e-3, "{solver:?}: {angle} rad");
        assert!((motion.position[3] - 0.4).abs() < 2e-3, "{solver:?}: {} rad", motion.position[3]);
    }
}

/// The cone of each arm (rad).
fn cone_of(arm: usize) -> f32 {
    0.2 + 0.11 * arm as f32
}

/// Arms with cones of all sizes, thrown in all directions.
fn whirling() -> World {
    let mut world = World::new();
    for k in 0..24 {
        let (cone, k) = (cone_of(k), k as f32);
        let body = world.insert(arm(Quat::from_rotation_y(k) * Quat::from_rotation_x(0.9 * cone)));
        let spin = Vec3::new((2.1 * k).sin(), 0.7 * (1.3 * k).cos(), (0.9 * k).cos()) * (1.0 + 0.3 * k);
        let moving = world.bodies[body].clone();
        let at = moving.position;
        world.bodies[body] = moving.velocity(spin.cross(at), spin).position(at.x + 3.0 * k, at.y, at.z);
        shoulder(&mut world, body, cone);
    }
    world
}

fn energy(body: &Body) -> f32 {
    body.kinetic_energy() as f32 + 9.81 * body.mass.mass * body.position.y
}

fn arms_that_whirl_stay_in_their_cones_and_make_no_energy() {
    for solver in SOLVERS {
        let world = whirling();
        let start: Vec<f32> = world.bodies.iter().map(energy).collect();
        let mut simulation = simulation(world, solver, || Box::new(Cpu::new()));
        let (mut widest, mut gained) = (0.0_f32, 0.0_f32);
        for _ in 0..600 {
            steps(&mut simulation, 1);
            for (k, (body, start)) in simulation.world.bodies.iter().zip(&start).enumerate() {
                widest = widest.max(swing(body) - cone_of(k));
                // The velocity is that in the middle of a substep.
                gained = gained.max((energy(body) - start) / (start.abs() + 10.0));
            }
        }
        println!("{solver:?}: beyond the cone by {widest} rad, gained {gained}");
        assert!(widest < 0.02, "{solver:?}: beyond the cone by {widest} rad");
        assert!(gained < 0.01, "{solver:?}: {gained} of the energy");
    }
}

fn two_bodies_in_a_cone_keep_their_momenta() {
    for solver in SOLVERS {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let a = world.insert(arm(Quat::IDENTITY).velocity(Vec3::X, Vec3::new(1.0, 3.0, -4.0)));
        let b = world.insert(arm(Quat::IDENTITY).position(0.0, 0.5, 0.0).velocity(Vec3::X, Vec3::new(-2.0, 0.0, 3.0)));
        let shoulder = Joint::new(a, Vec3::Y * 0.5, b, Vec3::Y * -0.5).along(Vec3::Y);
        world.insert_joint(shoulder);
        world.insert_joint(shoulder.cone(0.6));
        let momenta = |world: &World| {
            let all = world.bodies.iter().map(|body| {
                let p = body.linear_velocity * body.mass.mass;
                (p, body.angular_momentum().as_vec3())
            });
            all.fold((Vec3::ZERO, Vec3::ZERO), |sum, (p, l)| (sum.0 + p, sum.1 + l))
        };
        let before = momenta(&world);
        let mut simulation = simulation(world, solver, || Box::new(Cpu::new()));
        let mut reached = false;
        for _ in 0..240 {
            steps(&mut simulation, 1);
            let [a, b] = [a, b].map(|i| simulation.world.bodies[i].rotation * Vec3::Y);
            reached |= a.angle_between(b) > 0.59;
        }
        let after = momenta(&simulation.world);
        assert!(reached && (after.0 - before.0).length() < 1e-4, "{solver:?}: {before:?} {after:?}");
        assert!((after.1 - before.1).length() < 5e-3 * before.1.length(), "{solver:?}: {before:?} {after:?}");
    }
}

fn same_as_the_reference(open: Open) {
    for solver in SOLVERS {
        let [ours, theirs] = [open, reference].map(|open| {
            let mut simulation = simulation(whirling(), solver, open);
            steps(&mut simulation, 60);
            all_bits(&simulation.world)
        });
        assert_eq!(ours, theirs, "{solver:?}");
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_cones() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_cones() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}

fn a_cone_out_of_range_is_an_error() {
    for angle in [0.0, -1.0, 3.2, f32::NAN] {
        let mut world = World::new();
        let body = world.insert(arm(Quat::IDENTITY));
        shoulder(&mut world, body, angle);
        let error = world.check().expect_err("it is refused").to_string();
        assert!(error.contains("limits 0 and NaN"), "{error}");
    }
}
