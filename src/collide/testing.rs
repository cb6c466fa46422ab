//! Random numbers for tests of the detection, the same on every platform.

use glam::{Quat, Vec3};

use crate::random::mixed;

/// A stream with this seed.
pub struct Random(pub u64);

impl Random {
    /// From -1 to 1.
    pub fn next(&mut self) -> f32 {
        self.0 += 1;
        (mixed(self.0) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    pub fn rotation(&mut self) -> Quat {
        Quat::from_xyzw(self.next(), self.next(), self.next(), self.next()).normalize()
    }
}
