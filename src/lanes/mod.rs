//! Sixteen numbers side by side, for every instruction set.
//!
//! Sixteen numbers fill one register of the widest instruction set, and two or four of the others. The most expensive
//! part of a sweep is to move bodies from memory to the lanes and back ([`Lanes::columns`], [`Lanes::scattered`]): with
//! lanes of eight it took 41 % of all instructions.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod instructions;
mod portable;
mod shared;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
#[cfg(target_arch = "x86_64")]
mod sse2;
#[cfg(test)]
mod tests;

// A program has its baseline alone: the lanes of plain Rust are the slowest to compile and to run.
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128"))))]
use portable::Portable as Baseline;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use simd128::Simd128 as Baseline;
#[cfg(target_arch = "x86_64")]
use sse2::Sse2 as Baseline;

pub use instructions::{InstructionSet, Work};
pub use portable::Portable;
pub use shared::Shared;

use crate::math::Lane;

/// Number of contacts that are processed side by side.
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
    /// Name of the instruction set, for reports.
    const NAME: &'static str;
    /// Loads from memory.
    fn load(from: &Wide) -> Self;
    /// Stores to memory.
    fn store(self) -> Wide;
    /// Loads rows of sixteen bodies, number by number. `places` has the offset of each row from `rows`, in units of 8
    /// bytes.
    ///
    /// # Safety
    /// A row is at each of the places, and no thread writes it meanwhile.
    #[inline(always)]
    unsafe fn gathered(rows: *const Row8, places: &[u32; WIDTH]) -> [Self; 8] {
        // SAFETY: the caller's promise.
        unsafe { Self::columns(&lanes!(lane => row_at(rows, places[lane]).cast())) }
    }
    /// Loads sixteen rows of eight numbers, number by number.
    ///
    /// # Safety
    /// Eight numbers are at each of the addresses, and no thread writes them meanwhile.
    unsafe fn columns(rows: &[*const f32; WIDTH]) -> [Self; 8];
    /// Converts to sixteen rows.
    fn scattered(columns: [Self; 8]) -> [Row8; WIDTH];
    /// The square root, rounded as IEEE 754 requires. No kernel may use it.
    fn sqrt(self) -> Self;
    /// The quotient, rounded as IEEE 754 requires. No kernel may use it.
    fn divided_by(self, divisor: Self) -> Self;
    /// The magnitude of `self` with the sign bit of `sign`.
    fn with_sign(self, sign: Self) -> Self;
    /// The number with bits that are smaller by `steps`: for positive normal numbers, the float that is `steps` floats
    /// below.
    fn floats_below(self, steps: i32) -> Self;
}

/// The row at a place.
///
/// # Safety
/// `place` is the offset of a row in the allocation of `rows`.
#[inline(always)]
pub unsafe fn row_at(rows: *const Row8, place: u32) -> *const Row8 {
    // SAFETY: the caller's promise. Indices of the processor count in eights.
    unsafe { rows.cast::<u64>().add(place as usize).cast() }
}

/// The row number `row` of each of sixteen elements of `all`, number by number.
///
/// # Panics
/// An index in `which` is out of range.
#[inline(always)]
pub fn columns<L: Lanes, T: bytemuck::Pod>(all: &[T], row: usize, which: &[u32; WIDTH]) -> [L; 8] {
    const { assert!(align_of::<T>() >= align_of::<Row8>()) };
    assert!(row < size_of::<T>() / size_of::<Row8>());
    let (mut places, mut last) = (*which, 0);
    for place in &mut places {
        last = last.max(*place);
        *place *= (size_of::<T>() / 8) as u32;
    }
    assert!((last as usize) < all.len());
    // SAFETY: each `T` consists of whole rows of numbers and has a row with this number. `places` are offsets of
    // elements of `all`, which is borrowed, so nothing writes it meanwhile.
    unsafe { L::gathered(all.as_ptr().cast::<Row8>().add(row), &places) }
}

/// An array with the value of an expression for each lane, without a closure: a closure would be compiled for the plain
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
pub(crate) use lanes;

/// Arithmetic of a lane type: the operation of each function on the registers `a` and `b` of its arguments, and on a
/// mask `m`.
macro_rules! lane {
    (
        $Type:ident, $Mask:ty, |$a:ident, $b:ident, $m:ident|
        neg = $neg:expr; constant = $constant:expr; larger = $larger:expr; smaller = $smaller:expr;
        gt = $gt:expr; and = $and:expr; mask = $mask:expr; any = $any:expr; select = $select:expr;
        inverse_sqrt_guess = $guess:expr; inverse_power = $power:expr;
        $($Op:ident::$op:ident = $result:expr;)*
    ) => {
        impl Default for $Type {
            #[inline(always)]
            fn default() -> Self {
                Self::constant(0.0)
            }
        }

        impl PartialEq for $Type {
            fn eq(&self, o: &Self) -> bool {
                self.store() == o.store()
            }
        }

        $(impl std::ops::$Op for $Type {
            type Output = Self;
            #[inline(always)]
            fn $op(self, o: Self) -> Self {
                let ($a, $b) = (self.0, o.0);
                Self($result)
            }
        })*

        impl std::ops::Neg for $Type {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let $a = self.0;
                Self($neg)
            }
        }

        impl Lane for $Type {
            type Mask = $Mask;
            #[inline(always)]
            fn constant(x: f64) -> Self {
                let $a = x as f32;
                Self($constant)
            }
            #[inline(always)]
            fn larger(a: Self, b: Self) -> Self {
                let ($a, $b) = (a.0, b.0);
                Self($larger)
            }
            #[inline(always)]
            fn smaller(a: Self, b: Self) -> Self {
                let ($a, $b) = (a.0, b.0);
                Self($smaller)
            }
            #[inline(always)]
            fn gt(self, o: Self) -> $Mask {
                let ($a, $b) = (self.0, o.0);
                $gt
            }
            #[inline(always)]
            fn and($a: $Mask, $b: $Mask) -> $Mask {
                $and
            }
            #[inline(always)]
            fn mask($m: bool) -> $Mask {
                $mask
            }
            #[inline(always)]
            fn any($m: $Mask) -> bool {
                $any
            }
            #[inline(always)]
            fn select(if_false: Self, if_true: Self, $m: $Mask) -> Self {
                let ($a, $b) = (if_false.0, if_true.0);
                Self($select)
            }
            #[inline(always)]
            fn inverse_sqrt(self) -> Self {
                let $a = self.0;
                crate::math::newton_inverse_sqrt(self, Self($guess))
            }
            #[inline(always)]
            fn inverse_power(self) -> Self {
                let $a = self.0;
                Self($power)
            }
        }
    };
}
use lane;

/// Rows to lanes and back, of a type with four registers of four numbers: `$loaded` loads a register, `$stored` stores
/// one to an aligned address, and `$transposed` transposes four.
#[cfg(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128")))]
macro_rules! four_registers {
    ($loaded:ident, $stored:ident, $transposed:ident) => {
        #[inline(always)]
        unsafe fn columns(rows: &[*const f32; WIDTH]) -> [Self; 8] {
            let mut columns = [Self::constant(0.0); 8];
            for half in 0..2 {
                // SAFETY: the caller promises that eight numbers are at each of the addresses.
                let r = lanes!(lane => unsafe { $loaded(rows[lane].add(4 * half)) });
                for four in 0..4 {
                    let part = $transposed([r[4 * four], r[4 * four + 1], r[4 * four + 2], r[4 * four + 3]]);
                    for (k, column) in part.into_iter().enumerate() {
                        columns[4 * half + k].0[four] = column;
                    }
                }
            }
            columns
        }
        #[inline(always)]
        fn scattered(c: [Self; 8]) -> [Row8; WIDTH] {
            let mut rows = [Row8::default(); WIDTH];
            for half in 0..2 {
                let c = [c[4 * half], c[4 * half + 1], c[4 * half + 2], c[4 * half + 3]];
                for four in 0..4 {
                    let part = $transposed([c[0].0[four], c[1].0[four], c[2].0[four], c[3].0[four]]);
                    for (k, row) in part.into_iter().enumerate() {
                        // SAFETY: room for four numbers is at the address, which is aligned as half of a row.
                        unsafe { $stored(rows[4 * four + k].0.as_mut_ptr().add(4 * half), row) };
                    }
                }
            }
            rows
        }
    };
}
#[cfg(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128")))]
use four_registers;
