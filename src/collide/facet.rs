//! Contacts of a convex shape with flat geometry: a half-space, or each triangle of a mesh or height field.
//!
//! Parry finds the direction of such a contact with GJK and EPA. Their tolerances grow with the triangle, and parry
//! drops a contact whose direction points behind the triangle. Of 2000 cones of 0.1 m that lay 1 mm deep in a triangle,
//! EPA gave 190 the direction behind. Of cones that touched a triangle of 60 m, GJK gave 12 % an oblique direction,
//! with an error of 8 mm. Therefore this module tries the face normal first: the distance along it has a closed form.

use glam::Vec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::query::details::{NormalConstraints, contact_support_map_support_map_with_params};
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::query::{PointQuery, TrackedContact};
use parry3d::shape::{PackedFeatureId, Shape, SupportMap, Triangle, TrianglePseudoNormals};

use super::cone::FacetCone;
use super::rim::{Beside, Facet, RimScratch, each_triangle};
use super::solid::{
    ClipBuffers, ContactQuery, Corner, DEEP, EXACT, Magnified, PUSH, ParryManifold, Patch, Solid, add_above, ask, clip,
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
    beside: &mut Beside,
    buffers: &mut ClipBuffers,
    many: &mut Vec<ParryManifold>,
) {
    let around = shape.compute_aabb(pos12).loosened(search.prediction);
    // In the frame of the shape's middle, numbers are as small as the shape.
    let middle = pos12.translation;
    let convex = Solid::new(shape, Pose::from_parts(Vec3::ZERO, pos12.rotation));
    let near = Aabb::new(around.mins - middle, around.maxs - middle).loosened(search.size);
    each_triangle(composite, &around, |facet, triangle| {
        let mut found = ParryManifold::with_data(facet.number, 0, ());
        if let Some(convex) = &convex {
            let corners = triangle.vertices().map(|corner| corner - middle);
            let mut open = |cone: &FacetCone, points: &[Corner], d: Vec3, rim: &mut RimScratch| {
                beside.open(composite, cone, points.iter().map(|point| point.0 + middle), d, rim)
            };
            let sides = || Some(Sides { cone: facet.cone()?, is_free: facet.free_edges().contains(&true) });
            let peak = |corner, d| facet.peak(triangle, corner, d);
            let normals = Normals { sides: &sides, open: &mut open, peak: &peak };
            if triangle_contact(corners, normals, convex, &near, search, buffers, &mut found).is_some() {
                found.points.iter_mut().for_each(|point| point.local_p1 += middle);
            }
        } else {
            let cone = facet.cone();
            let cone = cone.as_ref().map(FacetCone::new);
            let is_open = cone.as_ref().is_some_and(|cone| ball_opens(facet, triangle, cone, middle, beside, buffers));
            let cone = cone.as_ref().filter(|_| !is_open);
            ask((triangle, shape), pos12, cone.map(|cone| cone as &dyn NormalConstraints), search, &mut found);
            if let (true, Some(cone)) = (found.points.is_empty(), cone) {
                ball_at_edge(triangle, cone, (shape, pos12), beside.around, search, &mut found);
            }
        }
        if !found.points.is_empty() {
            many.push(found);
        }
    });
}

/// Adds the contact of a ball whose center is above an edge of a triangle, or beside it by no more than `around` (m),
/// along the normal that the cone allows. Parry casts a ray along that normal, which misses the triangle by rounding: a
/// ball on the seam of two meshes fell through.
fn ball_at_edge(
    triangle: &Triangle,
    cone: &FacetCone,
    (ball, pos12): (&dyn Shape, &Pose),
    around: f32,
    ContactQuery { prediction, .. }: ContactQuery,
    found: &mut ParryManifold,
) {
    let Some(radius) = ball.as_ball().map(|ball| ball.radius) else { return };
    let on = triangle.project_local_point(pos12.translation, false).point;
    let away = pos12.translation - on;
    let Some(mut normal) = away.try_normalize().filter(|_| away.length() <= radius + prediction + around) else {
        return;
    };
    let is_in_front = cone.project_local_normal_mut(&mut normal);
    let height = normal.dot(away);
    let below = pos12.translation - height * normal;
    if is_in_front && below.distance(on) <= around && height - radius <= prediction {
        (found.local_n1, found.local_n2) = (normal, pos12.rotation.inverse() * -normal);
        let (on_ball, unknown) = (found.local_n2 * radius, PackedFeatureId::UNKNOWN);
        found.points.push(TrackedContact::new(below, on_ball, unknown, unknown, height - radius));
    }
}

/// Whether a ball at `center` may touch a triangle along the line from its nearest point, which the closed cone turns.
fn ball_opens(
    facet: Facet,
    triangle: &Triangle,
    cone: &FacetCone,
    center: Vec3,
    beside: &mut Beside,
    ClipBuffers { rim, .. }: &mut ClipBuffers,
) -> bool {
    if !facet.free_edges().contains(&true) {
        return false;
    }
    let on = triangle.project_local_point(center, false).point;
    let Some(d) = (center - on).try_normalize() else { return false };
    let mut turned = d;
    cone.project_local_normal_mut(&mut turned)
        && turned != d
        && beside.open(facet.composite, cone, [on], d, rim) == Some(d)
}

/// The normals of a triangle with one side.
pub(super) struct Sides {
    /// Those of the triangle and its neighbors, without the directions out of free edges.
    pub cone: TrianglePseudoNormals,
    /// Whether one of its edges is free.
    pub is_free: bool,
}

/// Finds the normal nearest to a direction at some points of a triangle. Returns `None` if nothing opens its cone
/// there.
type Open<'a> = &'a mut dyn FnMut(&FacetCone, &[Corner], Vec3, &mut RimScratch) -> Option<Vec3>;

/// The normals of contacts with a triangle.
pub(super) struct Normals<'a> {
    /// Those of its sides; `None` for a triangle with two sides.
    pub sides: &'a dyn Fn() -> Option<Sides>,
    /// Adds normals at free edges.
    pub open: Open<'a>,
    /// See [`Facet::peak`].
    pub peak: &'a dyn Fn(usize, Vec3) -> Option<bool>,
}

/// The contact of a triangle with a convex shape that is nearer than `prediction` and on the front of the triangle.
/// Only geometry within the box `near` counts. Normals stay within the cone of its sides, so bodies do not catch on
/// edges between triangles. Without sides the triangle has two.
pub(super) fn triangle_contact(
    [a, mut b, mut c]: [Vec3; 3],
    Normals { sides, open, peak }: Normals,
    convex: &Solid,
    near: &Aabb,
    ContactQuery { prediction, size }: ContactQuery,
    ClipBuffers { polygon, unclipped, patch, corners, rim }: &mut ClipBuffers,
    found: &mut ParryManifold,
) -> Option<()> {
    let mut face = (b - a).cross(c - a).try_normalize()?;
    let height = |face: Vec3| face.dot(convex.furthest(-face) - a) - convex.radius;
    let (mut above, mut below) = (height(face), height(-face));
    if above.max(below) > prediction {
        return None;
    }
    let sides = sides();
    if sides.is_none() && below > above {
        std::mem::swap(&mut b, &mut c);
        (face, above, below) = (-face, below, above);
    }
    let is_flat =
        |sides: &Sides| !sides.is_free && sides.cone.edges.iter().all(|edge| edge.dot(sides.cone.face) > 0.999_999);
    let is_flat = sides.as_ref().is_some_and(is_flat);
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
    if let Some(Sides { cone, is_free }) = sides {
        let cone = FacetCone::new(&cone);
        let is_in_front = cone.project_local_normal_mut(&mut normal);
        let is_turned = cone.is_in_front(direction) && !FacetCone::is_same(normal, direction);
        let vertices = [a, b, c];
        let along = |&i: &usize| direction.dot(vertices[i]);
        let highest = (0..3).max_by(|i, j| along(i).total_cmp(&along(j))).unwrap_or(0);
        let top = vertices[highest];
        let may_be_peak = is_turned && near.contains_local_point(top);
        if let Some(is_first) = may_be_peak.then(|| peak(highest, direction)).flatten() {
            // All triangles at a peak touch the solid there.
            let on_surface = convex.pose.inverse_transform_point(top + direction * distance);
            found.local_n1 = direction;
            found.local_n2 = convex.pose.rotation.inverse() * -direction;
            let unknown = PackedFeatureId::UNKNOWN;
            let point = TrackedContact::new(top, on_surface, unknown, unknown, distance);
            return is_first.then(|| found.points.push(point));
        }
        let opens = is_free && is_turned;
        let opened = opens.then(|| {
            corners.clear();
            if let Some((_, on_patch, ..)) = closest.filter(|closest| closest.0 == direction) {
                corners.push((on_patch, 0));
            } else {
                convex.feature(-direction, corners);
                let least = direction.dot(convex.furthest(-direction));
                corners.retain(|corner| direction.dot(corner.0) <= least + EXACT * size);
                let triangle = Triangle::new(a, b, c);
                let to_edge = direction * (distance + convex.radius);
                let on = |at: Vec3| triangle.project_local_point(at - to_edge, false).point;
                corners.iter_mut().for_each(|corner| corner.0 = on(corner.0));
            }
            open(&cone, corners, direction, rim)
        });
        match opened.flatten() {
            Some(turned) => normal = turned,
            None if !is_in_front => return None,
            None => {}
        }
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
