//! The second stage: the contact points of near cuboids.

use std::ops::Range;
use std::sync::{LazyLock, Mutex};

use glam::{Quat, Vec3 as Vector};
use parry3d::query::TrackedContact;
use parry3d::shape::{Cuboid, PolygonalFeature};

use super::super::lane_pose::{Pose, Turn, backwards, magnitude, negative};
use super::super::solid::ParryManifold;
use super::Near;
use crate::lanes::{Lanes, WIDTH, Wide, Work, columns};
use crate::math::{Vec3, cross3, dot3, vec3};

/// Candidate points of two faces: four corners of the first, four of the second, and sixteen crossings of their sides.
const PLACES: usize = 24;

/// Results of the second stage for a group of pairs.
#[derive(Default)]
pub(super) struct Clipped {
    /// As an integer, bit k says whether the faces touch at candidate point k.
    touching: Wide,
    /// Distance at each candidate point (m).
    distances: [Wide; PLACES],
    /// Position of each crossing along the sides of the first and the second face.
    shares: [[Wide; 2]; 16],
    /// Corners of the two faces, in the frame of the first cuboid.
    corners: [[[Wide; 3]; 4]; 2],
    /// Index of the face of each cuboid.
    faces: [Wide; 2],
    /// Direction from the second to the first, in the frame of the second.
    back: [Wide; 3],
}

/// The stage for pairs that are near.
pub(super) struct Clipping<'a> {
    pub near: &'a [Near],
    pub clipped: Mutex<&'a mut Clipped>,
}

impl Work for Clipping<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let mut clipped = self.clipped.lock().expect("no other thread has it");
        for group in groups {
            let mut which = [0; WIDTH];
            for (lane, which) in which.iter_mut().enumerate() {
                *which = (group * WIDTH + lane).min(self.near.len() - 1) as u32;
            }
            let (p, d) = (columns::<L, _>(self.near, 0, &which), columns::<L, _>(self.near, 1, &which));
            let half_2 = vec3(d[6], d[7], p[7]);
            clip(Pose::of(p), vec3(d[0], d[1], d[2]), [vec3(d[3], d[4], d[5]), half_2], &mut clipped);
        }
    }
}

/// A face of each cuboid.
struct Face<L> {
    corners: [Vec3<L>; 4],
    /// The corners, projected along the normal of the contact.
    flat: [[L; 2]; 4],
    number: L,
}

#[inline(always)]
fn clip<L: Lanes>(pose: Pose<L>, normal: Vec3<L>, half: [Vec3<L>; 2], clipped: &mut Clipped) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let turn = Turn::of(pose.rotation);
    let back = Turn::of(backwards(pose.rotation)).of_vector(negative(normal));
    // Parry's basis of the plane.
    let sign = one.with_sign(normal.z);
    let a = (-one).divided_by(sign + normal.z);
    let b = normal.x * normal.y * a;
    let basis = [
        vec3(one + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        vec3(b, sign + normal.y * normal.y * a, -normal.y),
    ];
    let mut first = face(half[0], normal);
    let mut second = face(half[1], back);
    for k in 0..4 {
        second.corners[k] = turn.of_vector(second.corners[k]) + pose.at;
    }
    for k in 0..4 {
        first.flat[k] = [dot3(first.corners[k], basis[0]), dot3(first.corners[k], basis[1])];
        second.flat[k] = [dot3(second.corners[k], basis[0]), dot3(second.corners[k], basis[1])];
    }
    let mut touching = zero;
    let mut bit = 1.0;
    for (side, (own, other)) in [(&first, &second), (&second, &first)].into_iter().enumerate() {
        let c = &other.corners;
        let across = cross3(c[2] - c[1], c[0] - c[1]);
        let along = if side == 0 { dot3(across, normal) } else { -dot3(across, normal) };
        for k in 0..4 {
            let is_outside = outside(own.flat[k], &other.flat);
            touching = touching + L::select(zero, L::constant(bit), one.gt(is_outside));
            clipped.distances[4 * side + k] = dot3(c[0] - own.corners[k], across).divided_by(along).store();
            bit *= 2.0;
        }
    }
    for j in 0..4 {
        for i in 0..4 {
            let (from_1, to_1) = (first.flat[i], first.flat[(i + 1) % 4]);
            let (from_2, to_2) = (second.flat[j], second.flat[(j + 1) % 4]);
            let (dir_1, dir_2) = (minus(to_1, from_1), minus(to_2, from_2));
            let r = minus(from_1, from_2);
            let (a, e, b) = (dot2(dir_1, dir_1), dot2(dir_2, dir_2), dot2(dir_1, dir_2));
            let (c, f) = (dot2(dir_1, r), dot2(dir_2, r));
            let (ae, bb) = (a * e, b * b);
            let denominator = ae - bb;
            let s = (b * f - c * e).divided_by(denominator);
            let t = (b * s + f).divided_by(e);
            // Not parallel, by more than four floats.
            let is_crossing = L::and(denominator.gt(zero), ae.floats_below(4).gt(bb));
            let is_within = L::and(L::and(s.gt(zero), one.gt(s)), L::and(t.gt(zero), one.gt(t)));
            touching = touching + L::select(zero, L::constant(bit), L::and(is_crossing, is_within));
            bit *= 2.0;
            let on_1 = first.corners[i] * (one - s) + first.corners[(i + 1) % 4] * s;
            let on_2 = second.corners[j] * (one - t) + second.corners[(j + 1) % 4] * t;
            clipped.distances[8 + 4 * j + i] = dot3(on_2 - on_1, normal).store();
            clipped.shares[4 * j + i] = [s.store(), t.store()];
        }
    }
    clipped.touching = touching.store();
    for k in 0..4 {
        clipped.corners[0][k] = stored(first.corners[k]);
        clipped.corners[1][k] = stored(second.corners[k]);
    }
    clipped.faces = [first.number.store(), second.number.store()];
    clipped.back = stored(back);
}

#[inline(always)]
fn stored<L: Lanes>(v: Vec3<L>) -> [Wide; 3] {
    [v.x.store(), v.y.store(), v.z.store()]
}

/// The face that is most perpendicular to a direction, with its corners in parry's order.
#[inline(always)]
fn face<L: Lanes>(half: Vec3<L>, direction: Vec3<L>) -> Face<L> {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let along = vec3(magnitude(direction.x), magnitude(direction.y), magnitude(direction.z));
    let is_y = along.y.gt(along.x);
    let is_z = along.z.gt(L::select(along.x, along.y, is_y));
    let chosen = L::select(L::select(direction.x, direction.y, is_y), direction.z, is_z);
    let sign = one.with_sign(chosen);
    // 1 if the face is perpendicular to that axis.
    let z = L::select(zero, one, is_z);
    let y = L::select(L::select(zero, one, is_y), zero, is_z);
    let (across_y, across_z) = (y.gt(zero), z.gt(zero));
    let across_x = one.gt(y + z);
    let signed = half * sign;
    let (plus, minus) = (half, negative(half));
    let (x_plus, x_minus) = (L::select(plus.x, signed.x, across_x), L::select(minus.x, signed.x, across_x));
    let (y_plus, y_minus) = (L::select(plus.y, signed.y, across_y), L::select(minus.y, signed.y, across_y));
    let (z_plus, z_minus) = (L::select(plus.z, signed.z, across_z), L::select(minus.z, signed.z, across_z));
    // Order around the face: y first, then z or x; x first if the face is perpendicular to y.
    let corners = [
        vec3(x_plus, y_plus, z_plus),
        vec3(L::select(x_plus, x_minus, across_y), y_minus, z_plus),
        vec3(x_minus, y_minus, z_minus),
        vec3(L::select(x_plus, x_minus, across_z), y_plus, z_minus),
    ];
    let number = L::constant(2.0) * (y + z + z) + L::select(zero, one, sign.gt(zero));
    Face { corners, flat: [[zero; 2]; 4], number }
}

/// Whether a point is outside a polygon: 0 or 1. By parry's rule, the other sides decide about a point on the line of
/// the last side.
#[inline(always)]
fn outside<L: Lanes>(point: [L; 2], polygon: &[[L; 2]; 4]) -> L {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let mut side = perp_dot(minus(polygon[0], polygon[3]), minus(point, polygon[3]));
    let mut outside = zero;
    for j in 0..3 {
        let next = perp_dot(minus(polygon[j + 1], polygon[j]), minus(point, polygon[j]));
        let is_known = magnitude(side).gt(zero);
        outside = L::select(outside, one, L::and(is_known, zero.gt(side * next)));
        side = L::select(next, side, is_known);
    }
    outside
}

#[inline(always)]
fn minus<L: Lanes>(p: [L; 2], q: [L; 2]) -> [L; 2] {
    [p[0] - q[0], p[1] - q[1]]
}

#[inline(always)]
fn dot2<L: Lanes>(p: [L; 2], q: [L; 2]) -> L {
    p[0] * q[0] + p[1] * q[1]
}

#[inline(always)]
fn perp_dot<L: Lanes>(p: [L; 2], q: [L; 2]) -> L {
    p[0] * q[1] - p[1] * q[0]
}

/// parry's numbers of the features of each face.
static FACES: LazyLock<[PolygonalFeature; 6]> = LazyLock::new(|| {
    let directions = Vector::AXES.map(|axis| [-axis, axis]);
    let faces = directions.as_flattened().iter().map(|&direction| Cuboid::new(Vector::ONE).support_face(direction));
    faces.collect::<Vec<_>>().try_into().expect("a cuboid has six faces")
});

impl Clipped {
    /// Writes the contact of one pair.
    pub fn write(&self, lane: usize, near: &Near, found: &mut ParryManifold) {
        let [n_x, n_y, n_z, ..] = near.direction.0;
        let normal = Vector::new(n_x, n_y, n_z);
        let [q_x, q_y, q_z, q_w, x, y, z, _] = near.pose.0;
        let (back, at) = (Quat::from_xyzw(q_x, q_y, q_z, q_w).conjugate(), Vector::new(x, y, z));
        let vector = |of: &[Wide; 3]| Vector::new(of[0].0[lane], of[1].0[lane], of[2].0[lane]);
        let corner = |side: usize, k: usize| vector(&self.corners[side][k % 4]);
        let [first, second] = self.faces.map(|face| &FACES[face.0[lane] as usize]);
        found.local_n1 = normal;
        found.local_n2 = vector(&self.back);
        let touching = self.touching.0[lane] as u32;
        for place in (0..PLACES).filter(|place| touching >> place & 1 == 1) {
            let distance = self.distances[place].0[lane];
            let (on_1, on_2, features) = match place {
                0..4 => (corner(0, place), corner(0, place) + distance * normal, (first.vids[place], second.fid)),
                4..8 => {
                    let k = place - 4;
                    (corner(1, k) - distance * normal, corner(1, k), (first.fid, second.vids[k]))
                }
                _ => {
                    let (j, i) = ((place - 8) / 4, place % 4);
                    let [s, t] = self.shares[place - 8].map(|share| share.0[lane]);
                    let on_1 = corner(0, i) * (1.0 - s) + corner(0, i + 1) * s;
                    let on_2 = corner(1, j) * (1.0 - t) + corner(1, j + 1) * t;
                    (on_1, on_2, (first.eids[i], second.eids[j]))
                }
            };
            found.points.push(TrackedContact::new(on_1, back * (on_2 - at), features.0, features.1, distance));
        }
    }
}
