//! Solves a contact problem to convergence in f64. It uses accelerated sweeps while they are efficient, then Newton's
//! method on the central path.
//!
//! Sweeps need thousands of passes if a heavy body stands on light ones, or if many bodies are stacked. A step of
//! Newton's method solves a sparse linear system instead ([`System`]): six unknowns a body, or three a contact if the
//! problem has no bodies. Tens of steps reach 1e-8 on towers of every mass ratio. In some towers of planks the central
//! path turns back: Newton's method then ends above 1e-8, and sweeps continue from there. docs/derivation.md, section
//! 10, describes the method. docs/convergence.md compares it with the solvers of Siconos, and docs/contacts-format.md
//! lists the problems that stay unsolved.

mod blocks;
mod bodies;
mod cone;
mod elimination;
mod factor;
mod interior;
mod scaling;
mod sweeps;
mod system;

pub use blocks::Blocks;
pub use bodies::Bodies;
pub use factor::Factor;
pub use sweeps::Sweeps;
pub use system::{Cone, System};

use glam::DVec3;

use drystone::config::Method;
use interior::Interior;

/// Number of sweeps between two checks of the error.
const STRIDE: u32 = 4;
/// Number of checks before sweeps are judged. Newton's method prepares nothing until then.
const FIRST_STRIDES: usize = 8;
/// Assumed number of Newton steps, for the comparison of the remaining work.
const EXPECTED_STEPS: f64 = 20.0;
/// Largest number of Newton steps.
const MAX_STEPS: u32 = 100;
/// Number of steps in which the smallest error must fall by a tenth.
const PATIENCE: u32 = 12;

/// Error, in units of the tolerance, below which sweeps continue after Newton's method.
const LAST_DIGITS: f64 = 100.0;

/// The reason why a solve ended.
///
/// ```
/// use drystone_problems::{contacts::LocalProblem, solver::newton::{Blocks, Ended, newton}};
///
/// // Nothing to solve.
/// let nothing = LocalProblem::default();
/// assert_eq!(newton(&mut Blocks::new(&nothing), 1e-8, 10).ended, Ended::FirstSweeps);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Ended {
    /// The sweeps before Newton's method reached the tolerance.
    FirstSweeps,
    /// Newton's method reached the tolerance.
    Newton,
    /// Newton's method ended without reaching the tolerance, and the sweeps after it reached it.
    LastSweeps,
    /// The tolerance was not reached.
    Limit,
}

/// The reason why Newton's method ended.
///
/// ```
/// use drystone_problems::{contacts::LocalProblem, solver::newton::{Blocks, NewtonEnded, newton}};
///
/// let nothing = LocalProblem::default();
/// assert_eq!(newton(&mut Blocks::new(&nothing), 1e-8, 10).newton, NewtonEnded::NotBegun);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum NewtonEnded {
    /// Newton's method was not needed.
    NotBegun,
    /// Newton's method reached the tolerance.
    Reached,
    /// The error no longer fell.
    Stalled,
    /// A matrix was singular, or a step was blocked.
    Blocked,
}

/// The best solution of a problem.
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
/// use drystone_problems::solver::newton::{Bodies, Ended, Outcome, newton};
///
/// let outcome: Outcome = newton(&mut Bodies::new(&problem), 1e-8, 1000);
/// assert_ne!(outcome.ended, Ended::Limit);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// The best impulses, each in the coordinates of its contact (N s).
    pub impulses: Vec<DVec3>,
    /// The error of the impulses.
    pub e_vel: f64,
    /// Number of sweeps, before and after Newton's method.
    pub sweeps: u32,
    /// Number of Newton steps.
    pub steps: u32,
    /// The reason why the solve ended.
    pub ended: Ended,
    /// The reason why Newton's method ended.
    pub newton: NewtonEnded,
}

impl Outcome {
    fn keep(&mut self, impulses: &[DVec3], e_vel: f64) {
        // Keep the first error and every smaller one. NaN never counts as smaller.
        if e_vel < self.e_vel {
            (self.e_vel, self.impulses) = (e_vel, impulses.to_vec());
        }
    }
}

/// Solves a problem until `e_vel` is at most `tolerance`, with at most `max_sweeps` sweeps.
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
/// use drystone_problems::solver::newton::{Bodies, newton};
///
/// let solved = newton(&mut Bodies::new(&problem), 1e-8, 1000);
/// assert!(solved.e_vel <= 1e-8 && (solved.impulses[0].x - 6.0).abs() < 1e-6);
/// ```
pub fn newton(system: &mut impl System, tolerance: f64, max_sweeps: u32) -> Outcome {
    let zero = vec![DVec3::ZERO; system.cones().len()];
    let mut best = Outcome {
        impulses: zero.clone(),
        e_vel: f64::INFINITY,
        sweeps: 0,
        steps: 0,
        ended: Ended::FirstSweeps,
        newton: NewtonEnded::NotBegun,
    };
    let mut sweeps = Sweeps::new(system, Method::Accelerated, zero);
    best.keep(sweeps.impulses(), sweeps.error(system));
    if best.e_vel <= tolerance {
        return best;
    }

    // Sweep while sweeps are expected to be cheaper.
    let mut errors = Vec::new();
    while best.e_vel > tolerance && sweeps.count < max_sweeps {
        (0..STRIDE).for_each(|_| sweeps.advance(system));
        best.keep(sweeps.impulses(), sweeps.error(system));
        errors.push(best.e_vel);
        if errors.len() < FIRST_STRIDES {
            continue;
        }
        // Estimate with the rate of the last half of the sweeps.
        let rate = (errors[errors.len() / 2] / best.e_vel).ln() / (0.5 * f64::from(sweeps.count));
        let left = (best.e_vel / tolerance).ln() / rate;
        let (step, sweep) = system.work();
        let affordable = EXPECTED_STEPS * step / sweep;
        if left.is_nan() || left.max(sweeps.count.into()) > affordable {
            break;
        }
    }
    best.sweeps = sweeps.count;
    if best.e_vel <= tolerance {
        return best;
    }

    for careful in [false, true] {
        best.newton = follow(&mut Interior::new(system, careful), system, tolerance, &mut best);
        if best.newton == NewtonEnded::Reached {
            best.ended = Ended::Newton;
            return best;
        }
        // Sweeps find the last digits.
        if best.e_vel <= LAST_DIGITS * tolerance {
            break;
        }
    }

    let mut sweeps = Sweeps::new(system, Method::Accelerated, best.impulses.clone());
    while best.e_vel > tolerance && best.e_vel.is_finite() && best.sweeps + sweeps.count < max_sweeps {
        (0..STRIDE).for_each(|_| sweeps.advance(system));
        best.keep(sweeps.impulses(), sweeps.error(system));
    }
    best.sweeps += sweeps.count;
    best.ended = if best.e_vel <= tolerance { Ended::LastSweeps } else { Ended::Limit };
    best
}

/// Runs Newton steps until a reason to end occurs.
fn follow(interior: &mut Interior, system: &mut impl System, tolerance: f64, best: &mut Outcome) -> NewtonEnded {
    let (mut milestone, mut since) = (f64::INFINITY, 0);
    for _ in 0..MAX_STEPS {
        if interior.step(system, tolerance).is_none() {
            return NewtonEnded::Blocked;
        }
        best.steps += 1;
        best.keep(&interior.r, interior.error);
        if interior.error <= tolerance {
            return NewtonEnded::Reached;
        }
        since += 1;
        if interior.error < 0.9 * milestone {
            (milestone, since) = (interior.error, 0);
        }
        if since > PATIENCE {
            break;
        }
    }
    NewtonEnded::Stalled
}
