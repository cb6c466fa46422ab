//! The contact of one pair of colliders: reused while they hardly moved, else asked of parry.

use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::query::TrackedContact;
use parry3d::shape::TypedShape;

use super::collider::{BodyState, ColliderInfo, Margins};
use super::facet::composite_contacts;
use super::manifold::{Manifold, ManifoldPoint, NO_SLOT};
use super::query::{convex_contact, flip};
use super::solid::{ClipBuffers, ContactQuery, ParryManifold};
use crate::random::mixed;

/// Two colliders whose boxes overlap.
#[derive(Clone, Debug)]
pub struct Pair {
    /// The body with the collider that reaches further.
    pub body_a: u32,
    /// The other body.
    pub body_b: u32,
    /// The contacts of the two colliders.
    pub manifolds: Vec<Manifold>,
    pub(super) collider_a: u32,
    pub(super) collider_b: u32,
    /// Half of the smallest side of the thinner one (m).
    pub size: f32,
    /// Radius around the origin of body b that holds its collider (m).
    reach_b: f32,
    /// Distance up to which the last computation predicted (m).
    predicted: f32,
    /// Where the bodies were when the manifolds were computed; none if they never were.
    computed_at: Option<[Placed; 2]>,
    /// Whether a body of it is awake, so that its manifolds are swept.
    pub takes_part: bool,
}

/// Where a body is.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Centre of mass (m).
    pub center: Vec3,
    /// Rotation.
    pub rotation: Quat,
}

impl Placed {
    fn of(body: &BodyState) -> Self {
        Self { center: body.center, rotation: body.rotation }
    }

    /// Rotation since `then`, by the shorter way.
    fn turn_since(&self, then: &Self) -> Quat {
        let turn = self.rotation * then.rotation.conjugate();
        if turn.w < 0.0 { -turn } else { turn }
    }
}

/// A collider, and where its body is.
type Side<'a> = (&'a ColliderInfo, &'a BodyState);

/// Memory that one thread reuses from pair to pair.
#[derive(Default)]
pub(super) struct Scratch {
    buffers: ClipBuffers,
    one: ParryManifold,
    many: Vec<ParryManifold>,
    candidates: Vec<ManifoldPoint>,
    old: Vec<Manifold>,
}

/// Square of the sine of half the angle that either body of a reused manifold may have turned: 0.03 rad. Normals stay as they were
/// computed, so this is how far bodies that turn together may see gravity from the wrong side. At 0.01 rad arches that open a little
/// are computed anew while they do, and one of 17 stones, 0.12 of its radius thick, falls with 8 substeps.
const RECYCLE_TURN: f32 = 2.25e-4;

/// The same where one of them is kinematic, and turns on and on: 0.002 rad. At 0.1 rad a block on a board that tilted slowly
/// slipped 1.6 degrees late, and a ball lost a quarter of its way.
const RECYCLE_TURN_KINEMATIC: f32 = 1e-6;

/// Largest turn of a body in a step with which planes are seen as far ahead as the body gets (rad). The rod of 1000 rad/s (H7) turns by 17.
const MOST_FORESEEN_TURN: f32 = 0.5;

/// How a pair was brought up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Update {
    Reused,
    Computed,
    /// Computed, to another number of manifolds or points.
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
            size: a.size.min(b.size),
            reach_b: b.reach,
            predicted: 0.0,
            computed_at: None,
            takes_part: true,
        }
    }

    /// In which order pairs choose their colors; the lower half is left to the manifolds of the pair. It says nothing of where the pair
    /// is, and is the same in every copy of its world. Pairs that are colored in the order of the bodies color rows of bricks alike: sweeps push a
    /// whole row the same way one after another, and a wall of 400 bricks rattled at 23 mm/s that otherwise rests at 0.2.
    pub fn rank(&self) -> u64 {
        let both = u64::from(self.collider_a) << 32 | u64::from(self.collider_b);
        mixed(both) >> 32 << 32
    }

    /// Whether the bodies touch, or are about to.
    pub fn is_touching(&self) -> bool {
        self.manifolds.iter().any(|manifold| !manifold.has_ended())
    }

    /// Where the bodies were when the manifolds were computed; none if they never were, or a body is out of range.
    pub fn computed_at(&self) -> Option<&[Placed; 2]> {
        self.computed_at.as_ref()
    }

    /// Computes the manifolds anew if the bodies moved too far to the poses `a` and `b` since they were computed.
    pub(super) fn update(
        &mut self,
        colliders: &[ColliderInfo],
        a: &BodyState,
        b: &BodyState,
        margins: Margins,
        scratch: &mut Scratch,
    ) -> Update {
        // A body that left the range touches nothing, so that the trouble does not spread.
        if !(a.is_in_range() && b.is_in_range()) {
            self.manifolds.retain(|manifold| manifold.slot != NO_SLOT);
            self.manifolds.iter_mut().for_each(Manifold::end);
            self.computed_at = None;
            return Update::Reshaped;
        }
        let size = self.size;
        let approach = (b.v - a.v).length() + self.reach_b * (b.w - a.w).length();
        let base = margins.speculative * size + margins.fall;
        // A contact with a plane is true however far away it is seen; with others it would stop what passes by. Arms stay the same within a step.
        let is_far_seen =
            colliders[self.collider_a as usize].unbounded && b.w.length() * margins.dt < MOST_FORESEEN_TURN;
        let farthest = if is_far_seen { f32::MAX } else { 2.0 * size };
        let prediction = base + (approach * margins.dt).min(farthest);

        if let Some([a_then, b_then]) = &self.computed_at {
            let (a_now, b_now) = (Placed::of(a), Placed::of(b));
            let (turn_a, turn_b) = (a_now.turn_since(a_then), b_now.turn_since(b_then));
            // How far any point of b that can touch moved as seen from a. 2 |vector part| is the angle, if small.
            let carried = b_then.center - a_then.center;
            let shift = (b_now.center - a_now.center) - (turn_a * carried);
            let turn = turn_a.conjugate() * turn_b;
            let moved = shift.length() + 2.0 * turn.xyz().length() * self.reach_b;
            let turned = turn_a.xyz().length_squared().max(turn_b.xyz().length_squared());
            let most = if a.kinematic || b.kinematic { RECYCLE_TURN_KINEMATIC } else { RECYCLE_TURN };
            if moved < margins.recycle * size && turned < most && prediction <= self.predicted + 0.5 * base {
                return Update::Reused;
            }
        }
        self.computed_at = Some([Placed::of(a), Placed::of(b)]);
        self.predicted = prediction;
        let before = self.manifolds.len();
        let sides = [(&colliders[self.collider_a as usize], a), (&colliders[self.collider_b as usize], b)];
        self.compute(sides, ContactQuery { prediction, size }, scratch);
        let same = |(now, then): (&Manifold, &Manifold)| now.points().len() == then.points().len();
        let all_same = self.manifolds.len() == before && self.manifolds.iter().zip(&scratch.old).all(same);
        if all_same { Update::Computed } else { Update::Reshaped }
    }

    fn compute(&mut self, sides: [Side; 2], search: ContactQuery, scratch: &mut Scratch) {
        let [(ca, _), (cb, _)] = sides;
        let [pose_a, pose_b] = sides.map(|(c, body)| Pose::from_parts(body.position, body.rotation) * c.local);
        let pos12 = pose_a.inv_mul(&pose_b);
        let Scratch { buffers, one, many, candidates, old } = scratch;
        many.clear();
        let found: &[ParryManifold] = if ca.is_composite() {
            composite_contacts(&*ca.shape, &*cb.shape, &pos12, search, buffers, many);
            many
        } else if cb.is_composite() {
            composite_contacts(&*cb.shape, &*ca.shape, &pos12.inverse(), search, buffers, many);
            many.iter_mut().for_each(flip);
            many
        } else {
            convex_contact((&ca.shape, &cb.shape), &pos12, search, buffers, one);
            std::slice::from_ref(one)
        };

        old.clear();
        old.append(&mut self.manifolds);
        // Most pairs have one manifold; by itself a vector would begin with room for four, a kilobyte too much.
        self.manifolds.reserve_exact(found.len());
        for m in found {
            candidates.clear();
            candidates.extend(m.points.iter().filter_map(|p| candidate(m, p, sides, search.prediction)));
            if candidates.is_empty() {
                continue;
            }
            let normal_a = m.subshape_pos1().map_or(m.local_n1, |pose| pose.rotation * m.local_n1);
            // Coincident centres leave no direction: up is as good as any, and finite.
            let normal = (pose_a.rotation * normal_a).try_normalize().unwrap_or(Vec3::Y);
            let mut manifold = Manifold::new(normal, (m.subshape1, m.subshape2), candidates);
            manifold.radius_a = curvature(ca, pose_a.rotation.inverse() * normal);
            manifold.radius_b = curvature(cb, pose_b.rotation.inverse() * normal);
            if let Some(o) = old.iter_mut().find(|o| o.subshapes == manifold.subshapes && !o.has_ended()) {
                manifold.succeed(o, 0.1 * search.size);
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
    }
}

/// A point of parry's as one of ours; none if it is not finite or too far away.
fn candidate(
    m: &ParryManifold,
    p: &TrackedContact<()>,
    [(ca, a), (cb, b)]: [Side; 2],
    prediction: f32,
) -> Option<ManifoldPoint> {
    let p1 = m.subshape_pos1().map_or(p.local_p1, |pose| pose * p.local_p1);
    let p2 = m.subshape_pos2().map_or(p.local_p2, |pose| pose * p.local_p2);
    let (anchor_a, anchor_b) = (ca.local * p1, cb.local * p2);
    // Arms to the point midway between the surfaces; differences of centres first, which are small.
    let on_a = a.rotation * anchor_a - (a.center - a.position);
    let on_b = b.rotation * anchor_b - (b.center - b.position);
    let half_gap = 0.5 * ((b.center - a.center) + on_b - on_a);
    let usable = p.dist <= prediction && p.dist.is_finite() && on_a.is_finite() && on_b.is_finite();
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

/// Radius of the ball, or of the side of the cylinder, that a shape touches with along `normal` (its own frame) (m).
fn curvature(c: &ColliderInfo, normal: Vec3) -> f32 {
    match c.shape.as_typed_shape() {
        TypedShape::Ball(ball) => ball.radius,
        TypedShape::Capsule(capsule) => capsule.radius,
        TypedShape::Cylinder(cylinder) if normal.y.abs() < 0.1 => cylinder.radius,
        _ => 0.0,
    }
}
