//! Contact problems from steps: they are what the step was, and they can be solved.

use crate::common::Open;
use crate::common::contacts::{curve, sweeps_to};
use drystone::config::Method;
use drystone::glam::{DVec3, Vec3};
use drystone::{Body, Cpu, Shape, Simulation, SolverConfig, World};
use drystone_problems::contacts::{ContactProblem, Operator};
use drystone_problems::solver::{Order, solution};
use drystone_scenes::Scene;

tests! {
    every_backend {
        every_backend_leaves_of_a_saved_step_what_f64_leaves,
    }
    no_gpu {
        a_saved_step_is_read_back_and_solved,
        acceleration_pays_on_saved_steps,
        a_problem_says_what_the_bodies_are_about_to_do,
        saving_a_step_changes_nothing,
    }
}

fn simulation(scene: &str, parameters: &[&str], steps: u32) -> Simulation {
    let parameters: Vec<String> = parameters.iter().map(|p| (*p).into()).collect();
    let scene = Scene::find(scene, &parameters).expect("a scene of the catalogue");
    let mut simulation = Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(Cpu::new()))
        .expect("it is sound");
    for _ in 0..steps {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    simulation
}

/// Problems of scenes at rest, falling and leaning on each other.
fn problems() -> Vec<ContactProblem> {
    [("pile", &["n=60"][..], 100), ("tower", &["n=6"], 30), ("wall", &["rows=5", "columns=4"], 60), ("drop", &[], 70)]
        .map(|(scene, parameters, steps)| {
            let mut simulation = simulation(scene, parameters, steps);
            drystone_problems::step_with_contacts(&mut simulation, scene, 1.0 / 60.0).expect("no joints").0
        })
        .into()
}

fn a_saved_step_is_read_back_and_solved() {
    for problem in problems() {
        let read = ContactProblem::parse(&problem.to_text()).expect("a problem");
        assert_eq!(read, problem);
        let solved = solution(&problem, 1e-8, 20_000).expect("good frames");
        measured!(
            "{}: {} contacts, {} sweeps, {:?}",
            problem.name,
            problem.contacts.len(),
            solved.sweeps,
            solved.residuals
        );
        assert!(solved.residuals.e_vel <= 1e-8 && !problem.contacts.is_empty(), "{}", problem.name);
    }
}

fn every_backend_leaves_of_a_saved_step_what_f64_leaves(open: Open) {
    for problem in problems() {
        for order in [Order::Contacts, Order::Manifolds] {
            let exact = curve(&problem, (Method::Plain, order), None, 200);
            let rounded = curve(&problem, (Method::Plain, order), Some(open()), 200);
            let apart = exact.iter().zip(&rounded).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            measured!("{}, {order:?}: {apart:.1e}", problem.name);
            assert!(apart <= 1e-5, "{}, {order:?}: {apart:e}", problem.name);
        }
    }
}

fn acceleration_pays_on_saved_steps() {
    for problem in problems() {
        let sweeps = |method| sweeps_to(&problem, (method, Order::Manifolds), None, &[1e-1, 1e-2, 1e-3], 20_000);
        let (plain, accelerated) = (sweeps(Method::Plain), sweeps(Method::Accelerated));
        measured!("{}: {plain:?} and {accelerated:?}", problem.name);
        assert!(plain.iter().zip(&accelerated).all(|(p, a)| a.expect("reached") <= p.expect("reached")));
    }
}

fn a_problem_says_what_the_bodies_are_about_to_do() {
    // A box that falls onto a plate which moves: gravity of a substep, the gap, and the plate's velocity are in it.
    let mut world = World::new();
    let plate = Body::kinematic().shape(Shape::cuboid(5.0, 0.5, 5.0)).velocity(Vec3::new(0.25, 0.125, 0.0), Vec3::ZERO);
    world.insert(plate);
    let falling = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).friction(0.5).position(0.0, 1.004, 0.0);
    world.insert(falling.velocity(Vec3::NEG_Y, Vec3::ZERO));
    world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(50.0, 50.0, 0.0));
    let config = SolverConfig::default().without_sleep().with(|c| c.substeps = 4);
    let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("it is sound");
    let (problem, _) = drystone_problems::step_with_contacts(&mut simulation, "plate", 0.1).expect("no joints");

    assert_eq!((problem.bodies.len(), problem.contacts.len()), (1, 4), "the ball touches nothing");
    let box_ = &problem.bodies[0];
    assert!((box_.mass - 1000.0).abs() < 1e-3 && (box_.inertia.x_axis.x - 1000.0 / 6.0).abs() < 1e-3);
    assert!(box_.free.linear.distance(DVec3::NEG_Y * (1.0 + 9.81 * 0.025)) < 1e-6, "{:?}", box_.free);
    let operator = Operator::new(&problem);
    for (i, contact) in problem.contacts.iter().enumerate() {
        // World axes: what the box does more than the plate, and the gap of 4 mm over 25 ms.
        let u = contact.impulse(operator.relative_velocity(i, &[box_.free]));
        let gap = contact.frame[0] * (0.004 / 0.025);
        let expected = box_.free.linear - DVec3::new(0.25, 0.125, 0.0);
        let sign = if contact.b.is_some() { 1.0 } else { -1.0 };
        assert!((u - gap).distance(expected * sign) < 1e-4, "{u}");
    }
}

fn saving_a_step_changes_nothing() {
    let end = |save: bool| {
        let mut simulation = simulation("pile", &["n=60"], 60);
        for _ in 0..30 {
            if save {
                drystone_problems::step_with_contacts(&mut simulation, "pile", 1.0 / 60.0).expect("no joints");
            } else {
                simulation.step(1.0 / 60.0).expect("a step");
            }
        }
        simulation.world.bodies.iter().map(|b| (b.position, b.rotation, b.linear_velocity)).collect::<Vec<_>>()
    };
    assert_eq!(end(false), end(true));
}
