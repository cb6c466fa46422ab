//! The surroundings of a character in the next step, and its motion among them.

use glam::{DVec3, Quat, Vec3};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Pose;

use super::nearest::{HalfSpace, nearest};
use super::{Character, Ground};
use crate::collide::{Clearance, clearances};
use crate::math::rotation::{about, product, unit};
use crate::queries::{Filter, Hit, Predicate, Queries};
use crate::world::{Body, BodyHandle, BodyKind, Collider, Shape, World, placed, pose};

/// Distance at which the character touches, relative to its margin.
const NEAR: f32 = 1.25;
/// Error of a distance, relative to the margin.
const EXACT: f32 = 1e-3;
/// Error of the cosine of a slope.
const SLOPE: f32 = 1e-4;
/// Largest number of pieces of one motion.
const PIECES: u32 = 24;
/// Shares of the way out of an overlap, tried in this order. With a share of 0, every set of planes has a solution.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.0];
/// Planes hold a unit vector if they leave less than this length of it.
const HELD: f64 = 1e-3;

/// A plane between the character and a collider near it.
pub(super) struct Touch {
    pub hit: Hit,
    /// The most level normal of the surface at the point.
    upright: Vec3,
    pub is_near: bool,
}

/// The end of a motion.
pub(super) struct Glide {
    /// Position of the body (m).
    pub at: Vec3,
    /// The surfaces near there.
    pub touches: Vec<Touch>,
}

/// The surfaces that carry the character.
#[derive(Clone, Copy)]
pub(super) enum Footing {
    /// Surfaces up to a step above its feet.
    Feet,
    /// Surfaces up to a step above this height (m).
    Level(f32),
    /// In the air: surfaces that are level at the contact itself, without a step height.
    Air,
}

/// The world around a character at the end of the next step: kinematic bodies and the ground are where they will be.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'a> {
    world: &'a World,
    queries: &'a Queries<'a>,
    own: &'a Body,
    filter: Filter<'a>,
    ground: Option<BodyHandle>,
    /// A body that does not count.
    without: Option<BodyHandle>,
    dt: f32,
    up: Vec3,
    /// Cosine of the steepest slope.
    cosine: f32,
    /// Height of the lowest point relative to the body (m).
    lowest: f32,
    /// Largest step (m).
    pub step: f32,
    margin: f32,
    /// Error of a position (m).
    pub exact: f32,
    /// Largest distance by which a moving body moves (m).
    moved: f32,
}

impl<'a> Surroundings<'a> {
    /// `ground` is the body on which the character stands. Only bodies count for which `only` returns true, if given.
    pub fn new(
        world: &'a World,
        queries: &'a Queries<'a>,
        character: &Character,
        ground: Option<BodyHandle>,
        only: Option<Predicate<'a>>,
        dt: f32,
    ) -> Self {
        let (own, part) = (&world.bodies[character.body.index()], world.bodies.worlds()[character.body.index()]);
        let up = character.up;
        let end = |up: Vec3| {
            let height = |collider: &Collider| {
                let local = placed(pose(Vec3::ZERO, own.rotation), pose(collider.position, collider.rotation));
                let support = collider.shape.0.as_support_map().map(|map| map.support_point(&local, up));
                support.map_or(0.0, |point| up.dot(point))
            };
            own.solids().map(height).fold(f32::NEG_INFINITY, f32::max)
        };
        let (highest, lowest) = (end(up), -end(-up));
        let margin = character.margin * own.smallest_half_extent();
        let mut around = Self {
            world,
            queries,
            own,
            filter: Filter { only, ..Filter::default().groups(own.groups).world(part as usize).except(character.body) },
            ground,
            without: None,
            dt,
            up,
            cosine: libm::cosf(character.steepest) - SLOPE,
            lowest,
            step: character.step_height * (highest - lowest),
            margin,
            exact: (EXACT * margin).max(4.0 * f32::EPSILON * own.position.abs().max_element()),
            moved: 0.0,
        };
        let moving = world.bodies.handles().filter(|&body| body != character.body && around.moves(body));
        let far = |body: BodyHandle| {
            let body = &world.bodies[body.index()];
            (body.linear_velocity.length() + body.angular_velocity.length() * body.reach()) * dt
        };
        around.moved = moving.map(far).fold(0.0, f32::max);
        around
    }

    /// The same without a body.
    pub fn beside(&self, body: BodyHandle) -> Self {
        Self { without: Some(body), ..*self }
    }

    /// The body, if it is dynamic.
    pub fn dynamic(&self, body: BodyHandle) -> Option<&'a Body> {
        self.world.body(body).filter(|body| body.kind == BodyKind::Dynamic)
    }

    /// Whether the character goes along with a body or out of its way.
    fn moves(&self, body: BodyHandle) -> bool {
        Some(body) == self.ground || self.world.bodies[body.index()].is_driven()
    }

    /// The pose of a body that moves at the end of the step.
    fn ahead(&self, body: &Body) -> Pose {
        let (center, speed) = (body.center_of_mass() + self.dt * body.linear_velocity, body.angular_velocity.length());
        let turn = if speed > 0.0 { about(body.angular_velocity / speed, speed * self.dt) } else { Quat::IDENTITY };
        let rotation = unit(product(turn, body.rotation));
        pose(center - rotation * body.mass.center, rotation)
    }

    /// Height of the ground under the feet at a position (m).
    pub fn feet(&self, at: Vec3) -> f32 {
        self.up.dot(at) + self.lowest - self.margin
    }

    /// The part of a vector across the vertical.
    pub fn across(&self, v: Vec3) -> Vec3 {
        v - v.dot(self.up) * self.up
    }

    /// How far the ground takes the point under the feet in the step (m).
    pub fn carried(&self, at: Vec3) -> Vec3 {
        let Some(ground) = self.ground.and_then(|ground| self.world.body(ground)) else { return Vec3::ZERO };
        if ground.linear_velocity == Vec3::ZERO && ground.angular_velocity == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let foot = at + (self.lowest - self.margin) * self.up;
        let local = ground.rotation.inverse() * (foot - ground.position);
        let ahead = self.ahead(ground);
        ahead.translation + ahead.rotation * local - foot
    }

    /// The velocity of a touched surface, if the character gives way to it (m/s).
    pub fn velocity_of(&self, touch: &Touch) -> Vec3 {
        let body = touch.hit.body;
        if self.moves(body) { self.world.bodies[body.index()].velocity_at(touch.hit.point) } else { Vec3::ZERO }
    }

    /// All surfaces that are nearer than `within` (m) to the character at a position, sorted by index.
    fn touches(&self, at: Vec3, within: f32) -> Vec<Touch> {
        let mut touches = Vec::new();
        for own in self.own.solids() {
            let own_pose = placed(pose(at, self.own.rotation), pose(own.position, own.rotation));
            let bounds = own.shape.0.compute_aabb(&own_pose).loosened(within + self.moved);
            self.queries.near(&self.filter, (bounds.mins, bounds.maxs), |body, index, collider, stood| {
                if Some(body) == self.without {
                    return;
                }
                let moved = || {
                    let frame = self.ahead(&self.world.bodies[body.index()]);
                    placed(frame, pose(collider.position, collider.rotation))
                };
                let stood = if self.moves(body) { moved() } else { stood };
                let tell = &mut |clearance| {
                    let Clearance { normal, distance, point, upright } = clearance;
                    let hit = Hit { body, collider: index, distance, point, normal };
                    touches.push(Touch { hit, upright, is_near: distance <= NEAR * self.margin });
                };
                let beside = &mut |at: Vec3, around: f32, with: &mut dyn FnMut(&Shape, Pose)| {
                    self.each_beside((body, index), at, around, with);
                };
                clearances((&collider.shape, &stood), (&own.shape, &own_pose), within, self.up, beside, tell);
            });
        }
        touches.sort_by_key(|touch| (touch.hit.body, touch.hit.collider));
        touches
    }

    /// Calls `with` on the fixed colliders near a point beside a fixed collider, sorted by index.
    fn each_beside(
        &self,
        (body, index): (BodyHandle, usize),
        at: Vec3,
        around: f32,
        with: &mut dyn FnMut(&Shape, Pose),
    ) {
        let is_fixed = |body: BodyHandle| self.world.bodies[body.index()].kind == BodyKind::Fixed;
        if !is_fixed(body) {
            return;
        }
        let mut near = Vec::new();
        let bounds = (at - Vec3::splat(around), at + Vec3::splat(around));
        self.queries.near(&self.filter, bounds, |other, k, collider, stood| {
            if (other, k) != (body, index) && Some(other) != self.without && is_fixed(other) {
                near.push((other, k, collider.shape.clone(), stood));
            }
        });
        near.sort_by_key(|&(other, k, ..)| (other, k));
        near.iter().for_each(|(.., shape, stood)| with(shape, *stood));
    }

    /// Whether a contact carries the character at a position.
    fn carries(&self, touch: &Touch, at: Vec3, footing: Footing) -> bool {
        let is_level = |normal: Vec3| normal.dot(self.up) >= self.cosine;
        let is_step =
            |level: f32| is_level(touch.upright) && self.up.dot(touch.hit.point) <= level + self.step + self.exact;
        match footing {
            Footing::Feet => is_level(touch.hit.normal) || is_step(self.feet(at)),
            Footing::Level(level) => is_step(level),
            Footing::Air => is_level(touch.hit.normal),
        }
    }

    /// Moves by `by` past all obstacles, to the place nearest to its aim.
    pub fn glide(&self, from: Vec3, by: Vec3, footing: Footing) -> Glide {
        self.travel(from, by, footing, false)
    }

    /// Moves down by up to `by` (m), until a surface carries it.
    pub fn lower(&self, from: Vec3, by: f32, footing: Footing) -> Glide {
        self.travel(from, -by * self.up, footing, true)
    }

    fn travel(&self, from: Vec3, by: Vec3, footing: Footing, is_held: bool) -> Glide {
        let (aim, mut at) = (from + by, from);
        for _ in 0..PIECES {
            let rest = aim - at;
            let touches = self.touches(at, rest.length() + 2.0 * self.margin);
            let piece = self.piece(rest, &touches, (at, footing), is_held);
            if piece.length() <= self.exact {
                return Glide { at, touches };
            }
            at += piece;
        }
        Glide { at, touches: self.touches(at, 2.0 * self.margin) }
    }

    /// The vector nearest to `rest` that keeps the margin from everything. If `is_held`, it ends at surfaces that carry
    /// the character.
    fn piece(&self, rest: Vec3, touches: &[Touch], (at, footing): (Vec3, Footing), is_held: bool) -> Vec3 {
        let (mut spaces, mut holds) = (Vec::new(), Vec::new());
        for touch in touches {
            let Hit { normal, distance, .. } = touch.hit;
            let space = HalfSpace { normal: normal.as_dvec3(), least: f64::from(self.margin) - f64::from(distance) };
            let carries = self.carries(touch, at, footing);
            if carries && is_held {
                holds.push(space);
                continue;
            }
            spaces.push(space);
            let across = self.across(normal).as_dvec3();
            if !carries && normal.dot(self.up) > 0.0 && across.length() > f64::from(SLOPE) {
                // A wall at the place where the slope has this height.
                let steepness = across.length();
                spaces.push(HalfSpace { normal: across / steepness, least: space.least.min(0.0) / steepness });
            }
        }
        let piece = out_of_overlaps(rest.as_dvec3(), &spaces);
        // Rounding of nearly parallel planes must not cause an overlap either.
        let loose = spaces.iter().map(|space| (space, 0.1 * f64::from(self.exact)));
        let fixed = holds.iter().map(|space| (space, 0.0));
        let share = loose.chain(fixed).fold(1.0_f64, |share, (space, error)| {
            let (least, way) = (space.least.min(0.0), space.normal.dot(piece));
            if way < least - error { share.min(least / way) } else { share }
        });
        (share * piece).as_vec3()
    }

    /// The ground: a surface that carries the character, or several surfaces that hold it together. The velocity in the
    /// result is zero.
    pub fn stands(&self, glide: &Glide, footing: Footing) -> Option<Ground> {
        let level = |normal: Vec3| normal.dot(self.up);
        let near = || glide.touches.iter().filter(|touch| touch.is_near);
        let best = |a: &'_ Touch, b: &'_ Touch| level(b.upright) > level(a.upright);
        let carrier = near().filter(|touch| self.carries(touch, glide.at, footing));
        if let Some(touch) = carrier.reduce(|a, b| if best(a, b) { b } else { a }) {
            return Some(self.ground_of(touch, touch.upright));
        }
        let spaces: Vec<HalfSpace> =
            near().map(|touch| HalfSpace { normal: touch.hit.normal.as_dvec3(), least: 0.0 }).collect();
        let is_held = nearest(-self.up.as_dvec3(), &spaces).is_some_and(|left| left.length() < HELD);
        let highest = near().reduce(|a, b| if level(b.hit.normal) > level(a.hit.normal) { b } else { a });
        highest.filter(|_| is_held).map(|touch| self.ground_of(touch, self.up))
    }

    /// A touched surface as ground at rest.
    fn ground_of(&self, Touch { hit, .. }: &Touch, normal: Vec3) -> Ground {
        let body = &self.world.bodies[hit.body.index()];
        let surface_velocity = body.rotation * body.material_of(hit.collider).surface_velocity;
        Ground { body: hit.body, normal, velocity: Vec3::ZERO, surface_velocity }
    }

    /// The part of a velocity that near surfaces allow (m/s).
    pub fn clipped(&self, velocity: Vec3, touches: &[Touch]) -> Vec3 {
        let near = touches.iter().filter(|touch| touch.is_near);
        let space = |touch: &Touch| {
            let normal = touch.hit.normal;
            HalfSpace { normal: normal.as_dvec3(), least: f64::from(normal.dot(self.velocity_of(touch))) }
        };
        let left = nearest(velocity.as_dvec3(), &near.map(space).collect::<Vec<_>>());
        left.map_or(Vec3::ZERO, DVec3::as_vec3)
    }
}

/// The vector nearest to `rest` that leads out of overlaps and deepens none.
///
/// An overlap cannot end if others become deeper on every way out of it. It waits, and the rest of them end: the mean of
/// motions that each lead out of one overlap leads out of all of those.
fn out_of_overlaps(rest: DVec3, spaces: &[HalfSpace]) -> DVec3 {
    let within = |share: &dyn Fn(usize) -> f64| {
        let eased = |(k, space): (usize, &HalfSpace)| {
            let least = space.least.min(share(k) * space.least);
            HalfSpace { least, ..*space }
        };
        nearest(rest, &spaces.iter().enumerate().map(eased).collect::<Vec<_>>())
    };
    let one_by_one = || {
        let alone = |k: usize| {
            let ends = |share: &f64| within(&|other| if other == k { *share } else { 0.0 }).is_some();
            SHARES.into_iter().find(ends).unwrap_or(0.0)
        };
        let most: Vec<f64> = (0..spaces.len()).map(alone).collect();
        SHARES.into_iter().find_map(|share| within(&|k| share * most[k]))
    };
    within(&|_| 1.0).or_else(one_by_one).unwrap_or(DVec3::ZERO)
}
