//! A hash of the state of all bodies.

use super::Simulation;
use crate::world::{Bodies, Body};

/// Basis and prime of 64-bit FNV-1a.
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

impl Simulation {
    /// A hash of the poses and velocities of all bodies. Two runs with the same bits have the same hash.
    ///
    /// It is the 64-bit FNV-1a hash of the following bytes, each number little-endian. For each body in the order of
    /// indices, without vacancies: the index and the generation of its handle (32 bits each), then position, rotation
    /// (x y z w), linear and angular velocity in single precision. -0 differs from 0, and a NaN counts by its bits. The
    /// definition will not change.
    pub fn hash(&self) -> u64 {
        numbers_of(&self.world.bodies).fold(BASIS, add)
    }
}

/// The hash of all bodies, and one byte for each body in the order of indices: the lowest byte of the same hash of that
/// body alone.
pub fn hashes(bodies: &Bodies) -> (u64, Vec<u8>) {
    let mut of_all = BASIS;
    let of_each = numbers_of(bodies).map(|numbers| {
        of_all = add(of_all, numbers);
        add(BASIS, numbers) as u8
    });
    let of_each = of_each.collect();
    (of_all, of_each)
}

/// The numbers of each body.
fn numbers_of(bodies: &Bodies) -> impl Iterator<Item = [u32; 15]> {
    bodies.handles().map(|handle| {
        let Body { position, rotation, linear_velocity, angular_velocity, .. } = &bodies[handle.index()];
        let mut numbers = [0; 15];
        numbers[..2].copy_from_slice(&[handle.index() as u32, bodies.generations()[handle.index()]]);
        let vectors = [linear_velocity, angular_velocity].into_iter().flat_map(|v| v.to_array());
        let motion = position.to_array().into_iter().chain(rotation.to_array()).chain(vectors);
        numbers[2..].iter_mut().zip(motion).for_each(|(number, x)| *number = x.to_bits());
        numbers
    })
}

/// Adds the bytes of some numbers to the hash.
fn add(hash: u64, numbers: [u32; 15]) -> u64 {
    let bytes = numbers.into_iter().flat_map(u32::to_le_bytes);
    bytes.fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}
