//! `drystone bench`: what the stages of a step cost on standard scenes, and what they get wrong.
//!
//! All scenes are settled first. Then they step in turns, a few steps each, over and over, so that whatever slows the machine
//! down meets all of them; a time is the median over the turns, its spread their quartiles. On one scene all backends and
//! numbers of threads take turns at one simulation, so that they have the same to do.

mod baseline;
mod limits;
mod machine;

pub use baseline::{Change, compare_with};
pub use limits::{LimitRow, limits};
pub use machine::Machine;

use serde::{Deserialize, Serialize};

use crate::report::rounds::{interleave, quartiles};
use crate::settings;
use drystone::metrics::rms_speed;
use drystone::residuals::Residuals;
use drystone::stages::plan::Kernel;
use drystone::stats::{StageTimes, median};
use drystone::{Backend, Error, Reference, Result, Scene, Simulation, SolverConfig};

/// The scenes of a whole bench: `name:key=value,...`, see [`Scene::find_spec`].
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

/// The scenes of a quick one.
pub const QUICK: [&str; 5] = ["pile:n=1000", "many-pyramids:n=10", "drum", "joint-grid", "pile:n=100,worlds=8"];

/// Steps of a turn.
const TURN: usize = 10;
/// Steps in which what falls into a container settles, at one substep.
const COARSE: usize = 240;
/// Steps at the settings that are measured, before they are.
const FINE: usize = 60;

/// One scene on one backend with so many threads. Times are wall milliseconds of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchRow {
    /// The scene, with its parameters.
    pub scene: String,
    /// Hash of what is in it.
    pub hash: String,
    /// `reference`, `cpu` or `gpu`.
    pub backend: String,
    /// What it ran on.
    pub adapter: String,
    /// Threads.
    pub threads: usize,
    /// Settings that are not at their defaults.
    pub settings: String,
    /// Worlds.
    pub worlds: usize,
    /// Dynamic bodies.
    pub bodies: usize,
    /// Manifolds at the end.
    pub manifolds: usize,
    /// Contact points at the end.
    pub points: usize,
    /// Joints.
    pub joints: usize,
    /// Colors of the contacts at the end.
    pub colors: usize,
    /// Share of the pairs whose manifolds were reused, at the end.
    pub reused: f64,
    /// All stages together, median over the turns (ms).
    pub ms: f64,
    /// Its lower quartile.
    pub ms_low: f64,
    /// Its upper quartile.
    pub ms_high: f64,
    /// Finding contacts (ms).
    pub detect: f64,
    /// Coloring them (ms).
    pub color: f64,
    /// Writing rows (ms).
    pub prepare: f64,
    /// Sweeping, transfers included (ms).
    pub run: f64,
    /// Reading the rows back (ms).
    pub store: f64,
    /// Deepest overlap at the end (m).
    pub penetration_max: f64,
    /// Mean overlap at the end (m).
    pub penetration_mean: f64,
    /// Root mean square speed at the end (m/s).
    pub speed_rms: f64,
    /// How far the impulses at the end of a substep are from solving its contact problem without springs:
    /// [`Residuals::e_vel`]. None where there are joints.
    pub residual: Option<f64>,
}

impl BenchRow {
    /// What tells the row from others of a bench.
    pub fn key(&self) -> (&str, &str, usize, &str) {
        (&self.scene, &self.backend, self.threads, &self.settings)
    }
}

/// A whole bench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bench {
    /// Where it ran.
    pub machine: Machine,
    /// Scene by scene, backend by backend, thread count by thread count.
    pub rows: Vec<BenchRow>,
}

/// A backend with a pool of threads, and what it took.
struct Way {
    backend: Option<Box<dyn Backend>>,
    pool: rayon::ThreadPool,
    turns: Vec<[f64; 6]>,
}

/// One scene that is measured.
struct Case {
    spec: String,
    hash: String,
    dt: f32,
    simulation: Simulation,
    ways: Vec<Way>,
    last: drystone::StepStats,
}

/// Measures `specs` over `turns` turns on each of the backends that `open` makes, with each number of `threads`. `after_turn` is
/// called after each turn of each scene, those to settle included.
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
        cases.push(Case::new(spec, config, threads, open)?);
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

/// A simulation of a scene at rest, the hash of the scene and the length of its steps. What falls into a container does so at
/// one substep: contacts are found as always, and it lies where it would. Then all is stepped at the settings that are measured,
/// until preloads and warm starts have come to rest, too.
fn settled(spec: &str, config: &SolverConfig) -> Result<(Simulation, String, f32)> {
    let scene = Scene::find_spec(spec)?;
    let (hash, dt, falls) = (scene.content_hash(), scene.dt, scene.container.is_some());
    let coarse = config.clone().with(|c| c.substeps = 1);
    let mut simulation = Simulation::new(scene.world, coarse, Box::new(drystone::Cpu::new()))?;
    for _ in 0..if falls { COARSE } else { 0 } {
        simulation.step(dt)?;
    }
    simulation.set_config(config.clone())?;
    for _ in 0..FINE {
        simulation.step(dt)?;
    }
    Ok((simulation, hash, dt))
}

fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::input(format!("{threads} threads: {e}")))
}

impl Case {
    fn new(
        spec: &str,
        config: &SolverConfig,
        threads: &[usize],
        open: &dyn Fn() -> Result<Vec<Box<dyn Backend>>>,
    ) -> Result<Self> {
        let mut ways = Vec::new();
        for &threads in threads {
            for backend in open()? {
                ways.push(Way { backend: Some(backend), pool: pool(threads)?, turns: Vec::new() });
            }
        }
        let (simulation, hash, dt) = settled(spec, config)?;
        Ok(Self { spec: spec.into(), hash, dt, simulation, ways, last: drystone::StepStats::default() })
    }

    /// Some steps on each way.
    fn turn(&mut self) -> Result<()> {
        let Self { simulation, ways, dt, last, .. } = self;
        for way in ways {
            let Some(backend) = way.backend.take() else { continue };
            let before = simulation.set_backend(backend);
            let mut steps = Vec::with_capacity(TURN);
            let stepped: Result<()> = way.pool.install(|| {
                for _ in 0..TURN {
                    *last = simulation.step(*dt)?;
                    steps.push(milliseconds(&last.times));
                }
                Ok(())
            });
            way.backend = Some(simulation.set_backend(before));
            stepped?;
            way.turns.push(std::array::from_fn(|i| median(&column(&steps, i))));
        }
        Ok(())
    }

    fn rows(self, config: &SolverConfig) -> Vec<BenchRow> {
        let Self { spec, hash, dt, mut simulation, ways, last: stats } = self;
        let penetration = simulation.penetration();
        let residual = residual(&mut simulation, dt);
        let world = &simulation.world;
        let row = |mut way: Way| {
            let [detect, color, prepare, run, store] = std::array::from_fn(|i| median(&column(&way.turns, i)));
            let [ms_low, ms, ms_high] = quartiles(&column(&way.turns, 5));
            let backend = way.backend.take().expect("given back after each turn");
            let name = backend.name().into();
            BenchRow {
                scene: spec.clone(),
                hash: hash.clone(),
                backend: name,
                adapter: way.pool.install(move || backend.adapter()),
                threads: way.pool.current_num_threads(),
                settings: settings::unusual(config, &["sleep_after"]).join(" "),
                worlds: world.worlds().len(),
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
        ways.into_iter().map(row).collect()
    }
}

/// Each stage, and all together.
fn milliseconds(times: &StageTimes) -> [f64; 6] {
    let [detect, color, prepare, run, store] = times.stages().map(|s| s.1.as_secs_f64() * 1e3);
    [detect, color, prepare, run, store, times.total().as_secs_f64() * 1e3]
}

fn column(rows: &[[f64; 6]], column: usize) -> Vec<f64> {
    rows.iter().map(|row| row[column]).collect()
}

/// How far the impulses of the next step are from solving its first substep when that ends; takes that step.
fn residual(simulation: &mut Simulation, dt: f32) -> Option<f64> {
    let (mut problem, plan) = simulation.next_problem(dt).ok()?;
    let begins = |p: &drystone::stages::plan::Pass| matches!(p.kernel, Kernel::IntegrateVelocities { .. });
    let end = plan.passes.iter().skip(1).position(begins).map_or(plan.passes.len(), |i| i + 1);
    Reference::<f32>::new().run(&mut problem, &plan.passes[..end]).ok()?;
    let of_contact = |row: &drystone::stages::problem::ContactRow| {
        let own = row.first_point as usize..(row.first_point + row.point_count) as usize;
        problem.impulses[own].iter().map(|i| glam::Vec3::new(i.normal, i.tangent_1, i.tangent_2).as_dvec3())
    };
    let impulses: Vec<_> = problem.swept_contacts().flat_map(of_contact).collect();
    let (contacts, _) = simulation.step_with_contacts("bench", dt).ok()?;
    Some(Residuals::of(&contacts, &impulses).e_vel)
}
