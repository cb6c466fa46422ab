//! Bodies that lie still are left alone until something disturbs them.
//!
//! Bodies that touch, or that a joint holds together, form an island. An island whose bodies were all slow for a while falls
//! asleep as a whole: its bodies stay where they are to the last bit, and no stage of a step works on them. It wakes as a
//! whole when a body that is awake comes near enough to make contact, when a kinematic body that moves touches it or is tied to it, or when
//! the caller changes the pose or velocity of one of its bodies, a force, torque or gravity on it, or the pose of a body under it or at the other
//! end of one of its joints. A body that
//! touches nothing never sleeps, nor does an island of a body that may not (`Body::can_sleep`), nor an island of which a body still comes out of another. Everything is decided in the order of bodies and pairs, whatever the number of threads.

use glam::{Quat, Vec3};

use crate::collide::{Activity, Detector, Pair};
use crate::config::SolverConfig;
use crate::error::{Result, ensure};
use crate::graph::Islands;
use crate::saved::{Archive, Saved};
use crate::world::{Body, BodyKind, Joint, World};

/// The state of a body that a caller may change between two steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Snapshot {
    position: Vec3,
    rotation: Quat,
    linear_velocity: Vec3,
    angular_velocity: Vec3,
    force: Vec3,
    torque: Vec3,
    /// The gravity that it feels.
    gravity: Vec3,
}

crate::saved::fields!(Snapshot { position, rotation, linear_velocity, angular_velocity, force, torque, gravity });

impl Snapshot {
    fn of(world: &World, i: usize) -> Self {
        let body = &world.bodies[i];
        Self {
            position: body.position,
            rotation: body.rotation,
            linear_velocity: body.linear_velocity,
            angular_velocity: body.angular_velocity,
            force: body.whole_force(),
            torque: body.whole_torque(),
            gravity: world.gravity_on(i),
        }
    }

    fn bits(&self) -> ([u32; 4], [[u32; 3]; 6]) {
        let Self { position, rotation, linear_velocity, angular_velocity, force, torque, gravity } = self;
        let vectors = [position, linear_velocity, angular_velocity, force, torque, gravity];
        (rotation.to_array().map(f32::to_bits), vectors.map(|v| v.to_array().map(f32::to_bits)))
    }
}

/// Which bodies sleep, and since when the others are slow.
#[derive(Debug, Default)]
pub struct Sleep {
    /// Seconds that an island has to be slow; 0 if nothing ever sleeps.
    after: f32,
    speed: f32,
    /// Whether each body sleeps; empty if nothing ever does.
    asleep: Vec<bool>,
    /// The activity of each body for the detection; empty likewise.
    activity: Vec<Activity>,
    /// How long each body has been slow (s).
    slow_for: Vec<f32>,
    /// Radius around the origin of each body that holds its shapes (m).
    reach: Vec<f32>,
    /// Bodies that sleep, and those that cannot be pushed, as they were left. The detector keeps poses of all bodies as well
    /// ([`Detector::note_left`]): it needs those of bodies that are awake, and no velocities and forces. This list has what wakes a body, or
    /// nothing that equals anything where a body is disturbed, and is empty where nothing sleeps.
    left: Vec<Snapshot>,
    islands: Islands,
    /// The next body of the island, around; of bodies that sleep.
    next: Vec<u32>,
    count: usize,
    steps: u32,
}

crate::saved::cloned!(Sleep {
    after,
    speed,
    asleep,
    activity,
    slow_for,
    reach,
    left,
    next,
    count,
    steps,
} scratch { islands });

/// The overlap from which on a body has to lie still, over the sag that the settings promise: preloads lift what rests out of deeper overlaps.
const DEEP: f32 = 0.25;
/// A body comes out of another if it does so within so long (s), as fast as it is now.
const COMING_OUT: f32 = 10.0;

/// Whether bodies that overlap come apart.
fn comes_out(pair: &Pair, world: &World, config: &SolverConfig) -> bool {
    let deep = DEEP * config.promised_sag(pair.size);
    let going_on = pair.manifolds.iter().filter(|manifold| !manifold.has_ended());
    let mut points = going_on.flat_map(|manifold| pair.overlaps(manifold, world));
    points.any(|(overlap, parting)| overlap > deep && COMING_OUT * parting > overlap)
}

/// Bodies that touch each other, and those that a joint ties to each other or to the world.
fn touching_or_tied(world: &World, detector: &Detector) -> impl Iterator<Item = (usize, Option<usize>)> {
    let touching = detector.pairs().filter(|p| p.is_touching()).map(|p| (p.body_a as usize, Some(p.body_b as usize)));
    let joints = world.joints.iter().filter(|joint| !joint.holds_nothing());
    touching.chain(joints.map(Joint::indices))
}

/// Islands are looked for in every so many steps.
const EVERY: u32 = 8;

/// What [`Sleep::walk`] does with the state in which a body was left.
#[derive(Clone, Copy, PartialEq)]
enum Left {
    /// A body that is awake and can be pushed has none.
    Unused,
    AsTheBody,
    Other,
}

crate::saved::kinds!(Left { Unused, AsTheBody, Other });

impl Sleep {
    /// Writes all that lasts, or reads it: for the bodies of `world`, whose kinds were `kinds` in the step before.
    pub fn walk<A: Archive>(&mut self, world: &World, kinds: &[BodyKind], archive: &mut A) -> Result<()> {
        let Self { after, speed, asleep, activity, slow_for, reach, left, islands: _, next, count, steps } = self;
        after.walk(archive)?;
        speed.walk(archive)?;
        steps.walk(archive)?;
        let bodies = archive.count(asleep.len())?;
        if A::READS {
            ensure(bodies == 0 || bodies == kinds.len(), || format!("{bodies} of {} bodies may sleep", kinds.len()))?;
            asleep.resize(bodies, false);
            activity.resize(bodies, Activity::Awake);
            slow_for.resize(bodies, 0.0);
            reach.resize(bodies, 0.0);
            left.resize(bodies, Snapshot::default());
            next.resize(bodies, 0);
        }
        let now = |i: usize| world.bodies.get(i).map(|_| Snapshot::of(world, i)).unwrap_or_default();
        let mut are_left = vec![Left::Unused; bodies];
        archive.runs(bodies, |i, archive| {
            if !A::READS && (kinds[i] != BodyKind::Dynamic || asleep[i]) {
                are_left[i] = if left[i].bits() == now(i).bits() { Left::AsTheBody } else { Left::Other };
            }
            asleep[i].walk(archive)?;
            activity[i].walk(archive)?;
            slow_for[i].walk(archive)?;
            reach[i].walk(archive)?;
            are_left[i].walk(archive)
        })?;
        for ((i, left), is_left) in left.iter_mut().enumerate().zip(are_left) {
            match is_left {
                Left::Other => left.walk(archive)?,
                _ if A::READS => *left = now(i),
                _ => {}
            }
        }
        let rings = archive.chunks(bodies, 1, |range, columns| {
            let walk = |i: usize| {
                let mut own = next[i];
                columns.index(0, &mut own, i as u32)?;
                ensure((own as usize) < bodies, || format!("body {own} of {bodies} sleeps"))?;
                Ok(own)
            };
            range.map(walk).collect::<Result<Vec<_>>>()
        })?;
        if A::READS {
            next.clear();
            next.extend(rings.into_iter().flatten());
        }
        *count = asleep.iter().filter(|asleep| **asleep).count();
        Ok(())
    }

    /// Everything is awake.
    pub fn new(world: &World, config: &SolverConfig) -> Self {
        if config.sleep_after == 0.0 {
            return Self::default();
        }
        let bodies = world.bodies.len();
        Self {
            after: config.sleep_after,
            speed: config.sleep_speed,
            asleep: vec![false; bodies],
            activity: vec![Activity::Awake; bodies],
            slow_for: vec![0.0; bodies],
            reach: world.bodies.iter().map(Body::reach).collect(),
            left: (0..bodies).map(|i| Snapshot::of(world, i)).collect(),
            islands: Islands::default(),
            next: (0..bodies as u32).collect(),
            count: 0,
            steps: 0,
        }
    }

    /// Takes over other settings. All bodies wake where anything but the settings of sleeping changes: what they rested on may
    /// hold them no longer.
    pub fn change_settings(&mut self, world: &World, before: &SolverConfig, now: &SolverConfig) {
        let SolverConfig { sleep_after, sleep_speed, .. } = *now;
        if self.asleep.is_empty() || sleep_after == 0.0 {
            *self = Self::new(world, now);
            return;
        }
        (self.after, self.speed) = (sleep_after, sleep_speed);
        if (SolverConfig { sleep_after, sleep_speed, ..before.clone() }) != *now {
            (0..self.asleep.len()).for_each(|body| self.wake(body));
        }
    }

    /// Takes over bodies that came, went, or changed kind, groups or shapes. They are awake, and wake what touches them.
    pub fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        if self.after == 0.0 {
            return;
        }
        let (before, bodies) = (self.asleep.len(), world.bodies.len());
        changed.iter().filter(|&&i| i < before).for_each(|&i| self.wake(i));
        self.asleep.resize(bodies, false);
        self.activity.resize(bodies, Activity::Awake);
        self.slow_for.resize(bodies, 0.0);
        self.reach.resize(bodies, 0.0);
        self.next.truncate(bodies);
        self.next.extend(self.next.len() as u32..bodies as u32);
        self.left.truncate(bodies);
        self.left.extend((before.min(bodies)..bodies).map(|i| Snapshot::of(world, i)));
        for &i in changed.iter().filter(|&&i| i < bodies) {
            self.slow_for[i] = 0.0;
            self.reach[i] = world.bodies[i].reach();
            self.disturb(i);
        }
    }

    /// Whether each body sleeps; empty if none ever does.
    pub fn asleep(&self) -> &[bool] {
        &self.asleep
    }

    /// The activity of each body for the detection; empty if nothing ever sleeps.
    pub fn activity(&self) -> &[Activity] {
        &self.activity
    }

    /// Bodies that sleep.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether a step would change nothing: something sleeps, and nothing else moves.
    pub fn is_everything_still(&self) -> bool {
        self.count > 0 && self.activity.iter().all(|a| *a == Activity::Still)
    }

    /// Wakes what was changed since the last step, and what touches what moves by itself.
    pub fn before_step(&mut self, world: &World, detector: &Detector) {
        for i in 0..self.asleep.len() {
            let body = &world.bodies[i];
            if self.asleep[i] && (!body.can_sleep || self.left[i] != Snapshot::of(world, i)) {
                self.wake(i);
            }
            self.activity[i] = match body.kind {
                BodyKind::Dynamic if self.asleep[i] => Activity::Still,
                BodyKind::Dynamic => Activity::Awake,
                BodyKind::Kinematic if body.is_driven() => Activity::Moving,
                _ if self.left[i] != Snapshot::of(world, i) => Activity::Moving,
                _ => Activity::Still,
            };
        }
        self.wake_touched(world, detector);
    }

    /// Wakes what sleeps and is touched by, or tied to, what does not; returns whether that was anything.
    pub fn wake_touched(&mut self, world: &World, detector: &Detector) -> bool {
        let before = self.count;
        if before > 0 && self.activity.iter().any(|a| *a != Activity::Still) {
            for (a, b) in touching_or_tied(world, detector) {
                let Some(b) = b else { continue };
                for (one, other) in [(a, b), (b, a)] {
                    if self.asleep[one] && self.activity[other] != Activity::Still {
                        self.wake(one);
                    }
                }
            }
        }
        self.count < before
    }

    /// Wakes the island of a body, if it sleeps.
    pub fn wake(&mut self, body: usize) {
        let mut i = body;
        while self.asleep.get(i) == Some(&true) {
            self.asleep[i] = false;
            self.activity[i] = Activity::Awake;
            self.slow_for[i] = 0.0;
            self.count -= 1;
            i = std::mem::replace(&mut self.next[i], i as u32) as usize;
        }
    }

    /// Wakes a body that the caller changed. A body that never sleeps wakes what touches it in the next step.
    pub fn disturb(&mut self, body: usize) {
        self.wake(body);
        if let Some(left) = self.left.get_mut(body) {
            // Equal to nothing.
            left.force = Vec3::NAN;
        }
    }

    /// Notes which bodies were slow in a step of `dt` seconds, and lets islands fall asleep that were slow for long enough.
    pub fn after_step(&mut self, world: &mut World, detector: &Detector, config: &SolverConfig, dt: f32) {
        let mut ready = false;
        for (i, body) in world.bodies.iter().enumerate().take(self.asleep.len()) {
            if body.kind != BodyKind::Dynamic {
                self.left[i] = Snapshot::of(world, i);
            } else if !self.asleep[i] {
                let speed = body.linear_velocity.length() + self.reach[i] * body.angular_velocity.length();
                self.slow_for[i] = if speed < self.speed { self.slow_for[i] + dt } else { 0.0 };
                ready |= self.slow_for[i] >= self.after;
            }
        }
        self.steps += 1;
        if ready && self.steps.is_multiple_of(EVERY) {
            self.let_islands_sleep(world, detector, config);
        }
    }

    fn let_islands_sleep(&mut self, world: &mut World, detector: &Detector, config: &SolverConfig) {
        // Islands of bodies that are awake; bodies that something holds; bodies that touch a driven body.
        let is_dynamic = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
        let mut held = vec![false; self.asleep.len()];
        let mut driven = vec![false; self.asleep.len()];
        self.islands.reset(self.asleep.len());
        for (a, b) in touching_or_tied(world, detector) {
            for (one, other) in [(Some(a), b), (b, Some(a))] {
                let Some(one) = one else { continue };
                held[one] = true;
                driven[one] |= other.is_some_and(|other| self.activity[other] == Activity::Moving);
            }
            if let Some(b) = b.filter(|&b| is_dynamic(a) && is_dynamic(b) && !self.asleep[a] && !self.asleep[b]) {
                self.islands.join(a as u32, b as u32);
            }
        }
        let mut restless = vec![false; self.asleep.len()];
        for pair in detector.pairs().filter(|pair| pair.takes_part && comes_out(pair, world, config)) {
            for body in [pair.body_a, pair.body_b].into_iter().filter(|&body| is_dynamic(body as usize)) {
                restless[self.islands.root(body) as usize] = true;
            }
        }
        let awake: Vec<usize> = (0..self.asleep.len()).filter(|&i| is_dynamic(i) && !self.asleep[i]).collect();
        for &i in &awake {
            restless[self.islands.root(i as u32) as usize] |=
                self.slow_for[i] < self.after || !held[i] || driven[i] || !world.bodies[i].can_sleep;
        }
        for i in awake {
            let root = self.islands.root(i as u32) as usize;
            if restless[root] {
                continue;
            }
            let body = &mut world.bodies[i];
            (body.linear_velocity, body.angular_velocity) = (Vec3::ZERO, Vec3::ZERO);
            self.left[i] = Snapshot::of(world, i);
            self.asleep[i] = true;
            self.activity[i] = Activity::Still;
            self.count += 1;
            // Into the ring of its island.
            if root != i {
                self.next[i] = std::mem::replace(&mut self.next[root], i as u32);
            }
        }
    }
}
