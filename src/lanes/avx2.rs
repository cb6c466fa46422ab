//! Sixteen numbers in two AVX2 registers. Use this type only inside functions that enable `avx2`;
//! [`super::instructions`] enters them after it has checked the processor.

use std::arch::x86_64::*;

use super::{Lanes, Row8, WIDTH, Wide, lane, lanes};
use crate::math::{EXPONENT, INVERSE_SQRT_GUESS, Lane, OPPOSITE_EXPONENT};

/// Two registers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Avx2([__m256; 2]);

// SAFETY of this module: every intrinsic here needs AVX2 and nothing else, and the type is only used where that has
// been detected; aligned loads and stores go through `Wide` and `Row8`, which are aligned to 32 bytes.

/// An intrinsic for both registers.
macro_rules! both {
    ($intrinsic:expr; $($x:expr),*) => {
        unsafe { [$intrinsic($($x[0]),*), $intrinsic($($x[1]),*)] }
    };
}

lane! {
    Avx2, [__m256; 2], |a, b, m|
    neg = both!(_mm256_xor_ps; a, [_mm256_set1_ps(-0.0); 2]);
    constant = [unsafe { _mm256_set1_ps(a) }; 2];
    larger = both!(_mm256_max_ps; a, b);
    smaller = both!(_mm256_min_ps; a, b);
    gt = both!(_mm256_cmp_ps::<_CMP_GT_OQ>; a, b);
    and = both!(_mm256_and_ps; a, b);
    mask = [unsafe { _mm256_castsi256_ps(_mm256_set1_epi32(if m { -1 } else { 0 })) }; 2];
    any = unsafe { _mm256_movemask_ps(m[0]) | _mm256_movemask_ps(m[1]) } != 0;
    select = both!(_mm256_blendv_ps; a, b, m);
    inverse_sqrt_guess = [guess(a[0]), guess(a[1])];
    inverse_power = [inverse_power(a[0]), inverse_power(a[1])];
    Add::add = both!(_mm256_add_ps; a, b);
    Sub::sub = both!(_mm256_sub_ps; a, b);
    Mul::mul = both!(_mm256_mul_ps; a, b);
}

/// One over the power of two in each number.
#[inline(always)]
fn inverse_power(x: __m256) -> __m256 {
    unsafe {
        let exponent = _mm256_and_si256(_mm256_castps_si256(x), _mm256_set1_epi32(EXPONENT as i32));
        _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(OPPOSITE_EXPONENT as i32), exponent))
    }
}

/// The starting value of Newton's method.
#[inline(always)]
fn guess(x: __m256) -> __m256 {
    unsafe {
        let half_bits = _mm256_srli_epi32::<1>(_mm256_castps_si256(x));
        _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(INVERSE_SQRT_GUESS as i32), half_bits))
    }
}

impl Lanes for Avx2 {
    const NAME: &'static str = "AVX2";

    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Self(unsafe { [_mm256_load_ps(from.0.as_ptr()), _mm256_load_ps(from.0.as_ptr().add(8))] })
    }
    #[inline(always)]
    fn store(self) -> Wide {
        let mut to = Wide::default();
        unsafe {
            _mm256_store_ps(to.0.as_mut_ptr(), self.0[0]);
            _mm256_store_ps(to.0.as_mut_ptr().add(8), self.0[1]);
        }
        to
    }
    #[inline(always)]
    unsafe fn columns(rows: &[*const f32; WIDTH]) -> [Self; 8] {
        // SAFETY: the caller promises that eight numbers are at each of the addresses.
        let r: [__m256; WIDTH] = lanes!(lane => unsafe { _mm256_loadu_ps(rows[lane]) });
        let s = transposed([r[8], r[9], r[10], r[11], r[12], r[13], r[14], r[15]]);
        let r = transposed([r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7]]);
        [
            Self([r[0], s[0]]),
            Self([r[1], s[1]]),
            Self([r[2], s[2]]),
            Self([r[3], s[3]]),
            Self([r[4], s[4]]),
            Self([r[5], s[5]]),
            Self([r[6], s[6]]),
            Self([r[7], s[7]]),
        ]
    }
    #[inline(always)]
    fn scattered(c: [Self; 8]) -> [Row8; WIDTH] {
        let r = transposed([c[0].0[0], c[1].0[0], c[2].0[0], c[3].0[0], c[4].0[0], c[5].0[0], c[6].0[0], c[7].0[0]]);
        let s = transposed([c[0].0[1], c[1].0[1], c[2].0[1], c[3].0[1], c[4].0[1], c[5].0[1], c[6].0[1], c[7].0[1]]);
        let mut rows = [Row8::default(); WIDTH];
        for i in 0..8 {
            unsafe {
                _mm256_store_ps(rows[i].0.as_mut_ptr(), r[i]);
                _mm256_store_ps(rows[i + 8].0.as_mut_ptr(), s[i]);
            }
        }
        rows
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(both!(_mm256_sqrt_ps; self.0))
    }
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(both!(_mm256_div_ps; self.0, divisor.0))
    }
    #[inline(always)]
    fn with_sign(self, sign: Self) -> Self {
        let bit = [unsafe { _mm256_set1_ps(-0.0) }; 2];
        let (magnitude, sign) = (both!(_mm256_andnot_ps; bit, self.0), both!(_mm256_and_ps; bit, sign.0));
        Self(both!(_mm256_or_ps; magnitude, sign))
    }
    #[inline(always)]
    fn floats_below(self, steps: i32) -> Self {
        Self([floats_below(self.0[0], steps), floats_below(self.0[1], steps)])
    }
}

#[inline(always)]
fn floats_below(x: __m256, steps: i32) -> __m256 {
    unsafe { _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_castps_si256(x), _mm256_set1_epi32(steps))) }
}

/// Transposes rows to columns.
#[inline(always)]
fn transposed(r: [__m256; 8]) -> [__m256; 8] {
    unsafe {
        let (a0, a1) = (_mm256_unpacklo_ps(r[0], r[1]), _mm256_unpackhi_ps(r[0], r[1]));
        let (a2, a3) = (_mm256_unpacklo_ps(r[2], r[3]), _mm256_unpackhi_ps(r[2], r[3]));
        let (a4, a5) = (_mm256_unpacklo_ps(r[4], r[5]), _mm256_unpackhi_ps(r[4], r[5]));
        let (a6, a7) = (_mm256_unpacklo_ps(r[6], r[7]), _mm256_unpackhi_ps(r[6], r[7]));
        let (b0, b1) = (_mm256_shuffle_ps::<0x44>(a0, a2), _mm256_shuffle_ps::<0xee>(a0, a2));
        let (b2, b3) = (_mm256_shuffle_ps::<0x44>(a1, a3), _mm256_shuffle_ps::<0xee>(a1, a3));
        let (b4, b5) = (_mm256_shuffle_ps::<0x44>(a4, a6), _mm256_shuffle_ps::<0xee>(a4, a6));
        let (b6, b7) = (_mm256_shuffle_ps::<0x44>(a5, a7), _mm256_shuffle_ps::<0xee>(a5, a7));
        [
            _mm256_permute2f128_ps::<0x20>(b0, b4),
            _mm256_permute2f128_ps::<0x20>(b1, b5),
            _mm256_permute2f128_ps::<0x20>(b2, b6),
            _mm256_permute2f128_ps::<0x20>(b3, b7),
            _mm256_permute2f128_ps::<0x31>(b0, b4),
            _mm256_permute2f128_ps::<0x31>(b1, b5),
            _mm256_permute2f128_ps::<0x31>(b2, b6),
            _mm256_permute2f128_ps::<0x31>(b3, b7),
        ]
    }
}
