//! Backends follow a plan over a problem, in place. Only the module `gpu` of the feature `gpu` knows wgpu.

pub(crate) mod calibrate;
pub(crate) mod checked;
mod choose;
pub mod cpu;
#[cfg(feature = "gpu")]
pub mod gpu;

pub(crate) use checked::CheckedStep;
pub use choose::{BackendChoice, BackendKind, choose};

use std::pin::Pin;

use crate::error::Result;
use crate::plan::Pass;
use crate::problem::StepProblem;
use crate::problem::carry::Carry;
use crate::stats::{KernelTime, Traffic};

/// Work of a device that goes on while its future is awaited. A run whose future is dropped before its end leaves the problem as it was.
pub type Running<'a, T = Result<()>> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// Something that can run the passes of a plan.
///
/// ```
/// use drystone::{Backend, Reference, Scene, Simulation, SolverConfig};
///
/// let scene = Scene::find("tower", &["n=3".into()])?;
/// let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// let (mut problem, plan) = simulation.next_problem(scene.dt)?;
/// let mut backend: Box<dyn Backend> = Box::new(drystone::Cpu::new());
/// assert!(!backend.adapter().is_empty() && !backend.keeps_rows() && backend.time_kernels()?.is_none());
/// assert!(backend.successor().is_none());
/// assert_eq!(backend.name(), "cpu");
/// backend.run(&mut problem, &plan.passes)?;
/// simulation.step(scene.dt)?;
/// assert_eq!(problem.bodies, simulation.problem().bodies);
/// assert_eq!((backend.traffic().up, backend.kernel_times().len()), (0, 0));
/// # Ok::<(), drystone::Error>(())
/// ```
pub trait Backend: Send {
    /// `reference`, `cpu` or `gpu`.
    fn name(&self) -> &'static str;

    /// The name of the device or processor, for messages.
    fn adapter(&self) -> String;

    /// Runs the passes in order; the passes write `bodies` and `impulses` of the problem. The numbers that accelerated sweeps
    /// leave for each other stay: the next run may go on with more sweeps of the same problem.
    ///
    /// # Errors
    /// [`CheckedStep::new`] refuses the problem or the passes, the problem does not fit the device, or the device is lost.
    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()> {
        self.run_checked(CheckedStep::new(problem, passes)?)
    }

    /// As [`Self::run`], for what was checked before.
    ///
    /// # Errors
    /// The problem does not fit the device, or the device is lost.
    fn run_checked(&mut self, step: CheckedStep) -> Result<()>;

    /// Runs the passes of a step that follows on the one before as `carry` says. A backend with a device of its own keeps the
    /// rows there, sends what changed and brings back what moved. The problem is complete before the step and after it; a step that
    /// fails leaves it as it was, so that another backend can repeat the step.
    ///
    /// # Errors
    /// As of [`Self::run_checked`].
    fn step(&mut self, step: CheckedStep, _carry: &Carry) -> Result<()> {
        self.run_checked(step)
    }

    /// As [`Self::run_checked`], for a page: a backend with a device of its own lets other tasks go on while the device works.
    fn run_async<'a>(&'a mut self, step: CheckedStep<'a>) -> Running<'a> {
        Box::pin(std::future::ready(self.run_checked(step)))
    }

    /// As [`Self::step`], likewise.
    fn step_async<'a>(&'a mut self, step: CheckedStep<'a>, carry: &'a Carry) -> Running<'a> {
        Box::pin(std::future::ready(self.step(step, carry)))
    }

    /// Whether the rows of the last step are on a device, so that the next step can go on from them.
    fn keeps_rows(&self) -> bool {
        false
    }

    /// The backend that goes on after this one lost its device ([`Error::Lost`](crate::Error::Lost)); none if there is no such backend.
    fn successor(&mut self) -> Option<Box<dyn Backend>> {
        None
    }

    /// As [`Self::successor`], for a page.
    fn successor_async(&mut self) -> Running<'_, Option<Box<dyn Backend>>> {
        Box::pin(std::future::ready(self.successor()))
    }

    /// The bytes that the last step moved to a device and back.
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    /// Lets the device take the time of each kernel from now on, where it has a clock; that may cost time itself. Gives the
    /// bytes a second that the device reads and writes when it copies, to hold them against; none without a clock.
    ///
    /// # Errors
    /// The device is lost.
    fn time_kernels(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }

    /// How long the device was at each kernel in the last step, if it took the time.
    fn kernel_times(&self) -> &[KernelTime] {
        &[]
    }
}
