//! Stops bodies that moved far in a step if their path passes through something.
//!
//! Contacts act along the paths that bodies would take without contact. But bodies bounce and push each other within a
//! step. If the path from the start of the step to its end still passes through fixed geometry, the body stops where
//! the two meet, and the next step has their contact.

use std::cell::Cell;
use std::collections::BTreeMap;

use glam::Vec3;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Pose;
use parry3d::shape::Ball;
use rayon::prelude::*;

use super::collider::{Activity, BodyState, ColliderInfo, FARTHEST, is_in_range, is_placed};
use super::detector::Detector;
use super::sensors::{Overlap, Visitors};
use super::sweep::{BodyPath, Impact, Station, Swept, Until, impact};
use super::world_contacts::{WorldContacts, box_reaches_plane, key};
use crate::graph::Islands;
use crate::math::rotation::product;
use crate::world::{Body, BodyKind, World, placed};

/// Displacement in a step from which the path of a body is checked, relative to its smallest half extent.
const FAR: f32 = 0.5;

/// Radius of a ball around the middle of a shape that must not pass through anything, relative to the smallest half
/// extent.
const HEART: f32 = 0.1;

/// Half of the smallest side of the thinnest collider of a body, and the radius around its origin that contains all of
/// them (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    thin: f32,
    reach: f32,
}

impl Extent {
    fn of(colliders: &[ColliderInfo]) -> Self {
        let none = Self { thin: f32::INFINITY, reach: 0.0 };
        colliders.iter().fold(none, |all, c| Self { thin: all.thin.min(c.size), reach: all.reach.max(c.reach) })
    }

    /// Whether a body moved far between two poses.
    fn is_far(self, then: &BodyState, now: &Body) -> bool {
        let shift = now.center_of_mass().distance(then.center);
        let turn = 2.0 * product(now.rotation, then.rotation.inverse()).xyz().length();
        shift + turn * (self.reach + then.center.distance(then.position)) > FAR * self.thin
    }
}

/// The place where a body is stopped.
#[derive(Clone, Copy)]
struct End {
    at: Station,
    /// Time of the stop, as a share of the step.
    share: f32,
    /// The normal along which the body loses its approach velocity, or zero. It belongs to a surface that the body
    /// touched at the start of the step. Its contact could not hold the body, because the body turns by a large angle
    /// in a step.
    against: Vec3,
    /// The velocity of that surface (m/s).
    pace: Vec3,
}

/// The path that a body took.
fn way(then: &BodyState, now: &Body, dt: f32) -> BodyPath {
    let begin = Station { center: then.center, rotation: then.rotation };
    let end = Station { center: now.center_of_mass(), rotation: now.rotation };
    BodyPath::between(begin, end, now.angular_velocity * dt)
}

impl Detector {
    /// The bodies that moved far in the step, in ascending order.
    fn far_bodies(&mut self, world: &World, activity: &[Activity]) -> Vec<u32> {
        if self.extents.len() != self.known.len() {
            let Self { extents, known, worlds, .. } = self;
            extents.clear();
            extents.extend(known.iter().map(|own| Extent::of(worlds[own.world as usize].colliders(own.colliders))));
        }
        let is_far = |&i: &usize| {
            let (then, now) = (&self.moving[i], &world.bodies[i]);
            now.kind != BodyKind::Fixed
                && activity.get(i) != Some(&Activity::Still)
                && self.extents[i].is_far(then, now)
                && then.in_range == 1.0
                && is_placed(now.position, now.rotation, FARTHEST)
        };
        let count = self.moving.len().min(world.bodies.len()).min(self.extents.len());
        let all = (0..count).into_par_iter().with_min_len(1024);
        // In most steps no body moves far, and nothing is allocated.
        if all.clone().any(|i| is_far(&i)) { all.filter(is_far).map(|i| i as u32).collect() } else { Vec::new() }
    }

    /// Stops bodies that moved far at the place where their path enters fixed geometry, after a step of `dt` seconds
    /// that led to the poses in `world`. Returns the bodies that moved far, and the stopped bodies that joints hold. A
    /// stopped body keeps its velocity, minus the change by gravity over the rest of the step. Constraints may have moved
    /// it further down than it would have fallen; then it also loses the work of gravity on the way that it did not take.
    pub fn hold(&mut self, world: &mut World, dt: f32, activity: &[Activity]) -> (Vec<u32>, Vec<usize>) {
        let far = self.far_bodies(world, activity);
        let is_dynamic = |&&i: &&u32| world.bodies[i as usize].kind == BodyKind::Dynamic;
        let ends = far.par_iter().filter(is_dynamic).filter_map(|&i| Some((i, self.end(world, i, dt)?)));
        let (ends, roots) = self.hold_joints(world, ends.collect(), dt);
        let is_tied = |i: u32| self.moving[i as usize].tied == 1.0;
        let root = |i: u32| if is_tied(i) { roots[i as usize] } else { i };
        // Kinetic energy, and energy gained by the stop, of bodies that joints hold together (J).
        let mut energies: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for &(i, End { at: Station { center, rotation }, share, against, pace }) in &ends {
            let (body, pull) = (&mut world.bodies[i as usize], self.moving[i as usize].pull);
            let undone = (body.mass.mass * pull).dot(body.center_of_mass() - center);
            let before = body.kinetic_energy() - f64::from(undone);
            body.linear_velocity -= (body.linear_velocity - pace).dot(against).min(0.0) * against;
            // In the frame of the body the spin is unchanged, and so is the energy.
            body.angular_velocity = rotation * (body.rotation.inverse() * body.angular_velocity);
            body.rotation = rotation;
            body.position = center - rotation * body.mass.center;
            body.linear_velocity -= (1.0 - share) * dt * pull;
            let after = body.kinetic_energy();
            let [kinetic, gained] = energies.entry(root(i)).or_default();
            (*kinetic, *gained) = (*kinetic + after, *gained + after - before);
        }
        for &(i, _) in &ends {
            let [kinetic, gained] = energies[&root(i)];
            if gained > 0.0 {
                let scale = (1.0 - gained / kinetic).max(0.0).sqrt() as f32;
                let body = &mut world.bodies[i as usize];
                body.linear_velocity *= scale;
                body.angular_velocity *= scale;
            }
        }
        let tied = ends.iter().filter(|(i, _)| is_tied(*i)).map(|(i, _)| *i as usize).collect();
        (far, tied)
    }

    /// Extends stops to jointed bodies. Bodies that joints hold together stay together: each one stops on its path at
    /// the time when the first of them stops. Also returns for each body one that stands for all that joints hold
    /// together with it; nothing if joints hold no stopped body.
    fn hold_joints(&self, world: &World, mut ends: Vec<(u32, End)>, dt: f32) -> (Vec<(u32, End)>, Vec<u32>) {
        let is_tied = |i: u32| self.moving[i as usize].tied == 1.0;
        if !ends.iter().any(|&(i, _)| is_tied(i)) {
            return (ends, Vec::new());
        }
        let is_dynamic = |i: usize| world.bodies[i].kind == BodyKind::Dynamic;
        let mut islands = Islands::default();
        islands.reset(world.bodies.len());
        for (a, b) in world.enabled_joints().filter_map(|joint| Some((joint.indices().0, joint.indices().1?))) {
            if is_dynamic(a) && is_dynamic(b) {
                islands.join(a as u32, b as u32);
            }
        }
        let roots = islands.roots();
        let mut first: Vec<Option<f32>> = vec![None; world.bodies.len()];
        for (i, end) in &ends {
            let share = &mut first[roots[*i as usize] as usize];
            *share = Some(share.map_or(end.share, |share| share.min(end.share)));
        }
        let own: BTreeMap<u32, End> = ends.iter().copied().collect();
        ends.retain(|&(i, _)| !is_tied(i));
        let held = (0..).zip(roots).filter(|&(i, _)| is_tied(i) && is_dynamic(i as usize));
        ends.extend(held.filter_map(|(i, root)| {
            let share = first[*root as usize]?;
            let end = || End { at: self.way_of(world, i, dt).at(share), share, against: Vec3::ZERO, pace: Vec3::ZERO };
            Some((i, own.get(&i).filter(|end| end.share == share).copied().unwrap_or_else(end)))
        }));
        let roots = roots.to_vec();
        (ends, roots)
    }

    /// The place where a body stops, or `None` if it does not.
    fn end(&self, world: &World, i: u32, dt: f32) -> Option<End> {
        let (then, now) = (&self.moving[i as usize], &world.bodies[i as usize]);
        let mut way = way(then, now, dt);
        let mut end = None;
        if let Some((Impact { time, normal, is_deep }, other)) = self.first_on(world, i, &way, dt, true) {
            // It goes on together with the body that it met.
            let Station { center, rotation } = way.at(time);
            let other = self.way_of(world, other, dt);
            let center = center + (1.0 - time) * other.shift;
            way = BodyPath::between(way.begin, Station { center, rotation }, time * way.turn);
            let against = if is_deep { normal } else { Vec3::ZERO };
            end = Some(End { at: Station { center, rotation }, share: time, against, pace: other.shift / dt });
        }
        match self.first_on(world, i, &way, dt, false) {
            Some((Impact { time, normal, is_deep }, _)) => Some(End {
                at: way.at(time),
                share: end.map_or(time, |end| time * end.share),
                against: if is_deep { normal } else { Vec3::ZERO },
                pace: Vec3::ZERO,
            }),
            None => end,
        }
    }

    fn way_of(&self, world: &World, i: u32, dt: f32) -> BodyPath {
        way(&self.moving[i as usize], &world.bodies[i as usize], dt)
    }

    /// The first obstacle of a body on its path, and the time: a moving one, or a fixed one. Of bodies that contacts
    /// can push, only a bullet meets moving obstacles.
    fn first_on(&self, world: &World, i: u32, way: &BodyPath, dt: f32, moves: bool) -> Option<(Impact, u32)> {
        let (known, then) = (self.known[i as usize], &self.moving[i as usize]);
        let part = &self.worlds[known.world as usize];
        let first: Cell<Option<(Impact, u32)>> = Cell::new(None);
        for c in part.colliders(known.colliders).iter().filter(|c| !c.sensor && !c.unbounded) {
            let own = Swept::new(c, then, way);
            let meet = |other: &ColliderInfo| {
                let is_fixed = self.is_still(world, other.body);
                let pair = key(i, other.body);
                let groups = [i, other.body].map(|body| self.groups[body as usize]);
                let is_pushed = self.kinds[other.body as usize] == BodyKind::Dynamic;
                let is_met = is_fixed != moves && (!is_pushed || world.bodies[i as usize].swept);
                if other.body == i || !is_met || !groups[0].meets(groups[1]) || self.jointed.contains(&pair) {
                    return;
                }
                if self.is_refused(c, other) {
                    return;
                }
                let others = self.way_of(world, other.body, dt);
                let until = if is_pushed { Until::Touch } else { Until::Deep };
                let standing = Swept::new(other, &self.moving[other.body as usize], &others);
                let found = impact(standing, own, c.size, until, true);
                // A body that gets too deep stops where the surfaces meet. A path can begin a little inside if the body
                // turned off a surface within the step.
                let found = match found {
                    Some(found) if !found.is_deep => impact(standing, own, c.size, Until::Touch, true).or(Some(found)),
                    found => found,
                };
                // If a body turns too fast for its path to be known, or is already deep, at least its middle does not
                // pass through.
                let heart = Ball::new(HEART * c.size);
                let middle = || impact(standing, own.heart(&heart), heart.radius, until, true);
                let found = [found, middle()].into_iter().flatten().min_by(|x, y| x.time.total_cmp(&y.time));
                // Of two obstacles at the same time, take the one with the smaller index.
                let is_first = |found: &Impact| {
                    first.get().is_none_or(|(known, body)| (found.time, other.body) < (known.time, body))
                };
                if let Some(found) = found.filter(is_first) {
                    first.set(Some((found, other.body)));
                }
            };
            part.meet_all(&own, &self.moving, meet);
        }
        first.get()
    }

    /// Whether a body kept its pose in the step and contacts cannot push it.
    fn is_still(&self, world: &World, i: u32) -> bool {
        let (then, now) = (&self.moving[i as usize], &world.bodies[i as usize]);
        let stays = || then.position == now.position && then.rotation == now.rotation;
        self.kinds[i as usize] == BodyKind::Fixed || self.kinds[i as usize] == BodyKind::Kinematic && stays()
    }

    /// The colliders that passed through a sensor in the step, with the time (s), for bodies that moved far. In
    /// ascending order.
    pub fn passed(&self, world: &World, dt: f32, activity: &[Activity], far: &[u32]) -> Vec<(Overlap, f32)> {
        let Self { kinds, groups, jointed, .. } = self;
        let visitors = Visitors { bodies: &world.bodies, kinds, groups, activity, jointed };
        let of_one = |&i: &u32| {
            let (known, then) = (self.known[i as usize], &self.moving[i as usize]);
            let part = &self.worlds[known.world as usize];
            let own_way = self.way_of(world, i, dt);
            let mut found: Vec<(Overlap, f32)> = Vec::new();
            for c in part.colliders(known.colliders).iter().filter(|c| !c.unbounded) {
                let own = Swept::new(c, then, &own_way);
                let mut meet = |other: &ColliderInfo| {
                    let (sensor, visitor) = if c.sensor { (c, other) } else { (other, c) };
                    if !sensor.sensor || !visitors.may_meet(sensor, visitor) {
                        return;
                    }
                    let others = self.way_of(world, other.body, dt);
                    let standing = Swept::new(other, &self.moving[other.body as usize], &others);
                    if standing.shape.as_halfspace().is_none() && !standing.aabb().intersects(&own.aabb()) {
                        return;
                    }
                    let size = c.size.min(other.size);
                    if let Some(met) = impact(standing, own, size, Until::Enter, false) {
                        let both = [sensor, visitor].map(|c| (c.body, c.index));
                        found.push((both, met.time * dt));
                    }
                };
                if c.sensor {
                    // Visitors that moved far find the sensor in their own search.
                    part.meet_all(&own, &self.moving, |other| {
                        if far.binary_search(&other.body).is_err() {
                            meet(other);
                        }
                    });
                } else {
                    part.sensors.iter().for_each(|&sensor| meet(&part.colliders[sensor as usize]));
                }
            }
            found
        };
        let mut all: Vec<(Overlap, f32)> = far.par_iter().flat_map_iter(of_one).collect();
        all.sort_unstable_by_key(|(pair, _)| *pair);
        all
    }
}

impl WorldContacts {
    /// Calls `meet` on colliders near the path of another one, except sensors.
    fn meet_all(&self, own: &Swept, moving: &[BodyState], mut meet: impl FnMut(&ColliderInfo)) {
        let aabb = own.aabb();
        if !is_in_range(&aabb) {
            return;
        }
        self.tree.visit(&aabb, |other| meet(&self.colliders[other as usize]));
        for plane in &self.planes {
            let c = &self.colliders[plane.collider as usize];
            let body = &moving[c.body as usize];
            if box_reaches_plane(c, placed(Pose::from_parts(body.position, body.rotation), c.local), &aabb) {
                meet(c);
            }
        }
    }
}
