//! The contacts of all worlds, which persist from step to step.

use std::collections::HashSet;

use rayon::prelude::*;

use super::collider::{Activity, BodyState, ColliderInfo, Margins};
use super::guard::Extent;
use super::manifold::MAX_POINTS;
use super::pair::Pair;
use super::pairs::Placed;
use super::places::Places;
use super::report::{Change, DetectStats};
use super::sensors::{Overlap, Visitors};
use super::teleport::{LastPose, Teleports};
use super::world_contacts::{ColliderRange, DetectionInput, PlacedBody, WorldContacts, key};
use crate::config::SolverConfig;
use crate::error::{Result, ensure};
use crate::saved::{Archive, Saved};
use crate::world::{Body, BodyKind, Groups, Joint, World};

/// A collider: its body, and its index on that body.
pub(crate) type ColliderSide = (u32, u32);

/// Whether two colliders may touch, the one of the body with the smaller index first.
pub(crate) type PairFilter<'a> = dyn FnMut([ColliderSide; 2]) -> bool + 'a;

/// Finds the contacts of one world or of several worlds beside each other, and keeps them from step to step.
#[derive(Default)]
pub struct Detector {
    pub(super) worlds: Vec<WorldContacts>,
    /// The known bodies, by index.
    pub(super) known: Vec<KnownBody>,
    pub(super) kinds: Vec<BodyKind>,
    pub(super) groups: Vec<Groups>,
    /// The bodies at the last detection.
    pub(super) moving: Vec<BodyState>,
    /// The sizes of the bodies; empty if they have to be computed.
    pub(super) extents: Vec<Extent>,
    /// The pose of each body after the last step. The `sleep` module, which builds on the detector, keeps the state
    /// that decides whether a body can sleep.
    left: Vec<LastPose>,
    /// Displacement by gravity in one step, in each world (m).
    falls: Vec<f32>,
    /// Pairs of bodies that a joint keeps from colliding, the smaller index first.
    pub(super) jointed: HashSet<(u32, u32)>,
    /// The result of the last call of [`Self::sense`].
    overlaps: Vec<Overlap>,
    /// Colliders that pass through each other in this step.
    pub(super) refused: HashSet<[ColliderSide; 2]>,
}

crate::saved::cloned!(Detector {
    worlds,
    known,
    kinds,
    groups,
    extents,
    left,
    jointed,
    refused,
} scratch { moving, falls, overlaps });

/// A body, as the detector knows it.
#[derive(Clone, Copy, Default)]
pub(super) struct KnownBody {
    generation: u32,
    pub(super) world: u32,
    /// Its colliders in its world.
    pub(super) colliders: ColliderRange,
}

crate::saved::fields!(KnownBody { generation, world, colliders });

/// Pairs of bodies that a joint keeps from colliding, the smaller index first.
fn jointed(world: &World) -> HashSet<(u32, u32)> {
    let apart = world.enabled_joints().filter(|joint| !joint.collide);
    let ends = |joint: &Joint| (joint.body_a.index() as u32, joint.body_b.map(|b| b.index() as u32));
    apart.map(ends).filter_map(|(a, b)| Some(key(a, b?))).collect()
}

impl Detector {
    /// Writes or reads all lasting state, for the bodies of `world`. `base` is a guess of the prediction distance: a
    /// share of the size of a pair, and an additional length (m).
    pub(crate) fn walk<A: Archive>(&mut self, world: &World, base: [f32; 2], archive: &mut A) -> Result<()> {
        let bodies = archive.count(self.known.len())?;
        if A::READS {
            self.extents.clear();
            self.known.resize(bodies, KnownBody::default());
            self.kinds.resize(bodies, BodyKind::Fixed);
            self.groups.resize(bodies, Groups::ALL);
            self.left.resize(bodies, LastPose::default());
        }
        // Whether each body has the colliders that it has in the world, and whether it has the pose that the last step
        // left.
        let (mut are_current, mut are_left) = (vec![false; bodies], vec![false; bodies]);
        let mut end = 0;
        archive.runs(bodies, |i, archive| {
            let mut known = self.known[i];
            if let Some(body) = world.bodies.get(i).filter(|_| !A::READS) {
                (are_current[i], are_left[i]) = (self.has_shapes_of(i, known, body), self.left[i].is_of(body));
            }
            known.generation.walk(archive)?;
            known.world.walk(archive)?;
            known.colliders.count.walk(archive)?;
            // The colliders of most bodies follow those of the body before.
            let mut is_behind = known.colliders.first == end;
            is_behind.walk(archive)?;
            if !is_behind {
                known.colliders.first.walk(archive)?;
            } else {
                known.colliders.first = end;
            }
            self.kinds[i].walk(archive)?;
            self.groups[i].walk(archive)?;
            are_left[i].walk(archive)?;
            are_current[i].walk(archive)?;
            end = known.colliders.first.wrapping_add(known.colliders.count);
            self.known[i] = known;
            Ok(())
        })?;
        for (i, left) in self.left.iter_mut().enumerate() {
            match world.bodies.get(i).filter(|_| are_left[i]) {
                Some(body) => *left = LastPose::of(body),
                None => left.walk(archive)?,
            }
        }
        self.jointed.walk(archive)?;
        let parts = archive.count(self.worlds.len())?;
        self.worlds.resize_with(parts, WorldContacts::default);
        for (part, own) in (0..).zip(&mut self.worlds) {
            own.walk_places(archive)?;
            let known = self.known.iter().zip(&are_current).enumerate().filter(|(_, (known, _))| known.world == part);
            let bodies = known.map(|(i, (known, &is_current))| PlacedBody {
                index: i as u32,
                colliders: known.colliders,
                body: world.bodies.get(i),
                is_current,
            });
            own.walk_contacts(&bodies.collect::<Vec<_>>(), world, base, archive)?;
        }
        ensure(self.known.iter().all(|known| (known.world as usize) < parts), || {
            format!("a body is in none of {parts} worlds")
        })
    }

    /// The kinds of the known bodies.
    pub(crate) fn kinds(&self) -> &[BodyKind] {
        &self.kinds
    }

    /// All pairs, each with its world and its index there.
    pub(crate) fn placed_pairs(&self) -> impl Iterator<Item = ([u32; 2], &Pair)> {
        (0..)
            .zip(&self.worlds)
            .flat_map(|(part, world)| (0..).zip(&world.pairs[..]).map(move |(i, pair)| ([part, i], pair)))
    }

    /// A detector for the present bodies of `world`.
    pub fn new(world: &World) -> Self {
        let mut detector = Self { jointed: jointed(world), ..Self::default() };
        detector.follow_bodies(world, &(0..world.bodies.len()).collect::<Vec<_>>());
        detector
    }

    /// The bodies that were added or removed, or that changed kind, groups or shapes, since the last
    /// [`Self::follow_bodies`], and the bodies for which `fits` returns false. In ascending order.
    pub fn changed_bodies(&self, world: &World, fits: impl Fn(usize, &Body) -> bool + Sync) -> Vec<usize> {
        let (generations, worlds) = (world.bodies.generations(), world.bodies.worlds());
        let is_other = |i: usize| {
            let (Some(known), Some(body)) = (self.known.get(i), world.bodies.get(i)) else { return true };
            let same_place = known.generation == generations[i] && known.world == worlds[i];
            let same = same_place && self.kinds[i] == body.kind && self.groups[i] == body.groups;
            !same || !self.has_shapes_of(i, *known, body) || !fits(i, body)
        };
        let all = (0..world.bodies.len().max(self.known.len())).into_par_iter().with_min_len(1024);
        // In most steps no body changes, and nothing is allocated.
        if all.clone().any(is_other) { all.filter(|&i| is_other(i)).collect() } else { Vec::new() }
    }

    fn has_shapes_of(&self, i: usize, known: KnownBody, body: &Body) -> bool {
        let colliders = self.worlds[known.world as usize].colliders(known.colliders);
        colliders.len() == body.colliders.len() && colliders.iter().zip(&body.colliders).all(|(c, now)| c.is(i, now))
    }

    /// Updates the bodies that [`Self::changed_bodies`] found. Their contacts end.
    pub fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        self.extents.clear();
        let count = world.bodies.len().max(self.known.len());
        self.known.resize(count, KnownBody::default());
        self.kinds.resize(count, BodyKind::Fixed);
        self.groups.resize(count, Groups::ALL);
        self.worlds.resize(self.worlds.len().max(world.world_count()), WorldContacts::default());
        // Remove all colliders before adding any, so that the order of indices does not decide which places are free.
        for &i in changed {
            let KnownBody { world, colliders, .. } = self.known[i];
            self.worlds[world as usize].remove(colliders);
        }
        for &i in changed.iter().filter(|&&i| i < world.bodies.len()) {
            let (body, part) = (&world.bodies[i], world.bodies.worlds()[i]);
            let colliders = self.worlds[part as usize].insert(i as u32, &body.colliders);
            self.known[i] = KnownBody { generation: world.bodies.generations()[i], world: part, colliders };
            (self.kinds[i], self.groups[i]) = (body.kind, body.groups);
        }
        self.known.truncate(world.bodies.len());
        self.kinds.truncate(world.bodies.len());
        self.groups.truncate(world.bodies.len());
        self.left.resize(world.bodies.len(), LastPose::default());
        changed
            .iter()
            .filter(|&&i| i < world.bodies.len())
            .for_each(|&i| self.left[i] = LastPose::of(&world.bodies[i]));
    }

    /// Whether the caller moved a body since [`Self::note_left`].
    pub fn is_teleported(&self, world: &World, i: usize) -> bool {
        world.bodies.get(i).zip(self.left.get(i)).is_some_and(|(body, left)| LastPose::of(body) != *left)
    }

    /// Ends the contacts of bodies that the caller moved since [`Self::note_left`].
    pub fn end_teleported(&mut self, world: &World) {
        if let Some(teleports) = Teleports::find(&self.left, &world.bodies) {
            self.worlds.iter_mut().for_each(|part| teleports.end_contacts(&self.kinds, &mut part.pairs));
        }
    }

    /// Records the poses of the bodies after a step.
    pub fn note_left(&mut self, world: &World) {
        world.bodies.par_iter().with_min_len(1024).map(LastPose::of).collect_into_vec(&mut self.left);
    }

    /// Updates the pairs of bodies that joints keep from colliding.
    pub fn follow_joints(&mut self, world: &World) {
        let jointed = jointed(world);
        if jointed != self.jointed {
            self.jointed = jointed;
            self.worlds.iter_mut().for_each(WorldContacts::look_again);
        }
    }

    /// Whether the last detection knew the body at this index.
    pub fn knows(&self, world: &World, body: usize) -> bool {
        let now = world.bodies.generations().get(body);
        !world.bodies.is_vacant(body) && self.known.get(body).map(|known| &known.generation) == now
    }

    /// Whether any collider is a sensor.
    pub fn has_sensors(&self) -> bool {
        self.worlds.iter().any(WorldContacts::has_sensors)
    }

    /// The colliders that overlap sensors at the poses of `world`, in any order. Call it after the detection of the
    /// step that led to these poses.
    pub fn sense(&mut self, world: &World, activity: &[Activity]) -> &[Overlap] {
        let Self { worlds, kinds, groups, jointed, overlaps, .. } = self;
        overlaps.clear();
        let visitors = Visitors { bodies: &world.bodies, kinds, groups, activity, jointed };
        worlds.iter_mut().for_each(|world| world.sense(&visitors, overlaps));
        overlaps
    }

    /// The pairs whose boxes overlap, with their manifolds, world by world. The order is the same for any thread count.
    /// Within a world it does not depend on the other worlds.
    pub fn pairs(&self) -> impl Iterator<Item = &Pair> + Clone {
        self.worlds.iter().flat_map(|world| world.pairs.iter())
    }

    /// Reports changes since the last call. The listener gives slots to manifolds that have none, and removes ended
    /// manifolds.
    pub(crate) fn take_changes(&mut self, tell: &mut dyn FnMut(Change)) {
        (0..).zip(&mut self.worlds).for_each(|(index, world)| world.take_changes(index, tell));
    }

    /// The colliders of `world` at their present poses. The tree of the last detection only decides which of them are
    /// stored near each other, so the world may have changed in any way.
    pub(crate) fn places(&self, world: &World) -> Vec<Places> {
        let count = |i: usize| {
            let known = self.known.get(i).filter(|known| known.world == world.bodies.worlds()[i]);
            known.map_or(0, |known| known.colliders.count as usize)
        };
        let standing =
            |part: usize| self.worlds.get(part).map(|contacts| contacts.standing(|i| self.known[i].colliders));
        Places::of(world, count, standing)
    }

    /// A pair by its world and its index there.
    pub fn pair(&self, world: u32, pair: u32) -> &Pair {
        &self.worlds[world as usize].pairs[pair as usize]
    }

    /// The same, to give slots to its manifolds.
    pub(crate) fn pair_mut(&mut self, world: u32, pair: u32) -> &mut Pair {
        &mut self.worlds[world as usize].pairs[pair as usize]
    }

    /// The poses of the bodies of a pair when its manifolds were computed. Returns `None` if they never were, or if a
    /// body is out of range.
    pub fn computed_at(&self, world: u32, pair: u32) -> Option<&[Placed; 2]> {
        self.worlds[world as usize].pairs.computed_at(pair as usize)
    }

    /// The places of the pairs that take part in the step and have manifolds, in the order of [`Self::pairs`].
    pub(crate) fn taking_part(&self) -> Vec<[u32; 2]> {
        let wanted = self.placed_pairs().filter(|(_, pair)| pair.takes_part && !pair.manifolds.is_empty());
        wanted.map(|(place, _)| place).collect()
    }

    /// Keeps those points of the manifolds of a pair for which `kept` is true, until the next detection computes the
    /// pair again. If no point is left, the colliders pass through each other. `is_reused`: the manifolds are those of
    /// the step before.
    pub(crate) fn drop_points(&mut self, [part, pair]: [u32; 2], kept: &[[bool; MAX_POINTS]], is_reused: bool) {
        let Self { worlds, refused, .. } = self;
        let own = worlds[part as usize].drop_points(pair, kept, is_reused);
        if !own.is_touching() {
            refused.insert(own.sides());
        }
    }

    /// Whether two colliders pass through each other in this step.
    pub(super) fn is_refused(&self, a: &ColliderInfo, b: &ColliderInfo) -> bool {
        !self.refused.is_empty() && self.refused.contains(&in_order([a, b].map(|c| (c.body, c.index))))
    }

    /// Updates the pairs to the poses of `world`, for a step of `dt` seconds. Reused manifolds stay unchanged, and
    /// their pairs keep the poses at which they were computed. Pairs without an active body stay unchanged and take no
    /// part in the step. Without `activity`, all pairs take part. Pairs that `filter` refuses have no manifolds.
    pub fn detect(
        &mut self,
        world: &World,
        config: &SolverConfig,
        dt: f32,
        activity: &[Activity],
        filter: Option<&mut PairFilter>,
    ) -> DetectStats {
        let state = |i: usize| activity.get(i).copied().unwrap_or(Activity::Awake);
        let moving = |(i, body): (usize, &Body)| BodyState::of(body, state(i), world.gravity_at(i));
        world.bodies.par_iter().enumerate().with_min_len(256).map(moving).collect_into_vec(&mut self.moving);
        for (a, b) in world.enabled_joints().map(Joint::indices) {
            [Some(a), b].into_iter().flatten().for_each(|body| self.moving[body].tied = 1.0);
        }
        self.falls.clear();
        self.falls.resize(self.worlds.len(), 1.0);
        for (state, &part) in self.moving.iter().zip(world.bodies.worlds()) {
            let largest = &mut self.falls[part as usize];
            *largest = largest.max(state.gravity_scale);
        }
        (0..).zip(&mut self.falls).for_each(|(part, fall)| *fall *= world.gravity_of(part).length() * dt * dt);
        let margins = |fall: f32| Margins {
            speculative: config.speculative_margin,
            recycle: config.recycle_distance,
            fall,
            dt,
            substep: dt / config.substeps as f32,
        };
        let input = |fall: f32| DetectionInput {
            margins: margins(fall),
            kinds: &self.kinds,
            groups: &self.groups,
            moving: &self.moving,
            activity,
            jointed: &self.jointed,
        };
        let worlds = self.worlds.par_iter_mut().zip(&self.falls);
        if filter.is_none() && self.refused.is_empty() {
            let detected = worlds.map(|(world, &fall)| world.detect(&input(fall)));
            return detected.reduce(DetectStats::default, DetectStats::and);
        }
        let parted: Vec<bool> = worlds.map(|(world, &fall)| world.broad_phase(&input(fall))).collect();
        self.refused.clear();
        let (mut filter, moving) = (filter, &self.moving);
        for part in &mut self.worlds {
            part.filter(moving, filter.as_deref_mut(), &mut self.refused);
        }
        let worlds = self.worlds.par_iter_mut().zip(&self.falls).zip(parted);
        let detected = worlds.map(|((world, &fall), parted)| world.narrow_phase(&input(fall), parted));
        detected.reduce(DetectStats::default, DetectStats::and)
    }
}

/// Two colliders, the one of the body with the smaller index first.
pub(super) fn in_order([a, b]: [ColliderSide; 2]) -> [ColliderSide; 2] {
    [a.min(b), a.max(b)]
}
