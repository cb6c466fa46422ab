//! Shape tests of queries, by parry.

use glam::Vec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::query::{self, Ray, ShapeCastHit, ShapeCastOptions};
use parry3d::shape::{HeightField, Shape as ParryShape, Triangle};

use super::boxes::BoxRay;
use super::surface;
use crate::world::{Shape, seen_from};

/// Distance and normal at which a ray meets a shape, between the distances `enters` and `most`.
///
/// The search starts near the shape: parry squares the distance of the origin. From 10 km away, the radius of a ball of
/// 0.5 m would vanish in rounding.
pub(super) fn ray(shape: &Shape, pose: &Pose, ray: &BoxRay, [enters, most]: [f32; 2]) -> Option<(f32, Vec3)> {
    let start = begin(&shape.0.compute_aabb(pose), enters);
    let from_start = Ray::new(ray.at(start), ray.direction);
    if is_surface(&*shape.0) {
        let hit = surface::ray(shape, &from_start.inverse_transform_by(pose), most - start)?;
        return Some((start + hit.time_of_impact, pose.rotation * hit.normal));
    }
    let hit = shape.0.cast_ray_and_get_normal(pose, &from_start, most - start, true)?;
    let distance = start + hit.time_of_impact;
    let is_inside = distance == 0.0 || hit.normal == Vec3::ZERO;
    Some((distance, if is_inside { -ray.direction } else { hit.normal }))
}

/// Where the search starts for a ray that enters a box at distance `enters`: one box diagonal before the box, rounded
/// to a multiple of a power of two of about that length. The rounding keeps equal surfaces of different shapes at equal
/// distances along an axis.
fn begin(aabb: &Aabb, enters: f32) -> f32 {
    let diagonal = (aabb.maxs - aabb.mins).length();
    let unit = f32::from_bits(diagonal.to_bits() & f32::INFINITY.to_bits());
    (((enters - diagonal) / unit).floor() * unit).max(0.0)
}

pub(super) fn contains(shape: &Shape, pose: &Pose, point: Vec3) -> bool {
    !is_surface(&*shape.0) && shape.0.contains_point(pose, point)
}

/// Distance from a point to the surface of a shape, negative inside the shape, with the nearest surface point and its
/// normal.
pub(super) fn closest(shape: &Shape, pose: &Pose, point: Vec3) -> Option<(f32, Vec3, Vec3)> {
    let found = shape.0.project_point(pose, point, false);
    let is_inside = found.is_inside && !is_surface(&*shape.0);
    let (on, away) = (found.point, if is_inside { found.point - point } else { point - found.point });
    let distance = away.length();
    let size = point.abs().max_element() + if shape.is_half_space() { 0.0 } else { shape.bounding_radius() };
    let normal = if let Some(normal) = shape.as_half_space() {
        pose.rotation * normal
    } else if distance > 32.0 * f32::EPSILON * size {
        away / distance
    } else {
        normal_at(shape, pose, on)
    };
    let distance = if is_inside { -distance } else { distance };
    (distance.is_finite() && on.is_finite()).then_some((distance, on, normal))
}

/// The normal of a surface at a point on it, from rays that start near the point.
fn normal_at(shape: &Shape, pose: &Pose, point: Vec3) -> Vec3 {
    let near = 1e-3 * shape.bounding_radius() + 1e-5 * point.abs().max_element();
    let meets = |from: Vec3| {
        let hit = shape.0.cast_ray_and_get_normal(pose, &Ray::new(point + near * from, -from), 2.0 * near, true)?;
        (hit.time_of_impact > 0.0).then_some((hit.normal.dot(from), hit.normal))
    };
    let sides = [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
    let best = sides.into_iter().filter_map(meets).reduce(|best, other| if other.0 > best.0 { other } else { best });
    best.map_or_else(|| (point - pose.translation).normalize_or(Vec3::Y), |(_, normal)| normal)
}

/// Whether two shapes overlap or touch.
pub(super) fn intersect((a, pose_a): (&Shape, &Pose), (b, pose_b): (&Shape, &Pose)) -> bool {
    do_intersect((&*a.0, pose_a), (&*b.0, pose_b))
}

/// For height fields, parry answers only ray and point queries.
fn do_intersect((a, pose_a): (&dyn ParryShape, &Pose), (b, pose_b): (&dyn ParryShape, &Pose)) -> bool {
    if a.as_heightfield().is_none() && b.as_heightfield().is_some() {
        return do_intersect((b, pose_b), (a, pose_a));
    }
    if let Some(field) = a.as_heightfield() {
        let mut do_meet = false;
        let near = b.compute_aabb(&seen_from(*pose_a, *pose_b));
        field.map_elements_in_local_aabb(&near, &mut |_, triangle| {
            do_meet = do_meet || do_intersect((triangle, pose_a), (b, pose_b));
        });
        return do_meet;
    }
    query::intersection_test(pose_a, a, pose_b, b).is_ok_and(|answer| answer.intersecting)
}

/// Distance, point and normal at which a shape that moves along a ray meets another shape, between the distances
/// `enters` and `most`.
pub(super) fn cast(
    (fixed, pose): (&Shape, &Pose),
    (moving, own): (&Shape, &Pose),
    ray: &BoxRay,
    [enters, most]: [f32; 2],
) -> Option<(f32, Vec3, Vec3)> {
    if enters == 0.0 && intersect((fixed, pose), (moving, own)) {
        let deep = query::contact(pose, &*fixed.0, own, &*moving.0, 0.0).ok().flatten();
        let deep = deep.map(|contact| (0.0, contact.point1, contact.normal1));
        let is_good = |hit: &(f32, Vec3, Vec3)| hit.1.is_finite() && hit.2.is_normalized();
        let nearest = || closest(fixed, pose, own.translation).map(|(_, on, normal)| (0.0, on, normal));
        return deep.filter(is_good).or_else(nearest);
    }
    let room =
        fixed.0.compute_aabb(pose).merged(&moving.0.compute_aabb(&Pose::from_parts(pose.translation, own.rotation)));
    let start = begin(&room, enters);
    let mut near = *own;
    near.translation += start * ray.direction;
    let options = ShapeCastOptions::with_max_time_of_impact(most - start);
    let hit = do_cast((&*fixed.0, pose), (&*moving.0, &near), ray.direction, options)?;
    let normal = (pose.rotation * hit.normal1).try_normalize().unwrap_or(-ray.direction);
    Some((start + hit.time_of_impact, pose * hit.witness1, normal))
}

/// Parry counts the cells of a height field that a box covers. It cannot count them for a box that is too large.
fn do_cast(
    (fixed, pose): (&dyn ParryShape, &Pose),
    (moving, own): (&dyn ParryShape, &Pose),
    direction: Vec3,
    options: ShapeCastOptions,
) -> Option<ShapeCastHit> {
    let extent = |shape: &dyn ParryShape| shape.compute_local_aabb().half_extents().max_element();
    let [first, second] = [(fixed, moving), (moving, fixed)].map(|(field, other)| {
        let all = |field: &HeightField| (extent(other) > extent(field)).then(|| field.triangles().collect::<Vec<_>>());
        field.as_heightfield().and_then(all)
    });
    let nearer = |a: ShapeCastHit, b: ShapeCastHit| if b.time_of_impact < a.time_of_impact { b } else { a };
    if let Some(triangles) = first {
        let hit = |triangle: &Triangle| do_cast((triangle, pose), (moving, own), direction, options);
        return triangles.iter().filter_map(hit).reduce(nearer);
    }
    if let Some(triangles) = second {
        let hit = |triangle: &Triangle| do_cast((fixed, pose), (triangle, own), direction, options);
        return triangles.iter().filter_map(hit).reduce(nearer);
    }
    query::cast_shapes(pose, Vec3::ZERO, fixed, own, direction, moving, options).ok()?
}

/// Whether a shape has no inside. Parry treats the points of a triangle as inside it.
fn is_surface(shape: &dyn ParryShape) -> bool {
    shape.as_trimesh().is_some() || shape.as_heightfield().is_some()
}
