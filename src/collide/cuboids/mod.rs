//! Computes the contacts of cuboids, sixteen pairs at a time. Each contact has the bits of parry's
//! `contact_manifold_cuboid_cuboid` for the same pair enlarged by 2^17 or more. Parry's tolerances are absolute
//! lengths, and have no effect on a pair of that size.
//!
//! Parry tests the three face normals of each cuboid and the nine cross products of edges, and takes the direction
//! along which the cuboids are furthest apart. Then it clips the two faces that are most perpendicular to that
//! direction. Both stages run the same arithmetic for every pair, with selects in place of branches. Only near pairs
//! reach the second stage: about half of the computed pairs in a falling pile.
//!
//! Code over lanes uses no closures: a closure would be compiled for the plain instruction set.

mod clipping;
mod separation;
#[cfg(test)]
mod tests;

use std::sync::Mutex;

use self::clipping::{Clipped, Clipping};
use self::separation::Separation;
use super::collider::{BodyState, CuboidPlace};
use super::solid::ParryManifold;
use crate::lanes::{InstructionSet, Row8, WIDTH};

/// Two cuboids to test.
#[derive(Clone, Copy)]
pub(super) struct CuboidPair {
    pub bodies: [u32; 2],
    /// Indices in the list of cuboids.
    pub cuboids: [u32; 2],
    /// Largest distance of a contact (m).
    pub prediction: f32,
    /// A number for the caller.
    pub number: u32,
}

/// Reusable memory of the stages.
#[derive(Default)]
pub(super) struct CuboidScratch {
    near: Vec<Near>,
    clipped: Clipped,
}

/// A pair whose distance is at most its prediction.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Near {
    /// The second cuboid in the frame of the first: rotation, position, then the last half extent of the second.
    pose: Row8,
    /// Direction from the first to the second, half extents of the first, and the two other half extents of the second.
    direction: Row8,
    number: u32,
    rest: [u32; 7],
}

/// Writes the contact of a pair.
type WriteContact<'a> = dyn Fn(&mut ParryManifold) + 'a;

/// Calls `with` on the number and the contact of each of `pairs`, in order. A pair gets no call if its distance exceeds
/// its prediction.
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
