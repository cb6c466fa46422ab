//! Corrects the contacts of shapes that lie flush with others.
//!
//! Detection sees each pair of shapes alone. In a row of boxes, each box has edges and sides that are hidden in the
//! row. A body that slides along the row with a tiny overlap is then nearest to an edge of the next box, or even to its
//! hidden side. This module brings the normal of a contact into the cone of normals that all shapes at the contact
//! point have together: the plane across such a normal leaves all of them on one side.

use glam::Vec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use parry3d::query::PointQuery;
use parry3d::shape::{SupportMap, Triangle};

use super::collider::ColliderInfo;
use super::cone::nearest;
use super::pair::{Side, pose};
use super::query::{TRUE, flip, flush_contact};
use super::rim::{each_triangle, goes_on};
use super::solid::{ClipBuffers, ContactQuery, EXACT, ParryManifold, Solid, has_rim};
use super::tree::Tree;
use super::world_contacts::{DetectionInput, Plane, key};
use crate::world::{BodyKind, seen_from};

/// Sine of the angle up to which two directions are equal.
const SAME: f32 = 1e-5;
/// A normal that was turned into the cone can point far through the shape. The deepest allowed overlap along it is five
/// times the overlap along the original normal plus this, relative to the smallest half extent of the thinner shape.
const DEEPEST: f32 = 0.5;

/// Sine of the largest error of a contact direction: parry's search ends when the distance is right to 1e-3 of itself.
/// The error of a point is this share of the distance and of the radius of a round shape.
const ASLANT: f32 = 0.05;
/// Rounding error of a position, relative to its distance from the origin.
const ROUNDING: f32 = 5e-7;

/// The colliders of a world that can lie flush with others.
#[derive(Clone, Copy)]
pub(super) struct Neighbors<'a> {
    pub colliders: &'a [ColliderInfo],
    pub tree: &'a Tree,
    pub planes: &'a [Plane],
    pub input: &'a DetectionInput<'a>,
    /// How much deeper a point can be than the bodies come, because their path leaves out the contacts that hold them
    /// (m).
    pub fall: f32,
}

/// Reusable memory of one thread.
#[derive(Default)]
pub(super) struct FlushScratch {
    pub near: Vec<u32>,
    faces: Vec<Face>,
    directions: Vec<Vec3>,
}

/// The outward normal of a face that belongs to all shapes at a point.
#[derive(Clone, Copy)]
struct Face {
    normal: Vec3,
    /// Whether the shape of the contact has this face.
    is_own: bool,
}

impl Face {
    /// Whether another direction is equal except for rounding and for the tolerance of flush faces.
    fn is_as(&self, normal: Vec3) -> bool {
        self.normal.distance(normal) < EXACT
    }
}

/// A shape, in the frame of the shape whose contact is corrected.
struct Flush<'a> {
    collider: &'a ColliderInfo,
    pose: Pose,
}

impl Flush<'_> {
    fn holds(&self, p: Vec3, exact: f32) -> bool {
        self.collider.shape.distance_to_local_point(self.pose.inverse_transform_point(p), true) <= exact
    }

    /// Calls `with` on the triangles at a point, if it is a mesh or height field.
    fn each_triangle(&self, (p, around): (Vec3, f32), mut with: impl FnMut(&Triangle)) {
        let p = self.pose.inverse_transform_point(p);
        each_triangle(&*self.collider.shape, &Aabb::from_half_extents(p, Vec3::splat(around)), |_, triangle| {
            if triangle.distance_to_local_point(p, true) <= around {
                with(triangle);
            }
        });
    }

    /// Its extent beyond the plane through `top` with the unit normal `n`, and its distance from `top` (m). Of a mesh
    /// or height field, only the triangles at a point count.
    fn beyond(&self, n: Vec3, top: Vec3, at: (Vec3, f32), size: f32) -> (f32, f32) {
        let own = self.pose.rotation.inverse() * n;
        if let Some(plane) = self.collider.shape.as_halfspace() {
            return (size * own.distance(plane.normal), size);
        }
        let beyond = |map: &dyn SupportMap| {
            let away = self.pose * map.local_support_point(own) - top;
            (n.dot(away), away.length())
        };
        if let Some(map) = self.collider.shape.as_support_map() {
            return beyond(map);
        }
        let mut furthest = (0.0, 0.0);
        self.each_triangle(at, |triangle| {
            let one = beyond(triangle);
            furthest = if one.0 > furthest.0 { one } else { furthest };
        });
        furthest
    }

    fn each_face(&self, at: (Vec3, f32), faces: &mut Vec<Face>) {
        let mut add = |normal: Vec3| {
            let normal = self.pose.rotation * normal;
            if faces.iter().all(|face| !face.is_as(normal)) {
                faces.push(Face { normal, is_own: false });
            }
        };
        if let Some(plane) = self.collider.shape.as_halfspace() {
            add(plane.normal);
        } else if let Some(solid) = Solid::new(&*self.collider.shape, Pose::IDENTITY) {
            solid.each_normal(add);
        } else {
            self.each_triangle(at, |triangle| triangle.normal().into_iter().for_each(&mut add));
        }
    }
}

/// The shape whose contact is corrected, the poses of that shape and of the other, and their largest distance.
#[derive(Clone, Copy)]
struct Of {
    own: u32,
    other: u32,
    pose: Pose,
    other_pose: Pose,
    search: ContactQuery,
}

impl Neighbors<'_> {
    /// Corrects the contact of two convex colliders with the shapes that lie flush with either. Returns whether the
    /// contact changed.
    pub fn mend(
        &self,
        [a, b]: [u32; 2],
        sides: [Side; 2],
        search: ContactQuery,
        found: &mut ParryManifold,
        buffers: &mut ClipBuffers,
        scratch: &mut FlushScratch,
    ) -> bool {
        let [pose_a, pose_b] = sides.map(pose);
        let mut is_mended = false;
        if !found.points.is_empty() && self.may_lie_flush(a) {
            let of = Of { own: a, other: b, pose: pose_a, other_pose: pose_b, search };
            is_mended |= self.mend_first(of, found, buffers, scratch);
        }
        if !found.points.is_empty() && self.may_lie_flush(b) {
            let of = Of { own: b, other: a, pose: pose_b, other_pose: pose_a, search };
            flip(found);
            is_mended |= self.mend_first(of, found, buffers, scratch);
            flip(found);
        }
        is_mended
    }

    /// Whether the second of two bodies is fixed and collides with the first.
    pub fn may_hold(&self, body: u32, other: u32) -> bool {
        let DetectionInput { kinds, groups, jointed, .. } = self.input;
        let meets = || groups[body as usize].meets(groups[other as usize]);
        kinds[other as usize] == BodyKind::Fixed && meets() && !jointed.contains(&key(body, other))
    }

    /// Distance up to which a collider lies flush with others (m).
    pub fn flush_distance(own: Pose, size: f32) -> f32 {
        (TRUE * size).max(ROUNDING * own.translation.abs().max_element())
    }

    /// Whether another shape lies flush with the first of two colliders at a point, within `around` (m), and goes on from
    /// there in a direction. Adds the normals of the triangles there. All are in the frame of the first collider, at `own_pose`.
    pub fn go_on(
        &self,
        [own, other]: [u32; 2],
        own_pose: Pose,
        [p, out]: [Vec3; 2],
        around: f32,
        (near, normals): (&mut Vec<u32>, &mut Vec<Vec3>),
    ) -> bool {
        if !self.may_lie_flush(own) {
            return false;
        }
        self.find_near([own, other], own_pose * p, around, near);
        let mut is_found = false;
        for &c in &*near {
            let collider = &self.colliders[c as usize];
            let seen = seen_from(own_pose, pose((collider, &self.input.moving[collider.body as usize])));
            is_found |= goes_on((&*collider.shape, seen), [p, out], around, normals);
        }
        is_found
    }

    /// Whether other colliders can keep their poses relative to this one: true for the colliders of a body that
    /// contacts cannot push.
    fn may_lie_flush(&self, own: u32) -> bool {
        let c = &self.colliders[own as usize];
        !c.unbounded && self.input.kinds[c.body as usize] != BodyKind::Dynamic
    }

    /// The same for shapes that lie flush with the first shape.
    fn mend_first(
        &self,
        of: Of,
        found: &mut ParryManifold,
        buffers: &mut ClipBuffers,
        FlushScratch { near, faces, directions }: &mut FlushScratch,
    ) -> bool {
        let ContactQuery { prediction, size } = of.search;
        let [own, other] = [of.own, of.other].map(|c| &self.colliders[c as usize]);
        // No finer than the rounding of positions.
        let exact = (EXACT * size).max(ROUNDING * of.pose.translation.abs().max_element());
        let Some(solid) = Solid::new(&*own.shape, Pose::IDENTITY) else { return false };
        let other_pose = seen_from(of.pose, of.other_pose);
        let Some(touching) = Solid::or_point(&*other.shape, other_pose) else { return false };
        let n = found.local_n1;
        let flush = |&c: &u32| {
            let collider = &self.colliders[c as usize];
            let body = &self.input.moving[collider.body as usize];
            Flush { collider, pose: seen_from(of.pose, pose((collider, body))) }
        };
        let mut best: Option<(f32, Face)> = None;
        let nearest_dist = found.points.iter().map(|point| point.dist).fold(f32::INFINITY, f32::min);
        let is_exact = other.cuboid.is_some() || other.shape.as_ball().is_some();
        let has_rim = has_rim(&*other.shape);
        let bend = if is_exact { 0.0 } else { other.size };
        for point in &found.points {
            let p = point.local_p1;
            let around = exact.max(TRUE * size).max(ASLANT * (bend + point.dist)) + self.fall;
            // Parry's other points can lie anywhere on the shape.
            if point.dist > nearest_dist + around {
                continue;
            }
            self.find_near([of.own, of.other], of.pose * p, around, near);
            near.retain(|c| flush(c).holds(p, around));
            let is_behind = |(beyond, distance): (f32, f32)| beyond <= SAME * (distance + 0.1 * size);
            let away = solid.furthest(n) - p;
            let is_own_behind = is_behind((n.dot(away), away.length()));
            let is_other_behind = |c: &u32| is_behind(flush(c).beyond(n, p, (p, around), size));
            let is_true = is_own_behind && near.iter().all(is_other_behind);
            if is_true || near.is_empty() && !has_rim {
                return false;
            }
            faces.clear();
            solid.each_normal(|normal| faces.push(Face { normal, is_own: true }));
            near.iter().for_each(|c| flush(c).each_face((p, around), faces));
            // Points that parry finds on an edge lie beside it by more than the tolerance of flush faces.
            faces.retain(|face| {
                let d = face.normal;
                let top = solid.furthest(d);
                d.dot(top - p) <= around && near.iter().all(|c| flush(c).beyond(d, top, (p, around), size).0 <= exact)
            });
            // At an edge of a shape that stands alone, parry's error can point out of the cone.
            if near.is_empty() && faces.len() > 1 {
                return false;
            }
            let mut consider = |face: Face| {
                let d = face.normal;
                let along = d.dot(touching.furthest(-d) - solid.furthest(d)) - touching.radius;
                if best.is_none_or(|best| along > best.0) {
                    best = Some((along, face));
                }
            };
            faces.iter().for_each(|face| consider(*face));
            directions.clear();
            directions.extend(faces.iter().map(|face| face.normal));
            if let Some(normal) = nearest(directions, n).filter(|d| faces.iter().all(|face| !face.is_as(*d))) {
                consider(Face { normal, is_own: false });
            }
        }
        let is_near = |best: &(f32, Face)| best.0 >= 5.0 * nearest_dist.min(0.0) - DEEPEST * size;
        let Some((along, face)) = best.filter(is_near) else { return false };
        if face.normal.distance(n) <= SAME {
            return false;
        }
        found.points.clear();
        if along <= prediction {
            flush_contact(&solid, &touching, (face.normal, face.is_own), of.search, buffers, found);
        }
        true
    }

    /// Finds colliders whose boxes contain a point of the world. They keep their poses relative to `own`, and collide
    /// with the other body.
    fn find_near(&self, [own, other]: [u32; 2], p: Vec3, around: f32, near: &mut Vec<u32>) {
        let DetectionInput { kinds, groups, jointed, .. } = *self.input;
        let [body, guest] = [own, other].map(|c| self.colliders[c as usize].body);
        let stays = |c: u32| {
            let collider = &self.colliders[c as usize];
            let is_fixed = |body: u32| kinds[body as usize] == BodyKind::Fixed;
            c != own
                && !collider.is_gone()
                && !collider.sensor
                && collider.body != guest
                && (collider.body == body || is_fixed(collider.body) && is_fixed(body))
                && groups[collider.body as usize].meets(groups[guest as usize])
                && !jointed.contains(&key(collider.body, guest))
        };
        near.clear();
        self.tree.visit(&Aabb::from_half_extents(p, Vec3::splat(around)), |c| {
            if stays(c) {
                near.push(c);
            }
        });
        near.extend(self.planes.iter().map(|plane| plane.collider).filter(|&c| stays(c)));
        // Makes the order independent of the tree.
        near.sort_unstable();
    }
}
