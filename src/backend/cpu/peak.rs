//! The most that the lanes can calculate: what sweeps are held against.

#![allow(unsafe_code)]

use super::sweep::InstructionSet;
use super::wide::{Lanes, Portable, WIDTH};

/// Chains of each kind, so that every unit of the processor always has one that waits for nothing.
const CHAINS: usize = 6;

/// Multiplies and adds `rounds` times on the best instruction set there is; returns how many operations on single numbers that
/// were. Multiplications and additions apart, as in the kernels, which never fuse them.
pub fn multiply_and_add(rounds: usize) -> u64 {
    match InstructionSet::best() {
        InstructionSet::Portable => chains::<Portable>(rounds),
        // SAFETY: `InstructionSet::each` asked the processor.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { chains_avx2(rounds) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { chains_avx512(rounds) },
    }
    (rounds * 2 * CHAINS * WIDTH) as u64
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn chains_avx2(rounds: usize) {
    chains::<super::wide::Avx2>(rounds);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn chains_avx512(rounds: usize) {
    chains::<super::wide::Avx512>(rounds);
}

#[inline(always)]
fn chains<L: Lanes>(rounds: usize) {
    let (factor, summand) = (std::hint::black_box(L::constant(0.999_999)), std::hint::black_box(L::constant(1e-3)));
    let (mut products, mut sums) = ([L::constant(1.0); CHAINS], [L::constant(1.0); CHAINS]);
    for _ in 0..rounds {
        for chain in 0..CHAINS {
            products[chain] = products[chain] * factor;
            sums[chain] = sums[chain] + summand;
        }
    }
    std::hint::black_box((products, sums));
}
