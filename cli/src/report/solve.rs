//! Report of one solve of a contact problem.

use std::time::Duration;

use serde::Serialize;

use drystone::config::Method;
use drystone::residuals::{Measure, Residuals};
use drystone::solver::{Order, Solver};
use drystone::{Backend, ContactProblem, Result};

use super::rounds::Clock;

/// Errors `e_vel` for which sweeps are reported.
const ERRORS: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveSettings {
    pub method: Method,
    pub order: Order,
    /// Passes over a manifold before the next one.
    pub passes: u8,
    /// Largest number of sweeps.
    pub sweeps: u32,
    /// Error `e_vel` below which the solve ends.
    pub tolerance: f64,
}

/// Report of one solve; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct SolveReport {
    pub problem: String,
    pub bodies: usize,
    pub contacts: usize,
    pub method: Method,
    pub order: Order,
    /// Passes over a manifold before the next one.
    pub passes: u8,
    /// `f64`, or `reference`, `cpu` or `gpu`, which are in f32.
    pub backend: String,
    pub adapter: String,
    pub colors: usize,
    /// Number of sweeps; the solve ends early if a number is not finite.
    pub sweeps: u32,
    /// Time of the single sweeps without measurements (ms).
    pub ms: f64,
    /// The sweeps to the errors 1e-1 to 1e-4.
    pub reached: Vec<Reached>,
    /// Errors after each power of two of sweeps, and after the last.
    pub curve: Vec<CurveRow>,
}

/// The first sweep after which `e_vel` is below an error; none if no sweep reaches it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Reached {
    pub e_vel: f64,
    pub sweeps: Option<u32>,
    /// Time of the sweeps (ms).
    pub ms: Option<f64>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub struct CurveRow {
    pub sweeps: u32,
    /// Time of the sweeps (ms).
    pub ms: f64,
    #[serde(flatten)]
    pub residuals: Residuals,
}

impl SolveSettings {
    pub fn by_manifolds(method: Method, passes: u8, sweeps: u32, tolerance: f64) -> Self {
        Self { method, order: Order::Manifolds, passes, sweeps, tolerance }
    }
}

impl SolveReport {
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
