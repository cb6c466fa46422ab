//! The contact of one pair of colliders, and its replacement by a newer one.

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::query::TrackedContact;
use parry3d::shape::{Shape, TypedShape};

use super::collider::{BodyState, ColliderInfo};
use super::detector::{ColliderSide, in_order};
use super::facet::composite_contacts;
use super::flush::{FlushScratch, Neighbors};
use super::manifold::{MAX_POINTS, Manifold, ManifoldPoint, NO_SLOT};
use super::query::{convex_contact, empty, flip};
use super::rim::Beside;
use super::solid::{ClipBuffers, ContactQuery, ParryManifold};
use crate::random::mixed;
use crate::world::{Body, BodyKind, World, placed, seen_from};

/// Two colliders whose boxes overlap.
#[derive(Debug)]
pub struct Pair {
    /// The body whose collider has the larger reach.
    pub body_a: u32,
    /// The other body.
    pub body_b: u32,
    /// The contacts of the two colliders.
    pub manifolds: Vec<Manifold>,
    pub(super) collider_a: u32,
    pub(super) collider_b: u32,
    /// The colliders, by index on their bodies.
    pub colliders: [u32; 2],
    /// Half of the smallest side of the thinner one (m).
    pub size: f32,
    /// Whether one of its bodies is awake, so that the sweeps solve its manifolds.
    pub takes_part: bool,
    /// Whether its manifolds do not follow from the two colliders: a shape that lies flush with one of them, or a hook,
    /// changed them.
    pub(super) is_mended: bool,
    /// Whether a hook lets the two colliders pass through each other.
    pub(super) is_refused: bool,
}

crate::saved::cloned!(Pair {
    body_a,
    body_b,
    manifolds,
    colliders,
    collider_a,
    collider_b,
    size,
    takes_part,
    is_mended,
    is_refused
});

/// A collider and the state of its body.
pub(super) type Side<'a> = (&'a ColliderInfo, &'a BodyState);

/// Memory that one thread reuses from pair to pair.
#[derive(Default)]
pub(super) struct PairScratch {
    buffers: ClipBuffers,
    one: ParryManifold,
    many: Vec<ParryManifold>,
    flush: FlushScratch,
    renewal: Renewal,
}

/// The same for manifolds that replace others.
#[derive(Default)]
struct Renewal {
    candidates: Vec<ManifoldPoint>,
    old: Vec<Manifold>,
}

/// The result of an update of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Update {
    Reused,
    Computed,
    /// Computed, with another number of manifolds or points.
    Reshaped,
}

impl Pair {
    pub(super) fn new(collider_a: u32, collider_b: u32, colliders: &[ColliderInfo]) -> Self {
        let (a, b) = (&colliders[collider_a as usize], &colliders[collider_b as usize]);
        Self {
            body_a: a.body,
            body_b: b.body,
            manifolds: Vec::new(),
            collider_a,
            collider_b,
            colliders: [a.index, b.index],
            size: a.size.min(b.size),
            takes_part: true,
            is_mended: false,
            is_refused: false,
        }
    }

    /// The order in which pairs choose their colors. The lower half of the number is free for the manifolds of the
    /// pair. The rank does not depend on where the pair is, and is the same in every copy of its world. If pairs chose
    /// colors in the order of bodies, rows of bricks would get the same colors. Sweeps would then push a whole row the
    /// same way, one brick after another: a wall of 400 bricks rattled at 23 mm/s, and rests at 0.2 mm/s with this
    /// rank.
    pub fn rank(&self) -> u64 {
        let both = u64::from(self.collider_a) << 32 | u64::from(self.collider_b);
        mixed(both) >> 32 << 32
    }

    /// Its colliders, the one of the body with the smaller index first.
    pub(super) fn sides(&self) -> [ColliderSide; 2] {
        in_order([(self.body_a, self.colliders[0]), (self.body_b, self.colliders[1])])
    }

    /// Keeps those points of its manifolds for which `kept` is true.
    pub(super) fn drop_points(&mut self, kept: &[[bool; MAX_POINTS]], is_reused: bool) {
        for (manifold, kept) in self.manifolds.iter_mut().zip(kept) {
            manifold.keep(kept, is_reused);
        }
        self.is_mended = true;
    }

    /// Whether the bodies touch or are about to touch.
    pub fn is_touching(&self) -> bool {
        self.manifolds.iter().any(|manifold| !manifold.has_ended())
    }

    /// For each point of a manifold of this pair, at the poses in `world`: the overlap of the surfaces (m) and their
    /// separation speed (m/s).
    pub fn overlaps<'a>(&self, manifold: &'a Manifold, world: &'a World) -> impl Iterator<Item = (f32, f32)> + 'a {
        let [a, b] = [self.body_a, self.body_b].map(|body| &world.bodies[body as usize]);
        let at = |body: &Body, anchor: Vec3| body.position + body.rotation * anchor;
        // A body that became fixed keeps velocity values that have no meaning.
        let velocity =
            |body: &Body, p: Vec3| if body.kind == BodyKind::Fixed { Vec3::ZERO } else { body.velocity_at(p) };
        manifold.points().iter().map(move |point| {
            let (on_a, on_b) = (at(a, point.anchor_a), at(b, point.anchor_b));
            let parting = velocity(b, on_b) - velocity(a, on_a);
            ((on_a - on_b).dot(manifold.normal), parting.dot(manifold.normal))
        })
    }

    /// Ends all manifolds. A body that left the range touches nothing, so that invalid numbers do not spread.
    pub(super) fn end(&mut self) {
        self.manifolds.retain(|manifold| manifold.slot != NO_SLOT);
        self.manifolds.iter_mut().for_each(Manifold::end);
    }

    /// Ends all manifolds of two colliders that do not touch.
    pub(super) fn part(&mut self) -> Update {
        if self.manifolds.is_empty() {
            return Update::Computed;
        }
        self.end();
        Update::Reshaped
    }

    /// Asks parry for the manifolds.
    pub(super) fn compute(
        &mut self,
        sides: [Side; 2],
        prediction: f32,
        neighbors: Option<&Neighbors>,
        scratch: &mut PairScratch,
    ) -> Update {
        let [(ca, _), (cb, _)] = sides;
        let colliders = [self.collider_a, self.collider_b];
        let search = ContactQuery { prediction, size: self.size };
        let [pose_a, pose_b] = sides.map(pose);
        let pos12 = seen_from(pose_a, pose_b);
        let PairScratch { buffers, one, many, flush, renewal } = scratch;
        many.clear();
        let [a, b] = colliders;
        let mut is_mended = false;
        let mut of_composite = |own: [u32; 2], own_pose: Pose, shapes: [&dyn Shape; 2], pos12: &Pose| {
            let around = Neighbors::flush_distance(own_pose, self.size);
            let mut goes_on = |at: [Vec3; 2], normals: &mut Vec<Vec3>| {
                let goes_on = |all: &Neighbors| all.go_on(own, own_pose, at, around, (&mut flush.near, normals));
                let is_covered = neighbors.is_some_and(goes_on);
                is_mended |= is_covered;
                is_covered
            };
            let beside = &mut Beside { around, goes_on: &mut goes_on };
            composite_contacts(shapes[0], shapes[1], pos12, search, beside, buffers, many);
        };
        let found: &[ParryManifold] = if ca.is_composite() {
            of_composite([a, b], pose_a, [&*ca.shape, &*cb.shape], &pos12);
            many
        } else if cb.is_composite() {
            of_composite([b, a], pose_b, [&*cb.shape, &*ca.shape], &pos12.inverse());
            many.iter_mut().for_each(flip);
            many
        } else {
            *one = convex_contact((&ca.shape, &cb.shape), &pos12, search, buffers);
            is_mended = neighbors.is_some_and(|all| all.mend(colliders, sides, search, one, buffers, flush));
            std::slice::from_ref(one)
        };
        self.is_mended = is_mended;
        self.renew(found, sides, prediction, renewal)
    }

    /// Takes over the manifold that `write` returns.
    pub(super) fn take_over(
        &mut self,
        sides: [Side; 2],
        prediction: f32,
        write: &dyn Fn(&mut ParryManifold),
        neighbors: Option<&Neighbors>,
        PairScratch { one, buffers, flush, renewal, .. }: &mut PairScratch,
    ) -> Update {
        empty(one);
        write(one);
        let search = ContactQuery { prediction, size: self.size };
        let colliders = [self.collider_a, self.collider_b];
        self.is_mended = neighbors.is_some_and(|all| all.mend(colliders, sides, search, one, buffers, flush));
        self.renew(std::slice::from_ref(one), sides, prediction, renewal)
    }

    /// Replaces the present manifolds by `found`.
    fn renew(
        &mut self,
        found: &[ParryManifold],
        sides: [Side; 2],
        prediction: f32,
        Renewal { candidates, old }: &mut Renewal,
    ) -> Update {
        let [(ca, _), (cb, _)] = sides;
        let [pose_a, pose_b] = sides.map(pose);
        let before = self.manifolds.len();
        old.clear();
        old.append(&mut self.manifolds);
        // Most pairs have one manifold. The default growth of a vector would allocate four, which wastes a kilobyte.
        self.manifolds.reserve_exact(found.len());
        for m in found {
            let normal_a = m.subshape_pos1().map_or(m.local_n1, |pose| pose.rotation * m.local_n1);
            // Coincident centers give no direction. Up is finite, and as good as any other.
            let normal = (pose_a.rotation * normal_a).try_normalize().unwrap_or(Vec3::Y);
            candidates.clear();
            let lines = [side_line(ca, pose_a, normal), side_line(cb, pose_b, -normal)];
            let on_side = move |p1, p2| on_side(lines, [pose_a, pose_b], [p1, p2]);
            candidates.extend(m.points.iter().filter_map(|p| candidate(m, p, normal, sides, prediction, on_side)));
            if candidates.is_empty() {
                continue;
            }
            let mut manifold = Manifold::new(normal, (m.subshape1, m.subshape2), candidates);
            manifold.radius_a = curvature(ca, pose_a.rotation.inverse() * normal);
            manifold.radius_b = curvature(cb, pose_b.rotation.inverse() * normal);
            if let Some(o) = old.iter_mut().find(|o| o.subshapes == manifold.subshapes && !o.has_ended()) {
                manifold.succeed(o, 0.1 * self.size);
                o.slot = NO_SLOT;
            }
            self.manifolds.push(manifold);
        }
        // A manifold without a successor stays until its slot is free.
        let ended = old.iter().filter(|o| o.slot != NO_SLOT).cloned();
        self.manifolds.extend(ended.map(|mut o| {
            o.end();
            o
        }));
        let same = |(now, then): (&Manifold, &Manifold)| now.points().len() == then.points().len();
        let all_same = self.manifolds.len() == before && self.manifolds.iter().zip(&*old).all(same);
        if all_same { Update::Computed } else { Update::Reshaped }
    }
}

/// The pose of a collider.
pub(super) fn pose((c, body): Side) -> Pose {
    placed(Pose::from_parts(body.position, body.rotation), c.local)
}

/// Converts one of parry's points. Returns `None` if it is not finite or too far away.
fn candidate(
    m: &ParryManifold,
    p: &TrackedContact<()>,
    normal: Vec3,
    [(ca, a), (cb, b)]: [Side; 2],
    prediction: f32,
    on_side: impl Fn(Vec3, Vec3) -> [Vec3; 2],
) -> Option<ManifoldPoint> {
    if p.dist > prediction {
        return None;
    }
    let p1 = m.subshape_pos1().map_or(p.local_p1, |pose| pose * p.local_p1);
    let p2 = m.subshape_pos2().map_or(p.local_p2, |pose| pose * p.local_p2);
    let [p1, p2] = on_side(p1, p2);
    let (anchor_a, anchor_b) = (ca.local * p1, cb.local * p2);
    // Arms to the point midway between overlapping surfaces. Surfaces apart push each other when they meet, so each arm
    // leads to its own surface then. Subtract the centers first: the differences are small.
    let on_a = a.rotation * anchor_a - (a.center - a.position);
    let on_b = b.rotation * anchor_b - (b.center - b.position);
    let half_gap = 0.5 * ((b.center - a.center) + on_b - on_a - normal * p.dist.max(0.0));
    let usable = p.dist.is_finite() && on_a.is_finite() && on_b.is_finite();
    usable.then(|| ManifoldPoint {
        anchor_a,
        anchor_b,
        r_a: on_a + half_gap,
        r_b: on_b - half_gap,
        separation: p.dist,
        features: u64::from(p.fid1.0) << 32 | u64::from(p.fid2.0),
        ..ManifoldPoint::default()
    })
}

/// The place of the line on the side of a cylinder where its surface has the outward normal `out` of the world, from the
/// axis of the cylinder in its own frame (m). `None` for other surfaces.
fn side_line(c: &ColliderInfo, pose: Pose, out: Vec3) -> Option<Vec3> {
    if c.cuboid.is_some() {
        return None;
    }
    let cylinder = c.shape.as_cylinder()?;
    let own = pose.rotation.inverse() * out;
    is_across(own).then(|| cylinder.radius * Vec3::new(own.x, 0.0, own.z).normalize())
}

/// Moves the points of a contact, each in the frame of its collider, to these lines. Parry's points lie up to 0.3 % of
/// the radius beside them, where the spin of a cylinder that rolls would lift it.
fn on_side(lines: [Option<Vec3>; 2], poses: [Pose; 2], points: [Vec3; 2]) -> [Vec3; 2] {
    let ways = [0, 1].map(|i| {
        let line = lines[i]?;
        Some(poses[i].rotation * Vec3::new(line.x - points[i].x, 0.0, line.z - points[i].z))
    });
    let moved = |i: usize| match ways[i].or(ways[1 - i]) {
        Some(way) => points[i] + poses[i].rotation.inverse() * way,
        None => points[i],
    };
    [moved(0), moved(1)]
}

/// Whether a cylinder touches with its side along a normal in its own frame.
fn is_across(normal: Vec3) -> bool {
    normal.y.abs() < 0.1
}

/// Radius of the surface that a shape touches with along `normal`, in its own frame (m): that of a ball, or of the side
/// of a cylinder.
fn curvature(c: &ColliderInfo, normal: Vec3) -> f32 {
    if c.cuboid.is_some() {
        return 0.0;
    }
    match c.shape.as_typed_shape() {
        TypedShape::Ball(ball) => ball.radius,
        TypedShape::Capsule(capsule) => capsule.radius,
        TypedShape::Cylinder(cylinder) if is_across(normal) => cylinder.radius,
        _ => 0.0,
    }
}
