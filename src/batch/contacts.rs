//! Contacts and events of many worlds, in columns.

use super::Member;
use crate::simulation::{Contact, Event, Hit};
use crate::world::{BodyHandle, JointHandle};

/// Contacts of some worlds. The contacts of one world are contiguous, in the order of the requested worlds, and so are
/// the points of one contact. Within a world, contacts are sorted by pairs of bodies. The order is the same on every
/// machine.
///
/// ```
/// use drystone::batch::{Batch, Contacts};
/// use drystone::{Listen, SolverConfig};
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &["n=2".into()])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 2)?;
/// for world in batch.worlds_mut() {
///     world.simulation_mut().listen(Listen { impulses: true, ..Listen::default() })?;
/// }
/// batch.step(30, &[0, 1])?;
/// let Contacts { world_start, bodies, impulse, point_start, .. } = batch.contacts(&[0, 1])?;
/// assert_eq!((world_start, &bodies[..2], point_start.len()), (vec![0, 2, 4], &[[0, 1], [1, 2]][..], 5));
/// assert!(impulse[0][1] > impulse[1][1], "the lower one carries more");
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// The index of the first contact of each world, and the end of the last world.
    pub world_start: Vec<u32>,
    /// Bodies a and b of each contact.
    pub bodies: Vec<[u32; 2]>,
    /// Unit normal from a to b.
    pub normal: Vec<[f32; 3]>,
    /// Impulse on b over the whole step (N s); zero unless the simulation listens.
    pub impulse: Vec<[f32; 3]>,
    /// The index of the first point of each contact, and the end of the last contact.
    pub point_start: Vec<u32>,
    /// Position of each point, midway between the surfaces (m).
    pub point: Vec<[f32; 3]>,
    /// Distance of the surfaces along the normal at the start of the step (m).
    pub separation: Vec<f32>,
    /// Normal impulse on b over the whole step (N s); zero unless the simulation listens.
    pub point_impulse: Vec<f32>,
}

impl Contacts {
    pub(super) fn of<'a>(members: impl Iterator<Item = &'a Member>) -> Self {
        let mut all = Self { world_start: vec![0], point_start: vec![0], ..Self::default() };
        for member in members {
            let mut own: Vec<Contact> = member.simulation().contacts().collect();
            own.sort_by_cached_key(order);
            own.iter().for_each(|contact| all.push(contact));
            all.world_start.push(all.bodies.len() as u32);
        }
        all
    }

    fn push(&mut self, contact: &Contact) {
        let Contact { a, b, normal, impulse, .. } = contact;
        self.bodies.push([a.body.index() as u32, b.body.index() as u32]);
        self.normal.push(normal.to_array());
        self.impulse.push(impulse.to_array());
        for point in contact.points() {
            self.point.push(point.position.to_array());
            self.separation.push(point.separation);
            self.point_impulse.push(point.impulse);
        }
        self.point_start.push(self.point.len() as u32);
    }
}

/// Sort key: bodies, then colliders, then positions, because parts of two shapes can have several contacts.
fn order(contact: &Contact) -> impl Ord + use<> {
    let (a, b) = (contact.a, contact.b);
    let pair = [a.body.index().min(b.body.index()), a.body.index().max(b.body.index()), a.collider, b.collider];
    let places: Vec<u32> = contact.points().iter().flat_map(|p| p.position.to_array()).map(f32::to_bits).collect();
    (pair, places)
}

/// An event of a step: an [`Event`] with the indices of its bodies.
///
/// ```
/// use drystone::batch::{Batch, EventRow};
/// use drystone::{Listen, SolverConfig};
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &["n=1".into()])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 2)?;
/// for world in batch.worlds_mut() {
///     world.simulation_mut().listen(Listen { contacts: true, ..Listen::default() })?;
/// }
/// batch.step(1, &[0, 1])?;
/// let events = batch.events(&[0, 1])?;
/// let bodies = |world| [0, 1].map(|i| batch.world(world).simulation().world.bodies.handle(i));
/// let began = |world| EventRow { world, kind: "began", bodies: bodies(world as usize), joint: None, value: 0.0 };
/// assert_eq!(events, [began(0), began(1)]);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventRow {
    /// The world.
    pub world: u32,
    /// One of began, ended, hit, entered, left, passed and broke.
    pub kind: &'static str,
    /// The body with the smaller index, or the body of the sensor, and the other body; `None` for a joint.
    pub bodies: [Option<BodyHandle>; 2],
    /// The joint that broke.
    pub joint: Option<JointHandle>,
    /// Speed of a hit (m/s), time of a passage within the step (s), or force on a broken joint (N); else 0.
    pub value: f32,
}

pub(super) fn events(world: usize, member: &Member) -> impl Iterator<Item = EventRow> + '_ {
    member.simulation().events().iter().map(move |event| {
        let (kind, bodies, value) = match event {
            Event::Began { a, b } => ("began", Some((a, b)), 0.0),
            Event::Ended { a, b } => ("ended", Some((a, b)), 0.0),
            Event::Hit(Hit { a, b, speed, .. }) => ("hit", Some((a, b)), *speed),
            Event::Entered { sensor, visitor } => ("entered", Some((sensor, visitor)), 0.0),
            Event::Left { sensor, visitor } => ("left", Some((sensor, visitor)), 0.0),
            Event::Passed { sensor, visitor, time } => ("passed", Some((sensor, visitor)), *time),
            Event::Broke { force, .. } => ("broke", None, *force),
        };
        let bodies = bodies.map_or([None; 2], |(a, b)| [a, b].map(|side| Some(side.body)));
        let joint = if let Event::Broke { joint, .. } = event { Some(*joint) } else { None };
        EventRow { world: world as u32, kind, bodies, joint, value }
    })
}
