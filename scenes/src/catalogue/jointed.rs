//! Scenes of ball joints: pendulum, chain, bridge, grid.

use glam::Vec3;

use super::common::centered;
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, BodyHandle, Joint, Shape, World};

/// A ball at the end of `length` (m), lifted by `degrees` from its hanging position. Its radius is a tenth of the
/// length, so its period is 0.2 % longer than that of a point mass.
pub(super) fn pendulum(length: f32, degrees: f32) -> Scene {
    let mut world = World::new();
    let turn = about(Vec3::Z, degrees.to_radians());
    let Vec3 { x, y, z } = turn * (-length * Vec3::Y);
    let ball =
        world.insert(Body::dynamic().named("ball").shape(Shape::ball(0.1 * length)).rotation(turn).position(x, y, z));
    world.insert_joint(Joint::to_world(ball, length * Vec3::Y, Vec3::ZERO));
    Scene::new("pendulum", world, 600)
}

/// `links` bars of 0.5 m. One end is held, and the other carries a ball of `ratio` times the mass of a bar. The chain
/// is straight, lifted by `degrees` from its hanging position.
pub(super) fn chain(links: usize, ratio: f32, degrees: f32) -> Scene {
    const HALF: f32 = 0.25;
    const RADIUS: f32 = 0.2;
    let mut world = World::new();
    let turn = about(Vec3::Z, degrees.to_radians());
    let along = turn * -Vec3::Y;
    let link = Body::dynamic().shape(Shape::cuboid(0.05, HALF, 0.05)).rotation(turn);
    let mut above = None;
    let mut hang = |body: Body, half: f32, start: f32| {
        let Vec3 { x, y, z } = along * (start + half);
        let body = world.insert(body.position(x, y, z));
        let top = half * Vec3::Y;
        world.insert_joint(match above.replace(body) {
            None => Joint::to_world(body, top, Vec3::ZERO),
            Some(above) => Joint::new(above, -HALF * Vec3::Y, body, top),
        });
    };
    for k in 0..links {
        hang(link.clone(), HALF, 2.0 * HALF * k as f32);
    }
    let ball = Body::dynamic().named("end").shape(Shape::ball(RADIUS)).total_mass(ratio * link.mass.mass);
    hang(ball.rotation(turn), RADIUS, 2.0 * HALF * links as f32);
    Scene::new("chain", world, 600)
}

/// `planks` of 0.5 x 0.1 x 2 m between two fixed towers, with two ball joints in each seam, along an arc of a circle,
/// and `boxes` of 0.4 m on them. The container ends 0.5 m below the lowest seam: a box that falls off is outside.
pub(super) fn bridge(planks: usize, boxes: usize) -> Scene {
    const PITCH: f32 = 0.5;
    const HALF: Vec3 = Vec3::new(0.24, 0.05, 1.0);
    /// Slope of the planks at the towers (rad).
    const STEEPEST: f64 = 0.25;
    let slope = |k: usize| about(Vec3::Z, (centered(k, planks) * 2.0 * STEEPEST / planks as f64) as f32);
    let step = |k: usize| slope(k) * (PITCH * Vec3::X);
    let end: Vec3 = (0..planks).map(step).sum();
    let mut seam = Vec3::new(-0.5 * end.x, 0.0, 0.0);

    let mut world = World::new();
    let tower = |x: f32| Body::fixed().named("tower").shape(Shape::cuboid(0.5, 2.0, 1.5)).position(x, -1.95, 0.0);
    let left = world.insert(tower(seam.x - 0.5));
    let right = world.insert(tower(0.5 - seam.x));
    let plank = Body::dynamic().shape(Shape::cuboid(HALF.x, HALF.y, HALF.z));
    // Joins the right side of a body, at this place in its frame, to the left side of the next plank.
    let join = |world: &mut World, body: BodyHandle, side: Vec3, next: BodyHandle, next_side: Vec3| {
        for z in [-0.8, 0.8].map(|z| z * Vec3::Z) {
            world.insert_joint(Joint::new(body, side + z, next, next_side + z));
        }
    };
    let half_pitch = 0.5 * PITCH * Vec3::X;
    let (mut before, mut side) = (left, Vec3::new(0.5, 1.95, 0.0));
    let mut lowest = 0.0_f32;
    for k in 0..planks {
        let Vec3 { x, y, z } = seam + 0.5 * step(k);
        let next = world.insert(plank.clone().position(x, y, z).rotation(slope(k)));
        join(&mut world, before, side, next, -half_pitch);
        (before, side) = (next, half_pitch);
        seam += step(k);
        lowest = lowest.min(seam.y);
    }
    join(&mut world, before, side, right, Vec3::new(-0.5, 1.95, 0.0));

    for k in 0..boxes {
        // In the middle of a plank, with the boxes evenly spread.
        let on = right.index() + 1 + (2 * k + 1) * planks / (2 * boxes);
        let Body { position, rotation, .. } = world.bodies[on];
        let Vec3 { x, y, z } = position + rotation * ((HALF.y + 0.2) * Vec3::Y);
        let cube = Body::dynamic().named(format!("box {k}")).shape(Shape::cuboid(0.2, 0.2, 0.2));
        world.insert(cube.position(x, y, z).rotation(rotation));
    }
    let container = Some((Vec3::new(-0.5 * end.x, lowest - 0.5, -HALF.z), Vec3::new(0.5 * end.x, 4.0, HALF.z)));
    Scene { container, ..Scene::new("bridge", world, 600) }
}

/// A plane sheet of `n` x `n` balls. Joints tie each ball to its neighbors, halfway between them, and the first row to
/// the world: the sheet swings down from the horizontal. The ball in the middle of the last row has `ratio` times the
/// mass of the others.
pub(super) fn grid(n: usize, ratio: f32) -> Scene {
    const PITCH: f32 = 0.5;
    let (mut world, mut balls) = (World::new(), Vec::new());
    let ball = |density: f32| Body::dynamic().shape(Shape::ball(0.2)).density(density);
    let heavy = (n - 1) * n + n / 2;
    let (to_x, to_z) = (0.5 * PITCH * Vec3::X, 0.5 * PITCH * Vec3::Z);
    for i in 0..n * n {
        let (column, row) = (i % n, i / n);
        let place = Vec3::new((centered(column, n) * f64::from(PITCH)) as f32, 0.0, PITCH * (row as f32 + 0.5));
        let density = if i == heavy { 1000.0 * ratio } else { 1000.0 };
        let ball = world.insert(ball(density).position(place.x, place.y, place.z));
        if column > 0 {
            world.insert_joint(Joint::new(balls[i - 1], to_x, ball, -to_x));
        }
        world.insert_joint(match i.checked_sub(n) {
            None => Joint::to_world(ball, -to_z, place - to_z),
            Some(above) => Joint::new(balls[above], to_z, ball, -to_z),
        });
        balls.push(ball);
    }
    Scene::new("joint-grid", world, 600)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_is_closed_at_the_start() {
        for degrees in [0.0, 30.0, 90.0, 180.0] {
            for scene in [pendulum(2.0, degrees), chain(20, 10.0, degrees)] {
                assert!(scene.world.joint_gap() < 1e-5, "{}: {}", scene.name, scene.world.joint_gap());
            }
        }
        for scene in [bridge(1, 0), bridge(20, 5), bridge(7, 30), grid(1, 300.0), grid(20, 1.0)] {
            assert!(scene.world.joint_gap() < 1e-5, "{}: {}", scene.name, scene.world.joint_gap());
        }
    }

    #[test]
    fn every_plank_has_four_joints_and_every_ball_of_the_grid_its_neighbors() {
        let count = |scene: Scene| (scene.world.dynamic_count(), scene.world.joints.len());
        assert_eq!(count(bridge(20, 5)), (25, 42));
        assert_eq!(count(grid(20, 1.0)), (400, 20 * 19 + 20 * 20));
        assert_eq!(count(chain(20, 10.0, 90.0)), (21, 21));
    }
}
