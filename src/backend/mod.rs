//! Backends run a plan over a problem, in place. Only the module `gpu` of the feature `gpu` uses wgpu.

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

/// The future of work on a device. If the future of a run is dropped before it completes, the problem stays unchanged.
pub type Running<'a, T = Result<()>> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// An implementation that can run the passes of a plan.
///
/// ```
/// use drystone::{Backend, Simulation};
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &["n=3".into()])?;
/// let mut simulation = Simulation::new(scene.world)?;
/// let (mut problem, plan) = simulation.next_problem(scene.dt)?;
/// let mut backend: Box<dyn Backend> = Box::new(drystone::Cpu::new());
/// assert!(!backend.adapter().is_empty() && !backend.keeps_rows() && backend.time_kernels()?.is_none());
/// assert!(backend.successor().is_none());
/// assert_eq!(backend.name(), "cpu");
/// backend.run(&mut problem, &plan.passes)?;
/// simulation.step(scene.dt)?;
/// assert_eq!(problem.bodies, simulation.problem().bodies);
/// assert_eq!((backend.traffic().up, backend.kernel_times().len()), (0, 0));
///
/// // The same for a web page: other tasks continue meanwhile.
/// use drystone::stages::{backend::CheckedStep, problem::Carry};
/// let mut repeated = problem.clone();
/// pollster::block_on(backend.run_async(CheckedStep::new(&mut repeated, &plan.passes)?))?;
/// pollster::block_on(backend.step_async(CheckedStep::new(&mut problem, &plan.passes)?, &Carry::default()))?;
/// assert_eq!(problem.bodies, repeated.bodies);
/// assert!(pollster::block_on(backend.successor_async()).is_none());
/// # Ok::<(), drystone::Error>(())
/// ```
pub trait Backend: Send + Sync {
    /// One of `reference`, `cpu` and `gpu`.
    fn name(&self) -> &'static str;

    /// The name of the device or processor, for messages.
    fn adapter(&self) -> String;

    /// Runs the passes in order. They write `bodies` and `impulses` of the problem. Accelerated sweeps keep their
    /// state: the next run can continue with more sweeps of the same problem.
    ///
    /// # Errors
    /// [`CheckedStep::new`] refuses the problem or the passes, the problem does not fit the device, or the device is
    /// lost.
    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()> {
        self.run_checked(CheckedStep::new(problem, passes)?)
    }

    /// Like [`Self::run`], for a step that was already checked.
    ///
    /// # Errors
    /// The problem does not fit the device, or the device is lost.
    fn run_checked(&mut self, step: CheckedStep) -> Result<()>;

    /// Runs the passes of a step that follows the previous one; `carry` describes the change. A backend with its own
    /// device keeps the rows there, sends changed rows and reads results back. The problem is complete before and after
    /// the step. A failed step leaves it unchanged, so that another backend can repeat the step.
    ///
    /// # Errors
    /// Those of [`Self::run_checked`].
    fn step(&mut self, step: CheckedStep, _carry: &Carry) -> Result<()> {
        self.run_checked(step)
    }

    /// Like [`Self::run_checked`], for a web page: with its own device, a backend lets other tasks continue while the
    /// device works.
    fn run_async<'a>(&'a mut self, step: CheckedStep<'a>) -> Running<'a> {
        Box::pin(std::future::ready(self.run_checked(step)))
    }

    /// Like [`Self::step`], for a web page.
    fn step_async<'a>(&'a mut self, step: CheckedStep<'a>, carry: &'a Carry) -> Running<'a> {
        Box::pin(std::future::ready(self.step(step, carry)))
    }

    /// Whether the rows of the last step are on a device, so that the next step can continue from them.
    fn keeps_rows(&self) -> bool {
        false
    }

    /// The backend that continues after this one lost its device ([`Error::Lost`](crate::Error::Lost)), or `None`.
    fn successor(&mut self) -> Option<Box<dyn Backend>> {
        None
    }

    /// Like [`Self::successor`], for a web page.
    fn successor_async(&mut self) -> Running<'_, Option<Box<dyn Backend>>> {
        Box::pin(std::future::ready(self.successor()))
    }

    /// The number of bytes that the last step moved to a device and back.
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    /// Makes the device measure the time of each kernel from now on, if it has a clock. Measuring can itself cost time.
    /// Returns the copy bandwidth of the device for comparison (bytes read and written per second), or `None` without a
    /// clock.
    ///
    /// # Errors
    /// The device is lost.
    fn time_kernels(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }

    /// The time of each kernel in the last step, if the device measured it.
    fn kernel_times(&self) -> &[KernelTime] {
        &[]
    }
}
