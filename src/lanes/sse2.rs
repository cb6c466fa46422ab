//! Sixteen numbers in four registers of any x86-64 processor.

use std::arch::x86_64::*;

use super::{Lanes, Row8, WIDTH, Wide, four_registers, lane, lanes};
use crate::math::{EXPONENT, INVERSE_SQRT_GUESS, Lane, OPPOSITE_EXPONENT};

/// Four registers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Sse2([__m128; 4]);

// SAFETY of this module: every x86-64 processor has SSE2; aligned loads and stores go through `Wide` and `Row8`, which
// are aligned to 32 bytes.

/// An intrinsic for each register.
macro_rules! each {
    ($intrinsic:expr; $($x:expr),*) => {
        unsafe { [$intrinsic($($x[0]),*), $intrinsic($($x[1]),*), $intrinsic($($x[2]),*), $intrinsic($($x[3]),*)] }
    };
}

lane! {
    Sse2, [__m128; 4], |a, b, m|
    neg = each!(_mm_xor_ps; a, [_mm_set1_ps(-0.0); 4]);
    constant = [unsafe { _mm_set1_ps(a) }; 4];
    larger = each!(_mm_max_ps; a, b);
    smaller = each!(_mm_min_ps; a, b);
    gt = each!(_mm_cmpgt_ps; a, b);
    and = each!(_mm_and_ps; a, b);
    mask = [unsafe { _mm_castsi128_ps(_mm_set1_epi32(if m { -1 } else { 0 })) }; 4];
    any = unsafe { _mm_movemask_ps(_mm_or_ps(_mm_or_ps(m[0], m[1]), _mm_or_ps(m[2], m[3]))) } != 0;
    select = each!(chosen; a, b, m);
    inverse_sqrt_guess = each!(guess; a);
    inverse_power = each!(inverse_power; a);
    Add::add = each!(_mm_add_ps; a, b);
    Sub::sub = each!(_mm_sub_ps; a, b);
    Mul::mul = each!(_mm_mul_ps; a, b);
}

/// The bits of `b` where those of `m` are set, else those of `a`.
#[inline(always)]
unsafe fn chosen(a: __m128, b: __m128, m: __m128) -> __m128 {
    unsafe { _mm_or_ps(_mm_andnot_ps(m, a), _mm_and_ps(m, b)) }
}

/// One over the power of two in each number.
#[inline(always)]
unsafe fn inverse_power(x: __m128) -> __m128 {
    unsafe {
        let exponent = _mm_and_si128(_mm_castps_si128(x), _mm_set1_epi32(EXPONENT as i32));
        _mm_castsi128_ps(_mm_sub_epi32(_mm_set1_epi32(OPPOSITE_EXPONENT as i32), exponent))
    }
}

/// The starting value of Newton's method.
#[inline(always)]
unsafe fn guess(x: __m128) -> __m128 {
    unsafe {
        let half_bits = _mm_srli_epi32::<1>(_mm_castps_si128(x));
        _mm_castsi128_ps(_mm_sub_epi32(_mm_set1_epi32(INVERSE_SQRT_GUESS as i32), half_bits))
    }
}

#[inline(always)]
unsafe fn floats_below(x: __m128, steps: i32) -> __m128 {
    unsafe { _mm_castsi128_ps(_mm_sub_epi32(_mm_castps_si128(x), _mm_set1_epi32(steps))) }
}

impl Lanes for Sse2 {
    const NAME: &'static str = "SSE2";

    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Self([0, 4, 8, 12].map(|first| unsafe { _mm_load_ps(from.0.as_ptr().add(first)) }))
    }
    #[inline(always)]
    fn store(self) -> Wide {
        let mut to = Wide::default();
        for (register, x) in self.0.into_iter().enumerate() {
            unsafe { _mm_store_ps(to.0.as_mut_ptr().add(4 * register), x) };
        }
        to
    }
    four_registers!(loaded, stored, transposed);
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each!(_mm_sqrt_ps; self.0))
    }
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(each!(_mm_div_ps; self.0, divisor.0))
    }
    #[inline(always)]
    fn with_sign(self, sign: Self) -> Self {
        let bit = [unsafe { _mm_set1_ps(-0.0) }; 4];
        Self(each!(chosen; self.0, sign.0, bit))
    }
    #[inline(always)]
    fn floats_below(self, steps: i32) -> Self {
        let steps = [steps; 4];
        Self(each!(floats_below; self.0, steps))
    }
}

/// Four numbers at an address.
#[inline(always)]
unsafe fn loaded(from: *const f32) -> __m128 {
    unsafe { _mm_loadu_ps(from) }
}

/// Stores four numbers to an aligned address.
#[inline(always)]
unsafe fn stored(to: *mut f32, x: __m128) {
    unsafe { _mm_store_ps(to, x) }
}

/// Transposes four rows to four columns.
#[inline(always)]
fn transposed([a, b, c, d]: [__m128; 4]) -> [__m128; 4] {
    unsafe {
        let (ab_low, ab_high) = (_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm_unpacklo_ps(c, d), _mm_unpackhi_ps(c, d));
        [
            _mm_movelh_ps(ab_low, cd_low),
            _mm_movehl_ps(cd_low, ab_low),
            _mm_movelh_ps(ab_high, cd_high),
            _mm_movehl_ps(cd_high, ab_high),
        ]
    }
}
