//! The other engines as a report has them: at their defaults, and over their substeps and the stiffness of their contacts.

use drystone::{Result, Scene};
use drystone_cli::report::comparison::{Contender, Extent, substeps};

use crate::{Engine, Entrant};

/// The other engines of this build with the settings of the report.
///
/// # Errors
/// A scene that is not fit for an engine, or several threads for a Rapier that was built for one.
pub fn team(scene: &Scene, extent: Extent, threads: usize) -> Result<Vec<Box<dyn Contender>>> {
    let line = || substeps(scene, extent);
    let mut all = Vec::new();
    for engine in Engine::built().into_iter().filter(|&engine| engine != Engine::Drystone) {
        let usual = Entrant::default_of(engine);
        let at = |substeps, frequency| Entrant { substeps, frequency, ..usual.clone() };
        // As stiff as drystone relative to its substeps, and for Rapier, which takes it, twice that.
        let mut entrants: Vec<_> = line().map(|n| at(n, Some(0.125))).collect();
        if engine == Engine::Rapier {
            entrants.extend(line().map(|n| at(n, Some(0.25))));
        }
        // More substeps at the stiffness of its defaults.
        entrants.extend([at(8, None), at(16, None)]);
        let named = |e: &Entrant| (e.substeps, e.hertz(scene.dt).round());
        let mut once = vec![usual.clone()];
        for entrant in entrants {
            if once.iter().all(|known| named(known) != named(&entrant)) {
                once.push(entrant);
            }
        }
        for entrant in once {
            all.push(entrant.build(scene, threads)?);
        }
    }
    Ok(all)
}
