//! The contacts of cuboids, sixteen pairs at a time: bit by bit what parry's `contact_manifold_cuboid_cuboid` says of each pair.
//! Where a half extent is below [`SMALL`], it is what parry says of a pair many times as large: parry's tolerances are lengths.
//!
//! parry tests the three faces of either cuboid and the nine directions across two edges, and takes the one along which the
//! cuboids are furthest apart. Then it clips the two faces that lie best across that direction. Both stages are the same arithmetic for
//! every pair, and branches become choices. Only pairs that are near go on to the second stage: of those that a falling pile computes
//! about half.
//!
//! No closures in what is over lanes: a closure would be compiled for the plain instruction set.

mod clipping;
mod separation;
#[cfg(test)]
mod tests;

use std::sync::Mutex;

use self::clipping::{Clipped, Clipping};
use self::separation::Separation;
use super::collider::{BodyState, CuboidPlace};
use super::solid::{ParryManifold, SMALL};
use crate::lanes::{InstructionSet, Lanes, Row8, WIDTH};
use crate::math::Vec3;

/// Two cuboids to be compared.
#[derive(Clone, Copy)]
pub(super) struct CuboidPair {
    /// The bodies.
    pub bodies: [u32; 2],
    /// Places in the list of cuboids.
    pub cuboids: [u32; 2],
    /// Distance up to which contacts are sought (m).
    pub prediction: f32,
    /// A number of the caller's.
    pub number: u32,
}

/// Memory for the stages.
#[derive(Default)]
pub(super) struct CuboidScratch {
    near: Vec<Near>,
    clipped: Clipped,
}

/// A pair that is no further apart than its prediction.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Near {
    /// The second cuboid as seen from the first: rotation, place; then the last half extent of the second.
    pose: Row8,
    /// Direction from the first to the second, half extents of the first, and the two others of the second.
    direction: Row8,
    number: u32,
    rest: [u32; 7],
}

/// Writes the contact of a pair.
type WriteContact<'a> = dyn Fn(&mut ParryManifold) + 'a;

/// Calls `with` on the number and the contact of each of `pairs`, in the order of the pairs; pairs that are further apart than
/// their predictions have none.
pub(super) fn cuboid_contacts(
    set: InstructionSet,
    bodies: &[BodyState],
    cuboids: &[CuboidPlace],
    pairs: &[CuboidPair],
    CuboidScratch { near, clipped }: &mut CuboidScratch,
    with: &mut dyn FnMut(u32, &WriteContact),
) {
    near.clear();
    let separation = Separation { bodies, cuboids, pairs, near: Mutex::new(near) };
    set.run(&separation, 0..pairs.len().div_ceil(WIDTH));
    for group in 0..near.len().div_ceil(WIDTH) {
        set.run(&Clipping { near, clipped: Mutex::new(clipped) }, group..group + 1);
        for (lane, near) in near.iter().skip(group * WIDTH).take(WIDTH).enumerate() {
            with(near.number, &|found| clipped.write(lane, near, found));
        }
    }
}

/// Whether the thinner of two cuboids with these half extents is so thin that parry's tolerances would show.
#[inline(always)]
fn is_small<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>) -> L::Mask {
    let thickness_1 = L::smaller(L::smaller(half_1.x, half_1.y), half_1.z);
    let thickness_2 = L::smaller(L::smaller(half_2.x, half_2.y), half_2.z);
    L::constant(f64::from(SMALL)).gt(L::smaller(thickness_1, thickness_2))
}
