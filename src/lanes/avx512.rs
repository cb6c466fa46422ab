//! Sixteen numbers in one AVX-512 register. Use this type only inside functions that enable `avx512f`;
//! [`super::instructions`] enters them after it has checked the processor.

use std::arch::x86_64::*;

use super::{Lanes, Row8, WIDTH, Wide, lane};
use crate::math::{EXPONENT, INVERSE_SQRT_GUESS, Lane, OPPOSITE_EXPONENT};

/// One register.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Avx512(__m512);

// SAFETY of this module: every intrinsic here needs AVX-512F and nothing else, and the type is only used where that has
// been detected; aligned loads and stores go through `Wide`, which is aligned to 64 bytes, and `Row8`, to 32.

lane! {
    Avx512, __mmask16, |a, b, m|
    neg = unsafe { _mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(a), _mm512_set1_epi32(i32::MIN))) };
    constant = unsafe { _mm512_set1_ps(a) };
    larger = unsafe { _mm512_max_ps(a, b) };
    smaller = unsafe { _mm512_min_ps(a, b) };
    gt = unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(a, b) };
    and = a & b;
    mask = if m { __mmask16::MAX } else { 0 };
    any = m != 0;
    select = unsafe { _mm512_mask_blend_ps(m, a, b) };
    inverse_sqrt_guess = unsafe {
        _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(INVERSE_SQRT_GUESS as i32), _mm512_srli_epi32::<1>(_mm512_castps_si512(a))))
    };
    inverse_power = unsafe {
        let exponent = _mm512_and_si512(_mm512_castps_si512(a), _mm512_set1_epi32(EXPONENT as i32));
        _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(OPPOSITE_EXPONENT as i32), exponent))
    };
    Add::add = unsafe { _mm512_add_ps(a, b) };
    Sub::sub = unsafe { _mm512_sub_ps(a, b) };
    Mul::mul = unsafe { _mm512_mul_ps(a, b) };
}

impl Lanes for Avx512 {
    const NAME: &'static str = "AVX-512";

    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Self(unsafe { _mm512_load_ps(from.0.as_ptr()) })
    }
    #[inline(always)]
    fn store(self) -> Wide {
        let mut to = Wide::default();
        unsafe { _mm512_store_ps(to.0.as_mut_ptr(), self.0) };
        to
    }
    #[inline(always)]
    unsafe fn columns(r: &[*const f32; WIDTH]) -> [Self; 8] {
        // Quarters of a register never meet before the last line, so the rows that are four apart share one.
        // SAFETY: the caller's promise.
        let (first, second) = unsafe {
            (
                [both(r[0], r[4]), both(r[1], r[5]), both(r[2], r[6]), both(r[3], r[7])],
                [both(r[8], r[12]), both(r[9], r[13]), both(r[10], r[14]), both(r[11], r[15])],
            )
        };
        let ([b0, b1, b2, b3], [b4, b5, b6, b7]) = (transposed(first), transposed(second));
        unsafe {
            [
                Self(_mm512_shuffle_f32x4::<0x88>(b0, b4)),
                Self(_mm512_shuffle_f32x4::<0x88>(b1, b5)),
                Self(_mm512_shuffle_f32x4::<0x88>(b2, b6)),
                Self(_mm512_shuffle_f32x4::<0x88>(b3, b7)),
                Self(_mm512_shuffle_f32x4::<0xdd>(b0, b4)),
                Self(_mm512_shuffle_f32x4::<0xdd>(b1, b5)),
                Self(_mm512_shuffle_f32x4::<0xdd>(b2, b6)),
                Self(_mm512_shuffle_f32x4::<0xdd>(b3, b7)),
            ]
        }
    }
    #[inline(always)]
    fn scattered(c: [Self; 8]) -> [Row8; WIDTH] {
        // Quarter q of register i is the first half of row 4 q + i, or the second.
        let first = transposed([c[0].0, c[1].0, c[2].0, c[3].0]);
        let second = transposed([c[4].0, c[5].0, c[6].0, c[7].0]);
        let mut rows = [Row8::default(); WIDTH];
        for i in 0..4 {
            unsafe {
                let low = _mm512_shuffle_f32x4::<0x44>(first[i], second[i]);
                let high = _mm512_shuffle_f32x4::<0xee>(first[i], second[i]);
                // From quarters f0 f1 s0 s1 to f0 s0 f1 s1.
                let (low, high) = (_mm512_shuffle_f32x4::<0xd8>(low, low), _mm512_shuffle_f32x4::<0xd8>(high, high));
                _mm256_store_ps(rows[i].0.as_mut_ptr(), _mm512_castps512_ps256(low));
                _mm256_store_ps(rows[i + 4].0.as_mut_ptr(), upper(low));
                _mm256_store_ps(rows[i + 8].0.as_mut_ptr(), _mm512_castps512_ps256(high));
                _mm256_store_ps(rows[i + 12].0.as_mut_ptr(), upper(high));
            }
        }
        rows
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(unsafe { _mm512_div_ps(self.0, divisor.0) })
    }
    #[inline(always)]
    fn with_sign(self, sign: Self) -> Self {
        unsafe {
            let (magnitude, sign) = (_mm512_castps_si512(self.0), _mm512_castps_si512(sign.0));
            // From the first number take the bits outside the mask, from the second the bits inside it.
            let both = _mm512_ternarylogic_epi32::<0xd8>(magnitude, sign, _mm512_set1_epi32(i32::MIN));
            Self(_mm512_castsi512_ps(both))
        }
    }
    #[inline(always)]
    fn floats_below(self, steps: i32) -> Self {
        unsafe { Self(_mm512_castsi512_ps(_mm512_sub_epi32(_mm512_castps_si512(self.0), _mm512_set1_epi32(steps)))) }
    }
}

/// Two rows in one register.
///
/// # Safety
/// Eight numbers are at both addresses, and no thread writes them meanwhile.
#[inline(always)]
unsafe fn both(low: *const f32, high: *const f32) -> __m512 {
    // SAFETY: the caller's promise.
    unsafe {
        let low = _mm512_castps_pd(_mm512_castps256_ps512(_mm256_loadu_ps(low)));
        _mm512_castpd_ps(_mm512_insertf64x4::<1>(low, _mm256_castps_pd(_mm256_loadu_ps(high))))
    }
}

#[inline(always)]
fn upper(x: __m512) -> __m256 {
    unsafe { _mm256_castpd_ps(_mm512_extractf64x4_pd::<1>(_mm512_castps_pd(x))) }
}

/// Transposes rows to columns in each quarter of four registers.
#[inline(always)]
fn transposed(r: [__m512; 4]) -> [__m512; 4] {
    unsafe {
        let (a0, a1) = (_mm512_unpacklo_ps(r[0], r[1]), _mm512_unpackhi_ps(r[0], r[1]));
        let (a2, a3) = (_mm512_unpacklo_ps(r[2], r[3]), _mm512_unpackhi_ps(r[2], r[3]));
        [
            _mm512_shuffle_ps::<0x44>(a0, a2),
            _mm512_shuffle_ps::<0xee>(a0, a2),
            _mm512_shuffle_ps::<0x44>(a1, a3),
            _mm512_shuffle_ps::<0xee>(a1, a3),
        ]
    }
}
