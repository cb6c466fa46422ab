//! Sixteen numbers in plain Rust, for every target.

use super::{Lanes, Row8, WIDTH, Wide, lane, lanes};
use crate::math::{INVERSE_SQRT_GUESS, Lane};

/// Sixteen numbers; the compiler chooses the registers.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Portable(Wide);

lane! {
    Portable, [bool; WIDTH], |a, b, m|
    neg = Wide(lanes!(i => -a.0[i]));
    constant = Wide([a; WIDTH]);
    larger = Wide(lanes!(i => Lane::larger(a.0[i], b.0[i])));
    smaller = Wide(lanes!(i => Lane::smaller(a.0[i], b.0[i])));
    gt = lanes!(i => a.0[i] > b.0[i]);
    and = lanes!(i => a[i] && b[i]);
    mask = [m; WIDTH];
    any = m.contains(&true);
    select = Wide(lanes!(i => if m[i] { b.0[i] } else { a.0[i] }));
    inverse_sqrt_guess = Wide(a.0.map(|x| f32::from_bits(INVERSE_SQRT_GUESS.wrapping_sub(x.to_bits() >> 1))));
    inverse_power = Wide(a.0.map(Lane::inverse_power));
    Add::add = Wide(lanes!(i => a.0[i] + b.0[i]));
    Sub::sub = Wide(lanes!(i => a.0[i] - b.0[i]));
    Mul::mul = Wide(lanes!(i => a.0[i] * b.0[i]));
}

impl Lanes for Portable {
    const NAME: &'static str = "portable";

    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self) -> Wide {
        self.0
    }
    #[inline(always)]
    unsafe fn columns(rows: &[*const f32; WIDTH]) -> [Self; 8] {
        // SAFETY: the caller's promise; an array of numbers is aligned as one number.
        let rows: [[f32; 8]; WIDTH] = lanes!(lane => unsafe { *rows[lane].cast() });
        std::array::from_fn(|column| Self(Wide(std::array::from_fn(|row| rows[row][column]))))
    }
    #[inline(always)]
    fn scattered(columns: [Self; 8]) -> [Row8; WIDTH] {
        std::array::from_fn(|row| Row8(std::array::from_fn(|column| columns[column].0.0[row])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i].sqrt())))
    }
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i] / divisor.0.0[i])))
    }
    #[inline(always)]
    fn with_sign(self, sign: Self) -> Self {
        Self(Wide(lanes!(i => self.0.0[i].copysign(sign.0.0[i]))))
    }
    #[inline(always)]
    fn floats_below(self, steps: i32) -> Self {
        Self(Wide(lanes!(i => f32::from_bits(self.0.0[i].to_bits().wrapping_sub(steps as u32)))))
    }
}
