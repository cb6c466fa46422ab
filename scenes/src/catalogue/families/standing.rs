//! Families that stand, by statics.

use glam::Vec3;

use super::draw::Draw;
use crate::catalogue::common::floor;
use crate::catalogue::masonry;
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Result, Shape, World};

/// Loads stay within this share of a face around its center, so that 10 % of its width is left at each edge.
const MIDDLE: f64 = 0.8;

/// A floor that is large enough for every structure here.
fn ground(friction: f64) -> World {
    let mut world = floor(100.0, 100.0);
    world.bodies[0].material.friction = friction as f32;
    world
}

/// A box of a stack.
struct Block {
    /// Half extents (m).
    half: [f64; 3],
    /// Position of its center along x and z (m).
    place: [f64; 2],
    /// Rotation about the vertical (rad).
    turn: f64,
}

impl Block {
    /// Whether a point at x and z is above the middle part of its face.
    fn bears(&self, place: [f64; 2]) -> bool {
        let [x, z] = [place[0] - self.place[0], place[1] - self.place[1]];
        let (sin, cos) = libm::sincos(self.turn);
        // The axes of the face: x rotates to -z.
        let [along, across] = [x * cos - z * sin, x * sin + z * cos];
        along.abs() <= MIDDLE * self.half[0] && across.abs() <= MIDDLE * self.half[2]
    }
}

/// Boxes on top of each other, dropped through gaps of up to 0.2 % of their heights. The center of mass of every box is
/// above the middle part of every face below it. A face is convex, so the center of mass of any group of these boxes is
/// above it too. Statics requires this of the group above each face, both for a stack at rest and for a box that lands
/// on boxes at rest.
pub(super) fn stack(draw: &mut Draw) -> Scene {
    let n = draw.whole(4, 40);
    let size = draw.log_uniform(0.1, 1.0);
    let friction = draw.between(0.2, 1.0);
    let gap = draw.between(0.0, 0.002);
    let reach = draw.between(0.0, 0.5) * size;
    let density = densities(draw, n);
    // From the top down: a box that does not support the boxes above is drawn again. A box of the largest size on the
    // axis supports all of them.
    let mut blocks: Vec<Block> = Vec::new();
    while blocks.len() < n {
        let half = [(0.6, 1.0), (0.2, 0.6), (0.6, 1.0)].map(|(least, most)| 0.5 * size * draw.between(least, most));
        let place = [draw.between(-0.5, 0.5) * reach, draw.between(-0.5, 0.5) * reach];
        let block = Block { half, place, turn: draw.turn() };
        if blocks.iter().all(|above| block.bears(above.place)) {
            blocks.push(block);
        }
    }
    let mut world = ground(friction);
    let mut top = 0.0;
    for (Block { half: [x, y, z], place, turn }, density) in blocks.into_iter().rev().zip(density) {
        let middle = top + (1.0 + 2.0 * gap) * y;
        let block = Body::dynamic().shape(Shape::cuboid(x as f32, y as f32, z as f32)).density(density as f32);
        let block = block.friction(friction as f32).rotation(about(Vec3::Y, turn as f32));
        world.insert(block.position(place[0] as f32, middle as f32, place[1] as f32));
        top = middle + y;
    }
    Scene::new("stacks", world, 0)
}

/// Densities of `n` boxes, the lowest first (kg/m³): equal, heavy on light, alternating, or random, with a ratio of up
/// to 1000.
fn densities(draw: &mut Draw, n: usize) -> Vec<f64> {
    const LIGHT: f64 = 100.0;
    let ratio = draw.log_uniform(1.0, 1000.0);
    match draw.whole(0, 3) {
        0 => vec![LIGHT; n],
        1 => (0..n).map(|k| if 2 * k < n { LIGHT } else { LIGHT * ratio }).collect(),
        2 => (0..n).map(|k| if k % 2 == 0 { LIGHT } else { LIGHT * ratio }).collect(),
        _ => (0..n).map(|_| LIGHT * draw.log_uniform(1.0, ratio)).collect(),
    }
}

/// Equal boxes, each shifted by the same amount relative to the one below. The center of mass of the k boxes above a
/// box is (k + 1)/2 shifts out, and has to stay within half a width: with n boxes the shift can be a width over n.
pub(super) fn leaned(draw: &mut Draw) -> Scene {
    const SHARE: f64 = 0.8;
    let n = draw.whole(2, 30);
    let width = draw.log_uniform(0.1, 1.0);
    let height = width * draw.between(0.2, 1.0);
    let depth = width * draw.between(0.5, 1.5);
    let friction = draw.between(0.2, 1.0);
    let turn = draw.turn();
    let (sin, cos) = libm::sincos(turn);
    let mut world = ground(friction);
    let block = Body::dynamic().shape(Shape::cuboid((0.5 * width) as f32, (0.5 * height) as f32, (0.5 * depth) as f32));
    let block = block.friction(friction as f32).rotation(about(Vec3::Y, turn as f32));
    for k in 0..n {
        let out = SHARE * width / n as f64 * k as f64;
        world.insert(block.clone().position(
            (out * cos) as f32,
            ((k as f64 + 0.5) * height) as f32,
            (-out * sin) as f32,
        ));
    }
    Scene::new("leaned-towers", world, 0)
}

/// Semicircles of wedges. The smallest thickness is 0.1074 of the radius if friction is above 0.3958 (Cocchetti and
/// Rizzi, "Analytical and numerical analysis on the collapse modes of least-thickness circular masonry arches at
/// decreasing friction", 2020, table 3). An arch with joints at only some angles can be thinner.
pub(super) fn arch(draw: &mut Draw) -> Result<Scene> {
    const LEAST: f64 = 0.107426;
    let voussoirs = draw.whole(7, 31);
    masonry::arch_of(voussoirs, LEAST * draw.between(1.1, 2.0), draw.between(0.5, 1.0) as f32)
}

/// Cards that lean at an angle push their feet apart with at most tan(angle) of their load, and with less if they are
/// thick.
pub(super) fn card_house(draw: &mut Draw) -> Scene {
    let storeys = draw.whole(1, 5);
    let degrees = draw.between(10.0, 30.0);
    let friction = libm::tan(degrees.to_radians()) * draw.between(1.25, 2.5);
    let length = draw.log_uniform(0.1, 1.0);
    masonry::card_house(storeys, degrees, friction as f32, length, length * draw.log_uniform(0.005, 0.04))
}

/// Planks on end and planks across. Their crossings are straight above each other.
pub(super) fn plank_tower(draw: &mut Draw) -> Scene {
    let storeys = draw.whole(1, 8);
    let half_length = draw.log_uniform(0.05, 0.6);
    let [thin, wide] = [draw.between(0.05, 0.15), draw.between(0.15, 0.3)].map(|share| (half_length * share) as f32);
    // The planks across end at most over the middle of the planks on end, and two side by side do not touch.
    let pitch = half_length * draw.between(0.7, 0.92);
    let friction = draw.between(0.2, 1.0) as f32;
    let mut scene = masonry::planks("plank-towers", storeys, Vec3::new(thin, wide, half_length as f32), pitch);
    scene.world.bodies.iter_mut().for_each(|body| body.material.friction = friction);
    scene
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::Family;
    use super::*;

    /// Distance of the center of mass of some bodies from the edge of a box face, as a share of the half width; the
    /// smaller of both axes.
    fn inside(face: &Body, above: &[Body]) -> f64 {
        let mass: f64 = above.iter().map(|b| f64::from(b.mass.mass)).sum();
        let center = above.iter().map(|b| f64::from(b.mass.mass) * b.position.as_dvec3()).sum::<DVec3>() / mass;
        let half = face.colliders[0].shape.as_cuboid().expect("a cuboid").as_dvec3();
        let own = face.rotation.as_dquat().inverse() * (center - face.position.as_dvec3());
        (1.0 - own.x.abs() / half.x).min(1.0 - own.z.abs() / half.z)
    }

    /// Checks the statics independently, from the positions of the bodies.
    #[test]
    fn all_above_a_box_of_a_stack_bears_on_its_middle_and_on_that_of_the_next() {
        for seed in 0..50 {
            let world = Family::Stacks.member(seed).expect("a member").scene.world;
            let boxes: Vec<Body> = world.dynamic().cloned().collect();
            for k in 1..boxes.len() {
                let least = inside(&boxes[k - 1], &boxes[k..]).min(inside(&boxes[k], &boxes[k..]));
                assert!(least > 0.2 - 1e-4, "{seed}: {least} at {k}");
                assert!(boxes[k..].iter().all(|one| inside(&boxes[k - 1], std::slice::from_ref(one)) > 0.2 - 1e-4));
            }
        }
    }

    #[test]
    fn a_tower_leans_to_the_stated_share_of_its_limit() {
        for seed in 0..20 {
            let world = Family::LeanedTowers.member(seed).expect("a member").scene.world;
            let boxes: Vec<Body> = world.dynamic().cloned().collect();
            let margin = inside(&boxes[0], &boxes[1..]);
            assert!((margin - 0.2).abs() < 1e-3, "{seed}: {margin}");
        }
    }
}
