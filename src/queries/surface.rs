//! Rays against meshes and height fields. Rays through an edge or a corner meet a triangle of it: parry lets some
//! through, of rays through the corners of a flat field every tenth.

use glam::{DVec3, Vec3, Vec4};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::partitioning::BvhNode;
use parry3d::query::{Ray, RayIntersection};
use parry3d::shape::{FeatureId, HeightField, TriMesh, Triangle};

use super::boxes::BoxRay;
use crate::world::Shape;

/// Boxes and cells are this much larger than they are, relative to their places and that of the ray: the pose of a
/// shape rounds the ray.
const WIDER: f32 = 4.0 * f32::EPSILON;

/// Where a ray in the frame of a mesh or height field meets it within the distance `most`. The direction has unit length.
pub(super) fn ray(shape: &Shape, ray: &Ray, most: f32) -> Option<RayIntersection> {
    let aabb = shape.0.compute_local_aabb();
    let places = [ray.origin, aabb.mins, aabb.maxs].map(|p| p.abs().max_element());
    let wider = WIDER * places.into_iter().fold(0.0, f32::max);
    match shape.0.as_trimesh() {
        Some(mesh) => of_mesh(mesh, ray, most, wider),
        None => of_field(shape.0.as_heightfield()?, ray, most, wider),
    }
}

fn of_mesh(mesh: &TriMesh, ray: &Ray, most: f32, wider: f32) -> Option<RayIntersection> {
    let boxes = BoxRay::new(ray.origin, ray.dir, Vec3::splat(wider))?;
    let enters = |node: &BvhNode, _| {
        let [mins, maxs] = [node.mins(), node.maxs()].map(|corner| corner.to_array().map(Vec4::splat));
        boxes.enters(&mins, &maxs).x
    };
    let meets = |number: u32, most: f32| of_triangle(&mesh.triangle(number), ray, most);
    mesh.bvh().find_best(most, enters, meets).map(|(_, hit)| hit)
}

/// The numbers of `count` intervals of the length `step`, from `first` on, that the interval from `a` to `b` meets, in
/// its direction.
fn met([a, b]: [f32; 2], first: f32, step: f32, count: usize, wider: f32) -> impl Iterator<Item = usize> {
    let number = |x: f32| ((x - first) / step).floor().clamp(0.0, count as f32 - 1.0) as usize;
    let (low, high) = (number(a.min(b) - wider), number(a.max(b) + wider));
    (0..=high - low).map(move |k| if a <= b { low + k } else { high - k })
}

fn of_field(field: &HeightField, ray: &Ray, most: f32, wider: f32) -> Option<RayIntersection> {
    let (from, to) = field.local_aabb().loosened(wider).clip_ray_parameters(ray)?;
    let to = to.min(most);
    if from > to {
        return None;
    }
    let at = |t: f32| ray.origin + t * ray.dir;
    let (left, top, width, height) = (field.x_at(0), field.z_at(0), field.cell_width(), field.cell_height());
    let mut best: Option<RayIntersection> = None;
    for column in met([at(from).x, at(to).x], left, width, field.ncols(), wider) {
        // The part of the ray over this column.
        let (mut enters, mut leaves) = (from, to);
        if ray.dir.x != 0.0 {
            let x = left + width * column as f32;
            let [a, b] = [x - wider, x + width + wider].map(|x| (x - ray.origin.x) / ray.dir.x);
            (enters, leaves) = (a.min(b).max(from), a.max(b).min(to));
        }
        if best.is_some_and(|hit| hit.time_of_impact < enters) {
            break;
        }
        for row in met([at(enters).z, at(leaves).z], top, height, field.nrows(), wider) {
            let (left, right) = field.triangles_at(row, column);
            for triangle in left.iter().chain(&right) {
                let nearest = best.map_or(most, |hit| hit.time_of_impact);
                best = of_triangle(triangle, ray, nearest).or(best);
            }
        }
    }
    best
}

/// Where a ray meets a triangle within the distance `most`. The normal points against the ray.
///
/// The volume that the ray spans with an edge has the opposite sign, to the last bit, for the other triangle at this
/// edge, so that no ray passes between them (Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, 2013).
fn of_triangle(triangle: &Triangle, ray: &Ray, most: f32) -> Option<RayIntersection> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|corner| corner.as_dvec3() - origin);
    let volume = |p: DVec3, q: DVec3| direction.dot(p.cross(q));
    let shares = DVec3::new(volume(b, c), volume(c, a), volume(a, b));
    let (sum, zero) = (shares.element_sum(), DVec3::ZERO);
    if sum == 0.0 || !(shares.cmpge(zero).all() || shares.cmple(zero).all()) {
        return None;
    }
    let distance = (shares / sum).dot(DVec3::new(a.dot(direction), b.dot(direction), c.dot(direction)));
    // A ray may start on the triangle.
    let rounding = 8.0 * f64::EPSILON * a.abs().max_element();
    if !(-rounding..=f64::from(most)).contains(&distance) {
        return None;
    }
    let normal = (b - a).cross(c - a).normalize();
    let against = if normal.dot(direction) > 0.0 { -normal } else { normal };
    Some(RayIntersection::new(distance.max(0.0) as f32, against.as_vec3(), FeatureId::Unknown))
}
