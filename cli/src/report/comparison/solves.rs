//! Contact problems: time against error for each solver.

use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use super::origin::{Origin, fnv};
use crate::report::rounds::interleave;
use crate::report::solve::{SolveReport, SolveSettings};
use drystone::config::Method;
use drystone::stats::quantile;
use drystone::{Backend, Cpu, Result};
use drystone_problems::ContactProblem;

/// The solvers: a method, in f64 or on the CPU lanes.
const SOLVERS: [(Method, &str); 4] =
    [(Method::Plain, "f64"), (Method::Accelerated, "f64"), (Method::Plain, "cpu"), (Method::Accelerated, "cpu")];

const TURNS: usize = 3;

const MOST: u32 = 2000;

/// Time and error of one solver on one problem after a number of sweeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolveRow {
    pub problem: String,
    pub hash: String,
    pub run: String,
    /// As in [`Origin`].
    pub build: String,
    pub commit: String,
    pub machine: String,
    pub contacts: usize,
    pub method: String,
    /// `f64`, or `cpu` for f32.
    pub backend: String,
    pub sweeps: u32,
    /// Time of the sweeps (ms): median, least and largest over the turns.
    pub ms: f64,
    pub ms_low: f64,
    pub ms_high: f64,
    /// The error after the sweeps, or the round number that the error passed in the last sweep.
    pub e_vel: f64,
}

impl SolveRow {
    pub fn solver(&self) -> String {
        format!("{} {}", self.method, self.backend)
    }
}

pub fn solves(problem: &ContactProblem, origin: &Origin) -> Result<Vec<SolveRow>> {
    let run = Origin::now();
    let mut solvers = SOLVERS.map(|solver| (solver, Vec::new()));
    interleave(TURNS, &mut solvers, |_, ((method, backend), reports)| {
        let settings = SolveSettings::by_manifolds(*method, 1, MOST, 1e-4);
        let backend = (*backend == "cpu").then(|| Box::new(Cpu::new()) as Box<dyn Backend>);
        reports.push(SolveReport::new(problem, &settings, backend)?);
        Ok(())
    })?;
    let row = |report: &SolveReport, (sweeps, e_vel): (u32, f64), ms: &[f64]| SolveRow {
        problem: problem.name.clone(),
        hash: hash(problem),
        run: run.clone(),
        build: origin.build.clone(),
        commit: origin.commit.clone(),
        machine: origin.machine.clone(),
        contacts: report.contacts,
        method: format!("{:?}", report.method).to_lowercase(),
        backend: report.backend.clone(),
        sweeps,
        ms: quantile(ms, 0.5),
        ms_low: quantile(ms, 0.0),
        ms_high: quantile(ms, 1.0),
        e_vel,
    };
    let mut rows = Vec::new();
    for (_, of) in &solvers {
        // Turns differ only in their times.
        let all: Vec<_> = of.iter().map(points).collect();
        for (i, &(sweeps, e_vel, _)) in all[0].iter().enumerate() {
            let ms: Vec<_> = all.iter().map(|points| points[i].2).collect();
            rows.push(row(&of[0], (sweeps, e_vel), &ms));
        }
    }
    Ok(rows)
}

/// Sweeps, error and time at powers of two of sweeps, and at the sweeps in which the error falls below round numbers.
fn points(report: &SolveReport) -> Vec<(u32, f64, f64)> {
    let curve = report.curve.iter().map(|row| (row.sweeps, row.residuals.e_vel, row.ms));
    let reached = report.reached.iter().filter_map(|r| Some((r.sweeps?, r.e_vel, r.ms?)));
    let mut points: Vec<_> = curve.chain(reached).collect();
    points.sort_by_key(|p| p.0);
    points
}

pub fn hash(problem: &impl Debug) -> String {
    fnv(format!("{problem:?}").as_bytes())
}
