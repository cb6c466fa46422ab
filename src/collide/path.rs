//! The contacts of a step along the ways that the bodies take in it.
//!
//! A contact that is seen before its surfaces meet stops what would cross its plane within the step. Where the bodies go on far, the plane is not
//! where the surfaces are: it would hold up what passes by, and miss what lies behind it. For such pairs the time is sought at which they meet.

use glam::Vec3;

use super::collider::{BodyState, FARTHEST};
use super::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use super::manifold::Manifold;
use super::narrow::Narrow;
use super::pair::{Pair, PairScratch, Update};
use super::pairs::Track;
use super::sweep::{Station, Swept, Until, Way, impact};
use crate::lanes::InstructionSet;

/// How far bodies approach in a step before their contact is held against their ways, relative to the smallest half extent of the thinner shape.
const SHORT: f32 = 0.1;
/// How far before the contact is that of the time at which they meet, relative to the same.
const FAR: f32 = 0.5;
/// The turn up to which a plane is seen as far ahead as a body gets (rad).
const MOST_TURN: f32 = 0.5;
/// The gap up to which surfaces touch, relative to the smallest half extent of the thinner shape.
const TOUCHING: f32 = 2e-3;

/// The distance up to which a pair was predicted that its next step computes anew in any case.
pub(super) const ANEW: f32 = 0.0;

impl Narrow<'_> {
    /// How far the bodies of a pair may approach in the step (m), and how far they turn (rad).
    fn approach(&self, track: &Track) -> (f32, f32) {
        let [a, b] = track.bodies.map(|body| &self.moving[body as usize]);
        let dt = self.margins.dt;
        let shift = (b.v - a.v) + 0.5 * dt * (b.pull - a.pull);
        (dt * (shift.length() + track.reach_b * (b.w - a.w).length()), dt * (a.w.length() + b.w.length()))
    }

    /// Whether a pair that is computed has to be held against the ways of its bodies.
    pub(super) fn goes_far(&self, track: &Track) -> bool {
        let (approach, turn) = self.approach(track);
        let is_tied = track.bodies.iter().any(|&body| self.moving[body as usize].tied == 1.0);
        !is_tied
            && approach > FAR * track.size
            && approach > SHORT * track.size
            && approach < FARTHEST
            && (track.unbounded == 0.0 || turn > MOST_TURN)
    }

    /// Brings the contacts of a pair that goes far to where its bodies meet; `before` are those that it had before it was computed. None if they stay as
    /// they were computed.
    pub(super) fn follow_ways(
        &self,
        pair: &mut Pair,
        track: &mut Track,
        before: Vec<Manifold>,
        (scratch, cuboids): (&mut PairScratch, &mut CuboidScratch),
    ) -> Option<Update> {
        let (approach, turn) = self.approach(track);
        let going_on = || pair.manifolds.iter().filter(|manifold| !manifold.has_ended());
        if going_on().flat_map(|manifold| manifold.points()).any(|point| point.separation <= TOUCHING * pair.size) {
            return None;
        }
        let bodies = track.bodies.map(|body| &self.moving[body as usize]);
        let size = pair.size;
        let acts =
            |manifold: &Manifold| !manifold.has_ended() && (turn > MOST_TURN || self.acts(manifold, size, bodies));
        let is_seen = approach <= 2.0 * pair.size;
        // Joints, and others in a heap, hold a body off its free way.
        let is_tied =
            bodies.into_iter().any(|body| body.tied == 1.0) || bodies.into_iter().all(|body| body.gravity_scale > 0.0);
        if is_seen && (is_tied || !going_on().any(acts)) {
            return None;
        }
        // The last substep leaves velocities that the next one may go on with.
        let ways = bodies.map(|body| Way::free(body, self.margins.dt + self.margins.substep));
        let [a, b] = [(0, pair.collider_a), (1, pair.collider_b)]
            .map(|(side, c)| Swept::new(&self.colliders[c as usize], bodies[side], &ways[side]));
        let prediction = track.predicted;
        let Some(met) = impact(a, b, pair.size, Until::Meet, true) else {
            track.predicted = ANEW;
            return pair.end_some(acts).then_some(Update::Reshaped);
        };
        if is_seen && (approach <= FAR * pair.size || self.is_held_up(pair, &ways, met.time)) {
            return None;
        }
        if !is_seen && self.is_held_up(pair, &ways, met.time) {
            track.predicted = ANEW;
            return pair.end_some(acts).then_some(Update::Reshaped);
        }
        track.predicted = ANEW;
        let moved = |side: usize| {
            let (body, Station { center, rotation }) = (bodies[side], ways[side].at(met.time));
            let own = body.rotation.inverse() * (body.center - body.position);
            BodyState { center, rotation, position: center - rotation * own, ..*body }
        };
        let then = [moved(0), moved(1)];
        pair.manifolds = before;
        let sides = [
            (&self.colliders[pair.collider_a as usize], &then[0]),
            (&self.colliders[pair.collider_b as usize], &then[1]),
        ];
        let places = [pair.collider_a, pair.collider_b];
        let update = if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
            let one = [CuboidPair { bodies: [0, 1], cuboids: places, prediction, number: 0 }];
            let mut update = None;
            cuboid_contacts(InstructionSet::default(), &then, self.cuboids, &one, cuboids, |_, write| {
                update = Some(pair.take_over(sides, prediction, write, Some(&self.neighbors), scratch));
            });
            update.unwrap_or_else(|| pair.part())
        } else {
            pair.compute(sides, prediction, Some(&self.neighbors), scratch)
        };
        let drift = (then[1].center - then[0].center) - (bodies[1].center - bodies[0].center);
        let turns = ways.map(|way| way.turned(met.time));
        pair.manifolds.iter_mut().for_each(|manifold| manifold.carry_back(drift, turns));
        Some(update)
    }

    /// Whether a body of a pair meets something fixed on its way before a time: it does not get to where it would meet the other one.
    fn is_held_up(&self, pair: &Pair, ways: &[Way; 2], time: f32) -> bool {
        let is_earlier = |side: usize| {
            let c = &self.colliders[[pair.collider_a, pair.collider_b][side] as usize];
            let body = &self.moving[c.body as usize];
            if c.unbounded || body.v == Vec3::ZERO && body.w == Vec3::ZERO {
                return false;
            }
            let own = Swept::new(c, body, &ways[side]);
            let mut is_earlier = false;
            let meet = |other: u32| {
                let standing = &self.colliders[other as usize];
                let others = [pair.collider_a, pair.collider_b].contains(&other) || standing.body == c.body;
                if is_earlier || others || !self.neighbors.may_hold(c.body, standing.body) {
                    return;
                }
                let way = Way::free(&self.moving[standing.body as usize], 0.0);
                let standing = Swept::new(standing, &self.moving[standing.body as usize], &way);
                let met = impact(standing, own, c.size, Until::Deep, true);
                is_earlier = met.is_some_and(|met| met.time < time);
            };
            self.neighbors.tree.visit(&own.aabb(), meet);
            is_earlier
                || self.neighbors.planes.iter().any(|plane| {
                    let standing = &self.colliders[plane.collider as usize];
                    let way = Way::free(&self.moving[standing.body as usize], 0.0);
                    let others = [pair.collider_a, pair.collider_b].contains(&plane.collider);
                    let standing = Swept::new(standing, &self.moving[standing.body as usize], &way);
                    let met = || impact(standing, own, c.size, Until::Deep, true);
                    !others
                        && self.neighbors.may_hold(c.body, self.colliders[plane.collider as usize].body)
                        && met().is_some_and(|met| met.time < time)
                })
        };
        is_earlier(0) || is_earlier(1)
    }

    /// Whether the bodies would cross the plane of a contact within the step or the substep after it, and go on beside the plane so far that the surfaces may
    /// be elsewhere by then.
    fn acts(&self, manifold: &Manifold, size: f32, [a, b]: [&BodyState; 2]) -> bool {
        let dt = self.margins.dt + self.margins.substep;
        let shift = |body: &BodyState, arm: Vec3| dt * (body.v + 0.5 * dt * body.pull + body.w.cross(arm));
        // A surface that turns about the middle of a body goes nowhere.
        let go = shift(b, Vec3::ZERO) - shift(a, Vec3::ZERO);
        let beside = (go - go.dot(manifold.normal) * manifold.normal).length() > SHORT * size;
        manifold.points().iter().any(|point| {
            let shift = shift(b, point.r_b) - shift(a, point.r_a);
            let along = shift.dot(manifold.normal);
            point.separation + along < 0.0 && beside
        })
    }
}
