//! Rows stay in their slots as long as their manifold lasts, and a slot that is free goes to another manifold with nothing in it.

use drystone::config::FrictionAt;
use drystone::glam::Vec3;
use drystone::{Body, BodyHandle, Cpu, Shape, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

const DT: f32 = 1.0 / 60.0;

fn simulation(world: World) -> Simulation {
    Simulation::with(world, SolverConfig::default().without_sleep(), Box::new(Cpu::new())).expect("a good world")
}

fn run(simulation: &mut Simulation, steps: u32) {
    for _ in 0..steps {
        simulation.step(DT).expect("a step");
    }
}

fn ball(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::ball(0.5)).position(x, y, 0.0)
}

/// Eight balls on the ground, 2 m apart.
fn row_of_balls() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..8 {
        world.insert(ball(2.0 * i as f32, 0.5));
    }
    world
}

/// Rows of the contacts of a body.
fn rows(simulation: &mut Simulation, body: BodyHandle) -> Vec<u32> {
    let (problem, _) = simulation.next_problem(DT).expect("a step");
    let own = |&row: &u32| {
        let contact = &problem.contacts[row as usize];
        [contact.body_a, contact.body_b].contains(&(body.index() as u32))
    };
    problem.rows_of(&problem.contact_colors()).iter().copied().filter(own).collect()
}

#[test]
fn a_contact_stays_in_its_row_while_others_come_and_go() {
    let mut simulation = simulation(row_of_balls());
    run(&mut simulation, 10);
    let last = simulation.world.bodies.handle(8).expect("a ball");
    let before = rows(&mut simulation, last);
    for body in 1..4 {
        simulation.world.bodies[body].position.y = 50.0;
        run(&mut simulation, 5);
        assert_eq!(rows(&mut simulation, last), before, "without body {body}");
    }
    assert_eq!(simulation.problem().swept_contacts().count(), 5);
}

/// The last pair takes the place of one that ended, also where nothing of it moves.
#[test]
fn a_sleeping_contact_keeps_its_points_while_another_ends() {
    let mut simulation =
        Simulation::with(row_of_balls(), SolverConfig::default(), Box::new(Cpu::new())).expect("a good world");
    run(&mut simulation, 120);
    let others_sleep = |s: &Simulation| s.world.bodies.handles().skip(2).all(|body| s.is_asleep(body));
    // Points of the contacts of the other balls.
    let points = |simulation: &Simulation| {
        let others = (2..9).filter_map(|body| {
            let mut own = simulation.contacts().filter(|c| [c.a, c.b].iter().any(|side| side.body.index() == body));
            Some((body, own.next()?.points()[0].position))
        });
        others.collect::<Vec<_>>()
    };
    let before = points(&simulation);
    let is_below = |&(body, point): &(usize, Vec3)| point.distance(Vec3::X * 2.0 * (body - 1) as f32) < 0.01;
    assert!(before.len() == 7 && before.iter().all(is_below), "{before:?}");
    assert!(others_sleep(&simulation));
    simulation.world.bodies[1].position.y = 50.0;
    run(&mut simulation, 5);
    assert!(others_sleep(&simulation));
    assert_eq!(points(&simulation), before);
}

#[test]
fn a_manifold_in_the_slot_of_one_that_ended_begins_without_its_impulses_and_preload() {
    for friction_at in [FrictionAt::Points, FrictionAt::Manifold] {
        begins_without_impulses(friction_at);
    }
}

fn begins_without_impulses(friction_at: FrictionAt) {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let (first, second) = (world.insert(ball(0.0, 0.5)), world.insert(ball(50.0, 800.0)));
    for i in 0..4 {
        world.insert(ball(10.0 + 2.0 * i as f32, 0.5));
    }
    let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at);
    let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("a good world");
    run(&mut simulation, 120);
    // It slides, so that friction acts.
    simulation.world.bodies[first].linear_velocity = Vec3::Z * 5.0;
    run(&mut simulation, 3);
    let row = rows(&mut simulation, first)[0];
    let borne = simulation.problem().contacts[row as usize];
    let last = (borne.first_point + simulation.problem().params.patches) as usize;
    let impulses = &simulation.problem().impulses;
    assert!(borne.preload > 0.0 && impulses[borne.first_point as usize].normal > 1.0);
    assert!(impulses[last].tangent_1.abs() + impulses[last].tangent_2.abs() > 1.0);
    simulation.world.bodies[first].position.y = 40.0;
    run(&mut simulation, 1);
    assert!(rows(&mut simulation, first).is_empty());
    simulation.world.bodies[second].position.y = 0.5;
    // A body that lay still would begin with what it rests with.
    simulation.world.bodies[second].linear_velocity = 1e-3 * Vec3::NEG_Y;
    assert_eq!(rows(&mut simulation, second), [row]);
    let (problem, _) = simulation.next_problem(DT).expect("a step");
    let begun = problem.contacts[row as usize];
    let first_point = begun.first_point as usize;
    for impulse in &problem.impulses[first_point..=first_point + problem.params.patches as usize] {
        assert_eq!((begun.preload, impulse.normal, impulse.tangent_1, impulse.tangent_2), (0.0, 0.0, 0.0, 0.0));
    }
}

/// A ball that rolls over a mesh is in contact with one triangle after another.
#[test]
fn slots_of_manifolds_that_ended_are_used_again() {
    let mut world = World::new();
    let vertices = (0..=60).flat_map(|i| [-2.0, 2.0].map(|z| Vec3::new(i as f32 * 0.25, 0.0, z))).collect();
    let triangles = (0..60).flat_map(|i| [[2 * i, 2 * i + 1, 2 * i + 2], [2 * i + 2, 2 * i + 1, 2 * i + 3]]).collect();
    world.insert(Body::fixed().shape(Shape::mesh(vertices, triangles).expect("a mesh")));
    world.insert(ball(1.0, 0.5).velocity(Vec3::X * 5.0, Vec3::NEG_Z * 10.0));
    // Contacts that last, so that slots are not sorted all the time.
    for i in 0..10 {
        world.insert(Body::fixed().shape(Shape::cuboid(0.6, 0.1, 0.6)).position(2.0 * i as f32, -3.0, 8.0));
        world.insert(ball(2.0 * i as f32, -2.4).position(2.0 * i as f32, -2.4, 8.0));
    }
    let mut simulation = simulation(world);
    run(&mut simulation, 120);
    assert!(simulation.world.bodies[1].position.x > 8.0, "{}", simulation.world.bodies[1].position);
    let problem = simulation.problem();
    let (slots, swept) = (problem.contacts.len(), problem.swept_contacts().count());
    assert!(slots <= swept + 4, "{slots} slots for {swept} contacts");
}

#[test]
fn rows_of_a_world_that_begins_stand_in_the_order_of_the_sweeps() {
    let scene = Scene::find("pyramid", &["base=6".into()]).expect("the scene");
    let mut simulation = simulation(scene.world);
    run(&mut simulation, 1);
    let problem = simulation.problem();
    let order = problem.rows_of(&problem.contact_colors());
    assert!(order.len() > 20 && order.iter().enumerate().all(|(i, &row)| i as u32 == row), "{order:?}");
}
