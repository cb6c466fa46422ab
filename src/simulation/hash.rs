//! One number for the state of all bodies.

use super::Simulation;

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
        let mut hash = BASIS;
        let mut add = |number: u32| {
            for byte in number.to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(PRIME);
            }
        };
        for (i, body) in bodies.iter().enumerate().filter(|&(i, _)| !bodies.is_vacant(i)) {
            add(i as u32);
            add(bodies.generations()[i]);
            let vectors =
                [body.position, body.linear_velocity, body.angular_velocity].map(|v| v.to_array().map(f32::to_bits));
            vectors[0].into_iter().for_each(&mut add);
            body.rotation.to_array().into_iter().for_each(|x| add(x.to_bits()));
            vectors[1..].iter().flatten().for_each(|&bits| add(bits));
        }
        hash
    }
}
