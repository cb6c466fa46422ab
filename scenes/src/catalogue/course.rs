//! A course for a character: stairs, a ramp, a turntable, crates, and a slope that is too steep.

use glam::Vec3;

use super::common::floor;
use crate::driver::Driver;
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Shape, World};

/// Rise and tread of the stairs (m), and their number.
const RISE: f32 = 0.18;
const TREAD: f32 = 0.3;
const STAIRS: usize = 6;
/// Half of the width of the course (m).
const WIDTH: f32 = 3.0;

/// A course along x, and a capsule of 1.8 m at its beginning. The turntable has the angular speed `spin` (rad/s).
pub(super) fn course(spin: f32) -> Scene {
    let mut world = floor(24.0, 2.0 * WIDTH);
    let block = |world: &mut World, name: &str, half: Vec3, at: Vec3| {
        world.insert(Body::fixed().named(name).shape(Shape::cuboid(half.x, half.y, half.z)).position(at.x, at.y, at.z))
    };
    let top = RISE * STAIRS as f32;
    let landing = 2.0 + TREAD * STAIRS as f32;
    for k in 0..STAIRS {
        let half = 0.5 * RISE * (k + 1) as f32;
        let at = Vec3::new(2.0 + TREAD * (k as f32 + 0.5), half, 0.0);
        block(&mut world, "stair", Vec3::new(0.5 * TREAD, half, WIDTH), at);
    }
    block(&mut world, "landing", Vec3::new(1.0, 0.5 * top, WIDTH), Vec3::new(landing + 1.0, 0.5 * top, 0.0));
    slope(&mut world, -30.0, Vec3::new(landing + 2.0, top, 0.0), 2.0 * top);
    let turntable = Body::kinematic().named("turntable").shape(Shape::cylinder(0.1, 2.0)).position(10.5, 0.1, 0.0);
    world.insert(turntable.velocity(Vec3::ZERO, spin * Vec3::Y));
    for z in [-0.7, 0.0, 0.7] {
        let crate_ = Body::dynamic().named("crate").shape(Shape::cuboid(0.3, 0.3, 0.3)).total_mass(30.0);
        world.insert(crate_.position(14.0, 0.3, z));
    }
    slope(&mut world, 50.0, Vec3::new(20.0, 0.0, 0.0), 3.0);
    let capsule = Shape::capsule(0.6, 0.3);
    let character = world.insert(Body::kinematic().named("character").shape(capsule).position(0.0, 0.906, 0.0));
    Scene { driver: Some(Driver::character(character)), ..Scene::new("course", world, 900) }
}

/// A slope with its upper face from `begin` on, with this length (m) and rise in degrees along x.
fn slope(world: &mut World, degrees: f32, begin: Vec3, length: f32) {
    let turn = about(Vec3::Z, degrees.to_radians());
    let at = begin + turn * Vec3::new(0.5 * length, -0.1, 0.0);
    let slope = Body::fixed().named("slope").shape(Shape::cuboid(0.5 * length, 0.1, WIDTH)).rotation(turn);
    world.insert(slope.position(at.x, at.y, at.z));
}
