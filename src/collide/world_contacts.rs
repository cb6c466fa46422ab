//! The colliders of one world: which of them are near each other, and what they touch with.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, DefaultHasher};

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rayon::prelude::*;

use super::collider::{BodyState, ColliderInfo, CuboidPlace, FARTHEST, Margins};
use super::manifold::NO_SLOT;
use super::narrow::{Narrow, Scratch, Updated};
use super::pairs::Pairs;
use super::report::{Activity, Change, DetectStats};
use crate::world::BodyKind;

/// The input of one detection, for all worlds; body indices count over all worlds.
pub(super) struct DetectionInput<'a> {
    pub margins: Margins,
    pub kinds: &'a [BodyKind],
    pub moving: &'a [BodyState],
    pub activity: &'a [Activity],
    /// Pairs of bodies that a joint keeps from colliding, the smaller index first.
    pub jointed: &'a HashSet<(u32, u32)>,
}

/// The colliders of one world, which meet no others.
#[derive(Clone, Default)]
pub(super) struct WorldContacts {
    colliders: Vec<ColliderInfo>,
    /// The same, of those that are cuboids.
    cuboids: Vec<CuboidPlace>,
    unbounded: Vec<u32>,
    tree: Bvh,
    workspace: BvhWorkspace,
    /// Fattened box of each collider, as the tree has it.
    fat: Vec<Aabb>,
    /// Box now of each collider that left its fattened one.
    left: Vec<Option<Aabb>>,
    /// Colliders whose fattened boxes are new.
    moved: Vec<u32>,
    /// The pairs whose boxes overlap.
    pub pairs: Pairs,
    slots: HashMap<(u32, u32), u32, BuildHasherDefault<DefaultHasher>>,
    found: Vec<(u32, u32)>,
    /// Slots of manifolds whose pairs have ended, and pairs that are not as they were when [`WorldContacts::take_changes`] last told of them.
    ended: Vec<u32>,
    changed: Vec<PairChange>,
    /// Whether other pairs may meet than before, so that all are predicted for.
    look_again: bool,
}

/// A pair, by its place, that is not as it was.
#[derive(Clone, Copy)]
struct PairChange {
    pair: u32,
    computed: bool,
}

/// How much larger than the shape a box in the tree is, relative to the shape's smallest half extent.
const FAT: f32 = 0.1;

impl WorldContacts {
    pub fn new(colliders: Vec<ColliderInfo>) -> Self {
        let unbounded = (0..colliders.len() as u32).filter(|&c| colliders[c as usize].unbounded).collect();
        let cuboids = colliders.iter().map(CuboidPlace::of).collect();
        Self { colliders, cuboids, unbounded, ..Self::default() }
    }

    /// The colliders, in the order of the bodies.
    pub fn colliders(&self) -> &[ColliderInfo] {
        &self.colliders
    }

    /// Looks for all pairs in the next detection, because other bodies are jointed.
    pub fn look_again(&mut self) {
        self.look_again = true;
    }

    /// Tells what changed since the last call; this is the world number `world`.
    pub fn take_changes(&mut self, world: u32, tell: &mut dyn FnMut(Change)) {
        self.ended.drain(..).for_each(|slot| tell(Change::Ended(slot)));
        for PairChange { pair: i, computed } in self.changed.drain(..) {
            if let Some(pair) = self.pairs.get_mut(i as usize) {
                tell(Change::Pair { place: [world, i], pair, computed });
            }
        }
    }

    /// Brings the pairs to where the bodies are.
    pub fn detect(&mut self, input: &DetectionInput) -> DetectStats {
        let parted = self.broad_phase(input);
        let stats = self.narrow_phase(input);
        DetectStats { reshaped: stats.reshaped | parted, ..stats }
    }

    /// Finds new pairs and ends parted ones; returns whether it ended any.
    fn broad_phase(&mut self, input: &DetectionInput) -> bool {
        let mut parted = false;
        // Each collider's box now: what it sweeps in this step, and the distance at which it makes contact.
        let tight = |c: &ColliderInfo| {
            let body = &input.moving[c.body as usize];
            let pose = Pose::from_parts(body.position, body.rotation);
            // The size of a half-space is infinite, and no margin at all of it no number.
            let margin = input.margins.speculative * c.size.min(FARTHEST) + input.margins.fall;
            let mut aabb = c.aabb(pose).loosened(margin);
            let sweep = body.v * input.margins.dt;
            // A collider that turns reaches no further out than from one side of the body to the other, and its box no further than its
            // longest half diagonal.
            let most = c.reach - c.size + c.local.translation.length();
            aabb = aabb.loosened((c.reach * body.w.length() * input.margins.dt).min(most).max(0.0));
            aabb.mins += sweep.min(glam::Vec3::ZERO);
            aabb.maxs += sweep.max(glam::Vec3::ZERO);
            aabb
        };
        if self.fat.is_empty() {
            let fatten = |c: &ColliderInfo| {
                let fat = tight(c).loosened(FAT * c.size);
                if c.unbounded || !is_in_range(&fat) { empty_box() } else { fat }
            };
            self.fat = self.colliders.iter().map(fatten).collect();
            self.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &self.fat);
            self.found.clear();
            let found = &mut self.found;
            self.tree.traverse_bvtt_single_tree::<false>(&mut self.workspace, &mut |a, b| found.push((a, b)));
            // In the order of the bodies in memory, in which every later stage then goes over them.
            found.iter_mut().for_each(|pair| *pair = key(pair.0, pair.1));
            found.sort_unstable();
            self.moved.extend(0..self.colliders.len() as u32);
            self.find_unbounded(input);
        } else {
            let left = |(c, fat): (&ColliderInfo, &Aabb)| {
                let still = input.activity.get(c.body as usize) == Some(&Activity::Still);
                if input.kinds[c.body as usize] == BodyKind::Fixed || c.unbounded || still {
                    return None;
                }
                let aabb = tight(c);
                (!fat.contains(&aabb) && is_in_range(&aabb)).then_some(aabb)
            };
            let colliders = self.colliders.par_iter().with_min_len(256);
            colliders.zip(&self.fat).map(left).collect_into_vec(&mut self.left);
            self.found.clear();
            self.moved.clear();
            for (i, aabb) in self.left.iter().enumerate().filter_map(|(i, left)| Some((i, left.as_ref()?))) {
                let margin = FAT * self.colliders[i].size;
                self.tree.insert_or_update_partially(*aabb, i as u32, margin);
                self.fat[i] = aabb.loosened(margin);
                self.moved.push(i as u32);
            }
            if !self.moved.is_empty() {
                self.tree.optimize_incremental(&mut self.workspace);
                self.tree.refit(&mut self.workspace);
            }
            if self.look_again {
                self.moved.clear();
                self.moved.extend(0..self.colliders.len() as u32);
                let found = &mut self.found;
                self.tree.traverse_bvtt_single_tree::<false>(&mut self.workspace, &mut |a, b| found.push((a, b)));
            } else if !self.moved.is_empty() {
                let found = &mut self.found;
                self.tree.traverse_bvtt_single_tree::<true>(&mut self.workspace, &mut |a, b| found.push((a, b)));
            }
            if !self.moved.is_empty() {
                self.find_unbounded(input);
                parted = self.drop_parted(input);
            }
        }
        self.add_found(input);
        self.look_again = false;
        parted
    }

    /// Half-spaces against the colliders that moved, by the corner of the box that lies deepest.
    fn find_unbounded(&mut self, input: &DetectionInput) {
        let mut found = std::mem::take(&mut self.found);
        for &plane in &self.unbounded {
            let near = self.moved.iter().filter(|&&c| plane != c && self.touches(input, plane, c));
            found.extend(near.map(|&c| (plane, c)));
        }
        self.found = found;
    }

    /// Whether the fattened boxes of two colliders still overlap.
    fn touches(&self, input: &DetectionInput, a: u32, b: u32) -> bool {
        let (ca, cb) = (&self.colliders[a as usize], &self.colliders[b as usize]);
        match (ca.unbounded, cb.unbounded) {
            (false, false) => self.fat[a as usize].intersects(&self.fat[b as usize]),
            (true, true) => false,
            (true, false) => box_reaches_plane(input, ca, &self.fat[b as usize]),
            (false, true) => box_reaches_plane(input, cb, &self.fat[a as usize]),
        }
    }

    /// Ends the pairs whose boxes came apart or whose bodies a joint holds; the last pair takes an ended one's slot. Returns
    /// whether it ended any.
    fn drop_parted(&mut self, input: &DetectionInput) -> bool {
        let (mut slot, before) = (0, self.pairs.len());
        while slot < self.pairs.len() {
            let pair = &self.pairs[slot];
            let jointed = self.look_again && input.jointed.contains(&key(pair.body_a, pair.body_b));
            if !jointed && self.touches(input, pair.collider_a, pair.collider_b) {
                slot += 1;
                continue;
            }
            self.slots.remove(&key(pair.collider_a, pair.collider_b));
            let ended = self.pairs.swap_remove(slot);
            self.ended.extend(ended.manifolds.iter().map(|m| m.slot).filter(|&slot| slot != NO_SLOT));
            if let Some(moved) = self.pairs.get(slot) {
                self.slots.insert(key(moved.collider_a, moved.collider_b), slot as u32);
                self.changed.push(PairChange { pair: slot as u32, computed: false });
            }
        }
        self.pairs.len() < before
    }

    /// Begins the pairs that are new, of different bodies of which one can be pushed, the further reaching first.
    fn add_found(&mut self, input: &DetectionInput) {
        for &(i, j) in &self.found {
            let (ci, cj) = (&self.colliders[i as usize], &self.colliders[j as usize]);
            let dynamic = |c: &ColliderInfo| input.kinds[c.body as usize] == BodyKind::Dynamic;
            let apart = ci.body == cj.body || input.jointed.contains(&key(ci.body, cj.body));
            if apart || !(dynamic(ci) || dynamic(cj)) {
                continue;
            }
            let slot = self.pairs.len() as u32;
            if let std::collections::hash_map::Entry::Vacant(entry) = self.slots.entry(key(i, j)) {
                entry.insert(slot);
                let (first, second) = (i.min(j), i.max(j));
                let swap = self.colliders[second as usize].reach > self.colliders[first as usize].reach;
                let (a, b) = if swap { (second, first) } else { (first, second) };
                self.pairs.push(a, b, &self.colliders);
            }
        }
    }

    fn narrow_phase(&mut self, input: &DetectionInput) -> DetectStats {
        let narrow =
            Narrow { colliders: &self.colliders, cuboids: &self.cuboids, moving: input.moving, margins: input.margins };
        let chunks = self.pairs.par_chunks_mut();
        let updates = chunks.map_init(Scratch::default, |scratch, chunk| narrow.update(chunk, scratch));
        let updates: Vec<Updated> = updates.flatten_iter().collect();
        let mut stats = DetectStats { pairs: self.pairs.len(), ..DetectStats::default() };
        for Updated { pair, computed, reshaped } in updates {
            stats.computed += usize::from(computed);
            stats.reshaped |= reshaped;
            self.changed.push(PairChange { pair, computed });
        }
        stats
    }
}

/// Whether a box reaches a half-space, by its corner that lies deepest.
fn box_reaches_plane(input: &DetectionInput, plane: &ColliderInfo, aabb: &Aabb) -> bool {
    let body = &input.moving[plane.body as usize];
    let pose = Pose::from_parts(body.position, body.rotation) * plane.local;
    let Some(half_space) = plane.shape.as_halfspace() else { return false };
    let normal = pose.rotation * half_space.normal;
    let deepest = (aabb.center() - pose.translation).dot(normal) - aabb.half_extents().dot(normal.abs());
    deepest <= 0.0
}

pub(super) fn key(i: u32, j: u32) -> (u32, u32) {
    (i.min(j), i.max(j))
}

/// A box that overlaps no other but its like, far from everything.
fn empty_box() -> Aabb {
    Aabb::new(glam::Vec3::splat(2.0 * FARTHEST), glam::Vec3::splat(2.0 * FARTHEST))
}

fn is_in_range(aabb: &Aabb) -> bool {
    let farthest = glam::Vec3::splat(FARTHEST);
    aabb.mins.abs().cmple(farthest).all() && aabb.maxs.abs().cmple(farthest).all()
}
