//! Sensors: colliders that detect others without contacts. Each step finds their overlaps again, at the poses after the
//! step.

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::query::intersection_test;

use super::collider::{Activity, ColliderInfo};
use super::world_contacts::{WorldContacts, box_reaches_plane, key};
use crate::world::{Body, BodyKind, Groups, placed};

/// The bodies of all worlds, for sensors.
pub(super) struct Visitors<'a> {
    /// At the poses after the step.
    pub bodies: &'a [Body],
    pub kinds: &'a [BodyKind],
    pub groups: &'a [Groups],
    pub activity: &'a [Activity],
    /// Whether a joint keeps two bodies from colliding, the smaller index first.
    pub jointed: &'a std::collections::HashSet<(u32, u32)>,
}

/// A sensor and another collider that overlap. Each is the index of its body, and its own index on that body.
pub type Overlap = [(u32, u32); 2];

impl Visitors<'_> {
    fn pose(&self, c: &ColliderInfo) -> Pose {
        let body = &self.bodies[c.body as usize];
        Pose::from_parts(body.position, body.rotation)
    }

    /// Whether a sensor can detect the collider of another body: one of the two bodies moves, and their groups match.
    pub(super) fn may_meet(&self, sensor: &ColliderInfo, other: &ColliderInfo) -> bool {
        if other.is_gone() || other.sensor || other.body == sensor.body {
            return false;
        }
        let (a, b) = key(sensor.body, other.body);
        let [one, two] = [a, b].map(|body| body as usize);
        let both_fixed = self.kinds[one] == BodyKind::Fixed && self.kinds[two] == BodyKind::Fixed;
        !both_fixed && self.groups[one].meets(self.groups[two]) && !self.jointed.contains(&(a, b))
    }
}

impl WorldContacts {
    /// Whether any collider is a sensor.
    pub fn has_sensors(&self) -> bool {
        !self.sensors.is_empty()
    }

    /// Finds the colliders that each sensor overlaps, in any order.
    pub fn sense(&mut self, visitors: &Visitors, found: &mut Vec<Overlap>) {
        if !self.has_sensors() {
            return;
        }
        let mut strayed = std::mem::take(&mut self.strayed);
        strayed.clear();
        // The tree has the boxes from the start of the step, enlarged for the expected motion.
        let has_strayed = |(c, fat): (&ColliderInfo, &Aabb)| {
            let is_still = || visitors.activity.get(c.body as usize) == Some(&Activity::Still);
            !c.is_gone() && !c.sensor && !c.unbounded && !is_still() && !fat.contains(&c.aabb(visitors.pose(c)))
        };
        let all = (0..).zip(self.colliders.iter().zip(&self.fat));
        strayed.extend(all.filter(|&(_, both)| has_strayed(both)).map(|(place, _)| place));
        for &place in &self.sensors {
            let sensor = &self.colliders[place as usize];
            let pose = visitors.pose(sensor);
            let mut meet = |other: u32| {
                let c = &self.colliders[other as usize];
                let overlap = || {
                    let [at, of] = [placed(pose, sensor.local), placed(visitors.pose(c), c.local)];
                    intersection_test(&at, &*sensor.shape, &of, &*c.shape).is_ok_and(|answer| answer.intersecting)
                };
                if visitors.may_meet(sensor, c) && overlap() {
                    found.push([(sensor.body, sensor.index), (c.body, c.index)]);
                }
            };
            let aabb = sensor.aabb(pose);
            self.tree.visit(&aabb, |other| {
                if strayed.binary_search(&other).is_err() {
                    meet(other);
                }
            });
            strayed.iter().for_each(|&other| meet(other));
            for plane in self.planes.iter().map(|plane| plane.collider) {
                let c = &self.colliders[plane as usize];
                if box_reaches_plane(c, placed(visitors.pose(c), c.local), &aabb) {
                    meet(plane);
                }
            }
        }
        self.strayed = strayed;
    }
}
