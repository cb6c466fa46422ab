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
use crate::files;

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

/// The page, and the files of its folder by their names: all rows as CSV.
pub struct Convergence {
    pub page: String,
    pub folder: Vec<(String, Vec<u8>)>,
}

/// One kind of sweeps on one problem.
struct Solve {
    problem: String,
    contacts: usize,
    kind: (Method, u8),
    /// Sweeps to the errors 1e-1 to 1e-4; `None` if no sweep reaches the error.
    to: [Option<u32>; 4],
    e_vel_after_32: f64,
}

/// One run of a scene, and its end.
struct Run {
    scene: String,
    substeps: u32,
    /// Biased sweeps per substep; as many relax sweeps follow.
    sweeps: u32,
    method: Method,
    deepest_mm: f64,
    speed_mm_per_s: f64,
    /// Empty for a scene that does not stand.
    in_place: String,
}

/// Makes the page from steps of catalogue scenes and the `.contacts` files of a folder. Calls `after_problem` after
/// each problem with the number of problems.
pub fn convergence(problems_folder: Option<&Path>, mut after_problem: impl FnMut(usize)) -> Result<Convergence> {
    let problems = problems(problems_folder)?;
    let solves = solves(&problems, || after_problem(problems.len()))?;
    let runs = runs()?;
    let mut page = include_str!("convergence_head.md").to_owned();
    sweeps_table(&mut page, &solves);
    gains_table(&mut page, &solves);
    page.push_str(include_str!("convergence_tail.md"));
    page.push_str(include_str!("convergence_runs.md"));
    runs_table(&mut page, &runs);
    let folder = vec![("sweeps.csv".to_owned(), sweeps_csv(&solves)?), ("steps.csv".to_owned(), runs_csv(&runs)?)];
    Ok(Convergence { page, folder })
}

/// All kinds of sweeps on each problem, in the order of [`KINDS`].
fn solves(problems: &[ContactProblem], mut after_problem: impl FnMut()) -> Result<Vec<Solve>> {
    let mut solves = Vec::new();
    for problem in problems {
        for (method, passes) in KINDS {
            let solved = |sweeps, tolerance| {
                SolveReport::new(problem, &SolveSettings::by_manifolds(method, passes, sweeps, tolerance), None)
            };
            let report = solved(MOST, 1e-4)?;
            let after_32 = solved(32, 0.0)?.curve.last().map_or(f64::NAN, |row| row.residuals.e_vel);
            solves.push(Solve {
                problem: problem.name.clone(),
                contacts: problem.contacts.len(),
                kind: (method, passes),
                to: [0, 1, 2, 3].map(|i| report.reached[i].sweeps),
                e_vel_after_32: after_32,
            });
        }
        after_problem();
    }
    Ok(solves)
}

fn count(sweeps: Option<u32>, none: &str) -> String {
    sweeps.map_or(none.to_owned(), |sweeps| sweeps.to_string())
}

/// Writes sweeps and errors of the kinds with one pass.
fn sweeps_table(page: &mut String, solves: &[Solve]) {
    page.push_str(
        "\n| problem | contacts | plain to 1e-2 | accelerated | plain to 1e-4 | accelerated | plain after 32 | accelerated |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for of_problem in solves.chunks(KINDS.len()) {
        let one_pass: Vec<_> = of_problem.iter().filter(|solve| solve.kind.1 == 1).collect();
        let mut cells = vec![of_problem[0].problem.clone(), of_problem[0].contacts.to_string()];
        // The errors 1e-2 and 1e-4.
        for k in [1, 3] {
            cells.extend(one_pass.iter().map(|solve| count(solve.to[k], "-")));
        }
        cells.extend(one_pass.iter().map(|solve| format!("{:.1e}", solve.e_vel_after_32)));
        let _ = writeln!(page, "| {} |", cells.join(" | "));
    }
}

/// Writes the medians of the gains of each kind over plain sweeps with one pass.
fn gains_table(page: &mut String, solves: &[Solve]) {
    page.push_str("\nMedians over these problems, relative to plain sweeps with one pass:\n\n");
    page.push_str("| sweeps | sweeps to 1e-3, times fewer | error after 32 sweeps, times smaller |\n|---|--:|--:|\n");
    let of = |kind: (Method, u8)| solves.iter().filter(move |solve| solve.kind == kind);
    let to = |solve: &Solve| solve.to[2].map_or(f64::INFINITY, f64::from);
    for kind in KINDS.into_iter().skip(1) {
        let pairs = || of(KINDS[0]).zip(of(kind));
        let fewer: Vec<f64> = pairs().map(|(plain, own)| to(plain) / to(own)).collect();
        let smaller: Vec<f64> = pairs().map(|(plain, own)| plain.e_vel_after_32 / own.e_vel_after_32).collect();
        let _ = writeln!(page, "| {} | {:.1} | {:.1} |", kind_name(kind), median(&fewer), median(&smaller));
    }
}

/// The solves as CSV.
fn sweeps_csv(solves: &[Solve]) -> Result<Vec<u8>> {
    let head = [
        "problem",
        "contacts",
        "method",
        "passes",
        "sweeps_to_1e-1",
        "sweeps_to_1e-2",
        "sweeps_to_1e-3",
        "sweeps_to_1e-4",
        "e_vel_after_32",
    ];
    let row = |solve: &Solve| {
        let (method, passes) = solve.kind;
        let mut cells = vec![solve.problem.clone(), solve.contacts.to_string(), method.to_string(), passes.to_string()];
        cells.extend(solve.to.map(|sweeps| count(sweeps, "")));
        cells.push(format!("{:.1e}", solve.e_vel_after_32));
        cells
    };
    csv_table(&head, solves.iter().map(row))
}

fn runs() -> Result<Vec<Run>> {
    let mut runs = Vec::new();
    for (spec, steps) in RUNS {
        let scene = Scene::find_spec(spec)?;
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
                runs.push(Run {
                    scene: spec.replace([':', ','], " "),
                    substeps,
                    sweeps,
                    method,
                    deepest_mm: 1e3 * deepest,
                    speed_mm_per_s: 1e3 * speed,
                    in_place: if scene.stands { format!("{in_place} of {bodies}") } else { String::new() },
                });
            }
        }
    }
    Ok(runs)
}

/// Writes the runs with 16 sweeps per step and several substeps.
fn runs_table(page: &mut String, runs: &[Run]) {
    page.push_str("\n| scene | substeps | sweeps | method | deepest [mm] | rms speed [mm/s] | in place |\n");
    page.push_str("|---|--:|--:|---|--:|--:|--:|\n");
    let mut last = "";
    for run in runs.iter().filter(|run| run.substeps > 1 && 2 * run.substeps * run.sweeps == 16) {
        let Run { substeps, sweeps, method, deepest_mm, speed_mm_per_s, in_place, .. } = run;
        let scene = run.scene.as_str();
        let title = if scene == last { "" } else { scene };
        let _ = writeln!(
            page,
            "| {title} | {substeps} | {sweeps} + {sweeps} | {method} | {deepest_mm:.2} | {speed_mm_per_s:.2} | {in_place} |"
        );
        last = scene;
    }
}

/// The runs as CSV.
fn runs_csv(runs: &[Run]) -> Result<Vec<u8>> {
    let head = ["scene", "substeps", "iterations", "relax", "method", "deepest_mm", "rms_speed_mm_per_s", "in_place"];
    let row = |run: &Run| {
        vec![
            run.scene.clone(),
            run.substeps.to_string(),
            run.sweeps.to_string(),
            run.sweeps.to_string(),
            run.method.to_string(),
            format!("{:.2}", run.deepest_mm),
            format!("{:.2}", run.speed_mm_per_s),
            run.in_place.clone(),
        ]
    };
    csv_table(&head, runs.iter().map(row))
}

fn csv_table(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Result<Vec<u8>> {
    let head: Vec<String> = head.iter().map(|cell| String::from(*cell)).collect();
    let rows: Vec<_> = std::iter::once(head).chain(rows).collect();
    files::csv(&rows)
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

    /// A row of some cells, which begins with this text.
    fn cells(text: &str, begins: &str) -> Vec<String> {
        let row = text.lines().find(|line| line.starts_with(begins));
        let row = row.unwrap_or_else(|| panic!("no row {begins} in {text}"));
        row.split('|').map(|cell| cell.trim().to_owned()).collect()
    }

    /// With one problem, medians are the values of that problem.
    #[test]
    fn gains_are_plain_over_own() {
        let problem = problem_of_step(Scene::find_spec("tower:n=4").expect("the scene"), 1).expect("a problem");
        let mut solved = 0;
        let solves = solves(std::slice::from_ref(&problem), || solved += 1).expect("solves");
        assert_eq!((solved, solves.len()), (1, KINDS.len()));
        let mut page = String::new();
        gains_table(&mut page, &solves);
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{cell} in {page}"));
        let to = |solve: &Solve| f64::from(solve.to[2].expect("it reaches the error"));
        for (own, kind) in solves[1..].iter().zip(["plain, 2 passes", "accelerated, 1 pass", "accelerated, 2 passes"]) {
            let gain = cells(&page, &format!("| {kind} |"));
            let fewer = to(&solves[0]) / to(own);
            assert!((number(&gain[2]) - fewer).abs() <= 0.051, "{kind}: {fewer} times fewer sweeps to 1e-3, in {page}");
            let lower = solves[0].e_vel_after_32 / own.e_vel_after_32;
            assert!((number(&gain[3]) - lower).abs() <= 0.051, "{kind}: {lower} times lower, in {page}");
            assert!(fewer > 1.0, "{kind} gains nothing: {page}");
        }
    }

    #[test]
    fn the_page_has_one_pass_and_the_file_all() {
        let solve = |k: u32, kind| Solve {
            problem: "tower, step 1".into(),
            contacts: 8,
            kind,
            to: [Some(k), Some(10 + k), None, None],
            e_vel_after_32: 0.04,
        };
        let solves: Vec<_> = (1..).zip(KINDS).map(|(k, kind)| solve(k, kind)).collect();
        let mut page = String::new();
        sweeps_table(&mut page, &solves);
        assert!(page.ends_with("|\n| tower, step 1 | 8 | 11 | 13 | - | - | 4.0e-2 | 4.0e-2 |\n"), "{page}");
        let csv = String::from_utf8(sweeps_csv(&solves).expect("rows")).expect("text");
        let lines: Vec<_> = csv.lines().collect();
        assert_eq!(lines.len(), 1 + KINDS.len(), "{csv}");
        assert_eq!(lines[4], "\"tower, step 1\",8,accelerated,2,4,14,,,4.0e-2");
    }

    #[test]
    fn the_page_has_16_sweeps_in_several_substeps_and_the_file_all() {
        let run = |(substeps, sweeps)| Run {
            scene: "wall".into(),
            substeps,
            sweeps,
            method: Method::Plain,
            deepest_mm: 0.5,
            speed_mm_per_s: 2.0,
            in_place: "3 of 4".into(),
        };
        let runs: Vec<_> = SETTINGS.into_iter().map(run).collect();
        let mut page = String::new();
        runs_table(&mut page, &runs);
        let rows: Vec<_> = page.lines().skip(3).collect();
        let wanted = [
            "| wall | 8 | 1 + 1 | plain | 0.50 | 2.00 | 3 of 4 |",
            "|  | 4 | 2 + 2 | plain | 0.50 | 2.00 | 3 of 4 |",
            "|  | 2 | 4 + 4 | plain | 0.50 | 2.00 | 3 of 4 |",
        ];
        assert_eq!(rows, wanted);
        let csv = String::from_utf8(runs_csv(&runs).expect("rows")).expect("text");
        assert_eq!(csv.lines().count(), 1 + SETTINGS.len(), "{csv}");
        assert!(csv.ends_with("\nwall,2,16,16,plain,0.50,2.00,3 of 4\n"), "{csv}");
    }
}
