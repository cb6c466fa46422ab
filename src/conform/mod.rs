//! Whether an adapter and its driver are fit: kernels on random problems, scenes, limits, long plans, lost devices.
//!
//! ```no_run
//! use drystone::conform::{Check, Conformance, ConformOptions, Mode, Verdict, conform};
//!
//! let options = ConformOptions { modes: vec![Mode::Exact], short: true, ..ConformOptions::default() };
//! let mut each = |check: &Check| println!("{} {}: {}", check.verdict, check.name, check.figure);
//! let found: Conformance = conform(&options, &mut each)?;
//! assert_eq!(found.count(Verdict::Failed), 0, "{} is not fit", found.adapter);
//! # Ok::<(), drystone::Error>(())
//! ```

mod device;
pub(crate) mod difference;
mod kernels;
pub(crate) mod passes;
pub(crate) mod random;
mod scenes;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::pin;
use std::task::Poll;

use crate::backend::Backend;
use crate::backend::gpu::{AdapterSummary, Gpu, GpuOptions, block_on};
use crate::error::{Error, Result};
use crate::names::named;
use crate::panics::text_of;
use crate::stats::Stopwatch;

/// Largest difference of a number after one kernel of plain WGSL, relative to 1 plus its size ([`difference::largest`]). Measured over
/// 24 seeds on software Vulkan: 3.9e-6, a sweep of joints; five times that. An impulse of 0.1 that is one percent off: 9e-4.
pub const PLAIN_PASS: f64 = 2e-5;

/// One step of plain WGSL, in the middle one of some moments: largest difference of a velocity (m/s) or angular velocity (rad/s).
/// Measured on software Vulkan during the fall of a pile: up to 1.3e-6; eight times that. A step that lacks one sweep of one color:
/// 2.4e-2.
pub const PLAIN_STEP: f64 = 1e-5;

/// What a check is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum Group {
    /// Every kernel on random problems, against its double in Rust.
    Kernels,
    /// Every scene of the catalogue, small and short, against the reference.
    Scenes,
    /// Large buffers, and problems beyond the limits of buffers and memory.
    Limits,
    /// Plans that would hold the device for long.
    LongDispatch,
    /// Devices that are lost between and during steps.
    DeviceLost,
}

named!(Group {
    Kernels = "kernels",
    Scenes = "scenes",
    Limits = "limits",
    LongDispatch = "long-dispatch",
    DeviceLost = "device-lost",
});

/// How shaders reach the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Mode {
    /// SPIR-V or WGSL whose arithmetic no driver can change ([`GpuOptions::exact`]): results are the reference's to the last bit.
    Exact,
    /// Plain WGSL: results are near those of the reference.
    Plain,
}

named!(Mode { Exact = "exact", Plain = "plain", });

/// What became of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Verdict {
    /// The adapter does what it should.
    Passed,
    /// It does not.
    Failed,
}

named!(Verdict { Passed = "passed", Failed = "failed", });

/// A check and its verdict.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Check {
    /// What it is about.
    pub group: Group,
    /// How shaders reached the driver.
    pub mode: Mode,
    /// Kernel, scene, or what is asked of the device.
    pub name: String,
    /// What became of it.
    pub verdict: Verdict,
    /// What was measured, or why it failed: one line.
    pub figure: String,
    /// How long it took (s).
    pub seconds: f64,
}

/// What to check.
#[derive(Clone, Debug)]
pub struct ConformOptions {
    /// The adapter, and faults on purpose. Each check sets `exact` and what it needs itself.
    pub gpu: GpuOptions,
    /// How shaders reach the driver.
    pub modes: Vec<Mode>,
    /// What the checks are about.
    pub groups: Vec<Group>,
    /// Only checks whose name contains one of these; all if there are none.
    pub names: Vec<String>,
    /// Fewer variants of kernels, fewer steps of scenes, smaller buffers.
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
    /// How many checks have this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.checks.iter().filter(|check| check.verdict == verdict).count()
    }
}

/// Runs the checks that `options` name, and calls `each` after each.
///
/// # Errors
/// There is no such adapter, or it cannot be opened.
pub fn conform(options: &ConformOptions, each: &mut dyn FnMut(&Check)) -> Result<Conformance> {
    block_on(conform_async(options, each))
}

/// As [`conform`], for a page: other tasks go on while the device works.
///
/// ```no_run
/// use drystone::conform::{Conformance, ConformOptions, conform_async};
///
/// # async fn page() -> drystone::Result<()> {
/// let found: Conformance = conform_async(&ConformOptions::default(), &mut |check| println!("{}", check.figure)).await?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As of [`conform`].
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

/// A fault on purpose ([`Faults::shader`](crate::backend::gpu::Faults::shader)): accelerations, and the impulses that contacts apply, are one
/// percent off. Checks of every group find it.
///
/// ```no_run
/// use drystone::conform::{ConformOptions, Verdict, conform, one_percent_off};
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

/// Why a check failed, in words.
struct Failure(String);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(error.to_string())
    }
}

/// What a check measured, in words.
type Outcome = std::result::Result<String, Failure>;

/// A [`Failure`] with a text as of `format!`.
macro_rules! failed {
    ($($text:tt)*) => { Err($crate::conform::Failure(format!($($text)*))) };
}
use failed;

/// What a future gives, or its panic.
async fn caught<T>(future: impl Future<Output = T>) -> std::thread::Result<T> {
    let mut future = pin!(future);
    std::future::poll_fn(|context| match catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context))) {
        Ok(polled) => polled.map(Ok),
        Err(panic) => Poll::Ready(Err(panic)),
    })
    .await
}

/// The checks that ran so far, and the device of the present mode.
struct Run<'a> {
    options: &'a ConformOptions,
    mode: Mode,
    /// A device that compiled some kernels already; none before the first check and after one that failed.
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

    /// The device of the present mode. A check gives it back by [`Run::give_back`].
    async fn take_gpu(&mut self) -> Result<Box<dyn Backend>> {
        match self.gpu.take() {
            Some(gpu) => Ok(gpu),
            None => Ok(Box::new(Gpu::open_async(self.gpu_options()).await?)),
        }
    }

    fn give_back(&mut self, gpu: Box<dyn Backend>) {
        self.gpu = Some(gpu);
    }

    /// Runs a check and notes its verdict. A panic of a driver's layer is a check that failed.
    async fn check(&mut self, group: Group, name: &str, body: impl AsyncFnOnce(&mut Self) -> Outcome) {
        let names = &self.options.names;
        if !(names.is_empty() || names.iter().any(|part| name.contains(part.as_str()))) {
            return;
        }
        let start = Stopwatch::start();
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
