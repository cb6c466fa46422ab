//! Report of one solve of a contact problem.

use std::time::Duration;

use serde::Serialize;

use drystone::config::Method;
use drystone::glam::DVec3;
use drystone::{Backend, Result};
use drystone_problems::contacts::{ContactProblem, LocalProblem, Problem};
use drystone_problems::residuals::{Measure, Residuals};
use drystone_problems::solver::newton::{Blocks, Bodies, Ended, NewtonEnded, Outcome, Sweeps, newton};
use drystone_problems::solver::{Order, Solver};

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
    /// `f64`, or a backend in f32: `reference`, `cpu` or `gpu`.
    pub backend: String,
    pub adapter: String,
    pub colors: usize,
    /// Number of sweeps. The solve ends early if a number is not finite.
    pub sweeps: u32,
    /// Total time of the sweeps, without measurements (ms).
    pub ms: f64,
    /// Sweeps until the errors 1e-1 to 1e-4.
    pub reached: Vec<Reached>,
    /// Errors after each power of two of sweeps, and after the last.
    pub curve: Vec<CurveRow>,
}

/// The first sweep after which `e_vel` is below an error; `None` if no sweep reaches it.
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
        let &SolveSettings { method, order, passes, .. } = settings;
        let measure = Measure::new(problem);
        let name = backend.as_ref().map_or("f64", |b| b.name());
        let mut solver = Solver::new(problem, method, order, backend)?.with_passes(passes);
        let report = Self {
            problem: problem.name.clone(),
            bodies: problem.bodies.len(),
            contacts: problem.contacts.len(),
            adapter: solver.adapter(),
            colors: solver.colors(),
            ..Self::begun(settings, name)
        };
        let residuals = |solver: &Solver| measure.of(&solver.impulses(), &solver.velocities());
        report.swept(settings, &mut solver, |solver| solver.advance(1), residuals)
    }

    /// Solves a problem without bodies in f64, contact by contact.
    pub fn of_blocks(problem: &LocalProblem, settings: &SolveSettings) -> Result<Self> {
        let blocks = Blocks::new(problem);
        let mut sweeps = Sweeps::new(&blocks, settings.method, vec![DVec3::ZERO; problem.rows.len()]);
        let report = Self {
            problem: problem.name.clone(),
            contacts: problem.rows.len(),
            adapter: ADAPTER.into(),
            colors: problem.colors().len(),
            ..Self::begun(&SolveSettings { order: Order::Contacts, passes: 1, ..*settings }, "f64")
        };
        let advance = |sweeps: &mut Sweeps| {
            sweeps.advance(&blocks);
            Ok(())
        };
        report.swept(settings, &mut sweeps, advance, |sweeps| Residuals::of_blocks(problem, sweeps.impulses()))
    }

    fn begun(&SolveSettings { method, order, passes, .. }: &SolveSettings, backend: &str) -> Self {
        Self {
            problem: String::new(),
            bodies: 0,
            contacts: 0,
            method,
            order,
            passes,
            backend: backend.into(),
            adapter: String::new(),
            colors: 0,
            sweeps: 0,
            ms: 0.0,
            reached: ERRORS.map(|e_vel| Reached { e_vel, sweeps: None, ms: None }).to_vec(),
            curve: Vec::new(),
        }
    }

    fn swept<S>(
        mut self,
        &SolveSettings { sweeps, tolerance, .. }: &SolveSettings,
        solver: &mut S,
        advance: impl Fn(&mut S) -> Result<()>,
        measure: impl Fn(&S) -> Residuals,
    ) -> Result<Self> {
        let clock = Clock::of(&self.backend);
        let mut time = Duration::ZERO;
        for sweep in 1..=sweeps {
            let begin = clock.now();
            advance(solver)?;
            time += clock.now() - begin;
            let ms = time.as_secs_f64() * 1e3;
            let residuals = measure(solver);
            let e_vel = residuals.e_vel;
            (self.sweeps, self.ms) = (sweep, ms);
            for reached in self.reached.iter_mut().filter(|r| r.sweeps.is_none() && e_vel < r.e_vel) {
                (reached.sweeps, reached.ms) = (Some(sweep), Some(ms));
            }
            let last = sweep == sweeps || e_vel < tolerance || e_vel.is_nan();
            if last || sweep.is_power_of_two() {
                self.curve.push(CurveRow { sweeps: sweep, ms, residuals });
            }
            if last {
                break;
            }
        }
        Ok(self)
    }
}

/// The adapter name for f64 without a backend.
const ADAPTER: &str = "one thread, scalar f64";

/// Report of one solve by Newton's method; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct NewtonReport {
    pub problem: String,
    /// Number of movable bodies; 0 for a problem without bodies.
    pub bodies: usize,
    pub contacts: usize,
    /// Always `newton`.
    pub method: &'static str,
    /// Always `f64`.
    pub backend: &'static str,
    /// Requested error `e_vel`.
    pub tolerance: f64,
    /// Steps of Newton's method.
    pub iterations: u32,
    /// Sweeps before and after Newton's method.
    pub sweeps: u32,
    /// The reason why the solve ended.
    pub ended: Ended,
    /// The reason why Newton's method ended.
    pub newton: NewtonEnded,
    /// Time from the problem in memory to the impulses (ms).
    pub ms: f64,
    pub residuals: Residuals,
    /// The impulse of each contact: normal, first and second tangent (N s).
    pub impulses: Vec<[f64; 3]>,
}

impl NewtonReport {
    /// Solves a problem to a tolerance, with at most `most` sweeps.
    pub fn new(problem: &Problem, tolerance: f64, most: u32) -> Self {
        let clock = Clock::of("f64");
        let begin = clock.now();
        let outcome = match problem {
            Problem::Bodies(problem) => newton(&mut Bodies::new(problem), tolerance, most),
            Problem::Blocks(problem) => newton(&mut Blocks::new(problem), tolerance, most),
        };
        let ms = (clock.now() - begin).as_secs_f64() * 1e3;
        let Outcome { impulses, sweeps, steps, ended, newton, .. } = outcome;
        let (name, bodies, residuals) = match problem {
            Problem::Bodies(p) => (&p.name, p.bodies.len(), Residuals::of(p, &impulses)),
            Problem::Blocks(p) => (&p.name, 0, Residuals::of_blocks(p, &impulses)),
        };
        Self {
            problem: name.clone(),
            bodies,
            contacts: impulses.len(),
            method: "newton",
            backend: "f64",
            tolerance,
            iterations: steps,
            sweeps,
            ended,
            newton,
            ms,
            residuals,
            impulses: impulses.iter().map(DVec3::to_array).collect(),
        }
    }
}
