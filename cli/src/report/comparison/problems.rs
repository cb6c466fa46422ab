//! The section of the page on contact problems.

use std::fmt::Write as _;

use super::html::{cell, escape, inline, profile_picture, table};
use super::solves::SolveRow;
use crate::report::number::number;
use crate::report::plot::Scale::Decades;
use crate::report::plot::{Frame, Look, Series, svg};

/// Errors for which tables have times.
const SOLVED: [f64; 3] = [1e-1, 1e-2, 1e-3];

pub(super) fn problems(html: &mut String, solves: &[Vec<SolveRow>]) {
    if solves.is_empty() {
        return;
    }
    let solvers = solvers(solves);
    let _ = writeln!(
        html,
        "<h2>Contact problems</h2>\n<p>The problems are single steps with hard contacts, solved from zero impulses. The error e_vel is the natural map in \
         velocities. Time is that of the sweeps one by one on one core, the least of three equal rounds, on the f64 reference or on the CPU lanes in f32 \
         (cpu). The curves show the share of {} problems that a solver solves to an error within a factor of the time of the fastest solver.</p>\n\
         <div class=\"pictures\">",
        solves.len()
    );
    for level in SOLVED {
        let costs: Vec<Vec<_>> =
            solvers.iter().map(|s| solves.iter().map(|rows| time_to(rows, s, level)).collect()).collect();
        let title = format!("e_vel of at most {level}");
        let named: Vec<_> = (0..).zip(&solvers).map(|(k, solver)| (solver.clone(), Look::nth(k))).collect();
        html.push_str(&inline(&profile_picture(&title, "share of problems", solves.len(), &named, &costs)));
    }
    html.push_str("</div>\n<h3>Time to an error [ms]</h3>\n");
    let time = |rows: &[SolveRow], level, solver: &str| time_to(rows, solver, level).map_or("-".into(), number);
    grid_table(html, solves, &solvers, SOLVED.map(|level| (level, level.to_string())), time);
    html.push_str("<h3>e_vel in a given time</h3>\n");
    let error = |rows: &[SolveRow], ms, solver: &str| {
        let fit = rows.iter().filter(|row| row.solver() == *solver && row.ms_low <= ms).map(|row| row.e_vel);
        fit.min_by(f64::total_cmp).map_or("-".into(), |e| format!("{e:.1e}"))
    };
    grid_table(html, solves, &solvers, [1.0, 2.0, 4.0, 8.0].map(|ms| (ms, format!("{ms} ms"))), error);
    html.push_str("<details><summary>Curves of all problems</summary><div class=\"pictures\">");
    for rows in solves {
        html.push_str(&inline(&curves(rows, &solvers)));
    }
    html.push_str("</div></details>\n");
}

/// The solvers in the order of the rows.
fn solvers(solves: &[Vec<SolveRow>]) -> Vec<String> {
    let mut solvers: Vec<String> = Vec::new();
    for solver in solves.iter().flatten().map(SolveRow::solver) {
        if !solvers.contains(&solver) {
            solvers.push(solver);
        }
    }
    solvers
}

/// A table with a row for each problem, and a column for each value and solver.
fn grid_table<const N: usize>(
    html: &mut String,
    solves: &[Vec<SolveRow>],
    solvers: &[String],
    values: [(f64, String); N],
    text: impl Fn(&[SolveRow], f64, &str) -> String,
) {
    let columns = || values.iter().flat_map(|value| solvers.iter().map(move |solver| (value, solver)));
    let mut headings = vec!["problem".to_owned(), "contacts".to_owned()];
    headings.extend(columns().map(|((_, name), solver)| format!("{name}<br>{solver}")));
    let row = |rows: &Vec<SolveRow>| {
        let mut cells = vec![cell("", escape(&rows[0].problem)), cell("", rows[0].contacts)];
        cells.extend(columns().map(|((value, _), solver)| cell("", text(rows, *value, solver))));
        cells
    };
    table(html, &headings, solves.iter().map(row));
}

/// Least time to reach an error with a solver (ms).
fn time_to(rows: &[SolveRow], solver: &str, level: f64) -> Option<f64> {
    let fit = rows.iter().filter(|row| row.solver() == solver && row.e_vel <= level);
    fit.map(|row| row.ms_low).min_by(f64::total_cmp)
}

fn curves(rows: &[SolveRow], solvers: &[String]) -> String {
    let series = solvers.iter().enumerate().map(|(look, name)| {
        let of = rows.iter().filter(|row| row.solver() == *name && row.e_vel > 0.0);
        let line: Vec<_> = of.clone().map(|row| (row.ms_low, row.e_vel)).collect();
        let points = line.iter().map(|&(ms, e)| (ms, e, String::new())).collect();
        Series { name: name.clone(), look: Look::nth(look), points, line }
    });
    let frame =
        Frame { title: &rows[0].problem, x: "time [ms]", y: "e_vel", scales: (Decades, Decades), size: (480, 300) };
    svg(&frame, &series.collect::<Vec<_>>())
}
