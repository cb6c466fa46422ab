//! A vehicle on hills: four sprung wheels, all driven, the front ones steered.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Quat, Vec3};

use crate::driver::{Driver, Turn};
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Axis, Body, Joint, MassProperties, Result, Shape, World};

/// Radius of a wheel (m), wheelbase (m), and the largest torque on a wheel (N m).
const RADIUS: f32 = 0.35;
const WHEELBASE: f32 = 2.6;
const TORQUE: f32 = 300.0;
/// Mass of a wheel (kg), and the places of the wheels on the chassis, the front ones first: half of the wheelbase, half of
/// the track (m).
const WHEEL: f32 = 30.0;
const PLACES: [(f32, f32); 4] =
    [(0.5 * WHEELBASE, -0.9), (0.5 * WHEELBASE, 0.9), (-0.5 * WHEELBASE, -0.9), (-0.5 * WHEELBASE, 0.9)];
/// Mass of the chassis (kg), and its height above level ground (m).
const CHASSIS: f32 = 1200.0;
const HEIGHT: f32 = 0.75;
/// Frequency of the chassis on its springs (Hz), and their damping ratio.
const RIDE: (f32, f32) = (1.5, 0.4);
/// Half of the side of the terrain (m), and the number of cells along it.
const HALF: f32 = 100.0;
const CELLS: usize = 100;

/// A vehicle that drives along x at `speed` (m/s), steered by `degrees` to the left, with `load` kg on its chassis, on
/// hills of the height `hills` (m), with the friction `mu`.
pub(super) fn vehicle(speed: f32, degrees: f32, hills: f32, load: f32, mu: f32) -> Result<Scene> {
    let turn = Turn { speed, steering: degrees.to_radians(), axles: (-0.5 * WHEELBASE, 0.5 * WHEELBASE) };
    let mut world = World::new();
    let size = Vec3::new(2.0 * HALF, 1.0, 2.0 * HALF);
    world.insert(Body::fixed().named("terrain").shape(Shape::height_field(&heights(hills), size)?).friction(mu));
    let mut chassis = Body::dynamic().named("chassis").shape(Shape::cuboid(1.8, 0.3, 0.7)).total_mass(CHASSIS);
    if load > 0.0 {
        chassis = chassis.additional_mass(MassProperties::point(load, Vec3::ZERO));
    }
    let chassis = world.insert(chassis.position(0.0, HEIGHT, 0.0));
    let omega = TAU * RIDE.0;
    let sag = 9.81 / (omega * omega);
    let (stiffness, damping) = (0.25 * CHASSIS * omega * omega, 0.5 * CHASSIS * omega * RIDE.1);
    let turned = about(Vec3::X, FRAC_PI_2);
    for (x, z) in PLACES {
        let wheel = Body::dynamic().named("wheel").shape(Shape::cylinder(0.12, RADIUS)).total_mass(WHEEL).friction(mu);
        let wheel = world.insert(wheel.rotation(turned).position(x, RADIUS, z));
        let spring = Axis::limited(-0.25, 0.25).spring_damper(-sag, stiffness, damping, f32::MAX);
        let (angle, speed) = turn.of_wheel((x, z));
        let steer = if x > 0.0 { Axis::limited(angle, angle) } else { Axis::LOCKED };
        let place = Vec3::new(x, RADIUS - HEIGHT, z);
        let joint = Joint::new(wheel, Vec3::ZERO, chassis, place).along(Vec3::Z).zero_at(turned, Quat::IDENTITY);
        let spin = Axis::FREE.motor(-speed / RADIUS, TORQUE);
        world.insert_joint(joint.generic([Axis::LOCKED, spring, Axis::LOCKED], [spin, steer, Axis::LOCKED]));
    }
    Ok(Scene { driver: Some(Driver::vehicle(chassis)), ..Scene::new("vehicle", world, 600) })
}

/// Rows of heights (m), level around the start.
fn heights(hills: f32) -> Vec<Vec<f32>> {
    let wave = |k: usize, length: f64| {
        let at = 2.0 * f64::from(HALF) * (k as f64 / CELLS as f64 - 0.5);
        libm::cos(std::f64::consts::TAU * at / length) as f32
    };
    let height = |row: usize, column: usize| 0.25 * hills * (1.0 - wave(column, 40.0)) * (1.0 + wave(row, 50.0));
    (0..=CELLS).map(|row| (0..=CELLS).map(|column| height(row, column)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wheels_of_a_vehicle_roll_about_one_center() {
        let turn = Turn { speed: 3.0, steering: 0.4, axles: (-1.3, 1.3) };
        let radius = 2.6 / libm::tanf(0.4);
        for (x, z) in PLACES {
            let (angle, speed) = turn.of_wheel((x, z));
            // The center lies to the left of the middle of the rear axle, and the axle of the wheel points to it.
            let to = Vec3::new(-1.3, 0.0, -radius) - Vec3::new(x, 0.0, z);
            assert!((about(Vec3::Y, angle) * Vec3::NEG_Z).distance(to.normalize()) < 1e-5, "{angle}");
            assert!((speed * radius - 3.0 * to.length()).abs() < 1e-4, "{speed}");
        }
        let scene = vehicle(8.0, 10.0, 0.0, 300.0, 1.0).expect("a scene");
        scene.world.check().expect("a world");
        assert!(scene.world.joint_gap() < 1e-5);
    }
}
