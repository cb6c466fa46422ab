//! The contacts of all worlds, kept from step to step.

use std::collections::HashSet;
use std::ops::Range;

use parry3d::math::Pose;
use rayon::prelude::*;

use super::collider::Activity;
use super::collider::{BodyState, ColliderInfo, Margins};
use super::pair::Pair;
use super::pairs::Placed;
use super::report::{Change, DetectStats};
use super::world_contacts::{DetectionInput, WorldContacts, key};
use crate::config::SolverConfig;
use crate::error::{Result, input};
use crate::world::{Body, BodyKind, Collider, World};

/// Finds the contacts of a world, or of several beside each other, and keeps them from step to step.
#[derive(Clone)]
pub struct Detector {
    worlds: Vec<WorldContacts>,
    kinds: Vec<BodyKind>,
    moving: Vec<BodyState>,
    /// Pairs of bodies that a joint keeps from colliding, the smaller index first.
    jointed: HashSet<(u32, u32)>,
    /// First body of each world but the first.
    begins: Vec<usize>,
}

/// The advice for bodies that came, went or changed.
const ANEW: &str = "bodies cannot come, go or change kind or shape yet; make a new simulation of this world";

/// Pairs of bodies that a joint keeps from colliding, the smaller index first.
fn jointed(world: &World) -> HashSet<(u32, u32)> {
    let apart = world.joints.iter().filter(|joint| !joint.collide);
    apart.filter_map(|joint| Some(key(joint.body_a as u32, joint.body_b? as u32))).collect()
}

impl Detector {
    /// A detector for the bodies of `world`, whose number, shapes and kinds stay as they are.
    pub fn new(world: &World) -> Self {
        let collider = |(body, c): (usize, &Collider)| {
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
        let contacts = |bodies: Range<usize>| {
            let on_body = |i: usize| world.bodies[i].colliders.iter().map(move |c| (i, c));
            WorldContacts::new(bodies.flat_map(on_body).map(collider).collect())
        };
        Self {
            worlds: world.worlds().map(contacts).collect(),
            kinds: world.bodies.iter().map(|b| b.kind).collect(),
            moving: Vec::new(),
            jointed: jointed(world),
            begins: world.begins.clone(),
        }
    }

    /// Refuses a world whose bodies are not those that this detector was made for.
    ///
    /// # Errors
    /// One line that names the first body that came, went, or changed kind or shape.
    pub fn check_bodies(&self, world: &World) -> Result<()> {
        let (had, has) = (self.kinds.len(), world.bodies.len());
        if had != has || world.begins != self.begins {
            return Err(input!(
                "there are {has} bodies in {} worlds, and there were {had} in {} when its simulation began: {ANEW}",
                world.begins.len() + 1,
                self.begins.len() + 1
            ));
        }
        let begin = |k: usize| if k == 0 { 0 } else { self.begins[k - 1] };
        let end = |k: usize| self.begins.get(k).copied().unwrap_or(has);
        let worlds = self.worlds.par_iter().enumerate();
        let changed = worlds.find_map_first(|(k, part)| self.first_changed(world, part, begin(k)..end(k)));
        let Some(i) = changed else { return Ok(()) };
        let name = &world.bodies[i].name;
        Err(input!("body {i} {name:?} changed its kind or shapes: {ANEW}"))
    }

    /// The first body of a part of the world that changed its kind or shapes.
    fn first_changed(&self, world: &World, part: &WorldContacts, bodies: Range<usize>) -> Option<usize> {
        const CHUNK: usize = 512;
        let chunks = world.bodies[bodies.clone()].par_chunks(CHUNK).zip(self.kinds[bodies.clone()].par_chunks(CHUNK));
        chunks.enumerate().find_map_first(|(chunk, (all, kinds))| {
            let first = bodies.start + CHUNK * chunk;
            let from = part.colliders().partition_point(|known| (known.body as usize) < first);
            let mut colliders = part.colliders()[from..].iter().peekable();
            let changed = |(i, (body, kind)): (usize, (&Body, &BodyKind))| {
                let same = |c: &Collider| colliders.next().is_some_and(|known| known.is(i, c));
                let all = body.kind == *kind && body.colliders.iter().all(same);
                (!all || colliders.peek().is_some_and(|next| next.body as usize == i)).then_some(i)
            };
            (first..).zip(all.iter().zip(kinds)).find_map(changed)
        })
    }

    /// Takes over which bodies joints keep from colliding.
    pub fn follow_joints(&mut self, world: &World) {
        let jointed = jointed(world);
        if jointed != self.jointed {
            self.jointed = jointed;
            self.worlds.iter_mut().for_each(WorldContacts::look_again);
        }
    }

    /// The pairs whose boxes overlap, with the manifolds they touch with, world by world. The order is the same for any
    /// thread count, and within a world whatever stands beside it.
    pub fn pairs(&self) -> impl Iterator<Item = &Pair> + Clone {
        self.worlds.iter().flat_map(|world| world.pairs.iter())
    }

    /// Tells what changed since the last call. The listener gives slots to manifolds that have none, and removes manifolds that ended.
    pub(crate) fn take_changes(&mut self, tell: &mut dyn FnMut(Change)) {
        (0..).zip(&mut self.worlds).for_each(|(index, world)| world.take_changes(index, tell));
    }

    /// A pair by its world and its place there.
    pub fn pair(&self, world: u32, pair: u32) -> &Pair {
        &self.worlds[world as usize].pairs[pair as usize]
    }

    /// The same, to give slots to its manifolds.
    pub(crate) fn pair_mut(&mut self, world: u32, pair: u32) -> &mut Pair {
        &mut self.worlds[world as usize].pairs[pair as usize]
    }

    /// Where the bodies of a pair were when its manifolds were computed; none if they never were, or a body is out of range.
    pub fn computed_at(&self, world: u32, pair: u32) -> Option<&[Placed; 2]> {
        self.worlds[world as usize].pairs.computed_at(pair as usize)
    }

    /// Brings the pairs to the poses of `world`, for a step of `dt` seconds: manifolds that are reused stay as they are, and
    /// their pairs know where the bodies were. Pairs of bodies that are still keep what they have, and take no part in
    /// the step; without `activity` all take part.
    pub fn detect(&mut self, world: &World, config: &SolverConfig, dt: f32, activity: &[Activity]) -> DetectStats {
        let state = |i: usize| activity.get(i).copied().unwrap_or(Activity::Awake);
        let moving = |(i, body): (usize, &Body)| BodyState::of(body, state(i));
        world.bodies.par_iter().enumerate().with_min_len(256).map(moving).collect_into_vec(&mut self.moving);
        let margins = Margins {
            speculative: config.speculative_margin,
            recycle: config.recycle_distance,
            fall: world.gravity.length() * dt * dt,
            dt,
        };
        let input =
            DetectionInput { margins, kinds: &self.kinds, moving: &self.moving, activity, jointed: &self.jointed };
        let detected = self.worlds.par_iter_mut().map(|world| world.detect(&input));
        detected.reduce(DetectStats::default, DetectStats::and)
    }
}
