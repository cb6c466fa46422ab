//! Sixteen numbers side by side, for every instruction set there is.
//!
//! Sixteen fill one register of the widest instruction set, and two or four of the others. The dearest thing in a sweep is to bring
//! bodies from where they stand in memory to the lanes and back ([`Lanes::gathered`], [`Lanes::scattered`]): with lanes of eight it
//! took 41 % of all instructions.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod instructions;
mod portable;
#[cfg(test)]
mod tests;

pub use instructions::{InstructionSet, Work};
pub use portable::Portable;

use crate::math::Lane;

/// How many contacts are worked on side by side.
pub const WIDTH: usize = 16;

/// One number of each of sixteen contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct Wide(pub [f32; WIDTH]);

/// Eight numbers of one body.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub struct Row8(pub [f32; 8]);

/// A lane of sixteen numbers.
pub trait Lanes: Lane {
    /// From memory.
    fn load(from: &Wide) -> Self;
    /// To memory.
    fn store(self) -> Wide;
    /// From rows of sixteen bodies, number by number. Where each row is, in units of 8 bytes from `rows`, say `places`.
    ///
    /// # Safety
    /// A row is at each of the places, and no thread writes it meanwhile.
    unsafe fn gathered(rows: *const Row8, places: &[u32; WIDTH]) -> [Self; 8];
    /// To sixteen rows.
    fn scattered(columns: [Self; 8]) -> [Row8; WIDTH];
}

/// The row at a place.
///
/// # Safety
/// `place` is where a row of the allocation of `rows` begins.
#[inline(always)]
pub(super) unsafe fn row_at(rows: *const Row8, place: u32) -> *const Row8 {
    // SAFETY: the caller's promise. Indices of the processor count in eights.
    unsafe { rows.cast::<u64>().add(place as usize).cast() }
}

/// An array of what an expression is for each lane, without a closure: a closure would be compiled for the plain
/// instruction set.
macro_rules! lanes {
    ($lane:ident => $value:expr) => {
        lanes!(@ $lane $value; 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15)
    };
    (@ $lane:ident $value:expr; $($i:literal)*) => {
        [$({
            let $lane: usize = $i;
            $value
        }),*]
    };
}
pub(super) use lanes;
