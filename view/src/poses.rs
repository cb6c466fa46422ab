//! Where the bodies of a world are.

use drystone::World;
use glam::{Quat, Vec3};

/// Position (m) and rotation of each body of a world.
pub type Poses = [(Vec3, Quat)];

/// Poses of the bodies of `world`, in their order.
pub fn poses(world: &World) -> Vec<(Vec3, Quat)> {
    world.bodies.iter().map(|b| (b.position, b.rotation)).collect()
}
