//! Submissions: their amount of work, their time on the device, and their errors.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::options::Loss;
use crate::error::{Error, Result};
use crate::stats::Stopwatch;

/// Number of rows in the first submission to a device of unknown speed: at most 100 MB, a tenth of a second at 1 GB/s.
const FIRST_ROWS: usize = 1 << 18;
/// A dispatch costs as much as a sweep over this number of rows.
pub(super) const ROWS_OF_A_DISPATCH: usize = 256;
/// A device that takes longer for a submission counts as lost. The work of a submission normally takes a tenth of a
/// second.
#[cfg(not(target_family = "wasm"))]
const LONGEST_WAIT: Duration = Duration::from_secs(120);

/// Errors that a device reported outside a call.
#[derive(Default)]
struct Reports {
    lost: Option<String>,
    error: Option<String>,
}

/// The queue of a device.
pub(super) struct Submissions {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    reports: Arc<Mutex<Reports>>,
    loss: Option<Loss>,
    count: u32,
    /// When the first part of the present submission went to the device.
    begun: Option<Stopwatch>,
    /// Target for the longest time of a submission on the device.
    target: Duration,
    /// Rows per second of the last submission.
    speed: Option<f64>,
    /// Number of submissions since the last query, and the time of the longest.
    taken: (usize, Duration),
}

impl Submissions {
    pub fn new(
        device: wgpu::Device,
        queue: wgpu::Queue,
        adapter: String,
        target: Duration,
        loss: Option<Loss>,
    ) -> Self {
        let reports = Arc::new(Mutex::new(Reports::default()));
        let (errors, losses) = (Arc::clone(&reports), Arc::clone(&reports));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            locked(&errors).error.get_or_insert(one_line(&error.to_string()));
        }));
        device.set_device_lost_callback(move |reason, message| {
            let reason = match reason {
                wgpu::DeviceLostReason::Destroyed => "destroyed".to_owned(),
                _ => one_line(&message),
            };
            locked(&losses).lost.get_or_insert(reason);
        });
        let taken = (0, Duration::ZERO);
        Self { device, queue, adapter, reports, loss, count: 0, begun: None, target, speed: None, taken }
    }

    /// Number of rows that one submission can sweep.
    pub fn room(&self) -> usize {
        self.speed.map_or(FIRST_ROWS, |speed| (speed * self.target.as_secs_f64()) as usize)
    }

    /// Sends work to the device. All work until the next [`Self::wait`] is one submission.
    pub fn submit(&mut self, encoder: wgpu::CommandEncoder) {
        if self.begun.is_none() {
            self.begun = Some(Stopwatch::start());
            self.count += 1;
        }
        self.queue.submit([encoder.finish()]);
        self.lose(true);
    }

    /// Ends a submission of work on `rows` rows: waits for the device. A web page continues with other tasks meanwhile;
    /// elsewhere this thread blocks.
    ///
    /// # Errors
    /// The device is lost, or it reported an error.
    pub async fn wait(&mut self, rows: usize) -> Result<()> {
        #[cfg(target_family = "wasm")]
        let waited = {
            let (done, is_done) = futures_channel::oneshot::channel();
            self.queue.on_submitted_work_done(move || {
                let _ = done.send(());
            });
            is_done.await
        };
        #[cfg(not(target_family = "wasm"))]
        let waited = {
            let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(LONGEST_WAIT) };
            self.device.poll(wait)
        };
        let time = self.begun.take().map_or(Duration::ZERO, |begun| begun.elapsed());
        if rows > 0 {
            self.speed = Some(rows as f64 / time.as_secs_f64().max(1e-6));
        }
        self.taken = (self.taken.0 + 1, self.taken.1.max(time));
        self.check()?;
        waited.map_err(|e| self.lost(e))?;
        self.lose(false);
        Ok(())
    }

    /// The first error that the device reported.
    pub fn check(&self) -> Result<()> {
        let mut reports = locked(&self.reports);
        let error = reports.error.take();
        if let Some(reason) = &reports.lost {
            return Err(self.lost(reason));
        }
        error.map_or(Ok(()), |message| Err(Error::Adapter(format!("{}: {message}", self.adapter))))
    }

    /// The error of a device that no longer answers.
    pub fn lost(&self, reason: impl std::fmt::Display) -> Error {
        Error::Lost(format!("{}: the device was lost ({reason})", self.adapter))
    }

    /// Returns and resets the number of submissions since the last call, and the time of the longest.
    pub fn take_taken(&mut self) -> (usize, Duration) {
        std::mem::take(&mut self.taken)
    }

    /// Destroys the device if a test requests it.
    fn lose(&mut self, during: bool) {
        if self.loss == Some(Loss { submission: self.count, during }) {
            self.device.destroy();
        }
    }
}

fn locked(reports: &Mutex<Reports>) -> std::sync::MutexGuard<'_, Reports> {
    reports.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A message of wgpu on one line.
pub(super) fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
