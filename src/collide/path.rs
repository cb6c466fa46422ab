//! The contacts of a step along the paths of the bodies.
//!
//! A speculative contact stops every crossing of its plane within the step. If the bodies move far, the surfaces are no
//! longer at that plane: the contact would hold bodies that pass by, and miss bodies behind it. For such pairs this
//! module searches for the time of impact.

use glam::Vec3;

use super::collider::{BodyState, FARTHEST};
use super::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use super::flush::Neighbors;
use super::manifold::{MAX_POINTS, Manifold};
use super::narrow::Narrow;
use super::pair::{Pair, PairScratch, Update};
use super::pairs::Track;
use super::sweep::{BodyPath, Station, Swept, Until, impact, overlap_at_end};
use crate::lanes::InstructionSet;

/// Approach in a step from which the contact is that of the time of impact, relative to the smallest half extent of the
/// thinner shape.
const FAR: f32 = 0.5;
/// Largest rotation of a body in a step for which contacts with a half-space are predicted over the body's whole path
/// (rad).
const MAX_TURN: f32 = 0.5;
/// Bound of the angular acceleration of a free body, divided by the square of its spin. The moments of inertia about
/// two axes differ by no more than the third moment, so no coefficient in Euler's three equations exceeds 1.
const SWERVE: f32 = 0.58;
/// Gap up to which surfaces touch, relative to the same half extent.
const TOUCHING: f32 = 2e-3;

/// The predicted distance of a pair that the next step computes in any case.
pub(super) const ANEW: f32 = 0.0;

/// The motion of a pair in the step.
#[derive(Clone, Copy)]
pub(super) struct Going {
    /// Upper bound of the approach of its bodies (m).
    approach: f32,
    size: f32,
}

impl Going {
    /// Whether the bodies can move so far that the contact is that of the time of impact.
    pub fn is_far(self) -> bool {
        self.approach > FAR * self.size
    }

    /// Whether the prediction covers the whole approach.
    fn is_seen(self) -> bool {
        self.approach <= 2.0 * self.size
    }
}

impl Narrow<'_> {
    /// The motion of a pair whose contacts can act although its bodies do not touch. Those contacts have to be checked
    /// against the paths of the bodies.
    pub(super) fn going(&self, track: &Track) -> Option<Going> {
        let [a, b] = track.bodies.map(|body| &self.moving[body as usize]);
        let (dt, size) = (self.margins.dt, track.size);
        let shift = (b.v - a.v) + 0.5 * dt * (b.pull - a.pull);
        let approach = dt * (shift.length() + track.reach_b * (b.w - a.w).length());
        let turn = dt * (a.w.length() + b.w.length());
        let goes = approach > TOUCHING * size && approach < FARTHEST && (track.unbounded == 0.0 || turn > 0.0);
        // The plane of a half-space contact is valid at any distance.
        let is_near = track.unbounded != 0.0 && turn <= MAX_TURN;
        goes.then_some(Going { approach: if is_near { 0.0 } else { approach }, size })
    }

    /// Adapts the contacts of a pair to the paths of its bodies. If the bodies meet far away, the contact is the one at
    /// that place; `before` are the contacts of the pair before it was computed. If they do not meet, no contact acts.
    /// Returns `None` if the contacts stay about as they were computed.
    pub(super) fn follow_ways(
        &self,
        pair: &mut Pair,
        track: &mut Track,
        (going, before): (Going, Vec<Manifold>),
        (scratch, cuboids): (&mut PairScratch, &mut CuboidScratch),
    ) -> Option<Update> {
        let size = pair.size;
        let points = || pair.manifolds.iter().flat_map(|manifold| manifold.points());
        if points().any(|point| point.separation <= TOUCHING * size) {
            return None;
        }
        let bodies = track.bodies.map(|body| &self.moving[body as usize]);
        let within = |time: f32| pair.manifolds.iter().any(|manifold| self.may_act(manifold, bodies, time));
        let step = self.margins.dt + self.margins.substep;
        if going.is_seen() && !within(step) {
            // A reused contact is not checked against paths.
            let reused = self.margins.recycle * size / going.approach;
            if within(step + self.margins.dt * reused) {
                track.predicted = ANEW;
            }
            return None;
        }
        // The next substep can start from the velocities that the last substep leaves.
        let ways = bodies.map(|body| BodyPath::free(body, step));
        let [a, b] = [(0, pair.collider_a), (1, pair.collider_b)]
            .map(|(side, c)| Swept::new(&self.colliders[c as usize], bodies[side], &ways[side]));
        let free = |manifold: &Manifold| self.free_separations(manifold, bodies, TOUCHING * size);
        let acts = |manifold: &Manifold| {
            manifold.points().iter().zip(free(manifold)).any(|(point, least)| point.separation < least)
        };
        if going.is_seen() && (!pair.manifolds.iter().any(acts) || !going.is_far() && overlap_at_end(a, b)) {
            return None;
        }
        let met = impact(a, b, size, Until::Meet, true);
        // Joints, and neighbors in a heap, hold a body off its free path.
        let is_led =
            || bodies.iter().any(|body| body.tied == 1.0) || bodies.iter().all(|body| body.gravity_scale > 0.0);
        let stays = |time: f32| going.is_seen() && (!going.is_far() || is_led() || self.is_held_up(pair, &ways, time));
        let met = match met {
            Some(met) if stays(met.time) => return None,
            Some(met) if going.is_seen() || !self.is_held_up(pair, &ways, met.time) => met,
            _ => {
                track.predicted = ANEW;
                pair.manifolds.iter_mut().for_each(|manifold| manifold.give_way(free(manifold)));
                return None;
            }
        };
        let prediction = track.predicted;
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
        let fall = met.time * 0.5 * step * step * (bodies[1].pull - bodies[0].pull).length();
        let neighbors = Some(&Neighbors { fall, ..self.neighbors });
        let update = if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
            let one = [CuboidPair { bodies: [0, 1], cuboids: places, prediction, number: 0 }];
            let mut update = None;
            cuboid_contacts(InstructionSet::default(), &then, self.cuboids, &one, cuboids, &mut |_, write| {
                update = Some(pair.take_over(sides, prediction, write, neighbors, scratch));
            });
            update.unwrap_or_else(|| pair.part())
        } else {
            pair.compute(sides, prediction, neighbors, scratch)
        };
        let drift = (then[1].center - then[0].center) - (bodies[1].center - bodies[0].center);
        let turns = ways.map(|way| way.turned(met.time));
        pair.manifolds.iter_mut().for_each(|manifold| manifold.carry_back(drift, turns));
        Some(update)
    }

    /// Whether a body of a pair meets fixed geometry before a time. Then it does not reach the place where it would
    /// meet the other body.
    fn is_held_up(&self, pair: &Pair, ways: &[BodyPath; 2], time: f32) -> bool {
        let is_earlier = |side: usize| {
            let c = &self.colliders[[pair.collider_a, pair.collider_b][side] as usize];
            let body = &self.moving[c.body as usize];
            if c.unbounded || body.v == Vec3::ZERO && body.w == Vec3::ZERO {
                return false;
            }
            let own = Swept::new(c, body, &ways[side]);
            let meets = |other: u32| {
                let standing = &self.colliders[other as usize];
                let is_own = [pair.collider_a, pair.collider_b].contains(&other) || standing.body == c.body;
                if is_own || !self.neighbors.may_hold(c.body, standing.body) {
                    return false;
                }
                let way = BodyPath::free(&self.moving[standing.body as usize], 0.0);
                let standing = Swept::new(standing, &self.moving[standing.body as usize], &way);
                impact(standing, own, c.size, Until::Deep, true).is_some_and(|met| met.time < time)
            };
            let mut is_earlier = self.neighbors.planes.iter().any(|plane| meets(plane.collider));
            self.neighbors.tree.visit(&own.aabb(), |other| is_earlier = is_earlier || meets(other));
            is_earlier
        };
        is_earlier(0) || is_earlier(1)
    }

    /// Whether the bodies can cross the plane of a contact within a time.
    fn may_act(&self, manifold: &Manifold, [a, b]: [&BodyState; 2], time: f32) -> bool {
        let shift = |body: &BodyState, arm: Vec3| time * (body.v + 0.5 * time * body.pull + body.w.cross(arm));
        // The first bounds the deviation of a turning arm from a straight line. The second bounds the deviation from a
        // rotation about a constant axis.
        let bend = |body: &BodyState, arm: Vec3| time * time * body.w.length_squared() * arm.length();
        manifold.points().iter().any(|point| {
            let along = (shift(b, point.r_b) - shift(a, point.r_a)).dot(manifold.normal);
            point.separation + along < bend(a, point.r_a) + bend(b, point.r_b)
        })
    }

    /// The smallest separations of the points at which a contact does not act while the bodies move freely and stay at
    /// least `gap` apart.
    fn free_separations(&self, manifold: &Manifold, [a, b]: [&BodyState; 2], gap: f32) -> [f32; MAX_POINTS] {
        let substep = self.margins.substep;
        let count = (self.margins.dt / substep).round() as u32;
        let (v, pull, normal) = (b.v - a.v, b.pull - a.pull, manifold.normal);
        let mut least = [f32::NEG_INFINITY; MAX_POINTS];
        // The velocities after the last substep are checked against the next substep.
        for k in 0..=count {
            let (then, next) = (k as f32 * substep, (k + 1) as f32 * substep);
            let drift = then * (v + 0.5 * next * pull);
            let turns = [a, b].map(|body| BodyPath::free(body, then).turned(1.0));
            let movement = manifold.movement(drift, turns);
            let swerve = |body: &BodyState, arm: Vec3| SWERVE * body.w.length_squared() * arm.cross(normal).length();
            for (least, point) in least.iter_mut().zip(manifold.points()) {
                let swerve = swerve(a, point.r_a) + swerve(b, point.r_b);
                let on = v + next * pull + b.w.cross(point.r_b) - a.w.cross(point.r_a);
                let on = substep * (on.dot(normal) - then * swerve).min(0.0);
                *least = least.max(gap - movement(point) - on + 0.5 * then * then * swerve);
            }
        }
        least
    }
}
