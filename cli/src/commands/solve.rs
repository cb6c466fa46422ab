//! `drystone solve`.

use std::path::PathBuf;

use clap::Args;

use super::output::{print, print_json};
use super::words;
use crate::report::{CurveRow, SolveReport, SolveSettings};
use drystone::backend::BackendKind;
use drystone::config::Method;
use drystone::solver::Order;
use drystone::{ContactProblem, Error, Result};

/// Largest number of sweeps with a tolerance.
const MOST_SWEEPS: u32 = 40_000;

#[derive(Args)]
pub struct SolveArgs {
    /// A contact problem of `run --save-problem` (docs/contacts-format.md), or FCLIB's.
    file: PathBuf,
    /// Number of sweeps.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    sweeps: u32,
    /// Sweep until the error e_vel is less than this, at most 40000 times.
    #[arg(long, value_name = "ERROR", allow_hyphen_values = true, conflicts_with = "sweeps")]
    tolerance: Option<f64>,
    /// Method of the sweeps.
    #[arg(long, value_parser = words::of::<Method>(), default_value = "accelerated")]
    method: Method,
    /// Order of the sweeps.
    #[arg(long, value_parser = words::of::<Order>(), default_value_t)]
    order: Order,
    /// Passes over a manifold before the next one; the default is 2 by manifolds and 1 by contacts.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=16))]
    passes: Option<u8>,
    /// Backend that runs the sweeps; errors are always measured in f64.
    #[arg(long, value_parser = words::of::<BackendKind>(), default_value = "f64")]
    backend: BackendKind,
    /// Make the GPU give the reference's results to the last bit.
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
        let problem = ContactProblem::read(&self.file)?;
        let settings = SolveSettings {
            method: self.method,
            order: self.order,
            passes: self.passes.unwrap_or(self.order.passes()),
            sweeps: if self.tolerance.is_some() { MOST_SWEEPS } else { self.sweeps },
            tolerance: self.tolerance.unwrap_or(0.0),
        };
        let backend = (self.backend != BackendKind::F64).then(|| self.backend.open(self.exact)).transpose()?;
        let report = SolveReport::new(&problem, &settings, backend).map_err(|e| e.within(self.file.display()))?;
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
