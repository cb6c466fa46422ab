//! `drystone report convergence`: how many sweeps contact problems take to which error, plain and accelerated.

use std::fmt::Write as _;
use std::path::Path;

use drystone::config::Method;
use drystone::solver::Order;
use drystone::stats::median;
use drystone::{ContactProblem, Cpu, Error, Result, Scene, Simulation, SolverConfig};

use super::run::RunReport;
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

/// Scenes that are run under settings with equal numbers of sweeps, and their steps.
const RUNS: [(&str, &[&str], u32); 4] = [
    ("tower", &["n=20", "offset=0.01"], 300),
    ("wall", &[], 120),
    ("mass-ratio", &["ratio=1000"], 300),
    ("pile", &["n=1000"], 180),
];

/// Substeps, and sweeps of each kind in one: 16 or 64 in all.
const SETTINGS: [(u32, u32); 7] = [(8, 1), (4, 2), (2, 4), (1, 8), (32, 1), (4, 8), (2, 16)];

/// Makes the page from steps of catalogue scenes and the `.contacts` files of `folder`; `after_problem` is called with the
/// number of problems after each.
pub fn convergence(folder: Option<&Path>, mut after_problem: impl FnMut(usize)) -> Result<String> {
    let problems = problems(folder)?;
    let mut page = include_str!("convergence_head.md").to_owned();
    solves(&mut page, &problems, || after_problem(problems.len()))?;
    page.push_str(include_str!("convergence_tail.md"));
    runs(&mut page)?;
    Ok(page)
}

/// How many sweeps `problems` take to which error, and what momentum and repeated passes gain over them; `after_problem` is called
/// after each.
fn solves(page: &mut String, problems: &[ContactProblem], mut after_problem: impl FnMut()) -> Result<()> {
    page.push_str(
        "\n| problem | contacts | sweeps | 1e-1 | 1e-2 | 1e-3 | 1e-4 | after 32 |\n|---|--:|---|--:|--:|--:|--:|--:|\n",
    );
    let mut gains = [const { (Vec::new(), Vec::new()) }; KINDS.len()];
    for problem in problems {
        let mut first = None;
        for (kind, (fewer, lower)) in KINDS.iter().zip(&mut gains) {
            let report = solved(problem, *kind, MOST, 1e-4)?;
            let to = |i: usize| report.reached[i].sweeps.map_or(f64::INFINITY, f64::from);
            let after_32 = solved(problem, *kind, 32, 0.0)?.curve.last().map_or(f64::NAN, |row| row.residuals.e_vel);
            let (plain_sweeps, plain_error) = *first.get_or_insert((to(2), after_32));
            fewer.push(plain_sweeps / to(2));
            lower.push(plain_error / after_32);
            let sweeps = [0, 1, 2, 3].map(|i| report.reached[i].sweeps.map_or("-".into(), |n| n.to_string()));
            let (name, contacts) = (&problem.name, problem.contacts.len());
            let (name, contacts) =
                if *kind == KINDS[0] { (name.as_str(), contacts.to_string()) } else { ("", String::new()) };
            let _ = writeln!(
                page,
                "| {name} | {contacts} | {} | {} | {after_32:.1e} |",
                kind_name(*kind),
                sweeps.join(" | ")
            );
        }
        after_problem();
    }
    page.push_str("\nMedians over these problems, relative to plain sweeps with one pass:\n\n");
    page.push_str("| sweeps | sweeps to 1e-3, times fewer | error after 32 sweeps, times smaller |\n|---|--:|--:|\n");
    for (kind, (fewer, lower)) in KINDS.iter().zip(&gains).skip(1) {
        let _ = writeln!(page, "| {} | {:.1} | {:.1} |", kind_name(*kind), median(fewer), median(lower));
    }
    Ok(())
}

/// What plain and accelerated sweeps make of whole runs.
fn runs(page: &mut String) -> Result<()> {
    page.push_str(include_str!("convergence_runs.md"));
    page.push_str("\n| scene | substeps | sweeps | method | deepest [mm] | rms speed [mm/s] | in place |\n");
    page.push_str("|---|--:|--:|---|--:|--:|--:|\n");
    for (name, parameters, steps) in RUNS {
        let parameters: Vec<String> = parameters.iter().map(|p| (*p).into()).collect();
        let scene = Scene::find(name, &parameters)?;
        let mut title = [&[name.to_owned()], &parameters[..]].concat().join(" ");
        for (substeps, sweeps) in SETTINGS {
            // Momentum begins with the third sweep.
            let methods = if sweeps < 3 { &[Method::Plain][..] } else { &[Method::Plain, Method::Accelerated] };
            for &method in methods {
                let config = SolverConfig::default().without_sleep().with(|c| {
                    c.substeps = substeps;
                    c.iterations = sweeps;
                    c.relax = sweeps;
                    c.method = method;
                });
                let backend = Box::new(Cpu::new());
                let mut report = RunReport::new(&scene, &config, &*backend);
                let mut simulation = Simulation::new(scene.world.clone(), config, backend)?;
                for _ in 0..steps {
                    report.add(&simulation.step(scene.dt)?);
                }
                report.measure(&scene, simulation);
                let (deepest, speed) = (1e3 * report.penetration_max, 1e3 * report.speed_rms);
                let method = format!("{method:?}").to_lowercase();
                let in_place =
                    if scene.stands { format!("{} of {}", report.in_place, report.bodies) } else { String::new() };
                let _ = writeln!(
                    page,
                    "| {} | {substeps} | {sweeps} + {sweeps} | {method} | {deepest:.2} | {speed:.2} | {in_place} |",
                    std::mem::take(&mut title)
                );
            }
        }
    }
    Ok(())
}

fn kind_name((method, passes): (Method, u8)) -> String {
    format!("{method:?}, {passes} pass{}", if passes == 1 { "" } else { "es" }).to_lowercase()
}

fn solved(
    problem: &ContactProblem,
    (method, passes): (Method, u8),
    sweeps: u32,
    tolerance: f64,
) -> Result<SolveReport> {
    let settings = SolveSettings { method, order: Order::Manifolds, passes, sweeps, tolerance };
    SolveReport::new(problem, &settings, None)
}

/// Contact problems: steps of catalogue scenes, then the `.contacts` files of a folder by their names.
pub fn problems(folder: Option<&Path>) -> Result<Vec<ContactProblem>> {
    let mut problems = Vec::new();
    for (name, parameters, step) in STEPS {
        let parameters: Vec<String> = parameters.iter().map(|p| (*p).into()).collect();
        let scene = Scene::find(name, &parameters)?;
        let mut simulation =
            Simulation::new(scene.world, SolverConfig::default().without_sleep(), Box::new(Cpu::new()))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers in a cell of the page's tables that begin with this.
    fn cells(page: &str, begins: &str) -> Vec<Vec<String>> {
        let lines = page.lines().filter(|l| l.starts_with(begins));
        lines.map(|l| l.split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
    }

    /// A tower of four, of which one problem is made: medians over one are its own.
    #[test]
    fn gains_are_plain_over_own() {
        let scene = Scene::find("tower", &["n=4".into()]).expect("the scene");
        let mut simulation =
            Simulation::new(scene.world, SolverConfig::default(), Box::new(Cpu::new())).expect("a simulation");
        let problem = simulation.step_with_contacts("tower", scene.dt).expect("a problem").0;
        let (mut page, mut solved) = (String::new(), 0);
        solves(&mut page, std::slice::from_ref(&problem), || solved += 1).expect("solves");
        assert_eq!(solved, 1);
        // | problem | contacts | sweeps | 1e-1 | 1e-2 | 1e-3 | 1e-4 | after 32 |
        let first = cells(&page, "| tower | ").remove(0);
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{cell} in {page}"));
        for kind in ["plain, 2 passes", "accelerated, 1 pass", "accelerated, 2 passes"] {
            let own = cells(&page, &format!("|  |  | {kind} |")).remove(0);
            let gain = cells(&page, &format!("| {kind} |")).remove(0);
            let fewer = number(&first[6]) / number(&own[6]);
            assert!((number(&gain[2]) - fewer).abs() <= 0.051, "{kind}: {fewer} times fewer sweeps to 1e-3, in {page}");
            // Errors are printed with two digits.
            let lower = number(&first[8]) / number(&own[8]);
            assert!((number(&gain[3]) / lower - 1.0).abs() < 0.12, "{kind}: {lower} times lower, in {page}");
            assert!(fewer > 1.0, "{kind} gains nothing: {page}");
        }
    }
}
