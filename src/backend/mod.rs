//! Backends follow a plan over a problem, in place. Only [`gpu`] knows wgpu.

mod choose;
pub mod cpu;
pub mod gpu;

pub use choose::{AUTO_GPU_BODIES, BackendChoice, choose};

use crate::error::Result;
use crate::plan::Pass;
use crate::problem::StepProblem;

/// Something that can run the passes of a plan.
pub trait Backend: Send {
    /// `reference`, `cpu` or `gpu`.
    fn name(&self) -> &'static str;

    /// What it runs on, for people.
    fn adapter(&self) -> String;

    /// Runs the passes in order; `bodies` and `impulses` of the problem are what they leave behind. What accelerated sweeps
    /// leave for each other is kept: the next run may go on with more sweeps of the same problem.
    ///
    /// # Errors
    /// The problem does not fit the device, or the device is lost.
    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()>;

    /// Bytes that one run of `problem` sends to the device and reads back.
    fn bytes_transferred(&self, _problem: &StepProblem) -> u64 {
        0
    }
}
