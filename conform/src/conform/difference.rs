//! Differences between the rows that two backends return for one problem.

use drystone::stages::problem::BodyRow;
use drystone::stages::problem::StepProblem;

/// All numbers that a backend returns.
fn numbers(problem: &StepProblem) -> Vec<f32> {
    let c = &problem.convergence;
    let m = &problem.momentum;
    let rows: [&[f32]; 5] = [
        bytemuck::cast_slice(&problem.bodies),
        bytemuck::cast_slice(&problem.impulses),
        bytemuck::cast_slice(&problem.totals),
        bytemuck::cast_slice(&problem.joint_impulses),
        bytemuck::cast_slice(&problem.joint_totals),
    ];
    let counts = [c.moving, c.done, c.sweeps, c.planned].map(|n| n as f32);
    let momentum = [m.t, m.factor, m.square, m.restarts as f32];
    [&rows.concat()[..], &counts, &momentum].concat()
}

/// The numbers of `a` with those of `b`.
fn pairs(a: &StepProblem, b: &StepProblem) -> impl Iterator<Item = (f32, f32)> {
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    a.into_iter().zip(b)
}

/// Number of values that differ in any bit.
pub fn differing(a: &StepProblem, b: &StepProblem) -> usize {
    pairs(a, b).filter(|(x, y)| x.to_bits() != y.to_bits()).count()
}

/// The largest difference of two values, relative to 1 plus their size; infinite for NaN.
pub fn largest(a: &StepProblem, b: &StepProblem) -> f64 {
    let apart = |(x, y): (f32, f32)| {
        let (x, y) = (f64::from(x), f64::from(y));
        let d = (x - y).abs() / (1.0 + x.abs().max(y.abs()));
        if d.is_nan() { f64::INFINITY } else { d }
    };
    pairs(a, b).map(apart).fold(0.0, f64::max)
}

/// For each body, the largest difference of a component of its velocity (m/s) and angular velocity (rad/s); infinite for
/// NaN.
fn of_bodies(a: &StepProblem, b: &StepProblem) -> Vec<f64> {
    assert_eq!(a.bodies.len(), b.bodies.len());
    let apart = |(x, y): (&f32, &f32)| if (x - y).is_nan() { f64::INFINITY } else { f64::from((x - y).abs()) };
    let of_body = |(a, b): (&BodyRow, &BodyRow)| {
        let (a, b) = ([a.v, a.w], [b.v, b.w]);
        a.as_flattened().iter().zip(b.as_flattened()).map(apart).fold(0.0, f64::max)
    };
    a.bodies.iter().zip(&b.bodies).map(of_body).collect()
}

/// The largest difference of a component of a velocity (m/s) or an angular velocity (rad/s).
pub fn of_velocities(a: &StepProblem, b: &StepProblem) -> f64 {
    of_most_velocities(a, b, 0)
}

/// The largest of these differences without the `left_out` largest.
pub fn of_most_velocities(a: &StepProblem, b: &StepProblem, left_out: usize) -> f64 {
    let mut apart = of_bodies(a, b);
    apart.sort_unstable_by(|x, y| y.total_cmp(x));
    apart.get(left_out).copied().unwrap_or_default()
}
