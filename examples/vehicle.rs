//! Drives the vehicle of the catalogue over hills: straight on, a curve to the left, and brakes. The wheels are bodies
//! on joints, so a driver changes motors and limits of the joints.
//!
//!     cargo run --release --example vehicle

use drystone::glam::Vec3;
use drystone::{Axis, Body, Joint, Reference, Result, Simulation, SolverConfig};
use drystone_scenes::Scene;

const RADIUS: f32 = 0.35;
const WHEELBASE: f32 = 2.6;

fn main() -> Result<()> {
    run(|line| println!("{line}"))
}

/// Sets the speed (m/s) and the largest torque (N m) of each wheel, and the angle of the front axle (rad). The axles of
/// all wheels pass through the center of one circle, and the wheels roll about it.
fn drive(joint: &mut Joint, speed: f32, torque: f32, angle: f32) {
    // The wheel in the frame of the chassis.
    let Vec3 { x, z, .. } = joint.anchor_b;
    let curvature = angle.tan() / WHEELBASE;
    let (ahead, across) = (curvature * (x + 0.5 * WHEELBASE), 1.0 + curvature * z);
    let [spin, steer, _] = &mut joint.angular;
    *spin = spin.motor(-speed / RADIUS * ahead.hypot(across), torque);
    if x > 0.0 {
        let angle = ahead.atan2(across);
        *steer = Axis::limited(angle, angle);
    }
}

pub fn run(mut print: impl FnMut(String)) -> Result<()> {
    let scene = Scene::find("vehicle", &["steering=0".into(), "speed=0".into()])?;
    let mut simulation = Simulation::with(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    for step in 0..600 {
        let (speed, torque, angle) = match step {
            0..60 => (0.0, 300.0, 0.0),
            60..240 => (10.0, 300.0, 0.0),
            // The wheels turn by 0.1 rad/s.
            240..480 => (10.0, 300.0, (0.1 * (step - 240) as f32 / 60.0).min(0.15)),
            _ => (0.0, 1000.0, 0.15),
        };
        simulation.world.joints.iter_mut().for_each(|joint| drive(joint, speed, torque, angle));
        simulation.step(scene.dt)?;
        if step % 60 == 59 {
            let is_chassis = |body: &&Body| body.name == "chassis";
            let Some(chassis) = simulation.world.bodies.iter().find(is_chassis) else { return Ok(()) };
            let Vec3 { x, y, z } = chassis.position;
            let travel = simulation.world.joints.iter().map(|joint| simulation.world.joint_motion(joint).position[1]);
            let travel = travel.map(|way| format!("{:.0}", 1e3 * way)).collect::<Vec<_>>().join(", ");
            let speed = chassis.linear_velocity.length();
            print(format!(
                "{:2} s: {x:6.2}, {y:5.2}, {z:6.2} m, {speed:4.1} m/s, springs {travel} mm",
                (step + 1) / 60
            ));
        }
    }
    Ok(())
}
