//! What stands without mortar, or falls in turn: arch, house of cards, dominoes, pyramid under a heavy box.

use std::f64::consts::PI;

use glam::{Quat, Vec3};

use super::Scene;
use super::parts::{centered, floor, unit_box};
use crate::error::Result;
use crate::world::{Body, Shape};

/// A semicircular arch of mean radius 5 m: `voussoirs` wedges, `thickness` of the radius thick and 1 m deep, on two fixed
/// springers, mu 0.6. Statics ask for a thickness of at least 0.1075 (Milankovitch, 1907) where nothing slides.
pub(super) fn arch(voussoirs: usize, thickness: f64) -> Result<Scene> {
    const RADIUS: f64 = 5.0;
    const MU: f32 = 0.6;
    /// Distance between neighbors at the start [m]: of hulls that touch exactly, nothing says which way they touch.
    const GAP: f64 = 1e-4;
    let half = PI / voussoirs as f64 / 2.0;
    let (inner, outer) = (RADIUS * (1.0 - thickness / 2.0), RADIUS * (1.0 + thickness / 2.0));
    // In the frame of a wedge x points out of the arch and y along it.
    let corner = |r: f64, angle: f64, z: f32| Vec3::new((r * angle.cos() - RADIUS) as f32, (r * angle.sin()) as f32, z);
    // Both faces of a wedge are half of the gap further in.
    let slit = |r: f64| half - GAP / 2.0 / r;
    let sides = [(inner, -slit(inner)), (inner, slit(inner)), (outer, -slit(outer)), (outer, slit(outer))];
    let corners: Vec<Vec3> = sides.iter().flat_map(|&(r, a)| [-0.5, 0.5].map(|z| corner(r, a, z))).collect();
    let wedge = Body::dynamic().shape(Shape::convex_hull(&corners)?).friction(MU);

    let mut world = floor(20.0, 10.0);
    let springer = Body::fixed().named("springer").shape(Shape::cuboid((thickness * RADIUS) as f32, 0.5, 1.0));
    for x in [RADIUS as f32, -RADIUS as f32] {
        world.add(springer.clone().friction(MU).position(x, 0.5, 0.0));
    }
    for k in 0..voussoirs {
        let angle = (2 * k + 1) as f64 * half;
        let (x, y) = ((RADIUS * angle.cos()) as f32, (1.0 + GAP / 2.0 + RADIUS * angle.sin()) as f32);
        world.add(wedge.clone().position(x, y, 0.0).rotation(Quat::from_rotation_z(angle as f32)));
    }
    Ok(Scene::new("arch", world, 600).standing())
}

/// A house of `storeys` of cards of 1 x 0.8 x 0.04 m: pairs that lean at each other by `degrees` from the vertical, one
/// pair fewer in each storey, and a plate across the pairs of each storey but the last.
pub(super) fn card_house(storeys: usize, degrees: f64, mu: f32) -> Scene {
    const LENGTH: f64 = 1.0;
    const THICKNESS: f64 = 0.04;
    const HALF_WIDTH: f32 = 0.4;
    let (sin, cos) = degrees.to_radians().sin_cos();
    // From a pair's ridge to the middle of its cards, to the side; from its feet to its highest edges.
    let aside = (THICKNESS * cos + LENGTH * sin) / 2.0;
    let rise = THICKNESS * sin + LENGTH * cos;
    // Feet of neighbors come 0.02 m near.
    let pitch = 2.0 * (LENGTH * sin + THICKNESS * cos) + 0.02;
    let cuboid = |x: f64, y: f64| Body::dynamic().shape(Shape::cuboid(x as f32, y as f32, HALF_WIDTH)).friction(mu);
    let card = cuboid(THICKNESS / 2.0, LENGTH / 2.0);

    let mut world = floor(storeys as f32 + 10.0, 10.0);
    world.bodies[0].material.friction = mu;
    for storey in 0..storeys {
        let (pairs, base) = (storeys - storey, storey as f64 * (rise + THICKNESS));
        let mut place = |body: Body, x: f64, y: f64| world.add(body.position(x as f32, (base + y) as f32, 0.0));
        for k in 0..pairs {
            let ridge = centered(k, pairs) * pitch;
            for side in [-1.0, 1.0] {
                let lean = Quat::from_rotation_z((side * degrees.to_radians()) as f32);
                place(card.clone().rotation(lean), ridge + side * aside, rise / 2.0);
            }
        }
        if pairs > 1 {
            let half = (pairs - 1) as f64 * pitch / 2.0 + 3.0 * THICKNESS;
            place(cuboid(half, THICKNESS / 2.0), 0.0, rise + THICKNESS / 2.0);
        }
    }
    Scene::new("card-house", world, 600).standing()
}

/// `n` dominoes of 0.15 x 1 x 0.5 m, 0.45 m apart; the first one tips over its far edge with 1.5 rad/s.
pub(super) fn dominoes(n: usize) -> Scene {
    const PITCH: f64 = 0.45;
    const HALF: Vec3 = Vec3::new(0.075, 0.5, 0.25);
    const PUSH: f32 = 1.5;
    let mut world = floor((n as f64 * PITCH / 2.0) as f32 + 10.0, 10.0);
    let domino = Body::dynamic().shape(Shape::cuboid(HALF.x, HALF.y, HALF.z));
    for k in 0..n {
        world.add(domino.clone().position((centered(k, n) * PITCH) as f32, HALF.y, 0.0));
    }
    let spin = -PUSH * Vec3::Z;
    world.bodies[1].angular_velocity = spin;
    world.bodies[1].linear_velocity = spin.cross(Vec3::new(-HALF.x, HALF.y, 0.0));
    let steps = 240 + 12 * n.min(10_000) as u32;
    Scene::new("dominoes", world, steps)
}

/// A plane pyramid of cubes with 0.1 m between neighbors, and on its tip one more, `ratio` times as dense.
pub(super) fn pyramid_heavy(base: usize, ratio: f32) -> Scene {
    let mut scene = super::boxes::pyramid(base);
    scene.name = "pyramid-heavy".to_owned();
    scene.steps = 600;
    let top = unit_box().named("heavy").density(1000.0 * ratio);
    scene.world.add(top.position(0.0, base as f32 + 0.5, 0.0));
    scene
}

#[cfg(test)]
mod tests {
    use parry3d::query::distance;

    use super::*;
    use crate::world::{World, pose};

    /// Distance between body i and body j; 0 if they overlap.
    fn gap(world: &World, i: usize, j: usize) -> f32 {
        let at = |i: usize| pose(world.bodies[i].position, world.bodies[i].rotation);
        let shape = |i: usize| &*world.bodies[i].colliders[0].shape.0;
        distance(&at(i), shape(i), &at(j), shape(j)).expect("convex shapes").distance
    }

    #[test]
    fn every_stone_of_an_arch_is_next_to_its_neighbors_and_overlaps_none() {
        let world = arch(17, 0.15).expect("an arch").world;
        assert_eq!(world.dynamic_count(), 17);
        for (i, j) in (3..19).map(|i| (i, i + 1)).chain([(1, 3), (2, 19)]) {
            assert!((2e-5..2e-4).contains(&gap(&world, i, j)), "{i} {j}: {}", gap(&world, i, j));
        }
        assert!((3..18).all(|i| gap(&world, i, i + 2) > 0.5));
    }

    #[test]
    fn the_cards_of_a_house_touch_where_they_lean_and_nowhere_else() {
        let world = card_house(2, 20.0, 0.5).world;
        // Floor, two pairs, a plate, a pair.
        assert_eq!(world.bodies.len(), 8);
        for (i, j) in [(0, 1), (0, 4), (1, 2), (3, 4), (1, 5), (4, 5), (5, 6), (5, 7), (6, 7)] {
            assert!(gap(&world, i, j) < 1e-5, "{i} {j}: {}", gap(&world, i, j));
        }
        for (i, j) in [(2, 3), (1, 3), (0, 5), (1, 6), (4, 7)] {
            assert!(gap(&world, i, j) > 0.019, "{i} {j}: {}", gap(&world, i, j));
        }
    }
}
