//! Report of one run, as rows and as JSON.

mod counted;
mod rows;

pub use counted::SensorCount;

use serde::Serialize;

use crate::hard::energy;
use drystone::metrics::{Penetration, fastest, half_height, rms_speed};
use drystone::stats::{HardestContact, KernelTime, median};
use drystone::{Backend, Body, BodyHandle, BodyKind, Simulation, SolverConfig, StepStats, World};
use drystone_scenes::Scene;
use glam::Vec3;

/// Bodies whose islands take the same number of substeps.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EffortRow {
    /// Number of substeps in a step.
    pub substeps: u32,
    /// Number of awake bodies that can be pushed.
    pub bodies: u32,
}

/// Report of one run; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport {
    pub scene: String,
    /// `reference`, `cpu` or `gpu`.
    pub backend: String,
    pub adapter: String,
    pub worlds: usize,
    pub bodies: usize,
    pub steps: u32,
    /// Length of a step (s).
    pub dt: f32,
    pub config: SolverConfig,
    /// Wall time of each step (ms).
    pub step_ms: Vec<f64>,
    /// Steps with an awake body; other steps do nothing.
    pub awake_steps: u32,
    /// Wall times over the awake steps (ms).
    pub awake_ms: Option<Spread>,
    pub stage_ms: Vec<StageRow>,
    /// Times by the clock of the device, if requested.
    pub kernel_ms: Vec<KernelRow>,
    /// Bytes per second that the device reads and writes in a copy (B/s), if requested.
    pub copy_bandwidth: Option<f64>,
    /// Manifolds and points at the end, including those of sleeping bodies.
    pub manifolds: usize,
    pub points: usize,
    /// Bodies by their substeps in the last step with an awake body.
    pub efforts: Vec<EffortRow>,
    /// Largest number of substeps that a body took in any step.
    pub most_substeps: u32,
    /// The contact that needed the most substeps in the last step with an awake body.
    pub hardest_contact: Option<HardestContact>,
    /// Numbers of bodies that came and left during the run; `None` if no body did.
    pub came: Option<u32>,
    pub left: Option<u32>,
    /// The counts of each sensor.
    pub sensors: Vec<SensorCount>,
    pub asleep: usize,
    /// The first step after which a body slept.
    pub first_asleep_step: Option<u32>,
    /// The step from which on all bodies sleep.
    pub all_asleep_step: Option<u32>,
    pub joints: usize,
    /// Largest distance between the anchors of a joint at the end (m); `None` without joints.
    pub joint_gap: Option<f64>,
    /// Completed and planned sweeps of all steps; `None` without a tolerance.
    pub sweeps: Option<u64>,
    pub planned_sweeps: Option<u64>,
    /// Number of colors in the last awake step. The values up to `bytes_down` are also of this step, except `overflow`.
    pub colors: usize,
    /// Largest number of manifolds without a color in a step. They are swept alone.
    pub overflow: usize,
    /// Share of the pairs that reused their manifolds.
    pub reused: f64,
    pub dispatches: usize,
    pub bytes_moved: u64,
    /// Bytes sent to the device, and read back.
    pub bytes_up: u64,
    pub bytes_down: u64,
    /// One line for each loss of a device: the step, the reason, and the backend that continued.
    pub faults: Vec<String>,
    /// Overlaps at the end (m): the deepest, the 95th percentile, and the mean.
    pub penetration_max: f64,
    pub penetration_p95: f64,
    pub penetration_mean: f64,
    /// Speed of the fastest body at the end (m/s), and the body; `None` if nothing moves.
    pub speed_max: f64,
    pub fastest: Option<String>,
    /// Root mean square speed at the end (m/s).
    pub speed_rms: f64,
    /// Kinetic energy at the end, and kinetic and potential energy gained since the start (J).
    pub kinetic_energy: f64,
    pub energy_gained: f64,
    /// Number of bodies outside the container at the end; `None` without a container.
    pub escaped: Option<usize>,
    /// Number of dynamic bodies whose center of mass moved by less than half of their height since the start.
    pub in_place: usize,
    pub standing: Vec<Standing>,
    /// [`Simulation::hash`] at the end, over the bodies of all worlds, in hexadecimal.
    pub hash: String,
    /// Number of bodies whose pose or velocity is not finite, and the first of them.
    pub non_finite: usize,
    pub first_non_finite: Option<String>,
    #[serde(skip)]
    awake_times: Vec<f64>,
    #[serde(skip)]
    stage_times: Vec<[f64; 5]>,
    #[serde(skip)]
    kernel_times: Vec<(KernelTime, Vec<f64>)>,
    #[serde(skip)]
    energy_before: f64,
    /// Center of mass (m), and half of the height (m) of each body at the start.
    #[serde(skip)]
    places: Vec<(Vec3, f64)>,
    #[serde(skip)]
    stands: bool,
    /// Number of dynamic bodies after the last step.
    #[serde(skip)]
    bodies_now: usize,
}

/// Number of dynamic bodies of a group, and of those in place.
#[derive(Clone, Debug, Serialize)]
pub struct Standing {
    pub group: String,
    pub bodies: usize,
    pub in_place: usize,
}

/// Median and least of some times (ms).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    pub median: f64,
    pub min: f64,
}

impl Spread {
    fn of(times: &[f64]) -> Option<Self> {
        let min = times.iter().copied().reduce(f64::min)?;
        Some(Self { median: median(times), min })
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} median, {:.3} least", self.median, self.min)
    }
}

/// Times of a kernel over the steps that ran it.
#[derive(Clone, Debug, Serialize)]
pub struct KernelRow {
    pub kernel: &'static str,
    #[serde(flatten)]
    pub ms: Spread,
    /// Bytes that the kernel read and wrote in its last step; 0 for kernels outside the plan.
    pub bytes: u64,
    /// Rate of these bytes relative to that of a copy.
    pub share_of_copying: Option<f64>,
}

/// Times of a stage over the awake steps.
#[derive(Clone, Debug, Serialize)]
pub struct StageRow {
    pub stage: &'static str,
    #[serde(flatten)]
    pub ms: Spread,
}

impl RunReport {
    /// A report before the first step of `scene`. It stores the positions of the bodies, so the simulation can take the
    /// world itself.
    pub fn new(scene: &Scene, config: &SolverConfig, backend: &dyn Backend) -> Self {
        Self {
            scene: scene.name.clone(),
            backend: backend.name().into(),
            adapter: backend.adapter(),
            worlds: scene.world.world_count(),
            bodies: scene.world.dynamic_count(),
            bodies_now: scene.world.dynamic_count(),
            sensors: counted::of(&scene.world),
            dt: scene.dt,
            config: config.clone(),
            joints: scene.world.joints.len(),
            energy_before: energy(&scene.world),
            places: scene.world.bodies.iter().map(|body| (body.center_of_mass(), half_height(body))).collect(),
            stands: scene.stands,
            ..Self::default()
        }
    }

    pub fn add(&mut self, stats: &StepStats) {
        let ms = |d: std::time::Duration| d.as_secs_f64() * 1e3;
        let step_ms = ms(stats.times.total());
        self.steps += 1;
        self.faults.extend(stats.fault.iter().map(|line| format!("step {}: {line}", self.steps)));
        self.step_ms.push(step_ms);
        self.asleep = stats.asleep;
        if self.asleep > 0 {
            self.first_asleep_step.get_or_insert(self.steps);
        }
        let all_sleep = self.asleep > 0 && self.asleep == self.bodies_now;
        self.all_asleep_step = all_sleep.then(|| self.all_asleep_step.unwrap_or(self.steps));
        // Without a dispatch, all bodies slept at the start of the step.
        if self.asleep > 0 && stats.dispatches == 0 {
            return;
        }
        self.awake_steps += 1;
        let efforts = (0..).zip(stats.efforts).filter(|(_, bodies)| *bodies > 0);
        self.efforts =
            efforts.map(|(class, bodies)| EffortRow { substeps: self.config.substeps << class, bodies }).collect();
        self.most_substeps = self.efforts.iter().map(|row| row.substeps).fold(self.most_substeps, u32::max);
        self.hardest_contact = stats.hardest;
        self.awake_times.push(step_ms);
        self.stage_times.push(stats.times.stages().map(|s| ms(s.1)));
        for kernel in &stats.kernels {
            match self.kernel_times.iter_mut().find(|known| known.0.kernel == kernel.kernel) {
                Some((last, times)) => {
                    last.clone_from(kernel);
                    times.push(ms(kernel.time));
                }
                None => self.kernel_times.push((kernel.clone(), vec![ms(kernel.time)])),
            }
        }
        self.manifolds = stats.manifolds;
        self.points = stats.points;
        if self.config.tolerance > 0.0 {
            *self.sweeps.get_or_insert(0) += u64::from(stats.sweeps);
            *self.planned_sweeps.get_or_insert(0) += u64::from(stats.planned_sweeps);
        }
        self.colors = stats.colors;
        self.overflow = self.overflow.max(stats.overflow);
        self.reused = 1.0 - stats.computed as f64 / stats.pairs.max(1) as f64;
        self.dispatches = if stats.traffic.dispatches > 0 { stats.traffic.dispatches } else { stats.dispatches };
        self.bytes_moved = stats.bytes_moved;
        self.bytes_up = stats.traffic.up;
        self.bytes_down = stats.traffic.down;
    }

    /// Measures the end of the run. It drops the simulation before it computes contacts anew: both together would take
    /// 1.5 times the memory of the steps.
    pub fn measure(&mut self, scene: &Scene, mut simulation: Simulation) {
        self.awake_ms = Spread::of(&self.awake_times);
        let names = StepStats::default().times.stages().map(|s| s.0);
        let stage = |(i, stage): (usize, &'static str)| {
            let times: Vec<f64> = self.stage_times.iter().map(|t| t[i]).collect();
            Spread::of(&times).map(|ms| StageRow { stage, ms })
        };
        self.stage_ms = names.into_iter().enumerate().filter_map(stage).collect();
        let bandwidth = self.copy_bandwidth;
        let kernel = |(last, times): &(KernelTime, Vec<f64>)| {
            let share = |bandwidth: f64| last.bytes as f64 / last.time.as_secs_f64() / bandwidth;
            KernelRow {
                kernel: last.kernel,
                ms: Spread::of(times).expect("a kernel has a time"),
                bytes: last.bytes,
                share_of_copying: bandwidth.filter(|_| last.bytes > 0 && !last.time.is_zero()).map(share),
            }
        };
        self.kernel_ms = self.kernel_times.iter().map(kernel).collect();
        if self.asleep > 0 {
            (self.manifolds, self.points) = contacts(&mut simulation);
        }
        self.hash = format!("{:016x}", simulation.hash());
        let world = &simulation.into_world();
        let penetration = Penetration::of_world(world, &self.config);
        let fastest = fastest(world);
        self.penetration_max = penetration.max;
        self.penetration_p95 = penetration.p95;
        self.penetration_mean = penetration.mean;
        self.speed_max = fastest.map_or(0.0, |(speed, _)| speed);
        let moving = fastest.filter(|(speed, _)| *speed != 0.0);
        self.fastest = moving.map(|(_, body)| body_name(world, body.index()));
        self.speed_rms = rms_speed(world);
        self.kinetic_energy = world.kinetic_energy();
        self.energy_gained = energy(world) - self.energy_before;
        self.escaped = scene.container.map(|_| scene.escaped(world));
        self.joint_gap = (!world.joints.is_empty()).then(|| world.joint_gap().into());
        // Like `drystone::metrics::in_place`, but from the stored positions.
        let in_place = |(handle, body): &(BodyHandle, &Body)| {
            let begun = self.places.get(handle.index());
            begun.is_some_and(|(center, half_height)| {
                center.as_dvec3().distance(body.center_of_mass().as_dvec3()) < *half_height
            })
        };
        let standing = |group: &str, bodies: &[BodyHandle]| {
            let bodies = bodies.iter().filter_map(|&handle| Some((handle, world.body(handle)?)));
            let dynamic = bodies.filter(|(_, body)| body.kind == BodyKind::Dynamic);
            Standing {
                group: group.into(),
                bodies: dynamic.clone().count(),
                in_place: dynamic.filter(in_place).count(),
            }
        };
        let all = standing("", &world.bodies.handles().collect::<Vec<_>>()).in_place;
        let groups = scene.groups.iter().map(|group| standing(&group.name, &group.bodies)).collect();
        (self.in_place, self.standing) = (all, groups);
        self.non_finite = world.bodies.iter().filter(|b| !b.is_finite()).count();
        self.first_non_finite = world.first_non_finite().map(|body| body_name(world, body.index()));
    }
}

/// Number of manifolds with a dynamic body, asleep or awake, and of their points.
fn contacts(simulation: &mut Simulation) -> (usize, usize) {
    let moves: Vec<bool> = simulation.world.bodies.iter().map(|body| body.kind == BodyKind::Dynamic).collect();
    let of_bodies = simulation.manifolds().filter(|m| moves[m.a.body.index()] || moves[m.b.body.index()]);
    of_bodies.fold((0, 0), |(manifolds, points), m| (manifolds + 1, points + m.points().len()))
}

/// The index of a body, and its name if it has one.
fn body_name(world: &World, index: usize) -> String {
    match world.bodies.get(index) {
        Some(body) if !body.name.is_empty() => format!("{index} {:?}", body.name),
        _ => index.to_string(),
    }
}
