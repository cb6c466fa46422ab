//! What happens at one manifold. Doubles of `shaders/lib/contact.wgsl`, `warm_start`, `solve_contacts` and
//! `apply_restitution`.
//!
//! A point whose effective masses and impulses are zero is left alone, so that manifolds with fewer points can share
//! the lanes of fuller ones.

use super::rows::{Contact, Impulse, Pair, Point, SoftnessOf, StepParams};
use crate::math::{Lane, Vec3, cross3, dot3, larger, turned};

/// The rules of one kernel: the overrides of `shaders/lib/contact.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Rules {
    /// Whether overlap is pushed out.
    pub biased: bool,
    /// Whether friction acts.
    pub friction: bool,
    /// Whether any surface is round.
    pub round: bool,
}

#[inline(always)]
fn apply_impulse<L: Lane>(pair: &mut Pair<L>, point: &Point<L>, p: Vec3<L>) {
    pair.a.v -= p * pair.mass_a.inv_mass;
    pair.a.w -= pair.mass_a.inv_inertia.times(cross3(point.r_a, p));
    pair.b.v += p * pair.mass_b.inv_mass;
    pair.b.w += pair.mass_b.inv_inertia.times(cross3(point.r_b, p));
}

/// Velocity of b relative to a at the point.
#[inline(always)]
pub fn relative_velocity<L: Lane>(pair: &Pair<L>, point: &Point<L>) -> Vec3<L> {
    (pair.b.v + cross3(pair.b.w, point.r_b)) - (pair.a.v + cross3(pair.a.w, point.r_a))
}

/// Separation now: what it was when the step began, and what the bodies moved since.
#[inline(always)]
pub fn current_separation<L: Lane>(rules: Rules, pair: &Pair<L>, point: &Point<L>, normal: Vec3<L>) -> L {
    let (mut arm_a, mut arm_b) = (point.r_a, point.r_b);
    // A round surface turns under its contact: what is carried along is the centre of its curvature.
    if rules.round {
        arm_a -= normal * point.radius_a;
        arm_b += normal * point.radius_b;
    }
    let moved_b = pair.b.dp + turned(pair.b.dq, arm_b);
    let moved_a = pair.a.dp + turned(pair.a.dq, arm_a);
    point.separation + dot3(moved_b - moved_a, normal)
}

#[inline(always)]
fn pair_softness<L: Lane>(params: &StepParams<L>, pair: &Pair<L>) -> SoftnessOf<L> {
    let zero = L::constant(0.0);
    let both = L::and(pair.mass_a.inv_mass.gt(zero), pair.mass_b.inv_mass.gt(zero));
    let (f, m) = (&params.fixed, &params.movable);
    SoftnessOf {
        bias_rate: L::select(f.bias_rate, m.bias_rate, both),
        mass_scale: L::select(f.mass_scale, m.mass_scale, both),
        impulse_scale: L::select(f.impulse_scale, m.impulse_scale, both),
        push_limit: L::select(f.push_limit, m.push_limit, both),
    }
}

/// Non-penetration: the sum of the impulses pushes, never pulls.
#[inline(always)]
fn solve_normal<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    softness: &SoftnessOf<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    point: &Point<L>,
    impulse: &mut Impulse<L>,
) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let s = current_separation(rules, pair, point, contact.normal);
    // Apart: may close the gap in this substep. Overlapping: pushed out softly, or not at all in a relax sweep.
    let apart = s.gt(zero);
    let pushed = larger(softness.bias_rate * s, -softness.push_limit);
    let bias = L::select(if rules.biased { pushed } else { zero }, s * params.inverse_substep, apart);
    let mass_scale = L::select(if rules.biased { softness.mass_scale } else { one }, one, apart);
    let impulse_scale = L::select(if rules.biased { softness.impulse_scale } else { zero }, zero, apart);
    let vn = dot3(relative_velocity(pair, point), contact.normal);
    let correction = -(point.normal_mass * mass_scale * (vn + bias)) - impulse_scale * impulse.normal;
    let sum = larger(impulse.normal + correction, zero);
    let change = sum - impulse.normal;
    impulse.normal = sum;
    impulse.peak = larger(impulse.peak, sum);
    apply_impulse(pair, point, contact.normal * change);
}

/// Coulomb friction: the sum of the tangential impulses stays in the disc of radius mu times the normal impulse.
///
/// The step along both tangents has one length, one over the larger eigenvalue of the tangential block: with a matrix
/// step the clamped point slips in a wrong direction unless that block is isotropic.
#[inline(always)]
fn solve_friction<L: Lane>(
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    tangent_2: Vec3<L>,
    point: &Point<L>,
    impulse: &mut Impulse<L>,
) {
    let u = relative_velocity(pair, point);
    let y_1 = impulse.tangent_1 - point.tangent_mass * dot3(u, contact.tangent);
    let y_2 = impulse.tangent_2 - point.tangent_mass * dot3(u, tangent_2);
    let radius = contact.friction * impulse.normal;
    let length_squared = y_1 * y_1 + y_2 * y_2;
    let scale = L::select(L::constant(1.0), radius * length_squared.inverse_sqrt(), length_squared.gt(radius * radius));
    let sum_1 = y_1 * scale;
    let sum_2 = y_2 * scale;
    let change = contact.tangent * (sum_1 - impulse.tangent_1) + tangent_2 * (sum_2 - impulse.tangent_2);
    impulse.tangent_1 = sum_1;
    impulse.tangent_2 = sum_2;
    apply_impulse(pair, point, change);
}

/// Applies the impulses that a manifold already carries. Kernel `warm_start`.
#[inline(always)]
pub fn warm_start<L: Lane>(
    rules: Rules,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    points: &[Point<L>],
    impulses: &[Impulse<L>],
) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    for (point, impulse) in points.iter().zip(impulses) {
        let mut p = contact.normal * impulse.normal;
        if rules.friction {
            p += contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        }
        apply_impulse(pair, point, p);
    }
}

/// Sweeps one manifold: all normals first, then friction within the cone they span. Kernel `solve_contacts`.
#[inline(always)]
pub fn solve_contact<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    points: &[Point<L>],
    impulses: &mut [Impulse<L>],
) {
    let softness = pair_softness(params, pair);
    for (point, impulse) in points.iter().zip(impulses.iter_mut()) {
        solve_normal(rules, params, &softness, pair, contact, point, impulse);
    }
    if rules.friction {
        let tangent_2 = cross3(contact.normal, contact.tangent);
        for (point, impulse) in points.iter().zip(impulses) {
            solve_friction(pair, contact, tangent_2, point, impulse);
        }
    }
}

/// Makes the points bounce that were hit fast enough. Kernel `apply_restitution`.
#[inline(always)]
pub fn restitute_contact<L: Lane>(
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    points: &[Point<L>],
    impulses: &mut [Impulse<L>],
) {
    let zero = L::constant(0.0);
    for (point, impulse) in points.iter().zip(impulses) {
        let hit = (-params.restitution_threshold).gt(point.approach_velocity);
        let bounces = L::and(hit, impulse.peak.gt(zero));
        let vn = dot3(relative_velocity(pair, point), contact.normal);
        let correction = -(point.normal_mass * (vn + contact.restitution * point.approach_velocity));
        let sum = L::select(impulse.normal, larger(impulse.normal + correction, zero), bounces);
        let change = sum - impulse.normal;
        impulse.normal = sum;
        impulse.peak = larger(impulse.peak, sum);
        apply_impulse(pair, point, contact.normal * change);
    }
}
