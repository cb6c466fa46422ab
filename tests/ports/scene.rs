//! Parts of scenes, and runs with the default settings.

use drystone::glam::{Quat, Vec3, vec3};
use drystone::{Body, BodyHandle, Shape, Simulation, World};

/// Length of a step (s).
pub const DT: f32 = 1.0 / 60.0;

/// A world without gravity.
pub fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

/// A dynamic body of 1 kg/m³, the density that other engines take without a word.
pub fn light() -> Body {
    Body::dynamic().density(1.0)
}

/// A body at a point.
pub fn at(body: Body, point: Vec3) -> Body {
    body.position(point.x, point.y, point.z)
}

/// A cube of half this side (m).
pub fn cube(half: f32) -> Shape {
    Shape::cuboid(half, half, half)
}

/// All points below y = 0.
pub fn floor() -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y))
}

/// A square slab whose upper side is at y = 0, with half its sides (m).
pub fn ground(half: f32, half_thickness: f32) -> Body {
    at(Body::fixed().shape(Shape::cuboid(half, half_thickness, half)), Vec3::NEG_Y * half_thickness)
}

/// A square of two triangles at y = 0, with half its side (m).
pub fn sheet(half: f32) -> Shape {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| vec3(x * half, 0.0, z * half));
    Shape::mesh(corners.into(), vec![[0, 2, 1], [0, 3, 2]]).expect("a square")
}

/// The corners of a cube of half this side (m).
pub fn corners(half: f32) -> Vec<Vec3> {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 0 { -half } else { half };
    (0..8).map(|i| vec3(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
}

/// A simulation with the default settings.
pub fn started(world: World) -> Simulation {
    Simulation::new(world).expect("a good world")
}

/// Steps of 1/60 s.
pub fn run(simulation: &mut Simulation, steps: usize) {
    run_with(simulation, steps, |_, _| {});
}

/// Steps of 1/60 s, with a call after each, which has the number of the step from 0.
pub fn run_with(simulation: &mut Simulation, steps: usize, mut after: impl FnMut(&mut Simulation, usize)) {
    for step in 0..steps {
        simulation.step(DT).expect("a step");
        after(simulation, step);
    }
}

/// A body that is there.
pub fn body(simulation: &Simulation, handle: BodyHandle) -> &Body {
    simulation.world.body(handle).expect("it is there")
}

/// The same, to change it.
pub fn body_mut(simulation: &mut Simulation, handle: BodyHandle) -> &mut Body {
    simulation.world.body_mut(handle).expect("it is there")
}

/// Position of a body (m).
pub fn place(simulation: &Simulation, handle: BodyHandle) -> Vec3 {
    body(simulation, handle).position
}

/// Kinetic and potential energy (J).
pub fn energy(world: &World) -> f64 {
    world.kinetic_energy() + world.potential_energy()
}

/// The angle of a rotation about an axis of unit length (rad), from -pi to pi.
pub fn twist(rotation: Quat, axis: Vec3) -> f32 {
    let angle = 2.0 * rotation.xyz().dot(axis).atan2(rotation.w);
    (angle + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI
}

/// The cosine of the angle by which a body is tilted.
pub fn upright(body: &Body) -> f32 {
    (body.rotation * Vec3::Y).y
}

/// The least height of the centers of mass of all dynamic bodies (m).
pub fn lowest(world: &World) -> f32 {
    world.dynamic().map(|body| body.center_of_mass().y).fold(f32::INFINITY, f32::min)
}

/// The speed of the fastest dynamic body (m/s).
pub fn fastest(world: &World) -> f32 {
    world.dynamic().map(|body| body.linear_velocity.length()).fold(0.0, f32::max)
}

/// Fails unless two numbers are at most `within` apart.
#[track_caller]
pub fn assert_about(found: f32, wanted: f32, within: f32) {
    assert!((found - wanted).abs() <= within, "{found}, not {wanted} within {within}");
}

/// Fails unless two vectors are at most `within` apart.
#[track_caller]
pub fn assert_near(found: Vec3, wanted: Vec3, within: f32) {
    let apart = found.distance(wanted);
    assert!(apart <= within, "{found}, not {wanted} within {within}, but {apart}");
}

/// Fails unless the quaternions of two rotations differ by at most `within`.
#[track_caller]
pub fn assert_turned(found: Quat, wanted: Quat, within: f32) {
    let apart = (found - wanted).length().min((found + wanted).length());
    assert!(apart <= within, "{found}, not {wanted} within {within}, but {apart}");
}
