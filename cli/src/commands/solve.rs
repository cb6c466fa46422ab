//! `drystone solve`.

use std::path::PathBuf;

use clap::Args;

use super::output::{print, print_json};
use super::words::{self, SolveMethod};
use crate::report::{CurveRow, NewtonReport, SolveReport, SolveSettings};
use drystone::backend::BackendKind;
use drystone::config::Method;
use drystone::{Error, Result};
use drystone_problems::contacts::Problem;
use drystone_problems::solver::Order;
use drystone_problems::solver::newton::{Ended, NewtonEnded};

/// Largest number of sweeps with a tolerance.
const MAX_SWEEPS: u32 = 40_000;

/// Default number of sweeps.
const SWEEPS: u32 = 512;

/// Default error at which Newton's method ends.
const TOLERANCE: f64 = 1e-8;

#[derive(Args)]
pub struct SolveArgs {
    /// A contact problem of `run --save-problem` (docs/contacts-format.md), or an FCLIB file.
    file: PathBuf,
    /// Number of sweeps; the default is 512.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    sweeps: Option<u32>,
    /// Solve until the error e_vel is less than this, with at most 40000 sweeps. With Newton's method the default is
    /// 1e-8.
    #[arg(long, value_name = "ERROR", allow_hyphen_values = true, conflicts_with = "sweeps")]
    tolerance: Option<f64>,
    /// Method of solution.
    #[arg(long, value_parser = words::of::<SolveMethod>(), default_value = "accelerated")]
    method: SolveMethod,
    /// Order of the sweeps; the default is manifolds, or contacts for a problem without bodies.
    #[arg(long, value_parser = words::of::<Order>())]
    order: Option<Order>,
    /// Passes over a manifold before the next one; the default is 2 with manifolds and 1 with contacts.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=16))]
    passes: Option<u8>,
    /// Backend that runs the sweeps; errors are always measured in f64.
    #[arg(long, value_parser = words::of::<BackendKind>(), default_value = "f64")]
    backend: BackendKind,
    /// Make results of the GPU equal to the reference to the last bit.
    #[arg(long)]
    exact: bool,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl SolveArgs {
    pub fn run(&self) -> Result<()> {
        if let Some(tolerance) = self.tolerance.filter(|t| !(t.is_finite() && *t > 0.0)) {
            return Err(Error::input(format!("--tolerance {tolerance}: must be more than 0")));
        }
        let problem = Problem::read(&self.file)?;
        let report = match (self.method, &problem) {
            (SolveMethod::Newton, problem) => return self.newton(problem),
            (SolveMethod::Sweeps(method), Problem::Bodies(problem)) => {
                let settings = self.settings(method, self.order.unwrap_or_default());
                let backend = (self.backend != BackendKind::F64).then(|| self.backend.open(self.exact)).transpose()?;
                SolveReport::new(problem, &settings, backend)
            }
            (SolveMethod::Sweeps(method), Problem::Blocks(problem)) => {
                let bodies = || format!("{}: fclib_local: has no bodies", self.file.display());
                if self.backend != BackendKind::F64 {
                    let name = self.backend;
                    return Err(Error::input(format!("{}: use --backend f64, not {name}", bodies())));
                }
                if self.order == Some(Order::Manifolds) || self.passes.is_some_and(|passes| passes > 1) {
                    return Err(Error::input(format!("{}: use --order contacts with one pass", bodies())));
                }
                SolveReport::of_blocks(problem, &self.settings(method, Order::Contacts))
            }
        };
        let report = report.map_err(|e| e.within(self.file.display()))?;
        if self.json {
            print_json(&report)?;
        } else {
            print_table(&report)?;
        }
        if report.curve.last().is_some_and(|row| row.residuals.e_vel.is_nan()) {
            let path = self.file.display();
            return Err(Error::input(format!("{path}: impulses left the finite range after {} sweeps", report.sweeps)));
        }
        Ok(())
    }

    fn settings(&self, method: Method, order: Order) -> SolveSettings {
        SolveSettings {
            method,
            order,
            passes: self.passes.unwrap_or(order.passes()),
            sweeps: if self.tolerance.is_some() { MAX_SWEEPS } else { self.sweeps.unwrap_or(SWEEPS) },
            tolerance: self.tolerance.unwrap_or(0.0),
        }
    }

    fn newton(&self, problem: &Problem) -> Result<()> {
        let given = [
            ("--sweeps", self.sweeps.is_some()),
            ("--order", self.order.is_some()),
            ("--passes", self.passes.is_some()),
            ("--exact", self.exact),
        ];
        if let Some((name, _)) = given.into_iter().find(|given| given.1) {
            return Err(Error::input(format!("{name}: not available with --method newton")));
        }
        if self.backend != BackendKind::F64 {
            return Err(Error::input(format!("--backend {}: --method newton runs in f64", self.backend)));
        }
        let r = NewtonReport::new(problem, self.tolerance.unwrap_or(TOLERANCE), MAX_SWEEPS);
        if r.residuals.e_vel.is_nan() {
            return Err(Error::input(format!("{}: impulses left the finite range", self.file.display())));
        }
        if self.json {
            return print_json(&r);
        }
        print(format_args!("{}: {} bodies, {} contacts", r.problem, r.bodies, r.contacts))?;
        print(format_args!("newton: {} steps and {} sweeps in {:.3} ms on f64", r.iterations, r.sweeps, r.ms))?;
        let x = &r.residuals;
        print(format_args!("e_vel {:.2e}, vmax {:.2e} m/s, ended by {}", x.e_vel, x.vmax, ended(&r)))
    }
}

/// The reason why a solve ended.
fn ended(r: &NewtonReport) -> String {
    let newton = match r.newton {
        NewtonEnded::NotBegun => "Newton's method was not needed",
        NewtonEnded::Reached => "Newton's method reached the tolerance",
        NewtonEnded::Stalled => "the error of Newton's method no longer fell",
        NewtonEnded::Blocked => "Newton's method found no further step",
        _ => "Newton's method ended",
    };
    let by = match r.ended {
        Ended::FirstSweeps => "sweeps",
        Ended::Newton => "Newton's method",
        Ended::LastSweeps => "sweeps after Newton's method",
        _ => "the limit of sweeps",
    };
    format!("{by} ({newton})")
}

fn print_table(r: &SolveReport) -> Result<()> {
    print(format_args!("{}: {} bodies, {} contacts, {} colors", r.problem, r.bodies, r.contacts, r.colors))?;
    let words = format!("{:?} sweeps by {:?}", r.method, r.order).to_lowercase();
    print(format_args!("{words}: {} in {:.3} ms on {}: {}", r.sweeps, r.ms, r.backend, r.adapter))?;
    let names = ["e_vel", "e_fclib", "vmax m/s", "contact", "pen m/s", "compl J", "cone N s", "diss J", "eom"];
    print(format_args!(" sweeps         ms{}", names.map(|name| format!(" {name:>8}")).concat()))?;
    for CurveRow { sweeps, ms, residuals: x } in &r.curve {
        let worst = x.worst_contact.map_or("none".into(), |i| i.to_string());
        let (errors, others) = ([x.e_vel, x.e_fclib, x.vmax], [x.pen_rate, x.compl, x.cone, x.diss, x.eom]);
        let columns = |numbers: &[f64]| numbers.iter().map(|x| format!(" {x:8.2e}")).collect::<String>();
        print(format_args!("{sweeps:7} {ms:10.3}{} {worst:>8}{}", columns(&errors), columns(&others)))?;
    }
    for reached in &r.reached {
        match (reached.sweeps, reached.ms) {
            (Some(sweeps), Some(ms)) => {
                print(format_args!("e_vel < {:.0e} after {sweeps} sweeps, {ms:.3} ms", reached.e_vel))?
            }
            _ => print(format_args!("e_vel < {:.0e} not reached", reached.e_vel))?,
        }
    }
    Ok(())
}
