//! Structures without mortar that stand, or fall in turn: arch, aqueduct, house of cards, planks, dominoes, and a
//! pyramid under a heavy box.

use std::f64::consts::PI;

use glam::Vec3;

use super::common::{centered, floor, unit_box};
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Result, Shape, World};

/// Initial distance between neighboring stones (m). Hulls that touch exactly have no defined contact direction.
const GAP: f64 = 1e-4;
/// Friction of stones.
const STONE: f32 = 0.6;

/// Wedges that form a semicircle about the z axis.
struct Ring {
    /// Mean radius (m).
    radius: f64,
    /// Relative to the mean radius.
    thickness: f64,
    /// Along z (m).
    depth: f32,
    voussoirs: usize,
    friction: f32,
}

impl Ring {
    /// Half of the angle of a wedge (rad).
    fn half(&self) -> f64 {
        PI / self.voussoirs as f64 / 2.0
    }

    fn outer(&self) -> f64 {
        self.radius * (1.0 + self.thickness / 2.0)
    }

    /// Height of the top of the middle wedge above the center, if their number is odd (m).
    fn crown(&self) -> f64 {
        self.outer() * libm::cos(self.half()) + GAP / 2.0
    }

    /// Adds the wedges, with the springing at height `y` around `x`.
    fn add_to(&self, world: &mut World, x: f64, y: f64) -> Result<()> {
        let (inner, outer) = (2.0 * self.radius - self.outer(), self.outer());
        // In the frame of a wedge, x points out of the arch and y along it.
        let corner = |r: f64, angle: f64, z: f32| {
            Vec3::new((r * libm::cos(angle) - self.radius) as f32, (r * libm::sin(angle)) as f32, z * self.depth)
        };
        // Both faces of a wedge are moved in by half of the gap.
        let slit = |r: f64| self.half() - GAP / 2.0 / r;
        let sides = [(inner, -slit(inner)), (inner, slit(inner)), (outer, -slit(outer)), (outer, slit(outer))];
        let corners: Vec<Vec3> = sides.iter().flat_map(|&(r, a)| [-0.5, 0.5].map(|z| corner(r, a, z))).collect();
        let wedge = Body::dynamic().shape(Shape::convex_hull(&corners)?).friction(self.friction);
        for k in 0..self.voussoirs {
            let angle = (2 * k + 1) as f64 * self.half();
            let (dx, dy) = (self.radius * libm::cos(angle), GAP / 2.0 + self.radius * libm::sin(angle));
            let place = wedge.clone().position((x + dx) as f32, (y + dy) as f32, 0.0);
            world.insert(place.rotation(about(Vec3::Z, angle as f32)));
        }
        Ok(())
    }
}

/// A semicircular arch of mean radius 5 m on two fixed springers: `voussoirs` wedges, `thickness` of the radius thick
/// and 1 m deep, mu 0.6. If nothing slides, statics requires a thickness of at least 0.1075 (Milankovitch, 1907).
pub(super) fn arch(voussoirs: usize, thickness: f64) -> Result<Scene> {
    arch_of(voussoirs, thickness, STONE)
}

/// The same with any friction.
pub(super) fn arch_of(voussoirs: usize, thickness: f64, friction: f32) -> Result<Scene> {
    let ring = Ring { radius: 5.0, thickness, depth: 1.0, voussoirs, friction };
    let mut world = floor(20.0, 10.0);
    let springer = Body::fixed().named("springer").shape(Shape::cuboid((thickness * ring.radius) as f32, 0.5, 1.0));
    for x in [5.0, -5.0] {
        world.insert(springer.clone().friction(friction).position(x, 0.5, 0.0));
    }
    ring.add_to(&mut world, 0.0, 1.0)?;
    Ok(Scene::new("arch", world, 600).standing())
}

/// `arches` semicircles of mean radius 2 m side by side on piers of three loose blocks, 11 wedges each. Slabs lie from
/// crown to crown. Neighbors push against each other over their pier. The outermost piers are fixed.
pub(super) fn aqueduct(arches: usize) -> Result<Scene> {
    const BLOCK: f64 = 1.0;
    const BLOCKS: usize = 3;
    let ring = Ring { radius: 2.0, thickness: 0.25, depth: 1.0, voussoirs: 11, friction: STONE };
    // Between neighbors over a pier there is half a gap on each side.
    let pitch = 2.0 * ring.outer() + GAP;
    let pier_half = ring.outer() - ring.radius + ring.thickness * ring.radius / 2.0;
    let springing = BLOCKS as f64 * (BLOCK + GAP) + GAP;
    let mut world = floor((arches as f64 * pitch) as f32 + 10.0, 10.0);
    world.bodies[0].material.friction = STONE;
    for pier in 0..=arches {
        let x = centered(pier, arches + 1) * pitch;
        let block =
            |body: Body, half_y: f64| body.shape(Shape::cuboid(pier_half as f32, half_y as f32, 0.5)).friction(STONE);
        if pier == 0 || pier == arches {
            // Tall enough to hold the foot of the outermost arch.
            let half = springing / 2.0;
            world.insert(block(Body::fixed().named("abutment"), half).position(x as f32, half as f32, 0.0));
            continue;
        }
        for k in 0..BLOCKS {
            let y = GAP + (BLOCK + GAP) * k as f64 + BLOCK / 2.0;
            world.insert(block(Body::dynamic().named("pier"), BLOCK / 2.0).position(x as f32, y as f32, 0.0));
        }
    }
    for arch in 0..arches {
        ring.add_to(&mut world, centered(arch, arches) * pitch, springing)?;
    }
    // One slab over each loose pier.
    const SLAB: f64 = 0.15;
    let slab = Body::dynamic()
        .named("slab")
        .shape(Shape::cuboid(((pitch - GAP) / 2.0) as f32, SLAB as f32, 0.5))
        .friction(STONE);
    for k in 1..arches {
        let (x, y) = (centered(k, arches + 1) * pitch, springing + ring.crown() + GAP + SLAB);
        world.insert(slab.clone().position(x as f32, y as f32, 0.0));
    }
    Ok(Scene::new("aqueduct", world, 600).standing())
}

/// A tower of planks of 0.08 x 0.24 x 1.2 m. In each of its `storeys`, nine planks stand on end in a square, three lie
/// across them one way, and three the other way.
pub(super) fn kapla(storeys: usize) -> Scene {
    planks("kapla", storeys, Vec3::new(0.04, 0.12, 0.6), 0.55)
}

/// The same with planks of any half extents, the smallest first, and with any `pitch` of the planks on end (m). A plank
/// across reaches over three of them.
pub(super) fn planks(name: &str, storeys: usize, half: Vec3, pitch: f64) -> Scene {
    let storey_height = 2.0 * f64::from(half.z) + 4.0 * f64::from(half.x);
    let mut world = floor(20.0, 20.0);
    let plank = |own: Vec3| Body::dynamic().shape(Shape::cuboid(own.x, own.y, own.z)).density(600.0);
    for storey in 0..storeys {
        let base = storey as f64 * storey_height;
        let at = |k: usize| (centered(k, 3) * pitch) as f32;
        let mut put = |own: Vec3, x: f32, y: f64, z: f32| world.insert(plank(own).position(x, (base + y) as f32, z));
        let lying = 2.0 * f64::from(half.z) + f64::from(half.x);
        for i in 0..3 {
            for j in 0..3 {
                // Rotate every other one.
                let (x, z) = if (i + j) % 2 == 0 { (half.x, half.y) } else { (half.y, half.x) };
                put(Vec3::new(x, half.z, z), at(i), f64::from(half.z), at(j));
            }
        }
        for k in 0..3 {
            put(Vec3::new(half.z, half.x, half.y), 0.0, lying, at(k));
        }
        for k in 0..3 {
            put(Vec3::new(half.y, half.x, half.z), at(k), lying + 2.0 * f64::from(half.x), 0.0);
        }
    }
    Scene::new(name, world, 3600).standing()
}

/// A house of cards with `storeys` storeys. Cards are `length` (m) long, 0.8 of it wide and `thickness` (m) thick.
/// Pairs lean against each other at `degrees` from the vertical. Each storey has one pair fewer, and a plate lies
/// across the pairs of each storey except the last.
pub(super) fn card_house(storeys: usize, degrees: f64, mu: f32, length: f64, thickness: f64) -> Scene {
    let half_width = 0.4 * length as f32;
    let (sin, cos) = libm::sincos(degrees.to_radians());
    // Sideways distance from a pair's ridge to the middle of its cards, and height from its feet to its highest edges.
    let aside = (thickness * cos + length * sin) / 2.0;
    let rise = thickness * sin + length * cos;
    // The feet of neighbors are half a thickness apart.
    let pitch = 2.0 * (length * sin + thickness * cos) + 0.5 * thickness;
    let cuboid = |x: f64, y: f64| Body::dynamic().shape(Shape::cuboid(x as f32, y as f32, half_width)).friction(mu);
    let card = cuboid(thickness / 2.0, length / 2.0);

    let mut world = floor(storeys as f32 + 10.0, 10.0);
    world.bodies[0].material.friction = mu;
    for storey in 0..storeys {
        let (pairs, base) = (storeys - storey, storey as f64 * (rise + thickness));
        let mut place = |body: Body, x: f64, y: f64| world.insert(body.position(x as f32, (base + y) as f32, 0.0));
        for k in 0..pairs {
            let ridge = centered(k, pairs) * pitch;
            for side in [-1.0, 1.0] {
                let lean = about(Vec3::Z, (side * degrees.to_radians()) as f32);
                place(card.clone().rotation(lean), ridge + side * aside, rise / 2.0);
            }
        }
        if pairs > 1 {
            let half = (pairs - 1) as f64 * pitch / 2.0 + 3.0 * thickness;
            place(cuboid(half, thickness / 2.0), 0.0, rise + thickness / 2.0);
        }
    }
    Scene::new("card-house", world, 600).standing()
}

/// `n` dominoes of 0.15 x 1 x 0.5 m, 0.45 m apart. The first one tips over its far edge at 1.5 rad/s.
pub(super) fn dominoes(n: usize) -> Scene {
    domino_row("dominoes", n, Vec3::new(0.075, 0.5, 0.25), 0.45, 1.5)
}

/// The same with dominoes of any half extents and `pitch` (m). The first one tips at `push` (rad/s).
pub(super) fn domino_row(name: &str, n: usize, half: Vec3, pitch: f64, push: f32) -> Scene {
    let mut world = floor((n as f64 * pitch / 2.0) as f32 + 10.0, 10.0);
    let domino = Body::dynamic().shape(Shape::cuboid(half.x, half.y, half.z));
    for k in 0..n {
        world.insert(domino.clone().position((centered(k, n) * pitch) as f32, half.y, 0.0));
    }
    let spin = -push * Vec3::Z;
    world.bodies[1].angular_velocity = spin;
    world.bodies[1].linear_velocity = spin.cross(Vec3::new(-half.x, half.y, 0.0));
    let steps = 240 + 12 * n.min(10_000) as u32;
    Scene::new(name, world, steps)
}

/// A plane pyramid of cubes with 0.1 m between neighbors, and one more cube on its tip, `ratio` times as dense.
pub(super) fn pyramid_heavy(base: usize, ratio: f32) -> Scene {
    let mut scene = super::boxes::pyramid(base, 0.0);
    scene.name = "pyramid-heavy".to_owned();
    scene.steps = 600;
    let top = unit_box().named("heavy").density(1000.0 * ratio);
    scene.world.insert(top.position(0.0, base as f32 + 0.5, 0.0));
    scene
}

#[cfg(test)]
mod tests {
    use parry3d::query::distance;

    use super::*;
    use drystone::stages::world::pose;

    /// Distance between body i and body j; 0 if they overlap.
    fn gap(world: &World, i: usize, j: usize) -> f32 {
        let at = |i: usize| pose(world.bodies[i].position, world.bodies[i].rotation);
        let shape = |i: usize| &**world.bodies[i].colliders[0].shape.parry();
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
    fn an_aqueduct_starts_without_overlap_and_every_stone_near_what_bears_it() {
        let world = aqueduct(3).expect("an aqueduct").world;
        assert_eq!(world.dynamic_count(), 2 * 3 + 3 * 11 + 2);
        for j in 1..world.bodies.len() {
            let gaps: Vec<f32> = (0..world.bodies.len()).filter(|&i| i != j).map(|i| gap(&world, i, j)).collect();
            let near = gaps.iter().filter(|g| **g < 3.0 * GAP as f32).count();
            let fixed = world.bodies[j].kind == drystone::BodyKind::Fixed;
            assert!(near >= if fixed { 1 } else { 2 }, "{j} {}: {near} neighbors", world.bodies[j].name);
            assert!(fixed || gaps.iter().all(|g| *g > 1e-5), "{j} {} overlaps", world.bodies[j].name);
        }
    }

    #[test]
    fn the_cards_of_a_house_touch_where_they_lean_and_nowhere_else() {
        let world = card_house(2, 20.0, 0.5, 1.0, 0.04).world;
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
