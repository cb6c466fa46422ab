//! Bodies that the caller puts elsewhere leave no impulses behind and bring none along.

use crate::common::gpu;
use crate::common::state::{all_bits, reference};
use drystone::glam::{Quat, Vec3};
use drystone::{Body, Cpu, Shape, Simulation, SolvedManifold, SolverConfig, World};

tests! {
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_where_bodies_are_put_elsewhere,
    }
    no_gpu {
        lanes_have_the_bits_of_the_reference_where_bodies_are_put_elsewhere,
        a_box_from_under_a_pile_lies_still_where_it_is_put,
        a_box_that_is_turned_over_under_a_pile_begins_without_impulses,
        a_box_from_one_tower_lies_still_on_another,
        boxes_that_change_places_lie_still,
        a_tower_that_is_moved_as_a_whole_stands_still,
        a_small_correction_keeps_impulses,
        a_platform_that_the_caller_moves_little_by_little_keeps_impulses,
        a_sleeping_box_that_is_put_into_the_air_falls,
        a_sleeping_pile_falls_when_its_lowest_box_is_put_elsewhere,
        a_box_that_is_put_away_and_back_within_a_step_keeps_its_bits,
    }
}

const DT: f32 = 1.0 / 60.0;

/// Towers of cubes of 1 m on one floor, 5 m apart: body 1 is the lowest of the first.
fn towers(heights: &[usize]) -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for (k, &height) in heights.iter().enumerate() {
        for i in 0..height {
            let cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
            world.insert(cube.position(5.0 * k as f32, 0.5 + i as f32, 0.0));
        }
    }
    world
}

/// The same after two seconds of rest.
fn settled(world: World, config: SolverConfig) -> Simulation {
    let mut simulation = Simulation::with(world, config, reference()).expect("a simulation");
    run(&mut simulation, 120);
    simulation
}

/// Whether all of these bodies sleep.
fn asleep(simulation: &Simulation, bodies: std::ops::Range<usize>) -> bool {
    bodies.into_iter().all(|i| simulation.is_asleep(simulation.world.bodies.handle(i).expect("a body")))
}

fn awake(heights: &[usize]) -> Simulation {
    settled(towers(heights), SolverConfig::default().without_sleep())
}

fn run(simulation: &mut Simulation, steps: u32) {
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

/// Fastest of some bodies in any of the next steps (m/s).
fn fastest(simulation: &mut Simulation, steps: u32, bodies: &[usize]) -> f32 {
    let mut fastest = 0.0_f32;
    for _ in 0..steps {
        run(simulation, 1);
        let own = bodies.iter().map(|&i| &simulation.world.bodies[i]);
        fastest = own.map(|b| b.linear_velocity.length() + b.angular_velocity.length()).fold(fastest, f32::max);
    }
    fastest
}

/// The force that presses two bodies together in the last substep, in weights of a cube.
fn weights(simulation: &mut Simulation, pair: [usize; 2]) -> f32 {
    let pair = pair.map(|i| simulation.world.bodies.handle(i).expect("a body"));
    let is_of = |m: &SolvedManifold| [m.a.body, m.b.body] == pair || [m.b.body, m.a.body] == pair;
    simulation.manifolds().filter(is_of).map(|m| m.normal_impulse() * m.substeps as f32 / (9810.0 * DT)).sum()
}

/// A tower of nine whose lowest cube weighs a thousandth of the others.
fn light_below() -> Simulation {
    let mut world = towers(&[9]);
    let lowest = world.bodies[1].clone();
    world.bodies[1] = lowest.total_mass(1.0);
    settled(world, SolverConfig::default().without_sleep())
}

/// How high a body gets in the next steps above half a meter (m).
fn highest(simulation: &mut Simulation, body: usize) -> f32 {
    (0..30).fold(0.0, |highest, _| {
        run(simulation, 1);
        f32::max(highest, simulation.world.bodies[body].position.y - 0.5)
    })
}

/// With what it bore it got 4.6 mm high.
fn a_box_from_under_a_pile_lies_still_where_it_is_put() {
    let mut simulation = light_below();
    let before = weights(&mut simulation, [0, 1]);
    assert!((before - 8.001).abs() < 0.1, "{before} weights");
    simulation.world.bodies[1].position = Vec3::new(20.0, 0.5, 0.0);
    let highest = highest(&mut simulation, 1);
    assert!(highest < 2e-5, "{highest} m");
    let after = weights(&mut simulation, [0, 1]);
    assert!((after - 0.001).abs() < 5e-5, "{after} weights");
    assert!(simulation.world.bodies[2].position.y < 0.6);
}

/// A quarter turn brings another side to the floor in the same place.
fn a_box_that_is_turned_over_under_a_pile_begins_without_impulses() {
    let mut simulation = light_below();
    for body in 2..10 {
        simulation.world.bodies[body].position.x = 20.0;
    }
    simulation.world.bodies[1].rotation = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    simulation.world.bodies[1].position = Vec3::Y * 0.5;
    let highest = highest(&mut simulation, 1);
    assert!(highest < 2e-5, "{highest} m");
}

/// The contacts that a box left do not act on it.
fn a_box_from_one_tower_lies_still_on_another() {
    let mut simulation = awake(&[9, 3]);
    let top = simulation.world.bodies[12].position;
    simulation.world.bodies[9].position = top + Vec3::Y;
    let fastest = fastest(&mut simulation, 30, &[9, 10, 11, 12]);
    // A cube without impulses falls by 20 mm/s in a substep.
    assert!(fastest < 1e-2, "{fastest} m/s");
    for (pair, expected) in [([12, 9], 1.0), ([0, 10], 4.0), ([0, 1], 8.0)] {
        let found = weights(&mut simulation, pair);
        assert!((found - expected).abs() < 0.1, "{pair:?}: {found} weights");
    }
}

/// The lowest of nine and a cube that stands alone, equal as bodies.
fn boxes_that_change_places_lie_still() {
    let mut simulation = awake(&[9, 1]);
    let [low, alone] = [1, 10].map(|i| simulation.world.bodies[i].position);
    (simulation.world.bodies[1].position, simulation.world.bodies[10].position) = (alone, low);
    let all: Vec<usize> = (1..11).collect();
    let fastest = fastest(&mut simulation, 30, &all);
    // The contact under the pile begins without impulses, and the pile sinks for some substeps.
    assert!(fastest < 0.1, "{fastest} m/s");
    let [alone, low] = [1, 10].map(|i| weights(&mut simulation, [0, i]));
    assert!((alone - 1.0).abs() < 0.05 && (low - 9.0).abs() < 0.2, "{alone} and {low} weights");
}

fn a_tower_that_is_moved_as_a_whole_stands_still() {
    let mut simulation = awake(&[9]);
    let turn = Quat::from_rotation_y(1.0);
    for body in simulation.world.bodies.iter_mut().skip(1) {
        body.position = turn * body.position + Vec3::X * 20.0;
        body.rotation = turn * body.rotation;
    }
    let all: Vec<usize> = (1..10).collect();
    let fastest = fastest(&mut simulation, 60, &all);
    assert!(fastest < 5e-3, "{fastest} m/s");
}

/// Without its impulses the tower would sink by gravity for some substeps.
fn a_small_correction_keeps_impulses() {
    let mut simulation = awake(&[9]);
    let all: Vec<usize> = (1..10).collect();
    for step in 0..20 {
        simulation.world.bodies[1 + step % 9].position.x += if step % 2 == 0 { 1e-4 } else { -1e-4 };
        // A pushed point of no friction would slide, and one without impulse would fall by 20 mm/s in a substep.
        let fastest = fastest(&mut simulation, 1, &all);
        assert!(fastest < 2e-3, "{fastest} m/s in step {step}");
    }
}

/// A platform of the caller's, 5 cm thick, that goes 2 cm sideways in every step.
fn a_platform_that_the_caller_moves_little_by_little_keeps_impulses() {
    for kind in [Body::fixed(), Body::kinematic()] {
        let mut world = World::new();
        world.insert(kind.shape(Shape::cuboid(9.0, 0.05, 9.0)).position(0.0, -0.05, 0.0));
        for i in 0..5 {
            world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5 + i as f32, 0.0));
        }
        let mut simulation = settled(world, SolverConfig::default().without_sleep());
        for _ in 0..20 {
            simulation.world.bodies[0].position.x += 0.02;
            run(&mut simulation, 1);
            let lowest = &simulation.world.bodies[1];
            assert!(lowest.linear_velocity.y.abs() < 2e-3, "{} m/s", lowest.linear_velocity);
        }
    }
}

fn a_sleeping_box_that_is_put_into_the_air_falls() {
    let mut simulation = settled(towers(&[3, 3]), SolverConfig::default());
    assert!(asleep(&simulation, 1..7));
    simulation.world.bodies[3].position.y += 4.0;
    run(&mut simulation, 10);
    let expected = -9.81 * 10.0 * DT;
    let top = &simulation.world.bodies[3];
    assert!((top.linear_velocity.y - expected).abs() < 1e-4, "{}", top.linear_velocity);
    assert!((1..3).all(|i| simulation.world.bodies[i].linear_velocity.length() < 2e-3));
    assert!(asleep(&simulation, 4..7));
}

fn a_sleeping_pile_falls_when_its_lowest_box_is_put_elsewhere() {
    let mut simulation = settled(towers(&[5]), SolverConfig::default());
    assert!(asleep(&simulation, 1..6));
    simulation.world.bodies[1].position.x = 20.0;
    let fastest = fastest(&mut simulation, 10, &[1]);
    assert!(fastest < 2e-3, "{fastest} m/s");
    // Springs between them push them apart by 0.02 m/s.
    let falls = |i: usize| (simulation.world.bodies[i].linear_velocity.y + 9.81 * 10.0 * DT).abs() < 0.03;
    assert!((2..6).all(falls));
}

fn a_box_that_is_put_away_and_back_within_a_step_keeps_its_bits() {
    let mut both = [awake(&[4]), awake(&[4])];
    let place = both[1].world.bodies[1].position;
    both[1].world.bodies[1].position = Vec3::ONE * 50.0;
    both[1].world.bodies[1].position = place;
    both.iter_mut().for_each(|simulation| run(simulation, 10));
    assert_eq!(all_bits(&both[0].world), all_bits(&both[1].world));
}

fn same_as_the_reference(backend: fn() -> Box<dyn drystone::Backend>) {
    let [ours, theirs] = [reference(), backend()].map(|backend| {
        let mut simulation = Simulation::with(towers(&[6, 4, 1]), SolverConfig::default().without_sleep(), backend)
            .expect("a simulation");
        for step in 0..60 {
            let body = 1 + (7 * step) % 11;
            match step % 6 {
                1 => simulation.world.bodies[body].position.x += 0.3,
                3 => simulation.world.bodies[body].position = Vec3::new(10.0, 1.5 + step as f32, 0.1),
                5 => simulation.world.bodies[body].position.x += 1e-3,
                _ => {}
            }
            run(&mut simulation, 1);
        }
        simulation.world
    });
    assert_eq!(all_bits(&ours), all_bits(&theirs));
}

fn a_gpu_has_the_bits_of_the_reference_where_bodies_are_put_elsewhere() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_where_bodies_are_put_elsewhere() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}
