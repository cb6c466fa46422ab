//! Contacts of bodies that the caller moved between two steps.
//!
//! A contact of the same two shapes keeps the impulses and the preload of the contact before, matched by features. That
//! is right if the bodies move on their own, or if the caller corrects them by a little. It is wrong for a teleported
//! body: a box of 1 kg, moved out from under 8,000 kg to another place on the same floor, jumped 4.6 mm off the floor.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::pair::Pair;
use super::pairs::Pairs;
use crate::math::rotation::product;
use crate::world::{Bodies, Body, BodyKind};

/// The pose of a body after the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LastPose {
    rotation: Quat,
    position: Vec3,
}

crate::saved::fields!(LastPose { rotation, position });

impl LastPose {
    pub fn of(body: &Body) -> Self {
        Self { rotation: body.rotation, position: body.position }
    }

    /// Whether the body still has this pose, to the last bit.
    pub fn is_of(&self, body: &Body) -> bool {
        let bits =
            |left: &Self| (left.rotation.to_array().map(f32::to_bits), left.position.to_array().map(f32::to_bits));
        bits(self) == bits(&Self::of(body))
    }
}

/// The poses of all bodies after the last step and now. It exists only if the caller moved one of them.
pub(super) struct Teleports<'a> {
    left: &'a [LastPose],
    now: Vec<LastPose>,
}

impl<'a> Teleports<'a> {
    /// Returns `None` if every body has the pose that the step left.
    pub fn find(left: &'a [LastPose], bodies: &Bodies) -> Option<Self> {
        let is_elsewhere = |(body, left): (&Body, &LastPose)| LastPose::of(body) != *left;
        let any = bodies.par_iter().with_min_len(1024).zip(left).any(is_elsewhere);
        any.then(|| Self { left, now: bodies.iter().map(LastPose::of).collect() })
    }

    /// Ends the contacts of two bodies if the caller moved one of them relative to the other by more than half of the
    /// smallest side of the thinner shape: their contact points are no longer the same. A body that moves together with
    /// all movable bodies that it touches keeps the contacts with them, and carries the same loads.
    pub fn end_contacts(&self, kinds: &[BodyKind], pairs: &mut Pairs) {
        let is_movable = |body: u32| kinds[body as usize] == BodyKind::Dynamic;
        let mut parted = Vec::new();
        // For each body: whether it keeps its place relative to a movable body that it touches, and to another one not.
        let mut company = vec![(false, false); self.now.len()];
        for place in (0..pairs.len()).filter(|&place| pairs[place].is_touching()) {
            let (bodies, parts) = ([pairs[place].body_a, pairs[place].body_b], self.parts(pairs, place));
            parted.extend(parts.then_some(place));
            if bodies.into_iter().all(is_movable) {
                for body in bodies {
                    let (stays, leaves) = &mut company[body as usize];
                    *if parts { leaves } else { stays } = true;
                }
            }
        }
        for place in parted {
            let bodies = [pairs[place].body_a, pairs[place].body_b];
            let moves_with_others = |body: u32| !is_movable(body) || company[body as usize] == (true, false);
            if !bodies.into_iter().all(moves_with_others) {
                pairs.end(place);
            }
        }
    }

    /// Whether the caller moved the bodies of a pair apart.
    fn parts(&self, pairs: &Pairs, place: usize) -> bool {
        let Pair { body_a, body_b, size, .. } = pairs[place];
        let [a, b] = [body_a as usize, body_b as usize];
        if self.now[a] == self.left[a] && self.now[b] == self.left[b] {
            return false;
        }
        let turned = |i: usize| product(self.now[i].rotation, self.left[i].rotation.inverse());
        let apart = |from: &[LastPose]| from[b].position - from[a].position;
        let (turn_a, turn_b) = (turned(a), turned(b));
        let shift = apart(&self.now) - turn_a * apart(self.left);
        let turn = product(turn_a.inverse(), turn_b);
        shift.length() + 2.0 * turn.xyz().length() * pairs.tracks[place].reach_b > size
    }
}
