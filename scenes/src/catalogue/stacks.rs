//! Stacks of cubes: straight, shifted, many side by side, and light cubes under heavy ones.

use super::common::{centered, floor, lifted, unit_box};
use crate::scene::{Group, Scene};
use drystone::stages::random::SplitMix64;
use drystone::{Body, Shape, World};

/// Adds `n` cubes on top of each other, with gaps as in [`lifted`]. `cube(k)` returns the position of the k-th cube
/// along x and z (m) and its density (kg/m³).
pub(super) fn stack(world: &mut World, n: usize, gap: f32, mut cube: impl FnMut(usize) -> ([f32; 2], f32)) {
    for k in 0..n {
        let ([x, z], density) = cube(k);
        world.insert(unit_box().density(density).position(x, k as f32 + 0.5 + lifted(k, gap), z));
    }
}

/// One such stack on a floor, as a scene that should stand.
fn standing(name: &str, n: usize, gap: f32, cube: impl FnMut(usize) -> ([f32; 2], f32)) -> Scene {
    let mut world = floor(20.0, 20.0);
    stack(&mut world, n, gap, cube);
    Scene::new(name, world, 600).standing()
}

/// `offset` with alternating sign.
fn in_turn(k: usize, offset: f32) -> f32 {
    if k.is_multiple_of(2) { offset } else { -offset }
}

/// A stack of `n` cubes, straight.
pub(super) fn aligned(n: usize) -> Scene {
    standing("stack", n, 0.0, |_| ([0.0; 2], 1000.0))
}

/// A straight stack of `n` cylinders, 1 m wide and 4 cm thick.
pub(super) fn coins(n: usize) -> Scene {
    const HALF: f32 = 0.02;
    let mut world = floor(20.0, 20.0);
    let coin = Body::dynamic().shape(Shape::cylinder(HALF, 0.5));
    for k in 0..n {
        world.insert(coin.clone().position(0.0, (2 * k + 1) as f32 * HALF, 0.0));
    }
    Scene::new("coins", world, 600).standing()
}

/// A stack of `n` cubes, shifted by `offset` to alternating sides. The top cube has `top_ratio` times the density.
pub(super) fn tower(n: usize, offset: f32, top_ratio: f32, gap: f32) -> Scene {
    standing("tower", n, gap, |k| ([in_turn(k, offset), 0.0], if k + 1 == n { 1000.0 * top_ratio } else { 1000.0 }))
}

/// A stack of `n` cubes, each off the axis by up to `offset` along x and along z. The shifts come from SplitMix64 with
/// seed 1, x first.
pub(super) fn misaligned(n: usize, offset: f64) -> Scene {
    let mut random = SplitMix64::new(1);
    let mut shift = || (offset * random.symmetric()) as f32;
    standing("misaligned", n, 0.0, |_| ([shift(), shift()], 1000.0))
}

/// A stack of `n` cubes: the lowest has 1000 kg/m³, and every other one is `ratio` times as dense.
pub(super) fn mass_ratio(n: usize, ratio: f32, gap: f32) -> Scene {
    standing("mass-ratio", n, gap, |k| ([0.0; 2], if k % 2 == 0 { 1000.0 } else { 1000.0 * ratio }))
}

/// Towers of `step`, 2 `step`, ... up to `n` cubes, 4 m apart along z. Each tower is a group. Cubes are 0.01 m off to
/// alternating sides along x, so a falling tower misses its neighbors.
pub(super) fn tallest(n: usize, step: usize) -> Scene {
    const PITCH: f64 = 4.0;
    let count = n / step;
    let mut world = floor(1.5 * n as f32 + 10.0, (PITCH * count as f64 / 2.0) as f32 + 10.0);
    let mut groups = Vec::new();
    for k in 0..count {
        let (height, z) = ((k + 1) * step, (centered(k, count) * PITCH) as f32);
        let first = world.bodies.len();
        stack(&mut world, height, 0.0, |i| ([in_turn(i, 0.01), z], 1000.0));
        groups.push(Group { name: format!("{height} cubes"), bodies: world.bodies.handles().skip(first).collect() });
    }
    Scene { groups, ..Scene::new("tallest", world, 1200).standing() }
}
