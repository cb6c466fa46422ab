//! A rotating drum.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::Vec3;

use super::common::centered;
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Shape, World};

/// Side of a box (m).
const SIDE: f32 = 0.2;
/// Share of the drum's volume in boxes.
const FILL: f32 = 0.2;
const STAVES: u16 = 12;

/// `n` boxes of 0.2 m in a hollow drum that turns about the horizontal axis z with `speed` (rad/s). The drum is one
/// kinematic body of twelve staves and two ends. It is as long inside as its radius, and a fifth full.
pub(super) fn drum(n: usize, speed: f32) -> Scene {
    let mut radius = libm::cbrtf(n as f32 * (SIDE * SIDE * SIDE) / (FILL * TAU / 2.0)).max(5.0 * SIDE);
    let mut places = grid(radius);
    // A small drum has room for fewer boxes.
    while places.len() < n {
        radius *= 1.05;
        places = grid(radius);
    }
    let mut world = World::new();
    world.insert(hollow(radius).velocity(Vec3::ZERO, speed * Vec3::Z));
    let cube = Body::dynamic().shape(Shape::cuboid(SIDE / 2.0, SIDE / 2.0, SIDE / 2.0));
    for Vec3 { x, y, z } in places.into_iter().take(n) {
        world.insert(cube.clone().position(x, y, z));
    }
    let corner = radius / libm::cosf(TAU / 2.0 / f32::from(STAVES));
    let reach = Vec3::new(corner, corner, radius / 2.0);
    Scene { container: Some((-reach, reach)), ..Scene::new("drum", world, 600) }
}

/// A drum with this inner radius, around the origin.
fn hollow(radius: f32) -> Body {
    // Half of the thickness of staves and ends.
    let half = 0.1 * radius;
    let width = (radius + 2.0 * half) * libm::tanf(TAU / 2.0 / f32::from(STAVES));
    let stave = Shape::cuboid(half, width, radius / 2.0 + 2.0 * half);
    let mut body = Body::kinematic().named("drum");
    for k in 0..STAVES {
        let turn = about(Vec3::Z, TAU * f32::from(k) / f32::from(STAVES));
        body = body.shape_at(stave.clone(), turn * ((radius + half) * Vec3::X), turn);
    }
    let end = Shape::cylinder(half, radius + 2.0 * half);
    for z in [radius / 2.0 + half, -radius / 2.0 - half] {
        body = body.shape_at(end.clone(), z * Vec3::Z, about(Vec3::X, FRAC_PI_2));
    }
    body
}

/// Grid places for boxes inside the drum, 1.2 sides apart, in ascending order of height.
fn grid(radius: f32) -> Vec<Vec3> {
    const PITCH: f32 = 1.2 * SIDE;
    let half = PITCH / 2.0;
    let (across, along) = ((2.0 * radius / PITCH) as usize, (radius / PITCH) as usize);
    let at = |k: usize, n: usize| centered(k, n) as f32 * PITCH;
    let mut places = Vec::new();
    for y in (0..across).map(|k| at(k, across)) {
        let inside = |&x: &f32| libm::hypotf(x.abs() + half, y.abs() + half) < radius;
        for x in (0..across).map(|k| at(k, across)).filter(inside) {
            places.extend((0..along).map(|k| Vec3::new(x, y, at(k, along))));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drums_of_every_size_hold_all_their_boxes() {
        for n in [1, 2, 50, 200, 5000] {
            let scene = drum(n, 1.0);
            assert_eq!((scene.world.dynamic_count(), scene.escaped(&scene.world)), (n, 0));
        }
    }

    #[test]
    fn the_drum_is_closed_all_around() {
        let drum = hollow(2.0);
        let solid = |p: Vec3| {
            let inside = |c: &drystone::world::Collider| {
                c.shape.parry().contains_point(&drystone::stages::world::pose(c.position, c.rotation), p)
            };
            drum.colliders.iter().any(inside)
        };
        for k in 0..360_u16 {
            let direction = glam::Quat::from_rotation_z(f32::from(k).to_radians()) * Vec3::X;
            assert!(solid(2.1 * direction) && !solid(1.99 * direction));
        }
        assert!(solid(Vec3::new(0.5, 0.5, 1.1)) && !solid(Vec3::new(0.5, 0.5, 0.99)));
    }
}
