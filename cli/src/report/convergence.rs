//! `drystone report convergence`: the numbers of plain and accelerated sweeps that contact problems need to reach an
//! error.

use std::fmt::Write as _;
use std::path::Path;

use drystone::config::Method;
use drystone::stats::median;
use drystone::{Cpu, Error, Result, Simulation, SolverConfig};
use drystone_problems::ContactProblem;
use drystone_scenes::Scene;

use super::run::RunReport;
use super::solve::{SolveReport, SolveSettings};

/// Catalogue scenes, each with the step to solve.
const STEPS: [(&str, u32); 5] =
    [("tower:n=10", 30), ("wall:rows=8,columns=8", 60), ("pyramid", 30), ("pile:n=200", 90), ("pile:n=200", 300)];

/// Kinds of sweeps: the method, and the passes over a manifold before the next one.
const KINDS: [(Method, u8); 4] =
    [(Method::Plain, 1), (Method::Plain, 2), (Method::Accelerated, 1), (Method::Accelerated, 2)];

const MOST: u32 = 40_000;

/// Scenes that run with equal numbers of sweeps, and their steps.
const RUNS: [(&str, u32); 4] =
    [("tower:n=20,offset=0.01", 300), ("wall", 120), ("mass-ratio:ratio=1000", 300), ("pile:n=1000", 180)];

/// Substeps, and biased (and relax) sweeps per substep: 16 or 64 sweeps in total.
const SETTINGS: [(u32, u32); 7] = [(8, 1), (4, 2), (2, 4), (1, 8), (32, 1), (4, 8), (2, 16)];

/// Makes the page from steps of catalogue scenes and the `.contacts` files of `folder`. Calls `after_problem` after
/// each problem with the number of problems.
pub fn convergence(folder: Option<&Path>, mut after_problem: impl FnMut(usize)) -> Result<String> {
    let problems = problems(folder)?;
    let mut page = include_str!("convergence_head.md").to_owned();
    solves(&mut page, &problems, || after_problem(problems.len()))?;
    page.push_str(include_str!("convergence_tail.md"));
    runs(&mut page)?;
    Ok(page)
}

/// Writes the sweeps of each kind to each error, and the medians of their gains over plain sweeps with one pass.
fn solves(page: &mut String, problems: &[ContactProblem], mut after_problem: impl FnMut()) -> Result<()> {
    page.push_str(
        "\n| problem | contacts | sweeps | 1e-1 | 1e-2 | 1e-3 | 1e-4 | after 32 |\n|---|--:|---|--:|--:|--:|--:|--:|\n",
    );
    let mut gains = [const { (Vec::new(), Vec::new()) }; KINDS.len()];
    for problem in problems {
        let mut first = None;
        for (kind, (fewer, lower)) in KINDS.iter().zip(&mut gains) {
            let solved = |sweeps, tolerance| {
                SolveReport::new(problem, &SolveSettings::by_manifolds(kind.0, kind.1, sweeps, tolerance), None)
            };
            let report = solved(MOST, 1e-4)?;
            let to = |i: usize| report.reached[i].sweeps.map_or(f64::INFINITY, f64::from);
            let after_32 = solved(32, 0.0)?.curve.last().map_or(f64::NAN, |row| row.residuals.e_vel);
            let (plain_sweeps, plain_error) = *first.get_or_insert((to(2), after_32));
            fewer.push(plain_sweeps / to(2));
            lower.push(plain_error / after_32);
            let sweeps = [0, 1, 2, 3].map(|i| report.reached[i].sweeps.map_or("-".into(), |n| n.to_string()));
            let begin =
                if *kind == KINDS[0] { format!("{} | {}", problem.name, problem.contacts.len()) } else { " | ".into() };
            let (kind, sweeps) = (kind_name(*kind), sweeps.join(" | "));
            let _ = writeln!(page, "| {begin} | {kind} | {sweeps} | {after_32:.1e} |");
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

fn runs(page: &mut String) -> Result<()> {
    page.push_str(include_str!("convergence_runs.md"));
    page.push_str("\n| scene | substeps | sweeps | method | deepest [mm] | rms speed [mm/s] | in place |\n");
    page.push_str("|---|--:|--:|---|--:|--:|--:|\n");
    for (spec, steps) in RUNS {
        let scene = Scene::find_spec(spec)?;
        let mut title = spec.replace([':', ','], " ");
        for (substeps, sweeps) in SETTINGS {
            // Momentum starts with the third sweep.
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
                let mut simulation = Simulation::with(scene.world.clone(), config, backend)?;
                (0..steps).try_for_each(|_| simulation.step(scene.dt).map(|stats| report.add(&stats)))?;
                report.measure(&scene, simulation);
                let RunReport { in_place, bodies, penetration_max: deepest, speed_rms: speed, .. } = report;
                let (deepest, speed, title) = (1e3 * deepest, 1e3 * speed, std::mem::take(&mut title));
                let method = format!("{method:?}").to_lowercase();
                let in_place = if scene.stands { format!("{in_place} of {bodies}") } else { String::new() };
                let _ = writeln!(
                    page,
                    "| {title} | {substeps} | {sweeps} + {sweeps} | {method} | {deepest:.2} | {speed:.2} | {in_place} |"
                );
            }
        }
    }
    Ok(())
}

fn kind_name((method, passes): (Method, u8)) -> String {
    format!("{method:?}, {passes} pass{}", if passes == 1 { "" } else { "es" }).to_lowercase()
}

/// The contact problem of a step of a scene, with default settings and without sleep. Step 1 is the first.
pub fn problem_of_step(scene: Scene, step: u32) -> Result<ContactProblem> {
    let mut simulation = Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(Cpu::new()))?;
    (1..step).try_for_each(|_| simulation.step(scene.dt).map(drop))?;
    Ok(drystone_problems::step_with_contacts(&mut simulation, &format!("{}, step {step}", scene.name), scene.dt)?.0)
}

/// Contact problems: steps of catalogue scenes, then the `.contacts` files of a folder, sorted by name.
pub fn problems(folder: Option<&Path>) -> Result<Vec<ContactProblem>> {
    let mut problems = Vec::new();
    for (spec, step) in STEPS {
        problems.push(problem_of_step(Scene::find_spec(spec)?, step)?);
    }
    if let Some(folder) = folder {
        let entries = std::fs::read_dir(folder).and_then(|all| all.map(|e| e.map(|e| e.path())).collect());
        let mut paths: Vec<_> = entries.map_err(Error::file(folder))?;
        paths.retain(|path| path.extension().is_some_and(|e| e == "contacts"));
        paths.sort();
        paths.into_iter().try_for_each(|path| ContactProblem::read(path).map(|problem| problems.push(problem)))?;
    }
    Ok(problems)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cells of the page's rows that begin with this text.
    fn cells(page: &str, begins: &str) -> Vec<Vec<String>> {
        let lines = page.lines().filter(|l| l.starts_with(begins));
        lines.map(|l| l.split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
    }

    /// With one problem, medians are the values of that problem.
    #[test]
    fn gains_are_plain_over_own() {
        let problem = problem_of_step(Scene::find_spec("tower:n=4").expect("the scene"), 1).expect("a problem");
        let (mut page, mut solved) = (String::new(), 0);
        solves(&mut page, std::slice::from_ref(&problem), || solved += 1).expect("solves");
        assert_eq!(solved, 1);
        // | problem | contacts | sweeps | 1e-1 | 1e-2 | 1e-3 | 1e-4 | after 32 |
        let first = cells(&page, "| tower, step 1 | ").remove(0);
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
