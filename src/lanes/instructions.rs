//! Chooses the instruction set at run time.

use std::ops::Range;

use super::{Baseline, Lanes};

/// An instruction set of a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// The baseline of the target: four numbers in one register of an x86-64 processor, or of WebAssembly in a program
    /// that was compiled for it; elsewhere plain Rust.
    Baseline,
    /// Eight numbers in one register of an x86-64 processor. Only [`InstructionSet::each`] creates it, after it has
    /// checked the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Sixteen numbers in one register, likewise.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl InstructionSet {
    /// The instruction sets of this processor, the best last.
    pub fn each() -> impl DoubleEndedIterator<Item = Self> {
        [
            Some(Self::Baseline),
            #[cfg(target_arch = "x86_64")]
            std::arch::is_x86_feature_detected!("avx2").then_some(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            std::arch::is_x86_feature_detected!("avx512f").then_some(Self::Avx512),
        ]
        .into_iter()
        .flatten()
    }

    /// Its name, for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => Baseline::NAME,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => super::avx2::Avx2::NAME,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => super::avx512::Avx512::NAME,
        }
    }
}

impl Default for InstructionSet {
    /// The best instruction set of this processor.
    fn default() -> Self {
        Self::each().next_back().unwrap_or(Self::Baseline)
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
            Self::Baseline => work.over::<Baseline>(groups),
            // SAFETY: `InstructionSet::each` asked the processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { run_avx2(work, groups) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { run_avx512(work, groups) },
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
