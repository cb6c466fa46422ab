//! Damped bodies against the solution of v' = a - d v.

use crate::common::state::{all_bits, bits, reference};
use crate::common::{Open, gpu};
use drystone::glam::Vec3;
use drystone::{Body, Cpu, Joint, Shape, Simulation, SolverConfig, World};

tests! {
    every_backend {
        a_damped_velocity_is_the_exponential_of_any_number_of_substeps,
        a_damped_body_falls_as_its_closed_form_says,
        a_torque_against_damping_comes_to_torque_over_inertia_and_rate,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_damping,
    }
    no_gpu {
        lanes_have_the_bits_of_the_reference_with_damping,
        a_body_without_damping_keeps_its_bits_beside_one_with_damping,
        a_box_that_slides_on_honey_stops_where_its_closed_form_says,
        damping_that_a_caller_changes_acts_from_the_next_step_on,
    }
}

const DT: f32 = 1.0 / 60.0;
/// From long substeps to those whose velocities are changes since the step began.
const SUBSTEPS: [u32; 4] = [1, 4, 8, 64];

/// A cube of 6 kg with sides of 1 m: 1 kg m² about every axis.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0)
}

fn after(world: World, substeps: u32, steps: u32, open: Open) -> World {
    let config = SolverConfig::default().with(|c| c.substeps = substeps);
    let mut simulation = Simulation::with(world, config, open()).expect("a simulation");
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
    simulation.world
}

/// Refuses vectors that differ by more than rounding does in a thousand substeps.
fn near(x: Vec3, y: Vec3) {
    assert!((x - y).length() < 1e-5 * (1.0 + y.length()), "{x}, not {y}");
}

fn a_damped_velocity_is_the_exponential_of_any_number_of_substeps(open: Open) {
    let (v, w) = (Vec3::new(3.0, -1.0, 2.0), Vec3::new(0.5, 4.0, -2.0));
    let rates = [(0.0, 0.0), (0.1, 0.0), (0.0, 2.0), (5.0, 0.3), (1e6, 1e9)];
    for substeps in SUBSTEPS {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        for (k, (linear, angular)) in rates.into_iter().enumerate() {
            let body = cube().position(20.0 * k as f32, 0.0, 0.0).velocity(v, w);
            world.insert(body.linear_damping(linear).angular_damping(angular));
        }
        let world = after(world, substeps, 30, open);
        for (body, (linear, angular)) in world.bodies.iter().zip(rates) {
            near(body.linear_velocity, v * (-0.5 * linear).exp());
            near(body.angular_velocity, w * (-0.5 * angular).exp());
        }
    }
}

/// v = g/d (1 - exp(-d t)), and g/d at last.
fn a_damped_body_falls_as_its_closed_form_says(open: Open) {
    for substeps in SUBSTEPS {
        let mut world = World::new();
        for (k, rate) in [0.5, 20.0, 1e4].into_iter().enumerate() {
            world.insert(cube().position(3.0 * k as f32, 0.0, 0.0).linear_damping(rate));
        }
        let world = after(world, substeps, 60, open);
        for body in &world.bodies {
            let rate = body.linear_damping;
            near(body.linear_velocity, Vec3::Y * (-9.81 / rate * (1.0 - (-rate).exp())));
        }
        assert!((world.bodies[1].linear_velocity.y + 9.81 / 20.0).abs() < 1e-6);
    }
}

fn a_torque_against_damping_comes_to_torque_over_inertia_and_rate(open: Open) {
    for substeps in SUBSTEPS {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        world.insert(cube().angular_damping(3.0));
        let torque = Vec3::new(1.0, -2.0, 0.5);
        world.bodies[0].torque = torque;
        let world = after(world, substeps, 30, open);
        near(world.bodies[0].angular_velocity, torque / 3.0 * (1.0 - (-1.5_f32).exp()));
    }
}

/// A tower, a plank that turns, and a chain, with damping on some bodies, pushed.
fn mixture() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..4 {
        let rate = i as f32;
        world.insert(cube().position(0.0, 0.5 + i as f32, 0.0).linear_damping(rate).angular_damping(0.5 * rate));
    }
    let plank = Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.2)).position(3.0, 3.0, 0.0);
    let plank = world.insert(plank.velocity(Vec3::X, Vec3::new(3.0, 1.0, 0.2)).angular_damping(0.7));
    let ball = |y: f32| Body::dynamic().shape(Shape::ball(0.3)).position(3.0, y, 0.0);
    let [near, far] =
        [ball(4.0).linear_damping(1.0), ball(5.0).velocity(Vec3::Z, -Vec3::ZERO)].map(|ball| world.insert(ball));
    world.insert_joint(Joint::new(plank, Vec3::Y, near, Vec3::ZERO));
    world.insert_joint(Joint::new(near, Vec3::Y, far, Vec3::ZERO));
    world.bodies[plank].torque = Vec3::new(0.1, 0.0, 0.4);
    world.bodies[4].linear_velocity.x = 2.0;
    world
}

fn same_as_the_reference(open: Open) {
    for substeps in [4, 8, 32] {
        let [ours, theirs] = [reference, open].map(|open| after(mixture(), substeps, 40, open));
        assert_eq!(all_bits(&ours), all_bits(&theirs), "{substeps} substeps");
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_damping() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_damping() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}

fn a_body_without_damping_keeps_its_bits_beside_one_with_damping() {
    let mut world = mixture();
    world.bodies.iter_mut().for_each(|body| (body.linear_damping, body.angular_damping) = (0.0, 0.0));
    let lone = world.insert(cube().position(50.0, 9.0, 0.0).velocity(Vec3::X, Vec3::Y));
    for substeps in [8, 64] {
        let [plain, damped] = [0.0, 1.0].map(|rate| {
            let mut world = world.clone();
            world.bodies[lone] = world.bodies[lone].clone().linear_damping(rate).angular_damping(rate);
            after(world, substeps, 40, reference)
        });
        assert_eq!(bits(&plain, 0..lone.index()), bits(&damped, 0..lone.index()));
        assert_ne!(bits(&plain, [lone.index()]), bits(&damped, [lone.index()]));
    }
}

/// v' = -mu g - d v, from v to 0: after the time t = ln(1 + d v/(mu g))/d the box has come (v - mu g t)/d far.
fn a_box_that_slides_on_honey_stops_where_its_closed_form_says() {
    let (rate, speed, braking) = (2.0_f64, 4.0_f64, 0.3 * 9.81_f64);
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.3));
    let slab = Body::dynamic().shape(Shape::cuboid(0.5, 0.05, 0.5)).position(0.0, 0.05, 0.0).friction(0.3);
    world.insert(slab.velocity(Vec3::X * speed as f32, Vec3::ZERO).linear_damping(rate as f32));
    let world = after(world, 8, 120, reference);
    let time = (1.0 + rate * speed / braking).ln() / rate;
    let way = (speed - braking * time) / rate;
    let x = f64::from(world.bodies[1].position.x);
    assert!((x - way).abs() < 0.01 && world.bodies[1].linear_velocity.length() < 1e-3, "{x} m, not {way}");
}

fn damping_that_a_caller_changes_acts_from_the_next_step_on() {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    world.insert(cube().velocity(Vec3::X, Vec3::ZERO));
    let mut simulation = Simulation::with(world, SolverConfig::default(), reference()).expect("a simulation");
    let mut speed = 1.0;
    for rate in [0.0, 1.0, 0.0, 6.0] {
        simulation.world.bodies[0].linear_damping = rate;
        simulation.step(DT).expect("a step");
        speed *= (-rate * DT).exp();
        assert!((simulation.world.bodies[0].linear_velocity.x - speed).abs() < 1e-6, "{rate}");
    }
}
