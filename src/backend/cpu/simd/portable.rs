//! Sixteen numbers in plain Rust: right on every target.

use std::ops::{Add, Mul, Neg, Sub};

use super::{Lanes, Row8, WIDTH, Wide, lanes, row_at};
use crate::math::Lane;

/// Sixteen numbers; the compiler chooses the registers.
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
