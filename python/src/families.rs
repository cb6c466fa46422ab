//! Families of hard cases, judged as `drystone hard --families` judges them.

use drystone::metrics::half_height;
use drystone::stats::largest;
use drystone::{Backend, Cpu, World};
use drystone_cli::hard::{Limit, Setup, families, passes};
use drystone_scenes::{Family, Member};
use pyo3::prelude::*;

use crate::raised;
use crate::scene::Config;

/// Number of times in a run at which overlap is measured, and at which signals are checked.
const LOOKS: u32 = 20;

/// A completed world of a family, as a dict.
#[derive(IntoPyObject)]
pub struct JudgedWorld {
    bodies: usize,
    height: f64,
    storeys: f64,
    mass_ratio: f64,
    gravity: f64,
    dt: f32,
    steps: u32,
    passed: bool,
    checks: Vec<CheckRow>,
    overlap_max: f64,
    price: u64,
    seconds: f64,
    hash: String,
}

#[derive(IntoPyObject)]
struct CheckRow {
    what: String,
    value: f64,
    limit: f64,
    passed: bool,
}

/// Name and summary of every family.
#[pyfunction]
pub fn family_names() -> Vec<(&'static str, &'static str)> {
    Family::ALL.iter().map(|family| (family.name(), family.summary())).collect()
}

/// The 95 % interval of a share.
#[pyfunction]
pub fn wilson(passed: usize, count: usize) -> [f64; 2] {
    families::wilson(passed, count)
}

/// Runs the world of a seed on one thread and checks it against its law.
#[pyfunction]
pub fn judge(py: Python<'_>, family: &str, seed: u64, config: &Config) -> PyResult<JudgedWorld> {
    let family: Family = family.parse().map_err(raised)?;
    let mut interrupt = None;
    let judged = py.detach(|| {
        let mut stop = || Python::attach(|py| py.check_signals()).map_err(|error| interrupt = Some(error)).is_err();
        judged(family, seed, config, &mut stop).map_err(|error| error.within(family.spec(seed)))
    });
    match interrupt {
        Some(interrupt) => Err(interrupt),
        None => judged.map_err(raised),
    }
}

fn judged(
    family: Family,
    seed: u64,
    Config(config): &Config,
    stop: &mut (dyn FnMut() -> bool + Send),
) -> drystone::Result<JudgedWorld> {
    let Member { scene, law } = family.member(seed)?;
    let open = || Ok(Box::new(Cpu::new()) as Box<dyn Backend>);
    let setup = Setup { config: config.clone(), open: &open };
    let every = (scene.steps / LOOKS).max(1);
    let (mut step, mut price, mut overlap, mut hash) = (0, 0, 0.0, 0);
    let judged = families::one_thread()?.install(|| {
        families::judge_while(&scene, &law, &setup, |simulation, stats| {
            step += 1;
            let efforts = stats.efforts.iter().enumerate();
            price += efforts.map(|(class, &bodies)| u64::from(bodies) << class).sum::<u64>();
            if step % every == 0 || step == scene.steps {
                overlap = largest(overlap, [simulation.penetration().max]);
                hash = simulation.hash();
            }
            if step % every == 0 && stop() {
                return Err(drystone::Error::Input("interrupted".to_owned()));
            }
            Ok(())
        })
    })?;
    let check = |check: &drystone_cli::hard::Check| {
        let (Limit::AtMost(limit) | Limit::AtLeast(limit)) = check.limit;
        CheckRow { what: check.what.clone(), value: check.value, limit, passed: check.passed }
    };
    let world = &scene.world;
    Ok(JudgedWorld {
        bodies: world.dynamic_count(),
        height: height(world),
        storeys: height(world) * world.dynamic_count() as f64
            / world.dynamic().map(|body| 2.0 * half_height(body)).sum::<f64>(),
        mass_ratio: mass_ratio(world),
        gravity: world.gravity.length().into(),
        dt: scene.dt,
        steps: scene.steps,
        passed: passes(&judged.checks),
        checks: judged.checks.iter().map(check).collect(),
        overlap_max: overlap,
        price: price * u64::from(config.substeps),
        seconds: judged.seconds,
        hash: format!("{hash:016x}"),
    })
}

/// Height from the lowest to the highest point of the dynamic bodies (m).
fn height(world: &World) -> f64 {
    let ends = world.dynamic().map(|body| {
        let bounds = body.colliders.iter().map(|collider| collider.bounds(body.position, body.rotation));
        bounds.fold((f64::MAX, f64::MIN), |(low, high), (a, b)| (low.min(a.y.into()), high.max(b.y.into())))
    });
    let (low, high) = ends.fold((f64::MAX, f64::MIN), |(low, high), (a, b)| (low.min(a), high.max(b)));
    high - low
}

/// Mass of the heaviest dynamic body divided by that of the lightest.
fn mass_ratio(world: &World) -> f64 {
    let masses = || world.dynamic().map(|body| f64::from(body.mass.mass));
    masses().fold(f64::MIN, f64::max) / masses().fold(f64::MAX, f64::min)
}
