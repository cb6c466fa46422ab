//! Interleaved measurements: all participants take turns, so that a slow phase of the machine affects all of them.

use std::ops::Range;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use drystone::Result;
use drystone::stats::quantile;

/// Gives each participant one turn in each round; `turn` gets the number of the round.
pub fn interleave<T>(
    rounds: usize,
    participants: &mut [T],
    mut turn: impl FnMut(usize, &mut T) -> Result<()>,
) -> Result<()> {
    (0..rounds).try_for_each(|round| participants.iter_mut().try_for_each(|participant| turn(round, participant)))
}

/// The thirds of a run, as ranges of turns.
pub fn thirds(turns: usize) -> [Range<usize>; 3] {
    std::array::from_fn(|k| k * turns / 3..(k + 1) * turns / 3)
}

/// Lower quartile, median and upper quartile of the measurements of the turns.
pub fn quartiles(turns: &[f64]) -> [f64; 3] {
    [0.25, 0.5, 0.75].map(|q| quantile(turns, q))
}

/// Processor time of this process for one thread, which depends less on other processes; wall time for several threads
/// and the GPU.
pub struct Clock {
    processor: bool,
    start: Instant,
}

impl Clock {
    /// The clock for a backend of this name in the current pool of threads.
    pub fn of(backend: &str) -> Self {
        Self { processor: backend != "gpu" && rayon::current_num_threads() == 1, start: Instant::now() }
    }

    pub fn name(&self) -> &'static str {
        if self.processor { "processor" } else { "wall" }
    }

    /// Time since a fixed moment.
    pub fn now(&self) -> Duration {
        if self.processor { ProcessTime::now().as_duration() } else { self.start.elapsed() }
    }
}
