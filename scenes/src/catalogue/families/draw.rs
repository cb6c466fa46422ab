//! The random numbers of a family.

use drystone::stages::random::SplitMix64;

/// Seeds are whole numbers of a double, below this power of two.
const SEED_BITS: u32 = 54;

pub(super) struct Draw(SplitMix64);

impl Draw {
    /// The random numbers of a seed. They differ in each family.
    pub fn new(family: u64, seed: u64) -> Self {
        Self(SplitMix64::new(seed | family << SEED_BITS))
    }

    /// Uniform from `least` to `most`.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * 0.5 * (1.0 + self.0.symmetric())
    }

    /// Log-uniform from `least` to `most`.
    pub fn log_uniform(&mut self, least: f64, most: f64) -> f64 {
        libm::exp(self.between(libm::log(least), libm::log(most)))
    }

    /// A whole number from `least` to `most`, both included.
    pub fn whole(&mut self, least: u32, most: u32) -> usize {
        let count = u64::from(most - least) + 1;
        (u64::from(least) + self.0.bits() % count) as usize
    }

    pub fn is_heads(&mut self) -> bool {
        self.whole(0, 1) == 1
    }

    /// An angle of a full turn (rad).
    pub fn turn(&mut self) -> f64 {
        self.between(0.0, std::f64::consts::TAU)
    }

    /// A new seed, for a scene that draws its own numbers.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }
}
