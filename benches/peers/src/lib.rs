//! Other engines on drystone's scenes: each takes the same [`World`](drystone::World), steps it by itself and gives poses and
//! velocities back, so that drystone's own [`measure`](drystone_cli::report::comparison::measure) times and scores all of them.
//!
//! The same for all engines: shapes, masses and inertias, friction (geometric mean) and restitution (larger), joints,
//! gravity, forces, the length of a step. Nothing sleeps and nothing is damped. Everything else (speculative margins, reuse of
//! contacts, friction model, restitution threshold) is what an engine does unless told otherwise.

mod box3d;
#[cfg(feature = "bullet")]
mod bullet;
mod entrant;
#[cfg(feature = "physx")]
mod physx;
mod rapier;
mod round;
mod setting;
mod team;

pub use entrant::{BulletSolver, Engine, Entrant};
pub use team::team;

use drystone::Result;
use drystone_maze::{Game, Map};

/// The maze game on `map` in Rapier's hands; `frequency` as in [`Entrant`], `unit` the size of things [m], 1 unless told: Rapier's
/// margins and thresholds go with it.
///
/// # Errors
/// A map that is not fit for a board.
pub fn rapier_game(map: Map, substeps: u32, frequency: Option<f32>, unit: f32) -> Result<Game> {
    let entrant = Entrant { substeps, frequency, ..Entrant::default_of(Engine::Rapier) };
    Game::with(map, |scene| {
        let hertz = entrant.hertz(scene.dt);
        Ok(Box::new(rapier::Rapier::new(&scene, substeps, hertz, 1)?.length_unit(unit)))
    })
}

/// The maze game on `map` in Bullet's hands at its defaults, but for `substeps`; things of `unit` meters are as large as those of 1 m are
/// by default, since Bullet's margins and thresholds are lengths.
///
/// # Errors
/// A map that is not fit for a board; a build without Bullet.
pub fn bullet_game(map: Map, substeps: u32, unit: f32) -> Result<Game> {
    #[cfg(feature = "bullet")]
    return Game::with(map, |scene| {
        let usual = Entrant::default_of(Engine::Bullet);
        Ok(Box::new(bullet::Bullet::new(&scene, substeps, (usual.solver, usual.iterations), 1, unit)?))
    });
    #[cfg(not(feature = "bullet"))]
    {
        let _ = (map, substeps, unit);
        Err(entrant::no_bullet())
    }
}
