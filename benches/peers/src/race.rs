//! Contenders in one process, a few steps each in turn, so that whatever slows the machine slows all of them.

use std::time::Instant;

use drystone::stats::median;
use drystone::{Result, Scene};

use crate::{Score, Setting};

/// Steps that one contender takes before it is the next one's turn.
const ROUND: u32 = 20;

/// One scene, several settings.
pub struct Race<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Who takes part.
    pub settings: &'a [Setting],
    /// Threads of each.
    pub threads: usize,
    /// How often everything is run.
    pub repetitions: u32,
}

/// How one contender fared.
#[derive(Clone, Debug)]
pub struct Row {
    /// Who.
    pub setting: Setting,
    /// Median wall time of a step in each repetition [ms].
    pub ms: Vec<f64>,
    /// Errors after the last step.
    pub score: Score,
}

impl Row {
    /// Median, least and greatest of the repetitions [ms].
    pub fn spread(&self) -> [f64; 3] {
        let edge = |pick: fn(f64, f64) -> f64| self.ms.iter().copied().reduce(pick).unwrap_or(f64::NAN);
        [median(&self.ms), edge(f64::min), edge(f64::max)]
    }
}

impl Race<'_> {
    /// Runs it; `done` is called with the number of steps after each turn.
    ///
    /// # Errors
    /// A contender cannot take the scene or do a step.
    pub fn run(&self, mut done: impl FnMut(u32)) -> Result<Vec<Row>> {
        let mut ms = vec![Vec::new(); self.settings.len()];
        let mut scores = Vec::new();
        for repetition in 0..self.repetitions as usize {
            let build = |setting: &Setting| setting.build(self.scene, self.threads);
            let mut contenders = self.settings.iter().map(build).collect::<Result<Vec<_>>>()?;
            let mut times = vec![Vec::new(); contenders.len()];
            for (round, first) in (0..self.scene.steps).step_by(ROUND as usize).enumerate() {
                let steps = ROUND.min(self.scene.steps - first);
                for turn in 0..contenders.len() {
                    // Another one begins each time.
                    let who = (turn + round + repetition) % contenders.len();
                    for _ in 0..steps {
                        let start = Instant::now();
                        contenders[who].step()?;
                        times[who].push(start.elapsed().as_secs_f64() * 1e3);
                    }
                    done(steps);
                }
            }
            ms.iter_mut().zip(&times).for_each(|(all, times)| all.push(median(times)));
            scores = contenders.iter_mut().map(|c| Score::of(self.scene, c.world())).collect();
        }
        let rows = self.settings.iter().zip(ms).zip(scores);
        Ok(rows.map(|((&setting, ms), score)| Row { setting, ms, score }).collect())
    }
}
