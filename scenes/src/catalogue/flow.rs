//! Scenes with a flow of bodies: bodies appear at one end and leave beyond the other.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;

use super::common::centered;
use crate::scene::Scene;
use crate::spawner::{Leaves, Spawner};
use drystone::stages::math::about;
use drystone::stages::random::SplitMix64;
use drystone::world::Collider;
use drystone::{Body, CombineRule, Groups, Joint, Material, Result, Shape, World};

/// Radius of the rollers of the conveyor (m), and the distance between neighbors.
const ROLLER: f32 = 0.15;
const PITCH: f32 = 0.4;

/// A conveyor of driven rollers, `length` long (m). The tops of the rollers move at `speed` (m/s). A box appears at one
/// end every `every` steps, rides to the other end, falls off and leaves 1 m below.
pub(super) fn conveyor(length: f32, speed: f32, every: u32) -> Result<Scene> {
    let mut world = World::new();
    let rollers = (length / PITCH).ceil() as usize + 1;
    for k in 0..rollers {
        let roller = Body::kinematic().named(format!("roller {k}")).shape(Shape::cylinder(0.5, ROLLER));
        let roller = roller.position(PITCH * k as f32, -ROLLER, 0.0).rotation(about(Vec3::X, FRAC_PI_2));
        world.insert(roller.velocity(Vec3::ZERO, Vec3::NEG_Z * (speed / ROLLER)));
    }
    // A box is three roller distances long, so at least two rollers carry it. Its bottom rises by 1 cm towards both
    // ends: a straight edge would hit each roller a little below its top, and the box would hop by 7 mm at 2 m/s. With
    // the rise it hops by 0.3 mm.
    let mut points = Vec::new();
    for (x, z) in [(-1.0, -0.4), (-1.0, 0.4), (1.0, -0.4), (1.0, 0.4)] {
        for (half, y) in [(1.5 * PITCH, 0.2), (1.5 * PITCH, -0.19), (PITCH, -0.2)] {
            points.push(Vec3::new(x * half, y, z));
        }
    }
    let parcel = Body::dynamic().named("box").shape(Shape::convex_hull(&points)?).density(200.0);
    let parcel = parcel.position(1.5 * PITCH, 0.205, 0.0).velocity(Vec3::X * speed, Vec3::ZERO);
    let first = world.insert(parcel.clone());
    let mut scene = Scene::new("conveyor", world, 900);
    scene.leaving.push((first, below(-1.0)));
    scene.spawners.push(Spawner { leaves: below(-1.0), first: every, ..Spawner::new(parcel, every) });
    Ok(scene)
}

/// Four belts around a square, each of which ends at the side of the next. `n` boxes and balls ride round on them at
/// `speed` (m/s), between two smooth walls. Every third is a ball that resists rolling.
pub(super) fn belts(n: usize, speed: f32) -> Scene {
    const BELTS: f32 = 3.0;
    const HALF_WIDTH: f32 = 0.5;
    let mut world = World::new();
    let (mut belts, mut walls) = (Body::fixed().named("belts"), Body::fixed().named("walls"));
    let slippery = Material { friction: 0.0, friction_rule: Some(CombineRule::Minimum), ..Material::default() };
    for k in 0..4 {
        let side = about(Vec3::Y, -FRAC_PI_2 * k as f32);
        let piece = |half: Vec3, at: Vec3, material: Material| Collider {
            position: side * at,
            rotation: side,
            material: Some(material),
            ..Collider::new(Shape::cuboid(half.x, half.y, half.z))
        };
        let runs = Material { surface_velocity: side * Vec3::X * speed, ..Material::default() };
        let [outer, inner] = [BELTS + HALF_WIDTH, BELTS - HALF_WIDTH];
        belts = belts.collider(piece(Vec3::new(BELTS, 0.1, HALF_WIDTH), Vec3::new(-HALF_WIDTH, -0.1, -BELTS), runs));
        for (half_length, z) in [(outer + 0.1, -outer - 0.05), (inner, -inner + 0.05)] {
            walls = walls.collider(piece(Vec3::new(half_length, 0.3, 0.05), Vec3::new(0.0, 0.2, z), slippery));
        }
    }
    world.insert(belts);
    world.insert(walls);
    for i in 0..n {
        let (lap, along) = (4 * i / n, 4.0 * i as f32 / n as f32);
        let side = about(Vec3::Y, -FRAC_PI_2 * lap as f32);
        let place = side * Vec3::new(2.0 * BELTS * (along - lap as f32) - BELTS, 0.2, -BELTS);
        let rolls = Material { rolling_friction: 0.02, ..Material::default() };
        let body = if i % 3 == 2 {
            Body::dynamic().named("ball").shape(Shape::ball(0.2)).material(rolls)
        } else {
            Body::dynamic().named("box").shape(Shape::cuboid(0.2, 0.2, 0.15)).rotation(side)
        };
        world.insert(body.position(place.x, place.y, place.z));
    }
    Scene::new("belts", world, 900)
}

/// A channel that slopes by 8 degrees. A cross of four arms turns freely about an upright axis in it: a hinge of two
/// ball joints. One of `n` balls appears every `every` steps, rolls down, pushes an arm, rolls off the end and leaves 3
/// m below.
pub(super) fn turnstile(n: u32, every: u32) -> Scene {
    const WIDTH: f32 = 0.9;
    const BALL: f32 = 0.3;
    let slope = about(Vec3::Z, -8_f32.to_radians());
    let place = |x: f32, y: f32, z: f32| slope * Vec3::new(x, y, z);
    // The cross passes through the walls, which collide only with balls.
    let (balls, walls, arms) = (0b001, 0b010, 0b100);
    let groups = |membership: u32, filter: u32| Groups { membership, filter };
    let mut world = World::new();
    let mut board = |name: &str, half: Vec3, at: Vec3| {
        let board = Body::fixed().named(name).shape(Shape::cuboid(half.x, half.y, half.z)).rotation(slope);
        world.insert(board.groups(groups(walls, balls)).position(at.x, at.y, at.z));
    };
    board("floor", Vec3::new(8.0, 0.1, 0.5 * WIDTH), place(-4.0, -0.1, 0.0));
    for (name, z) in [("left", -0.5 * WIDTH - 0.05), ("right", 0.5 * WIDTH + 0.05)] {
        board(name, Vec3::new(8.0, 0.25, 0.05), place(-4.0, 0.15, z));
    }
    // The axis stands in the right wall: arms cross the channel downhill, and return behind the wall.
    let arm = Shape::cuboid(0.94 * WIDTH, 0.2, 0.03);
    let across = about(Vec3::Y, FRAC_PI_2);
    let cross = Body::dynamic().named("cross").shape(arm.clone()).shape_at(arm, Vec3::ZERO, across).total_mass(10.0);
    // Almost no friction: with more, a ball and the wall can jam an arm between them forever.
    let cross = cross.friction(0.02);
    let at = place(0.0, 0.35, 0.5 * WIDTH);
    let cross = world.insert(cross.groups(groups(arms, balls)).position(at.x, at.y, at.z).rotation(slope));
    for y in [-0.5, 0.5] {
        world.insert_joint(Joint::to_world(cross, Vec3::Y * y, at + slope * Vec3::Y * y));
    }
    let at = place(-11.0, BALL + 0.01, 0.0);
    let ball = Body::dynamic().named("ball").shape(Shape::ball(BALL)).density(100.0).groups(groups(balls, u32::MAX));
    let mut scene = Scene::new("turnstile", world, 1300);
    let ball = ball.position(at.x, at.y, at.z);
    scene.spawners.push(Spawner { leaves: below(-3.0), count: Some(n), ..Spawner::new(ball, every) });
    scene
}

/// An upright board. One of `n` balls appears every `every` steps at a random place near the middle, falls past `rows`
/// rows of pins and into one of `rows + 1` bins. A sensor across the board detects every ball, and a sensor in each bin
/// detects the balls of that bin.
pub(super) fn galton(n: u32, rows: usize, every: u32, seed: u64) -> Scene {
    const BALL: f32 = 0.1;
    const PIN: f32 = 0.06;
    const PITCH: f32 = 0.4;
    // From one row of pins to the next, and from the glass to the back, with a little room for a ball.
    const DROP: f32 = 0.4;
    const HALF_DEPTH: f32 = BALL + 0.01;
    let bins = rows + 1;
    // No bin gets more than a third of the balls, and 15 balls fill a meter of a bin.
    let rim = 0.6 + 0.03 * n as f32;
    let half_width = 0.5 * PITCH * bins as f32;
    let lowest = rim + 0.1;
    let gate = lowest + DROP * (rows - 1) as f32 + 1.1;
    let top = gate + 0.5;
    let place = |k: usize, of: usize| PITCH * centered(k, of) as f32;
    let mut world = World::new();
    let mut fixed = |name: &str, [x, y, z]: [f32; 3], at: [f32; 3]| {
        world.insert(Body::fixed().named(name).shape(Shape::cuboid(x, y, z)).position(at[0], at[1], at[2]));
    };
    fixed("floor", [half_width + 0.1, 0.1, HALF_DEPTH + 0.1], [0.0, -0.1, 0.0]);
    for (name, z) in [("back", -HALF_DEPTH - 0.05), ("glass", HALF_DEPTH + 0.05)] {
        fixed(name, [half_width + 0.1, 0.5 * top, 0.05], [0.0, 0.5 * top, z]);
    }
    for (name, x) in [("left", -half_width - 0.05), ("right", half_width + 0.05)] {
        fixed(name, [0.05, 0.5 * top, HALF_DEPTH], [x, 0.5 * top, 0.0]);
    }
    for k in 0..rows {
        fixed("divider", [0.02, 0.5 * rim, HALF_DEPTH], [place(k, rows), 0.5 * rim, 0.0]);
    }
    // The lowest row has a pin above each divider, and the pins of each row above are over the gaps of the row below.
    // The rows end one pitch from the walls, so that no ball gets stuck there.
    let mut pins = Body::fixed().named("pins");
    let lying = about(Vec3::X, FRAC_PI_2);
    for row in 0..rows {
        let count = if row % 2 == 0 { rows } else { rows - 1 };
        for k in 0..count {
            let at = Vec3::new(place(k, count), lowest + DROP * row as f32, 0.0);
            pins = pins.shape_at(Shape::cylinder(HALF_DEPTH, PIN), at, lying);
        }
    }
    world.insert(pins);
    for k in 0..bins {
        let half = Vec3::new(0.5 * PITCH - 0.02, 0.5 * rim - 0.1, HALF_DEPTH);
        let bin = Body::fixed().named(format!("bin {}", k + 1)).sensor(Shape::cuboid(half.x, half.y, half.z));
        world.insert(bin.position(place(k, bins), half.y, 0.0));
    }
    let across = Body::fixed().named("gate").sensor(Shape::cuboid(half_width, 0.05, HALF_DEPTH));
    world.insert(across.position(0.0, gate, 0.0));

    let corner = Vec3::new(half_width, 0.0, HALF_DEPTH);
    let mut scene = Scene::new("galton", world, n * every + 300);
    scene.container = Some((-corner, corner.with_y(top)));
    let mut random = SplitMix64::new(seed);
    let ball = Body::dynamic().named("ball").shape(Shape::ball(BALL)).restitution(0.3).friction(0.1);
    for k in 0..n {
        let x = 0.25 * PITCH * random.symmetric() as f32;
        let ball = ball.clone().position(x, top - BALL - 0.05, 0.0);
        scene.spawners.push(Spawner { first: k * every, count: Some(1), ..Spawner::new(ball, 1) });
    }
    scene
}

fn below(height: f32) -> Leaves {
    Leaves { below: Some(height), after: None }
}
