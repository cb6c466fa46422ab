//! The first stage: the direction along which cuboids are furthest apart, and whether they are near.

use std::ops::Range;
use std::sync::Mutex;

use super::super::collider::{BodyState, CuboidPlace, POSE, POSITION};
use super::super::lane_pose::{Pose, Turn, backwards, corner, length, negative};
use super::{CuboidPair, Near};
use crate::lanes::{Lanes, WIDTH, Wide, Work, columns};
use crate::math::{Quat, Vec3, dot3, select3, vec3};

/// The stage for all pairs. It adds near pairs to `near`.
pub(super) struct Separation<'a> {
    pub bodies: &'a [BodyState],
    pub cuboids: &'a [CuboidPlace],
    pub pairs: &'a [CuboidPair],
    pub near: Mutex<&'a mut Vec<Near>>,
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
            let (pose_1, half_1, least_1) = self.side::<L>(&bodies[0], &cuboids[0]);
            let (pose_2, half_2, least_2) = self.side::<L>(&bodies[1], &cuboids[1]);
            let pose = pose_1.sees(pose_2);
            let (distance, direction) = separation(half_1, half_2, pose, L::smaller(least_1, least_2));
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
    /// Poses, half extents and least distances of the cuboids.
    #[inline(always)]
    fn side<L: Lanes>(&self, bodies: &[u32; WIDTH], cuboids: &[u32; WIDTH]) -> (Pose<L>, Vec3<L>, L) {
        let q = columns::<L, _>(self.bodies, POSE, bodies);
        let at = columns::<L, _>(self.bodies, POSITION, bodies);
        let local = columns::<L, _>(self.cuboids, 0, cuboids);
        let half = columns::<L, _>(self.cuboids, 1, cuboids);
        let body = Pose { rotation: Quat { axis: vec3(q[0], q[1], q[2]), w: q[3] }, at: vec3(at[0], at[1], at[2]) };
        (body.after(Pose::of(local)), vec3(half[0], half[1], half[2]), half[3])
    }
}

/// The largest distance of two cuboids over parry's directions, and its direction.
#[inline(always)]
fn separation<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>, pose: Pose<L>, least: L) -> (L, Vec3<L>) {
    let (distance_1, direction_1) = across_faces(half_1, half_2, pose, least);
    let (distance_2, direction_2) = across_faces(half_2, half_1, pose.inverse(), least);
    let (distance_3, direction_3) = across_edges(half_1, half_2, pose);
    let from_2 = Turn::of(pose.rotation).of_vector(negative(direction_2));
    // Pick the best direction, and the first one in parry's order if two are equal.
    let is_third = distance_3.gt(distance_1);
    let is_second = L::and(distance_2.gt(distance_1), distance_2.gt(distance_3));
    let direction = select3(select3(direction_1, direction_3, is_third), from_2, is_second);
    (L::larger(L::larger(distance_1, distance_2), distance_3), direction)
}

/// The distance across the best face of the first cuboid. If the second lies beyond several faces, the direction is
/// between their normals; `least` stands there for a distance of zero.
#[inline(always)]
fn across_faces<L: Lanes>(half_1: Vec3<L>, half_2: Vec3<L>, pose: Pose<L>, least: L) -> (L, Vec3<L>) {
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
        best = (L::select(best.0, distance, is_better), select3(best.1, axis, is_better));
        let is_inside = zero.gt(distance);
        sum[i] = L::select(sign * L::larger(distance, least), zero, is_inside);
        beyond = beyond + L::select(one, zero, is_inside);
    }
    let sum = vec3(sum[0], sum[1], sum[2]);
    let between = sum * one.divided_by(length(sum));
    let toward = negative(between);
    let gap = turn.of_vector(corner(half_2, back.of_vector(toward))) + pose.at - corner(half_1, between);
    let is_between = beyond.gt(one);
    (L::select(best.0, dot3(gap, between), is_between), select3(best.1, between, is_between))
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
            best = (L::select(best.0, distance, is_better), select3(best.1, axis, is_better));
        }
    }
    best
}
