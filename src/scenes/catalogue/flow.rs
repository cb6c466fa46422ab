//! Scenes through which bodies flow: they come at one end and leave behind the other.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;

use crate::math::rotation::about;
use crate::scenes::scene::Scene;
use crate::scenes::spawner::{Leaves, Spawner};
use crate::world::{Body, Groups, Joint, Shape, World};

/// Radius of the rollers of the conveyor (m), and the distance from one to the next.
const ROLLER: f32 = 0.15;
const PITCH: f32 = 0.4;

/// A conveyor of driven rollers, `length` long (m), whose tops move at `speed` (m/s). A box comes at one end every `every` steps, rides to the
/// other end, falls off and leaves 1 m below.
pub(super) fn conveyor(length: f32, speed: f32, every: u32) -> Scene {
    let mut world = World::new();
    let rollers = (length / PITCH).ceil() as usize + 1;
    for k in 0..rollers {
        let roller = Body::kinematic().named(format!("roller {k}")).shape(Shape::cylinder(0.5, ROLLER));
        let roller = roller.position(PITCH * k as f32, -ROLLER, 0.0).rotation(about(Vec3::X, FRAC_PI_2));
        world.add(roller.velocity(Vec3::ZERO, Vec3::NEG_Z * (speed / ROLLER)));
    }
    // As long as the distance of three rollers, so that two or more bear it.
    let parcel = Body::dynamic().named("box").shape(Shape::cuboid(1.5 * PITCH, 0.2, 0.4)).density(200.0);
    let parcel = parcel.position(1.5 * PITCH, 0.205, 0.0).velocity(Vec3::X * speed, Vec3::ZERO);
    let first = world.add(parcel.clone());
    let mut scene = Scene::new("conveyor", world, 900);
    scene.leaving.push((first, below(-1.0)));
    scene.spawners.push(Spawner { leaves: below(-1.0), first: every, ..Spawner::new(parcel, every) });
    scene
}

/// A channel that slopes by 8 degrees, across which a cross of four arms turns freely about an upright axis: a hinge of two ball joints. One of `n`
/// balls comes every `every` steps, rolls down, pushes an arm on, rolls off the end and leaves 3 m below.
pub(super) fn turnstile(n: u32, every: u32) -> Scene {
    const WIDTH: f32 = 0.9;
    const BALL: f32 = 0.3;
    let slope = about(Vec3::Z, -8_f32.to_radians());
    let place = |x: f32, y: f32, z: f32| slope * Vec3::new(x, y, z);
    // The cross passes through the walls, which meet balls alone.
    let (balls, walls, arms) = (0b001, 0b010, 0b100);
    let groups = |membership: u32, filter: u32| Groups { membership, filter };
    let mut world = World::new();
    let mut board = |name: &str, half: Vec3, at: Vec3| {
        let board = Body::fixed().named(name).shape(Shape::cuboid(half.x, half.y, half.z)).rotation(slope);
        world.add(board.groups(groups(walls, balls)).position(at.x, at.y, at.z));
    };
    board("floor", Vec3::new(8.0, 0.1, 0.5 * WIDTH), place(-4.0, -0.1, 0.0));
    for (name, z) in [("left", -0.5 * WIDTH - 0.05), ("right", 0.5 * WIDTH + 0.05)] {
        board(name, Vec3::new(8.0, 0.5, 0.05), place(-4.0, 0.4, z));
    }
    // The axis stands in the right wall: arms cross the channel downhill, and go back behind the wall.
    let arm = Shape::cuboid(0.94 * WIDTH, 0.2, 0.03);
    let across = about(Vec3::Y, FRAC_PI_2);
    let cross = Body::dynamic().named("cross").shape(arm.clone()).shape_at(arm, Vec3::ZERO, across).total_mass(10.0);
    let at = place(0.0, 0.35, 0.5 * WIDTH);
    let cross = world.add(cross.groups(groups(arms, balls)).position(at.x, at.y, at.z).rotation(slope));
    for y in [-0.5, 0.5] {
        world.join(Joint::to_world(cross, Vec3::Y * y, at + slope * Vec3::Y * y));
    }
    let at = place(-11.0, BALL + 0.01, 0.0);
    let ball = Body::dynamic().named("ball").shape(Shape::ball(BALL)).density(100.0).groups(groups(balls, u32::MAX));
    let mut scene = Scene::new("turnstile", world, 1300);
    let ball = ball.position(at.x, at.y, at.z);
    scene.spawners.push(Spawner { leaves: below(-3.0), count: Some(n), ..Spawner::new(ball, every) });
    scene
}

fn below(height: f32) -> Leaves {
    Leaves { below: Some(height), after: None }
}
