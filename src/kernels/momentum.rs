//! Nesterov's momentum for sweeps, with a restart as soon as steps grow (O'Donoghue and Candès 2015). Doubles of the kernels
//! `extrapolate`, `measure_step` and `update_momentum`.
//!
//! With S one sweep over all constraints, x its result and r where it begins:
//!
//! ```text
//! x_k = S(r_k-1)        f_k = |x_k - r_k-1|
//! if f_k > f_k-1:       t_k = 1,  r_k = x_k
//! else:                 t_k = (1 + sqrt(1 + 4 t_k-1²))/2,  r_k = x_k + (t_k-1 - 1)/t_k (x_k - x_k-1)
//! ```
//!
//! Velocities are linear in the impulses and go along with the same factor. The result is x_k, so nothing follows the last
//! sweep; the factor is 0 before the second.

use std::ops::{Add, Mul, Sub};

use super::rows::{Impulse, Momentum, Step};
use crate::math::{Lane, Scalar, Vec3, dot3, reciprocal, vec3};

/// Threads of a workgroup: how many sums are taken side by side.
const WORKGROUP: usize = 64;
/// Numbers that one workgroup sums, the constant of the same name in `measure_step.wgsl`.
pub const CHUNK: usize = 1024;

impl<S: Scalar> Momentum<S> {
    /// Begins a sequence of sweeps: none yet.
    pub fn begin(&mut self) {
        let square = S::constant(f32::MAX.into());
        *self = Self { t: S::constant(1.0), factor: S::constant(0.0), square, restarts: self.restarts };
    }

    /// After a sweep whose step has the squared norm `square`. Kernel `update_momentum`.
    pub fn update(&mut self, square: S) {
        let (zero, half, one) = (S::constant(0.0), S::constant(0.5), S::constant(1.0));
        let x = one + S::constant(4.0) * self.t * self.t;
        let t = half * (one + x * x.inverse_sqrt());
        let factor = (self.t - one) * reciprocal(t);
        let grew = square > self.square;
        let restarts = self.restarts + u32::from(grew);
        *self = Self { t: if grew { one } else { t }, factor: if grew { zero } else { factor }, square, restarts };
    }
}

impl<L: Lane> Impulse<L> {
    /// The three components.
    #[inline(always)]
    pub fn components(&self) -> Vec3<L> {
        vec3(self.normal, self.tangent_1, self.tangent_2)
    }

    /// Changes the three components.
    #[inline(always)]
    pub fn set_components(&mut self, r: Vec3<L>) {
        (self.normal, self.tangent_1, self.tangent_2) = (r.x, r.y, r.z);
    }
}

/// Goes on from `before` through `now`. Kernel `extrapolate`.
#[inline(always)]
pub fn extrapolated<L, T>(now: T, before: T, factor: L) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<L, Output = T>,
{
    now + (now - before) * factor
}

/// Goes on with an impulse, and remembers where it was and where it begins.
#[inline(always)]
pub fn extrapolate<L: Lane>(first: bool, factor: L, impulse: Vec3<L>, step: &mut Step<L>) -> Vec3<L> {
    let begin = if first { impulse } else { extrapolated(impulse, step.before, factor) };
    *step = Step { before: impulse, begin };
    begin
}

/// How far a sweep moved an impulse, squared. Kernel `measure_step`.
#[inline(always)]
pub fn squared_step<L: Lane>(impulse: Vec3<L>, step: &Step<L>) -> L {
    let d = impulse - step.begin;
    dot3(d, d)
}

/// Sum of some numbers as the kernels form it: `measure_step` that of each chunk, `update_momentum` that of those.
pub fn chunked_sum<L: Lane>(numbers: &[L]) -> L {
    let mut sums = [L::constant(0.0); WORKGROUP];
    for (i, chunk) in numbers.chunks(CHUNK).enumerate() {
        sums[i % WORKGROUP] = sums[i % WORKGROUP] + workgroup_sum(chunk);
    }
    sum_of_halves(sums)
}

/// Sum of some numbers as a workgroup forms it: each thread takes every 64th, then halves are added.
fn workgroup_sum<L: Lane>(numbers: &[L]) -> L {
    let mut sums = [L::constant(0.0); WORKGROUP];
    for row in numbers.chunks(WORKGROUP) {
        for (sum, &x) in sums.iter_mut().zip(row) {
            *sum = *sum + x;
        }
    }
    sum_of_halves(sums)
}

fn sum_of_halves<L: Lane>(mut sums: [L; WORKGROUP]) -> L {
    let mut half = WORKGROUP / 2;
    while half > 0 {
        for i in 0..half {
            sums[i] = sums[i] + sums[i + half];
        }
        half /= 2;
    }
    sums[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn momentum_grows_as_it_is_told_and_a_longer_step_ends_it() {
        let mut momentum = Momentum::<f64>::default();
        momentum.begin();
        let mut t = 1.0_f64;
        for k in 0..20 {
            momentum.update(1.0 / f64::from(1 + k));
            let next = 0.5 * (1.0 + (1.0 + 4.0 * t * t).sqrt());
            assert!((momentum.t - next).abs() < 1e-12 && (momentum.factor - (t - 1.0) / next).abs() < 1e-12);
            t = next;
        }
        momentum.update(0.06);
        assert_eq!(momentum, Momentum { t: 1.0, factor: 0.0, square: 0.06, restarts: 1 });
    }

    #[test]
    fn a_chunked_sum_has_everything_once() {
        for count in [0_u32, 1, 63, 64, 65, 1000, 1024, 1025, 70_000, 140_000] {
            let numbers: Vec<f64> = (0..count).map(f64::from).collect();
            assert_eq!(chunked_sum(&numbers), numbers.iter().sum::<f64>());
        }
    }
}
