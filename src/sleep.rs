//! Bodies that lie still fall asleep until something disturbs them.
//!
//! Bodies that touch, or that a joint connects, form an island. If all bodies of an island have been slow for some
//! time, the whole island falls asleep. Its bodies then keep their exact poses, and no stage of a step works on them.
//! An island wakes as a whole in one of these cases:
//!
//! - An awake body comes near enough to make contact.
//! - A moving kinematic body touches a body of the island or is connected to it.
//! - The caller changes the pose or velocity of one of its bodies, or a force, torque or gravity on it.
//! - The caller changes the pose of a body beneath it or at the other end of one of its joints.
//!
//! Three things keep an island awake: a body that touches nothing, a body that may not sleep (`Body::can_sleep`), and a
//! body that still comes out of another body. All decisions follow the order of bodies and pairs, so they do not depend
//! on the number of threads.

use glam::{Quat, Vec3};

use crate::collide::{Activity, Detector, Pair};
use crate::config::SolverConfig;
use crate::constants::{COMING_OUT, DEEP_OVERLAP, STEPS_TO_SLEEP};
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
    /// The gravity on the body.
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
            gravity: world.gravity_at(i),
        }
    }

    fn bits(&self) -> ([u32; 4], [[u32; 3]; 6]) {
        let Self { position, rotation, linear_velocity, angular_velocity, force, torque, gravity } = self;
        let vectors = [position, linear_velocity, angular_velocity, force, torque, gravity];
        (rotation.to_array().map(f32::to_bits), vectors.map(|v| v.to_array().map(f32::to_bits)))
    }
}

/// The bodies that sleep, and the times for which the others have been slow.
#[derive(Debug, Default)]
pub struct Sleep {
    /// Time for which an island has to be slow (s); 0 if nothing ever sleeps.
    after: f32,
    speed: f32,
    /// Whether each body sleeps; empty if nothing ever sleeps.
    asleep: Vec<bool>,
    /// The activity of each body for the detector; empty if nothing ever sleeps.
    activity: Vec<Activity>,
    /// How long each body has been slow (s).
    slow_for: Vec<f32>,
    /// Radius around the origin of each body that encloses its shapes (m).
    reach: Vec<f32>,
    /// The last state of bodies that sleep, and of those that cannot be pushed. The detector also keeps poses of all
    /// bodies ([`Detector::note_left`]), but it needs those of awake bodies, and no velocities and forces. The state
    /// here decides whether a body wakes. A disturbed body has a state that equals nothing. Empty if nothing ever
    /// sleeps.
    left: Vec<Snapshot>,
    islands: Islands,
    /// The next body in the ring of the island, for bodies that sleep.
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

/// Whether overlapping bodies separate.
fn comes_out(pair: &Pair, world: &World, config: &SolverConfig) -> bool {
    let deep = DEEP_OVERLAP * config.promised_sag(pair.size);
    let going_on = pair.manifolds.iter().filter(|manifold| !manifold.has_ended());
    let mut points = going_on.flat_map(|manifold| pair.overlaps(manifold, world));
    points.any(|(overlap, parting)| overlap > deep && COMING_OUT * parting > overlap)
}

/// Bodies that touch each other, and bodies that a joint connects to each other or to the world.
fn touching_or_tied(world: &World, detector: &Detector) -> impl Iterator<Item = (usize, Option<usize>)> {
    let touching = detector.pairs().filter(|p| p.is_touching()).map(|p| (p.body_a as usize, Some(p.body_b as usize)));
    let joints = world.joints.iter().filter(|joint| !joint.holds_nothing());
    touching.chain(joints.map(Joint::indices))
}

/// How [`Sleep::walk`] writes the state in which a body was left.
#[derive(Clone, Copy, PartialEq)]
enum SavedPose {
    /// Awake bodies that can be pushed have no such state.
    Unused,
    AsTheBody,
    Other,
}

crate::saved::kinds!(SavedPose { Unused, AsTheBody, Other });

impl Sleep {
    /// Writes the lasting state, or reads it, for the bodies of `world`. `kinds` are their kinds in the step before.
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
        let mut are_left = vec![SavedPose::Unused; bodies];
        archive.runs(bodies, |i, archive| {
            if !A::READS && (kinds[i] != BodyKind::Dynamic || asleep[i]) {
                are_left[i] = if left[i].bits() == now(i).bits() { SavedPose::AsTheBody } else { SavedPose::Other };
            }
            asleep[i].walk(archive)?;
            activity[i].walk(archive)?;
            slow_for[i].walk(archive)?;
            reach[i].walk(archive)?;
            are_left[i].walk(archive)
        })?;
        for ((i, left), is_left) in left.iter_mut().enumerate().zip(are_left) {
            match is_left {
                SavedPose::Other => left.walk(archive)?,
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

    /// A state with all bodies awake.
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

    /// Follows a change of settings. All bodies wake if any settings but those of sleep change, because their supports
    /// may no longer hold them.
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

    /// Follows bodies that were added, removed, or changed in kind, groups or shapes. These are awake, and wake the
    /// bodies that touch them.
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

    /// The activity of each body for the detector; empty if nothing ever sleeps.
    pub fn activity(&self) -> &[Activity] {
        &self.activity
    }

    /// Number of bodies that sleep.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether a step would change nothing: some bodies sleep, and no others move.
    pub fn is_everything_still(&self) -> bool {
        self.count > 0 && self.activity.iter().all(|a| *a == Activity::Still)
    }

    /// Wakes the bodies that were changed since the last step, and those that touch active bodies.
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

    /// Wakes sleeping bodies that touch active bodies or are connected to them. Returns whether there were any.
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

    /// Wakes a body that the caller changed. A change of a body that never sleeps wakes the bodies that touch it in the
    /// next step.
    pub fn disturb(&mut self, body: usize) {
        self.wake(body);
        if let Some(left) = self.left.get_mut(body) {
            // Equal to nothing.
            left.force = Vec3::NAN;
        }
    }

    /// Records which bodies were slow in a step of `dt` seconds, and lets islands fall asleep that were slow for long
    /// enough.
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
        if ready && self.steps.is_multiple_of(STEPS_TO_SLEEP) {
            self.let_islands_sleep(world, detector, config);
        }
    }

    fn let_islands_sleep(&mut self, world: &mut World, detector: &Detector, config: &SolverConfig) {
        // Islands of awake bodies, the bodies that something holds, and the bodies that touch a driven body.
        let is_dynamic = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
        let has_belt = |i: usize| world.bodies[i].materials().any(|material| material.is_driven());
        let mut held = vec![false; self.asleep.len()];
        let mut driven = vec![false; self.asleep.len()];
        self.islands.reset(self.asleep.len());
        for (a, b) in touching_or_tied(world, detector) {
            for (one, other) in [(Some(a), b), (b, Some(a))] {
                let Some(one) = one else { continue };
                held[one] = true;
                let moves = |other: usize| self.activity[other] == Activity::Moving || has_belt(other);
                driven[one] |= has_belt(one) || other.is_some_and(moves);
            }
            if let Some(b) = b.filter(|&b| is_dynamic(a) && is_dynamic(b) && !self.asleep[a] && !self.asleep[b]) {
                self.islands.join(a as u32, b as u32);
            }
        }
        let mut stays_awake = vec![false; self.asleep.len()];
        for pair in detector.pairs().filter(|pair| pair.takes_part && comes_out(pair, world, config)) {
            for body in [pair.body_a, pair.body_b].into_iter().filter(|&body| is_dynamic(body as usize)) {
                stays_awake[self.islands.root(body) as usize] = true;
            }
        }
        let awake: Vec<usize> = (0..self.asleep.len()).filter(|&i| is_dynamic(i) && !self.asleep[i]).collect();
        for &i in &awake {
            stays_awake[self.islands.root(i as u32) as usize] |=
                self.slow_for[i] < self.after || !held[i] || driven[i] || !world.bodies[i].can_sleep;
        }
        for i in awake {
            let root = self.islands.root(i as u32) as usize;
            if stays_awake[root] {
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
