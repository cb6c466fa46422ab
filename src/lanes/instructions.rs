//! The instruction set is chosen at run time.

use std::ops::Range;

use super::Lanes;

/// What a processor can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// What every processor of its kind has.
    Portable,
    /// Eight numbers in one register of an x86-64 processor. Only [`InstructionSet::each`] makes it, after it has asked.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Sixteen numbers in one register; the same holds.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// Four numbers in one register of WebAssembly, in a program that is compiled for it.
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128,
}

impl InstructionSet {
    /// Those that this processor has, the best last.
    pub fn each() -> impl DoubleEndedIterator<Item = Self> {
        let has = |set: &Self| match set {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => std::arch::is_x86_feature_detected!("avx512f"),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => true,
        };
        let known = [
            #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
            Self::Portable,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128,
        ];
        known.into_iter().filter(has)
    }

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "AVX-512",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => "simd128",
        }
    }
}

impl Default for InstructionSet {
    /// The best that this processor has.
    fn default() -> Self {
        Self::each().next_back().unwrap_or(Self::Portable)
    }
}

/// What is done to groups of sixteen, over whatever lanes.
pub trait Work: Sync {
    /// Does some groups. To be inlined: what is not loses the instruction set.
    fn over<L: Lanes>(&self, groups: Range<usize>);
}

impl InstructionSet {
    /// Does some groups of a work; no other task has the same.
    pub fn run(self, work: &impl Work, groups: Range<usize>) {
        match self {
            #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
            Self::Portable => work.over::<super::Portable>(groups),
            // SAFETY: `InstructionSet::each` asked the processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { run_avx2(work, groups) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { run_avx512(work, groups) },
            // A module with these instructions leaves the portable lanes out: a page loads them for nothing, and the bits are the same.
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Portable | Self::Simd128 => work.over::<super::simd128::Simd128>(groups),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: &impl Work, groups: Range<usize>) {
    work.over::<super::avx2::Avx2>(groups);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn run_avx512(work: &impl Work, groups: Range<usize>) {
    work.over::<super::avx512::Avx512>(groups);
}
