//! Rapier and Box3D as a report has them: at their defaults, and over their substeps and the stiffness of their contacts.

use drystone::{Result, Scene};
use drystone_cli::report::comparison::{Contender, Extent, substeps};

use crate::{Engine, Entrant};

/// Both engines with the settings of the report.
///
/// # Errors
/// A scene that is not fit for an engine, or several threads for a Rapier that was built for one.
pub fn team(scene: &Scene, extent: Extent, threads: usize) -> Result<Vec<Box<dyn Contender>>> {
    let line = || substeps(scene, extent);
    let mut all = Vec::new();
    for engine in [Engine::Rapier, Engine::Box3d] {
        let usual = Entrant::default_of(engine);
        let at = |substeps, frequency| Entrant { substeps, frequency, ..usual.clone() };
        // As stiff as drystone relative to its substeps, and for Rapier, which takes it, twice that.
        let mut entrants: Vec<_> = line().map(|n| at(n, Some(0.125))).collect();
        if engine == Engine::Rapier {
            entrants.extend(line().map(|n| at(n, Some(0.25))));
        }
        // More substeps at the stiffness of its defaults.
        entrants.extend([at(8, None), at(16, None)]);
        let new =
            |e: &&Entrant| (e.substeps, e.hertz(scene.dt).round()) != (usual.substeps, usual.hertz(scene.dt).round());
        let rest = entrants.iter().filter(new);
        for entrant in std::iter::once(&usual).chain(rest) {
            all.push(entrant.build(scene, threads)?);
        }
    }
    Ok(all)
}
