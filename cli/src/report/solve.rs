//! What one solve of a contact problem came to, sweep by sweep.

use std::time::Duration;

use serde::Serialize;

use drystone::config::Method;
use drystone::residuals::{Measure, Residuals};
use drystone::solver::{Order, Solver};
use drystone::{Backend, ContactProblem, Result};

use super::rounds::Clock;

/// Errors `e_vel` whose sweeps are reported.
const ERRORS: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];

/// How a contact problem is solved, and when that ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveSettings {
    /// What is done with the sweeps.
    pub method: Method,
    /// In which order they go.
    pub order: Order,
    /// How often a manifold is swept before the next one.
    pub passes: u8,
    /// Most sweeps.
    pub sweeps: u32,
    /// Error `e_vel` below which no more are done; 0 does them all.
    pub tolerance: f64,
}

/// Report of one solve; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct SolveReport {
    /// Name of the problem.
    pub problem: String,
    /// Bodies that can move.
    pub bodies: usize,
    /// Contacts.
    pub contacts: usize,
    /// What was done with the sweeps.
    pub method: Method,
    /// Their order.
    pub order: Order,
    /// How often a manifold was swept before the next one.
    pub passes: u8,
    /// `f64`, or `reference`, `cpu` or `gpu`, which are in f32.
    pub backend: String,
    /// What it ran on.
    pub adapter: String,
    /// Colors of that order.
    pub colors: usize,
    /// Sweeps that were done; they end early where the numbers are not finite.
    pub sweeps: u32,
    /// Time of the sweeps one by one, without measuring (ms).
    pub ms: f64,
    /// When the error first fell below 1e-1 to 1e-4.
    pub reached: Vec<Reached>,
    /// After each power of two of sweeps, and the last.
    pub curve: Vec<CurveRow>,
}

/// When `e_vel` first fell below an error.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Reached {
    /// The error.
    pub e_vel: f64,
    /// Sweeps until then; none if it did not.
    pub sweeps: Option<u32>,
    /// Their time (ms).
    pub ms: Option<f64>,
}

/// What is left after some sweeps.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CurveRow {
    /// Sweeps.
    pub sweeps: u32,
    /// Their time (ms).
    pub ms: f64,
    /// What they leave.
    #[serde(flatten)]
    pub residuals: Residuals,
}

impl SolveReport {
    /// Whether any number of the end is not finite.
    pub fn is_spoiled(&self) -> bool {
        self.curve.last().is_some_and(|row| row.residuals.e_vel.is_nan())
    }

    /// Solves a problem in f64, or in f32 on a backend.
    pub fn new(problem: &ContactProblem, settings: &SolveSettings, backend: Option<Box<dyn Backend>>) -> Result<Self> {
        let &SolveSettings { method, order, passes, sweeps, tolerance } = settings;
        let measure = Measure::new(problem);
        let name = backend.as_ref().map_or("f64", |b| b.name());
        let mut solver = Solver::new(problem, method, order, backend)?.with_passes(passes);
        let mut report = Self {
            problem: problem.name.clone(),
            bodies: problem.bodies.len(),
            contacts: problem.contacts.len(),
            method,
            order,
            passes,
            backend: name.into(),
            adapter: solver.adapter(),
            colors: solver.colors(),
            sweeps: 0,
            ms: 0.0,
            reached: ERRORS.map(|e_vel| Reached { e_vel, sweeps: None, ms: None }).to_vec(),
            curve: Vec::new(),
        };
        let clock = Clock::of(name);
        let mut time = Duration::ZERO;
        for sweep in 1..=sweeps {
            let begin = clock.now();
            solver.advance(1)?;
            time += clock.now() - begin;
            let ms = time.as_secs_f64() * 1e3;
            let residuals = measure.of(&solver.impulses(), &solver.velocities());
            let e_vel = residuals.e_vel;
            (report.sweeps, report.ms) = (sweep, ms);
            for reached in report.reached.iter_mut().filter(|r| r.sweeps.is_none() && e_vel < r.e_vel) {
                (reached.sweeps, reached.ms) = (Some(sweep), Some(ms));
            }
            let last = sweep == sweeps || e_vel < tolerance || e_vel.is_nan();
            if last || sweep.is_power_of_two() {
                report.curve.push(CurveRow { sweeps: sweep, ms, residuals });
            }
            if last {
                break;
            }
        }
        Ok(report)
    }
}
