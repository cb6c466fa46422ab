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
#[cfg(test)]
mod tests;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;

use std::ops::{Add, Mul, Neg, Sub};

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

/// Sixteen numbers in plain Rust: right on every target, and what the compiler makes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(transparent)]
pub struct Portable(Wide);

impl Add for Portable {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i] + o.0.0[i])))
    }
}

impl Sub for Portable {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i] - o.0.0[i])))
    }
}

impl Mul for Portable {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i] * o.0.0[i])))
    }
}

impl Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(Wide(self.0.0.map(|x| -x)))
    }
}

impl Lane for Portable {
    type Mask = [bool; WIDTH];
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self(Wide([x as f32; WIDTH]))
    }
    #[inline(always)]
    fn gt(self, o: Self) -> Self::Mask {
        std::array::from_fn(|i| self.0.0[i] > o.0.0[i])
    }
    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        std::array::from_fn(|i| a[i] && b[i])
    }
    #[inline(always)]
    fn mask(value: bool) -> Self::Mask {
        [value; WIDTH]
    }
    #[inline(always)]
    fn select(if_false: Self, if_true: Self, mask: Self::Mask) -> Self {
        Self(Wide(std::array::from_fn(|i| if mask[i] { if_true.0.0[i] } else { if_false.0.0[i] })))
    }
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        Self(Wide(self.0.0.map(Lane::inverse_sqrt)))
    }
    #[inline(always)]
    fn inverse_power(self) -> Self {
        Self(Wide(self.0.0.map(Lane::inverse_power)))
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self) -> Wide {
        self.0
    }
    #[inline(always)]
    unsafe fn gathered(rows: *const Row8, places: &[u32; WIDTH]) -> [Self; 8] {
        // SAFETY: the caller's promise.
        let rows: [Row8; WIDTH] = lanes!(lane => unsafe { *row_at(rows, places[lane]) });
        std::array::from_fn(|column| Self(Wide(std::array::from_fn(|row| rows[row].0[column]))))
    }
    #[inline(always)]
    fn scattered(columns: [Self; 8]) -> [Row8; WIDTH] {
        std::array::from_fn(|row| Row8(std::array::from_fn(|column| columns[column].0.0[row])))
    }
}
