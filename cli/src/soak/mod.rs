//! Worlds that run for a long time, with checks that they stay level.

mod judge;
mod worlds;

use cpu_time::ProcessTime;
use drystone::stages::memory;
use drystone::{Error, Result, Simulation};
use drystone_scenes::{Scene, Spawners};

pub use judge::judge;
use worlds::Acts;
pub use worlds::{NAMES, WORLDS};

/// Number of rows of a world, for any number of steps.
pub const ROWS: u32 = 100;

/// The measurements of some steps of a world. Values are means over the steps unless they say otherwise.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Row {
    pub scene: String,
    /// Number of steps from the start of the run to the end of this row.
    pub step: u32,
    /// Processor time of a step (ms).
    pub ms: f64,
    /// Resident memory of the process at the end (B); empty if the system does not report it.
    pub resident: Option<f64>,
    /// Size of the saved state at the end (B).
    pub state: f64,
    /// Number of bodies, and of places for bodies, at the end.
    pub bodies: f64,
    pub places: f64,
    /// Number of joints at the end.
    pub joints: f64,
    pub pairs: f64,
    /// Number of slots for contacts at the end, including free ones.
    pub slots: f64,
    pub asleep: f64,
    /// Kinetic energy (J).
    pub energy: f64,
    /// Deepest overlap at the end (m).
    pub overlap: f64,
    /// Number of bodies outside the container at the end.
    pub outside: f64,
    /// Number of wrong handles at the end: they name no body although theirs exists, or a body although theirs was
    /// removed.
    pub lost: f64,
}

/// A world for a long run.
pub struct Soaked {
    scene: Scene,
    spawners: Spawners,
    acts: Acts,
    simulation: Simulation,
    step: u32,
}

impl Soaked {
    /// Finds a world of [`WORLDS`], or a scene of the catalogue with its parameters as `name:key=value,...`, or a scene
    /// file.
    ///
    /// # Errors
    /// There is no such world or scene.
    pub fn new(spec: &str) -> Result<Self> {
        let (mut scene, acts) = worlds::find(spec)?;
        spec.clone_into(&mut scene.name);
        let spawners = Spawners::new(&scene);
        let world = std::mem::take(&mut scene.world);
        let simulation = Simulation::new(world)?;
        Ok(Self { scene, spawners, acts, simulation, step: 0 })
    }

    /// Advances the world by some steps.
    ///
    /// # Errors
    /// A step fails, or leaves a number that is not finite.
    pub fn go(&mut self, steps: u32) -> Result<Row> {
        let (mut spent, mut pairs, mut asleep, mut energy) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..steps {
            self.spawners.before_step(&mut self.simulation.world, self.scene.dt);
            self.acts.before_step(self.step, self.scene.dt, &mut self.simulation.world);
            let begin = ProcessTime::now();
            let stats = self.simulation.step(self.scene.dt)?;
            spent += begin.elapsed().as_secs_f64();
            self.step += 1;
            pairs += stats.pairs as f64;
            asleep += stats.asleep as f64;
            energy += self.simulation.world.kinetic_energy();
            if let Some(body) = stats.first_non_finite {
                let (name, step) = (&self.scene.name, self.step);
                return Err(Error::input(format!(
                    "{name}: body {} left the finite range in step {step}",
                    body.index()
                )));
            }
        }
        let mean = |sum: f64| sum / f64::from(steps);
        let world = &self.simulation.world;
        Ok(Row {
            scene: self.scene.name.clone(),
            step: self.step,
            ms: 1e3 * mean(spent),
            resident: memory::resident(),
            bodies: world.bodies.count() as f64,
            places: world.bodies.len() as f64,
            joints: world.joints.len() as f64,
            outside: self.scene.escaped(world) as f64,
            lost: self.acts.lost(world) as f64,
            pairs: mean(pairs),
            asleep: mean(asleep),
            energy: mean(energy),
            slots: self.simulation.problem().contacts.len() as f64,
            overlap: self.simulation.penetration().max,
            state: self.simulation.save().len() as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hard::passes;

    fn rows(soaked: &mut Soaked, steps: u32) -> Vec<Row> {
        (0..ROWS).map(|_| soaked.go(steps / ROWS).expect("steps")).collect()
    }

    #[test]
    fn every_world_moves_and_nothing_leaves_it() {
        for name in NAMES {
            let mut soaked = Soaked::new(name).expect("a world");
            let row = soaked.go(400).expect("steps");
            assert!(row.energy > 0.0 && row.pairs > 0.0 && row.bodies > 1.0, "{row:?}");
            assert_eq!((row.outside, row.lost), (0.0, 0.0), "{name}");
            assert!(row.overlap < 0.02, "{row:?}");
        }
    }

    /// The first box exists before any spawner adds one.
    #[test]
    fn what_is_there_at_first_leaves_too() {
        let mut soaked = Soaked::new("conveyor").expect("a world");
        soaked.go(600).expect("steps");
        assert!(soaked.simulation.world.dynamic().all(|body| body.position.y > -2.0));
    }

    #[test]
    fn bodies_that_never_leave_are_found() {
        let failed = |keeps: usize, steps: u32| {
            let mut soaked = Soaked::new("rain").expect("a world");
            soaked.acts.keep(keeps);
            let checks = judge(&rows(&mut soaked, steps)).expect("rows");
            checks.into_iter().filter(|check| !check.passed).map(|check| check.what).collect::<Vec<_>>()
        };
        let failed_of_a_leak = failed(usize::MAX, 700);
        for word in ["bodies", "places", "slots", "saved state"] {
            assert!(failed_of_a_leak.iter().any(|what| what.contains(word)), "{word}: {failed_of_a_leak:?}");
        }
        let failed_of_twenty = failed(20, 2000);
        assert!(!failed_of_twenty.iter().any(|what| what.contains("places")), "{failed_of_twenty:?}");
    }

    #[test]
    fn handles_that_name_other_bodies_are_found() {
        let mut soaked = Soaked::new("rain").expect("a world");
        soaked.go(300).expect("steps");
        let last = soaked.simulation.world.bodies.handles().last().expect("a body");
        soaked.simulation.world.remove(last);
        assert_eq!(soaked.acts.lost(&soaked.simulation.world), 1);
        let row = soaked.go(1).expect("a step");
        assert!(!passes(&judge(&vec![row; 20]).expect("rows")));
    }
}
