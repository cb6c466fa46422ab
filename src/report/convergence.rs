//! `drystone report convergence`: how many sweeps contact problems take to which error, plain and accelerated.

use std::fmt::Write as _;
use std::path::Path;

use crate::backend::cpu::Cpu;
use crate::config::{Method, SolverConfig};
use crate::contacts::ContactProblem;
use crate::error::{Error, Result};
use crate::scenes::Scene;
use crate::simulation::Simulation;
use crate::solver::Order;
use crate::stats::median;

use super::solve::{SolveReport, SolveSettings};

/// Scenes of the catalogue whose steps are solved, with their parameters and the step.
const STEPS: [(&str, &[&str], u32); 5] = [
    ("tower", &["n=10"], 30),
    ("wall", &["rows=8", "columns=8"], 60),
    ("pyramid", &[], 30),
    ("pile", &["n=200"], 90),
    ("pile", &["n=200"], 300),
];

/// What is compared: a method, and how often a manifold is swept before the next one.
const KINDS: [(Method, u8); 4] =
    [(Method::Plain, 1), (Method::Plain, 2), (Method::Accelerated, 1), (Method::Accelerated, 2)];

/// Most sweeps of one solve.
const MOST: u32 = 40_000;

/// Makes the page from steps of catalogue scenes and the `.contacts` files of `folder`; `after_problem` is called with the
/// number of problems after each.
///
/// # Errors
/// A file that cannot be read or solved.
pub fn convergence(folder: Option<&Path>, mut after_problem: impl FnMut(usize)) -> Result<String> {
    let problems = problems(folder)?;
    let mut page = include_str!("convergence_head.md").to_owned();
    page.push_str(
        "\n| problem | contacts | sweeps | 1e-1 | 1e-2 | 1e-3 | 1e-4 | after 32 |\n|---|--:|---|--:|--:|--:|--:|--:|\n",
    );
    let mut gains = [const { (Vec::new(), Vec::new()) }; KINDS.len()];
    for problem in &problems {
        let mut first = None;
        for (kind, (fewer, lower)) in KINDS.iter().zip(&mut gains) {
            let report = solved(problem, *kind)?;
            let to = |i: usize| report.reached[i].sweeps.map_or(f64::INFINITY, f64::from);
            let after_32 = report.curve.iter().find(|row| row.sweeps == 32).map_or(0.0, |row| row.residuals.e_vel);
            let (plain_sweeps, plain_error) = *first.get_or_insert((to(2), after_32));
            fewer.push(plain_sweeps / to(2));
            lower.push(plain_error / after_32.max(f64::MIN_POSITIVE));
            let sweeps = [0, 1, 2, 3].map(|i| report.reached[i].sweeps.map_or("-".into(), |n| n.to_string()));
            let (name, contacts) = (&problem.name, problem.contacts.len());
            let (name, contacts) =
                if *kind == KINDS[0] { (name.as_str(), contacts.to_string()) } else { ("", String::new()) };
            line(
                &mut page,
                format_args!(
                    "| {name} | {contacts} | {} | {} | {after_32:.1e} |",
                    kind_name(*kind),
                    sweeps.join(" | ")
                ),
            );
        }
        after_problem(problems.len());
    }
    page.push_str("\nMedians over these problems, against plain sweeps with one pass:\n\n");
    page.push_str("| sweeps | times fewer to 1e-3 | times lower after 32 |\n|---|--:|--:|\n");
    for (kind, (fewer, lower)) in KINDS.iter().zip(&gains).skip(1) {
        line(&mut page, format_args!("| {} | {:.1} | {:.1} |", kind_name(*kind), median(fewer), median(lower)));
    }
    page.push_str(include_str!("convergence_tail.md"));
    Ok(page)
}

fn line(page: &mut String, text: std::fmt::Arguments) {
    writeln!(page, "{text}").expect("a string takes everything");
}

fn kind_name((method, passes): (Method, u8)) -> String {
    format!("{method:?}, {passes} pass{}", if passes == 1 { "" } else { "es" }).to_lowercase()
}

fn solved(problem: &ContactProblem, (method, passes): (Method, u8)) -> Result<SolveReport> {
    let settings = SolveSettings { method, order: Order::Manifolds, passes, sweeps: MOST, tolerance: 1e-4 };
    SolveReport::new(problem, &settings, None)
}

/// Steps of catalogue scenes, then the files of a folder by their names.
fn problems(folder: Option<&Path>) -> Result<Vec<ContactProblem>> {
    let mut problems = Vec::new();
    for (name, parameters, step) in STEPS {
        let parameters: Vec<String> = parameters.iter().map(|p| (*p).into()).collect();
        let scene = Scene::find(name, &parameters)?;
        let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Cpu::new()))?;
        for _ in 1..step {
            simulation.step(scene.dt)?;
        }
        problems.push(simulation.step_with_contacts(&format!("{}, step {step}", scene.name), scene.dt)?.0);
    }
    if let Some(folder) = folder {
        let entries = std::fs::read_dir(folder).and_then(|all| all.map(|e| e.map(|e| e.path())).collect());
        let mut paths: Vec<_> = entries.map_err(Error::file(folder))?;
        paths.retain(|path| path.extension().is_some_and(|e| e == "contacts"));
        paths.sort();
        for path in paths {
            problems.push(ContactProblem::read(path)?);
        }
    }
    Ok(problems)
}
