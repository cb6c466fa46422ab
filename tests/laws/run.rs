//! A run of a world, held against the laws.

use std::collections::BTreeSet;

use drystone::glam::DVec3;
use drystone::{Backend, BodyHandle, BodyKind, Cpu, Listen, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

use super::measures::{Gap, Mechanics, Springs, is_alone, size};

/// The share of the energy in motion that a world may gain (law 1).
pub const SHARE: f64 = 1e-3;
/// The share of the weight times the size of the bodies likewise; where gravity is less than 1 m/s², of their weight in that. Anchors that
/// rounding leaves a millionth of their size apart move bodies that rest without gravity.
pub const SHARE_OF_WEIGHT: f64 = 1e-6;
/// The most that a world may gain above what it began with, over that. The energy of a motion that springs of joints hold for a while comes back, and
/// velocities of jointed bodies are half a substep off places: law 1, in a form that holds today.
pub const MAX_LASTING: f64 = 0.01;
/// The largest gap of a joint, over its lever, or angle (rad).
pub const MAX_GAP: f64 = 0.01;
/// The most steps after which a joint may be open by more than [`MAX_GAP`]: a hit opens joints, and they close again.
pub const MAX_OPEN: u32 = 30;
/// The largest change of momentum of what nothing outside touches, over the sum of the sizes of the momenta of the bodies, beyond what the
/// rounding of places and of a fall explains ([`Rounding`]).
///
/// A velocity of f32 rounds by 2^-24 of itself. A step of 8 substeps changes it some 50 times in each of its joints and contacts, so that 10 s of
/// 60 steps round it some 10^5 times. Signs of these errors are not those of each other: their sum is 2^-24 times the root of 10^5, 2e-5; five
/// times that.
pub const MAX_DRIFT: f64 = 1e-4;

/// A world, and how it runs.
#[derive(Clone, Debug)]
pub struct Case {
    pub scene: Scene,
    pub config: SolverConfig,
    /// How long it runs (s).
    pub seconds: f32,
    /// It ends before that once it gained so many times what it began with.
    pub enough: f64,
}

impl Case {
    pub fn new(scene: Scene, config: SolverConfig, rate: u32, seconds: f32) -> Self {
        Self { scene: Scene { dt: 1.0 / rate as f32, ..scene }, config, seconds, enough: f64::INFINITY }
    }

    pub fn steps(&self) -> u32 {
        (self.seconds / self.scene.dt).round() as u32
    }
}

/// The result of a run.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Why a step was refused, or a world has numbers that are not finite.
    pub lost: Option<String>,
    /// Most that energy rose above an earlier value, work and push apart (J).
    pub rise: f64,
    /// Most that it rose beyond what law 1 allows (J); above 0 the law is broken.
    pub excess: f64,
    /// Likewise above the value that it began with: less than the excess where energy is lost and comes back.
    pub above_start: f64,
    /// The step in which the law was broken first.
    pub broken_at: Option<u32>,
    /// The energy that the world began with: in motion, in springs, of its weight over its size, of what pushes it apart (J).
    pub scale: f64,
    /// What `push_limit` gives (J).
    pub push: f64,
    /// Bound of the work of motors, kinematic bodies (J).
    pub work: f64,
    pub gap: Gap,
    pub gap_at: u32,
    /// The steps after which a joint is open by more than [`MAX_GAP`].
    pub open: u32,
    /// Change of momentum and of angular momentum over what they are made of; none where something outside touches.
    pub drift: Option<[f64; 2]>,
    /// The most substeps of a body.
    pub substeps: u32,
    /// The energy of each step, where asked for: kinetic, potential, of springs, work, taken by the law; then the steps that it refused, and the
    /// change of angular momentum since the start where nothing outside touches (kg m²/s), the largest gap, and the most substeps.
    pub trace: Vec<[f64; 9]>,
}

impl Verdict {
    /// The excess over what the world began with.
    pub fn gain(&self) -> f64 {
        self.share(self.excess)
    }

    /// The excess above the start over that.
    pub fn lasting_gain(&self) -> f64 {
        self.share(self.above_start)
    }

    fn share(&self, energy: f64) -> f64 {
        if energy > 0.0 { energy / self.scale.max(1e-12) } else { 0.0 }
    }

    /// Each law that it breaks, by a word.
    pub fn broken(&self) -> Vec<&'static str> {
        let [momentum, spin] = self.drift.unwrap_or_default();
        let laws = [
            (self.lost.is_some(), "finite"),
            (self.excess > 0.0, "energy"),
            (self.lasting_gain() > MAX_LASTING, "lasting"),
            (self.gap.worst() > MAX_GAP, "gap"),
            (self.open > MAX_OPEN, "open"),
            (momentum > MAX_DRIFT, "momentum"),
            (spin > MAX_DRIFT, "spin"),
        ];
        laws.into_iter().filter(|(is_broken, _)| *is_broken).map(|(_, law)| law).collect()
    }
}

/// The bodies that begin inside of each other.
type Overlaps = BTreeSet<[usize; 2]>;

/// Pairs of bodies that overlap when the last step began by more than a contact may sag, and by how much at most (m).
fn overlaps(simulation: &Simulation) -> (Overlaps, f64) {
    let (mut pairs, mut deepest) = (Overlaps::new(), 0.0_f64);
    for contact in simulation.contacts() {
        let ends = [contact.a.body.index(), contact.b.body.index()];
        let bodies = &simulation.world.bodies;
        let extent = ends.map(|i| bodies[i].smallest_half_extent()).into_iter().fold(f32::INFINITY, f32::min);
        let sag = simulation.config().promised_sag(extent);
        let depth = contact.points().iter().map(|point| -point.separation).fold(0.0, f32::max);
        if depth > sag {
            pairs.insert(ends);
            deepest = deepest.max(f64::from(depth));
        }
    }
    (pairs, deepest)
}

/// Joints that are open by more than rounding, or beyond a limit.
fn open_joints(world: &World) -> BTreeSet<usize> {
    let is_open = |i: &usize| Gap::of(world, &world.joints[*i]).worst() > 1e-4;
    (0..world.joints.len()).filter(is_open).collect()
}

/// What `push_limit` v may give to bodies that begin inside of each other, or on joints that begin beyond a limit (J).
///
/// Two bodies that overlap are pushed apart until they part at v: that gives them at most m v²/2 of the lighter one. In a heap pushes add up. Of
/// all that is connected by overlaps and joints, what cannot move stands still, or else the heaviest body; a body that is d overlaps away from
/// that parts from it at d v at most, at least one, and is lifted by d times the depth. Energy of the motion relative to the body that stands
/// still is at least that relative to the common center of mass.
fn push(world: &World, limit: f64, overlaps: &Overlaps, depth: f64, open: &BTreeSet<usize>) -> f64 {
    let count = world.bodies.len();
    let moves = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
    // All immovable bodies count as one, after the others.
    let place = |i: usize| if moves(i) { i } else { count };
    let mut edges: Vec<(usize, usize, u32)> = overlaps.iter().map(|&[a, b]| (place(a), place(b), 1)).collect();
    for (k, joint) in world.joints.iter().enumerate() {
        let b = joint.body_b.map_or(count, |b| place(b.index()));
        edges.push((place(joint.body_a.index()), b, u32::from(open.contains(&k))));
    }
    let mass = |i: usize| if i == count { f64::INFINITY } else { f64::from(world.bodies[i].mass.mass) };
    let mut roots: Vec<usize> = (0..=count).filter(|&i| i == count || moves(i)).collect();
    roots.sort_by(|&a, &b| mass(b).total_cmp(&mass(a)));
    let mut distance = vec![u32::MAX; count + 1];
    let mut all = 0.0;
    for root in roots {
        if distance[root] < u32::MAX {
            continue;
        }
        distance[root] = 0;
        let mut own = BTreeSet::from([root]);
        let mut is_done = false;
        while !is_done {
            is_done = true;
            for &(a, b, length) in &edges {
                for (from, to) in [(a, b), (b, a)] {
                    if own.contains(&from) && distance[from] + length < distance[to] {
                        distance[to] = distance[from] + length;
                        own.insert(to);
                        is_done = false;
                    }
                }
            }
        }
        let is_pushed = edges.iter().any(|&(a, b, length)| length > 0 && own.contains(&a) && own.contains(&b));
        if is_pushed {
            let gravity = f64::from(world.gravity.length());
            all += own
                .iter()
                .filter(|&&i| i != root && i != count)
                .map(|&i| {
                    let d = f64::from(distance[i].max(1));
                    mass(i) * (0.5 * (d * limit).powi(2) + gravity * d * depth)
                })
                .sum::<f64>();
        }
    }
    all
}

/// The most power of the motors of a world (W).
///
/// A motor of the speed s pushes by at most its load L towards s. It does work only where the axis moves the way that it pushes, and so only
/// between rest and s: L |s| at most. A motor at speed 0 does none.
fn motor_power(world: &World) -> f64 {
    use drystone::{Axis, Bounds, Drive, Linear};
    let power = |axis: &Axis| match axis.drive {
        _ if matches!(axis.bounds, Bounds::Between { min, max } if min == max) => 0.0,
        Drive::Motor { speed, max_load } => f64::from(speed.abs()) * f64::from(max_load),
        _ => 0.0,
    };
    let of = |joint: &drystone::Joint| {
        let linear: f64 = match &joint.linear {
            Linear::Axes(axes) => axes.iter().map(power).sum(),
            Linear::Distance(distance) => power(distance),
        };
        linear + joint.angular.iter().map(power).sum::<f64>()
    };
    world.joints.iter().map(of).sum()
}

/// The work of kinematic bodies, from the momentum that they give.
///
/// The force F of a body that shifts at a velocity v does F v: its work in a step is v times the momentum that it gave, that is, what the
/// dynamic bodies gained and neither gravity nor fixed bodies gave. That of the latter is the sum of the impulses of contacts; a world with a
/// kinematic body has no joints to fixed bodies. A body that turns at a spin w about its center c, which rests, does w times the angular
/// momentum about c that it gave, where nothing else gives any.
struct Driver {
    velocity: DVec3,
    spin: DVec3,
    center: DVec3,
}

impl Driver {
    fn of(world: &World) -> Option<Self> {
        let mut driven = world.bodies.iter().filter(|body| body.is_driven());
        let body = driven.next()?;
        assert!(driven.next().is_none(), "the work of one kinematic body is known, not that of several");
        let (velocity, spin) = (body.linear_velocity.as_dvec3(), body.angular_velocity.as_dvec3());
        Some(Self { velocity, spin, center: body.center_of_mass().as_dvec3() })
    }

    fn work(&self, simulation: &Simulation, [before, after]: [&Mechanics; 2], dt: f64) -> f64 {
        let world = &simulation.world;
        let gravity = world.gravity.as_dvec3();
        if self.spin != DVec3::ZERO {
            let about = |m: &Mechanics| m.spin_about_origin - self.center.cross(m.momentum);
            let arm = 0.5 * (before.moment + after.moment) - self.center * after.mass;
            return self.spin.dot(about(after) - about(before) - arm.cross(gravity) * dt);
        }
        let kind = |body: drystone::BodyHandle| world.body(body).map(|body| body.kind);
        let mut by_fixed = DVec3::ZERO;
        for contact in simulation.contacts() {
            match (kind(contact.a.body), kind(contact.b.body)) {
                (Some(BodyKind::Fixed), _) => by_fixed += contact.impulse.as_dvec3(),
                (_, Some(BodyKind::Fixed)) => by_fixed -= contact.impulse.as_dvec3(),
                _ => {}
            }
        }
        self.velocity.dot(after.momentum - before.momentum - after.mass * gravity * dt - by_fixed)
    }
}

/// What rounding alone does to the momentum of what nothing outside touches.
#[derive(Clone, Copy, Debug, Default)]
struct Rounding {
    /// Each substep of a fall rounds the velocity of a body by up to 2^-24 of itself, and all of them alike (kg m/s).
    linear: f64,
    /// Each substep rounds the place x of a body by up to 2^-24 of it, one this way and one that way: after n of them the body is off by
    /// x 2^-24 times the root of n, with its momentum (kg m²/s).
    places: f64,
    /// The velocity of each body rounds by up to 2^-24 of itself in each substep of a fall, and always the same way while a substep changes it by the
    /// same number (kg m²/s).
    speeds: f64,
}

impl Rounding {
    fn add(&mut self, world: &World, now: &Mechanics, substeps: f64) {
        const UNIT: f64 = 1.0 / (1 << 24) as f64;
        let falls = world.gravity != drystone::glam::Vec3::ZERO;
        self.linear += if falls { substeps * UNIT * now.momentum.length() } else { 0.0 };
        let far = world.dynamic().map(|body| f64::from(body.position.length())).fold(0.0, f64::max);
        self.places = self.places.hypot(substeps.sqrt() * UNIT * far * now.momenta);
        self.speeds += if falls { substeps * UNIT * now.levers } else { 0.0 };
    }
}

/// Follows energy from step to step: the most that it rose above an earlier value.
#[derive(Clone, Debug)]
pub struct Passivity {
    lowest: f64,
    /// The largest energy in motion and in springs so far (J).
    in_motion: f64,
    start: f64,
    pub rise: f64,
    pub excess: f64,
    pub above_start: f64,
}

impl Passivity {
    /// Of a world that begins with so much energy, of which so much is in motion (J).
    pub fn new(energy: f64, in_motion: f64) -> Self {
        let none = f64::NEG_INFINITY;
        Self { lowest: energy, in_motion, start: energy, rise: 0.0, excess: none, above_start: none }
    }

    /// After a step: the energy without the work that was done so far, that in motion, and what the law allows besides 0.1 % of the latter (J).
    /// Returns whether the law holds.
    pub fn follow(&mut self, energy: f64, in_motion: f64, allowance: f64) -> bool {
        // A comparison with a number that is none is false.
        self.in_motion = self.in_motion.max(in_motion);
        let rise = energy - self.lowest;
        let excess = rise - allowance - SHARE * self.in_motion;
        self.rise = self.rise.max(rise);
        self.excess = self.excess.max(excess);
        self.above_start = self.above_start.max(excess + self.lowest - self.start);
        self.lowest = self.lowest.min(energy);
        excess <= 0.0
    }

    /// Forgets what was before.
    fn restart(&mut self, energy: f64) {
        (self.lowest, self.start) = (energy, energy);
    }
}

/// Runs a case on the processor, and measures it after every step.
pub fn run(case: &Case) -> Verdict {
    run_on(case, Box::new(Cpu::new()), false)
}

/// The same on some backend, with a trace if asked for.
pub fn run_on(case: &Case, backend: Box<dyn Backend>, traces: bool) -> Verdict {
    let mut verdict = Verdict::default();
    let mut config = case.config.clone();
    let drivers = Driver::of(&case.scene.world).is_some();
    if drivers || is_alone(&case.scene.world) {
        // A body that sleeps feels no gravity, its contacts tell of no impulses, and the momentum that it had is gone.
        config = config.without_sleep();
    }
    let limit = f64::from(config.push_limit);
    let mut simulation = match Simulation::with(case.scene.world.clone(), config, backend) {
        Ok(simulation) => simulation,
        Err(e) => return Verdict { lost: Some(e.to_string()), ..verdict },
    };
    if drivers {
        simulation.listen(Listen { impulses: true, ..Listen::default() }).expect("no approach speed");
    }
    let dt = f64::from(case.scene.dt);
    let alone = is_alone(&simulation.world);
    let gravity = simulation.world.gravity.as_dvec3();
    let power = motor_power(&simulation.world);
    let weight: f64 =
        simulation.world.dynamic().map(|b| f64::from(b.mass.mass) * size(b)).sum::<f64>() * gravity.length().max(1.0);
    let bodies = &simulation.world.bodies;
    let dynamic: Vec<BodyHandle> = bodies.handles().filter(|&i| bodies[i].kind == BodyKind::Dynamic).collect();
    let (mut before, springs_at_start) = (Mechanics::of(&simulation.world), Springs::of(&simulation.world));
    let start = before;
    let motion = |m: &Mechanics| if alone { m.kinetic - m.common } else { m.kinetic };
    let of_bodies = |m: &Mechanics| motion(m) + if alone { 0.0 } else { m.potential };
    // Springs hold at most what they took. Where an angle jumps from half a turn to the other side, no body gets the rest.
    let mut held = springs_at_start.energy;
    let in_motion = motion(&start) + springs_at_start.energy;
    let mut passivity = Passivity::new(of_bodies(&start) + held, in_motion);
    let (mut pushed, mut open) = (Overlaps::new(), open_joints(&simulation.world));
    let (mut work, mut given, mut push_left) = (0.0, 0.0, 0.0);
    let (mut momenta, mut spins) = (start.momenta, start.spins);
    let (mut drift, mut rounding) = ([0.0_f64; 2], Rounding::default());
    for step in 0..case.steps() {
        let stats = match simulation.step(case.scene.dt) {
            Ok(stats) => stats,
            Err(e) => {
                verdict.lost = Some(e.to_string());
                break;
            }
        };
        let world = &simulation.world;
        let (now, depth) = overlaps(&simulation);
        if step == 0 {
            pushed = now;
            if !pushed.is_empty() || !open.is_empty() {
                push_left = push(&case.scene.world, limit, &pushed, depth, &open);
            }
            verdict.push = push_left;
            verdict.scale = in_motion + 0.5 * weight + push_left;
        } else if push_left > 0.0 {
            pushed.retain(|pair| now.contains(pair));
            if !open.is_empty() {
                let still = open_joints(world);
                open.retain(|joint| still.contains(joint));
            }
        }
        let (after, springs) = (Mechanics::of(world), Springs::of(world));
        if !after.kinetic.is_finite() || !springs.energy.is_finite() {
            verdict.lost = Some(format!("no number after step {step}"));
            break;
        }
        let work_before = work;
        if let Some(driver) = Driver::of(world) {
            // Where the body was while the step ran makes no difference to one that only shifts, and one that turns rests.
            let own = driver.work(&simulation, [&before, &after], dt);
            work += own;
            given += own.abs();
        }
        work += power * dt;
        given += power * dt;
        let is_pushing = !pushed.is_empty() || !open.is_empty();
        let allowance = SHARE_OF_WEIGHT * weight + push_left;
        let taken = of_bodies(&before) + (work - work_before) - of_bodies(&after);
        held = springs.energy.min(held + taken.max(0.0));
        let total = of_bodies(&after) + held - work;
        if !passivity.follow(total, motion(&after) + held, allowance) && verdict.broken_at.is_none() {
            verdict.broken_at = Some(step);
        }
        if passivity.above_start > case.enough * (verdict.scale + given) {
            break;
        }
        if push_left > 0.0 && !is_pushing {
            // From now on nothing is pushed out of where it began.
            passivity.restart(total);
            push_left = 0.0;
        }
        let substeps = dynamic.iter().map(|&i| simulation.substeps_of(i)).fold(1, u32::max);
        if alone {
            (momenta, spins) = (momenta.max(after.momenta), spins.max(after.spins));
            let fallen = start.momentum + after.mass * gravity * (dt * f64::from(step + 1));
            rounding.add(world, &after, f64::from(substeps));
            drift[0] = drift[0].max((after.momentum - fallen).length() - rounding.linear);
            drift[1] = drift[1].max((after.spin - start.spin).length() - rounding.places - rounding.speeds);
        }
        let gap = Gap::largest(world);
        if gap.worst() > verdict.gap.worst() {
            (verdict.gap, verdict.gap_at) = (gap, step);
        }
        verdict.open += u32::from(gap.worst() > MAX_GAP);
        verdict.substeps = verdict.substeps.max(substeps);
        if traces {
            let potential = if alone { 0.0 } else { after.potential };
            verdict.trace.push([
                motion(&after),
                potential,
                springs.energy,
                work,
                stats.energy_taken,
                stats.refused as f64,
                if alone { (after.spin - start.spin).length() } else { 0.0 },
                gap.worst(),
                f64::from(substeps),
            ]);
        }
        before = after;
    }
    verdict.work = given;
    verdict.scale += given;
    (verdict.rise, verdict.excess, verdict.above_start) = (passivity.rise, passivity.excess, passivity.above_start);
    if alone {
        // A world rests if it has no more energy than law 1 allows.
        let rest = (2.0 * start.mass * SHARE_OF_WEIGHT * weight).sqrt();
        let share = |drift: f64, whole: f64| if whole > rest { drift / whole } else { 0.0 };
        verdict.drift = Some([share(drift[0], momenta + start.momentum.length()), share(drift[1], spins)]);
    }
    verdict
}
