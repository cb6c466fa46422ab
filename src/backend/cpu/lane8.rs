//! Eight numbers side by side, for every instruction set there is.

#![allow(unsafe_code)]

use std::ops::{Add, Mul, Neg, Sub};

use crate::math::Lane;

/// Eight numbers in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub struct Row8(pub [f32; 8]);

/// A lane of eight numbers.
pub trait Lane8: Lane {
    /// From memory.
    fn load(row: &Row8) -> Self;
    /// To memory.
    fn store(self) -> Row8;
    /// Rows become columns.
    fn transposed(rows: [Self; 8]) -> [Self; 8];
}

/// Eight numbers in plain Rust: right on every target, and what the compiler makes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(transparent)]
pub struct Portable(Row8);

/// Applies an operation to each of eight pairs.
macro_rules! each {
    ($a:expr, $b:expr, $op:tt) => {{
        let (a, b) = (($a).0.0, ($b).0.0);
        Portable(Row8([
            a[0] $op b[0], a[1] $op b[1], a[2] $op b[2], a[3] $op b[3],
            a[4] $op b[4], a[5] $op b[5], a[6] $op b[6], a[7] $op b[7],
        ]))
    }};
}

impl Add for Portable {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        each!(self, o, +)
    }
}

impl Sub for Portable {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        each!(self, o, -)
    }
}

impl Mul for Portable {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        each!(self, o, *)
    }
}

impl Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(Row8(self.0.0.map(|x| -x)))
    }
}

impl Lane for Portable {
    type Mask = [bool; 8];
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self(Row8([x as f32; 8]))
    }
    #[inline(always)]
    fn gt(self, o: Self) -> [bool; 8] {
        std::array::from_fn(|i| self.0.0[i] > o.0.0[i])
    }
    #[inline(always)]
    fn and(a: [bool; 8], b: [bool; 8]) -> [bool; 8] {
        std::array::from_fn(|i| a[i] && b[i])
    }
    #[inline(always)]
    fn mask(value: bool) -> [bool; 8] {
        [value; 8]
    }
    #[inline(always)]
    fn select(if_false: Self, if_true: Self, mask: [bool; 8]) -> Self {
        Self(Row8(std::array::from_fn(|i| if mask[i] { if_true.0.0[i] } else { if_false.0.0[i] })))
    }
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        Self(Row8(self.0.0.map(Lane::inverse_sqrt)))
    }
}

impl Lane8 for Portable {
    #[inline(always)]
    fn load(row: &Row8) -> Self {
        Self(*row)
    }
    #[inline(always)]
    fn store(self) -> Row8 {
        self.0
    }
    #[inline(always)]
    fn transposed(rows: [Self; 8]) -> [Self; 8] {
        std::array::from_fn(|column| Self(Row8(std::array::from_fn(|row| rows[row].0.0[column]))))
    }
}

/// Eight numbers in one AVX2 register. Only for use inside functions that enable `avx2`, which [`super::lanes`] enters after
/// it has asked the processor.
#[cfg(target_arch = "x86_64")]
pub mod avx2 {
    use super::{Add, Lane, Lane8, Mul, Neg, Row8, Sub};
    use std::arch::x86_64::*;

    /// One register.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub struct Avx2(__m256);

    // SAFETY of this module: every intrinsic here needs AVX2 and nothing else, and the type is only used where that has
    // been detected; loads and stores go through `Row8`, which is aligned to 32 bytes.

    impl Default for Avx2 {
        #[inline(always)]
        fn default() -> Self {
            Self(unsafe { _mm256_setzero_ps() })
        }
    }

    impl PartialEq for Avx2 {
        fn eq(&self, o: &Self) -> bool {
            self.store() == o.store()
        }
    }

    impl Add for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn add(self, o: Self) -> Self {
            Self(unsafe { _mm256_add_ps(self.0, o.0) })
        }
    }

    impl Sub for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn sub(self, o: Self) -> Self {
            Self(unsafe { _mm256_sub_ps(self.0, o.0) })
        }
    }

    impl Mul for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn mul(self, o: Self) -> Self {
            Self(unsafe { _mm256_mul_ps(self.0, o.0) })
        }
    }

    impl Neg for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            Self(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
        }
    }

    impl Lane for Avx2 {
        type Mask = __m256;
        #[inline(always)]
        fn constant(x: f64) -> Self {
            Self(unsafe { _mm256_set1_ps(x as f32) })
        }
        #[inline(always)]
        fn gt(self, o: Self) -> __m256 {
            unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, o.0) }
        }
        #[inline(always)]
        fn and(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_and_ps(a, b) }
        }
        #[inline(always)]
        fn mask(value: bool) -> __m256 {
            unsafe { _mm256_castsi256_ps(_mm256_set1_epi32(if value { -1 } else { 0 })) }
        }
        #[inline(always)]
        fn select(if_false: Self, if_true: Self, mask: __m256) -> Self {
            Self(unsafe { _mm256_blendv_ps(if_false.0, if_true.0, mask) })
        }
        #[inline(always)]
        fn inverse_sqrt(self) -> Self {
            let half_x = Self::constant(0.5) * self;
            let three_halves = Self::constant(1.5);
            let mut y = unsafe {
                let half_bits = _mm256_srli_epi32::<1>(_mm256_castps_si256(self.0));
                Self(_mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(0x5f37_5a86), half_bits)))
            };
            y = y * (three_halves - half_x * y * y);
            y = y * (three_halves - half_x * y * y);
            y = y * (three_halves - half_x * y * y);
            y
        }
    }

    impl Lane8 for Avx2 {
        #[inline(always)]
        fn load(row: &Row8) -> Self {
            Self(unsafe { _mm256_load_ps(row.0.as_ptr()) })
        }
        #[inline(always)]
        fn store(self) -> Row8 {
            let mut row = Row8::default();
            unsafe { _mm256_store_ps(row.0.as_mut_ptr(), self.0) };
            row
        }
        #[inline(always)]
        fn transposed(r: [Self; 8]) -> [Self; 8] {
            unsafe {
                let (a0, a1) = (_mm256_unpacklo_ps(r[0].0, r[1].0), _mm256_unpackhi_ps(r[0].0, r[1].0));
                let (a2, a3) = (_mm256_unpacklo_ps(r[2].0, r[3].0), _mm256_unpackhi_ps(r[2].0, r[3].0));
                let (a4, a5) = (_mm256_unpacklo_ps(r[4].0, r[5].0), _mm256_unpackhi_ps(r[4].0, r[5].0));
                let (a6, a7) = (_mm256_unpacklo_ps(r[6].0, r[7].0), _mm256_unpackhi_ps(r[6].0, r[7].0));
                let (b0, b1) = (_mm256_shuffle_ps::<0x44>(a0, a2), _mm256_shuffle_ps::<0xee>(a0, a2));
                let (b2, b3) = (_mm256_shuffle_ps::<0x44>(a1, a3), _mm256_shuffle_ps::<0xee>(a1, a3));
                let (b4, b5) = (_mm256_shuffle_ps::<0x44>(a4, a6), _mm256_shuffle_ps::<0xee>(a4, a6));
                let (b6, b7) = (_mm256_shuffle_ps::<0x44>(a5, a7), _mm256_shuffle_ps::<0xee>(a5, a7));
                [
                    Self(_mm256_permute2f128_ps::<0x20>(b0, b4)),
                    Self(_mm256_permute2f128_ps::<0x20>(b1, b5)),
                    Self(_mm256_permute2f128_ps::<0x20>(b2, b6)),
                    Self(_mm256_permute2f128_ps::<0x20>(b3, b7)),
                    Self(_mm256_permute2f128_ps::<0x31>(b0, b4)),
                    Self(_mm256_permute2f128_ps::<0x31>(b1, b5)),
                    Self(_mm256_permute2f128_ps::<0x31>(b2, b6)),
                    Self(_mm256_permute2f128_ps::<0x31>(b3, b7)),
                ]
            }
        }
    }
}
