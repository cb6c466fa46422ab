//! Measures scenes from their first step: times of the stages in each third of the run.

use serde::{Deserialize, Serialize};

use super::{TURN, column, pool, stage_times};
use crate::report::rounds::{interleave, thirds};
use crate::report::scene_hash::content_hash;
use crate::settings;
use drystone::metrics::{Penetration, rms_speed};
use drystone::stats::{largest, median};
use drystone::{Backend, Result, Simulation, SolverConfig, StepStats};
use drystone_scenes::{Scene, Spawners};

pub const FALLING: [&str; 3] = ["pyramid:base=100", "pile:n=5120", "pile:n=20000"];
pub const FALLING_QUICK: [&str; 2] = ["pyramid:base=20", "pile:n=1000"];

/// Wall times of the stages of a step (ms) in one third of a run: medians over its steps, without the first step of the
/// run. Errors are those at the end of the third. [`comparison::WindowRow`](crate::report::comparison::WindowRow)
/// compares engines, which do not report stages.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FallingRow {
    pub scene: String,
    pub hash: String,
    pub backend: String,
    pub threads: usize,
    pub settings: String,
    pub bodies: usize,
    /// The first and the last step of the third, counted from 1.
    pub from: usize,
    pub to: usize,
    /// All stages together: median and largest.
    pub ms: f64,
    pub ms_worst: f64,
    /// The first step of the run.
    pub ms_first: f64,
    pub detect: f64,
    pub color: f64,
    pub prepare: f64,
    /// Sweeps and transfers.
    pub run: f64,
    pub store: f64,
    /// Medians per step: pairs, pairs with recomputed manifolds, and manifolds.
    pub pairs: f64,
    pub computed: f64,
    pub manifolds: f64,
    /// Overlaps (m) and speed (m/s).
    pub penetration_max: f64,
    pub penetration_mean: f64,
    pub speed_rms: f64,
}

struct Fall {
    spec: String,
    hash: String,
    dt: f32,
    simulation: Simulation,
    spawners: Spawners,
    pool: rayon::ThreadPool,
    steps: Vec<[f64; 6]>,
    counts: Vec<[f64; 3]>,
    ends: Vec<(Penetration, f64)>,
}

/// Runs the scenes `specs` for `steps` steps on each backend of `open`, with each number of `threads`. Calls
/// `after_turn` after each turn of ten steps of each combination.
pub fn falling(
    specs: &[String],
    config: &SolverConfig,
    threads: &[usize],
    open: &dyn Fn() -> Result<Vec<Box<dyn Backend>>>,
    steps: usize,
    after_turn: &mut dyn FnMut(),
) -> Result<Vec<FallingRow>> {
    let mut falls = Vec::new();
    for spec in specs {
        let scene = Scene::find_spec(spec)?;
        for &threads in threads {
            for backend in open()? {
                falls.push(Fall {
                    spec: spec.clone(),
                    hash: content_hash(&scene),
                    dt: scene.dt,
                    simulation: Simulation::with(scene.world.clone(), config.clone(), backend)?,
                    spawners: Spawners::new(&scene),
                    pool: pool(threads)?,
                    steps: Vec::new(),
                    counts: Vec::new(),
                    ends: Vec::new(),
                });
            }
        }
    }
    let turns = turns(steps);
    let ends = thirds(turns).map(|third| third.end - 1);
    interleave(turns, &mut falls, |turn, fall| {
        fall.turn()?;
        if ends.contains(&turn) {
            fall.ends.push((fall.simulation.penetration(), rms_speed(&fall.simulation.world)));
        }
        after_turn();
        Ok(())
    })?;
    Ok(falls.into_iter().flat_map(|fall| fall.rows(config)).collect())
}

/// Number of turns of a run with this number of steps: at least one in each third.
pub fn turns(steps: usize) -> usize {
    steps.div_ceil(TURN).max(3)
}

impl Fall {
    fn turn(&mut self) -> Result<()> {
        let Self { simulation, spawners, pool, dt, steps, counts, .. } = self;
        pool.install(|| {
            (0..TURN).try_for_each(|_| {
                spawners.before_step(&mut simulation.world, *dt);
                let stats: StepStats = simulation.step(*dt)?;
                steps.push(stage_times(&stats));
                counts.push([stats.pairs, stats.computed, stats.manifolds].map(|count| count as f64));
                Ok(())
            })
        })
    }

    fn rows(self, config: &SolverConfig) -> Vec<FallingRow> {
        let thirds = thirds(self.steps.len() / TURN);
        let row = |(third, (penetration, speed)): (std::ops::Range<usize>, &(Penetration, f64))| {
            let (from, to) = (third.start * TURN, third.end * TURN);
            let (steps, counts) = (&self.steps[from.max(1)..to], &self.counts[from.max(1)..to]);
            let [detect, color, prepare, run, store, ms] = std::array::from_fn(|i| median(&column(steps, i)));
            let [pairs, computed, manifolds] = std::array::from_fn(|i| median(&column(counts, i)));
            FallingRow {
                scene: self.spec.clone(),
                hash: self.hash.clone(),
                backend: self.simulation.backend().name().into(),
                threads: self.pool.current_num_threads(),
                settings: settings::unusual(config, &["sleep_after"]).join(" "),
                bodies: self.simulation.world.dynamic_count(),
                from: from + 1,
                to,
                ms,
                ms_worst: largest(0.0, column(steps, 5)),
                ms_first: self.steps[0][5],
                detect,
                color,
                prepare,
                run,
                store,
                pairs,
                computed,
                manifolds,
                penetration_max: penetration.max,
                penetration_mean: penetration.mean,
                speed_rms: *speed,
            }
        };
        thirds.into_iter().zip(&self.ends).map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_scene_has_three_thirds_with_their_stages_and_every_way_the_same_errors() {
        let open = || Ok(vec![Box::new(drystone::Cpu::new()) as Box<dyn Backend>]);
        let (config, mut turns) = (SolverConfig::default().without_sleep(), 0);
        let rows = falling(&["pile:n=27".into()], &config, &[1, 2], &open, 60, &mut || turns += 1).expect("runs");
        assert_eq!(turns, 2 * 6);
        assert_eq!(
            rows.iter().map(|r| (r.threads, r.from, r.to)).collect::<Vec<_>>()[1..4],
            [(1, 21, 40), (1, 41, 60), (2, 1, 20)]
        );
        for (one, two) in rows[..3].iter().zip(&rows[3..]) {
            let errors = |r: &FallingRow| (r.penetration_max, r.penetration_mean, r.speed_rms, r.pairs, r.manifolds);
            assert_eq!(errors(one), errors(two), "threads change no bit");
            assert!(one.ms > 0.0 && one.ms_worst >= one.ms && one.ms_first > 0.0, "{one:?}");
            assert!(one.detect + one.color + one.prepare + one.run + one.store < 2.0 * one.ms, "{one:?}");
        }
        // Boxes fall before they touch: first speeds grow, then contacts.
        assert!(rows[0].speed_rms > 1.0 && rows[0].manifolds < rows[2].manifolds, "{rows:?}");
    }
}
