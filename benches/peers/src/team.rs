//! The other engines as a report has them: at their defaults, and over their substeps and the stiffness of their contacts.

use drystone::Result;
use drystone_scenes::Scene;
use drystone_cli::report::comparison::{Contender, Extent, substeps};

use crate::{BulletSolver, Engine, Entrant};

/// Most dynamic bodies for Dantzig's pivots, whose time grows with the third power of the contacts.
const FEW: usize = 40;

/// Dynamic bodies from which on Bullet has few settings.
const MANY: usize = 100;

/// The other engines of this build with the settings of the report.
///
/// # Errors
/// A scene that is not fit for an engine, or several threads for a Rapier that was built for one. Bullet takes part on one thread.
pub fn team(scene: &Scene, extent: Extent, threads: usize) -> Result<Vec<Box<dyn Contender>>> {
    let mut all = Vec::new();
    for engine in Engine::on(threads).into_iter().filter(|&engine| engine != Engine::Drystone) {
        let usual = Entrant::default_of(engine);
        let entrants =
            if engine == Engine::Bullet { bullets(scene, extent, &usual) } else { springs(scene, extent, &usual) };
        let hertz = |e: &Entrant| e.hertz(scene.dt).round();
        let named = |e: &Entrant| (e.substeps, hertz(e), e.solver, e.iterations);
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

/// Settings of an engine over its substeps and the stiffness of its contacts.
fn springs(scene: &Scene, extent: Extent, usual: &Entrant) -> Vec<Entrant> {
    let at = |substeps, frequency| Entrant { substeps, frequency, ..usual.clone() };
    // As stiff as drystone relative to its substeps, and for Rapier, which takes it, twice that.
    let mut entrants: Vec<_> = substeps(scene, extent).map(|n| at(n, Some(0.125))).collect();
    if usual.engine == Engine::Rapier {
        entrants.extend(substeps(scene, extent).map(|n| at(n, Some(0.25))));
    }
    // More substeps at the stiffness of its defaults.
    entrants.extend([at(8, None), at(16, None)]);
    entrants
}

/// Settings of Bullet over iterations and over substeps, for each solver.
fn bullets(scene: &Scene, extent: Extent, usual: &Entrant) -> Vec<Entrant> {
    let at = |solver, substeps, iterations| Entrant { substeps, solver, iterations, ..usual.clone() };
    let (sequential, nncg) = (BulletSolver::Sequential, BulletSolver::Nncg);
    if scene.world.dynamic_count() >= MANY {
        // A step of these takes seconds by more.
        let all = [(sequential, 4, 10), (sequential, 16, 10), (sequential, 1, 50), (sequential, 1, 200), (nncg, 1, 50)];
        return all.map(|(solver, substeps, iterations)| at(solver, substeps, iterations)).into();
    }
    let mut entrants: Vec<_> = substeps(scene, extent).map(|n| at(sequential, n, 10)).collect();
    entrants.extend([20, 50, 100, 200].map(|n| at(sequential, 1, n)));
    entrants.extend([10, 50, 200].map(|n| at(nncg, 1, n)));
    entrants.push(at(nncg, 4, 10));
    if scene.world.dynamic_count() <= FEW {
        entrants.extend([1, 4, 16].map(|n| at(BulletSolver::Dantzig, n, 10)));
    }
    entrants
}
