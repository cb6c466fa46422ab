//! Collision detection: parry's tree over boxes, then persistent manifolds. The only module that asks parry for contacts.
//!
//! The tree holds fattened boxes and is touched only where a collider left its own; pairs live in slots, in the order
//! in which they were found, so that every later stage is deterministic for any number of threads.

mod manifold;
mod narrow;
mod query;

pub use manifold::{MAX_POINTS, Manifold, ManifoldPoint};
pub use narrow::{Motion, Pair};

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, DefaultHasher};

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rayon::prelude::*;

use crate::config::SolverConfig;
use crate::world::{Body, BodyKind, World};
use narrow::{ColliderInfo, Margins, Moving, Scratch, Update};

/// What a body is to the detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Does not move, and nothing is solved for it.
    Still,
    /// Moves by itself: cannot be pushed, but may wake what it touches.
    Moving,
    /// Can be pushed.
    Awake,
}

/// What one detection did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DetectStats {
    /// Pairs whose boxes overlap.
    pub pairs: usize,
    /// Pairs whose manifolds were computed; the others were reused.
    pub computed: usize,
    /// Whether what touches, or with how many points, is other than before.
    pub reshaped: bool,
}

/// Finds the contacts of a world and keeps them from step to step.
pub struct Detector {
    colliders: Vec<ColliderInfo>,
    kinds: Vec<BodyKind>,
    moving: Vec<Moving>,
    unbounded: Vec<u32>,
    tree: Bvh,
    workspace: BvhWorkspace,
    /// Fattened box of each collider, as the tree has it.
    fat: Vec<Aabb>,
    /// Box now of each collider that left its fattened one.
    left: Vec<Option<Aabb>>,
    /// Colliders whose fattened boxes are new.
    moved: Vec<u32>,
    pairs: Vec<Pair>,
    slots: HashMap<(u32, u32), u32, BuildHasherDefault<DefaultHasher>>,
    found: Vec<(u32, u32)>,
    detections: u64,
    computed_in: u64,
    reshaped_in: u64,
    /// Pairs of bodies that a joint keeps from colliding, the smaller index first.
    jointed: HashSet<(u32, u32)>,
}

/// How much larger than the shape a box in the tree is, relative to the shape's smallest half extent.
const FAT: f32 = 0.1;

impl Detector {
    /// A detector for the bodies of `world`, whose number, shapes and kinds stay as they are.
    pub fn new(world: &World) -> Self {
        let collider = |(body, c): (usize, &crate::world::Collider)| {
            let bounding = c.shape.bounding_radius();
            ColliderInfo {
                body: body as u32,
                shape: c.shape.0.clone(),
                local: Pose::from_parts(c.position, c.rotation),
                cuboid: c.shape.0.as_cuboid().map(|cuboid| cuboid.half_extents),
                size: c.shape.smallest_half_extent(),
                reach: c.position.length() + bounding,
                unbounded: c.shape.0.as_halfspace().is_some(),
            }
        };
        let on_body =
            |(i, b): (usize, &Body)| b.colliders.iter().map(move |c| (i, c)).map(collider).collect::<Vec<_>>();
        let colliders: Vec<_> = world.bodies.iter().enumerate().flat_map(on_body).collect();
        let unbounded = (0..colliders.len() as u32).filter(|&c| colliders[c as usize].unbounded).collect();
        Self {
            colliders,
            kinds: world.bodies.iter().map(|b| b.kind).collect(),
            moving: Vec::new(),
            unbounded,
            tree: Bvh::new(),
            workspace: BvhWorkspace::default(),
            fat: Vec::new(),
            left: Vec::new(),
            moved: Vec::new(),
            pairs: Vec::new(),
            slots: HashMap::default(),
            found: Vec::new(),
            detections: 0,
            computed_in: 0,
            reshaped_in: 0,
            jointed: world
                .joints
                .iter()
                .filter(|j| !j.collide)
                .filter_map(|j| Some(key(j.body_a as u32, j.body_b? as u32)))
                .collect(),
        }
    }

    /// The pairs whose boxes overlap, with the manifolds they touch with. The order is the same for any thread count.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The same, to write impulses and colors into.
    pub fn pairs_mut(&mut self) -> &mut [Pair] {
        &mut self.pairs
    }

    /// Brings the pairs to the poses of `world`, for a step of `dt` seconds: manifolds that are reused stay as they are, and
    /// their pairs know how the bodies moved since. A manifold that is computed anew inherits the impulses of the old one,
    /// which `give_back` fetches from where the last step left them. Pairs of bodies that are still keep what they have, and take
    /// no part in the step; without `activity` all take part.
    pub fn detect(
        &mut self,
        world: &World,
        config: &SolverConfig,
        dt: f32,
        activity: &[Activity],
        give_back: &(dyn Fn(&mut Pair) + Sync),
    ) -> DetectStats {
        let moving = |b: &Body| Moving {
            position: b.position,
            rotation: b.rotation,
            center: b.center_of_mass(),
            v: b.linear_velocity,
            w: b.angular_velocity,
        };
        world.bodies.par_iter().with_min_len(256).map(moving).collect_into_vec(&mut self.moving);
        self.detections += 1;
        let margins = Margins {
            speculative: config.speculative_margin,
            recycle: config.recycle_distance,
            fall: world.gravity.length() * dt * dt,
            dt,
            detection: self.detections,
        };
        let parted = self.broad_phase(margins, activity);
        let mut stats = self.narrow_phase(margins, activity, give_back);
        stats.reshaped |= parted;
        if stats.computed > 0 {
            self.computed_in = self.detections;
        }
        if stats.reshaped {
            self.reshaped_in = self.detections;
        }
        stats
    }

    /// The last detection, counted from 1.
    pub fn detections(&self) -> u64 {
        self.detections
    }

    /// The last detection that computed any manifold.
    pub fn computed_in(&self) -> u64 {
        self.computed_in
    }

    /// The last detection after which another set of manifolds touched, or with other numbers of points.
    pub fn reshaped_in(&self) -> u64 {
        self.reshaped_in
    }

    /// Finds new pairs and ends parted ones; returns whether it ended any.
    fn broad_phase(&mut self, margins: Margins, activity: &[Activity]) -> bool {
        let mut parted = false;
        // Each collider's box now: what it sweeps in this step, and the distance at which it makes contact.
        let tight = |c: &ColliderInfo| {
            let body = &self.moving[c.body as usize];
            let pose = Pose::from_parts(body.position, body.rotation);
            let mut aabb = c.aabb(pose).loosened(margins.speculative * c.size + margins.fall);
            let sweep = body.v * margins.dt;
            aabb.mins += sweep.min(glam::Vec3::ZERO);
            aabb.maxs += sweep.max(glam::Vec3::ZERO);
            aabb
        };
        if self.fat.is_empty() {
            let fatten = |c: &ColliderInfo| if c.unbounded { empty_box() } else { tight(c).loosened(FAT * c.size) };
            self.fat = self.colliders.iter().map(fatten).collect();
            self.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &self.fat);
            self.found.clear();
            let found = &mut self.found;
            self.tree.traverse_bvtt_single_tree::<false>(&mut self.workspace, &mut |a, b| found.push((a, b)));
            self.moved.extend(0..self.colliders.len() as u32);
            self.find_unbounded();
        } else {
            let kinds = &self.kinds;
            let left = |(c, fat): (&ColliderInfo, &Aabb)| {
                let still = activity.get(c.body as usize) == Some(&Activity::Still);
                if kinds[c.body as usize] == BodyKind::Fixed || c.unbounded || still {
                    return None;
                }
                let aabb = tight(c);
                (!fat.contains(&aabb) && is_finite(&aabb)).then_some(aabb)
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
                let found = &mut self.found;
                self.tree.traverse_bvtt_single_tree::<true>(&mut self.workspace, &mut |a, b| found.push((a, b)));
                self.find_unbounded();
                parted = self.drop_parted();
            }
        }
        self.add_found();
        parted
    }

    /// Half-spaces against the colliders that moved, by the corner of the box that lies deepest.
    fn find_unbounded(&mut self) {
        let mut found = std::mem::take(&mut self.found);
        for &plane in &self.unbounded {
            let near = self.moved.iter().filter(|&&c| plane != c && self.touches(plane, c));
            found.extend(near.map(|&c| (plane, c)));
        }
        self.found = found;
    }

    /// Whether the fattened boxes of two colliders still overlap.
    fn touches(&self, a: u32, b: u32) -> bool {
        let (ca, cb) = (&self.colliders[a as usize], &self.colliders[b as usize]);
        match (ca.unbounded, cb.unbounded) {
            (false, false) => self.fat[a as usize].intersects(&self.fat[b as usize]),
            (true, true) => false,
            (true, false) => self.box_reaches_plane(ca, &self.fat[b as usize]),
            (false, true) => self.box_reaches_plane(cb, &self.fat[a as usize]),
        }
    }

    fn box_reaches_plane(&self, plane: &ColliderInfo, aabb: &Aabb) -> bool {
        let body = &self.moving[plane.body as usize];
        let pose = Pose::from_parts(body.position, body.rotation) * plane.local;
        let Some(half_space) = plane.shape.as_halfspace() else { return false };
        let normal = pose.rotation * half_space.normal;
        let deepest = (aabb.center() - pose.translation).dot(normal) - aabb.half_extents().dot(normal.abs());
        deepest <= 0.0
    }

    /// Ends the pairs whose boxes came apart; the last pair takes an ended one's slot. Returns whether there were any.
    fn drop_parted(&mut self) -> bool {
        let (mut slot, before) = (0, self.pairs.len());
        while slot < self.pairs.len() {
            let pair = &self.pairs[slot];
            if self.touches(pair.collider_a, pair.collider_b) {
                slot += 1;
                continue;
            }
            self.slots.remove(&key(pair.collider_a, pair.collider_b));
            self.pairs.swap_remove(slot);
            if let Some(moved) = self.pairs.get(slot) {
                self.slots.insert(key(moved.collider_a, moved.collider_b), slot as u32);
            }
        }
        self.pairs.len() < before
    }

    /// Begins the pairs that are new, of different bodies of which one can be pushed, the further reaching first.
    fn add_found(&mut self) {
        for &(i, j) in &self.found {
            let (ci, cj) = (&self.colliders[i as usize], &self.colliders[j as usize]);
            let dynamic = |c: &ColliderInfo| self.kinds[c.body as usize] == BodyKind::Dynamic;
            let apart = ci.body == cj.body || self.jointed.contains(&key(ci.body, cj.body));
            if apart || !(dynamic(ci) || dynamic(cj)) {
                continue;
            }
            let slot = self.pairs.len() as u32;
            if let std::collections::hash_map::Entry::Vacant(entry) = self.slots.entry(key(i, j)) {
                entry.insert(slot);
                let (first, second) = (i.min(j), i.max(j));
                let swap = self.colliders[second as usize].reach > self.colliders[first as usize].reach;
                let (a, b) = if swap { (second, first) } else { (first, second) };
                self.pairs.push(Pair::new(a, b, &self.colliders));
            }
        }
    }

    fn narrow_phase(
        &mut self,
        margins: Margins,
        activity: &[Activity],
        give_back: &(dyn Fn(&mut Pair) + Sync),
    ) -> DetectStats {
        let (colliders, moving) = (&self.colliders, &self.moving);
        let update = |scratch: &mut Scratch, pair: &mut Pair| {
            let (a, b) = (&moving[pair.body_a as usize], &moving[pair.body_b as usize]);
            let of = |body: u32| activity.get(body as usize).copied().unwrap_or(Activity::Awake);
            let both = [of(pair.body_a), of(pair.body_b)];
            // What a pair has belongs to its manifolds while it takes no part, and to their rows while it does.
            let takes_part = both.contains(&Activity::Awake);
            let changes = pair.rests == takes_part;
            if changes && !takes_part {
                give_back(pair);
                pair.manifolds.iter_mut().for_each(Manifold::forget_rows);
            }
            let mut update = Update::Reused;
            if both != [Activity::Still; 2] {
                update = pair.update(colliders, a, b, margins, scratch, give_back);
            }
            if changes && takes_part {
                pair.computed_in = margins.detection;
            }
            pair.rests = !takes_part;
            if changes && !pair.manifolds.is_empty() {
                update = Update::Reshaped;
            }
            (usize::from(update != Update::Reused), update == Update::Reshaped)
        };
        let both = |x: (usize, bool), y: (usize, bool)| (x.0 + y.0, x.1 | y.1);
        let updates = self.pairs.par_iter_mut().with_min_len(64).map_init(Scratch::default, update);
        let (computed, reshaped) = updates.reduce(|| (0, false), both);
        DetectStats { pairs: self.pairs.len(), computed, reshaped }
    }
}

fn key(i: u32, j: u32) -> (u32, u32) {
    (i.min(j), i.max(j))
}

/// A box that overlaps nothing, far from everything.
fn empty_box() -> Aabb {
    Aabb::new(glam::Vec3::splat(f32::MAX / 4.0), glam::Vec3::splat(f32::MAX / 4.0))
}

fn is_finite(aabb: &Aabb) -> bool {
    aabb.mins.is_finite() && aabb.maxs.is_finite()
}
