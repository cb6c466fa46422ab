//! The colliders of one world: near pairs, and their contacts.

mod saved;

pub(super) use saved::PlacedBody;

use std::collections::{BTreeMap, HashSet};

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use rayon::prelude::*;

use super::collider::{Activity, BodyState, ColliderInfo, CuboidPlace, Margins, is_in_range};
use super::detector::{ColliderSide, PairFilter};
use super::flush::Neighbors;
use super::manifold::{MAX_POINTS, NO_SLOT};
use super::narrow::{Narrow, Updated};
use super::pair::Pair;
use super::pairs::Pairs;
use super::path::ANEW;
use super::places::{Place, TreeColliders};
use super::report::{Change, DetectStats};
use super::tree::{NOWHERE, Tree};
use crate::world::{BodyKind, Collider, Groups, placed};

/// Input of one detection for all worlds. Body indices count over all worlds.
pub(super) struct DetectionInput<'a> {
    pub margins: Margins,
    pub kinds: &'a [BodyKind],
    pub groups: &'a [Groups],
    pub moving: &'a [BodyState],
    pub activity: &'a [Activity],
    /// Pairs of bodies that a joint keeps from colliding, the smaller index first.
    pub jointed: &'a HashSet<(u32, u32)>,
}

/// The colliders of one body, in contiguous places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ColliderRange {
    pub first: u32,
    pub count: u32,
}

crate::saved::fields!(ColliderRange { first, count });

impl ColliderRange {
    fn places(self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// The colliders of one world. They meet no colliders of other worlds.
#[derive(Default)]
pub(super) struct WorldContacts {
    pub(super) colliders: Vec<ColliderInfo>,
    /// Colliders that were removed since the last detection. Their pairs have not ended yet.
    leaving: Vec<ColliderRange>,
    /// Vacant runs of places, by length: the first place of each. The last one is used first.
    vacant: BTreeMap<u32, Vec<u32>>,
    /// Cuboid data of each collider.
    cuboids: Vec<CuboidPlace>,
    /// Fattened box of each collider.
    pub(super) fat: Vec<Aabb>,
    /// Whether the box is new in this detection; for a half-space, whether it moved.
    moved: Vec<bool>,
    /// The box before, if the box is new.
    before: Vec<Aabb>,
    pub(super) tree: Tree,
    /// The half-spaces, without sensors.
    pub(super) planes: Vec<Plane>,
    pub(super) sensors: Vec<u32>,
    /// Memory of [`WorldContacts::sense`].
    pub(super) strayed: Vec<u32>,
    /// The pairs whose boxes overlap.
    pub pairs: Pairs,
    /// The colliders of each pair, the smaller index first.
    keys: Vec<(u32, u32)>,
    /// Colliders whose boxes began to overlap in this detection, likewise.
    found: Vec<(u32, u32)>,
    /// Slots of manifolds whose pairs have ended, and pairs that changed since the last
    /// [`WorldContacts::take_changes`].
    ended: Vec<u32>,
    changed: Vec<PairChange>,
    /// Whether the set of pairs that can collide changed, so that the detection searches for all pairs.
    look_again: bool,
}

crate::saved::cloned!(WorldContacts {
    colliders,
    leaving,
    vacant,
    cuboids,
    fat,
    moved,
    before,
    tree,
    planes,
    sensors,
    pairs,
    keys,
    ended,
    changed,
    look_again,
} scratch { found, strayed });

/// A changed pair, by index.
#[derive(Clone, Copy)]
struct PairChange {
    pair: u32,
    computed: bool,
}

crate::saved::fields!(PairChange { pair, computed });

/// A half-space, and its pose at the last search for its pairs.
#[derive(Clone)]
pub(super) struct Plane {
    pub(super) collider: u32,
    then: Option<Pose>,
}

crate::saved::fields!(Plane { collider, then });

/// Margin of a box in the tree, relative to the smallest half extent of the shape.
const FAT: f32 = 0.1;

impl WorldContacts {
    /// Adds the colliders of a body.
    pub fn insert(&mut self, body: u32, colliders: &[Collider]) -> ColliderRange {
        let count = colliders.len() as u32;
        if count == 0 {
            return ColliderRange::default();
        }
        let vacant = self.vacant.get_mut(&count).and_then(Vec::pop);
        let range = ColliderRange { first: vacant.unwrap_or(self.colliders.len() as u32), count };
        for ((place, collider), index) in range.places().zip(colliders).zip(0..) {
            let info = ColliderInfo::new(body, index, collider);
            if info.sensor {
                self.sensors.push(place as u32);
            } else if info.unbounded {
                self.planes.push(Plane { collider: place as u32, then: None });
            }
            let cuboid = CuboidPlace::of(&info);
            if place < self.colliders.len() {
                (self.colliders[place], self.cuboids[place]) = (info, cuboid);
            } else {
                self.colliders.push(info);
                self.cuboids.push(cuboid);
                self.fat.push(NOWHERE);
                self.before.push(NOWHERE);
                self.moved.push(false);
            }
        }
        range
    }

    /// Removes the colliders of a body. The next detection ends their pairs and frees their places.
    pub fn remove(&mut self, range: ColliderRange) {
        if range.count > 0 {
            self.colliders[range.places()].iter_mut().for_each(ColliderInfo::leave);
            self.planes.retain(|plane| !range.places().contains(&(plane.collider as usize)));
            self.sensors.retain(|&sensor| !range.places().contains(&(sensor as usize)));
            self.leaving.push(range);
        }
    }

    /// The colliders of a body.
    pub fn colliders(&self, range: ColliderRange) -> &[ColliderInfo] {
        &self.colliders[range.places()]
    }

    /// The colliders with their places in the tree at the last detection. `range_of` returns those of a body.
    pub fn standing(&self, range_of: impl Fn(usize) -> ColliderRange) -> TreeColliders<'_> {
        let place = |(c, i): (&ColliderInfo, u32)| {
            let first = if c.is_gone() { i } else { range_of(c.body as usize).first };
            Place { body: c.body, collider: i - first }
        };
        let places = self.colliders.iter().zip(0..).map(place).collect();
        TreeColliders { tree: &self.tree, places, boxes: &self.fat }
    }

    /// Makes the next detection search for all pairs, because joints changed.
    pub fn look_again(&mut self) {
        self.look_again = true;
    }

    /// Reports changes since the last call. `world` is the number of this world.
    pub fn take_changes(&mut self, world: u32, tell: &mut dyn FnMut(Change)) {
        self.ended.drain(..).for_each(|slot| tell(Change::Ended(slot)));
        for PairChange { pair: i, computed } in self.changed.drain(..) {
            // A pair without contacts has no slot.
            if let Some(pair) = self.pairs.get_mut(i as usize).filter(|pair| !pair.manifolds.is_empty()) {
                tell(Change::Pair { place: [world, i], pair, computed });
            }
        }
    }

    /// Updates the pairs to the present poses.
    pub fn detect(&mut self, input: &DetectionInput) -> DetectStats {
        let parted = self.broad_phase(input);
        self.narrow_phase(input, parted)
    }

    /// Asks `filter` about every pair with an awake or moving body. The other pairs keep their answers. Without a
    /// filter all pairs may touch. Adds refused pairs to `refused`.
    pub fn filter(
        &mut self,
        moving: &[BodyState],
        mut filter: Option<&mut PairFilter>,
        refused: &mut HashSet<[ColliderSide; 2]>,
    ) {
        for i in 0..self.pairs.len() {
            let pair = &self.pairs[i];
            let is_active = [pair.body_a, pair.body_b].iter().any(|&body| moving[body as usize].activity > 0.0);
            let sides = pair.sides();
            let is_refused = match &mut filter {
                Some(filter) if is_active => !filter(sides),
                Some(_) => pair.is_refused,
                None => false,
            };
            self.pairs[i].is_refused = is_refused;
            if is_refused {
                refused.insert(sides);
                self.pairs.end(i);
            }
        }
    }

    /// Drops points of the manifolds of a pair. The next detection computes the pair again.
    pub fn drop_points(&mut self, place: u32, kept: &[[bool; MAX_POINTS]], is_reused: bool) -> &Pair {
        let pair = &mut self.pairs.all[place as usize];
        pair.drop_points(kept, is_reused);
        self.pairs.tracks[place as usize].predicted = ANEW;
        self.changed.push(PairChange { pair: place, computed: true });
        pair
    }

    /// Finds new pairs and ends separated ones. Returns whether an ended pair had a contact.
    pub fn broad_phase(&mut self, input: &DetectionInput) -> bool {
        let look_again = std::mem::take(&mut self.look_again);
        if !self.fatten(input) && !look_again {
            return false;
        }
        if look_again {
            self.moved.fill(true);
            self.before.fill(NOWHERE);
        }
        self.find(input);
        if look_again {
            let known: HashSet<_> = self.keys.iter().collect();
            self.found.retain(|pair| !known.contains(pair));
        }
        let parted = self.drop_parted(input, look_again);
        self.add_found();
        for range in self.leaving.drain(..) {
            self.vacant.entry(range.count).or_default().push(range.first);
        }
        parted
    }

    /// Gives a new fattened box to each collider that left its own. Returns whether a box changed or a half-space
    /// moved.
    fn fatten(&mut self, input: &DetectionInput) -> bool {
        let fatten = |((c, fat), (moved, before)): ((&ColliderInfo, &mut Aabb), (&mut bool, &mut Aabb))| {
            *moved = false;
            if c.is_gone() || c.sensor {
                return false;
            }
            let still = input.activity.get(c.body as usize) == Some(&Activity::Still);
            let stays = still || input.kinds[c.body as usize] == BodyKind::Fixed;
            if c.unbounded || stays && *fat != NOWHERE {
                return false;
            }
            let tight = tight(c, input);
            if fat.contains(&tight) || !is_in_range(&tight) {
                return false;
            }
            *moved = true;
            *before = std::mem::replace(fat, tight.loosened(FAT * c.size));
            true
        };
        let boxes = self.colliders.par_iter().zip(&mut self.fat).with_min_len(256);
        let moved = boxes.zip(self.moved.par_iter_mut().zip(&mut self.before)).map(fatten);
        let mut any = moved.reduce(|| false, |a, b| a | b);
        for plane in &self.planes {
            let moved = plane.then != Some(pose_of(&self.colliders[plane.collider as usize], input));
            self.moved[plane.collider as usize] = moved;
            any |= moved;
        }
        for place in self.leaving.iter().flat_map(|range| range.places()) {
            self.moved[place] = true;
            self.before[place] = std::mem::replace(&mut self.fat[place], NOWHERE);
        }
        any | !self.leaving.is_empty()
    }

    /// Finds the pairs whose boxes began to overlap. (Two boxes that both overlapped before have a pair.) The pairs are
    /// in the order of the bodies in memory, which every later stage follows.
    fn find(&mut self, input: &DetectionInput) {
        let Self { colliders, fat, moved, before, tree, planes, found, .. } = self;
        let (fat, moved) = (&*fat, &*moved);
        // Different bodies whose groups match, and contacts can push at least one of them.
        let may_touch = |i: u32, j: u32| {
            let bodies = key(colliders[i as usize].body, colliders[j as usize].body);
            let dynamic = |body: u32| input.kinds[body as usize] == BodyKind::Dynamic;
            let meet = || input.groups[bodies.0 as usize].meets(input.groups[bodies.1 as usize]);
            let one_moves = bodies.0 != bodies.1 && (dynamic(bodies.0) || dynamic(bodies.1));
            one_moves && meet() && !input.jointed.contains(&bodies)
        };
        tree.follow(fat, before, moved);
        *found = tree.overlaps(&may_touch);
        found.par_sort_unstable();
        let box_before = |c: u32| if moved[c as usize] { &before[c as usize] } else { &fat[c as usize] };
        for Plane { collider, then } in planes {
            let plane = &colliders[*collider as usize];
            let now = pose_of(plane, input);
            let is_new = |c: u32| {
                let looks = !colliders[c as usize].unbounded
                    && !colliders[c as usize].sensor
                    && (moved[c as usize] || moved[*collider as usize]);
                looks
                    && box_reaches_plane(plane, now, &fat[c as usize])
                    && !then.is_some_and(|then| box_reaches_plane(plane, then, box_before(c)))
                    && may_touch(*collider, c)
            };
            found.extend((0..colliders.len() as u32).filter(|&c| is_new(c)).map(|c| key(*collider, c)));
            *then = Some(now);
        }
    }

    /// Whether the fattened boxes of two colliders overlap.
    fn touches(&self, input: &DetectionInput, a: u32, b: u32) -> bool {
        let (ca, cb) = (&self.colliders[a as usize], &self.colliders[b as usize]);
        if ca.is_gone() || cb.is_gone() {
            return false;
        }
        match (ca.unbounded, cb.unbounded) {
            (false, false) => self.fat[a as usize].intersects(&self.fat[b as usize]),
            (true, true) => false,
            (true, false) => box_reaches_plane(ca, pose_of(ca, input), &self.fat[b as usize]),
            (false, true) => box_reaches_plane(cb, pose_of(cb, input), &self.fat[a as usize]),
        }
    }

    /// Ends the pairs whose boxes came apart and, if joints changed, the pairs of jointed bodies. The last pair takes
    /// the index of an ended one. Returns whether an ended pair had a contact.
    fn drop_parted(&mut self, input: &DetectionInput, joints_changed: bool) -> bool {
        let ends = |&(i, &(a, b)): &(usize, &(u32, u32))| {
            let jointed = |i: usize| input.jointed.contains(&key(self.pairs[i].body_a, self.pairs[i].body_b));
            let moved = self.moved[a as usize] || self.moved[b as usize];
            moved && !self.touches(input, a, b) || joints_changed && jointed(i)
        };
        let parted = self.keys.par_iter().enumerate().with_min_len(1024).filter(ends).map(|(i, _)| i);
        let (parted, before): (Vec<usize>, _) = (parted.collect(), self.ended.len());
        for i in parted.into_iter().rev() {
            self.keys.swap_remove(i);
            let ended = self.pairs.swap_remove(i);
            self.ended.extend(ended.manifolds.iter().map(|m| m.slot).filter(|&slot| slot != NO_SLOT));
            if i < self.pairs.len() {
                self.changed.push(PairChange { pair: i as u32, computed: false });
            }
        }
        self.ended.len() > before
    }

    /// Adds the new pairs. The collider with the larger reach comes first.
    fn add_found(&mut self) {
        let Self { colliders, pairs, keys, found, .. } = self;
        keys.extend(&*found);
        pairs.begin(found, colliders);
    }

    /// Updates the contacts of all pairs. `parted` tells whether an ended pair had a contact.
    pub fn narrow_phase(&mut self, input: &DetectionInput, parted: bool) -> DetectStats {
        let Self { colliders, cuboids, tree, planes, pairs, changed, .. } = self;
        let neighbors = Neighbors { colliders, tree, planes, input, fall: 0.0 };
        let narrow = Narrow { colliders, cuboids, moving: input.moving, margins: input.margins, neighbors };
        let updates: Vec<Updated> = pairs.par_chunks_mut().flat_map_iter(|chunk| narrow.update(chunk)).collect();
        let mut stats = DetectStats { pairs: pairs.len(), reshaped: parted, ..DetectStats::default() };
        for Updated { pair, computed, reshaped } in updates {
            stats.computed += usize::from(computed);
            stats.reshaped |= reshaped;
            changed.push(PairChange { pair, computed });
        }
        stats
    }
}

/// The box that a collider sweeps in this step, enlarged by the distance at which contacts begin.
fn tight(c: &ColliderInfo, input: &DetectionInput) -> Aabb {
    let body = &input.moving[c.body as usize];
    let pose = Pose::from_parts(body.position, body.rotation);
    let mut aabb = c.aabb(pose).loosened(input.margins.speculative * c.size + input.margins.fall);
    let sweep = body.v * input.margins.dt;
    // A turning collider reaches no further than from one side of the body to the other, and its box no further than
    // its longest half diagonal.
    let most = c.reach - c.size + c.local.translation.length();
    aabb = aabb.loosened((c.reach * body.w.length() * input.margins.dt).min(most).max(0.0));
    aabb.mins += sweep.min(glam::Vec3::ZERO);
    aabb.maxs += sweep.max(glam::Vec3::ZERO);
    aabb
}

fn pose_of(c: &ColliderInfo, input: &DetectionInput) -> Pose {
    let body = &input.moving[c.body as usize];
    placed(Pose::from_parts(body.position, body.rotation), c.local)
}

/// Whether the deepest corner of a box is below a half-space at `pose`.
pub(super) fn box_reaches_plane(plane: &ColliderInfo, pose: Pose, aabb: &Aabb) -> bool {
    let Some(half_space) = plane.shape.as_halfspace() else { return false };
    let normal = pose.rotation * half_space.normal;
    let deepest = (aabb.center() - pose.translation).dot(normal) - aabb.half_extents().dot(normal.abs());
    deepest <= 0.0
}

pub(super) fn key(i: u32, j: u32) -> (u32, u32) {
    (i.min(j), i.max(j))
}
