//! Bodies that are held or slowed, each in its own way, with a closed form for each.

use glam::{IVec3, Vec3};

use crate::scene::Scene;
use drystone::{Body, Joint, Result, Shape, World};

/// Stiffness of the spring of the lamp (N/m), its damping (N s/m), and the largest speed of the slow ball (m/s).
const SPRING: (f32, f32) = (200.0, 20.0);
const SLOW: f32 = 2.0;

/// From the left to the right: a damped ball and one with a largest speed fall, an arm that is pushed aside leans on its
/// cone, a flag hangs under the load of its hinge, a lamp hangs on its spring, and a crate that keeps its plane and its
/// rotation slides down stairs of voxels. `damping` is a rate (1/s), `cone` an angle (degrees), and `load` the torque as a
/// share of what lifts the flag level.
pub(super) fn held(damping: f32, cone: f32, load: f32) -> Result<Scene> {
    let mut world = World::new();
    world.insert(Body::fixed().named("ground").shape(Shape::half_space(Vec3::Y)));
    let ball = |name: &str, x: f32| Body::dynamic().named(name).shape(Shape::ball(0.25)).position(x, 8.0, 0.0);
    world.insert(ball("damped", -5.0).linear_damping(damping));
    world.insert(ball("slow", -4.0).max_speeds(SLOW, f32::INFINITY));
    // Arms and the flag hang with their centers half a meter from a point of the beam, and come to rest by damping.
    let beam = Body::fixed().named("beam").shape(Shape::cuboid(3.0, 0.1, 0.1));
    world.insert(beam.position(-0.5, 3.3, 0.0));
    let hanging = |name: &str, x: f32| {
        let body = Body::dynamic().named(name).shape(Shape::cuboid(0.1, 0.45, 0.2)).total_mass(4.0);
        body.position(x, 2.5, 0.0).linear_damping(3.0).angular_damping(3.0)
    };
    let point = Vec3::new(-2.5, 3.0, 0.0);
    let arm = world.insert(hanging("arm", point.x));
    world.bodies[arm].force = Vec3::new(0.6, 0.0, 0.8) * (3.0 * 4.0 * 9.81);
    let shoulder = Joint::to_world(arm, point, point).along(Vec3::Y).in_world(&world);
    world.insert_joint(shoulder);
    world.insert_joint(shoulder.cone(cone.to_radians()));
    let point = Vec3::new(-0.5, 3.0, 0.0);
    let flag = world.insert(hanging("flag", point.x));
    let hinge = Joint::to_world(flag, point, point).hinge(Vec3::Z).in_world(&world);
    world.insert_joint(hinge.constant_load(load * 4.0 * 9.81 * 0.5));
    let point = Vec3::new(1.5, 2.5, 0.0);
    let lamp =
        world.insert(Body::dynamic().named("lamp").shape(Shape::ball(0.2)).total_mass(4.0).position(1.5, 2.5, 0.0));
    let slider = Joint::to_world(lamp, point, point).slider(Vec3::Y).in_world(&world);
    world.insert_joint(slider.spring_damper(0.0, SPRING.0, SPRING.1));
    // Six steps down to the right.
    let cells: Vec<IVec3> = (0..6).flat_map(|step| (0..6 - step).map(move |y| IVec3::new(step, y, 0))).collect();
    let stairs = Body::fixed().named("stairs").shape(Shape::voxels(Vec3::new(0.6, 0.3, 2.0), &cells)?);
    world.insert(stairs.position(3.0, 0.0, -1.0).friction(0.01));
    let sled = Body::dynamic().named("crate").shape(Shape::cuboid(0.2, 0.15, 0.3)).friction(0.01);
    let sled = sled.locked_translations([false, false, true]).locked_rotations([true; 3]);
    world.insert(sled.position(3.3, 1.95, 0.0).velocity(Vec3::X * 1.5, Vec3::ZERO));
    Ok(Scene::new("held", world, 600))
}
