//! Ground truth: a contact problem solved as far as f64 goes.

use glam::DVec3;

use super::{Order, Solver};
use crate::config::Method;
use crate::contacts::{ContactProblem, Velocity};
use crate::error::Result;
use crate::residuals::{Measure, Residuals};

/// A solved contact problem.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Solution {
    /// Impulses of the contacts, each in its coordinates (N s). Often not the only ones that solve the problem.
    pub impulses: Vec<DVec3>,
    /// The velocities that they give the bodies.
    pub velocities: Vec<Velocity>,
    /// Their errors.
    pub residuals: Residuals,
    /// Sweeps that it took.
    pub sweeps: u32,
}

/// Solves a problem in f64 by accelerated sweeps, contact by contact, until `e_vel` is at most `tolerance` or `most` sweeps
/// are done; the best of them is the result, and its residuals say how good that is.
///
/// # Errors
/// A contact whose second tangent is not, up to its sign, the normal times the first.
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
