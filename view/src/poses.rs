//! Poses of the bodies of a world.

use drystone::{BodyHandle, Joint, World};
use glam::{Quat, Vec3};

/// Position (m) and rotation of each body of a world.
pub type Poses = [(Vec3, Quat)];

/// Poses of the bodies of `world`, in their order.
pub fn poses(world: &World) -> Vec<(Vec3, Quat)> {
    world.bodies.iter().map(|b| (b.position, b.rotation)).collect()
}

/// Positions of the anchors of a joint, that of a first, for the bodies at `poses`.
pub(crate) fn anchors(joint: &Joint, poses: &Poses) -> [Vec3; 2] {
    let on = |body: BodyHandle, anchor: Vec3| poses[body.index()].0 + poses[body.index()].1 * anchor;
    [on(joint.body_a, joint.anchor_a), joint.body_b.map_or(joint.anchor_b, |b| on(b, joint.anchor_b))]
}
