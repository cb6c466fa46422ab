//! Contact problems whose solution is known, and how long a solver takes to find it.
#![allow(dead_code)]

use drystone::Backend;
use drystone::config::Method;
use drystone_problems::ContactProblem;
use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
use drystone_problems::residuals::Measure;
use drystone_problems::solver::{Order, Solver};
use glam::{DMat3, DVec3};

/// Step length of the problems [s].
pub const STEP: f64 = 1.0 / 60.0;
/// Acceleration of gravity, downward along z [m/s²].
pub const GRAVITY: f64 = 9.81;
/// Friction coefficient of the problems.
pub const FRICTION: f64 = 0.5;

/// Boxes of edge 1 m and the given masses [kg] on each other and the lowest on the ground, four contacts a face, from rest
/// over one step. Every box has its weight to bear, so the solution is v = 0.
pub fn tower(masses: &[f64]) -> ContactProblem {
    let free = Velocity { linear: DVec3::NEG_Z * (GRAVITY * STEP), angular: DVec3::ZERO };
    let cube = |&mass: &f64| FreeBody { mass, inertia: DMat3::IDENTITY * (mass / 6.0), free };
    let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)];
    let contact = |upper: u32, (x, y): (f64, f64)| PointContact {
        a: upper.checked_sub(1),
        b: Some(upper),
        friction: FRICTION,
        offset: DVec3::ZERO,
        frame: [DVec3::Z, DVec3::X, DVec3::Y],
        r_a: if upper == 0 { DVec3::ZERO } else { DVec3::new(x, y, 0.5) },
        r_b: DVec3::new(x, y, -0.5),
    };
    ContactProblem {
        name: format!("tower of {}", masses.len()),
        bodies: masses.iter().map(cube).collect(),
        contacts: (0..masses.len() as u32).flat_map(|upper| corners.map(|corner| contact(upper, corner))).collect(),
    }
}

/// The impulses that hold a tower: the four contacts of a face bear what is above in equal parts [N s].
pub fn bearing(masses: &[f64]) -> Vec<DVec3> {
    let above = |i: usize| masses[i..].iter().sum::<f64>() * GRAVITY * STEP / 4.0;
    (0..masses.len()).flat_map(|i| [DVec3::X * above(i); 4]).collect()
}

/// e_vel after each of `sweeps` sweeps, in f64 or in f32 on a backend.
pub fn curve(
    problem: &ContactProblem,
    (method, order): (Method, Order),
    backend: Option<Box<dyn Backend>>,
    sweeps: u32,
) -> Vec<f64> {
    let measure = Measure::new(problem);
    let mut solver = Solver::new(problem, method, order, backend).expect("good frames");
    let after_one = |_| {
        solver.advance(1).expect("it runs");
        measure.of(&solver.impulses(), &solver.velocities()).e_vel
    };
    (0..sweeps).map(after_one).collect()
}

/// Sweeps until e_vel is less than each of `errors`; none if `most` sweeps do not do it.
pub fn sweeps_to(
    problem: &ContactProblem,
    (method, order): (Method, Order),
    backend: Option<Box<dyn Backend>>,
    errors: &[f64],
    most: u32,
) -> Vec<Option<u32>> {
    let measure = Measure::new(problem);
    let mut solver = Solver::new(problem, method, order, backend).expect("good frames");
    let mut found = vec![None; errors.len()];
    for sweep in 1..=most {
        solver.advance(1).expect("it runs");
        let reached = measure.of(&solver.impulses(), &solver.velocities()).e_vel;
        for (found, _) in found.iter_mut().zip(errors).filter(|(found, error)| found.is_none() && reached < **error) {
            *found = Some(sweep);
        }
        if found.iter().all(Option::is_some) {
            break;
        }
    }
    found
}
