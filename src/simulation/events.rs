//! What a step tells of the bodies that meet.

use glam::Vec3;

use crate::error::{Result, ensure};
use crate::saved::{Archive, Saved};
use crate::world::{BodyHandle, JointHandle};

/// What a simulation listens to: [`Simulation::listen`](crate::Simulation::listen). Whatever is off costs nothing.
///
/// Each of the three adds up impulses over the substeps of a step, so that
/// [`SolvedPoint::summed`](crate::SolvedPoint::summed) is there.
///
/// ```
/// use drystone::{Listen, Reference, Simulation, SolverConfig, World};
///
/// let mut simulation = Simulation::new(World::new(), SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// simulation.listen(Listen { hits_above: Some(0.5), ..Listen::default() })?;
/// assert!(simulation.listen(Listen { hits_above: Some(-1.0), ..Listen::default() }).is_err());
/// assert_eq!(simulation.listening().hits_above, Some(0.5));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Listen {
    /// Whether steps tell of contacts that began or ended.
    pub contacts: bool,
    /// The approach speed above which steps tell of hits, 0 or more (m/s); none for no hits. What rests approaches at up to some mm/s.
    pub hits_above: Option<f32>,
    /// Whether impulses are added up for [`Simulation::contacts_of`](crate::Simulation::contacts_of), without any event.
    pub impulses: bool,
}

crate::saved::fields!(Listen { contacts, hits_above, impulses });

impl Listen {
    /// Whether impulses are to be summed.
    pub(super) fn sums(&self) -> bool {
        self.contacts || self.impulses || self.hits_above.is_some()
    }

    pub(super) fn check(&self) -> Result<()> {
        let Some(least) = self.hits_above else { return Ok(()) };
        ensure(least >= 0.0, || format!("hits_above = {least}: must be 0 m/s or more"))
    }
}

/// A collider, by its body and its place among the colliders of that body.
///
/// ```
/// use drystone::{Body, ColliderOf, Reference, Shape, Simulation, SolverConfig, World};
///
/// let mut world = World::new();
/// let room = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 1.0, 1.0)));
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)));
/// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// simulation.step(1.0 / 60.0)?;
/// let [sensor, visitor] = [room, ball].map(|body| ColliderOf { body, collider: 0 });
/// assert_eq!(simulation.overlaps(), [[sensor, visitor]]);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ColliderOf {
    /// The body. The handle is stale where the body was removed.
    pub body: BodyHandle,
    /// Index in [`Body::colliders`](crate::Body::colliders).
    pub collider: usize,
}

crate::saved::fields!(ColliderOf { body, collider });

/// Something that happened in a step; see [`Simulation::events`](crate::Simulation::events).
///
/// ```
/// # use drystone::{Body, Event, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.8, 0.0));
/// # let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
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
    /// Two colliders touch that did not touch in the step before.
    Began {
        /// That of the body with the lesser index.
        a: ColliderOf,
        /// The other one.
        b: ColliderOf,
    },
    /// Two colliders no longer touch, or one of them is gone.
    Ended {
        /// That of the body with the lesser index.
        a: ColliderOf,
        /// The other one.
        b: ColliderOf,
    },
    /// Two colliders met fast.
    Hit(Hit),
    /// A collider overlaps a sensor that did not when the step began.
    Entered {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
    },
    /// A collider no longer overlaps a sensor, or one of them is gone.
    Left {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
    },
    /// A collider flew through a sensor: they overlapped neither when the step began nor at its end.
    Passed {
        /// The sensor.
        sensor: ColliderOf,
        /// The other collider.
        visitor: ColliderOf,
        /// When the collider met the sensor, from the begin of the step on (s).
        time: f32,
    },
    /// A joint bore more than its [`break_force`](crate::Joint::break_force), and is gone from the world.
    Broke {
        /// The joint. The handle is stale.
        joint: JointHandle,
        /// What the joint bore, the mean over the step (N).
        force: f32,
    },
}

/// Two colliders that met faster than [`Listen::hits_above`].
///
/// ```
/// # use drystone::{Body, Event, Hit, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.8, 0.0));
/// # let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
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
    /// That of the body with the lesser index.
    pub a: ColliderOf,
    /// The other one.
    pub b: ColliderOf,
    /// Where the surfaces approach fastest of all points that bear something, midway between them when the step begins (m).
    pub point: Vec3,
    /// Unit normal there, from a to b.
    pub normal: Vec3,
    /// Speed there along the normal when the surfaces meet, 0 or more (m/s).
    pub speed: f32,
    /// Sum of the normal impulses of all its points over all substeps of the step (N s). Where a step ends amid a hit, the next one tells of the
    /// hit, with the impulse of both.
    pub impulse: f32,
}

crate::saved::fields!(Hit { a, b, point, normal, speed, impulse });

/// Two colliders that touch, the body with the lesser index first.
pub(super) type Touch = [ColliderOf; 2];

/// Pairs of colliders from step to step: those of this step and of the step before, ascending.
#[derive(Debug, Default)]
pub(super) struct Touches {
    now: Vec<Touch>,
    before: Vec<Touch>,
    /// Those of this step as they came, and those of the step before.
    found: Vec<Touch>,
    found_before: Vec<Touch>,
}

crate::saved::state!(Touches { now, found } scratch { before, found_before });

impl Touches {
    /// Takes over the pairs of a step, in any order and as often as they come; calls `tell` on each that is new, and on each that is gone,
    /// ascending.
    pub fn follow(&mut self, pairs: impl Iterator<Item = Touch>, mut tell: impl FnMut(Touch, bool)) {
        std::mem::swap(&mut self.found, &mut self.found_before);
        self.found.clear();
        self.found.extend(pairs);
        // In a settled world the pairs are those of the step before, in the same order.
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

    /// Forgets all.
    pub fn forget(&mut self) {
        self.now.clear();
        self.found.clear();
    }
}

/// A hit, and the share of its speed that is left after the step; none of a hit that began in the step before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub hit: Hit,
    pub left: Option<f32>,
}

crate::saved::fields!(Met { hit, left });

/// A hit waits for the rest of its impulse while more than this share of its speed is left.
const UNFINISHED: f32 = 0.01;

/// The events of the last step, and what they follow from.
#[derive(Debug, Default)]
pub(super) struct Events {
    pub listen: Listen,
    pub all: Vec<Event>,
    contacts: Touches,
    /// Hits of this step, and those of the step before that were not over.
    pub met: Vec<Met>,
    unfinished: Vec<Met>,
    inside: Touches,
}

crate::saved::cloned!(Events { listen, all, contacts, met, unfinished, inside });

/// A state that is read has no events: they are those of a step.
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
    /// Listens to something else from the next step on.
    pub fn listen(&mut self, listen: Listen) {
        self.unfinished.clear();
        if !listen.contacts {
            self.contacts.forget();
        }
        self.listen = listen;
    }

    /// Notes the pairs that touch in a step, in any order.
    pub fn note_contacts(&mut self, touching: impl Iterator<Item = Touch>) {
        let all = &mut self.all;
        self.contacts.follow(touching, |[a, b], is_new| {
            all.push(if is_new { Event::Began { a, b } } else { Event::Ended { a, b } });
        });
    }

    /// Notes the sensors and the colliders that overlap after a step, in any order.
    pub fn note_overlaps(&mut self, overlaps: impl Iterator<Item = Touch>) {
        let all = &mut self.all;
        self.inside.follow(overlaps, |[sensor, visitor], is_new| {
            all.push(if is_new { Event::Entered { sensor, visitor } } else { Event::Left { sensor, visitor } });
        });
    }

    /// Notes the sensors and the colliders that met them on their ways through a step, ascending, with the times; after those that overlap.
    pub fn note_passed(&mut self, passed: impl Iterator<Item = (Touch, f32)>) {
        let is_inside = |pair: &Touch| self.inside.now.binary_search(pair).is_ok();
        let flew = passed.filter(|(pair, _)| !is_inside(pair));
        self.all.extend(flew.map(|([sensor, visitor], time)| Event::Passed { sensor, visitor, time }));
    }

    /// The sensors, each with the colliders that overlap it, ascending.
    pub fn inside(&self) -> &[Touch] {
        &self.inside.now
    }

    /// Whether a hit of two colliders is not over.
    pub fn waits_for(&self, [a, b]: Touch) -> bool {
        self.unfinished.binary_search_by_key(&(a, b), |met| (met.hit.a, met.hit.b)).is_ok()
    }

    /// Notes the hits of a step, in any order. Those of one pair are one. A contact stops bodies a little before their surfaces meet, and the
    /// rest of the approach a substep later: where that is in the next step, the hit waits for it.
    pub fn note_hits(&mut self, met: Vec<Met>) {
        self.met = met;
        self.met.append(&mut self.unfinished);
        // Of one pair the fastest stands first, and the order of equal ones does not follow from where their rows are.
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
