//! One number for the state of all bodies.

use super::Simulation;
use crate::world::Body;

/// Basis and prime of FNV-1a with 64 bits.
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

impl Simulation {
    /// A hash of the poses and velocities of all bodies: two runs have the same one where they have the same bits.
    ///
    /// It is FNV-1a with 64 bits over these bytes, the least of each number first: body by body in the order of their indices, vacancies left
    /// out, the index and the generation of its handle (32 bits each), then position, rotation (x y z w), linear and angular velocity in
    /// single precision. -0 is not 0, and a number that is none counts by its bits. The definition stays.
    pub fn hash(&self) -> u64 {
        let bodies = &self.world.bodies;
        bodies.handles().fold(BASIS, |hash, body| {
            add(hash, bodies.generations()[body.index()], body.index(), &bodies[body.index()])
        })
    }

    /// The same hash of each body alone, in the order of their indices.
    pub(crate) fn body_hashes(&self) -> impl Iterator<Item = u64> {
        let bodies = &self.world.bodies;
        bodies.handles().map(|body| add(BASIS, bodies.generations()[body.index()], body.index(), &bodies[body.index()]))
    }
}

/// The hash with a body added.
fn add(hash: u64, generation: u32, index: usize, body: &Body) -> u64 {
    let place = [index as u32, generation];
    let vectors = [body.position, body.linear_velocity, body.angular_velocity].map(|v| v.to_array().map(f32::to_bits));
    let rotation = body.rotation.to_array().map(f32::to_bits);
    let motion = vectors[0].iter().chain(&rotation).chain(&vectors[1]).chain(&vectors[2]);
    let bytes = place.iter().chain(motion).flat_map(|number| number.to_le_bytes());
    bytes.fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}
