//! Sixteen numbers in four registers of WebAssembly. The engine accepts or refuses a module with these instructions as
//! a whole, so they are chosen at compile time (`-C target-feature=+simd128`).

use std::arch::wasm32::*;

use super::{Lanes, Row8, WIDTH, Wide, four_registers, lane, lanes};
use crate::math::{EXPONENT, INVERSE_SQRT_GUESS, Lane, OPPOSITE_EXPONENT};

/// Four registers.
#[derive(Clone, Copy, Debug)]
pub struct Simd128([v128; 4]);

/// An intrinsic for each register.
macro_rules! each {
    ($intrinsic:expr; $($x:expr),*) => {
        [$intrinsic($($x[0]),*), $intrinsic($($x[1]),*), $intrinsic($($x[2]),*), $intrinsic($($x[3]),*)]
    };
}

// `f32x4_pmax(b, a)` is a if a > b, else b, and `f32x4_pmin(b, a)` is a if a < b, else b, like the other lane types.
lane! {
    Simd128, [v128; 4], |a, b, m|
    neg = each!(f32x4_neg; a);
    constant = [f32x4_splat(a); 4];
    larger = each!(f32x4_pmax; b, a);
    smaller = each!(f32x4_pmin; b, a);
    gt = each!(f32x4_gt; a, b);
    and = each!(v128_and; a, b);
    mask = [i32x4_splat(if m { -1 } else { 0 }); 4];
    any = v128_any_true(v128_or(v128_or(m[0], m[1]), v128_or(m[2], m[3])));
    select = each!(v128_bitselect; b, a, m);
    inverse_sqrt_guess = each!(guess; a);
    inverse_power = each!(inverse_power; a);
    Add::add = each!(f32x4_add; a, b);
    Sub::sub = each!(f32x4_sub; a, b);
    Mul::mul = each!(f32x4_mul; a, b);
}

/// One over the power of two in each number.
#[inline(always)]
fn inverse_power(x: v128) -> v128 {
    i32x4_sub(i32x4_splat(OPPOSITE_EXPONENT as i32), v128_and(x, i32x4_splat(EXPONENT as i32)))
}

/// The starting value of Newton's method.
#[inline(always)]
fn guess(x: v128) -> v128 {
    i32x4_sub(i32x4_splat(INVERSE_SQRT_GUESS as i32), u32x4_shr(x, 1))
}

impl Lanes for Simd128 {
    const NAME: &'static str = "simd128";

    #[inline(always)]
    fn load(from: &Wide) -> Self {
        // SAFETY: sixteen numbers are at the address; a load needs no alignment.
        Self([0, 4, 8, 12].map(|first| unsafe { v128_load(from.0.as_ptr().add(first).cast()) }))
    }
    #[inline(always)]
    fn store(self) -> Wide {
        let mut to = Wide::default();
        for (register, x) in self.0.into_iter().enumerate() {
            // SAFETY: room for sixteen numbers is at the address.
            unsafe { v128_store(to.0.as_mut_ptr().add(4 * register).cast(), x) };
        }
        to
    }
    four_registers!(loaded, stored, transposed);
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each!(f32x4_sqrt; self.0))
    }
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(each!(f32x4_div; self.0, divisor.0))
    }
    #[inline(always)]
    fn with_sign(self, sign: Self) -> Self {
        let bit = [f32x4_splat(-0.0); 4];
        Self(each!(v128_bitselect; sign.0, self.0, bit))
    }
    #[inline(always)]
    fn floats_below(self, steps: i32) -> Self {
        let steps = [i32x4_splat(steps); 4];
        Self(each!(i32x4_sub; self.0, steps))
    }
}

/// Four numbers at an address.
#[inline(always)]
unsafe fn loaded(from: *const f32) -> v128 {
    // SAFETY: the caller's promise; a load needs no alignment.
    unsafe { v128_load(from.cast()) }
}

/// Stores four numbers to an address.
#[inline(always)]
unsafe fn stored(to: *mut f32, x: v128) {
    // SAFETY: the caller's promise.
    unsafe { v128_store(to.cast(), x) }
}

/// Transposes four rows to four columns.
#[inline(always)]
fn transposed([a, b, c, d]: [v128; 4]) -> [v128; 4] {
    let (ab_low, ab_high) = (i32x4_shuffle::<0, 4, 1, 5>(a, b), i32x4_shuffle::<2, 6, 3, 7>(a, b));
    let (cd_low, cd_high) = (i32x4_shuffle::<0, 4, 1, 5>(c, d), i32x4_shuffle::<2, 6, 3, 7>(c, d));
    [
        i64x2_shuffle::<0, 2>(ab_low, cd_low),
        i64x2_shuffle::<1, 3>(ab_low, cd_low),
        i64x2_shuffle::<0, 2>(ab_high, cd_high),
        i64x2_shuffle::<1, 3>(ab_high, cd_high),
    ]
}
