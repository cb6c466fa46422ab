//! `drystone report rules`: effects of each rule of the course sheet, measured in runs.

mod friction;
mod stacks;
mod substeps;

use std::fmt::Write as _;
use std::path::Path;

use crate::files;
use crate::settings;
use drystone::metrics::{drift, in_place_count};
use drystone::{BodyKind, Error, Reference, Result, Simulation, World};
use drystone_scenes::Scene;

use super::plot::{Frame, Look, Scale, Series, svg};

pub struct RulesReport {
    pub page: String,
    pub pictures: Vec<(&'static str, String)>,
}

impl RulesReport {
    /// Writes `rules.md` and the pictures into a directory, which is created if needed.
    pub fn write(&self, directory: &Path) -> Result<()> {
        let pictures = directory.join("rules");
        std::fs::create_dir_all(&pictures).map_err(Error::file(&pictures))?;
        for (name, text) in &self.pictures {
            files::write(&pictures.join(name), text.as_bytes())?;
        }
        files::write(&directory.join("rules.md"), self.page.as_bytes())
    }
}

/// Length of a step (s).
const DT: f32 = 1.0 / 60.0;
/// Times (s) and values of a line in a plot.
type Line = Vec<(f64, f64)>;

/// Runs everything and makes the page. Calls `after_run` [`RUNS`] times.
pub fn rules(mut after_run: impl FnMut()) -> Result<RulesReport> {
    let mut report = RulesReport { page: include_str!("../rules_head.md").to_owned(), pictures: Vec::new() };
    stacks::clamping(&mut report, &mut after_run)?;
    stacks::stabilization(&mut report, &mut after_run)?;
    friction::friction(&mut report, &mut after_run)?;
    substeps::heights(&mut report, &mut after_run)?;
    substeps::ratios(&mut report, &mut after_run)?;
    Ok(report)
}

/// Makes all bodies fall at 1 mm/s at the start, so that no body starts with its impulses at rest: rules differ in
/// their reaction to a new load.
fn simulate(mut world: World, settings_text: &str) -> Result<Simulation> {
    world.bodies.iter_mut().filter(|b| b.kind == BodyKind::Dynamic).for_each(|b| b.linear_velocity.y -= 1e-3);
    Simulation::with(world, settings::awake(settings_text.split_whitespace())?, Box::new(Reference::<f32>::new()))
}

struct Standing {
    /// Time until a body left its place (s); `None` if all bodies stood for 20 s.
    fell: Option<f64>,
    /// Largest horizontal distance of a body from its initial position (m).
    drift: f64,
    /// Deepest overlap at the end (m).
    penetration: f64,
}

/// Runs a scene for 20 s or until a body leaves its place.
fn stand(spec: &str, settings_text: &str) -> Result<Standing> {
    let world = Scene::find_spec(spec)?.world;
    let mut simulation = simulate(world.clone(), settings_text)?;
    let (mut step, mut stands) = (0, true);
    while stands && step < 1200 {
        step += 1;
        simulation.step(DT)?;
        stands = in_place_count(&world, &simulation.world) == world.dynamic_count();
    }
    Ok(Standing {
        fell: (!stands).then(|| f64::from(step) * f64::from(DT)),
        drift: drift(&world, &simulation.world),
        penetration: simulation.penetration().max,
    })
}

pub const RUNS: u64 = 9 + 3 + 12 + 4 + 8 + 8;

impl RulesReport {
    /// Adds a plot of named lines over time. A logarithmic scale leaves out values of 0 or less.
    fn picture(&mut self, file: &'static str, title: &str, (y, scale): (&str, Scale), lines: Vec<(String, Line)>) {
        let _ = writeln!(self.page, "\n![{file}](rules/{file})");
        let series = lines.into_iter().enumerate().map(|(look, (name, mut line))| {
            line.retain(|p| scale != Scale::Decades || p.1 > 0.0);
            Series { name, look: Look::nth(look), points: Vec::new(), line }
        });
        let frame = Frame { title, x: "time s", y, scales: (Scale::Linear, scale), size: (760, 420) };
        self.pictures.push((file, svg(&frame, &series.collect::<Vec<_>>())));
    }
}
