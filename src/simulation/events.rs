//! The events of a step.

use glam::Vec3;

use crate::constants::UNFINISHED;
use crate::error::{Result, ensure};
use crate::saved::{Archive, Saved};
use crate::world::{BodyHandle, JointHandle};

/// The events that a simulation reports: see [`Simulation::listen`](crate::Simulation::listen). An option that is off
/// costs nothing.
///
/// Each of the three options makes a step sum impulses over its substeps, so that
/// [`SolvedPoint::summed`](crate::SolvedPoint::summed) is available, and forces of joints are means over the step.
///
/// ```
/// use drystone::{Listen, Simulation, World};
///
/// let mut simulation = Simulation::new(World::new())?;
/// simulation.listen(Listen { hits_above: Some(0.5), ..Listen::default() })?;
/// assert!(simulation.listen(Listen { hits_above: Some(-1.0), ..Listen::default() }).is_err());
/// assert_eq!(simulation.listening().hits_above, Some(0.5));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Listen {
    /// Whether steps report contacts that began or ended.
    pub contacts: bool,
    /// The approach speed above which steps report hits, 0 or more (m/s); `None` reports no hits. Bodies at rest
    /// approach at up to a few mm/s.
    pub hits_above: Option<f32>,
    /// Whether steps sum impulses for [`Simulation::contacts_of`](crate::Simulation::contacts_of) and
    /// [`Simulation::joint_force`](crate::Simulation::joint_force), without any event.
    pub impulses: bool,
}

crate::saved::fields!(Listen { contacts, hits_above, impulses });

impl Listen {
    /// Whether steps sum impulses.
    pub(super) fn sums(&self) -> bool {
        self.contacts || self.impulses || self.hits_above.is_some()
    }

    pub(super) fn check(&self) -> Result<()> {
        let Some(least) = self.hits_above else { return Ok(()) };
        ensure(least >= 0.0, || format!("hits_above = {least}: must be 0 m/s or more"))
    }
}

/// A collider: its body, and its index on that body.
///
/// ```
/// use drystone::{Body, ColliderOf, Shape, Simulation, World};
///
/// let mut world = World::new();
/// let room = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 1.0, 1.0)));
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)));
/// let mut simulation = Simulation::new(world)?;
/// simulation.step(1.0 / 60.0)?;
/// let [sensor, visitor] = [room, ball].map(|body| ColliderOf { body, collider: 0 });
/// assert_eq!(simulation.overlaps(), [[sensor, visitor]]);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ColliderOf {
    /// The body. The handle is stale if the body was removed.
    pub body: BodyHandle,
    /// Index in [`Body::colliders`](crate::Body::colliders).
    pub collider: usize,
}

crate::saved::fields!(ColliderOf { body, collider });

/// An event of a step; see [`Simulation::events`](crate::Simulation::events).
///
/// ```
/// # use drystone::{Body, Event, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.8, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// simulation.listen(Listen { contacts: true, ..Listen::default() })?;
/// let mut landed = false;
/// for _ in 0..60 {
///     simulation.step(1.0 / 60.0)?;
///     for event in simulation.events() {
///         match event {
///             Event::Began { b, .. } => landed |= b.body == ball,
///             Event::Ended { .. } => panic!("the ball does not bounce"),
///             _ => {}
///         }
///     }
/// }
/// assert!(landed);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// Two colliders began to touch in this step.
    Began {
        /// The collider of the body with the smaller index.
        a: ColliderOf,
        /// The other collider.
        b: ColliderOf,
    },
    /// Two colliders no longer touch, or one of them was removed.
    Ended {
        /// The collider of the body with the smaller index.
        a: ColliderOf,
        /// The other collider.
        b: ColliderOf,
    },
    /// Two colliders met at high speed.
    Hit(Hit),
    /// A collider began to overlap a sensor in this step.
    Entered {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
    },
    /// A collider no longer overlaps a sensor, or one of them was removed.
    Left {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
    },
    /// A collider flew through a sensor: they overlapped neither at the start of the step nor at its end.
    Passed {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
        /// When the collider met the sensor, from the start of the step (s).
        time: f32,
    },
    /// A joint carried more than its [`break_force`](crate::Joint::break_force), and the step removed it from the
    /// world.
    Broke {
        /// The joint. The handle is stale.
        joint: JointHandle,
        /// The force that the joint carried, averaged over the step (N).
        force: f32,
    },
}

/// Two colliders that met faster than [`Listen::hits_above`].
///
/// ```
/// # use drystone::{Body, Event, Hit, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.8, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// simulation.listen(Listen { hits_above: Some(1.0), ..Listen::default() })?;
/// let mut hits: Vec<Hit> = Vec::new();
/// for _ in 0..60 {
///     simulation.step(1.0 / 60.0)?;
///     hits.extend(simulation.events().iter().filter_map(|event| if let Event::Hit(hit) = event { Some(*hit) } else { None }));
/// }
/// // A ball of 524 kg that fell by 0.3 m.
/// let [Hit { speed, normal, impulse, .. }] = hits[..] else { panic!("{hits:?}") };
/// assert!((speed - 2.43).abs() < 0.01 && normal == Vec3::Y && impulse > 1200.0);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The collider of the body with the smaller index.
    pub a: ColliderOf,
    /// The other collider.
    pub b: ColliderOf,
    /// The contact point with the highest approach speed among points that carry an impulse, midway between the
    /// surfaces at the start of the step (m).
    pub point: Vec3,
    /// Unit normal at the point, from a to b.
    pub normal: Vec3,
    /// Approach speed along the normal at the point when the surfaces meet, 0 or more (m/s).
    pub speed: f32,
    /// Sum of the normal impulses of all points over all substeps of the step (N s). If a step ends during a hit, the
    /// next step reports the hit with the impulse of both steps.
    pub impulse: f32,
}

crate::saved::fields!(Hit { a, b, point, normal, speed, impulse });

/// Two colliders that touch. The body with the smaller index comes first.
pub(super) type Touch = [ColliderOf; 2];

/// Pairs of colliders of this step and of the step before, sorted.
#[derive(Debug, Default)]
pub(super) struct Touches {
    now: Vec<Touch>,
    before: Vec<Touch>,
    /// The pairs of this step in the order of arrival, and those of the step before.
    found: Vec<Touch>,
    found_before: Vec<Touch>,
}

crate::saved::state!(Touches { now, found } scratch { before, found_before });

impl Touches {
    /// Takes the pairs of a step, in any order and with repetitions. It calls `tell` for each pair that is new and for
    /// each pair that is gone, in sorted order.
    pub fn follow(&mut self, pairs: impl Iterator<Item = Touch>, mut tell: impl FnMut(Touch, bool)) {
        std::mem::swap(&mut self.found, &mut self.found_before);
        self.found.clear();
        self.found.extend(pairs);
        // In a settled world, the pairs are usually the same in the same order.
        if self.found == self.found_before {
            return;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.clone_from(&self.found);
        rayon::slice::ParallelSliceMut::par_sort_unstable(&mut self.now[..]);
        self.now.dedup();
        let (mut now, mut before) = (self.now.iter().peekable(), self.before.iter().peekable());
        loop {
            let (is_new, is_gone) = match (now.peek(), before.peek()) {
                (None, None) => break,
                (Some(now), Some(before)) => (now <= before, before <= now),
                (now, before) => (now.is_some(), before.is_some()),
            };
            match (now.next_if(|_| is_new), before.next_if(|_| is_gone)) {
                (Some(&touch), None) => tell(touch, true),
                (None, Some(&touch)) => tell(touch, false),
                _ => {}
            }
        }
    }

    /// Discards all pairs.
    pub fn forget(&mut self) {
        self.now.clear();
        self.found.clear();
    }
}

/// A hit, and the share of its speed that remains after the step. The share is `None` for a hit that began in the step
/// before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub hit: Hit,
    pub left: Option<f32>,
}

crate::saved::fields!(Met { hit, left });

/// The events of the last step, and the state to derive them.
#[derive(Debug, Default)]
pub(super) struct Events {
    pub listen: Listen,
    pub all: Vec<Event>,
    contacts: Touches,
    /// Hits of this step, and hits of the step before that were not complete.
    pub met: Vec<Met>,
    unfinished: Vec<Met>,
    inside: Touches,
}

crate::saved::cloned!(Events { listen, all, contacts, met, unfinished, inside });

/// Loaded state has no events: events belong to one step.
impl Saved for Events {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { listen, all: _, contacts, met: _, unfinished, inside } = self;
        listen.walk(archive)?;
        contacts.walk(archive)?;
        unfinished.walk(archive)?;
        inside.walk(archive)
    }
}

impl Events {
    /// Sets the events to report from the next step on.
    pub fn listen(&mut self, listen: Listen) {
        self.unfinished.clear();
        if !listen.contacts {
            self.contacts.forget();
        }
        self.listen = listen;
    }

    /// Records the pairs that touch in a step, in any order.
    pub fn note_contacts(&mut self, touching: impl Iterator<Item = Touch>) {
        let all = &mut self.all;
        self.contacts.follow(touching, |[a, b], is_new| {
            all.push(if is_new { Event::Began { a, b } } else { Event::Ended { a, b } });
        });
    }

    /// Records the sensors and the colliders that overlap them after a step, in any order.
    pub fn note_overlaps(&mut self, overlaps: impl Iterator<Item = Touch>) {
        let all = &mut self.all;
        self.inside.follow(overlaps, |[sensor, visitor], is_new| {
            all.push(if is_new { Event::Entered { sensor, visitor } } else { Event::Left { sensor, visitor } });
        });
    }

    /// Records the sensors and the colliders that passed through them in a step, sorted, with the times. Call it after
    /// `note_overlaps`.
    pub fn note_passed(&mut self, passed: impl Iterator<Item = (Touch, f32)>) {
        let is_inside = |pair: &Touch| self.inside.now.binary_search(pair).is_ok();
        let flew = passed.filter(|(pair, _)| !is_inside(pair));
        self.all.extend(flew.map(|([sensor, visitor], time)| Event::Passed { sensor, visitor, time }));
    }

    /// Pairs of a sensor and a collider that overlaps it, sorted.
    pub fn inside(&self) -> &[Touch] {
        &self.inside.now
    }

    /// Whether a hit of two colliders is not complete.
    pub fn waits_for(&self, [a, b]: Touch) -> bool {
        self.unfinished.binary_search_by_key(&(a, b), |met| (met.hit.a, met.hit.b)).is_ok()
    }

    /// Records the hits of a step, in any order, and merges the hits of one pair. A contact stops bodies a little
    /// before their surfaces meet, and the next substep stops the rest of the approach. If that substep is in the next
    /// step, the hit waits for it.
    pub fn note_hits(&mut self, met: Vec<Met>) {
        self.met = met;
        self.met.append(&mut self.unfinished);
        // Sort the fastest hit of a pair first. The order of equal hits must not depend on the places of their rows.
        let pair = |met: &Met| (met.hit.a, met.hit.b);
        let point = |met: &Met| met.hit.point.to_array().map(f32::to_bits);
        self.met.sort_unstable_by(|x, y| {
            let faster = || y.hit.speed.total_cmp(&x.hit.speed);
            pair(x).cmp(&pair(y)).then_with(faster).then_with(|| point(x).cmp(&point(y)))
        });
        for own in self.met.chunk_by(|x, y| pair(x) == pair(y)) {
            let hit = Hit { impulse: own.iter().map(|met| met.hit.impulse).sum(), ..own[0].hit };
            let waited = own.iter().any(|met| met.left.is_none());
            if !waited && own[0].left.is_some_and(|left| left > UNFINISHED) {
                self.unfinished.push(Met { hit, left: None });
            } else {
                self.all.push(Event::Hit(hit));
            }
        }
    }
}
