//! Distances of a convex shape from other shapes, and the directions of these distances.

use std::cell::RefCell;

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::shape::Triangle;

use super::facet::composite_contacts;
use super::query::{TRUE, convex_contact};
use super::rim::{self, Beside};
use super::solid::{ClipBuffers, ContactQuery, EXACT, ParryManifold, Solid};
use crate::world::{Shape, seen_from};

/// A plane between two convex shapes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clearance {
    /// Unit normal of the plane, out of the first shape.
    pub normal: Vec3,
    /// Distance of the shapes along the normal, negative for overlap (m). No other normal gives a larger one, within
    /// the accuracy of contacts. With any normal, the shapes are at least this far apart.
    pub distance: f32,
    /// A point of the first shape that is nearest to the second one (m).
    pub point: Vec3,
    /// The direction nearest to `up` among the normal of the plane and those of the faces that hold the point.
    pub upright: Vec3,
}

/// Distance up to which a face holds a point, relative to the smallest half extent of the thinner shape.
const HOLDS: f32 = 2.0 * EXACT;

thread_local! {
    static SCRATCH: RefCell<(ClipBuffers, Vec<ParryManifold>)> = RefCell::default();
}

/// Calls a function on the shapes that lie within a distance (m) of a point of the world, and on their poses.
pub(crate) type EachBeside<'a> = &'a mut dyn FnMut(Vec3, f32, &mut dyn FnMut(&Shape, Pose));

/// Calls `with` for each convex part of a shape (the whole of a convex one, each triangle of a mesh or height field)
/// that is nearer than `within` (m) to a convex shape `moving`. The mesh determines the order of triangles. `beside`
/// finds the shapes that go on from free edges.
pub(crate) fn clearances(
    (fixed, pose): (&Shape, &Pose),
    (moving, own): (&Shape, &Pose),
    within: f32,
    up: Vec3,
    beside: EachBeside,
    with: &mut dyn FnMut(Clearance),
) {
    let Some(mover) = Solid::or_point(&*moving.0, *own) else { return };
    let lowest = |d: Vec3| d.dot(mover.furthest(-d)) - mover.radius;
    if let Some(normal) = fixed.as_half_space().map(|normal| pose.rotation * normal) {
        let distance = lowest(normal) - normal.dot(pose.translation);
        if distance <= within {
            let point = mover.furthest(-normal) - (mover.radius + distance) * normal;
            with(Clearance { normal, distance, point, upright: normal });
        }
        return;
    }
    let size = fixed.smallest_half_extent().min(moving.smallest_half_extent());
    let search = ContactQuery { prediction: within, size };
    let pos12 = seen_from(*pose, *own);
    let mut tell = |clearance: Clearance| {
        if clearance.distance <= within && clearance.normal.is_finite() && clearance.point.is_finite() {
            with(clearance);
        }
    };
    let higher = |a: Vec3, b: Vec3| if b.dot(up) > a.dot(up) { b } else { a };
    SCRATCH.with_borrow_mut(|(buffers, many)| {
        let Some(other) = Solid::or_point(&*fixed.0, *pose) else {
            many.clear();
            let around = TRUE * size;
            let mut goes_on = |[p, out]: [Vec3; 2], normals: &mut Vec<Vec3>| {
                let mut is_found = false;
                beside(*pose * p, around, &mut |other, stood| {
                    is_found |= rim::goes_on((&*other.0, seen_from(*pose, stood)), [p, out], around, normals);
                });
                is_found
            };
            let rims = &mut Beside { around, goes_on: &mut goes_on };
            composite_contacts(&*fixed.0, &*moving.0, &pos12, search, rims, buffers, many);
            for found in many.iter() {
                let Some(triangle) = triangle_of(fixed, found.subshape1) else { continue };
                let corners = triangle.vertices().map(|corner| *pose * corner);
                let furthest =
                    |d: Vec3| corners.map(|corner| d.dot(corner)).into_iter().fold(f32::NEG_INFINITY, f32::max);
                let along = |d: Vec3| lowest(d) - furthest(d);
                let first = pose.rotation * found.local_n1;
                let [a, b, c] = corners;
                let face = (b - a).cross(c - a).normalize_or(first);
                let face = if face.dot(first) < 0.0 { -face } else { face };
                let normal = if along(face) > along(first) { face } else { first };
                let point = *pose * nearest_point(found, size);
                let mut upright = higher(normal, face);
                if normal != face {
                    // Other triangles hold the point on an edge. This one lies behind them, unless it rises from them.
                    let mut holds = |beyond: Vec3| {
                        if furthest(beyond) <= beyond.dot(point) + HOLDS * size {
                            upright = higher(upright, beyond);
                        }
                    };
                    rim::each_face_at((&*fixed.0, *pose), point, HOLDS * size, &mut holds);
                    beside(point, around, &mut |other, stood| {
                        rim::each_face_at((&*other.0, stood), point, around, &mut holds);
                    });
                }
                tell(Clearance { normal, distance: along(normal), point, upright });
            }
            return;
        };
        let found = convex_contact((&fixed.0, &moving.0), &pos12, search, buffers);
        if found.points.is_empty() {
            return;
        }
        let furthest = |d: Vec3| d.dot(other.furthest(d)) + other.radius;
        let along = |d: Vec3| lowest(d) - furthest(d);
        let first = pose.rotation * found.local_n1;
        let mut best = (along(first), first);
        let mut consider = |d: Vec3| {
            let distance = along(d);
            if distance > best.0 {
                best = (distance, d);
            }
        };
        other.each_normal(&mut consider);
        mover.each_normal(|d| consider(-d));
        let (distance, normal) = best;
        let point = *pose * nearest_point(&found, size);
        let mut upright = normal;
        other.each_normal(|face| {
            if face.dot(point) > furthest(face) - HOLDS * size {
                upright = higher(upright, face);
            }
        });
        tell(Clearance { normal, distance, point, upright });
    });
}

/// The middle of the nearest points of a contact with points, in the frame of the first shape.
fn nearest_point(found: &ParryManifold, size: f32) -> Vec3 {
    let least = found.points.iter().map(|point| point.dist).fold(f32::INFINITY, f32::min);
    let nearest = || found.points.iter().filter(|point| point.dist <= least + EXACT * size);
    nearest().map(|point| point.local_p1).sum::<Vec3>() / nearest().count() as f32
}

/// A triangle of a mesh or height field, by parry's number.
fn triangle_of(shape: &Shape, number: u32) -> Option<Triangle> {
    let mesh = shape.0.as_trimesh().map(|mesh| mesh.triangle(number));
    mesh.or_else(|| shape.0.as_heightfield()?.triangle_at_id(number))
}
