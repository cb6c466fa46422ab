//! Scenes of joints with axes: four-bar linkage, drawbridge, car, ragdolls; and a press.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Quat, Vec3};

use super::common::floor;
use crate::scene::Scene;
use drystone::stages::math::{about, arc, product};
use drystone::{Axis, Body, BodyHandle, Bounds, Drive, Joint, Linear, MassProperties, Shape, World};

/// A crank, a coupler and a rocker in the plane z = 0. Hinges join them to each other and to two points of the world
/// 0.5 m apart. A motor turns the crank at `speed` (rad/s).
pub(super) fn four_bar(speed: f32) -> Scene {
    const GROUND: f32 = 0.5;
    const CRANK: f32 = 0.2;
    const COUPLER: f32 = 0.5;
    const ROCKER: f32 = 0.4;
    let mut world = World::new();
    // The crank starts upright. The rocker ends where the coupler reaches it.
    let (left, right) = (Vec3::ZERO, GROUND * Vec3::X);
    let top = CRANK * Vec3::Y;
    let across = right - top;
    let along = (across.length_squared() + COUPLER * COUPLER - ROCKER * ROCKER) / (2.0 * across.length());
    let up = (COUPLER * COUPLER - along * along).sqrt();
    let end = top + across.normalize() * along + Vec3::Z.cross(across.normalize()) * up;
    let mut bar = |name: &str, from: Vec3, to: Vec3| {
        let (length, Vec3 { x, y, z }) = (from.distance(to), 0.5 * (from + to));
        let turned = arc(Vec3::X, (to - from) / length);
        let bar = Body::dynamic().named(name).shape(Shape::cuboid(0.5 * length, 0.02, 0.02)).rotation(turned);
        (world.insert(bar.position(x, y, z)), 0.5 * length * Vec3::X)
    };
    let (crank, half_crank) = bar("crank", left, top);
    let (coupler, half_coupler) = bar("coupler", top, end);
    let (rocker, half_rocker) = bar("rocker", right, end);
    world.insert_joint(Joint::to_world(crank, -half_crank, left).hinge(Vec3::Z).motor(speed, 100.0));
    world.insert_joint(Joint::new(coupler, -half_coupler, crank, half_crank).hinge(Vec3::Z));
    world.insert_joint(Joint::to_world(rocker, -half_rocker, right).hinge(Vec3::Z));
    world.insert_joint(Joint::new(rocker, half_rocker, coupler, half_coupler).hinge(Vec3::Z));
    Scene::new("four-bar", world, 600)
}

/// A deck of 4 m, hinged to a tower, with a crate of `load` kg on it. Two winches pull its far end up by ropes.
pub(super) fn drawbridge(load: f32) -> Scene {
    const LENGTH: f32 = 4.0;
    const WIDTH: f32 = 1.0;
    /// Largest angle of the deck (rad). A friction of 1 holds the crate there.
    const STEEPEST: f32 = 0.6;
    /// The speed of the ropes (m/s), and the largest force of each (N).
    const WINCH: (f32, f32) = (-0.4, 2e4);
    let mut world = World::new();
    let tower = Body::fixed().named("tower").shape(Shape::cuboid(0.5, 3.0, 1.5)).position(-0.6, 1.0, 0.0);
    let tower = world.insert(tower);
    let deck =
        Body::dynamic().named("deck").shape(Shape::cuboid(0.5 * LENGTH, 0.1, WIDTH)).density(500.0).friction(1.0);
    let deck = world.insert(deck.position(0.5 * LENGTH, 0.0, 0.0));
    let hinge = Joint::new(deck, -0.5 * LENGTH * Vec3::X, tower, Vec3::new(0.6, -1.0, 0.0)).hinge(Vec3::Z);
    world.insert_joint(hinge.limited(0.0, STEEPEST));
    for z in [-WIDTH, WIDTH] {
        let (on_deck, on_tower) = (Vec3::new(0.5 * LENGTH, 0.1, z), Vec3::new(0.6, 3.0, z));
        let longest = Vec3::new(LENGTH, 0.1, z).distance(Vec3::new(0.0, 4.0, z));
        let rope = Axis::limited(0.0, longest).motor(WINCH.0, WINCH.1);
        world.insert_joint(Joint::new(deck, on_deck, tower, on_tower).at_distance(rope));
    }
    if load > 0.0 {
        let crate_ = Body::dynamic().named("crate").shape(Shape::cuboid(0.3, 0.3, 0.3)).total_mass(load).friction(1.0);
        world.insert(crate_.position(0.8, 0.4, 0.0));
    }
    Scene::new("drawbridge", world, 600)
}

/// A chassis of 1200 kg on four sprung wheels. Motors turn the rear wheels so that it drives along x at `speed` (m/s),
/// over bumps. `inside` is the depth of the wheels in the chassis, if they overlap it (m).
pub(super) fn car(speed: f32, inside: f32) -> Scene {
    const RADIUS: f32 = 0.35;
    const CHASSIS: f32 = 1200.0;
    const WHEEL: f32 = 30.0;
    /// Frequency of the chassis on its springs (Hz), and their damping ratio.
    const RIDE: (f32, f32) = (1.5, 0.4);
    let mut world = floor(200.0, 10.0);
    world.bodies[0].material.friction = 1.0;
    for k in 0..8 {
        let bump = Body::fixed().named("bump").shape(Shape::cylinder(5.0, 0.5)).friction(1.0);
        let lies = about(Vec3::X, FRAC_PI_2);
        world.insert(bump.rotation(lies).position(8.0 + 3.0 * k as f32, -0.44, 0.0));
    }
    let half_width = if inside > 0.0 { 0.78 + inside } else { 0.7 };
    let chassis = Body::dynamic().named("chassis").shape(Shape::cuboid(1.8, 0.3, half_width)).total_mass(CHASSIS);
    let chassis = world.insert(chassis.position(0.0, 0.75, 0.0));
    let omega = TAU * RIDE.0;
    let sag = 9.81 / (omega * omega);
    let (stiffness, damping) = (0.25 * CHASSIS * omega * omega, 0.5 * CHASSIS * omega * RIDE.1);
    for (x, z) in [(1.3, -0.9), (1.3, 0.9), (-1.3, -0.9), (-1.3, 0.9)] {
        let turned = about(Vec3::X, FRAC_PI_2);
        let wheel = Body::dynamic().named("wheel").shape(Shape::cylinder(0.12, RADIUS)).total_mass(WHEEL).friction(1.0);
        let wheel = world.insert(wheel.rotation(turned).position(x, RADIUS, z));
        let spring = Axis::limited(-0.15, 0.15).spring_damper(-sag, stiffness, damping, f32::MAX);
        let spin = if x < 0.0 { Axis::FREE.motor(-speed / RADIUS, 800.0) } else { Axis::FREE };
        let place = Vec3::new(x, RADIUS - 0.75, z);
        let joint = |body: BodyHandle| Joint::new(body, Vec3::ZERO, chassis, place).along(Vec3::Z);
        if inside > 0.0 {
            // The wheel has its own axle, so it collides with the chassis.
            let mass = 0.5 * WHEEL;
            let axle =
                MassProperties { mass, principal_inertia: Vec3::splat(0.02 * mass), ..MassProperties::IMMOVABLE };
            let axle = world.insert(Body::dynamic().named("axle").mass_properties(axle).position(x, RADIUS, z));
            world.insert_joint(joint(axle).generic([Axis::LOCKED, spring, Axis::LOCKED], [Axis::LOCKED; 3]));
            let hinge = Joint::new(wheel, Vec3::ZERO, axle, Vec3::ZERO).along(Vec3::Z).zero_at(turned, Quat::IDENTITY);
            world.insert_joint(hinge.generic([Axis::LOCKED; 3], [spin, Axis::LOCKED, Axis::LOCKED]));
            continue;
        }
        let joint = joint(wheel).zero_at(turned, Quat::IDENTITY);
        world.insert_joint(joint.generic([Axis::LOCKED, spring, Axis::LOCKED], [spin, Axis::LOCKED, Axis::LOCKED]));
    }
    Scene::new("car", world, 600)
}

/// A part of a ragdoll: name, center, half of its length along y, radius; the index of the part that holds it, and the
/// place of the joint.
type Part = (&'static str, [f32; 3], f32, f32, Option<(usize, [f32; 3])>);

/// A trunk of two parts, a head, arms and legs. The left hand is at +z.
const PARTS: [Part; 11] = [
    ("hips", [0.0, 1.0, 0.0], 0.06, 0.13, None),
    ("chest", [0.0, 1.35, 0.0], 0.1, 0.14, Some((0, [0.0, 1.15, 0.0]))),
    ("head", [0.0, 1.72, 0.0], 0.03, 0.1, Some((1, [0.0, 1.58, 0.0]))),
    ("left arm", [0.0, 1.33, 0.24], 0.11, 0.05, Some((1, [0.0, 1.48, 0.22]))),
    ("left forearm", [0.0, 1.03, 0.24], 0.11, 0.04, Some((3, [0.0, 1.18, 0.24]))),
    ("right arm", [0.0, 1.33, -0.24], 0.11, 0.05, Some((1, [0.0, 1.48, -0.22]))),
    ("right forearm", [0.0, 1.03, -0.24], 0.11, 0.04, Some((5, [0.0, 1.18, -0.24]))),
    ("left thigh", [0.0, 0.68, 0.1], 0.14, 0.07, Some((0, [0.0, 0.9, 0.1]))),
    ("left shin", [0.0, 0.25, 0.1], 0.15, 0.05, Some((7, [0.0, 0.46, 0.1]))),
    ("right thigh", [0.0, 0.68, -0.1], 0.14, 0.07, Some((0, [0.0, 0.9, -0.1]))),
    ("right shin", [0.0, 0.25, -0.1], 0.15, 0.05, Some((9, [0.0, 0.46, -0.1]))),
];

/// The axes of the joint that holds a part: rotations about z, along the limb, and sideways. A motor with zero speed
/// acts as friction of the joint.
fn limb(name: &str) -> [Axis; 3] {
    let loose = |axis: Axis, torque: f32| axis.motor(0.0, torque);
    let bend = |min: f32, max: f32| [loose(Axis::limited(min, max), 2.0), Axis::LOCKED, Axis::LOCKED];
    let within = |x: f32, y: f32, z: f32| {
        [loose(Axis::limited(-x, x), 3.0), loose(Axis::limited(-y, y), 1.0), loose(Axis::limited(-z, z), 3.0)]
    };
    match name {
        "chest" => within(0.5, 0.4, 0.3),
        "head" => within(0.6, 0.8, 0.4),
        _ if name.contains("forearm") => bend(0.0, 2.4),
        _ if name.contains("shin") => bend(-2.4, 0.0),
        _ if name.contains("thigh") => {
            [loose(Axis::limited(-0.4, 1.6), 3.0), Axis::limited(-0.4, 0.4), Axis::limited(-0.6, 0.6)]
        }
        _ => [loose(Axis::limited(-1.0, 2.6), 3.0), Axis::limited(-0.8, 0.8), Axis::limited(-0.8, 0.8)],
    }
}

/// `n` ragdolls side by side at the top of 12 stairs along x, pushed forwards.
pub(super) fn ragdoll(n: usize) -> Scene {
    const STEPS: usize = 12;
    const TREAD: f32 = 0.3;
    const RISE: f32 = 0.18;
    // Leave room beside them: a ragdoll that turns as it falls must not leave the stairs.
    let half_width = 0.8 * n as f32 + 1.2;
    let mut world = floor(12.0, half_width);
    let height = RISE * STEPS as f32;
    let landing = Shape::cuboid(1.0, 0.5 * height, half_width);
    world.insert(Body::fixed().named("landing").shape(landing).position(-1.0, 0.5 * height, 0.0));
    for k in 1..STEPS {
        let half = 0.5 * (height - RISE * k as f32);
        let step = Body::fixed().named(format!("step {k}")).shape(Shape::cuboid(0.5 * TREAD, half, half_width));
        world.insert(step.position(TREAD * (k as f32 - 0.5), half, 0.0));
    }
    for i in 0..n {
        let feet = Vec3::new(-0.3, height + 0.01, 1.6 * (i as f32 - 0.5 * (n as f32 - 1.0)));
        // The push acts at the chest.
        let forwards = |y: f32| Vec3::X * (1.5 * y.max(height) - 1.5 * height);
        add_ragdoll(&mut world, |part| feet + part, Quat::IDENTITY, forwards, limb);
    }
    Scene::new("ragdoll", world, 600)
}

/// A ragdoll with rotated parts at positions from `place`. `velocity` is a function of the height of a part, and `axes`
/// returns the axes of the joint that holds a part.
fn add_ragdoll(
    world: &mut World,
    place: impl Fn(Vec3) -> Vec3,
    turn: Quat,
    velocity: impl Fn(f32) -> Vec3,
    axes: impl Fn(&str) -> [Axis; 3],
) {
    let mut parts = Vec::new();
    for (name, middle, half, radius, held) in PARTS {
        let Vec3 { x, y, z } = place(Vec3::from(middle));
        let body = Body::dynamic().named(name).shape(Shape::capsule(half, radius)).density(1000.0).rotation(turn);
        let body = world.insert(body.position(x, y, z).velocity(velocity(y), Vec3::ZERO));
        parts.push(body);
        let Some((holder, at)) = held else { continue };
        let (holder, at) = (parts[holder], place(Vec3::from(at)));
        let on = |body: BodyHandle| turn.inverse() * (at - world.bodies[body].position);
        let joint = Joint::new(body, on(body), holder, on(holder)).along(Vec3::Z);
        let locked = Linear::Axes([Axis::LOCKED; 3]);
        world.insert_joint(Joint { linear: locked, angular: axes(name), ..joint });
    }
}

/// `n` ragdolls, each rotated differently, in rows of five over a floor. All their axes have friction: a leg on the
/// floor would roll to and fro forever.
pub(super) fn ragdolls(n: usize) -> Scene {
    let axes = |name: &str| {
        let is_loose = |axis: &Axis| axis.bounds != Bounds::Locked && axis.drive == Drive::None;
        limb(name).map(|axis| if is_loose(&axis) { axis.motor(0.0, 1.0) } else { axis })
    };
    let mut world = floor(12.0, 12.0 + 0.4 * n as f32);
    for i in 0..n {
        let turns = [(Vec3::X, 0.7 * (i as f32 + 1.0)), (Vec3::Y, 1.3 * i as f32), (Vec3::Z, 0.9 * i as f32)];
        let turn = turns.into_iter().fold(Quat::IDENTITY, |turn, (axis, angle)| product(turn, about(axis, angle)));
        let hips = Vec3::new(2.0 * (i % 5) as f32 - 4.0, 1.5, 2.0 * (i / 5) as f32 - 0.2 * n as f32);
        add_ragdoll(&mut world, |part| hips + turn * (part - Vec3::Y), turn, |_| Vec3::ZERO, axes);
    }
    Scene::new("ragdolls", world, 600)
}

/// A crate of 1 m on the floor, and a press that overlaps it by `depth` (m).
pub(super) fn press(depth: f32) -> Scene {
    let mut world = floor(5.0, 5.0);
    let block = |body: Body| body.shape(Shape::cuboid(0.5, 0.5, 0.5));
    world.insert(block(Body::dynamic()).named("crate").density(1000.0).position(0.0, 0.5, 0.0));
    world.insert(block(Body::kinematic()).named("press").position(0.0, 1.5 - depth, 0.0));
    Scene::new("press", world, 600)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machines_begin_with_closed_joints_within_their_limits() {
        for scene in [four_bar(6.0), drawbridge(100.0), car(5.0, 0.0), ragdoll(3), ragdolls(6)] {
            scene.world.check().expect("a world");
            assert!(scene.world.joint_gap() < 1e-5, "{}: {}", scene.name, scene.world.joint_gap());
            for joint in &scene.world.joints {
                let angles = &scene.world.joint_motion(joint).position[3..];
                let allowed = joint.angular.iter().zip(angles).all(|(axis, angle)| match axis.bounds {
                    drystone::Bounds::Free => true,
                    drystone::Bounds::Locked => angle.abs() < 1e-5,
                    drystone::Bounds::Between { min, max } => (min - 1e-5..=max + 1e-5).contains(angle),
                });
                assert!(allowed || joint.is_ball(), "{}: {angles:?}", scene.name);
            }
        }
    }
}
