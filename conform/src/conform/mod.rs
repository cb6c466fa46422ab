//! Conformance tests of an adapter and its driver: kernels on random problems, scenes, limits, long plans, and lost
//! devices.
//!
//! ```no_run
//! use drystone_conform::{Check, ConformOptions, Conformance, Group, Mode, Verdict, conform};
//!
//! assert_eq!(Group::ALL.len(), 5);
//! let options = ConformOptions { modes: vec![Mode::Exact], short: true, ..ConformOptions::default() };
//! let mut each = |check: &Check| println!("{} {}: {}", check.verdict, check.name, check.figure);
//! let found: Conformance = conform(&options, &mut each)?;
//! assert_eq!(found.count(Verdict::Failed), 0, "{} is not fit", found.adapter);
//! # Ok::<(), drystone::Error>(())
//! ```

mod device;
pub mod difference;
mod kernels;
pub mod passes;
pub mod random;
mod scenes;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::pin;
use std::task::Poll;

use drystone::Gpu;
use drystone::backend::gpu::{AdapterSummary, GpuOptions};
use drystone::stages::backend::block_on;
use drystone::stages::error::text_of;
use drystone::{Backend, Error, Result, named};
use web_time::Instant;

/// Largest difference of a number after one kernel of plain WGSL, relative to 1 plus its size
/// ([`difference::largest`]). Over 24 seeds on software Vulkan, the largest measured value is 3.9e-6 for a sweep of
/// joints; this is five times that. An impulse of 0.1 with an error of one percent gives 9e-4.
pub const PLAIN_PASS: f64 = 2e-5;

/// Largest difference of a velocity (m/s) or angular velocity (rad/s) after one step of plain WGSL, the median over
/// some steps. On software Vulkan, the largest measured value is 1.3e-6 during the fall of a pile; this is eight times
/// that. A step without one sweep of one color gives 2.4e-2.
pub const PLAIN_STEP: f64 = 1e-5;

/// The subject of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum Group {
    /// Every kernel on random problems, against its Rust twin.
    Kernels,
    /// Every scene of the catalogue, in a small and short version, against the reference.
    Scenes,
    /// Large buffers, and problems beyond the limits of buffers and memory.
    Limits,
    /// Plans that would hold the device for a long time.
    LongDispatch,
    /// Devices that are lost between or during steps.
    DeviceLost,
}

named!(Group {
    Kernels = "kernels",
    Scenes = "scenes",
    Limits = "limits",
    LongDispatch = "long-dispatch",
    DeviceLost = "device-lost",
});

/// The form in which the driver gets shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Mode {
    /// SPIR-V or WGSL with arithmetic that no driver can change ([`GpuOptions::exact`]): results equal the reference to
    /// the last bit.
    Exact,
    /// Plain WGSL: results are near the reference.
    Plain,
}

named!(Mode { Exact = "exact", Plain = "plain", });

/// The result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Verdict {
    /// The adapter works correctly.
    Passed,
    /// The adapter does not work correctly.
    Failed,
}

named!(Verdict { Passed = "passed", Failed = "failed", });

/// A check and its verdict.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Check {
    /// The subject of the check.
    pub group: Group,
    /// The form of the shaders.
    pub mode: Mode,
    /// Name of the kernel or scene, or the requirement on the device.
    pub name: String,
    /// The result.
    pub verdict: Verdict,
    /// The measurement, or the reason of a failure, in one line.
    pub figure: String,
    /// Duration of the check (s).
    pub seconds: f64,
}

/// Selects the checks.
#[derive(Clone, Debug)]
pub struct ConformOptions {
    /// The adapter, and injected faults. Each check sets `exact` and other options as it needs.
    pub gpu: GpuOptions,
    /// The forms of shaders to check.
    pub modes: Vec<Mode>,
    /// The subjects to check.
    pub groups: Vec<Group>,
    /// Runs only checks whose name contains one of these; all checks if the list is empty.
    pub names: Vec<String>,
    /// Uses fewer variants of kernels, fewer steps of scenes, and smaller buffers.
    pub short: bool,
}

impl Default for ConformOptions {
    fn default() -> Self {
        let (modes, groups) = (Mode::ALL.to_vec(), Group::ALL.to_vec());
        Self { gpu: GpuOptions::default(), modes, groups, names: Vec::new(), short: false }
    }
}

/// All checks of an adapter.
#[derive(Clone, Debug)]
pub struct Conformance {
    /// The adapter.
    pub adapter: AdapterSummary,
    /// The checks, in the order in which they ran.
    pub checks: Vec<Check>,
}

impl Conformance {
    /// Number of checks with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.checks.iter().filter(|check| check.verdict == verdict).count()
    }
}

/// Runs the checks that `options` select, and calls `each` after each check.
///
/// # Errors
/// There is no such adapter, or it cannot be opened.
pub fn conform(options: &ConformOptions, each: &mut dyn FnMut(&Check)) -> Result<Conformance> {
    block_on(conform_async(options, each))
}

/// Like [`conform`], for a web page: other tasks continue while the device works.
///
/// ```no_run
/// use drystone_conform::{ConformOptions, Conformance, conform_async};
///
/// # async fn page() -> drystone::Result<()> {
/// let found: Conformance = conform_async(&ConformOptions::default(), &mut |check| println!("{}", check.figure)).await?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Those of [`conform`].
pub async fn conform_async(options: &ConformOptions, each: &mut dyn FnMut(&Check)) -> Result<Conformance> {
    let adapter = Gpu::open_async(options.gpu.clone()).await?.summary().clone();
    let mut run = Run { options, mode: Mode::Plain, gpu: None, checks: Vec::new(), each };
    for &mode in &options.modes {
        run.mode = mode;
        run.gpu = None;
        for &group in &options.groups {
            match group {
                Group::Kernels => kernels::check(&mut run).await,
                Group::Scenes => scenes::check(&mut run).await,
                Group::Limits => device::check_limits(&mut run).await,
                Group::LongDispatch => device::check_long_plans(&mut run).await,
                Group::DeviceLost => device::check_losses(&mut run).await,
            }
        }
    }
    Ok(Conformance { adapter, checks: run.checks })
}

/// An injected fault ([`Faults::shader`](drystone::backend::gpu::Faults::shader)): accelerations, and the impulses that
/// contacts apply, are one percent off. Checks of every group find it.
///
/// ```no_run
/// use drystone_conform::{ConformOptions, Verdict, conform, one_percent_off};
///
/// let mut options = ConformOptions { short: true, ..ConformOptions::default() };
/// options.gpu.faults.shader = Some(one_percent_off);
/// assert!(conform(&options, &mut |_| ())?.count(Verdict::Failed) > 0);
/// # Ok::<(), drystone::Error>(())
/// ```
pub fn one_percent_off(_: &str, source: String) -> String {
    let source = source
        .replace("masses[i].acceleration * pass_row.substep", "masses[i].acceleration * (1.01 * pass_row.substep)");
    source.replace("point.r_b, contact.normal * change)", "point.r_b, contact.normal * (1.01 * change))")
}

/// The reason of a failure.
struct Failure(String);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(error.to_string())
    }
}

/// The measurement of a check, or its failure.
type Outcome = std::result::Result<String, Failure>;

/// A [`Failure`] with a text, like `format!`.
macro_rules! failed {
    ($($text:tt)*) => { Err($crate::conform::Failure(format!($($text)*))) };
}
use failed;

/// The result of a future, or its panic.
async fn caught<T>(future: impl Future<Output = T>) -> std::thread::Result<T> {
    let mut future = pin!(future);
    std::future::poll_fn(|context| match catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context))) {
        Ok(polled) => polled.map(Ok),
        Err(panic) => Poll::Ready(Err(panic)),
    })
    .await
}

/// The completed checks, and the device of the present mode.
struct Run<'a> {
    options: &'a ConformOptions,
    mode: Mode,
    /// A device that already compiled some kernels; `None` before the first check and after a failed one.
    gpu: Option<Box<dyn Backend>>,
    checks: Vec<Check>,
    each: &'a mut dyn FnMut(&Check),
}

impl Run<'_> {
    fn is_exact(&self) -> bool {
        self.mode == Mode::Exact
    }

    /// The options of a device of the present mode.
    fn gpu_options(&self) -> GpuOptions {
        GpuOptions { exact: self.is_exact(), ..self.options.gpu.clone() }
    }

    /// Takes the device of the present mode. A check returns it with [`Run::give_back`].
    async fn take_gpu(&mut self) -> Result<Box<dyn Backend>> {
        match self.gpu.take() {
            Some(gpu) => Ok(gpu),
            None => Ok(Box::new(Gpu::open_async(self.gpu_options()).await?)),
        }
    }

    fn give_back(&mut self, gpu: Box<dyn Backend>) {
        self.gpu = Some(gpu);
    }

    /// Runs a check and records its verdict. A panic in a driver's layer counts as a failed check.
    async fn check(&mut self, group: Group, name: &str, body: impl AsyncFnOnce(&mut Self) -> Outcome) {
        let names = &self.options.names;
        if !(names.is_empty() || names.iter().any(|part| name.contains(part.as_str()))) {
            return;
        }
        let start = Instant::now();
        let outcome = caught(body(self)).await;
        let (verdict, figure) = match outcome {
            Ok(Ok(figure)) => (Verdict::Passed, figure),
            Ok(Err(Failure(why))) => (Verdict::Failed, why),
            Err(panic) => (Verdict::Failed, format!("a panic: {}", text_of(&*panic).unwrap_or("without a message"))),
        };
        let figure = figure.split_whitespace().collect::<Vec<_>>().join(" ");
        let seconds = start.elapsed().as_secs_f64();
        self.checks.push(Check { group, mode: self.mode, name: name.into(), verdict, figure, seconds });
        (self.each)(&self.checks[self.checks.len() - 1]);
    }
}
