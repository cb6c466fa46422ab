//! The most that the lanes can calculate: what sweeps are held against.

use std::ops::Range;

use super::sweep::{InstructionSet, Work};
use super::wide::{Lanes, WIDTH};

/// Chains of each kind, so that every unit of the processor always has one that waits for nothing.
const CHAINS: usize = 6;

/// Multiplies and adds `rounds` times on the best instruction set there is; returns how many operations on single numbers that
/// were. Multiplications and additions apart, as in the kernels, which never fuse them.
pub fn multiply_and_add(rounds: usize) -> u64 {
    InstructionSet::best().run(&Chains, 0..rounds);
    (rounds * 2 * CHAINS * WIDTH) as u64
}

/// So many rounds of all chains.
struct Chains;

impl Work for Chains {
    #[inline(always)]
    fn over<L: Lanes>(&self, rounds: Range<usize>) {
        let (factor, summand) = (std::hint::black_box(L::constant(0.999_999)), std::hint::black_box(L::constant(1e-3)));
        let (mut products, mut sums) = ([L::constant(1.0); CHAINS], [L::constant(1.0); CHAINS]);
        for _ in rounds {
            for chain in 0..CHAINS {
                products[chain] = products[chain] * factor;
                sums[chain] = sums[chain] + summand;
            }
        }
        std::hint::black_box((products, sums));
    }
}
