//! The threads that a process begins in its first step. The only test of this process: threads of another one would count, too.
#![cfg(target_os = "linux")]

use drystone::{Body, Shape, Simulation, World, glam::Vec3};

/// The threads of this process.
fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").expect("a list of threads").count()
}

#[test]
fn the_first_step_of_a_process_begins_no_thread() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..10 {
        world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5 + i as f32, 0.0));
    }
    let mut simulation = Simulation::new(world).expect("a world that can be simulated");
    let begun = threads();
    simulation.step(1.0 / 60.0).expect("a step");
    assert_eq!(threads(), begun, "threads began in the first step");
}
