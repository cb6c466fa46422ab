//! Chooses the instruction set at run time.

use std::ops::Range;

use super::Lanes;

/// An instruction set of a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// The baseline of the target.
    Portable,
    /// Eight numbers in one register of an x86-64 processor. Only [`InstructionSet::each`] creates it, after it has
    /// checked the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Sixteen numbers in one register, likewise.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// Four numbers in one register of WebAssembly, in a program that was compiled for it.
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128,
}

impl InstructionSet {
    /// The instruction sets of this processor, the best last.
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

    /// Its name, for reports.
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
    /// The best instruction set of this processor.
    fn default() -> Self {
        Self::each().next_back().unwrap_or(Self::Portable)
    }
}

/// Work on groups of sixteen, for any lane type.
pub trait Work: Sync {
    /// Processes some groups. It has to be inlined: a separate function would lose the instruction set.
    fn over<L: Lanes>(&self, groups: Range<usize>);
}

impl InstructionSet {
    /// Processes some groups of the work. No other task has the same groups.
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
            // A module with these instructions leaves the portable lanes out: a page would load them for nothing, and
            // the bits are the same.
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
