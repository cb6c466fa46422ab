//! The scenes of the report, and drystone's settings.

use super::contender::{Contender, Drystone, Extent};
use crate::adapter;
use crate::settings;
use drystone::{Result, SolverConfig};
use drystone_scenes::Scene;

/// The scenes with at most 1,000 bodies, for a full and for a brief report.
///
/// Only drystone starts structures that are built in place with their impulses at rest. Therefore the list also has
/// structures that fall from gaps.
const SMALL: [&str; 15] = [
    "tower:n=20,gap=0.005",
    "tower:n=10,top_ratio=1000,gap=0.005",
    "mass-ratio:gap=0.005",
    "wall:gap=0.005",
    "tower:n=20",
    "tower:n=10,top_ratio=1000",
    "tower:n=20,top_ratio=1000",
    "tower:n=30,top_ratio=100",
    "mass-ratio",
    "chain",
    "wall",
    "pile:n=512,ratio=100",
    "pile:n=1000",
    "pile-mixed",
    "pile-mixed:n=600,kinds=6",
];

/// More scenes of a full report.
const FULL: [&str; 3] = ["pyramid:base=40,gap=0.005", "pyramid:base=100", "pile:n=5000"];

/// More scenes of a brief report.
const BRIEF: [&str; 2] = ["pyramid:base=40,gap=0.005", "pyramid:base=40"];

const QUICK: [&str; 6] = [
    "tower:n=20,gap=0.005",
    "tower:n=20",
    "tower:n=10,top_ratio=1000",
    "mass-ratio",
    "chain",
    "wall:rows=10,columns=10",
];

/// Scenes from this number of bodies on have fewer steps and settings, and do not run on a software adapter.
const LARGE: usize = 2000;

/// Steps of a large scene; the pile is at rest after half of them.
const LARGE_STEPS: u32 = 300;

pub fn scenes(extent: Extent) -> Result<Vec<Scene>> {
    let names = match extent {
        Extent::Quick => QUICK.to_vec(),
        Extent::Brief => [&SMALL[..], &BRIEF].concat(),
        Extent::Full => [&SMALL[..], &FULL].concat(),
    };
    let named = |name: &&str| {
        let scene = scene(name)?;
        let steps = if is_large(&scene) { scene.steps.min(LARGE_STEPS) } else { scene.steps };
        Ok(Scene { steps, ..scene })
    };
    names.iter().map(named).collect()
}

/// A scene by [`Scene::find_spec`], with the specification as its name.
pub fn scene(word: &str) -> Result<Scene> {
    Ok(Scene { name: word.to_owned(), ..Scene::find_spec(word)? })
}

fn is_large(scene: &Scene) -> bool {
    scene.world.dynamic_count() >= LARGE
}

/// The substeps of settings with defaults otherwise: up to 128 for few bodies, 32 for many.
pub fn substeps(scene: &Scene, extent: Extent) -> impl Iterator<Item = u32> + use<> {
    let most = match (extent, scene.world.dynamic_count()) {
        (_, LARGE..) | (Extent::Quick, 100..) => 32,
        (Extent::Quick, _) | (_, 100..) => 64,
        _ => 128,
    };
    [2, 4, 8, 16, 32, 64, 128].into_iter().filter(move |&n| n <= most)
}

/// Settings with sweeps instead of substeps: substeps, and sweeps per substep.
const SWEEPS: [(u32, u32); 8] = [(1, 16), (4, 4), (1, 4), (2, 4), (2, 16), (4, 2), (4, 16), (8, 4)];

/// Drystone with the settings of the report: the line of substeps, and from it one step along each other axis. The
/// product of all axes would be some hundred settings per scene. The reference and the shaders on a software adapter
/// have the errors of the CPU lanes, so they run only at the defaults, for their time.
pub fn drystone(scene: &Scene, extent: Extent) -> Result<Vec<Box<dyn Contender>>> {
    let few = is_large(scene) || extent == Extent::Quick;
    let brief = extent == Extent::Brief;
    let default = SolverConfig::default().substeps;
    // Times are relative to the first setting, the defaults.
    let mut points: Vec<(&str, String)> = vec![("cpu", String::new())];
    points.extend(substeps(scene, extent).filter(|&n| n != default).map(|n| ("cpu", format!("substeps={n}"))));
    let sweeps = if brief {
        0
    } else if few {
        2
    } else {
        SWEEPS.len()
    };
    for (substeps, sweeps) in SWEEPS.into_iter().take(sweeps) {
        let point = format!("substeps={substeps} iterations={sweeps} relax={sweeps}");
        if sweeps > 2 {
            // Momentum starts with the third sweep.
            points.push(("cpu", format!("{point} method=accelerated")));
        }
        points.push(("cpu", point));
    }
    for rule in [
        "friction=box",
        "friction_at=manifold",
        "contact_frequency=0.25",
        "preload_rate=0",
        "preload_rate=0 contact_frequency=0.25",
    ] {
        let some: &[u32] = if few {
            &[8]
        } else if brief {
            &[4, 8, 16, 32]
        } else {
            &[4, 8, 16]
        };
        points.extend(some.iter().map(|n| ("cpu", format!("substeps={n} {rule}"))));
    }
    if extent != Extent::Quick {
        // All islands take the same substeps, for any load.
        for rule in ["", " preload_rate=0 contact_frequency=0.25"] {
            points.extend([1, 2, 4, 8, 16, 32].map(|n| ("cpu", format!("substeps={n} max_substeps={n}{rule}"))));
        }
        // A looser limit on overlap, and a tighter one.
        points.extend([0.1, 0.001].map(|share| ("cpu", format!("max_penetration_share={share}"))));
    }
    if !scene.world.joints.is_empty() {
        for solver in ["direct", "sweeps"] {
            points.extend(substeps(scene, extent).map(|n| ("cpu", format!("substeps={n} joint_solver={solver}"))));
        }
    }
    if !brief {
        points.push(("reference", String::new()));
    }
    match adapter::best().filter(|_| !brief) {
        Some(adapter) if adapter.hardware => {
            points.extend(substeps(scene, extent).map(|n| ("gpu", format!("substeps={n}"))));
        }
        Some(_) if !is_large(scene) => points.push(("gpu", String::new())),
        _ => {}
    }
    let contender = |(backend, settings): (&str, String)| -> Result<Box<dyn Contender>> {
        Ok(Box::new(Drystone::new(scene, backend, &settings::awake(settings.split_whitespace())?)?))
    };
    points.into_iter().map(contender).collect()
}
