//! Measures world steps per second for several numbers of worlds.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::{pool, settled};
use drystone::stats::median;
use drystone::{Cpu, Result, Simulation, SolverConfig};

pub const WORLDS: [&str; 2] = ["tower", "pile:n=100"];
pub const COUNTS: [usize; 5] = [1, 16, 256, 1024, 4096];

/// Steps before the measurement, because impulses start at zero in each world.
const SETTLE: usize = 10;
/// Smallest number of steps of a measurement, and its shortest duration (s).
const STEPS: usize = 8;
const SECONDS: f64 = 0.3;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorldsRow {
    pub scene: String,
    pub threads: usize,
    pub worlds: usize,
    pub bodies: usize,
    /// Median wall time of a step of all worlds (ms).
    pub ms: f64,
    /// Steps of single worlds per second.
    pub per_second: f64,
    /// The same relative to the best number of worlds.
    pub of_best: f64,
}

/// Steps each number of worlds of each scene, all at rest. Calls `after_count` after each number of worlds.
pub fn worlds(
    specs: &[String],
    counts: &[usize],
    threads: &[usize],
    after_count: &mut dyn FnMut(),
) -> Result<Vec<WorldsRow>> {
    let config = SolverConfig::default().without_sleep();
    let mut rows = Vec::new();
    for spec in specs {
        let (one, _, _, dt) = settled(spec, &config)?;
        let first = rows.len();
        for &count in counts {
            let mut world = one.world.clone();
            (1..count).for_each(|_| world.beside(&one.world));
            let mut simulation = Simulation::with(world, config.clone(), Box::new(Cpu::new()))?;
            (0..SETTLE).try_for_each(|_| simulation.step(dt).map(drop))?;
            for &threads in threads {
                let ms = pool(threads)?.install(|| ms_a_step(&mut simulation, dt))?;
                let per_second = count as f64 * 1e3 / ms;
                let bodies = simulation.world.dynamic_count();
                rows.push(WorldsRow {
                    scene: spec.clone(),
                    threads,
                    worlds: count,
                    bodies,
                    ms,
                    per_second,
                    of_best: 0.0,
                });
            }
            after_count();
        }
        for k in first..rows.len() {
            let same = rows[first..].iter().filter(|row| row.threads == rows[k].threads);
            rows[k].of_best = rows[k].per_second / same.map(|row| row.per_second).fold(0.0, f64::max);
        }
    }
    Ok(rows)
}

fn ms_a_step(simulation: &mut Simulation, dt: f32) -> Result<f64> {
    let (begin, mut times) = (Instant::now(), Vec::new());
    while times.len() < STEPS || begin.elapsed().as_secs_f64() < SECONDS {
        times.push(simulation.step(dt)?.times.total().as_secs_f64() * 1e3);
    }
    Ok(median(&times))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_a_second_are_those_of_all_worlds_and_one_number_of_worlds_is_the_best() {
        let rows = worlds(&["tower:n=3".into()], &[1, 4], &[1, 2], &mut || ()).expect("runs");
        assert_eq!(
            rows.iter().map(|r| (r.worlds, r.bodies, r.threads)).collect::<Vec<_>>(),
            [(1, 3, 1), (1, 3, 2), (4, 12, 1), (4, 12, 2)]
        );
        for row in &rows {
            assert!(
                row.ms > 0.0 && (row.per_second * row.ms / (1e3 * row.worlds as f64) - 1.0).abs() < 1e-9,
                "{row:?}"
            );
        }
        for threads in [1, 2] {
            let shares: Vec<_> = rows.iter().filter(|r| r.threads == threads).map(|r| r.of_best).collect();
            assert!(shares.contains(&1.0) && shares.iter().all(|share| *share > 0.0 && *share <= 1.0), "{shares:?}");
        }
    }
}
