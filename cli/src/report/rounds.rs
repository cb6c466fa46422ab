//! Interleaved measurements: all participants take turns, round after round, so that a slow machine slows all of them.

use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use drystone::Result;
use drystone::stats::quantile;

/// Lets each of `participants` take its turn, in each of `rounds` rounds; the turn is told the number of its round.
pub fn interleave<T>(
    rounds: usize,
    participants: &mut [T],
    mut turn: impl FnMut(usize, &mut T) -> Result<()>,
) -> Result<()> {
    (0..rounds).try_for_each(|round| participants.iter_mut().try_for_each(|participant| turn(round, participant)))
}

/// Lower quartile, median and upper quartile of what the turns of a participant gave.
pub fn quartiles(turns: &[f64]) -> [f64; 3] {
    [0.25, 0.5, 0.75].map(|q| quantile(turns, q))
}

/// Processor time of this process where one thread does everything, so that what else the machine does counts less; wall time
/// where there are several, and where a GPU is waited for.
pub struct Clock {
    processor: bool,
    start: Instant,
}

impl Clock {
    /// For work on a backend of this name, in the pool as it is.
    pub fn of(backend: &str) -> Self {
        Self { processor: backend != "gpu" && rayon::current_num_threads() == 1, start: Instant::now() }
    }

    /// `processor` or `wall`.
    pub fn name(&self) -> &'static str {
        if self.processor { "processor" } else { "wall" }
    }

    /// Since some moment.
    pub fn now(&self) -> Duration {
        if self.processor { ProcessTime::now().as_duration() } else { self.start.elapsed() }
    }
}
