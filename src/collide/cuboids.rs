//! The contacts of cuboids, sixteen pairs at a time: bit by bit what parry's `contact_manifold_cuboid_cuboid` says of each pair.
//!
//! parry tests the three faces of either cuboid and the nine directions across two edges, and takes the one along which the
//! cuboids are furthest apart. Then it clips the two faces that lie best across that direction. Both stages are the same arithmetic for
//! every pair, and branches become choices. Only pairs that are near go on to the second stage: of those that a falling pile computes
//! about half.
//!
//! No closures in what is over lanes: a closure would be compiled for the plain instruction set.

use std::ops::Range;
use std::sync::{LazyLock, Mutex};

use glam::{Quat, Vec3 as Vector};
use parry3d::query::TrackedContact;
use parry3d::shape::{Cuboid, PolygonalFeature};

use super::collider::{BodyState, CuboidPlace, POSE, POSITION};
use super::lane_pose::{Pose, Turn, backwards, choose, corner, length, magnitude, negative};
use super::solid::ParryManifold;
use crate::backend::cpu::simd::{InstructionSet, Lanes, Row8, WIDTH, Wide, Work, columns};
use crate::math::{Quat as LaneQuat, Vec3, cross3, dot3, vec3};

/// Two cuboids to be compared.
#[derive(Clone, Copy)]
pub(super) struct CuboidPair {
    /// The bodies.
    pub bodies: [u32; 2],
    /// Places in the list of cuboids.
    pub cuboids: [u32; 2],
    /// Distance up to which contacts are sought (m).
    pub prediction: f32,
    /// A number of the caller's.
    pub number: u32,
}

/// Memory for the stages.
#[derive(Default)]
pub(super) struct CuboidScratch {
    near: Vec<Near>,
    clipped: Clipped,
}

/// A pair that is no further apart than its prediction.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Near {
    /// The second cuboid as seen from the first: rotation, place; then the last half extent of the second.
    pose: Row8,
    /// Direction from the first to the second, half extents of the first, and the two others of the second.
    direction: Row8,
    number: u32,
    rest: [u32; 7],
}

/// Calls `with` on the number and the contact of each of `pairs`, in the order of the pairs; pairs that are further apart than
/// their predictions have none.
pub(super) fn cuboid_contacts(
    bodies: &[BodyState],
    cuboids: &[CuboidPlace],
    pairs: &[CuboidPair],
    CuboidScratch { near, clipped }: &mut CuboidScratch,
    mut with: impl FnMut(u32, &dyn Fn(&mut ParryManifold)),
) {
    let set = InstructionSet::default();
    near.clear();
    let separation = Separation { bodies, cuboids, pairs, near: Mutex::new(near) };
    set.run(&separation, 0..pairs.len().div_ceil(WIDTH));
    for group in 0..near.len().div_ceil(WIDTH) {
        set.run(&Clipping { near, clipped: Mutex::new(clipped) }, group..group + 1);
        for (lane, near) in near.iter().skip(group * WIDTH).take(WIDTH).enumerate() {
            with(near.number, &|found| clipped.write(lane, near, found));
        }
    }
}

/// The first stage: along which direction cuboids are furthest apart.
struct Separation<'a> {
    bodies: &'a [BodyState],
    cuboids: &'a [CuboidPlace],
    pairs: &'a [CuboidPair],
    near: Mutex<&'a mut Vec<Near>>,
}

impl Work for Separation<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let mut near = self.near.lock().expect("no other thread has it");
        for group in groups {
            let pairs = &self.pairs[group * WIDTH..self.pairs.len().min((group + 1) * WIDTH)];
            let (mut bodies, mut cuboids, mut prediction) = ([[0; WIDTH]; 2], [[0; WIDTH]; 2], Wide::default());
            for lane in 0..WIDTH {
                let pair = &pairs[lane.min(pairs.len() - 1)];
                for side in 0..2 {
                    bodies[side][lane] = pair.bodies[side];
                    cuboids[side][lane] = pair.cuboids[side];
                }
                prediction.0[lane] = pair.prediction;
            }
            let (pose_1, half_1) = self.side::<L>(&bodies[0], &cuboids[0]);
            let (pose_2, half_2) = self.side::<L>(&bodies[1], &cuboids[1]);
            let pose = pose_1.sees(pose_2);
            let (distance, direction) = separation(half_1, half_2, pose);
            let is_apart = L::select(L::constant(0.0), L::constant(1.0), distance.gt(L::load(&prediction))).store();
            let (q, at) = (pose.rotation, pose.at);
            let poses = L::scattered([q.axis.x, q.axis.y, q.axis.z, q.w, at.x, at.y, at.z, half_2.z]);
            let (d, h) = (direction, half_1);
            let directions = L::scattered([d.x, d.y, d.z, h.x, h.y, h.z, half_2.x, half_2.y]);
            for (lane, pair) in pairs.iter().enumerate() {
                if is_apart.0[lane] == 0.0 {
                    near.push(Near {
                        pose: poses[lane],
                        direction: directions[lane],
                        number: pair.number,
                        rest: [0; 7],
                    });
                }
            }
        }
    }
}

impl Separation<'_> {
    /// Where the cuboids are, and their half extents.
    #[inline(always)]
    fn side<L: Lanes>(&self, bodies: &[u32; WIDTH], cuboids: &[u32; WIDTH]) -> (Pose<L>, Vec3<L>) {
        let q = columns::<L, _>(self.bodies, POSE, bodies);
        let at = columns::<L, _>(self.bodies, POSITION, bodies);
        let local = columns::<L, _>(self.cuboids, 0, cuboids);
        let half = columns::<L, _>(self.cuboids, 1, cuboids);
        let body = Pose { rotation: LaneQuat { axis: vec3(q[0], q[1], q[2]), w: q[3] }, at: vec3(at[0], at[1], at[2]) };
        (body.after(Pose::of(local)), vec3(half[0], half[1], half[2]))
    }
}

/// The largest distance of two cuboids over parry's directions, and that direction.
#[inline(always)]
fn separation<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>, pose: Pose<L>) -> (L, Vec3<L>) {
    let (distance_1, direction_1) = across_faces(half_1, half_2, pose);
    let (distance_2, direction_2) = across_faces(half_2, half_1, pose.inverse());
    let (distance_3, direction_3) = across_edges(half_1, half_2, pose);
    let from_2 = Turn::of(pose.rotation).of_vector(negative(direction_2));
    // Which is best, and in parry's order where two are as good.
    let is_third = distance_3.gt(distance_1);
    let is_second = L::and(distance_2.gt(distance_1), distance_2.gt(distance_3));
    let direction = choose(choose(direction_1, direction_3, is_third), from_2, is_second);
    (L::larger(L::larger(distance_1, distance_2), distance_3), direction)
}

/// The distance across the best face of the first cuboid; between those of several, if the second lies beyond several.
#[inline(always)]
fn across_faces<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>, pose: Pose<L>) -> (L, Vec3<L>) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let (turn, back) = (Turn::of(pose.rotation), Turn::of(backwards(pose.rotation)));
    let place = [pose.at.x, pose.at.y, pose.at.z];
    let half = [half_1.x, half_1.y, half_1.z];
    let mut best = (L::constant(f64::from(f32::MIN)), vec3(zero, zero, zero));
    let (mut sum, mut beyond) = ([zero; 3], zero);
    for i in 0..3 {
        let sign = one.with_sign(place[i]);
        let mut axis = [zero; 3];
        axis[i] = sign;
        let axis = vec3(axis[0], axis[1], axis[2]);
        let nearest = turn.of_vector(corner(half_2, back.of_vector(negative(axis)))) + pose.at;
        let distance = [nearest.x, nearest.y, nearest.z][i] * sign - half[i];
        let is_better = distance.gt(best.0);
        best = (L::select(best.0, distance, is_better), choose(best.1, axis, is_better));
        let is_inside = zero.gt(distance);
        sum[i] = L::select(sign * L::larger(distance, L::constant(f64::from(f32::EPSILON))), zero, is_inside);
        beyond = beyond + L::select(one, zero, is_inside);
    }
    let sum = vec3(sum[0], sum[1], sum[2]);
    let between = sum * one.divided_by(length(sum));
    let toward = negative(between);
    let gap = turn.of_vector(corner(half_2, back.of_vector(toward))) + pose.at - corner(half_1, between);
    let is_between = beyond.gt(one);
    (L::select(best.0, dot3(gap, between), is_between), choose(best.1, between, is_between))
}

/// The distance across the best pair of edges.
#[inline(always)]
fn across_edges<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>, pose: Pose<L>) -> (L, Vec3<L>) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let (turn, back) = (Turn::of(pose.rotation), Turn::of(backwards(pose.rotation)));
    let mut best = (L::constant(f64::from(f32::MIN)), vec3(zero, zero, zero));
    for of_2 in 0..3 {
        let mut edge = [zero; 3];
        edge[of_2] = one;
        let edge = turn.of_vector(vec3(edge[0], edge[1], edge[2]));
        for of_1 in 0..3 {
            let across = match of_1 {
                0 => vec3(zero, -edge.z, edge.y),
                1 => vec3(edge.z, zero, -edge.x),
                _ => vec3(-edge.y, edge.x, zero),
            };
            let norm = length(across);
            let unit = vec3(across.x.divided_by(norm), across.y.divided_by(norm), across.z.divided_by(norm));
            let axis = unit * one.with_sign(dot3(pose.at, unit));
            let nearest = turn.of_vector(corner(half_2, back.of_vector(negative(axis)))) + pose.at;
            let distance = dot3(nearest - corner(half_1, axis), axis);
            let is_better = L::and(norm.gt(L::constant(f64::from(f32::EPSILON))), distance.gt(best.0));
            best = (L::select(best.0, distance, is_better), choose(best.1, axis, is_better));
        }
    }
    best
}

/// Places where two faces can touch: four corners of the first, four of the second, and sixteen crossings of their sides.
const PLACES: usize = 24;

/// What the second stage finds of a group of pairs.
#[derive(Default)]
struct Clipped {
    /// Bit k of the whole number says whether the faces touch at place k.
    touching: Wide,
    /// Distance at each place (m).
    distances: [Wide; PLACES],
    /// How far along the sides of the first and the second face each crossing lies.
    shares: [[Wide; 2]; 16],
    /// Corners of the two faces, as seen from the first cuboid.
    corners: [[[Wide; 3]; 4]; 2],
    /// Which face of each cuboid it is.
    faces: [Wide; 2],
    /// From the second to the first, as seen from the second.
    back: [Wide; 3],
}

/// The second stage: where the faces touch.
struct Clipping<'a> {
    near: &'a [Near],
    clipped: Mutex<&'a mut Clipped>,
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
    /// The same, as seen along the normal of the contact.
    flat: [[L; 2]; 4],
    number: L,
}

#[inline(always)]
fn clip<L: Lanes>(pose: Pose<L>, normal: Vec3<L>, half: [Vec3<L>; 2], clipped: &mut Clipped) {
    let (zero, one, eps) = (L::constant(0.0), L::constant(1.0), L::constant(f64::from(f32::EPSILON)));
    let turn = Turn::of(pose.rotation);
    let back = Turn::of(backwards(pose.rotation)).of_vector(negative(normal));
    // parry's basis of the plane.
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
        let is_open = magnitude(along).gt(eps);
        for k in 0..4 {
            let is_outside = outside(own.flat[k], &other.flat);
            let is_touching = L::and(is_open, one.gt(is_outside));
            touching = touching + L::select(zero, L::constant(bit), is_touching);
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
            // Neither side is a point, and they are not parallel: by more than four floats.
            let is_crossing =
                L::and(L::and(a.gt(eps), e.gt(eps)), L::and(denominator.gt(eps), ae.floats_below(4).gt(bb)));
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

/// The face that lies best across a direction; its corners in parry's order.
#[inline(always)]
fn face<L: Lanes>(half: Vec3<L>, direction: Vec3<L>) -> Face<L> {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let along = vec3(magnitude(direction.x), magnitude(direction.y), magnitude(direction.z));
    let is_y = along.y.gt(along.x);
    let is_z = along.z.gt(L::select(along.x, along.y, is_y));
    let chosen = L::select(L::select(direction.x, direction.y, is_y), direction.z, is_z);
    let sign = one.with_sign(chosen);
    // One where the face lies across that axis.
    let z = L::select(zero, one, is_z);
    let y = L::select(L::select(zero, one, is_y), zero, is_z);
    let (across_y, across_z) = (y.gt(zero), z.gt(zero));
    let across_x = one.gt(y + z);
    let signed = half * sign;
    let (plus, minus) = (half, negative(half));
    let (x_plus, x_minus) = (L::select(plus.x, signed.x, across_x), L::select(minus.x, signed.x, across_x));
    let (y_plus, y_minus) = (L::select(plus.y, signed.y, across_y), L::select(minus.y, signed.y, across_y));
    let (z_plus, z_minus) = (L::select(plus.z, signed.z, across_z), L::select(minus.z, signed.z, across_z));
    // Around the face: y first, then z or x; x first where the face lies across y.
    let corners = [
        vec3(x_plus, y_plus, z_plus),
        vec3(L::select(x_plus, x_minus, across_y), y_minus, z_plus),
        vec3(x_minus, y_minus, z_minus),
        vec3(L::select(x_plus, x_minus, across_z), y_plus, z_minus),
    ];
    let number = L::constant(2.0) * (y + z + z) + L::select(zero, one, sign.gt(zero));
    Face { corners, flat: [[zero; 2]; 4], number }
}

/// Whether a point lies outside of a polygon: 0 or 1. parry's rule, which counts what lies on the line of the last side by the other sides.
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
    fn write(&self, lane: usize, near: &Near, found: &mut ParryManifold) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::mixed;
    use parry3d::math::Pose as ParryPose;
    use parry3d::query::details::contact_manifold_cuboid_cuboid;

    struct Random(u64);

    impl Random {
        /// From -1 to 1.
        fn next(&mut self) -> f32 {
            self.0 += 1;
            (mixed(self.0) >> 40) as f32 / (1 << 23) as f32 - 1.0
        }

        fn vector(&mut self) -> Vector {
            Vector::new(self.next(), self.next(), self.next())
        }

        fn rotation(&mut self) -> Quat {
            Quat::from_xyzw(self.next(), self.next(), self.next(), self.next()).normalize()
        }

        /// One of a few angles, and a tiny one.
        fn nearly_right(&mut self) -> Quat {
            let quarter = |x: f32| (3.0 * x) as i32 as f32 * std::f32::consts::FRAC_PI_2;
            let right = Vector::new(self.next(), self.next(), self.next()).to_array().map(quarter);
            let tiny =
                self.vector() * 10.0_f32.powf(-4.5 + 3.5 * self.next()) * if self.next() > -0.8 { 1.0 } else { 0.0 };
            let turned = Quat::from_euler(glam::EulerRot::XYZ, right[0], right[1], right[2]);
            (Quat::from_scaled_axis(tiny) * turned).normalize()
        }

        fn body(&mut self, position: Vector, rotation: Quat) -> BodyState {
            BodyState { position, rotation, ..BodyState::default() }
        }
    }

    /// Two cuboids about as far apart as they touch. In a row of `round` pairs some have equal sizes, and sides that are the same number.
    fn two(random: &mut Random, nearly_parallel: bool) -> ([BodyState; 2], [CuboidPlace; 2]) {
        let size = |random: &mut Random| {
            let any = Vector::splat(1.05) + random.vector();
            if random.next() > 0.0 { any } else { (any * 4.0).ceil() * 0.25 }
        };
        let half = if random.next() > 0.0 { [size(random); 2] } else { [size(random), size(random)] };
        let base = if random.next() > 0.5 { Quat::IDENTITY } else { random.rotation() };
        let (rotation, mut between) = if nearly_parallel {
            let axis = Vector::AXES[(3.0 * (0.5 + 0.499 * random.next())) as usize];
            let across = random.vector() * (half[0] + half[1]) * (Vector::ONE - axis);
            let gap = 0.02 * random.next() * if random.next() > -0.5 { 1.0 } else { 0.0 };
            let signed = axis * random.next().signum();
            (random.nearly_right(), across + signed * ((half[0] + half[1]).dot(axis) + gap))
        } else {
            (random.rotation(), random.vector() * (half[0].length() + half[1].length()))
        };
        if random.next() > 0.7 {
            between = (between * 8.0).round() * 0.125;
        }
        let at = 5.0 * random.vector();
        let bodies = [random.body(at, base), random.body(at + base * between, (base * rotation).normalize())];
        let local = if random.next() > 0.8 {
            (0.1 * random.vector(), random.rotation())
        } else {
            (Vector::ZERO, Quat::IDENTITY)
        };
        let places =
            [CuboidPlace::new(half[0], local.0, local.1), CuboidPlace::new(half[1], Vector::ZERO, Quat::IDENTITY)];
        (bodies, places)
    }

    /// Compares `count` pairs with parry, bit by bit; returns how many touch.
    fn compare(count: u32, nearly_parallel: bool) -> usize {
        let mut random = Random(if nearly_parallel { 1 << 40 } else { 1 << 41 });
        let (mut scratch, mut touching, mut points) = (CuboidScratch::default(), 0, 0);
        for batch in 0..count.div_ceil(1000) {
            let (mut bodies, mut cuboids, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
            for number in 0..1000 {
                let (two, places) = two(&mut random, nearly_parallel);
                bodies.extend(two);
                cuboids.extend(places);
                let ids = [2 * number, 2 * number + 1];
                let prediction = 0.05 * (1.0 + random.next());
                pairs.push(CuboidPair { bodies: ids, cuboids: ids, prediction, number });
            }
            let mut found: Vec<Option<ParryManifold>> = vec![None; 1000];
            cuboid_contacts(&bodies, &cuboids, &pairs, &mut scratch, |number, write| {
                let mut one = ParryManifold::new();
                write(&mut one);
                found[number as usize] = Some(one);
            });
            for pair in &pairs {
                let [a, b] = pair.bodies.map(|i| i as usize);
                let pose = |i: usize| {
                    let body = ParryPose::from_parts(bodies[i].position, bodies[i].rotation);
                    body * ParryPose::from_parts(cuboids[i].position, cuboids[i].rotation)
                };
                let pos12 = pose(a).inv_mul(&pose(b));
                let [box_a, box_b] = [a, b].map(|i| Cuboid::new(cuboids[i].half));
                let mut expected = ParryManifold::new();
                contact_manifold_cuboid_cuboid(&pos12, &box_a, &box_b, pair.prediction, &mut expected);
                let none = ParryManifold::new();
                let found = found[pair.number as usize].as_ref().unwrap_or(&none);
                let bits = |m: &ParryManifold| -> Vec<u32> {
                    let vector = |v: Vector| v.to_array().map(f32::to_bits);
                    let point = |p: &TrackedContact<()>| {
                        let [a, b] = [vector(p.local_p1), vector(p.local_p2)];
                        [&a[..], &b, &[p.dist.to_bits(), p.fid1.0, p.fid2.0]].concat()
                    };
                    let normals = [vector(m.local_n1), vector(m.local_n2)].concat();
                    if m.points.is_empty() {
                        Vec::new()
                    } else {
                        [normals, m.points.iter().flat_map(point).collect()].concat()
                    }
                };
                let what = format!("batch {batch}, pair {}: {pos12:?} {box_a:?} {box_b:?}", pair.number);
                assert_eq!(bits(found), bits(&expected), "{what}\n{:?}\n{:?}", found.points, expected.points);
                touching += usize::from(!found.points.is_empty());
                points += found.points.len();
            }
        }
        println!("{touching} of {count} touch, {points} points");
        touching
    }

    #[test]
    fn cuboids_touch_as_parry_says_bit_by_bit() {
        assert!(compare(100_000, false) > 10_000);
    }

    #[test]
    fn nearly_parallel_cuboids_touch_as_parry_says_bit_by_bit() {
        assert!(compare(100_000, true) > 40_000);
    }

    /// A million pairs of either kind: `cargo test --release --lib collide::cuboids -- --ignored`.
    #[test]
    #[ignore = "half a minute"]
    fn a_million_cuboids_touch_as_parry_says_bit_by_bit() {
        assert!(compare(1_000_000, false) > 100_000);
        assert!(compare(1_000_000, true) > 400_000);
    }
}
