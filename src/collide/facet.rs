//! Contacts of a convex shape with flat geometry: a half-space, or each triangle of a mesh or height field.
//!
//! Parry finds the direction of such a contact with GJK and EPA. Their tolerances grow with the triangle, and parry
//! drops a contact whose direction points behind the triangle. Of 2000 cones of 0.1 m that lay 1 mm deep in a triangle,
//! EPA gave 190 the direction behind. Of cones that touched a triangle of 60 m, GJK gave 12 % an oblique direction,
//! with an error of 8 mm. Therefore this module tries the face normal first: the distance along it has a closed form.

use glam::Vec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::query::TrackedContact;
use parry3d::query::details::{NormalConstraints, contact_support_map_support_map_with_params};
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::shape::{PackedFeatureId, Shape, SupportMap, Triangle, TrianglePseudoNormals};

use super::cone::FacetCone;
use super::solid::{
    ClipBuffers, ContactQuery, DEEP, EXACT, Magnified, PUSH, ParryManifold, Patch, Solid, add_above, ask, clip,
    clip_to, magnification,
};

/// The contact of a half-space with a convex shape at `pos12`. Returns `None` for a ball.
pub(super) fn half_space_contact(
    normal: Vec3,
    shape: &dyn Shape,
    pos12: &Pose,
    buffers: &mut ClipBuffers,
    found: &mut ParryManifold,
) -> Option<()> {
    let convex = Solid::new(shape, *pos12)?;
    let ClipBuffers { polygon, corners, .. } = buffers;
    convex.feature(-normal, polygon);
    convex.corners(-normal, corners);
    add_above(polygon, corners, &[], normal);
    found.local_n1 = normal;
    found.local_n2 = pos12.rotation.inverse() * -normal;
    found.points.extend(convex.contacts(polygon, [normal, normal, Vec3::ZERO]));
    Some(())
}

/// The contacts of a mesh or height field with a convex shape at `pos12`, one for each triangle. The mesh determines
/// their order.
pub(super) fn composite_contacts(
    composite: &dyn Shape,
    shape: &dyn Shape,
    pos12: &Pose,
    search: ContactQuery,
    buffers: &mut ClipBuffers,
    many: &mut Vec<ParryManifold>,
) {
    let around = shape.compute_aabb(pos12).loosened(search.prediction);
    // In the frame of the shape's middle, numbers are as small as the shape.
    let convex = Solid::new(shape, Pose::from_parts(Vec3::ZERO, pos12.rotation));
    let near = Aabb::new(around.mins - pos12.translation, around.maxs - pos12.translation).loosened(search.size);
    let mut with = |i: u32, triangle: &Triangle, cone: &dyn Fn() -> Option<TrianglePseudoNormals>| {
        let mut found = ParryManifold::with_data(i, 0, ());
        if let Some(convex) = &convex {
            let corners = triangle.vertices().map(|corner| corner - pos12.translation);
            if triangle_contact(corners, cone, convex, &near, search, buffers, &mut found).is_some() {
                found.points.iter_mut().for_each(|point| point.local_p1 += pos12.translation);
            }
        } else {
            let cone = cone();
            let cone = cone.as_ref().map(FacetCone::new);
            let cone = cone.as_ref().map(|cone| cone as &dyn NormalConstraints);
            ask((triangle, shape), pos12, cone, search, &mut found);
        }
        if !found.points.is_empty() {
            many.push(found);
        }
    };
    if let Some(mesh) = composite.as_trimesh() {
        let triangles = mesh.bvh().intersect_aabb(&around).filter(|&i| (i as usize) < mesh.num_triangles());
        triangles.for_each(|i| with(i, &mesh.triangle(i), &|| mesh.triangle_normal_constraints(i)));
    } else if let Some(field) = composite.as_heightfield() {
        field.map_elements_in_local_aabb(&around, &mut |i, triangle| {
            with(i, triangle, &|| field.triangle_normal_constraints(i));
        });
    }
}

/// The contact of a triangle with a convex shape that is nearer than `prediction` and on the front of the triangle.
/// Only geometry within the box `near` counts. Normals stay within `cone`, so bodies do not catch on edges between
/// triangles. Without a cone the triangle has two sides.
pub(super) fn triangle_contact(
    [a, mut b, mut c]: [Vec3; 3],
    cone: &dyn Fn() -> Option<TrianglePseudoNormals>,
    convex: &Solid,
    near: &Aabb,
    ContactQuery { prediction, size }: ContactQuery,
    ClipBuffers { polygon, unclipped, patch, corners }: &mut ClipBuffers,
    found: &mut ParryManifold,
) -> Option<()> {
    let mut face = (b - a).cross(c - a).try_normalize()?;
    let height = |face: Vec3| face.dot(convex.furthest(-face) - a) - convex.radius;
    let (mut above, mut below) = (height(face), height(-face));
    if above.max(below) > prediction {
        return None;
    }
    let cone = cone();
    if cone.is_none() && below > above {
        std::mem::swap(&mut b, &mut c);
        (face, above, below) = (-face, below, above);
    }
    let is_flat = cone.as_ref().is_some_and(|cone| cone.edges.iter().all(|edge| edge.dot(cone.face) > 0.999_999));
    let base = [a, b, c].map(|at| (at, 0));
    convex.feature(-face, polygon);
    clip_to(polygon, unclipped, &base, face);
    let lowest = polygon.iter().map(|corner| face.dot(corner.0 - a)).fold(f32::INFINITY, f32::min) - convex.radius;
    let mut best = (above, face);
    let mut closest = None;
    // Otherwise the face is the nearest feature, or the overlap is so small that another feature would not be much
    // better.
    if lowest > above + EXACT * size || above < -DEEP * size {
        patch.clear();
        patch.extend(base);
        for axis in Vec3::AXES {
            clip(patch, unclipped, axis, axis.dot(near.maxs), 0);
            clip(patch, unclipped, -axis, -axis.dot(near.mins), 0);
        }
        if patch.is_empty() {
            return None;
        }
        let patch = Patch(patch);
        // A lower bound of the true distance, exact for the best direction.
        let along = |d: Vec3| d.dot(convex.furthest(-d) - patch.local_support_point(d)) - convex.radius;
        let mut consider = |d: Vec3, distance: f32| {
            let is_better = distance > best.0;
            if is_better {
                best = (distance, d);
            }
            is_better
        };
        consider(-face, below);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let out = (to - from).cross(face).normalize_or(face);
            consider(out, along(out));
        }
        if !is_flat {
            let by = magnification(size);
            let (patch, solid) = (Magnified { map: &patch, by }, Magnified { map: convex.map, by });
            // Finds a direction after the solid is pushed off the face by a length.
            let search = |push: f32| {
                let pose = Pose::from_parts(by * (convex.pose.translation + push * face), convex.pose.rotation);
                let (most, simplex) = (by * (prediction + push + convex.radius), &mut VoronoiSimplex::new());
                contact_support_map_support_map_with_params(&pose, &patch, &solid, most, simplex, Some(face))
            };
            let is_true = match search(0.0) {
                GJKResult::ClosestPoints(on_patch, on_solid, d) => {
                    let (on_patch, on_solid, distance) = (on_patch / by, on_solid / by, along(d));
                    let claimed = d.dot(on_solid - on_patch) - convex.radius;
                    let is_true = (claimed - distance).abs() < EXACT * size;
                    if consider(d, distance) && is_true {
                        closest = Some((d, on_patch, on_solid, claimed));
                    }
                    is_true
                }
                GJKResult::NoIntersection(d) => {
                    let distance = along(d);
                    consider(d, distance);
                    distance > prediction
                }
                _ => false,
            };
            // For shapes that just touch, the search can end without a direction. No direction through the face
            // separates them.
            if !is_true
                && let GJKResult::ClosestPoints(.., d) | GJKResult::NoIntersection(d) = search(PUSH * size)
                && d.dot(face) > 0.0
            {
                consider(d, along(d));
            }
        }
    }
    let (distance, direction) = best;
    if distance > prediction {
        return None;
    }
    let mut normal = direction;
    if cone.is_some_and(|cone| !FacetCone::new(&cone).project_local_normal_mut(&mut normal)) {
        return None;
    }
    if normal != face {
        convex.feature(-normal, polygon);
        clip_to(polygon, unclipped, &base, normal);
    }
    found.local_n1 = normal;
    found.local_n2 = convex.pose.rotation.inverse() * -normal;
    // A normal that was turned into the cone can point far through the shape.
    let least = 5.0 * distance.min(0.0) - DEEP * size;
    if face.dot(normal) > 0.1 {
        convex.corners(-normal, corners);
        add_above(polygon, corners, &base, normal);
        let contacts = convex.contacts(polygon, [normal, face, a]);
        found.points.extend(contacts.filter(|contact| contact.dist <= prediction && contact.dist >= least));
    }
    let mut closest = closest.filter(|closest| closest.0 == normal);
    if closest.is_none() && found.points.is_empty() && normal == direction {
        // Beside the triangle, the nearest point of the solid touches the edge.
        let on_solid = convex.furthest(-normal);
        closest = Some((normal, on_solid - normal * (distance + convex.radius), on_solid, distance));
    }
    if let Some((_, on_patch, on_solid, claimed)) = closest {
        let on_surface = convex.pose.inverse_transform_point(on_solid - normal * convex.radius);
        let unknown = PackedFeatureId::UNKNOWN;
        found.points.push(TrackedContact::new(on_patch, on_surface, unknown, unknown, claimed));
    }
    Some(())
}
