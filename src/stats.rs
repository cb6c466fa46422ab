//! Times and counts of one step, as data.

use std::time::Duration;
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
use std::time::Instant;
#[cfg(all(target_family = "wasm", target_os = "unknown", feature = "gpu"))]
use web_time::Instant;

use crate::world::BodyHandle;

/// Times and counts of one step.
///
/// ```
/// use drystone::{Simulation, StepStats};
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &[])?;
/// let mut simulation = Simulation::new(scene.world)?;
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
    /// Number of pairs of colliders whose boxes overlap.
    pub pairs: usize,
    /// Number of pairs whose manifolds were computed; the others were reused.
    pub computed: usize,
    /// Number of manifolds.
    pub manifolds: usize,
    /// Number of contact points.
    pub points: usize,
    /// Number of colors, including the single ones of the overflow.
    pub colors: usize,
    /// Number of manifolds without a color, which are solved alone.
    pub overflow: usize,
    /// Number of sleeping bodies.
    pub asleep: usize,
    /// Number of awake dynamic bodies by the substep level of their island: at level c an island takes 2^c times the
    /// substeps of the settings.
    pub efforts: [u32; EFFORT_CLASSES],
    /// The contact that needs the most substeps.
    pub hardest: Option<HardestContact>,
    /// Number of joints.
    pub joints: usize,
    /// Number of joints in direct joint systems, which are not swept.
    pub direct_joints: usize,
    /// Largest gap that sweeps would leave in a joint at rest, relative to its arms. Above `max_joint_gap_share` of the
    /// settings, nets take more substeps.
    pub swept_joint_gap: f32,
    /// Energy that the step removed from bodies because constraints had added it (J).
    pub energy_taken: f64,
    /// Number of islands whose step would have added more energy than they have. They moved as one rigid body, or stood
    /// still if something held them, and take shorter substeps from the next step on.
    pub refused: usize,
    /// How often the step was taken again with other substeps, because joints opened beyond the promised gap.
    pub repeats: u32,
    /// Number of completed sweeps if the settings have a tolerance, else 0.
    pub sweeps: u32,
    /// Number of sweeps in the plan if the settings have a tolerance, else 0.
    pub planned_sweeps: u32,
    /// Number of passes in the plan. They are dispatches, unless a device runs the whole plan in one (`traffic`).
    pub dispatches: usize,
    /// Bytes that the kernels of the plan read and write.
    pub bytes_moved: u64,
    /// Bytes sent to a device and read back.
    pub traffic: Traffic,
    /// Time of a device at each kernel, if it has a clock.
    pub kernels: Vec<KernelTime>,
    /// The first body whose pose or velocity became not finite in the step, or `None`. The body touches nothing from
    /// then on, and later steps do not fail because of it.
    pub first_non_finite: Option<BodyHandle>,
    /// One line if a device was lost in this step: the reason, and the backend that repeated the step and continues.
    pub fault: Option<String>,
}

/// Number of substep levels: the settings allow at most 4096 substeps.
pub const EFFORT_CLASSES: usize = 13;

/// The contact that needs the most substeps.
///
/// ```
/// # use drystone::Simulation;
/// # use drystone_scenes::Scene;
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world)?;
/// # let mut stats = simulation.step(scene.dt)?;
/// # for _ in 0..10 {
/// #     stats = simulation.step(scene.dt)?;
/// # }
/// // A tower with a top that is a thousand times as heavy: the substeps of the settings are not sufficient.
/// let top = simulation.world.bodies.handles().last().expect("the top");
/// let hardest: drystone::stats::HardestContact = stats.hardest.expect("a load");
/// assert!(hardest.need > 1.0 && simulation.substeps_of(top) > simulation.config().substeps);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct HardestContact {
    /// Its dynamic bodies; only one if the other body is not dynamic. serde writes their indices.
    pub bodies: [Option<BodyHandle>; 2],
    /// Static compression of the contact under its sustained load with the substeps of the settings, divided by the
    /// compression that the settings promise. An island with need n takes at least the square root of n times these
    /// substeps.
    pub need: f32,
}

/// Time of a device at one kernel in one step.
///
/// ```
/// # use drystone::Simulation;
/// # use drystone_scenes::Scene;
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world)?;
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
    /// Name of the kernel.
    pub kernel: &'static str,
    /// Total time of all its passes.
    pub time: Duration,
    /// Bytes that the passes read and write; 0 for kernels outside the plan.
    pub bytes: u64,
}

/// The bytes and dispatches of a step between the processor and a device.
///
/// ```
/// # use drystone::Simulation;
/// # use drystone_scenes::Scene;
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world)?;
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
    /// Number of dispatches, including those that move rows to their places; 0 without a device.
    pub dispatches: usize,
    /// Number of submissions: more than one if a single one would hold the device too long.
    pub submissions: usize,
    /// The longest time of a submission, measured by the host.
    pub longest_submission: Duration,
}

/// Wall time of each stage of a step. It is zero in a browser, because WebAssembly has no clock.
///
/// ```
/// # use drystone::Simulation;
/// # use drystone_scenes::Scene;
/// # let scene = Scene::find("tower", &["top_ratio=1000".into()])?;
/// # let mut simulation = Simulation::new(scene.world)?;
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
    /// Coloring contacts.
    pub color: Duration,
    /// Writing the rows.
    pub prepare: Duration,
    /// Sweeping, including transfers.
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

    /// Total time of all stages.
    pub fn total(&self) -> Duration {
        self.stages().iter().map(|s| s.1).sum()
    }
}

/// Measures the time since its start.
#[derive(Clone, Copy)]
pub(crate) struct Stopwatch {
    start: Instant,
}

/// WebAssembly has no clock of its own, and the browser's clock comes with the feature `gpu`. Without the feature the
/// time is always zero.
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

/// Runs `f` and adds its duration to `time`.
pub(crate) fn timed<T>(time: &mut Duration, f: impl FnOnce() -> T) -> T {
    let start = Stopwatch::start();
    let result = f();
    *time += start.elapsed();
    result
}

/// The largest of `from` and some numbers. It is NaN if any of them is NaN, so that a check fails instead of ignoring
/// it.
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

/// The median of some numbers: the mean of the two middle ones if their count is even, and NaN for an empty list.
///
/// ```
/// assert_eq!(drystone::stats::median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
/// ```
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The quantile `q` of some numbers, linear between neighbors; NaN for an empty list.
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
