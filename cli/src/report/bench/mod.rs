//! `drystone bench`: times of the stages of a step, and errors, on standard scenes.
//!
//! All scenes are settled first. Then they take turns of a few steps, so that a slow phase of the machine affects all
//! of them. A time is the median over the turns, and its spread is given by the quartiles. All backends and numbers of
//! threads share one simulation of a scene, so that they do the same work. Other measurements have separate files:
//! scenes from their first step on (`falling`), one island of growing size (`growth`), many worlds (`worlds`), saved
//! states (`states`), and sweeps compared with the limits of the machine (`limits`).

mod baseline;
mod falling;
mod growth;
mod limits;
mod machine;
mod memory;
mod rates;
mod states;
mod worlds;

pub use baseline::{Change, compare_with};
pub use falling::{FALLING, FALLING_QUICK, FallingRow, falling, turns};
pub use growth::{GROWTH, GrowthRow, growth};
pub use limits::{LIMITS, LIMITS_QUICK, LimitRow, OPERATIONS, limits};
pub use machine::Machine;
pub use states::{STATES, StatesRow, states};
pub use worlds::{COUNTS, WORLDS, WorldsRow, worlds};

use serde::{Deserialize, Serialize};

use crate::report::rounds::{interleave, quartiles};
use crate::report::scene_hash::content_hash;
use crate::settings;
use drystone::metrics::rms_speed;
use drystone::stats::median;
use drystone::{Backend, Error, Result, Simulation, SolverConfig, StepStats};
use drystone_scenes::{Scene, Spawners};

/// The scenes of a full bench, as in [`Scene::find_spec`].
pub const STANDARD: [&str; 9] = [
    "pile:n=1000",
    "pile:n=5000",
    "pile:n=20000",
    "pile:n=100000",
    "pyramid:base=100",
    "many-pyramids",
    "drum",
    "joint-grid",
    "pile:n=100,worlds=256",
];

pub const QUICK: [&str; 5] = ["pile:n=1000", "many-pyramids:n=10", "drum", "joint-grid", "pile:n=100,worlds=8"];

const TURN: usize = 10;
/// Steps with one substep, in which bodies fall into a container.
const COARSE: usize = 240;
/// Steps with the measured settings before the measurement.
const FINE: usize = 60;

/// Wall times of the stages of a step (ms), counts and errors of one scene on one backend with one number of threads.
/// Counts and errors are those of the last step. [`comparison::Row`](crate::report::comparison::Row) compares engines,
/// which do not report stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StagesRow {
    pub scene: String,
    pub hash: String,
    pub backend: String,
    pub adapter: String,
    pub threads: usize,
    pub settings: String,
    pub worlds: usize,
    pub bodies: usize,
    pub manifolds: usize,
    pub points: usize,
    pub joints: usize,
    pub colors: usize,
    /// Share of the pairs that reused their manifolds.
    pub reused: f64,
    /// All stages together: median over the turns, and quartiles.
    pub ms: f64,
    pub ms_low: f64,
    pub ms_high: f64,
    pub detect: f64,
    pub color: f64,
    pub prepare: f64,
    /// Sweeps and transfers.
    pub run: f64,
    pub store: f64,
    /// Overlaps (m).
    pub penetration_max: f64,
    pub penetration_mean: f64,
    /// Root mean square speed (m/s).
    pub speed_rms: f64,
    /// [`e_vel`](drystone_problems::residuals::Residuals::e_vel) of the impulses after a substep, in its contact
    /// problem without springs; `None` with joints.
    pub residual: Option<f64>,
}

impl StagesRow {
    /// The values that identify a row in a bench.
    pub fn key(&self) -> (&str, &str, usize, &str) {
        (&self.scene, &self.backend, self.threads, &self.settings)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bench {
    pub machine: Machine,
    pub rows: Vec<StagesRow>,
}

/// A backend with a pool of threads, and the medians of its turns: the five stages and their sum (ms).
struct BackendRun {
    backend: Option<Box<dyn Backend>>,
    pool: rayon::ThreadPool,
    turns: Vec<[f64; 6]>,
}

struct Case {
    spec: String,
    hash: String,
    dt: f32,
    simulation: Simulation,
    spawners: Spawners,
    runs: Vec<BackendRun>,
    last: StepStats,
}

/// Measures the scenes `specs` on each backend of `open`, with each number of `threads`. Calls `after_turn` after each
/// scene has settled and after each of its turns.
pub fn bench(
    specs: &[String],
    config: &SolverConfig,
    threads: &[usize],
    open: &dyn Fn() -> Result<Vec<Box<dyn Backend>>>,
    turns: usize,
    after_turn: &mut dyn FnMut(),
) -> Result<Bench> {
    let mut cases = Vec::new();
    for spec in specs {
        let mut runs = Vec::new();
        for &threads in threads {
            for backend in open()? {
                runs.push(BackendRun { backend: Some(backend), pool: pool(threads)?, turns: Vec::new() });
            }
        }
        let (simulation, spawners, hash, dt) = settled(spec, config)?;
        cases.push(Case { spec: spec.clone(), hash, dt, simulation, spawners, runs, last: StepStats::default() });
        after_turn();
    }
    interleave(turns, &mut cases, |_, case| {
        case.turn()?;
        after_turn();
        Ok(())
    })?;
    let rows = cases.into_iter().flat_map(|case| case.rows(config)).collect();
    Ok(Bench { machine: Machine::this(), rows })
}

/// A simulation of a scene at rest, the hash of the scene and the length of its steps (s). Bodies fall into a container
/// at one substep. Then preloads and warm starts settle at the measured settings.
fn settled(spec: &str, config: &SolverConfig) -> Result<(Simulation, Spawners, String, f32)> {
    let scene = Scene::find_spec(spec)?;
    let (hash, dt, falls) = (content_hash(&scene), scene.dt, scene.container.is_some());
    let coarse = config.clone().with(|c| c.substeps = 1);
    let mut spawners = Spawners::new(&scene);
    let mut simulation = Simulation::with(scene.world, coarse, Box::new(drystone::Cpu::new()))?;
    let mut step = |simulation: &mut Simulation| {
        spawners.before_step(&mut simulation.world, dt);
        simulation.step(dt).map(drop)
    };
    (0..if falls { COARSE } else { 0 }).try_for_each(|_| step(&mut simulation))?;
    simulation.set_config(config.clone())?;
    (0..FINE).try_for_each(|_| step(&mut simulation))?;
    Ok((simulation, spawners, hash, dt))
}

fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::input(format!("{threads} threads: {e}")))
}

impl Case {
    fn turn(&mut self) -> Result<()> {
        let Self { simulation, spawners, runs, dt, last, .. } = self;
        for run in runs {
            let Some(backend) = run.backend.take() else { continue };
            let before = simulation.set_backend(backend);
            let mut steps = Vec::with_capacity(TURN);
            let stepped: Result<()> = run.pool.install(|| {
                (0..TURN).try_for_each(|_| {
                    spawners.before_step(&mut simulation.world, *dt);
                    *last = simulation.step(*dt)?;
                    if let Some(fault) = last.fault.take() {
                        return Err(Error::Lost(fault));
                    }
                    steps.push(stage_times(last));
                    Ok(())
                })
            });
            run.backend = Some(simulation.set_backend(before));
            stepped?;
            run.turns.push(std::array::from_fn(|i| median(&column(&steps, i))));
        }
        Ok(())
    }

    fn rows(self, config: &SolverConfig) -> Vec<StagesRow> {
        let Self { spec, hash, dt, mut simulation, runs, last: stats, .. } = self;
        let penetration = simulation.penetration();
        let residual =
            drystone_problems::step_with_residuals(&mut simulation, dt).ok().map(|residuals| residuals.e_vel);
        let world = &simulation.world;
        let row = |mut measured: BackendRun| {
            let [detect, color, prepare, run, store] = std::array::from_fn(|i| median(&column(&measured.turns, i)));
            let [ms_low, ms, ms_high] = quartiles(&column(&measured.turns, 5));
            let backend = measured.backend.take().expect("given back after each turn");
            let name = backend.name().into();
            StagesRow {
                scene: spec.clone(),
                hash: hash.clone(),
                backend: name,
                adapter: measured.pool.install(move || backend.adapter()),
                threads: measured.pool.current_num_threads(),
                settings: settings::unusual(config, &["sleep_after"]).join(" "),
                worlds: world.world_count(),
                bodies: world.dynamic_count(),
                manifolds: stats.manifolds,
                points: stats.points,
                joints: stats.joints,
                colors: stats.colors,
                reused: 1.0 - stats.computed as f64 / stats.pairs.max(1) as f64,
                ms,
                ms_low,
                ms_high,
                detect,
                color,
                prepare,
                run,
                store,
                penetration_max: penetration.max,
                penetration_mean: penetration.mean,
                speed_rms: rms_speed(world),
                residual,
            }
        };
        runs.into_iter().map(row).collect()
    }
}

/// The five stages of a step and their sum (ms).
fn stage_times(stats: &StepStats) -> [f64; 6] {
    let [detect, color, prepare, run, store] = stats.times.stages().map(|s| s.1.as_secs_f64() * 1e3);
    [detect, color, prepare, run, store, stats.times.total().as_secs_f64() * 1e3]
}

fn column<const N: usize>(rows: &[[f64; N]], column: usize) -> Vec<f64> {
    rows.iter().map(|row| row[column]).collect()
}
