//! The joints of a world. Joints can be inserted and removed at any time.

use std::fmt;
use std::slice;

use super::joint::Joint;
use super::tag::WorldTag;

/// Identifies one joint for as long as the joint is in its world. Another world refuses it, like a
/// [`BodyHandle`](super::BodyHandle).
///
/// ```
/// use drystone::{Body, Joint, JointHandle, World, glam::Vec3};
///
/// let mut world = World::new();
/// let body = world.insert(Body::fixed());
/// let handle: JointHandle = world.insert_joint(Joint::to_world(body, Vec3::ZERO, Vec3::ZERO));
/// assert!(world.joint(handle).is_some());
/// world.remove_joint(handle);
/// assert!(world.joint(handle).is_none());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JointHandle {
    number: u32,
    generation: u32,
    tag: WorldTag,
}

/// Leaves the world tag out, like that of a [`BodyHandle`](super::BodyHandle).
impl fmt::Debug for JointHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { number, generation, tag: _ } = self;
        f.debug_struct("JointHandle").field("number", number).field("generation", generation).finish()
    }
}

crate::saved::fields!(JointHandle { number, generation } scratch { tag });

/// The joints of a world: a slice in order of insertion. When a joint is removed, the index of every later joint falls
/// by one, but its handle stays valid. Joints can be changed one by one, but must not be sorted or swapped as a slice:
/// handles would then name other joints.
///
/// ```
/// use drystone::{Body, Joint, World, glam::Vec3, world::Joints};
///
/// let mut world = World::new();
/// let body = world.insert(Body::fixed());
/// let [a, b] = [1.0, 2.0].map(|y| world.insert_joint(Joint::to_world(body, Vec3::ZERO, Vec3::Y * y)));
/// let joints: &mut Joints = &mut world.joints;
/// assert_eq!(joints.handles(), [a, b]);
/// joints.retain(|joint| joint.anchor_b.y > 1.5);
/// assert_eq!((joints.index(a), joints.index(b)), (None, Some(0)));
/// joints.iter_mut().for_each(|joint| joint.break_force = 50.0);
/// joints.clear();
/// assert!(joints.is_empty());
/// ```
#[derive(Debug, Default)]
pub struct Joints {
    all: Vec<Joint>,
    handles: Vec<JointHandle>,
    /// Generation of each number, and the index of its joint or `None` if the number is free.
    numbers: Vec<(u32, Option<u32>)>,
    /// Free numbers. The last one is used first.
    free: Vec<u32>,
    tag: WorldTag,
}

crate::saved::fields!(Joints { all, handles, numbers, free } scratch { tag });
crate::saved::cloned!(Joints { all, handles, numbers, free, tag });

impl Joints {
    /// No joints yet, for a world with this tag.
    pub(super) fn of_world(tag: WorldTag) -> Self {
        Self { tag, ..Self::default() }
    }

    /// Appends a joint.
    pub(super) fn insert(&mut self, joint: Joint) -> JointHandle {
        let number = self.free.pop().unwrap_or_else(|| {
            self.numbers.push((0, None));
            self.numbers.len() as u32 - 1
        });
        let (generation, index) = &mut self.numbers[number as usize];
        *index = Some(self.all.len() as u32);
        let handle = JointHandle { number, generation: *generation, tag: self.tag };
        self.all.push(joint);
        self.handles.push(handle);
        handle
    }

    /// Removes a joint. Returns `None` if it is already gone.
    pub(super) fn remove(&mut self, handle: JointHandle) -> Option<Joint> {
        let index = self.index(handle)?;
        let joint = self.all[index];
        let mut here = 0..;
        self.retain(|_| here.next() != Some(index));
        Some(joint)
    }

    /// Whether numbers and joints refer to each other.
    pub(crate) fn are_consistent(&self) -> bool {
        let Self { all, handles, numbers, free, tag: _ } = self;
        let is_free = |&number: &u32| numbers.get(number as usize).is_some_and(|number| number.1.is_none());
        handles.len() == all.len()
            && handles.iter().enumerate().all(|(i, &handle)| self.index(handle) == Some(i))
            && free.iter().all(is_free)
    }

    /// Keeps the joints for which `keep` returns true.
    pub fn retain(&mut self, mut keep: impl FnMut(&Joint) -> bool) {
        let mut kept = 0;
        for index in 0..self.all.len() {
            let handle = self.handles[index];
            let (generation, place) = &mut self.numbers[handle.number as usize];
            if keep(&self.all[index]) {
                *place = Some(kept as u32);
                self.all[kept] = self.all[index];
                self.handles[kept] = handle;
                kept += 1;
            } else {
                (*generation, *place) = (generation.wrapping_add(1), None);
                self.free.push(handle.number);
            }
        }
        self.all.truncate(kept);
        self.handles.truncate(kept);
    }

    /// Removes all joints.
    pub fn clear(&mut self) {
        self.retain(|_| false);
    }

    /// The index of a joint. Returns `None` if the joint is gone.
    pub fn index(&self, handle: JointHandle) -> Option<usize> {
        let &(generation, index) = self.numbers.get(handle.number as usize)?;
        index.filter(|_| generation == handle.generation && handle.tag.fits(self.tag)).map(|index| index as usize)
    }

    /// All joints, mutable.
    pub fn iter_mut(&mut self) -> slice::IterMut<'_, Joint> {
        self.all.iter_mut()
    }

    /// The handle of each joint.
    pub fn handles(&self) -> &[JointHandle] {
        &self.handles
    }
}

super::list::list!(Joints of Joint, "joint" by JointHandle, index);
