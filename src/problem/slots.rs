//! Slots of rows. A manifold keeps its slot from its first step until it ends.
//!
//! Rows stay in place. A step changes only the list of the slots that take part, in the order of the sweeps. Backends
//! are fastest if slots have this order, so [`super::ContactRows::sort`] sorts all slots once many are new. If slots
//! stay in the order of the pairs, a step of a pyramid of 125,000 boxes takes 1.12 times as long.

use crate::collide::{Change, Detector, NO_SLOT, Pair};
use crate::graph::{Edge, IMMOVABLE};
use crate::world::{BodyKind, World};

/// The part of a slot's rows that the next step writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Write {
    /// The separations of its points.
    Separations,
    /// Everything but the impulses: the manifold is the same, but masses, materials or settings differ.
    Rows,
    /// Everything: the manifold was computed anew, and its points bring their impulses.
    Computed,
    /// Everything: the slot has another manifold, which begins without impulses.
    New,
}

crate::saved::kinds!(Write { Separations, Rows, Computed, New });

#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    /// World of the pair.
    pub world: u32,
    /// Place of the pair among those of its world.
    pub pair: u32,
    /// Which manifold of the pair.
    pub manifold: u32,
    pub write: Write,
    /// Whether the contact is swept. A resting contact and a free slot are not.
    pub takes_part: bool,
    /// Half of the smallest side of the thinner shape (m).
    pub size: f32,
    /// The sag of its contact in class 0 under its lasting load, over the sag that the settings promise.
    pub need: f32,
}

crate::saved::fields!(Slot { world, pair, manifold, write, takes_part, size, need });

pub(super) const FREE: Slot =
    Slot { world: u32::MAX, pair: 0, manifold: 0, write: Write::Separations, takes_part: false, size: 0.0, need: 0.0 };

impl Slot {
    /// Whether no manifold has the slot.
    pub fn is_free(&self) -> bool {
        self.world == FREE.world
    }
}

/// All slots, including the free ones.
#[derive(Debug, Default)]
pub(super) struct Slots {
    pub all: Vec<Slot>,
    /// The edges that the graph colors, one for each slot.
    pub edges: Vec<Edge>,
    /// The colliders of each slot, by their indices among those of their bodies a and b.
    pub colliders: Vec<[u32; 2]>,
    pub free: Vec<u32>,
    /// Number of slots taken since the last sort.
    pub taken: usize,
}

crate::saved::cloned!(Slots { all, edges, colliders, free, taken });

impl Slots {
    /// Follows the detector: new manifolds take slots, and manifolds that ended free theirs.
    pub fn follow(&mut self, world: &World, detector: &mut Detector) {
        detector.take_changes(&mut |change| match change {
            Change::Ended(slot) => self.release(slot),
            Change::Pair { place, pair, computed } => self.follow_pair(world, place, pair, computed),
        });
    }

    fn follow_pair(&mut self, world: &World, [part, i]: [u32; 2], pair: &mut Pair, computed: bool) {
        pair.manifolds.retain(|manifold| {
            if manifold.has_ended() {
                self.release(manifold.slot);
            }
            !manifold.has_ended()
        });
        let movable = |body: u32| if world.bodies[body as usize].kind == BodyKind::Dynamic { body } else { IMMOVABLE };
        let (a, b, takes_part) = (movable(pair.body_a), movable(pair.body_b), pair.takes_part);
        let rank = pair.rank();
        for (k, manifold) in (0..).zip(&mut pair.manifolds) {
            let is_new = manifold.slot == NO_SLOT;
            if is_new {
                manifold.slot = self.take();
            }
            let slot = &mut self.all[manifold.slot as usize];
            let wakes = takes_part && !slot.takes_part;
            let write = match (is_new, computed, wakes) {
                (true, ..) => Write::New,
                (_, true, _) => Write::Computed,
                (.., true) => Write::Rows,
                _ => Write::Separations,
            };
            let need = if is_new { 0.0 } else { slot.need };
            *slot = Slot {
                world: part,
                pair: i,
                manifold: k,
                write: slot.write.max(write),
                takes_part,
                size: pair.size,
                need,
            };
            self.colliders[manifold.slot as usize] = pair.colliders;
            let edge = &mut self.edges[manifold.slot as usize];
            *edge = Edge { a, b, color: edge.color, rank: rank | u64::from(k) };
        }
    }

    /// The slot and edge of the manifold `k` of a pair as [`Self::follow`] leaves them, if only separations are to be
    /// written.
    pub fn settled(kinds: &[BodyKind], [world, i]: [u32; 2], pair: &Pair, k: u32) -> (Slot, Edge) {
        let movable = |body: u32| if kinds[body as usize] == BodyKind::Dynamic { body } else { IMMOVABLE };
        let slot = Slot { world, pair: i, manifold: k, takes_part: pair.takes_part, size: pair.size, ..FREE };
        let rank = pair.rank() | u64::from(k);
        (slot, Edge { a: movable(pair.body_a), b: movable(pair.body_b), color: None, rank })
    }

    fn take(&mut self) -> u32 {
        self.taken += 1;
        if let Some(slot) = self.free.pop() {
            return slot;
        }
        self.all.push(FREE);
        self.colliders.push([0; 2]);
        self.edges.push(Edge { a: IMMOVABLE, b: IMMOVABLE, color: None, rank: 0 });
        self.all.len() as u32 - 1
    }

    fn release(&mut self, slot: u32) {
        self.all[slot as usize] = FREE;
        self.edges[slot as usize].color = None;
        self.free.push(slot);
    }

    /// Lets the next step write all rows again.
    pub fn write_again(&mut self) {
        let taken = self.all.iter_mut().filter(|slot| !slot.is_free());
        taken.for_each(|slot| slot.write = slot.write.max(Write::Rows));
    }

    /// Whether enough slots are new that it pays to sort all: more than half of the slots in use.
    pub fn are_unsorted(&self) -> bool {
        2 * self.taken > self.all.len() - self.free.len()
    }

    /// Sorts slots into an `order` that begins with those that take part. Returns the former place of each. Free slots
    /// vanish.
    pub fn sort(&mut self, order: &[u32], detector: &mut Detector) -> Vec<u32> {
        self.free.clear();
        let resting = (0..).zip(&self.all).filter(|(_, slot)| !slot.takes_part && !slot.is_free()).map(|(i, _)| i);
        let from: Vec<u32> = order.iter().copied().chain(resting).collect();
        self.all = from.iter().map(|&slot| self.all[slot as usize]).collect();
        self.edges = from.iter().map(|&slot| self.edges[slot as usize]).collect();
        self.colliders = from.iter().map(|&slot| self.colliders[slot as usize]).collect();
        for (i, slot) in (0..).zip(&self.all) {
            detector.pair_mut(slot.world, slot.pair).manifolds[slot.manifold as usize].slot = i;
        }
        self.taken = 0;
        from
    }

    /// The slots that take part, in ascending order.
    pub fn taking_part(&self) -> impl Iterator<Item = u32> {
        (0..).zip(&self.all).filter(|(_, slot)| slot.takes_part).map(|(i, _)| i)
    }
}
