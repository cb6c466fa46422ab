//! What one run was and what it came to: rows for people, JSON for programs.

use std::ops::Range;

use serde::Serialize;

use drystone::Simulation;
use drystone::config::SolverConfig;
use drystone::metrics::{fastest, in_place, rms_speed};
use drystone::scenes::{Group, Scene};
use drystone::stats::{KernelTime, StepStats, median};
use drystone::world::{BodyKind, World};

/// Report of one run; its fields are the keys of the JSON object.
#[derive(Clone, Debug, Serialize)]
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
    /// Median over the steps that it was in.
    pub median: f64,
    /// Least over them.
    pub min: f64,
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
    /// Median over the steps.
    pub median: f64,
    /// Least over the steps.
    pub min: f64,
}

impl RunReport {
    /// The report of a run that has not begun.
    pub fn new(scene: &Scene, simulation: &Simulation) -> Self {
        Self {
            scene: scene.name.clone(),
            backend: simulation.backend().name().into(),
            adapter: simulation.backend().adapter(),
            worlds: scene.world.worlds().len(),
            bodies: scene.world.dynamic_count(),
            steps: 0,
            dt: scene.dt,
            config: simulation.config().clone(),
            step_ms: Vec::new(),
            awake_steps: 0,
            awake_ms: None,
            stage_ms: Vec::new(),
            kernel_ms: Vec::new(),
            copy_bandwidth: None,
            manifolds: 0,
            points: 0,
            asleep: 0,
            first_asleep_step: None,
            all_asleep_step: None,
            joints: scene.world.joints.len(),
            joint_gap: None,
            sweeps: None,
            planned_sweeps: None,
            colors: 0,
            overflow: 0,
            reused: 0.0,
            dispatches: 0,
            bytes_moved: 0,
            bytes_up: 0,
            bytes_down: 0,
            penetration_max: 0.0,
            penetration_p95: 0.0,
            penetration_mean: 0.0,
            speed_max: 0.0,
            fastest: None,
            speed_rms: 0.0,
            kinetic_energy: 0.0,
            energy_gained: 0.0,
            escaped: None,
            in_place: 0,
            standing: Vec::new(),
            non_finite: 0,
            first_non_finite: None,
            awake_times: Vec::new(),
            stage_times: Vec::new(),
            kernel_times: Vec::new(),
            energy_before: energy(&scene.world),
            stands: scene.stands,
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

    /// Measures how the run ended.
    pub fn measure(&mut self, scene: &Scene, simulation: &mut Simulation) {
        self.awake_ms = Spread::of(&self.awake_times);
        let names = StepStats::default().times.stages().map(|s| s.0);
        let stage = |(i, stage): (usize, &'static str)| {
            let times: Vec<f64> = self.stage_times.iter().map(|t| t[i]).collect();
            Spread::of(&times).map(|Spread { median, min }| StageRow { stage, median, min })
        };
        self.stage_ms = names.into_iter().enumerate().filter_map(stage).collect();
        let bandwidth = self.copy_bandwidth;
        let kernel = |(last, times): &(KernelTime, Vec<f64>)| {
            let share = |bandwidth: f64| last.bytes as f64 / last.time.as_secs_f64() / bandwidth;
            KernelRow {
                kernel: last.kernel,
                median: median(times),
                min: times.iter().copied().fold(f64::INFINITY, f64::min),
                bytes: last.bytes,
                share_of_copying: bandwidth.filter(|_| last.bytes > 0 && !last.time.is_zero()).map(share),
            }
        };
        self.kernel_ms = self.kernel_times.iter().map(kernel).collect();
        if self.asleep > 0 {
            (self.manifolds, self.points) = contacts(simulation);
        }
        let penetration = simulation.penetration();
        let world = &simulation.world;
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
            let in_place = dynamic.clone().filter(|&i| in_place(&scene.world.bodies[i], &world.bodies[i])).count();
            (dynamic.count(), in_place)
        };
        self.in_place = counted(0..world.bodies.len()).1;
        let standing = |group: &Group| {
            let (bodies, in_place) = counted(group.bodies.clone());
            Standing { group: group.name.clone(), bodies, in_place }
        };
        self.standing = scene.groups.iter().map(standing).collect();
        self.non_finite = world.bodies.iter().filter(|b| !b.is_finite()).count();
        self.first_non_finite = world.first_non_finite().map(|i| body_name(world, i));
    }

    /// The report as names and values for people.
    pub fn rows(&self) -> Vec<(String, String)> {
        let mut rows = Vec::new();
        let mut row = |what: &str, value: String| rows.push((what.to_owned(), value));
        let (substeps, iterations, relax) = (self.config.substeps, self.config.iterations, self.config.relax);
        row("scene", format!("{}, {} dynamic bodies", self.scene, self.bodies));
        if self.worlds > 1 {
            let steps = self.worlds as f64 / (1e-3 * median(&self.awake_times));
            row("worlds", format!("{}, {steps:.3e} steps of one world a second", self.worlds));
        }
        row("backend", format!("{}: {}", self.backend, self.adapter));
        row(
            "steps",
            format!("{} of {:.3} ms; {substeps} substeps of {iterations} + {relax} sweeps", self.steps, self.dt * 1e3),
        );
        let (manifolds, points) = (self.manifolds, self.points);
        if self.asleep == 0 {
            let (colors, reused) = (self.colors, 100.0 * self.reused);
            row("contacts", format!("{manifolds} manifolds, {points} points, {colors} colors, {reused:.0} % reused"));
        } else {
            row("contacts", format!("{manifolds} manifolds, {points} points, with those that bodies sleep on"));
            let after = |step: u32| format!("after {:.2} s", f64::from(step) * f64::from(self.dt));
            let first =
                self.first_asleep_step.map_or_else(String::new, |first| format!(", the first {}", after(first)));
            row(
                "asleep",
                match self.all_asleep_step {
                    Some(all) if self.first_asleep_step == Some(all) => format!("all bodies {}", after(all)),
                    Some(all) => format!("all bodies {}{first}", after(all)),
                    None => format!("{} of {} bodies{first}", self.asleep, self.bodies),
                },
            );
        }
        if let Some(gap) = self.joint_gap {
            row("joints", format!("{}, {:.3} mm apart at most", self.joints, gap * 1e3));
        }
        if let (Some(sweeps), Some(planned)) = (self.sweeps, self.planned_sweeps) {
            row("sweeps", format!("{sweeps} of {planned}"));
        }
        if self.overflow > 0 {
            row("overflow", format!("up to {} manifolds found no color and were swept alone", self.overflow));
        }
        if let Some(times) = self.awake_ms {
            let which = match self.steps - self.awake_steps {
                0 => String::new(),
                _ => format!(", of {} steps with a body awake", self.awake_steps),
            };
            row("ms a step", format!("{times}{which}"));
        }
        for stage in &self.stage_ms {
            row(&format!("  {}", stage.stage), format!("{:.3} median, {:.3} least", stage.median, stage.min));
        }
        for kernel in &self.kernel_ms {
            let share = kernel.share_of_copying.map(|s| format!(", {:.1} % of copying", 100.0 * s)).unwrap_or_default();
            row(
                &format!("    {}", kernel.kernel),
                format!("{:.3} median, {:.3} least{share}", kernel.median, kernel.min),
            );
        }
        if self.bytes_up > 0 {
            let kb = |bytes: u64| bytes as f64 / 1e3;
            let (up, down) = (kb(self.bytes_up), kb(self.bytes_down));
            row("last step", format!("{up:.1} kB to the device, {down:.1} kB back, {} dispatches", self.dispatches));
        }
        row(
            "penetration",
            format!(
                "{:.3} mm deepest, 95 % within {:.3}, mean {:.3}",
                self.penetration_max * 1e3,
                self.penetration_p95 * 1e3,
                self.penetration_mean * 1e3
            ),
        );
        let (rms, most) = (self.speed_rms * 1e3, self.speed_max * 1e3);
        row(
            "speed",
            match &self.fastest {
                Some(body) => format!("{rms:.3} mm/s rms, {most:.3} mm/s fastest (body {body})"),
                None => "0 mm/s: nothing moves".into(),
            },
        );
        row("energy", format!("{:.3e} J kinetic, {:.3e} J gained in all", self.kinetic_energy, self.energy_gained));
        if let Some(escaped) = self.escaped {
            row("container", format!("{escaped} bodies outside"));
        }
        if self.stands {
            row("in place", format!("{} of {}", self.in_place, self.bodies));
        }
        if !self.standing.is_empty() {
            let up = || self.standing.iter().filter(|s| s.in_place == s.bodies);
            let largest = up().max_by_key(|s| s.bodies).map_or("none", |s| &s.group);
            row("standing", format!("{} of {} groups; the largest is {largest}", up().count(), self.standing.len()));
        }
        if let Some(body) = &self.first_non_finite {
            row("non-finite", format!("{} bodies, first {body}", self.non_finite));
        }
        rows
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
