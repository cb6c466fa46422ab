//! The bodies of a world. Bodies can be inserted and removed at any time.

use std::fmt;
use std::slice;

use glam::{Quat, Vec3};

use super::body::{Body, BodyKind};
use super::tag::WorldTag;
use crate::error::{Result, ensure, input};
use crate::saved::{Archive, Columns, Saved};

/// Identifies one body for as long as the body is in its world. After the body is removed, its handle names nothing:
/// the next body at the same index gets another handle.
///
/// A world refuses handles of an unrelated world ([`World::new`](super::World::new)). A world, its clones, its forks
/// and its snapshots accept each other's handles. A world that was loaded, and [`Bodies`] that were collected from an
/// iterator, have no identity: they accept any handle, and any world accepts theirs. Handles compare by index and
/// generation alone, so handles of two worlds can be equal.
///
/// The default handle names no body.
///
/// ```
/// use drystone::{Body, BodyHandle, World};
///
/// let mut world = World::new();
/// let handle: BodyHandle = world.insert(Body::fixed());
/// assert_eq!(handle.index(), 0);
/// world.remove(handle);
/// // Another body gets the index, but not the handle.
/// let other = world.insert(Body::fixed());
/// assert!(other.index() == 0 && other != handle);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle {
    index: u32,
    generation: u32,
    tag: WorldTag,
}

crate::saved::fields!(BodyHandle { index, generation } scratch { tag });

/// Leaves the world tag out: its number differs in each process.
impl fmt::Debug for BodyHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { index, generation, tag: _ } = self;
        f.debug_struct("BodyHandle").field("index", index).field("generation", generation).finish()
    }
}

/// As its index.
#[cfg(feature = "serde")]
impl serde::Serialize for BodyHandle {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        self.index().serialize(serializer)
    }
}

/// Names no body.
impl Default for BodyHandle {
    fn default() -> Self {
        Self { index: u32::MAX, generation: 0, tag: WorldTag::default() }
    }
}

impl BodyHandle {
    /// Whether both handles name the same body of the same world. Tags can only tell worlds apart if both worlds have
    /// one.
    pub(crate) fn is(self, other: Self) -> bool {
        self == other && self.tag.fits(other.tag)
    }

    /// The index of the body in [`World::bodies`](super::World::bodies).
    pub fn index(self) -> usize {
        self.index as usize
    }
}

/// The bodies of one world, or of several worlds that share this list. It acts as a slice in which a body keeps its
/// index until it is removed.
///
/// A removed body leaves a vacancy: a fixed body without shapes. The next body of the same world fills it. Indices
/// depend only on the order of the calls. Bodies can be changed one by one, but must not be sorted or swapped as a
/// slice: handles would then name other bodies. [`World::check`](super::World::check) and the next step refuse a body
/// that was written to a vacancy.
///
/// ```
/// use drystone::{Body, World, world::Bodies};
///
/// let mut world = World::new();
/// let [a, b] = ["a", "b"].map(|name| world.insert(Body::fixed().named(name)));
/// world.remove(a);
/// let bodies: &Bodies = &world.bodies;
/// assert!(!bodies.contains(a) && bodies.contains(b));
/// assert_eq!((bodies.len(), bodies.count(), bodies.world_count()), (2, 1, 1));
/// assert_eq!((bodies.handle(0), bodies.handle(1)), (None, Some(b)));
/// assert!(bodies.handles().eq([b]));
/// assert_eq!(bodies.worlds(), [0, 0]);
///
/// world.bodies.iter_mut().for_each(|body| body.material.friction = 0.2);
/// world.body_mut(b).expect("b").material.friction = 0.8;
/// assert_eq!([0, 1].map(|i| world.bodies[i].material.friction), [0.2, 0.8]);
/// ```
///
/// ```compile_fail
/// # use drystone::{Body, World};
/// # let mut world = World::new();
/// # [(); 2].map(|()| world.insert(Body::fixed()));
/// world.bodies.swap(0, 1);
/// ```
#[derive(Debug, Default)]
pub struct Bodies {
    all: Vec<Body>,
    /// Generation of each index: even while a body is there, odd while the index is vacant.
    generations: Vec<u32>,
    /// The world of each index.
    worlds: Vec<u32>,
    /// Vacant indices of each world. The last one is filled first.
    pub(super) vacant: Vec<Vec<u32>>,
    tag: WorldTag,
}

crate::saved::cloned!(Bodies { all, generations, worlds, vacant, tag });

/// Column indices in a saved file: position, two for the rotation, whether the body moves, and its velocities.
const PLACE: usize = 0;
const ROTATION: usize = 3;
const MOVES: usize = 5;
const VELOCITY: usize = 6;

impl Saved for Bodies {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { all, generations, worlds, vacant, tag: _ } = self;
        let count = archive.count(all.len())?;
        if A::READS {
            all.resize(count, Body::fixed());
            generations.resize(count, 0);
            worlds.resize(count, 0);
        }
        archive.runs(count, |i, archive| {
            generations[i].walk(archive)?;
            worlds[i].walk(archive)?;
            all[i].walk_rest(archive)
        })?;
        let motions = archive.chunks(count, VELOCITY + 2, |range, columns| {
            let mut motions = Vec::new();
            let mut last = Motion { place: Vec3::ZERO, rotation: Quat::IDENTITY, velocities: [Vec3::ZERO; 2] };
            for body in &all[range] {
                let mut motion =
                    if columns.reads() { Motion { velocities: [Vec3::ZERO; 2], ..last } } else { Motion::of(body) };
                motion.walk(&last, columns)?;
                last = motion;
                if columns.reads() {
                    motions.push(motion);
                }
            }
            Ok(motions)
        })?;
        for (body, motion) in all.iter_mut().zip(motions.into_iter().flatten()) {
            (body.position, body.rotation) = (motion.place, motion.rotation);
            [body.linear_velocity, body.angular_velocity] = motion.velocities;
        }
        vacant.walk(archive)
    }
}

/// Pose and velocity of a body.
#[derive(Clone, Copy)]
struct Motion {
    place: Vec3,
    rotation: Quat,
    velocities: [Vec3; 2],
}

impl Motion {
    fn of(body: &Body) -> Self {
        let velocities = [body.linear_velocity, body.angular_velocity];
        Self { place: body.position, rotation: body.rotation, velocities }
    }

    /// Writes or reads it as a difference from the body before.
    fn walk(&mut self, last: &Self, columns: &mut Columns) -> Result<()> {
        let Self { place, rotation, velocities } = self;
        for k in 0..3 {
            columns.near(PLACE + k, &mut place[k], last.place[k])?;
        }
        columns.near_rotation(ROTATION, rotation, last.rotation)?;
        let mut moves = u8::from(velocities.iter().flat_map(|v| v.to_array()).any(|x| x.to_bits() != 0));
        columns.byte(MOVES, &mut moves)?;
        if moves != 0 {
            for (column, velocity) in (VELOCITY..).zip(velocities) {
                (0..3).try_for_each(|k| columns.float(column, &mut velocity[k]))?;
            }
        }
        Ok(())
    }
}

impl Bodies {
    /// No bodies yet, for a world with this tag.
    pub(super) fn of_world(tag: WorldTag) -> Self {
        Self { tag, ..Self::default() }
    }

    /// Inserts a body into an existing world, or into a new one after the last.
    pub(super) fn insert(&mut self, world: usize, body: Body) -> BodyHandle {
        if self.vacant.len() <= world {
            self.vacant.resize(world + 1, Vec::new());
        }
        let Some(index) = self.vacant[world].pop() else {
            self.all.push(body);
            self.generations.push(0);
            self.worlds.push(world as u32);
            return BodyHandle { index: self.all.len() as u32 - 1, generation: 0, tag: self.tag };
        };
        let generation = &mut self.generations[index as usize];
        *generation = generation.wrapping_add(1);
        self.all[index as usize] = body;
        BodyHandle { index, generation: *generation, tag: self.tag }
    }

    /// Removes a body. Returns `None` if it is already gone.
    pub(super) fn remove(&mut self, handle: BodyHandle) -> Option<Body> {
        if !self.contains(handle) {
            return None;
        }
        let index = handle.index();
        self.generations[index] = self.generations[index].wrapping_add(1);
        self.vacant[self.worlds[index] as usize].push(handle.index);
        Some(std::mem::replace(&mut self.all[index], Body::fixed()))
    }

    /// Appends the bodies and vacancies of another list as worlds of their own.
    pub(super) fn append(&mut self, other: &Self) {
        let (first, world) = (self.all.len() as u32, self.world_count() as u32);
        self.vacant.resize(world as usize, Vec::new());
        self.all.extend_from_slice(&other.all);
        self.generations.extend_from_slice(&other.generations);
        self.worlds.extend(other.worlds.iter().map(|of| world + of));
        let vacant = (0..other.world_count()).map(|k| other.vacant.get(k).map_or(&[][..], Vec::as_slice));
        self.vacant.extend(vacant.map(|own| own.iter().map(|index| first + index).collect::<Vec<_>>()));
    }

    /// Grows or shrinks the list to `count` indices.
    pub(super) fn resize(&mut self, count: usize) {
        self.all.resize(count, Body::fixed());
        self.generations.resize(count, 0);
        self.worlds.resize(count, 0);
    }

    /// Sets the generation and the world of the body at an index.
    pub(super) fn set_place(&mut self, index: usize, generation: u32, world: u32) {
        (self.generations[index], self.worlds[index]) = (generation, world);
    }

    /// Whether the handle names a body that is still in this world.
    pub fn contains(&self, handle: BodyHandle) -> bool {
        self.generations.get(handle.index()) == Some(&handle.generation) && handle.tag.fits(self.tag)
    }

    /// The index of the body that the handle names, if it is still in this world.
    pub(crate) fn index_of(&self, handle: BodyHandle) -> Option<usize> {
        self.contains(handle).then_some(handle.index())
    }

    /// Converts a handle of `other` after `other` was appended at index `first`. The result names no body if the handle
    /// names none in `other`.
    pub(super) fn appended(&self, body: BodyHandle, first: usize, other: &Self) -> BodyHandle {
        let generation = if other.contains(body) { body.generation } else { u32::MAX };
        BodyHandle { index: body.index.saturating_add(first as u32), generation, tag: self.tag }
    }

    /// Refuses a handle that names no body here.
    pub(super) fn check_handle(&self, handle: BodyHandle) -> Result<()> {
        let (index, count) = (handle.index(), self.all.len());
        if self.contains(handle) && !self.is_vacant(index) {
            return Ok(());
        }
        Err(match self.all.get(index) {
            _ if !handle.tag.fits(self.tag) => input!("names body {index} of another world"),
            None => input!("names body {index}, beyond the last of {count}"),
            Some(_) if self.is_vacant(index) => input!("names body {index}, which was removed"),
            Some(other) => input!("names body {index}, which was removed: {:?} has its index now", other.name),
        })
    }

    /// Refuses a body that was written to a vacancy.
    pub(super) fn check_place(&self, index: usize) -> Result<()> {
        let body = &self.all[index];
        let is_empty = body.kind == BodyKind::Fixed && body.colliders.is_empty();
        ensure(is_empty || !self.is_vacant(index), || {
            "written to a vacant index: use World::insert to add a body".into()
        })
    }

    /// A mutable body by its index. Returns `None` beyond the last index.
    pub(crate) fn get_mut(&mut self, index: usize) -> Option<&mut Body> {
        self.all.get_mut(index)
    }

    /// All bodies and vacancies, mutable.
    pub fn iter_mut(&mut self) -> slice::IterMut<'_, Body> {
        self.all.iter_mut()
    }

    /// The same as a slice, to split among threads.
    pub(crate) fn as_mut_slice(&mut self) -> &mut [Body] {
        &mut self.all
    }

    /// The handle of the body at an index. Returns `None` if the index is vacant or beyond the last.
    pub fn handle(&self, index: usize) -> Option<BodyHandle> {
        let generation = self.generations.get(index).copied().filter(|generation| generation % 2 == 0)?;
        Some(BodyHandle { index: index as u32, generation, tag: self.tag })
    }

    /// The handles of all bodies, ascending by index.
    pub fn handles(&self) -> impl Iterator<Item = BodyHandle> {
        (0..self.all.len()).filter_map(|index| self.handle(index))
    }

    /// Number of bodies, without vacancies.
    pub fn count(&self) -> usize {
        self.all.len() - self.vacant.iter().map(Vec::len).sum::<usize>()
    }

    /// Whether no body is at an index.
    pub(crate) fn is_vacant(&self, index: usize) -> bool {
        self.handle(index).is_none()
    }

    /// The number of worlds, at least one.
    pub fn world_count(&self) -> usize {
        self.vacant.len().max(1)
    }

    /// The world of each index.
    pub fn worlds(&self) -> &[u32] {
        &self.worlds
    }

    /// Whether every index that a body, a vacancy or a world names exists.
    pub(crate) fn are_consistent(&self) -> bool {
        let Self { all, generations, worlds, vacant, tag: _ } = self;
        let is_vacant = |&i: &u32| generations.get(i as usize).is_some_and(|generation| generation % 2 == 1);
        let fits = |&world: &u32| (world as usize) < vacant.len();
        generations.len() == all.len()
            && worlds.len() == all.len()
            && worlds.iter().all(fits)
            && vacant.iter().flatten().all(is_vacant)
    }

    /// The generation of each index. It changes whenever a body is inserted or removed there.
    pub(crate) fn generations(&self) -> &[u32] {
        &self.generations
    }
}

super::list::list!(Bodies of Body, "body" by BodyHandle, index_of);

impl IntoIterator for Bodies {
    type Item = Body;
    type IntoIter = std::vec::IntoIter<Body>;
    fn into_iter(self) -> Self::IntoIter {
        self.all.into_iter()
    }
}

impl FromIterator<Body> for Bodies {
    fn from_iter<B: IntoIterator<Item = Body>>(bodies: B) -> Self {
        let mut all = Self::default();
        bodies.into_iter().for_each(|body| {
            all.insert(0, body);
        });
        all
    }
}
