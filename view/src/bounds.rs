//! Axis-aligned boxes in the world.

use glam::Vec3;

use crate::poses::{Poses, anchors, poses};
use drystone::{BodyHandle, BodyKind, World};

/// Room on each side of a body, as a share of its size.
const MARGIN: f32 = 0.25;
/// Distance in radii of a scene beyond which a body that left the others counts as gone.
pub(crate) const FAR: f32 = 4.0;
/// At most one in this many bodies can count as gone.
const GONE: usize = 10;

/// An axis-aligned box: lower and upper corner (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// An empty box. Joined with another box it gives the other.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub fn around(center: Vec3, reach: f32) -> Self {
        Self { low: center - reach, high: center + reach }
    }

    /// The smallest box that contains both. A box that is not finite counts as empty.
    pub fn join(self, other: Self) -> Self {
        if !(other.low.is_finite() && other.high.is_finite()) {
            return self;
        }
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Center (m); the origin if the box is empty.
    pub fn center(&self) -> Vec3 {
        if self.low.is_finite() { 0.5 * (self.low + self.high) } else { Vec3::ZERO }
    }

    /// Radius of the sphere around the box (m); 1 if the box is empty.
    pub fn radius(&self) -> f32 {
        if self.low.is_finite() { (0.5 * (self.high - self.low).length()).max(1e-3) } else { 1.0 }
    }

    pub fn corners(&self) -> [Vec3; 8] {
        let pick = |k: usize, bit: usize, axis: usize| if k >> bit & 1 == 0 { self.low[axis] } else { self.high[axis] };
        std::array::from_fn(|k| Vec3::new(pick(k, 0, 0), pick(k, 1, 1), pick(k, 2, 2)))
    }

    /// Bounds of all movable bodies in a world with a margin, of sensors, and of the anchors of joints.
    pub fn of(world: &World) -> Self {
        Self::at(world, &poses(world), f32::INFINITY)
    }

    /// The same with the bodies at `poses`, without a few bodies that flew away from a scene of this radius (m).
    pub fn at(world: &World, poses: &Poses, radius: f32) -> Self {
        Self::with_margin(world, poses, MARGIN, radius)
    }

    /// Like [`Self::of`] without a margin: anything outside, on the side of the eye, only hides the scene.
    pub fn tight(world: &World) -> Self {
        Self::with_margin(world, &poses(world), 0.0, f32::INFINITY)
    }

    /// The part of these bounds within `room` of `other` on each side (m), joined with `other`.
    pub(crate) fn near(self, other: Self, room: f32) -> Self {
        let kept = Self { low: self.low.max(other.low - room), high: self.high.min(other.high + room) };
        if kept.low.cmple(kept.high).all() { kept.join(other) } else { other }
    }

    fn with_margin(world: &World, poses: &Poses, margin: f32, radius: f32) -> Self {
        let around = world.bodies.iter().zip(poses).map(|(body, &(position, rotation))| {
            let shown = body.colliders.iter().filter(|c| body.kind != BodyKind::Fixed || c.sensor);
            let bounds = shown.map(|c| c.bounds(position, rotation));
            let body = bounds.fold(Self::EMPTY, |all, (low, high)| all.join(Self { low, high }));
            let room = margin * (body.high - body.low);
            Self { low: body.low - room, high: body.high + room }
        });
        let mut around: Vec<Self> = around.collect();
        leave_out_gone(&mut around, FAR * radius);
        let is_gone = |handle: BodyHandle| {
            let body = handle.index();
            world.bodies[body].kind != BodyKind::Fixed && !around[body].low.is_finite()
        };
        let joints = world.joints.iter().filter(|j| !is_gone(j.body_a) && !j.body_b.is_some_and(is_gone));
        let anchors = joints.flat_map(|joint| anchors(joint, poses)).map(|at| Self::around(at, 0.0));
        around.iter().copied().chain(anchors).fold(Self::EMPTY, Self::join)
    }
}

/// Empties the boxes that are further than `far` from the median box (m), if there are few of them.
fn leave_out_gone(boxes: &mut [Bounds], far: f32) {
    let mut centers: Vec<Vec3> = boxes.iter().filter(|b| b.low.is_finite()).map(Bounds::center).collect();
    let (half, few) = (centers.len() / 2, centers.len() / GONE);
    if few == 0 || far == f32::INFINITY {
        return;
    }
    let middle = Vec3::from_array([0, 1, 2].map(|k| {
        let (_, center, _) = centers.select_nth_unstable_by(half, |a, b| a[k].total_cmp(&b[k]));
        center[k]
    }));
    let is_gone = |b: &&mut Bounds| b.low.is_finite() && b.center().distance(middle) > far;
    if boxes.iter_mut().filter(is_gone).count() <= few {
        boxes.iter_mut().filter(is_gone).for_each(|b| *b = Bounds::EMPTY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::{Body, Joint, Shape};

    /// A row of `count` cubes, 1 m apart. The last one is `away` (m) from its place, and a rope ties it to its place.
    fn row(count: usize, away: f32) -> World {
        let mut world = World::new();
        let cubes = (0..count).map(|i| {
            let x = i as f32 + if i + 1 == count { away } else { 0.0 };
            world.insert(Body::dynamic().shape(Shape::cuboid(0.4, 0.4, 0.4)).position(x, 0.0, 0.0))
        });
        let last = cubes.last().expect("a cube");
        world.insert_joint(Joint::to_world(last, Vec3::ZERO, Vec3::X * (count as f32 - 1.0)).rope(1e9));
        world
    }

    fn length(world: &World, radius: f32) -> f32 {
        let bounds = Bounds::at(world, &poses(world), radius);
        bounds.high.x - bounds.low.x
    }

    #[test]
    fn one_of_many_that_flew_off_is_left_out_with_its_joints() {
        let radius = Bounds::of(&row(20, 0.0)).radius();
        assert!(length(&row(20, 1e4), radius) < 20.0);
        // A body stays in the bounds if it is nearer than four radii, or if there are few bodies.
        assert!(length(&row(20, 25.0), radius) > 40.0);
        assert!(length(&row(9, 1e4), radius) > 1e4);
        assert!(length(&row(20, 1e4), f32::INFINITY) > 1e4);
        let mut scattered = row(20, 1e4);
        scattered.bodies.iter_mut().step_by(4).for_each(|body| body.position.y = 1e4);
        let bounds = Bounds::at(&scattered, &poses(&scattered), radius);
        assert!(bounds.high.y > 9e3 && bounds.high.x > 9e3, "six of twenty are no few");
    }

    #[test]
    fn bounds_that_move_leave_those_behind_that_are_too_far() {
        let at = |x: f32| Bounds::around(Vec3::X * x, 1.0);
        let way = at(0.0).near(at(5.0), 10.0);
        assert_eq!((way.low.x, way.high.x), (-1.0, 6.0));
        let way = way.near(at(14.0), 10.0);
        assert_eq!((way.low.x, way.high.x), (3.0, 15.0));
        assert_eq!(way.near(at(-100.0), 10.0), at(-100.0));
        assert_eq!(Bounds::EMPTY.near(at(3.0), 10.0), at(3.0));
    }
}
