//! Bars of millimeters lie on the bars that they cross, as bars of meters do.

use std::f32::consts::FRAC_PI_2;

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Cpu, Shape, Simulation, SolverConfig, World};

/// A bar along x, five times as long as it is thick (m).
type Bar = fn(f32) -> Shape;

fn cuboid(thick: f32) -> Shape {
    Shape::cuboid(2.5 * thick, 0.5 * thick, 0.5 * thick)
}

/// The same as a hull.
fn hull(thick: f32) -> Shape {
    let corner = |k: u32| {
        let side = |bit: u32| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
        thick * Vec3::new(5.0 * side(0), side(1), side(2))
    };
    Shape::convex_hull(&(0..8).map(corner).collect::<Vec<_>>()).expect("a hull")
}

/// Lays a bar down, turned by `turn` about the vertical.
fn bar(shape: &Shape, at: Vec3, turn: f32) -> Body {
    let body = Body::dynamic().shape(shape.clone()).position(at.x, at.y, at.z);
    body.rotation(Quat::from_rotation_y(turn))
}

fn floor() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world
}

/// Positions of all bodies after `seconds`.
fn after(world: World, seconds: f32) -> Vec<Vec3> {
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("a world");
    for _ in 0..(240.0 * seconds) as usize {
        simulation.step(1.0 / 240.0).expect("a step");
    }
    simulation.world.bodies.iter().map(|body| body.position).collect()
}

/// Two bars on the floor, and in layers on them two more across each time: nothing moves by a tenth of its thickness in two seconds.
#[track_caller]
fn assert_pile_stands(name: &str, shape: Bar, thick: f32) {
    let (mut world, shape) = (floor(), shape(thick));
    for layer in 0..6 {
        for side in [-1.5, 1.5] {
            let (aside, turn) = if layer % 2 == 0 { (Vec3::Z, 0.0) } else { (Vec3::X, FRAC_PI_2) };
            world.insert(bar(&shape, thick * (side * aside + (layer as f32 + 0.5) * Vec3::Y), turn));
        }
    }
    let before: Vec<Vec3> = world.bodies.iter().map(|body| body.position).collect();
    let ways = after(world, 2.0).into_iter().zip(before).map(|(now, then)| now.distance(then) / thick);
    let worst = ways.fold(0.0, f32::max);
    println!("{name} of {thick} m: {worst} of its thickness");
    assert!(worst < 0.1, "a {name} of {thick} m moves by {worst} of its thickness");
}

#[test]
fn a_pile_of_thin_logs_stands() {
    for thick in [3e-3, 1e-3] {
        assert_pile_stands("cuboid", cuboid, thick);
        assert_pile_stands("hull", hull, thick);
    }
}

#[test]
fn a_thin_bar_that_falls_on_another_stays_on_it() {
    const THICK: f32 = 5e-3;
    // Nearly along the other as well.
    for shape in [cuboid as Bar, hull] {
        for turn in [FRAC_PI_2, 1.0, 0.3, 0.05] {
            let (mut world, shape) = (floor(), shape(THICK));
            world.insert(bar(&shape, Vec3::Y * 0.5 * THICK, 0.0));
            world.insert(bar(&shape, Vec3::Y * 2.0 * THICK, turn));
            let height = after(world, 1.0)[2].y / THICK;
            println!("{turn}: {height}");
            assert!((height - 1.5).abs() < 0.05, "turned by {turn}, a bar lies at {height} times its thickness");
        }
    }
}
