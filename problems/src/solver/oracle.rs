//! Reference solutions of contact problems, as accurate as f64 allows.

use glam::DVec3;

use super::{Order, Solver};
use crate::contacts::{ContactProblem, Velocity};
use crate::residuals::{Measure, Residuals};
use drystone::Result;
use drystone::config::Method;

/// A solved contact problem.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// use drystone_problems::solver::{Solution, solution};
///
/// let solved: Solution = solution(&problem, 1e-10, 1000)?;
/// assert!(solved.residuals.e_vel <= 1e-10 && (solved.impulses[0].x - 6.0).abs() < 1e-6);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Solution {
    /// Impulses of the contacts, each in its coordinates (N s). They are often not unique.
    pub impulses: Vec<DVec3>,
    /// The velocities of the bodies under these impulses.
    pub velocities: Vec<Velocity>,
    /// Their errors.
    pub residuals: Residuals,
    /// Number of sweeps.
    pub sweeps: u32,
}

/// Solves a problem in f64 by accelerated sweeps, contact by contact, until `e_vel` is at most `tolerance` or after
/// `most` sweeps. The result is the best iterate, and its residuals give its accuracy.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// let solved = drystone_problems::solver::solution(&problem, 1e-10, 1000)?;
/// assert!((solved.velocities[0].linear.x - 0.7).abs() < 1e-6);
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// # Errors
/// The second tangent of a contact is not the normal times the first, up to sign.
pub fn solution(problem: &ContactProblem, tolerance: f64, most: u32) -> Result<Solution> {
    let measure = Measure::new(problem);
    let mut solver = Solver::new(problem, Method::Accelerated, Order::Contacts, None)?;
    let state = |solver: &Solver, sweeps: u32| {
        let (impulses, velocities) = (solver.impulses(), solver.velocities());
        let residuals = measure.of(&impulses, &velocities);
        Solution { impulses, velocities, residuals, sweeps }
    };
    let mut best = state(&solver, 0);
    for sweep in 1..=most {
        if best.residuals.e_vel <= tolerance {
            break;
        }
        solver.advance(1)?;
        let now = state(&solver, sweep);
        if now.residuals.e_vel < best.residuals.e_vel {
            best = now;
        }
    }
    Ok(best)
}
