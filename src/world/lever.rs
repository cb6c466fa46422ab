//! The smallest inertia that a body can have for the size of its shapes.

use glam::Vec3;

use super::body::{Body, BodyKind, Collider};
use super::mass::MassProperties;
use super::shape::{placed, pose};

/// Raises the moments of inertia of a body to the limit that [`MassProperties::MAX_LEVERAGE`] sets.
pub(super) fn raise_inertia(body: &mut Body) {
    if body.kind == BodyKind::Dynamic {
        let least = squared_levers(&body.mass, &body.colliders) * (body.mass.mass / MassProperties::MAX_LEVERAGE);
        body.mass.principal_inertia = body.mass.principal_inertia.max(least);
    }
}

/// Upper bound of the squared distance between the shapes and each principal axis (m²). It can exceed the exact maximum
/// a little.
fn squared_levers(mass: &MassProperties, colliders: &[Collider]) -> Vec3 {
    let to_axes = pose(mass.center, mass.principal_frame).inverse();
    let of_one = |collider: &Collider| {
        let at = placed(to_axes, pose(collider.position, collider.rotation));
        let (aabb, sphere) = (collider.shape.0.compute_aabb(&at), collider.shape.0.compute_bounding_sphere(&at));
        let squared = |v: Vec3| Vec3::new(v.y * v.y + v.z * v.z, v.z * v.z + v.x * v.x, v.x * v.x + v.y * v.y);
        let in_box = squared(aabb.mins.abs().max(aabb.maxs.abs()));
        let to_sphere = squared(sphere.center).map(f32::sqrt) + sphere.radius;
        in_box.min(to_sphere * to_sphere)
    };
    colliders.iter().filter(|c| !c.sensor).map(of_one).fold(Vec3::ZERO, Vec3::max)
}
