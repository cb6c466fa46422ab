//! Times and counts of one step, as data.

use std::time::Duration;
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
use std::time::Instant;
#[cfg(all(target_family = "wasm", target_os = "unknown", feature = "gpu"))]
use web_time::Instant;

/// Times and counts of one step.
///
/// ```
/// use drystone::{Reference, Scene, Simulation, SolverConfig, StepStats};
///
/// let scene = Scene::find("tower", &[])?;
/// let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// let stats: StepStats = simulation.step(scene.dt)?;
/// assert_eq!((stats.manifolds, stats.points, stats.asleep, stats.first_non_finite), (10, 40, 0, None));
/// assert!(stats.colors >= 2 && stats.overflow == 0);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct StepStats {
    /// Wall time of each stage.
    pub times: StageTimes,
    /// Pairs of colliders whose boxes overlap.
    pub pairs: usize,
    /// Pairs whose manifolds were computed; the others were reused.
    pub computed: usize,
    /// Manifolds.
    pub manifolds: usize,
    /// Contact points.
    pub points: usize,
    /// Colors, the single ones of the overflow included.
    pub colors: usize,
    /// Manifolds that found no color and were swept alone.
    pub overflow: usize,
    /// Bodies that sleep.
    pub asleep: usize,
    /// Bodies that are awake and can be pushed, by the class of effort of their island: in class c an island takes 2^c times the
    /// substeps of the settings.
    pub efforts: [u32; EFFORT_CLASSES],
    /// The contact that asks for most substeps.
    pub hardest: Option<HardestContact>,
    /// Joints.
    pub joints: usize,
    /// Those of them that are solved at once and not swept.
    pub direct_joints: usize,
    /// Largest gap that sweeps would leave in a joint at rest, as a share of its arms. Above `max_joint_gap_share` of the settings, nets take more
    /// substeps.
    pub swept_joint_gap: f32,
    /// Energy that the step took from bodies because constraints had made it (J).
    pub energy_taken: f64,
    /// Islands whose step would have made more energy than they have: they stood still, and take shorter substeps from the next step on.
    pub refused: usize,
    /// Sweeps that were done, where the settings have a tolerance; else 0.
    pub sweeps: u32,
    /// Sweeps that the plan held, where the settings have a tolerance; else 0.
    pub planned_sweeps: u32,
    /// Passes of the plan: dispatches, where a device does not follow all of it in one (`traffic`).
    pub dispatches: usize,
    /// Bytes that the kernels of the plan read and write.
    pub bytes_moved: u64,
    /// Bytes sent to a device and read back.
    pub traffic: Traffic,
    /// How long a device was at each kernel, where it has a clock.
    pub kernels: Vec<KernelTime>,
    /// The first body whose pose or velocity the step made not finite, if any: it touches nothing from then on, and no step is
    /// refused for it.
    pub first_non_finite: Option<usize>,
    /// One line where a device was lost in this step: the reason, and the backend that repeated the step and goes on.
    pub fault: Option<String>,
}

/// Number of classes of effort: 4096 substeps are the most that the settings take.
pub const EFFORT_CLASSES: usize = 13;

/// The contact that asks for most substeps.
///
/// ```
/// # use drystone::{Reference, Scene, Simulation, SolverConfig};
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// # let mut stats = simulation.step(scene.dt)?;
/// # for _ in 0..10 {
/// #     stats = simulation.step(scene.dt)?;
/// # }
/// // A tower whose top is a thousand times as heavy: the substeps of the settings would not do.
/// let hardest: drystone::stats::HardestContact = stats.hardest.expect("a load");
/// assert!(hardest.need > 1.0 && simulation.substeps_of(10) > simulation.config().substeps);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct HardestContact {
    /// Its bodies that can be pushed; one only if the other cannot.
    pub bodies: [Option<usize>; 2],
    /// How deep it would sag with the substeps of the settings under what it bears for long, over the sag that the settings promise. An
    /// island of need n takes at least the square root of n times these substeps.
    pub need: f32,
}

/// Time that a device spent at one kernel in one step.
///
/// ```
/// # use drystone::{Reference, Scene, Simulation, SolverConfig};
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// # let mut stats = simulation.step(scene.dt)?;
/// # for _ in 0..10 {
/// #     stats = simulation.step(scene.dt)?;
/// # }
/// // Kernels are timed by the clock of a device: see `Backend::time_kernels`.
/// let times: &[drystone::stats::KernelTime] = &stats.kernels;
/// assert!(times.is_empty());
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct KernelTime {
    /// Its name.
    pub kernel: &'static str,
    /// All its passes together.
    pub time: Duration,
    /// Bytes that they read and write; 0 for those that are not of the plan.
    pub bytes: u64,
}

/// The bytes and dispatches of a step between the processor and a device.
///
/// ```
/// # use drystone::{Reference, Scene, Simulation, SolverConfig};
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// # let mut stats = simulation.step(scene.dt)?;
/// # for _ in 0..10 {
/// #     stats = simulation.step(scene.dt)?;
/// # }
/// // The reference has no device.
/// assert_eq!(stats.traffic, drystone::stats::Traffic::default());
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Traffic {
    /// Bytes sent to the device.
    pub up: u64,
    /// Bytes read back.
    pub down: u64,
    /// Dispatches, those included that bring rows to their places; 0 without a device.
    pub dispatches: usize,
    /// Submissions: several where one would hold the device for long.
    pub submissions: usize,
    /// Longest that one of them took, as the host saw it.
    pub longest_submission: Duration,
}

/// Wall time of each stage of a step; zero in a browser, whose WebAssembly has no clock.
///
/// ```
/// # use drystone::{Reference, Scene, Simulation, SolverConfig};
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// # let mut stats = simulation.step(scene.dt)?;
/// # for _ in 0..10 {
/// #     stats = simulation.step(scene.dt)?;
/// # }
/// let times: drystone::stats::StageTimes = stats.times;
/// assert_eq!(times.stages().map(|stage| stage.0), ["detect", "color", "prepare", "run", "store"]);
/// assert_eq!(times.total(), times.stages().iter().map(|stage| stage.1).sum());
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct StageTimes {
    /// Finding contacts.
    pub detect: Duration,
    /// Coloring them.
    pub color: Duration,
    /// Writing the rows.
    pub prepare: Duration,
    /// Sweeping, transfers included.
    pub run: Duration,
    /// Reading the rows back into the world.
    pub store: Duration,
}

impl StageTimes {
    /// Name and time of each stage, in order.
    pub fn stages(&self) -> [(&'static str, Duration); 5] {
        [
            ("detect", self.detect),
            ("color", self.color),
            ("prepare", self.prepare),
            ("run", self.run),
            ("store", self.store),
        ]
    }

    /// All stages together.
    pub fn total(&self) -> Duration {
        self.stages().iter().map(|s| s.1).sum()
    }
}

/// Takes the time since it was started.
#[derive(Clone, Copy)]
pub(crate) struct Stopwatch {
    start: Instant,
}

/// WebAssembly has no clock of its own, and the clock of a page comes with the feature `gpu`. Without the feature no time passes.
#[cfg(all(target_family = "wasm", target_os = "unknown", not(feature = "gpu")))]
#[derive(Clone, Copy)]
struct Instant;

#[cfg(all(target_family = "wasm", target_os = "unknown", not(feature = "gpu")))]
impl Instant {
    fn now() -> Self {
        Self
    }

    fn elapsed(&self) -> Duration {
        Duration::ZERO
    }
}

impl Stopwatch {
    pub fn start() -> Self {
        Self { start: Instant::now() }
    }

    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Runs `f` and adds how long it took to `time`.
pub(crate) fn timed<T>(time: &mut Duration, f: impl FnOnce() -> T) -> T {
    let start = Stopwatch::start();
    let result = f();
    *time += start.elapsed();
    result
}

/// The largest of `from` and some numbers; NaN if any of these is, so that it spoils a check instead of passing unseen.
///
/// ```
/// use drystone::stats::largest;
///
/// assert_eq!(largest(0.0, [1.0, 3.0, 2.0]), 3.0);
/// assert!(largest(0.0, [1.0, f64::NAN]).is_nan());
/// ```
pub fn largest(from: f64, values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(from, |x, y| if y > x || y.is_nan() { y } else { x })
}

/// The middle of some numbers, the mean of the two middle ones if they are even in number; NaN for none.
///
/// ```
/// assert_eq!(drystone::stats::median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
/// ```
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The number that a share `q` of some numbers does not exceed, linear between neighbors; NaN for none.
///
/// ```
/// assert_eq!(drystone::stats::quantile(&[1.0, 2.0, 3.0], 0.75), 2.5);
/// ```
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = q * last as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    low + (high - low) * (place - place.floor())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_the_numbers() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(quantile(&[1.0, 2.0, 3.0], 1.0), 3.0);
        assert!(median(&[]).is_nan() && median(&[1.0, f64::NAN]).is_nan());
    }
}
