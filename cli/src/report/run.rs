//! What one run was and what it came to: rows for people, JSON for programs.

mod rows;

use std::ops::Range;

use serde::Serialize;

use drystone::metrics::{Penetration, fastest, half_height, rms_speed};
use drystone::scenes::Group;
use drystone::stats::{KernelTime, median};
use drystone::{Backend, Body, BodyKind, Scene, Simulation, SolverConfig, StepStats, World};
use glam::Vec3;

/// Report of one run; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport {
    /// Name of the scene.
    pub scene: String,
    /// `reference`, `cpu` or `gpu`.
    pub backend: String,
    /// What it ran on.
    pub adapter: String,
    /// Worlds beside each other.
    pub worlds: usize,
    /// Dynamic bodies of all of them.
    pub bodies: usize,
    /// Steps that were run.
    pub steps: u32,
    /// Length of a step (s).
    pub dt: f32,
    /// Settings.
    pub config: SolverConfig,
    /// Wall time of each step (ms).
    pub step_ms: Vec<f64>,
    /// Steps in which a body was awake; in the others nothing is done.
    pub awake_steps: u32,
    /// Wall time of these, median and least (ms).
    pub awake_ms: Option<Spread>,
    /// Wall time of each stage, median and least over these (ms).
    pub stage_ms: Vec<StageRow>,
    /// Time of each kernel by the clock of the device, if it was asked for, median and least over these (ms).
    pub kernel_ms: Vec<KernelRow>,
    /// Bytes a second that the device reads and writes when it copies (B/s), if it was asked for times.
    pub copy_bandwidth: Option<f64>,
    /// Manifolds at the end, those that bodies sleep on among them.
    pub manifolds: usize,
    /// Their contact points.
    pub points: usize,
    /// Bodies that sleep at the end.
    pub asleep: usize,
    /// The first step after which a body slept.
    pub first_asleep_step: Option<u32>,
    /// The step after which all bodies slept, if they still do at the end.
    pub all_asleep_step: Option<u32>,
    /// Joints.
    pub joints: usize,
    /// Largest distance between the anchors of a joint at the end (m); none if the scene has no joints.
    pub joint_gap: Option<f64>,
    /// Sweeps that were done in all steps, where the settings have a tolerance; else none.
    pub sweeps: Option<u64>,
    /// Sweeps that the plans of all steps held, where the settings have a tolerance; else none.
    pub planned_sweeps: Option<u64>,
    /// Colors of the last step in which a body was awake, as all that follows of a last step.
    pub colors: usize,
    /// Most manifolds of any step that found no color and were swept alone.
    pub overflow: usize,
    /// Share of the pairs of the last step whose manifolds were reused.
    pub reused: f64,
    /// Dispatches of the last step.
    pub dispatches: usize,
    /// Bytes that the kernels of the last step read and wrote.
    pub bytes_moved: u64,
    /// Bytes that the last step sent to the device.
    pub bytes_up: u64,
    /// Bytes that the last step read back.
    pub bytes_down: u64,
    /// Deepest overlap at the end (m).
    pub penetration_max: f64,
    /// Overlap at the end that 95 % of the contacts do not exceed (m).
    pub penetration_p95: f64,
    /// Mean overlap at the end (m).
    pub penetration_mean: f64,
    /// Speed of the fastest body at the end (m/s).
    pub speed_max: f64,
    /// Which body that is; none if none moves.
    pub fastest: Option<String>,
    /// Root mean square speed at the end (m/s).
    pub speed_rms: f64,
    /// Kinetic energy at the end (J).
    pub kinetic_energy: f64,
    /// Kinetic and potential energy gained since the start (J).
    pub energy_gained: f64,
    /// Bodies outside the container at the end; none if the scene has no container.
    pub escaped: Option<usize>,
    /// Dynamic bodies whose center of mass moved by less than half of their height since the start.
    pub in_place: usize,
    /// The same for each group of the scene.
    pub standing: Vec<Standing>,
    /// Bodies whose pose or velocity is not finite.
    pub non_finite: usize,
    /// The first such body.
    pub first_non_finite: Option<String>,
    #[serde(skip)]
    awake_times: Vec<f64>,
    #[serde(skip)]
    stage_times: Vec<[f64; 5]>,
    #[serde(skip)]
    kernel_times: Vec<(KernelTime, Vec<f64>)>,
    #[serde(skip)]
    energy_before: f64,
    /// Center of mass and half the height (m) of each body at the start.
    #[serde(skip)]
    places: Vec<(Vec3, f64)>,
    #[serde(skip)]
    stands: bool,
}

/// How much of a group still stands.
#[derive(Clone, Debug, Serialize)]
pub struct Standing {
    /// Name of the group.
    pub group: String,
    /// Its dynamic bodies.
    pub bodies: usize,
    /// Those of them that are in place.
    pub in_place: usize,
}

/// Some times (ms).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    /// The middle one.
    pub median: f64,
    /// The least.
    pub min: f64,
}

impl Spread {
    /// None of no times.
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

/// Time of one kernel over a run (ms).
#[derive(Clone, Debug, Serialize)]
pub struct KernelRow {
    /// Name of the kernel.
    pub kernel: &'static str,
    /// Over the steps that it was in.
    #[serde(flatten)]
    pub ms: Spread,
    /// Bytes that it read and wrote in the last step that it was in; 0 if it is not of the plan.
    pub bytes: u64,
    /// Bytes a second of that step, as a share of what copying reaches.
    pub share_of_copying: Option<f64>,
}

/// Time of one stage over a run (ms).
#[derive(Clone, Debug, Serialize)]
pub struct StageRow {
    /// Name of the stage.
    pub stage: &'static str,
    /// Over the steps.
    #[serde(flatten)]
    pub ms: Spread,
}

impl RunReport {
    /// The report of a run of `scene` that has not begun. It keeps the places of the bodies, so the world itself may go to the simulation.
    pub fn new(scene: &Scene, config: &SolverConfig, backend: &dyn Backend) -> Self {
        Self {
            scene: scene.name.clone(),
            backend: backend.name().into(),
            adapter: backend.adapter(),
            worlds: scene.world.worlds().len(),
            bodies: scene.world.dynamic_count(),
            dt: scene.dt,
            config: config.clone(),
            joints: scene.world.joints.len(),
            energy_before: energy(&scene.world),
            places: scene.world.bodies.iter().map(|body| (body.center_of_mass(), half_height(body))).collect(),
            stands: scene.stands,
            ..Self::default()
        }
    }

    /// Takes in one step.
    pub fn add(&mut self, stats: &StepStats) {
        let ms = |d: std::time::Duration| d.as_secs_f64() * 1e3;
        let step_ms = ms(stats.times.total());
        self.steps += 1;
        self.step_ms.push(step_ms);
        self.asleep = stats.asleep;
        if self.asleep > 0 {
            self.first_asleep_step.get_or_insert(self.steps);
        }
        let all_sleep = self.asleep > 0 && self.asleep == self.bodies;
        self.all_asleep_step = all_sleep.then(|| self.all_asleep_step.unwrap_or(self.steps));
        // No pass was planned: everything slept when the step began.
        if self.asleep > 0 && stats.dispatches == 0 {
            return;
        }
        self.awake_steps += 1;
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

    /// Measures how the run ended. Only the world of the simulation is left when contacts are computed anew: both together would take half as much
    /// memory again as the steps.
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
        let world = &simulation.into_world();
        let penetration = Penetration::of_world(world, &self.config);
        let (speed, body) = fastest(world);
        self.penetration_max = penetration.max;
        self.penetration_p95 = penetration.p95;
        self.penetration_mean = penetration.mean;
        self.speed_max = speed;
        self.fastest = (speed != 0.0).then(|| body_name(world, body));
        self.speed_rms = rms_speed(world);
        self.kinetic_energy = world.kinetic_energy();
        self.energy_gained = energy(world) - self.energy_before;
        self.escaped = scene.container.map(|_| scene.escaped(world));
        self.joint_gap = (!world.joints.is_empty()).then(|| world.joint_gap().into());
        let counted = |bodies: Range<usize>| {
            let dynamic = bodies.filter(|&i| world.bodies.get(i).is_some_and(|b| b.kind == BodyKind::Dynamic));
            let in_place = dynamic.clone().filter(|&i| self.is_in_place(i, &world.bodies[i])).count();
            (dynamic.count(), in_place)
        };
        let in_place = counted(0..world.bodies.len()).1;
        let standing = |group: &Group| {
            let (bodies, in_place) = counted(group.bodies.clone());
            Standing { group: group.name.clone(), bodies, in_place }
        };
        (self.in_place, self.standing) = (in_place, scene.groups.iter().map(standing).collect());
        self.non_finite = world.bodies.iter().filter(|b| !b.is_finite()).count();
        self.first_non_finite = world.first_non_finite().map(|i| body_name(world, i));
    }

    /// As [`drystone::metrics::in_place`], from the place of the body at the start.
    fn is_in_place(&self, index: usize, body: &Body) -> bool {
        let (center, half_height) = self.places[index];
        center.as_dvec3().distance(body.center_of_mass().as_dvec3()) < half_height
    }
}

fn energy(world: &World) -> f64 {
    world.kinetic_energy() + world.potential_energy()
}

/// Manifolds of bodies that can be pushed, and their points, whether they sleep or not.
fn contacts(simulation: &mut Simulation) -> (usize, usize) {
    let moves: Vec<bool> = simulation.world.bodies.iter().map(|body| body.kind == BodyKind::Dynamic).collect();
    let of_bodies = simulation.manifolds().filter(|m| moves[m.body_a] || moves[m.body_b]);
    of_bodies.fold((0, 0), |(manifolds, points), m| (manifolds + 1, points + m.points().len()))
}

/// A body's own name and its index.
fn body_name(world: &World, index: usize) -> String {
    match world.bodies.get(index) {
        Some(body) if !body.name.is_empty() => format!("{index} {:?}", body.name),
        _ => index.to_string(),
    }
}
