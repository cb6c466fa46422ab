//! Time of impact of two shapes within a step, by conservative advancement.
//!
//! Centers of mass move straight, and bodies turn about constant axes. Let f(t) be the separation of the surfaces along
//! a direction d: the least d · x over the points of b, minus the largest over those of a. Over the time t, a point
//! with the arm r moves by d · (v + w × r) t, and deviates from that line by at most |w|² |r| t² / 2. So one support
//! point of each shape, in a slightly turned direction, bounds f from below for all times up to t. The bound is
//! concave: if it holds at the end of an interval, it holds within it. No closer approach of the shapes is missed.

use glam::{Quat, Vec3};
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::query::gjk::{CsoPoint, GJKResult, VoronoiSimplex, closest_points};
use parry3d::query::intersection_test;
use parry3d::shape::{Ball, PolygonalFeatureMap, Shape, Triangle};

use super::collider::{BodyState, ColliderInfo};
use super::solid::{Magnified, Point, Solid, magnification};
use crate::math::rotation::{about, product, unit, vector_of};
use crate::world::placed;

/// Position of the center of mass and rotation of a body at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub center: Vec3,
    pub rotation: Quat,
}

/// The path of a body through a step, whose length is 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPath {
    pub begin: Station,
    /// Displacement of the center of mass (m).
    pub shift: Vec3,
    /// Rotation of the body (rad).
    pub turn: Vec3,
}

impl BodyPath {
    /// The path of a free body in a step of `dt` seconds.
    pub fn free(body: &BodyState, dt: f32) -> Self {
        let begin = Station { center: body.center, rotation: body.rotation };
        Self { begin, shift: (body.v + 0.5 * dt * body.pull) * dt, turn: body.w * dt }
    }

    /// The path from one pose to another, with the rotation that is nearest to `spin` (rad).
    pub fn between(begin: Station, end: Station, spin: Vec3) -> Self {
        let turn = product(end.rotation, begin.rotation.inverse());
        let turn = vector_of(if turn.w < 0.0 { -turn } else { turn });
        let axis = turn.normalize_or_zero();
        let more = ((axis.dot(spin) - axis.dot(turn)) / std::f32::consts::TAU).round();
        Self { begin, shift: end.center - begin.center, turn: turn + more * std::f32::consts::TAU * axis }
    }

    /// The rotation up to a time.
    pub fn turned(&self, time: f32) -> Quat {
        let angle = self.turn.length();
        if angle < 1e-12 { Quat::IDENTITY } else { about(self.turn / angle, angle * time) }
    }

    /// The pose of the body at a time.
    pub fn at(&self, time: f32) -> Station {
        let rotation = unit(product(self.turned(time), self.begin.rotation));
        Station { center: self.begin.center + time * self.shift, rotation }
    }
}

/// A convex shape on its path.
#[derive(Clone, Copy)]
struct Mover<'a> {
    way: &'a BodyPath,
    shape: &'a dyn Shape,
    /// The shape without its rounding; `None` for a point.
    core: Option<&'a dyn PolygonalFeatureMap>,
    radius: f32,
    /// Pose of the shape relative to the center of mass of its body.
    local: Pose,
    /// Radius around the center of mass that contains the core (m).
    reach: f32,
}

/// A shape of a body, and the path of the body.
#[derive(Clone, Copy)]
pub(super) struct Swept<'a> {
    pub shape: &'a dyn Shape,
    /// Pose of the shape relative to the center of mass of its body.
    local: Pose,
    way: &'a BodyPath,
}

impl<'a> Swept<'a> {
    /// A collider of `body`. The center of mass keeps its place in the frame of the body.
    pub fn new(collider: &'a ColliderInfo, body: &BodyState, way: &'a BodyPath) -> Self {
        let center = body.rotation.inverse() * (body.center - body.position);
        let local = Pose::from_parts(collider.local.translation - center, collider.local.rotation);
        Self { shape: &*collider.shape, local, way }
    }

    /// A ball with this radius around the middle of the shape, on the same path.
    pub fn heart<'b>(&self, ball: &'b Ball) -> Swept<'b>
    where
        'a: 'b,
    {
        let middle = self.shape.compute_local_aabb().center();
        let translation = self.local.translation + self.local.rotation * middle;
        Swept { shape: ball, local: Pose::from_parts(translation, Quat::IDENTITY), way: self.way }
    }

    fn is_composite(&self) -> bool {
        self.shape.as_trimesh().is_some() || self.shape.as_heightfield().is_some()
    }

    /// Radius around the center of mass that contains the shape (m).
    fn reach(&self) -> f32 {
        let sphere = self.shape.compute_local_bounding_sphere();
        (self.local.translation + self.local.rotation * sphere.center()).length() + sphere.radius()
    }

    /// A box around the shape on its whole path.
    pub fn aabb(&self) -> Aabb {
        let (from, to) = (self.way.begin.center, self.way.begin.center + self.way.shift);
        Aabb::new(from.min(to), from.max(to)).loosened(self.reach())
    }

    /// As a convex shape; `None` for a half-space, mesh or height field.
    fn mover(&self) -> Option<Mover<'a>> {
        let Self { shape, local, way, .. } = *self;
        if let Some(ball) = shape.as_ball() {
            let reach = local.translation.length();
            return Some(Mover { way, shape, core: None, radius: ball.radius, local, reach });
        }
        let (core, radius) = shape.as_polygonal_feature_map()?;
        Some(Mover { way, shape, core: Some(core), radius, local, reach: self.reach() - radius })
    }
}

/// A mover at a time.
#[derive(Clone, Copy)]
struct Stood<'a> {
    core: Option<&'a dyn PolygonalFeatureMap>,
    center: Vec3,
    /// Pose of the shape relative to the center of mass, in world axes.
    arm: Pose,
}

impl<'a> Mover<'a> {
    fn at(&self, time: f32) -> Stood<'a> {
        let Station { center, rotation } = self.way.at(time);
        let arm = Pose::from_parts(rotation * self.local.translation, product(rotation, self.local.rotation));
        Stood { core: self.core, center, arm }
    }
}

impl Stood<'_> {
    /// Arm of the core's support point in a direction of any length.
    fn furthest(&self, d: Vec3) -> Vec3 {
        let own = |core: &dyn PolygonalFeatureMap| core.local_support_point(self.arm.rotation.inverse() * d);
        self.arm.translation + self.core.map_or(Vec3::ZERO, |core| self.arm.rotation * own(core))
    }
}

/// The first time at which two shapes are near enough, and the direction from a to b at that time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Impact {
    pub time: f32,
    pub normal: Vec3,
    /// Whether they touched at the start of the step.
    pub is_deep: bool,
}

/// The event to search for.
#[derive(Clone, Copy)]
pub(super) enum Until {
    /// The surfaces meet; at once, if they meet at the start of the step.
    Meet,
    /// The surfaces meet; never, if they meet at the start of the step.
    Touch,
    /// The surfaces meet; never, if they overlap at the start of the step.
    Enter,
    /// One shape is deeper in the other than a contact allows.
    Deep,
}

/// Tolerance of a distance, relative to the smallest half extent of the thinner shape.
const NEAR: f32 = 1e-3;
/// Depth of a touching shape at which it is held, and the largest additional depth of a held shape in one step,
/// relative to the same half extent.
const HELD: f32 = 0.2;
const DEEPER: f32 = 0.002;
/// Depth, relative to the same half extent, from which a shape is not held. It did not get there by passing through:
/// walls press it, or it started there. It turns as it comes out.
const STUCK: f32 = 0.35;
/// Largest depth at which a shape is held, relative to the same half extent.
const DEEPEST: f32 = 0.9;
/// Largest number of pieces of a path.
const PIECES: usize = 256;

impl Until {
    fn is_of_both(self) -> bool {
        !matches!(self, Self::Deep)
    }

    /// The target separation for shapes with separation `apart` at the start of the step. Returns `None` if they are
    /// not checked.
    fn least(self, apart: f32, near: f32, size: f32) -> Option<f32> {
        match self {
            Self::Meet => Some(0.0),
            Self::Enter => (apart > 0.0).then_some(0.0),
            Self::Touch => (apart > 2.0 * near).then_some(0.0),
            Self::Deep => {
                let deeper = if apart < -STUCK * size { HELD } else { DEEPER };
                let least = (-HELD * size).min(apart - deeper * size);
                (least > -DEEPEST * size).then_some(least)
            }
        }
    }
}

/// The time of impact of two shapes. At most one of them is a mesh or height field. `size` sets the tolerance of
/// lengths: half of the smallest side of the moving shape. If `is_one_sided`, only those sides of meshes and height
/// fields count that face the center of the other body at the start of the step.
pub(super) fn impact(a: Swept, b: Swept, size: f32, until: Until, is_one_sided: bool) -> Option<Impact> {
    let turned = |impact: Impact| Impact { normal: -impact.normal, ..impact };
    if b.is_composite() || b.shape.as_halfspace().is_some() {
        return if a.is_composite() { None } else { impact(b, a, size, until, is_one_sided).map(turned) };
    }
    let moving = b.mover()?;
    if let Some(plane) = a.shape.as_halfspace() {
        let rotation = product(a.way.begin.rotation, a.local.rotation);
        return with_plane(&a, rotation * plane.normal, &moving, size, until);
    }
    if !a.is_composite() {
        // Gives the same bits for either order of the shapes.
        let [at_a, at_b] = [a, b].map(|side| side.way.begin.center.to_array());
        if until.is_of_both() && at_b.partial_cmp(&at_a) == Some(std::cmp::Ordering::Less) {
            let search = Search { a: moving, b: a.mover()?, faces: None, size, until, latest: 1.0 };
            return search.run().map(turned);
        }
        return Search { a: a.mover()?, b: moving, faces: None, size, until, latest: 1.0 }.run();
    }
    // The path of b in the frame of a.
    let pose = Pose::from_parts(
        a.way.begin.center + a.way.begin.rotation * a.local.translation,
        product(a.way.begin.rotation, a.local.rotation),
    );
    let (from, to) = (b.way.begin.center, b.way.begin.center + (b.way.shift - a.way.shift));
    let reach = b.reach();
    let lever = (from - a.way.begin.center).length().max((to - a.way.begin.center).length()) + reach;
    let around = Aabb::new(from.min(to), from.max(to)).loosened(reach + a.way.turn.length() * lever);
    let around = around.transform_by(&pose.inverse());
    let [from, to] = [from, to].map(|at| pose.inverse_transform_point(at));
    let turns = a.way.turn != Vec3::ZERO;
    let mut first: Option<Impact> = None;
    let mut with = |triangle: &Triangle, has_one_side: bool| {
        let Some(normal) = triangle.normal() else { return };
        let [low, high] = [from, to].map(|at| normal.dot(at - triangle.a));
        let is_behind = is_one_sided && has_one_side && low < 0.0;
        if is_behind || !turns && (low.min(high) > reach || low.max(high) < -reach) {
            return;
        }
        let middle = (triangle.a + triangle.b + triangle.c) / 3.0;
        let way = to - from;
        let share = ((middle - from).dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let radius = triangle.vertices().iter().map(|corner| corner.distance(middle)).fold(0.0, f32::max);
        if !turns && (from + share * way).distance(middle) > reach + radius {
            return;
        }
        let side = Swept { shape: triangle, ..a };
        let Some(flat) = side.mover() else { return };
        let faces = Some((normal, !(is_one_sided && has_one_side)));
        let latest = first.map_or(1.0, |first| first.time);
        let found = Search { a: flat, b: moving, faces, size, until, latest }.run();
        first = found.filter(|found| found.time < latest || first.is_none()).or(first);
    };
    if let Some(mesh) = a.shape.as_trimesh() {
        let near = mesh.bvh().intersect_aabb(&around).filter(|&i| (i as usize) < mesh.num_triangles());
        near.for_each(|i| with(&mesh.triangle(i), mesh.triangle_normal_constraints(i).is_some()));
    } else if let Some(field) = a.shape.as_heightfield() {
        field.map_elements_in_local_aabb(&around, &mut |i, triangle| {
            with(triangle, field.triangle_normal_constraints(i).is_some());
        });
    }
    first
}

/// Whether two shapes overlap at the end of their paths. This is cheaper than the time of impact.
pub(super) fn overlap_at_end(a: Swept, b: Swept) -> bool {
    let [at, of] = [a, b].map(|side| {
        let Station { center, rotation } = side.way.at(1.0);
        placed(Pose::from_parts(center, rotation), side.local)
    });
    intersection_test(&at, a.shape, &of, b.shape).is_ok_and(|answer| answer.intersecting)
}

/// The same for a half-space whose body does not move.
fn with_plane(plane: &Swept, normal: Vec3, b: &Mover, size: f32, until: Until) -> Option<Impact> {
    let point = plane.way.begin.center + plane.way.begin.rotation * plane.local.translation;
    let apart = |stood: &Stood, d: Vec3| d.dot(stood.furthest(-d)) - b.radius;
    let mut pieces = Pieces::new(0.0, 1.0);
    for _ in 0..PIECES {
        let stood = b.at(pieces.time);
        let height = normal.dot(stood.center - point);
        let near = NEAR * size + rounding(b.way, stood.center - point);
        let bound = |time: f32| {
            let d = normal + time * normal.cross(b.way.turn);
            height + time * normal.dot(b.way.shift) + apart(&stood, d) - bend(b) * time * time
        };
        match pieces.next(bound, near, |apart| until.least(apart, near, size)) {
            Piece::End => return None,
            Piece::Met => break,
            Piece::On => {}
        }
    }
    Some(pieces.impact(normal))
}

/// Rounding error of a separation, from the sizes of its terms.
fn rounding(way: &BodyPath, apart: Vec3) -> f32 {
    2.0 * f32::EPSILON * (way.shift.length() + apart.length())
}

/// Half of the largest acceleration of a core point by the rotation.
fn bend(mover: &Mover) -> f32 {
    0.5 * mover.reach * mover.way.turn.length_squared()
}

/// Two convex shapes on their paths.
struct Search<'a> {
    a: Mover<'a>,
    b: Mover<'a>,
    /// The normal of a in its own frame, if a is a triangle, and whether the triangle has two sides.
    faces: Option<(Vec3, bool)>,
    size: f32,
    until: Until,
    /// The latest time of interest.
    latest: f32,
}

impl Search<'_> {
    fn run(&self) -> Option<Impact> {
        let Self { a, b, size, until, latest, .. } = *self;
        let shift = b.way.shift - a.way.shift;
        // Most pairs with overlapping boxes stay apart along the line of their middles.
        let from = b.way.begin.center - a.way.begin.center;
        let share = (-from.dot(shift) / shift.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        if (from + share * shift).length() > a.reach + a.radius + b.reach + b.radius + NEAR * size {
            return None;
        }
        let mut pieces = Pieces::new(0.0, latest);
        let mut known = Vec3::ZERO;
        for _ in 0..PIECES {
            let stood = [a.at(pieces.time), b.at(pieces.time)];
            let apart = stood[1].center - stood[0].center;
            let near = NEAR * size + rounding(b.way, apart) + rounding(a.way, apart);
            let normal = self.direction(&stood, known, pieces.least.map_or(2.0 * near, |least| least + 2.0 * near));
            let bound = |time: f32| {
                let d_a = normal + time * normal.cross(a.way.turn);
                let d_b = normal + time * normal.cross(b.way.turn);
                let arms = d_b.dot(stood[1].furthest(-d_b)) - d_a.dot(stood[0].furthest(d_a));
                normal.dot(apart + time * shift) + arms - (a.radius + b.radius) - (bend(&a) + bend(&b)) * time * time
            };
            known = normal;
            match pieces.next(bound, near, |apart| until.least(apart, near, size)) {
                Piece::End => return None,
                Piece::Met => break,
                Piece::On => {}
            }
        }
        Some(pieces.impact(known))
    }

    /// The direction from a to b along which they are furthest apart. A good direction is sufficient if it separates
    /// them by more than `enough`.
    fn direction(&self, [a, b]: &[Stood; 2], known: Vec3, enough: f32) -> Vec3 {
        let apart = b.center - a.center;
        let along =
            |d: Vec3| d.dot(apart) + d.dot(b.furthest(-d)) - d.dot(a.furthest(d)) - (self.a.radius + self.b.radius);
        let middles = (apart + b.arm.translation - a.arm.translation).normalize_or(Vec3::Y);
        let first = self.search([a, b]).unwrap_or(middles);
        let mut best = (along(first), first);
        if best.0 > enough {
            return best.1;
        }
        let mut consider = |d: Vec3| {
            let distance = along(d);
            if distance > best.0 {
                best = (distance, d);
            }
        };
        if known != Vec3::ZERO {
            consider(known);
        }
        if let Some((normal, has_two_sides)) = self.faces {
            let normal = a.arm.rotation * normal;
            consider(normal);
            if has_two_sides {
                consider(-normal);
            }
        } else if let Some(solid) = Solid::new(self.a.shape, Pose::from_parts(Vec3::ZERO, a.arm.rotation)) {
            solid.each_normal(&mut consider);
        }
        if let Some(solid) = Solid::new(self.b.shape, Pose::from_parts(Vec3::ZERO, b.arm.rotation)) {
            solid.each_normal(|normal| consider(-normal));
        }
        best.1
    }

    /// The direction of the shortest distance between the cores; `None` if they overlap.
    fn search(&self, [a, b]: [&Stood; 2]) -> Option<Vec3> {
        let back = a.arm.rotation.inverse();
        let between = back * ((b.center - a.center) + b.arm.translation - a.arm.translation);
        if a.core.is_none() && b.core.is_none() {
            return between.try_normalize();
        }
        let by = magnification(self.size);
        let pos12 = Pose::from_parts(by * between, product(back, b.arm.rotation));
        let [map_a, map_b] = [a, b].map(|side| Magnified { map: side.core.unwrap_or(&Point), by });
        let mut simplex = VoronoiSimplex::new();
        simplex.reset(CsoPoint::from_shapes(&pos12, &map_a, &map_b, (-between).normalize_or(Vec3::X)));
        match closest_points(&pos12, &map_a, &map_b, f32::MAX, true, &mut simplex) {
            GJKResult::ClosestPoints(on_a, on_b, d) => {
                // If the search stopped early, the points give a better direction than the search.
                let d = (on_b - on_a).try_normalize().unwrap_or(d);
                (a.arm.rotation * d).try_normalize()
            }
            _ => None,
        }
    }
}

/// The part of a path that is known to be free.
struct Pieces {
    time: f32,
    latest: f32,
    /// The target separation.
    least: Option<f32>,
    /// Whether the shapes touch at the start of the step.
    touched: bool,
}

/// The end of a piece.
enum Piece {
    /// The shapes are near enough.
    Met,
    /// They are never near enough, or are not checked.
    End,
    On,
}

impl Pieces {
    fn new(time: f32, latest: f32) -> Self {
        Self { time, latest, least: None, touched: false }
    }

    fn impact(&self, normal: Vec3) -> Impact {
        Impact { time: self.time, normal, is_deep: self.touched }
    }

    /// Advances while `bound`, a concave function of the time from now, stays above the target separation. `least`
    /// returns the target at the first time.
    fn next(&mut self, bound: impl Fn(f32) -> f32, near: f32, least: impl Fn(f32) -> Option<f32>) -> Piece {
        let now = bound(0.0);
        let least = match self.least {
            Some(least) => least,
            None => match least(now) {
                Some(least) => {
                    self.touched = now <= 2.0 * near;
                    *self.least.insert(least)
                }
                None => return Piece::End,
            },
        };
        if now <= least + near {
            return Piece::Met;
        }
        // A straight path meets the target to the last bits, and must not pass it.
        let least = least + 0.25 * near;
        let (mut time, mut above) = (0.0, now - least);
        let mut late = self.latest - self.time;
        let mut below = bound(late) - least;
        if below >= 0.0 {
            return Piece::End;
        }
        // The chord of a concave function lies below it. A little before the root, rounding does not matter.
        for _ in 0..4 {
            if above < 0.5 * near {
                break;
            }
            let next = time + (late - time) * ((above - 0.25 * near) / (above - below));
            let value = bound(next) - least;
            if value < 0.0 {
                (late, below) = (next, value);
                continue;
            }
            (time, above) = (next, value);
            // Past the root, but nearer to it.
            let other = 0.5 * (time + late);
            let value = bound(other) - least;
            if value < 0.0 { (late, below) = (other, value) } else { (time, above) = (other, value) }
        }
        if time <= 0.0 {
            return Piece::Met;
        }
        self.time += time;
        Piece::On
    }
}
