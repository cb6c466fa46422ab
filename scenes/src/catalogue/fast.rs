//! Scenes with bodies that move far in a step.

use std::f64::consts::TAU;

use glam::Vec3;

use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::stages::random::SplitMix64;
use drystone::{Body, Result, Shape, World};

/// Half of the side of the terrain (m), and the number of squares along each side.
const HALF: f32 = 10.0;
const SQUARES: u32 = 20;
/// Half of the side of the bullet room (m), and half of the thickness of its walls.
const ROOM: f32 = 3.0;
const SHEET: f32 = 0.0005;

/// Hills of triangles with a high rim. `n` bodies fall on them from `height` and above: thin slabs, coins and balls in
/// turn.
pub(super) fn terrain(n: usize, height: f32, seed: u64) -> Result<Scene> {
    let mut world = World::new();
    world.insert(Body::fixed().named("terrain").shape(hills()?));
    let mut random = SplitMix64::new(seed);
    let mut number = || random.symmetric() as f32;
    for k in 0..n {
        let (name, shape) = match k % 3 {
            0 => ("slab", Shape::cuboid(0.5, 0.03, 0.5)),
            1 => ("coin", Shape::cylinder(0.01, 0.1)),
            _ => ("ball", Shape::ball(0.05)),
        };
        let [x, z, tilt] = [0.6 * HALF * number(), 0.6 * HALF * number(), 0.3 * number()];
        let body = Body::dynamic().named(format!("{name} {k}")).shape(shape).rotation(about(Vec3::X, tilt));
        world.insert(body.position(x, height + 1.5 + 0.1 * k as f32, z));
    }
    let top = height + 2.0 + 0.1 * n as f32;
    let container = Some((Vec3::new(-HALF, -1.0, -HALF), Vec3::new(HALF, top, HALF)));
    Ok(Scene { container, ..Scene::new("terrain", world, 600) })
}

/// Waves in both directions, 1 m high.
fn hills() -> Result<Shape> {
    let side = SQUARES + 1;
    let at = |k: u32| 2.0 * HALF * (k as f32 / SQUARES as f32 - 0.5);
    let wave = |x: f32| libm::sin(TAU * f64::from(x) / 8.0) as f32;
    let vertex = |i: u32| {
        let (x, z) = (at(i % side), at(i / side));
        let rim = 2.0 * (x.abs().max(z.abs()) - 0.7 * HALF).max(0.0);
        Vec3::new(x, 0.5 * wave(x) * wave(z + 1.0) + rim, z)
    };
    let cells = (0..side * side).filter(|i| i % side + 1 < side && i / side + 1 < side);
    let triangles = cells.flat_map(|i| [[i, i + side, i + 1], [i + 1, i + side, i + side + 1]]).collect();
    Shape::mesh((0..side * side).map(vertex).collect(), triangles)
}

/// A room of six sheets of 1 mm. `n` balls of 2 cm, marked as bullets, start in a grid and fly at `speed` (m/s).
pub(super) fn bullets(n: usize, speed: f32, seed: u64) -> Scene {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    for side in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let half = side.abs() * SHEET + (Vec3::ONE - side.abs()) * ROOM;
        let at = -(ROOM + SHEET) * side;
        let sheet = Body::fixed().named("sheet").shape(Shape::cuboid(half.x, half.y, half.z)).friction(0.0);
        world.insert(sheet.restitution(1.0).position(at.x, at.y, at.z));
    }
    let mut random = SplitMix64::new(seed);
    let mut number = || random.symmetric() as f32;
    let rows = (1..).find(|rows| rows * rows * rows >= n).unwrap_or(1);
    for k in 0..n {
        let place = |i: usize| 1.6 * ROOM * ((i % rows) as f32 + 0.5) / rows as f32 - 0.8 * ROOM;
        let way = Vec3::new(number(), number(), number()).normalize_or(Vec3::X);
        let bullet = Body::dynamic().named(format!("bullet {k}")).shape(Shape::ball(0.02)).swept();
        let bullet = bullet.friction(0.0).restitution(1.0).velocity(speed * way, Vec3::ZERO);
        world.insert(bullet.position(place(k), place(k / rows), place(k / rows / rows)));
    }
    let container = Some((Vec3::splat(-ROOM), Vec3::splat(ROOM)));
    Scene { container, ..Scene::new("bullets", world, 300) }
}
