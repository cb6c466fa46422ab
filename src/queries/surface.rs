//! Rays against meshes and height fields. Rays through an edge or a corner meet a triangle of it: parry lets some
//! through, of rays through the corners of a flat field every tenth.

use glam::{DVec3, Vec3, Vec4};
use parry3d::partitioning::BvhNode;
use parry3d::query::Ray;
use parry3d::shape::{HeightField, Triangle};

use super::boxes::BoxRay;
use crate::world::Shape;

/// Cells are this much larger than they are (of the extent of a field): the pose of a field rounds the ray.
const WIDER: f32 = 4.0 * f32::EPSILON;

/// Distance and normal at which a ray in the frame of a mesh or height field meets it within the distance `most`. The
/// direction has unit length.
pub(super) fn ray(shape: &Shape, ray: &Ray, most: f32) -> Option<(f32, Vec3)> {
    if let Some(mesh) = shape.0.as_trimesh() {
        let aabb = mesh.local_aabb();
        let wider =
            WIDER * [ray.origin, aabb.mins, aabb.maxs].map(|p| p.abs().max_element()).into_iter().fold(0.0, f32::max);
        let boxes = BoxRay::new(ray.origin, ray.dir, Vec3::splat(wider))?;
        let enters = |node: &BvhNode, _| {
            let [mins, maxs] = [node.mins(), node.maxs()].map(|corner| corner.to_array().map(Vec4::splat));
            boxes.enters(&mins, &maxs).x
        };
        let meets = |number: u32, most: f32| Some(of_triangle(&mesh.triangle(number), ray, most)?.0);
        let (number, _) = mesh.bvh().find_best(most, enters, meets)?;
        return of_triangle(&mesh.triangle(number), ray, most);
    }
    of_field(shape.0.as_heightfield()?, ray, most)
}

/// The numbers of `count` intervals of the length `step`, from `first` on, that the interval from `a` to `b` meets, in
/// its direction.
fn met([a, b]: [f32; 2], first: f32, step: f32, count: usize, wider: f32) -> impl Iterator<Item = usize> {
    let number = |x: f32| ((x - first) / step).floor().clamp(0.0, count as f32 - 1.0) as usize;
    let (low, high) = (number(a.min(b) - wider), number(a.max(b) + wider));
    (0..=high - low).map(move |k| if a <= b { low + k } else { high - k })
}

fn of_field(field: &HeightField, ray: &Ray, most: f32) -> Option<(f32, Vec3)> {
    let wider = WIDER * (ray.origin.abs().max_element() + field.scale().abs().max_element());
    let aabb = field.local_aabb();
    let (columns, rows) = (field.ncols(), field.nrows());
    let (first, step) =
        (Vec3::new(field.x_at(0), 0.0, field.z_at(0)), Vec3::new(field.cell_width(), 0.0, field.cell_height()));
    // Where the ray is in the box of the field.
    let (mut from, mut to) = (0.0_f32, most);
    for axis in 0..3 {
        let (x, speed) = (ray.origin[axis], ray.dir[axis]);
        let (low, high) = (aabb.mins[axis] - wider, aabb.maxs[axis] + wider);
        if speed == 0.0 {
            if x < low || x > high {
                return None;
            }
            continue;
        }
        let (enters, leaves) = ((low - x) / speed, (high - x) / speed);
        (from, to) = (from.max(enters.min(leaves)), to.min(enters.max(leaves)));
    }
    if from > to {
        return None;
    }
    let mut best: Option<(f32, Vec3)> = None;
    let at = |t: f32| ray.origin + t * ray.dir;
    for column in met([at(from).x, at(to).x], first.x, step.x, columns, wider) {
        // The part of the ray over this column.
        let x = first.x + step.x * column as f32;
        let over = [x - wider, x + step.x + wider].map(|x| (x - ray.origin.x) / ray.dir.x);
        let (enters, leaves) =
            if ray.dir.x == 0.0 { (from, to) } else { (over[0].min(over[1]).max(from), over[0].max(over[1]).min(to)) };
        if best.is_some_and(|(distance, _)| distance < enters) {
            break;
        }
        for row in met([at(enters).z, at(leaves).z], first.z, step.z, rows, wider) {
            let (left, right) = field.triangles_at(row, column);
            for triangle in left.iter().chain(&right) {
                let nearest = best.map_or(most, |(distance, _)| distance);
                best = of_triangle(triangle, ray, nearest).or(best);
            }
        }
    }
    best
}

/// Distance and normal at which a ray meets a triangle within the distance `most`. The normal points against the ray.
///
/// The volume that the ray spans with an edge has the opposite sign, to the last bit, for the other triangle at this
/// edge, so that no ray passes between them (Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, 2013).
fn of_triangle(triangle: &Triangle, ray: &Ray, most: f32) -> Option<(f32, Vec3)> {
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
    Some((distance.max(0.0) as f32, against.as_vec3()))
}
