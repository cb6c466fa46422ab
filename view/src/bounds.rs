//! Boxes along the axes of the world.

use glam::Vec3;

use crate::poses::{Poses, anchors, poses};
use drystone::{BodyKind, World};

/// Room on each side of a body, as a share of its size.
const MARGIN: f32 = 0.25;

/// A box along the world's axes: lower and upper corner (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// An empty box; joined with another box it gives the other.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub fn around(center: Vec3, reach: f32) -> Self {
        Self { low: center - reach, high: center + reach }
    }

    /// The smallest box that contains both. A box that is not finite is empty.
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

    /// Bounds of everything that moves in a world, with a margin, of sensors, and of the anchors of joints.
    pub fn of(world: &World) -> Self {
        Self::at(world, &poses(world))
    }

    /// The same with the bodies at `poses`.
    pub fn at(world: &World, poses: &Poses) -> Self {
        Self::with_margin(world, poses, MARGIN)
    }

    /// The same without a margin: what lies outside on the side of the eye only hides it.
    pub fn tight(world: &World) -> Self {
        Self::with_margin(world, &poses(world), 0.0)
    }

    fn with_margin(world: &World, poses: &Poses, margin: f32) -> Self {
        let around = world.bodies.iter().zip(poses).map(|(body, &(position, rotation))| {
            let shown = body.colliders.iter().filter(|c| body.kind != BodyKind::Fixed || c.sensor);
            let bounds = shown.map(|c| c.bounds(position, rotation));
            let body = bounds.fold(Self::EMPTY, |all, (low, high)| all.join(Self { low, high }));
            let room = margin * (body.high - body.low);
            Self { low: body.low - room, high: body.high + room }
        });
        let anchors = world.joints.iter().flat_map(|joint| anchors(joint, poses));
        around.chain(anchors.map(|at| Self::around(at, 0.0))).fold(Self::EMPTY, Self::join)
    }
}
