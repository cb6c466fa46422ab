//! The cost of a manifold and of a body as one island grows.

use serde::{Deserialize, Serialize};

use super::{column, memory, pool, stage_times};
use drystone::stats::median;
use drystone::{Cpu, Result, Simulation, SolverConfig, StepStats};
use drystone_scenes::Scene;

/// Plane pyramids, each one island, of 1,035, 10,011, 100,128 and 1,000,405 boxes.
pub const GROWTH: [&str; 4] = ["pyramid:base=45", "pyramid:base=141", "pyramid:base=447", "pyramid:base=1414"];

/// Steps before the measurement.
const SETTLE: usize = 5;
/// Total number of body steps in a measurement. It determines the number of steps, within [`STEPS`].
const BODY_STEPS: usize = 400_000;
const STEPS: [usize; 2] = [6, 100];

/// Cost of a scene at rest: times are medians over steps (ms).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrowthRow {
    pub scene: String,
    pub threads: usize,
    pub boxes: usize,
    pub manifolds: usize,
    /// Passes over all contacts in a step: a warm start and the sweeps.
    pub passes: f64,
    /// Least time of `run` per manifold and pass (ns).
    pub ns: f64,
    /// The same relative to the first scene.
    pub growth: f64,
    pub detect: f64,
    pub color: f64,
    pub prepare: f64,
    pub run: f64,
    pub store: f64,
    pub ms: f64,
    /// Peak memory of the process while the scene is built and stepped, minus the memory before, per box (B). `None` if
    /// the system does not report it.
    pub bytes_a_box: Option<f64>,
}

/// Steps the scenes in turn with each number of `threads`. Calls `after_scene` after each scene.
pub fn growth(specs: &[String], threads: &[usize], after_scene: &mut dyn FnMut()) -> Result<Vec<GrowthRow>> {
    let config = SolverConfig::default().without_sleep();
    let mut rows: Vec<GrowthRow> = Vec::new();
    for spec in specs {
        let before = memory::begin();
        let Scene { world, dt, .. } = Scene::find_spec(spec)?;
        let boxes = world.dynamic_count();
        let mut simulation = Simulation::with(world, config.clone(), Box::new(Cpu::new()))?;
        (0..SETTLE).try_for_each(|_| simulation.step(dt).map(drop))?;
        let count = (BODY_STEPS / boxes.max(1)).clamp(STEPS[0], STEPS[1]);
        let mut measured = Vec::new();
        for &threads in threads {
            let step = |_| simulation.step(dt);
            measured.push((threads, pool(threads)?.install(|| (0..count).map(step).collect::<Result<Vec<_>>>())?));
        }
        let bytes_a_box = before.and_then(|before| Some((memory::peak()? - before) / boxes as f64));
        for (threads, stats) in measured {
            let row = GrowthRow { scene: spec.clone(), threads, boxes, bytes_a_box, ..GrowthRow::of(&stats, &config) };
            let first = rows.iter().find(|row| row.threads == threads).map_or(row.ns, |first| first.ns);
            rows.push(GrowthRow { growth: row.ns / first, ..row });
        }
        after_scene();
    }
    Ok(rows)
}

impl GrowthRow {
    fn of(steps: &[StepStats], config: &SolverConfig) -> Self {
        let times: Vec<_> = steps.iter().map(stage_times).collect();
        let [detect, color, prepare, run, store, ms] = std::array::from_fn(|i| median(&column(&times, i)));
        let last = steps.last().cloned().unwrap_or_default();
        let passes = passes(config, &last);
        let least = column(&times, 3).into_iter().fold(f64::INFINITY, f64::min);
        let ns = least * 1e6 / (last.manifolds as f64 * passes);
        Self { manifolds: last.manifolds, passes, ns, detect, color, prepare, run, store, ms, ..Self::default() }
    }
}

/// Passes over the contacts in a step: a warm start, and the sweeps of an average body. An island of class c takes 2^c
/// times the substeps of the settings.
fn passes(config: &SolverConfig, stats: &StepStats) -> f64 {
    let awake: f64 = stats.efforts.iter().map(|&count| f64::from(count)).sum();
    let efforts: f64 = stats.efforts.iter().zip(0..).map(|(&count, class)| f64::from(count) * 2_f64.powi(class)).sum();
    let sweeps = f64::from(config.substeps * (config.iterations + config.relax));
    1.0 + sweeps * if awake > 0.0 { efforts / awake } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_island_has_its_manifolds_passes_and_memory() {
        let specs = ["pyramid:base=10".to_owned(), "pyramid:base=60".to_owned()];
        let rows = growth(&specs, &[1, 2], &mut || ()).expect("runs");
        assert_eq!(
            rows.iter().map(|r| (r.boxes, r.threads)).collect::<Vec<_>>(),
            [(55, 1), (55, 2), (1830, 1), (1830, 2)]
        );
        for row in &rows {
            // Each box above the lowest row stands on two others: n(n-1) manifolds, and n on the ground.
            let base = if row.boxes == 55 { 10 } else { 60 };
            assert_eq!((row.manifolds, row.passes), (base * base, 17.0));
            let of_run = row.ns * 1e-6 * row.manifolds as f64 * row.passes;
            assert!(of_run > 0.0 && of_run <= 1.001 * row.run && row.run < row.ms, "{row:?}");
        }
        assert_eq!((rows[0].growth, rows[2].growth), (1.0, rows[2].ns / rows[0].ns));
        if cfg!(target_os = "linux") {
            let bytes = rows[2].bytes_a_box.expect("Linux says it");
            assert!((500.0..50_000.0).contains(&bytes), "{bytes}");
        }
    }

    #[test]
    fn an_island_of_class_two_takes_four_times_the_sweeps() {
        let config = SolverConfig::default();
        let mut stats = StepStats::default();
        assert_eq!(passes(&config, &stats), 17.0);
        (stats.efforts[0], stats.efforts[2]) = (30, 10);
        // Thirty boxes take 16 sweeps and ten take 64.
        assert_eq!(passes(&config, &stats), 1.0 + (30.0 * 16.0 + 10.0 * 64.0) / 40.0);
    }
}
