//! Short substeps find changes of velocities since the step began.

use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World};
use glam::Vec3;

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5))
}

fn simulation(world: World, substeps: u32) -> Simulation {
    let config = SolverConfig::default().without_sleep().with(|c| c.substeps = substeps);
    Simulation::with(world, config, Box::new(Reference::<f32>::new())).expect("good settings")
}

#[test]
fn only_a_plan_of_short_substeps_begins_and_ends_changes() {
    let plan = |substeps| {
        let mut world = World::new();
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
        world.insert(cube().position(0.0, 0.5, 0.0));
        simulation(world, substeps).next_problem(1.0 / 60.0).expect("a step").1.to_string()
    };
    assert!(!plan(16).contains("change") && !plan(16).contains("from start"), "{}", plan(16));
    let short = plan(32);
    assert!(short.starts_with("begin_changes\nintegrate_velocities(from start)\n"), "{short}");
    assert!(short.ends_with("end_changes\n") && !short.contains("warm start)"), "{short}");
    assert_eq!(short.matches("change").count(), 2, "{short}");
}

/// Nothing pushes the floor, so its velocity is no change; those of the cubes are.
#[test]
fn a_moving_floor_carries_a_tower_of_short_substeps() {
    let speed = Vec3::new(1.0, 0.0, 0.5);
    let mut world = World::new();
    let mut floor = Body::kinematic().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0);
    floor.linear_velocity = speed;
    world.insert(floor);
    let lowest = world.insert(cube().position(0.0, 0.5, 0.0));
    let highest = world.insert(cube().position(0.0, 1.5, 0.0));
    let mut simulation = simulation(world, 32);
    for _ in 0..120 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    for body in [lowest, highest] {
        let v = simulation.world.bodies[body].linear_velocity;
        assert!((v - speed).length() < 1e-3, "{body:?}: {v} m/s");
    }
}
