//! Nesterov's momentum for sweeps, with a restart when it leads uphill (O'Donoghue and Candès 2015). Twins of the
//! kernels `extrapolate`, `measure_step` and `update_momentum`.
//!
//! S is one sweep over all constraints, x its result, and r its start:
//!
//! ```text
//! x_k = S(r_k-1)        f_k = |x_k - r_k-1|
//! if (x_k - r_k-1)·(x_k - x_k-1) < 0, or f_k > 2 f_j for a j since the last restart:
//!                       t_k = 1,  r_k = x_k
//! else:                 t_k = (1 + sqrt(1 + 4 t_k-1²))/2,  r_k = x_k + (t_k-1 - 1)/t_k (x_k - x_k-1)
//! ```
//!
//! The first condition is the stricter one. It holds when a sweep goes back against the momentum. In a cycle it may
//! never hold, and then the second condition ends momentum. Numbers are in docs/experiments.md.
//!
//! Velocities are linear in the impulses and use the same factor. The result is x_k, so nothing follows the last sweep.
//! The factor is 0 before the second sweep.

use std::ops::{Add, Mul, Sub};

use super::Rules;
use super::rows::{Impulse, ImpulseStep, Momentum};
use crate::math::{Lane, Scalar, Vec3, dot3, larger, reciprocal, vec3};

/// Threads of a workgroup, the number of partial sums.
const WORKGROUP: usize = 64;
/// Numbers that one workgroup sums; the constant of the same name in `measure_step.wgsl`.
pub const IMPULSES_PER_CHUNK: usize = 1024;

impl<S: Scalar> Momentum<S> {
    /// Begins a sequence of sweeps.
    pub fn begin(&mut self) {
        let square = S::constant(f32::MAX.into());
        *self = Self { t: S::constant(1.0), factor: S::constant(0.0), square, restarts: self.restarts };
    }

    /// Updates the momentum after a sweep. Kernel `update_momentum`.
    pub fn update(&mut self, step: StepLength<S>) {
        let (zero, half, one, four) = (S::constant(0.0), S::constant(0.5), S::constant(1.0), S::constant(4.0));
        let x = one + four * self.t * self.t;
        let t = half * (one + x * x.inverse_sqrt());
        let factor = (self.t - one) * reciprocal(t);
        let ends = step.along < zero || step.square > four * self.square;
        let shorter = ends || step.square < self.square;
        *self = Self {
            t: if ends { one } else { t },
            factor: if ends { zero } else { factor },
            square: if shorter { step.square } else { self.square },
            restarts: self.restarts + u32::from(ends),
        };
    }
}

/// A sum over impulses. Twin of the `vec2f` of `measure_step`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLength<L> {
    /// |x_k - r_k-1|²
    pub square: L,
    /// (x_k - r_k-1)·(x_k - x_k-1)
    pub along: L,
}

impl<L: Add<Output = L>> Add for StepLength<L> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { square: self.square + other.square, along: self.along + other.along }
    }
}

impl<L: Lane> Impulse<L> {
    /// The three components.
    #[inline(always)]
    pub fn components(&self) -> Vec3<L> {
        vec3(self.normal, self.tangent_1, self.tangent_2)
    }

    /// The normal impulse of the substep, which limits friction.
    #[inline(always)]
    pub fn pressing(&self, rules: Rules) -> L {
        if rules.bounces { self.normal + larger(self.bounce, L::constant(0.0)) } else { self.normal }
    }

    /// Sets the three components.
    #[inline(always)]
    pub fn set_components(&mut self, r: Vec3<L>) {
        (self.normal, self.tangent_1, self.tangent_2) = (r.x, r.y, r.z);
    }
}

/// Extrapolates from `before` through `now`. Kernel `extrapolate`.
#[inline(always)]
pub fn extrapolated<L, T>(now: T, before: T, factor: L) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<L, Output = T>,
{
    now + (now - before) * factor
}

/// Extrapolates an impulse, and stores its former value and its new start.
#[inline(always)]
pub fn extrapolate<L: Lane>(first: bool, factor: L, impulse: Vec3<L>, step: &mut ImpulseStep<L>) -> Vec3<L> {
    let begin = if first { impulse } else { extrapolated(impulse, step.before, factor) };
    *step = ImpulseStep { before: impulse, begin };
    begin
}

/// The change of an impulse in a sweep. Kernel `measure_step`.
#[inline(always)]
pub fn step_length<L: Lane>(impulse: Vec3<L>, step: &ImpulseStep<L>) -> StepLength<L> {
    let d = impulse - step.begin;
    StepLength { square: dot3(d, d), along: dot3(d, impulse - step.before) }
}

/// Sum of some numbers in the order of the kernels. `measure_step` sums each chunk, and `update_momentum` sums these
/// sums.
pub fn chunked_sum<T: Copy + Default + Add<Output = T>>(numbers: &[T]) -> T {
    let mut sums = [T::default(); WORKGROUP];
    for (i, chunk) in numbers.chunks(IMPULSES_PER_CHUNK).enumerate() {
        sums[i % WORKGROUP] = sums[i % WORKGROUP] + workgroup_sum(chunk);
    }
    sum_of_halves(sums)
}

/// Sum of some numbers in the order of a workgroup. Each thread sums every 64th number, then halves are added.
fn workgroup_sum<T: Copy + Default + Add<Output = T>>(numbers: &[T]) -> T {
    let mut sums = [T::default(); WORKGROUP];
    for row in numbers.chunks(WORKGROUP) {
        for (sum, &x) in sums.iter_mut().zip(row) {
            *sum = *sum + x;
        }
    }
    sum_of_halves(sums)
}

fn sum_of_halves<T: Copy + Add<Output = T>>(mut sums: [T; WORKGROUP]) -> T {
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
    fn momentum_grows_as_it_is_told_and_a_step_back_or_a_longer_one_ends_it() {
        let step = |square, along| StepLength { square, along };
        let mut momentum = Momentum::<f64>::default();
        momentum.begin();
        let mut t = 1.0_f64;
        for k in 0..20 {
            // Steps grow in the second half, but none has twice the length of the shortest.
            momentum.update(step(if k < 10 { 1.0 / f64::from(1 + k) } else { 0.399 }, 0.0));
            let next = 0.5 * (1.0 + (1.0 + 4.0 * t * t).sqrt());
            assert!((momentum.t - next).abs() < 1e-12 && (momentum.factor - (t - 1.0) / next).abs() < 1e-12);
            t = next;
        }
        for (ending, restarts) in [(step(0.401, 1.0), 1), (step(0.3, -1e-9), 2)] {
            momentum.update(step(0.1, 1.0));
            momentum.update(ending);
            assert_eq!(momentum, Momentum { t: 1.0, factor: 0.0, square: ending.square, restarts });
        }
    }

    #[test]
    fn a_chunked_sum_has_everything_once() {
        for count in [0_u32, 1, 63, 64, 65, 1000, 1024, 1025, 70_000, 140_000] {
            let numbers: Vec<f64> = (0..count).map(f64::from).collect();
            assert_eq!(chunked_sum(&numbers), numbers.iter().sum::<f64>());
        }
    }

    #[test]
    fn a_step_is_held_against_the_shortest_since_the_last_restart() {
        let mut momentum = Momentum::<f64>::default();
        momentum.begin();
        for (square, restarts) in [(1.0, 0), (3.9, 0), (4.1, 1), (16.3, 1), (16.5, 2)] {
            momentum.update(StepLength { square, along: 1.0 });
            assert_eq!(momentum.restarts, restarts, "{square}");
        }
    }

    #[test]
    fn a_step_goes_from_where_the_sweep_began_and_along_the_way_from_the_sweep_before() {
        let step = ImpulseStep { before: vec3(1.0, 0.0, 0.0), begin: vec3(2.0, 1.0, 0.0) };
        let length = step_length(vec3(2.0, 3.0, 0.0), &step);
        assert_eq!(length, StepLength { square: 4.0, along: 6.0 });
        let back = step_length(vec3(1.5, -1.0, 0.0), &ImpulseStep { before: vec3(1.5, 2.0, 0.0), ..step });
        assert_eq!(back, StepLength { square: 4.25, along: 6.0 });
        // The impulse turned back, uphill.
        let turned = step_length(vec3(1.5, 1.0, 0.0), &step);
        assert_eq!(turned.along, -0.25);
    }
}
