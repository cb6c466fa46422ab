//! Files that a user writes, and command-line words.

use std::io::Write;
use std::path::Path;

use drystone::config::Method;
use drystone::{Cpu, Simulation, SolverConfig};
use drystone_cli::report::Shard;
use drystone_cli::report::bench::{self, Bench};
use drystone_cli::report::comparison::{self, Extent, Origin, Report, Survey};
use drystone_maze::{Map, Script};
use drystone_problems::ContactProblem;
use drystone_problems::contacts::Problem;
use drystone_problems::residuals::Residuals;
use drystone_problems::solver::{Order, Solver};
use drystone_scenes::{CATALOGUE, Scene, SceneFile};

use crate::good;

/// Largest number of bodies for a scene that is also stepped.
const MAX_BODIES: usize = 200;

/// Reads a file with these bytes and with a name that ends in `end`.
fn from_file<T>(bytes: &[u8], end: &str, read: impl FnOnce(&Path) -> T) -> T {
    let mut file = tempfile::Builder::new().suffix(end).tempfile().expect("a file");
    file.write_all(bytes).expect("room for a file");
    read(file.path())
}

pub fn scene(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Some(scene) = good(SceneFile::parse(text)).and_then(|file| good(file.into_scene("fuzzed"))) else { return };
    let bodies = scene.world.bodies.len();
    // An input file can omit defaults; a written file has all values.
    if let Some(file) = good(SceneFile::of(&scene)) {
        let written = file.to_text();
        let again = SceneFile::parse(&written).and_then(|file| file.into_scene("fuzzed")).expect("what was written");
        assert_eq!(again.world.bodies.len(), bodies);
        assert_eq!(SceneFile::of(&again).expect("a scene").to_text(), written, "what is written is read as another");
    }
    if bodies > MAX_BODIES {
        return;
    }
    let config = SolverConfig::default().with(|c| c.max_substeps = 16);
    let Some(mut simulation) = good(Simulation::with(scene.world, config, Box::new(Cpu::new()))) else { return };
    for _ in 0..4 {
        let Some(stats) = good(simulation.step(scene.dt)) else { return };
        assert_eq!(stats.first_non_finite, simulation.world.first_non_finite());
    }
}

pub fn scenes() -> Vec<Vec<u8>> {
    let of = |scene: Scene| SceneFile::of(&scene).ok().map(|file| file.to_text().into_bytes());
    let catalogue = CATALOGUE.iter().filter_map(|entry| Scene::find(entry.name, &[]).ok().and_then(of));
    let example = include_bytes!("../../examples/two_boxes.json").to_vec();
    catalogue.filter(|text| text.len() < 4096).chain([example]).collect()
}

/// A scene of the command line. A large scene is only looked up, if the lookup refuses it.
pub fn spec(data: &[u8]) {
    let Ok(spec) = std::str::from_utf8(data) else { return };
    // Two digits are enough.
    let digits = |c: char| c.is_ascii_digit();
    let is_large = spec.split(|c: char| !digits(c)).any(|number| number.len() > 2)
        || spec.contains(['e', 'E']) && spec.contains(digits);
    if !is_large {
        good(Scene::find_spec(spec));
    }
}

pub fn specs() -> Vec<Vec<u8>> {
    let words = CATALOGUE.iter().map(|entry| {
        let parameters: Vec<_> = entry.parameters.iter().map(|p| format!("{}=2", p.name)).collect();
        format!("{}:{}", entry.name, parameters.join(",")).into_bytes()
    });
    words.chain([b"tower:n=3,worlds=4,vary=n".to_vec()]).collect()
}

/// Solves a valid problem. Every failure must be reported.
fn solve(problem: &ContactProblem) {
    if problem.bodies.len() > 40 || problem.contacts.len() > 40 {
        return;
    }
    for backend in [None, Some(Box::new(Cpu::new()) as Box<dyn drystone::Backend>)] {
        let Some(mut solver) = good(Solver::new(problem, Method::Plain, Order::default(), backend)) else { continue };
        if good(solver.advance(20)).is_none() {
            continue;
        }
        let _ = Residuals::of(problem, &solver.impulses());
    }
}

pub fn problem(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Some(problem) = good(ContactProblem::parse(text)) else { return };
    let written = problem.to_text();
    let again = ContactProblem::parse(&written).expect("what was written");
    assert_eq!(again.to_text(), written, "what is written is read as another");
    solve(&problem);
}

fn small_problems() -> Vec<ContactProblem> {
    let after = |name: &str, parameters: &[&str], steps: usize| {
        let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
        let scene = Scene::find(name, &parameters).expect("a scene");
        let mut simulation = Simulation::new(scene.world).expect("a world");
        for _ in 0..steps {
            simulation.step(scene.dt).expect("a step");
        }
        drystone_problems::step_with_contacts(&mut simulation, name, scene.dt).expect("a step").0
    };
    vec![after("tower", &["n=2"], 3), after("slide", &[], 3), after("pile", &["n=4"], 60)]
}

pub fn problems() -> Vec<Vec<u8>> {
    small_problems().iter().map(|problem| problem.to_text().into_bytes()).collect()
}

pub fn fclib(data: &[u8]) {
    if let Some(Problem::Bodies(problem)) = from_file(data, ".hdf5", |path| good(Problem::read(path))) {
        solve(&problem);
    }
}

pub fn fclibs() -> Vec<Vec<u8>> {
    small_problems().iter().filter_map(|problem| problem.to_fclib().ok()).collect()
}

pub fn settings(data: &[u8]) {
    from_file(data, ".toml", |path| good(drystone_cli::settings::read(path)));
    let Ok(text) = std::str::from_utf8(data) else { return };
    let mut config = SolverConfig::default();
    for line in text.lines().take(4) {
        good(drystone_cli::settings::set(&mut config, line));
    }
    config.check_ranges().expect("settings in range are in range");
}

pub fn setting_files() -> Vec<Vec<u8>> {
    vec![b"substeps=4".to_vec(), b"rules.clamping=per-correction\nfriction = \"none\"".to_vec()]
}

pub fn board(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    good(Map::parse("fuzzed", text));
}

pub fn boards() -> Vec<Vec<u8>> {
    drystone_maze::BOARDS.iter().map(|(_, text)| text.as_bytes().to_vec()).collect()
}

pub fn script(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Some(script) = good(Script::parse("fuzzed", text)) else { return };
    assert_eq!(
        good(Script::parse("fuzzed", &script.text())).as_ref(),
        Some(&script),
        "what is written is read as another"
    );
    let tilts = [-1.0, 0.0, 0.5 * script.end(), script.end(), f32::MAX].map(|time| script.at(time));
    assert!(tilts.iter().flatten().all(|tilt| tilt.is_finite()), "{tilts:?}");
}

pub fn scripts() -> Vec<Vec<u8>> {
    vec![b"0 0 0\n1 2 -4\n# rest\n3 8 0\n".to_vec(), b"0.5 1e-3 -8\n".to_vec()]
}

/// Rows of an interrupted report, and the page that is drawn from them.
pub fn rows(data: &[u8]) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scenes.csv"), data).expect("room for a file");
    if let Some(report) = good(Report::read(folder.path())) {
        good(report.write(folder.path()));
    }
}

pub fn row_files() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = comparison::scene("tower:n=2").expect("a scene");
    let team = |scene: &Scene, extent| Ok(comparison::drystone(scene, extent)?.into_iter().take(2).collect());
    let survey = Survey {
        scenes: vec![Scene { steps: 40, ..scene }],
        teams: vec![&team],
        extent: Extent::Quick,
        problems: Vec::new(),
        out: folder.path().into(),
        shard: Shard::WHOLE,
    };
    survey.run(&Origin::here(None), &mut |_, _, _| ()).expect("a report");
    vec![std::fs::read(folder.path().join("scenes.csv")).expect("rows")]
}

pub fn bench_file(data: &[u8]) {
    from_file(data, ".json", |path| good(Bench::read(path)));
}

pub fn benches() -> Vec<Vec<u8>> {
    let open = || Ok(vec![Box::new(Cpu::new()) as Box<dyn drystone::Backend>]);
    let made = bench::bench(&["tower:n=2".to_owned()], &SolverConfig::default(), &[1], &open, 3, &mut || ());
    vec![serde_json::to_vec(&made.expect("a bench")).expect("a bench serializes")]
}
