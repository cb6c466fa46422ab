//! Stacks of cubes: aligned, misaligned, many next to each other, light under heavy.

use glam::Vec3;

use super::parts::{centered, floor, unit_box};
use super::{Group, Scene};
use crate::random::SplitMix64;
use crate::world::World;

/// Adds `n` cubes on top of each other, the k-th one off the axis by `offset(k)` (m).
pub(super) fn stack(world: &mut World, n: usize, mut offset: impl FnMut(usize) -> Vec3) {
    for k in 0..n {
        let Vec3 { x, z, .. } = offset(k);
        world.add(unit_box().position(x, k as f32 + 0.5, z));
    }
}

/// A stack of `n` cubes, straight.
pub(super) fn aligned(n: usize) -> Scene {
    let mut world = floor(20.0, 20.0);
    stack(&mut world, n, |_| Vec3::ZERO);
    Scene::new("stack", world, 600).standing()
}

/// A stack of `n` cubes, each off the axis by up to `offset` along x and along z: SplitMix64 with seed 1, x first.
pub(super) fn misaligned(n: usize, offset: f64) -> Scene {
    let mut world = floor(20.0, 20.0);
    let mut random = SplitMix64::new(1);
    let mut shift = || (offset * random.symmetric()) as f32;
    stack(&mut world, n, |_| Vec3::new(shift(), 0.0, shift()));
    Scene::new("misaligned", world, 600).standing()
}

/// Towers of `step`, 2 `step`, ... up to `n` cubes, 4 m apart along z, each a group; cubes 0.01 m off to the one side and
/// to the other in turn, along x, so that a tower that falls misses its neighbors.
pub(super) fn tallest(n: usize, step: usize) -> Scene {
    const PITCH: f64 = 4.0;
    let count = n / step;
    let mut world = floor(1.5 * n as f32 + 10.0, (PITCH * count as f64 / 2.0) as f32 + 10.0);
    let mut groups = Vec::new();
    for k in 0..count {
        let (height, z) = ((k + 1) * step, (centered(k, count) * PITCH) as f32);
        let first = world.bodies.len();
        stack(&mut world, height, |i| Vec3::new(if i % 2 == 0 { 0.01 } else { -0.01 }, 0.0, z));
        groups.push(Group { name: format!("{height} cubes"), bodies: first..world.bodies.len() });
    }
    Scene { groups, ..Scene::new("tallest", world, 1200).standing() }
}

/// A stack of `n` cubes, the lowest of 1000 kg/m³, every other one `ratio` times as dense.
pub(super) fn mass_ratio(n: usize, ratio: f32) -> Scene {
    let mut world = floor(20.0, 20.0);
    for k in 0..n {
        let density = if k % 2 == 0 { 1000.0 } else { 1000.0 * ratio };
        world.add(unit_box().density(density).position(0.0, k as f32 + 0.5, 0.0));
    }
    Scene::new("mass-ratio", world, 600).standing()
}
