//! The rows of damped bodies.
//!
//! The velocity of a body with the damping d follows v' = a - d v. With a constant acceleration a and x = d t its
//! solution is
//!
//! ```text
//! v(t) = v(0) - (1 - exp(-x)) v(0) + a t (1 - exp(-x))/x
//! ```
//!
//! It holds over any number of substeps: a step from 0 to t and one from t to 2 t give the step from 0 to 2 t. The
//! number of substeps of an island therefore does not change how its bodies slow down. With v/(1 + d t) it would.

use super::StepProblem;
use super::rows::DampingRow;
use crate::world::World;

/// The effect of damping on a velocity over some time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decay {
    /// The share of the velocity that is lost: 1 - exp(-x).
    pub loss: f64,
    /// The velocity gained by an acceleration, over the acceleration (s).
    pub gain: f64,
}

impl Decay {
    /// Decay at a rate of 0 or more (1/s) over some time (s).
    pub fn of(rate: f32, time: f64) -> Self {
        let x = f64::from(rate) * time;
        if x <= 0.0 {
            return Self { loss: 0.0, gain: time };
        }
        let loss = loss_in(x);
        Self { loss, gain: time * (loss / x) }
    }
}

/// 1 - exp(-x) for x >= 0. Sums and products alone give the same bits on every platform.
pub(super) fn loss_in(x: f64) -> f64 {
    // exp(-x) is below the rounding of 1 in double precision.
    if x >= 64.0 {
        return 1.0;
    }
    let (mut x, mut doublings) = (x, 0);
    while x > 0.0625 {
        (x, doublings) = (0.5 * x, doublings + 1);
    }
    // x - x²/2! + x³/3! - ..., by Horner's rule.
    let mut loss = x;
    for k in (2..=10).rev() {
        loss = x * (1.0 - loss / f64::from(k));
    }
    // 1 - exp(-2x) = (1 - exp(-x)) (1 + exp(-x)).
    for _ in 0..doublings {
        loss *= 2.0 - loss;
    }
    loss
}

/// Writes the rows of damping once the blocks are laid out. There are no rows if no damped body takes part.
pub fn write_dampings(world: &World, asleep: &[bool], problem: &mut StepProblem) {
    let StepProblem { dampings, masses, torques, blocks, order, colors, .. } = problem;
    dampings.clear();
    let is_damped = |i: usize| world.bodies[i].is_damped() && asleep.get(i) != Some(&true);
    if !(0..world.bodies.len()).any(is_damped) {
        return;
    }
    dampings.resize(masses.len(), DampingRow::default());
    for block in blocks {
        let time = f64::from(block.substep.length);
        let color = block.bodies as usize;
        let own = order[colors[color] as usize..colors[color + 1] as usize].iter().map(|&body| body as usize);
        for i in own.filter(|&i| i < world.bodies.len() && is_damped(i)) {
            let body = &world.bodies[i];
            let of = |rate: f32, acceleration: [f32; 3]| {
                let Decay { loss, gain } = Decay::of(rate, time);
                // The kernel also applies the loss to the velocity that the acceleration gave in this substep.
                let besides = gain - time * (1.0 - loss);
                (acceleration.map(|a| (f64::from(a) * besides) as f32), loss as f32)
            };
            let turns = torques.get(i).map_or([0.0; 3], |row| row.angular_acceleration);
            let (linear_gain, linear_loss) = of(body.linear_damping, masses[i].acceleration);
            let (angular_gain, angular_loss) = of(body.angular_damping, turns);
            dampings[i] = DampingRow { linear_gain, linear_loss, angular_gain, angular_loss };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_is_that_of_the_exponential() {
        for x in [0.0, 1e-300, 1e-9, 1e-3, 0.0625, 0.07, 1.0, 5.0, 30.0, 63.9, 64.0, 1e30] {
            let wanted = -f64::exp_m1(-x);
            assert!((loss_in(x) - wanted).abs() <= 1e-15 * wanted, "{x}: {} {wanted}", loss_in(x));
        }
    }

    #[test]
    fn two_times_are_one_of_their_sum() {
        for (rate, time) in [(0.0, 0.1), (0.5, 0.01), (3.0, 2.0), (1e6, 0.01)] {
            let [one, both] = [time, 2.0 * time].map(|time| Decay::of(rate, time));
            let after = |decay: Decay, v: f64| v - decay.loss * v + 9.81 * decay.gain;
            assert!((after(one, after(one, 2.0)) - after(both, 2.0)).abs() < 1e-13, "{rate} {time}");
        }
    }
}
