//! Measures the cost of keeping a state and going back to it, compared with a step.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::{column, pool, settled};
use drystone::stats::median;
use drystone::{Cpu, Result, Simulation, SolverConfig};

/// Scenes of the measurement. A short measurement leaves out the last one.
pub const STATES: [&str; 2] = ["pile:n=1000", "pile:n=20000"];

/// A scene at rest and awake, with one number of threads. Times are medians over the rounds (ms).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatesRow {
    pub scene: String,
    pub threads: usize,
    pub bodies: usize,
    /// Time of a step.
    pub ms: f64,
    /// Time of [`Simulation::snapshot_into`] allocated memory.
    pub snapshot: f64,
    pub restore: f64,
    pub save: f64,
    pub load: f64,
    /// Bytes of a saved state divided by the number of dynamic bodies.
    pub bytes_a_body: f64,
}

/// Measures the scenes `specs` with each number of `threads`, in `rounds` rounds: a step, a snapshot, a restore, a save
/// and a load. Calls `after_round` after each round of a scene with one number of threads.
pub fn states(
    specs: &[String],
    threads: &[usize],
    rounds: usize,
    after_round: &mut dyn FnMut(),
) -> Result<Vec<StatesRow>> {
    let mut rows = Vec::new();
    for spec in specs {
        let (mut simulation, _, _, dt) = settled(spec, &SolverConfig::default().without_sleep())?;
        for &threads in threads {
            let pool = pool(threads)?;
            let mut times = Vec::new();
            let mut length = 0;
            for _ in 0..rounds {
                let (own, bytes) = pool.install(|| round(&mut simulation, dt))?;
                times.push(own);
                length = bytes;
                after_round();
            }
            let [ms, snapshot, restore, save, load] = std::array::from_fn(|i| median(&column(&times, i)));
            let bodies = simulation.world.dynamic_count();
            let bytes_a_body = length as f64 / bodies as f64;
            rows.push(StatesRow {
                scene: spec.clone(),
                threads,
                bodies,
                ms,
                snapshot,
                restore,
                save,
                load,
                bytes_a_body,
            });
        }
    }
    Ok(rows)
}

/// The times of a round (ms), and the length of a saved state.
fn round(simulation: &mut Simulation, dt: f32) -> Result<([f64; 5], usize)> {
    // Memory that is already allocated.
    let mut state = simulation.snapshot();
    let (stepped, step) = timed(|| simulation.step(dt));
    stepped?;
    let ((), snapshot) = timed(|| simulation.snapshot_into(&mut state));
    let ((), restore) = timed(|| simulation.restore(&state));
    let (bytes, save) = timed(|| simulation.save());
    let (loaded, load) = timed(|| Simulation::load(&bytes, Box::new(Cpu::new())));
    loaded?;
    Ok(([step, snapshot, restore, save, load], bytes.len()))
}

/// The result of a call, and its wall time (ms).
fn timed<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let begin = Instant::now();
    let given = call();
    (given, begin.elapsed().as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_of_a_small_pile_have_times_and_a_length() {
        let mut rounds = 0;
        let rows = states(&["pile:n=27".into()], &[1, 2], 3, &mut || rounds += 1).expect("runs");
        assert_eq!((rounds, rows.iter().map(|r| r.threads).collect::<Vec<_>>()), (6, vec![1, 2]));
        for row in rows {
            let StatesRow { bodies, ms, snapshot, restore, save, load, bytes_a_body, .. } = row;
            assert!(bodies == 27 && [ms, snapshot, restore, save, load].iter().all(|&time| time > 0.0));
            // A pose and a velocity alone are 13 numbers.
            assert!((52.0..2000.0).contains(&bytes_a_body), "{bytes_a_body} B");
        }
    }
}
