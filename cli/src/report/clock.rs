//! What times of reports are measured by.

use std::time::{Duration, Instant};

use cpu_time::ProcessTime;

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
