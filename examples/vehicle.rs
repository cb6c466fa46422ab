//! Builds a vehicle of a chassis and four wheels, and drives it over waves: straight on, a curve to the left, and brakes.
//! The wheels are bodies on joints, so a driver changes motors and limits of the joints.
//!
//!     cargo run --release --example vehicle

use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, BodyHandle, Joint, JointHandle, Result, Shape, Simulation, World};

const RADIUS: f32 = 0.35;
const WHEELBASE: f32 = 2.6;
const TRACK: f32 = 1.8;
const CHASSIS: f32 = 1200.0;
/// Stiffness (N/m) and damping (N s/m) of the spring of each wheel.
const SPRING: (f32, f32) = (26_000.0, 2300.0);

fn main() -> Result<()> {
    run(|line| println!("{line}"))
}

/// A wheel: its place on the chassis (m) and its joint.
struct Wheel {
    x: f32,
    z: f32,
    joint: JointHandle,
}

/// The world, the chassis and the wheels.
fn build() -> Result<(World, BodyHandle, Vec<Wheel>)> {
    let mut world = World::new();
    // Waves of 10 cm, 20 m long.
    let height = |column: usize| 0.05 * (1.0 - (column as f32 * 0.2 * std::f32::consts::PI).cos());
    let rows = vec![(0..=100).map(height).collect(); 101];
    world.insert(Body::fixed().shape(Shape::height_field(&rows, Vec3::new(200.0, 1.0, 200.0))?).friction(1.0));
    let chassis = Body::dynamic().named("chassis").shape(Shape::cuboid(1.8, 0.3, 0.7)).total_mass(CHASSIS);
    let chassis = world.insert(chassis.position(0.0, 0.85, 0.0));
    // The axle of a cylinder is its y axis.
    let turned = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let mut wheels = Vec::new();
    for (ahead, right) in [(0.5, -0.5), (0.5, 0.5), (-0.5, -0.5), (-0.5, 0.5)] {
        let (x, z) = (ahead * WHEELBASE, right * TRACK);
        let at = Vec3::new(x, RADIUS + 0.1, z);
        let wheel = Body::dynamic().shape(Shape::cylinder(0.12, RADIUS)).total_mass(30.0).friction(1.0);
        let wheel = world.insert(wheel.rotation(turned).position(at.x, at.y, at.z));
        // The axle is along z, the spring along the next axis of the joint, upward. The front wheels steer about it.
        let spring = Axis::limited(-0.25, 0.25).spring_damper(-0.11, SPRING.0, SPRING.1, f32::MAX);
        let steer = if x > 0.0 { Axis::limited(0.0, 0.0) } else { Axis::LOCKED };
        let joint = Joint::new(wheel, at, chassis, at).along(Vec3::Z).in_world(&world);
        let joint = joint.generic([Axis::LOCKED, spring, Axis::LOCKED], [Axis::FREE, steer, Axis::LOCKED]);
        wheels.push(Wheel { x, z, joint: world.insert_joint(joint) });
    }
    Ok((world, chassis, wheels))
}

/// Sets the speed (m/s) and the largest torque (N m) of each wheel, and the angle of the front axle (rad). The axles of
/// all wheels pass through the center of one circle, and the wheels roll about it.
fn drive(world: &mut World, wheels: &[Wheel], (speed, torque, angle): (f32, f32, f32)) {
    let curvature = angle.tan() / WHEELBASE;
    for wheel in wheels {
        let Some(joint) = world.joint_mut(wheel.joint) else { continue };
        let (ahead, across) = (curvature * (wheel.x + 0.5 * WHEELBASE), 1.0 + curvature * wheel.z);
        let [spin, steer, _] = &mut joint.angular;
        *spin = spin.motor(-speed / RADIUS * ahead.hypot(across), torque);
        if wheel.x > 0.0 {
            let angle = ahead.atan2(across);
            *steer = Axis::limited(angle, angle);
        }
    }
}

pub fn run(mut print: impl FnMut(String)) -> Result<()> {
    let (world, chassis, wheels) = build()?;
    let mut simulation = Simulation::new(world)?;
    for step in 0..600 {
        let drives = match step {
            0..60 => (0.0, 300.0, 0.0),
            60..240 => (10.0, 300.0, 0.0),
            // The wheels turn by 0.1 rad/s.
            240..480 => (10.0, 300.0, (0.1 * (step - 240) as f32 / 60.0).min(0.15)),
            _ => (0.0, 1000.0, 0.15),
        };
        drive(&mut simulation.world, &wheels, drives);
        simulation.step(1.0 / 60.0)?;
        if step % 60 == 59 {
            let world = &simulation.world;
            let body = &world.bodies[chassis];
            let Vec3 { x, y, z } = body.position;
            let joints = wheels.iter().filter_map(|wheel| world.joint(wheel.joint));
            let travel = joints.map(|joint| format!("{:.0}", 1e3 * world.joint_motion(joint).position[1]));
            let (travel, speed) = (travel.collect::<Vec<_>>().join(", "), body.linear_velocity.length());
            let second = (step + 1) / 60;
            print(format!("{second:2} s: {x:6.2}, {y:5.2}, {z:6.2} m, {speed:4.1} m/s, springs {travel} mm"));
        }
    }
    Ok(())
}
