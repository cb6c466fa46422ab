//! The scenes of the report, and the settings with which drystone runs them.

use super::contender::{Contender, Drystone, Extent};
use crate::backend::gpu::adapters;
use crate::config::SolverConfig;
use crate::error::Result;
use crate::scenes::Scene;

/// Scenes of the whole report.
const FULL: [&str; 9] = [
    "tower:n=20",
    "tower:n=10,top_ratio=1000",
    "mass-ratio",
    "chain",
    "wall",
    "pile:n=512,ratio=100",
    "pile:n=1000",
    "pyramid:base=100",
    "pile:n=5000",
];

/// Those of them that two minutes are enough for.
const QUICK: [&str; 5] = ["tower:n=20", "tower:n=10,top_ratio=1000", "mass-ratio", "chain", "wall:rows=10,columns=10"];

/// Bodies from which on a scene is run with fewer settings, and not on an adapter that is software.
const LARGE: usize = 2000;

/// The scenes of the report.
///
/// # Errors
/// Never: the catalogue has them.
pub fn course(extent: Extent) -> Result<Vec<Scene>> {
    let names = if extent == Extent::Quick { QUICK.as_slice() } else { &FULL };
    names.iter().map(|name| Scene::named(name)).collect()
}

/// Substeps of the line along which everything else is at its default.
const SUBSTEPS: [u32; 7] = [2, 4, 8, 16, 32, 64, 128];

/// Substeps and sweeps of each off that line: sweeps where substeps could be.
const SWEEPS: [(u32, u32); 9] = [(1, 4), (1, 16), (1, 64), (2, 4), (2, 16), (4, 2), (4, 4), (4, 16), (8, 4)];

/// Drystone with the settings of the report.
///
/// Not the product of all axes, which is some hundred settings a scene: the line of substeps, and from it one step along each
/// other axis. The reference gives the bits of the CPU's lanes, so its errors are theirs: it stands for itself at the defaults
/// only, to show its time. Shaders on a software adapter run at the defaults only, for the same reason.
///
/// # Errors
/// The scene is not fit to be simulated.
pub fn drystone(scene: &Scene, extent: Extent) -> Result<Vec<Box<dyn Contender>>> {
    let large = scene.world.dynamic_count() >= LARGE;
    let quick = extent == Extent::Quick;
    let line = || SUBSTEPS.into_iter().filter(|&n| n <= if large { 32 } else if quick { 64 } else { 128 });
    let default = SolverConfig::default().substeps;
    let mut points: Vec<(&str, String)> = vec![("cpu", String::new())];
    points.extend(line().filter(|&n| n != default).map(|n| ("cpu", format!("substeps={n}"))));
    for (substeps, sweeps) in SWEEPS.into_iter().filter(|&(n, sweeps)| !(quick || large && n * sweeps > 16)) {
        points.push(("cpu", format!("substeps={substeps} iterations={sweeps} relax={sweeps}")));
    }
    let other = if quick { 8..=8 } else { 4..=16 };
    for rule in ["friction=box", "friction_at=manifold", "contact_frequency=0.25"] {
        points.extend(line().filter(|n| other.contains(n)).map(|n| ("cpu", format!("substeps={n} {rule}"))));
    }
    points.push(("reference", String::new()));
    match adapters().first() {
        Some(adapter) if adapter.hardware => points.extend(line().map(|n| ("gpu", format!("substeps={n}")))),
        Some(_) if !large => points.push(("gpu", String::new())),
        _ => {}
    }
    points.into_iter().map(|(backend, settings)| contender(scene, backend, &settings)).collect()
}

fn contender(scene: &Scene, backend: &str, settings: &str) -> Result<Box<dyn Contender>> {
    let mut config = SolverConfig::default();
    settings.split_whitespace().try_for_each(|assignment| config.set(assignment))?;
    Ok(Box::new(Drystone::new(scene, backend, &config)?))
}
