//! Detection: which bodies are a pair, how far apart they are, and when a manifold is computed anew.

use drystone::{Body, Shape, SolverConfig, World};
use glam::{Quat, Vec3};

use super::{DT, ball, cube, empty, floor, near, run, simulation};

/// A ball that flies 0.9 m a step and has 0.81 m to go when a step begins: farther than any margin, nearer than its way.
#[test]
fn what_comes_fast_stops_at_the_surface() {
    let way = 0.9;
    let mut world = empty();
    world.insert(Body::fixed().shape(Shape::cuboid(0.5, 5.0, 5.0)));
    world.insert(ball().position(-1.0 - 1.9 * way, 0.0, 0.0).velocity(Vec3::X * way / DT, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    for (step, gap) in [(1, 0.9 * way), (2, 0.0), (3, 0.0)] {
        run(&mut simulation, 1, DT);
        near(&format!("gap after step {step} [m]"), -1.0 - simulation.world.bodies[1].position.x, gap, 1e-3);
    }
    near("speed [m/s]", simulation.world.bodies[1].linear_velocity.x, 0.0, 1e-3);
}

/// Springs as soft as those that sink in by half a millimeter, and are preloaded by as much.
#[test]
fn a_pair_says_how_far_its_surfaces_are_apart_whatever_they_are_preloaded_by() {
    let mut world = World::new();
    world.insert(floor());
    world.insert(cube());
    let mut simulation = simulation(world, SolverConfig::default().without_sleep().with(|c| c.substeps = 2));
    for _ in 0..5 {
        run(&mut simulation, 60, DT);
        let above = simulation.world.bodies[1].position.y - 0.5;
        let manifolds: Vec<_> = simulation.manifolds().collect();
        let [manifold] = &manifolds[..] else { panic!("one manifold") };
        assert!(manifold.preload > 1e-4, "{} m", manifold.preload);
        for point in manifold.points() {
            // Of the step that has run: as it was when that began.
            near("separation [m]", point.separation, above, 2e-5);
        }
    }
}

#[test]
fn bodies_that_part_are_no_pair_any_more() {
    let mut world = empty();
    world.insert(ball());
    world.insert(ball().position(1.01, 0.0, 0.0).velocity(Vec3::X * 3.0, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    assert_eq!(run(&mut simulation, 1, DT).pairs, 1);
    assert_eq!(run(&mut simulation, 60, DT).pairs, 0);
    // And a pair again when they come back.
    simulation.world.bodies[1].linear_velocity = Vec3::X * -3.0;
    assert_eq!(run(&mut simulation, 60, DT).pairs, 1);
}

/// Surfaces apart push each other when they meet. Both arms then lead to the same point.
#[test]
fn arms_lead_to_the_own_surface_across_a_gap_and_to_the_middle_of_an_overlap() {
    for (height, ends) in [(0.51, [0.0, 0.01]), (0.49, [-0.005; 2])] {
        arms_end_at(height, ends);
    }
}

fn arms_end_at(height: f32, ends: [f32; 2]) {
    let mut world = empty();
    world.insert(floor());
    world.insert(ball().position(0.0, height, 0.0));
    let before = world.clone();
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 1, DT);
    let manifold = simulation.manifolds().next().expect("near enough");
    let point = manifold.points()[0];
    let bodies = [manifold.a, manifold.b].map(|side| before.bodies[side.body.index()].position);
    for ((center, arm), end) in bodies.into_iter().zip([point.r_a, point.r_b]).zip(ends) {
        near("height of the end of an arm [m]", (center + arm).y, end, 1e-6);
    }
}

/// A manifold is computed anew once its bodies moved by 2 % of their half extents, seen from each other, or turned by as much.
#[test]
fn a_contact_is_computed_anew_once_its_bodies_moved_or_turned() {
    let computed = |velocity: Vec3, spin: Vec3| {
        let mut world = empty();
        world.insert(floor().friction(0.0));
        world.insert(cube().friction(0.0).velocity(velocity, spin));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        run(&mut simulation, 1, DT);
        (1..=30).find(|_| run(&mut simulation, 1, DT).computed > 0)
    };
    // 1 cm: at 2 mm a step after five, where rounding lets it.
    assert!(
        matches!(computed(Vec3::X * 0.002 / DT, Vec3::ZERO), Some(5 | 6)),
        "{:?}",
        computed(Vec3::X * 0.12, Vec3::ZERO)
    );
    assert_eq!(computed(Vec3::ZERO, Vec3::ZERO), None);
    // The corner, 0.87 m from the middle, goes 1 cm: 12 mrad.
    let turned = computed(Vec3::ZERO, Vec3::Y * 0.002 / DT);
    assert!(matches!(turned, Some(5..=7)), "{turned:?}");
}

/// Slow, so that the contact is looked for nearby; then fast, within the distance at which it would be reused.
#[test]
fn what_comes_slowly_and_then_fast_stops_at_the_surface() {
    let mut world = empty();
    world.insert(Body::fixed().shape(Shape::cuboid(0.5, 5.0, 5.0)));
    world.insert(ball().position(-1.06, 0.0, 0.0));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 2, DT);
    simulation.world.bodies[1].linear_velocity.x = 0.5 / DT;
    for _ in 0..3 {
        run(&mut simulation, 1, DT);
        let gap = -1.0 - simulation.world.bodies[1].position.x;
        near("gap [m]", gap, 0.0, 1e-3);
    }
}

/// A plank 1 cm above the floor, farther than the margin of 4 mm. Its end comes down by more within the step if it turns.
#[test]
fn what_turns_fast_is_looked_ahead_for() {
    for (spin, manifolds) in [(8.0, 1), (0.0, 0)] {
        let mut world = empty();
        world.insert(floor());
        let plank = Body::dynamic().shape(Shape::cuboid(1.0, 0.1, 0.1)).position(0.0, 0.11, 0.0);
        world.insert(plank.velocity(Vec3::ZERO, Vec3::Z * -spin));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        assert_eq!(run(&mut simulation, 1, DT).manifolds, manifolds, "{spin} rad/s");
    }
}

#[test]
fn bodies_that_nothing_pushes_are_no_pair() {
    let mut world = World::new();
    world.insert(floor());
    for x in [0.0, 0.5] {
        world.insert(Body::kinematic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, 0.5, 0.0));
    }
    assert_eq!(run(&mut simulation(world, SolverConfig::default().without_sleep()), 1, DT).pairs, 0);
}

/// An end of a plank that turns comes down by 0.13 m a step, the plank itself by nothing.
#[test]
fn a_plank_that_turns_onto_a_board_meets_it() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world.insert(Body::fixed().shape(Shape::cuboid(5.0, 0.02, 5.0)).position(0.0, -0.02, 0.0));
    let plank = Body::dynamic().shape(Shape::cuboid(1.0, 0.05, 0.1)).position(0.0, 0.3, 0.0);
    // One end is 3 cm above the board, further than contacts are made.
    let plank = plank.rotation(Quat::from_rotation_z(-0.2227)).velocity(Vec3::ZERO, Vec3::new(0.0, 0.0, -8.0));
    let plank = world.insert(plank);
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    let mut lowest = f32::INFINITY;
    for _ in 0..30 {
        simulation.step(DT).expect("a step");
        let body = &simulation.world.bodies[plank];
        let ends = [-1.0, 1.0].map(|x| body.position + body.rotation * Vec3::new(x, -0.05, 0.0));
        lowest = ends.iter().map(|end| end.y).fold(lowest, f32::min);
    }
    assert!(lowest > -0.02, "an end is {lowest} m above the board");
    assert!(simulation.world.bodies[plank].linear_velocity.y > 0.5, "the board pushes it up");
}
