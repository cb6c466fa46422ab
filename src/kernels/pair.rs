//! Two bodies that one thread works on. Twins of `shaders/lib/pair.wgsl`.

use super::Rules;
use super::rows::{Pair, StepParams, Sym3};
use crate::math::{Lane, Vec3, cross3, dot3, larger, turned, vec3};

/// The change of a body's spin by an impulse with the moment u: its inverse inertia times u.
#[inline(always)]
pub fn spin_of<L: Lane>(rules: Rules, inv_inertia: Sym3<L>, u: Vec3<L>) -> Vec3<L> {
    if rules.isotropic { u * inv_inertia.x.x } else { inv_inertia.times(u) }
}

/// Applies the impulse p to b at r_b, and -p to a at r_a.
#[inline(always)]
pub fn apply_impulse<L: Lane>(rules: Rules, pair: &mut Pair<L>, r_a: Vec3<L>, r_b: Vec3<L>, p: Vec3<L>) {
    pair.a.v -= p * pair.mass_a.inv_mass;
    pair.a.w -= spin_of(rules, pair.mass_a.inv_inertia, cross3(r_a, p));
    pair.b.v += p * pair.mass_b.inv_mass;
    pair.b.w += spin_of(rules, pair.mass_b.inv_inertia, cross3(r_b, p));
    if !rules.isotropic {
        keep_locks(pair);
    }
}

/// Which pairs have a body with locked axes.
#[inline(always)]
pub fn has_locks<L: Lane>(pair: &Pair<L>) -> L::Mask {
    (pair.mass_a.locks + pair.mass_b.locks).gt(L::constant(0.0))
}

/// The sum of the inverse masses of the two bodies along each axis of the world.
#[inline(always)]
pub fn inverse_masses<L: Lane>(pair: &Pair<L>) -> Vec3<L> {
    let all = |m: L| vec3(m, m, m);
    let (a, b) = (pair.mass_a.inv_mass, pair.mass_b.inv_mass);
    if !L::any(has_locks(pair)) {
        return all(a + b);
    }
    pair.mass_a.unlocked(all(a)) + pair.mass_b.unlocked(all(b))
}

/// The sum of the inverse masses of the two bodies along a direction of length 1.
#[inline(always)]
pub fn inverse_mass_along<L: Lane>(rules: Rules, pair: &Pair<L>, n: Vec3<L>) -> L {
    let all = pair.mass_a.inv_mass + pair.mass_b.inv_mass;
    if rules.isotropic || !L::any(has_locks(pair)) {
        return all;
    }
    let Vec3 { x, y, z } = inverse_masses(pair);
    L::select(all, dot3(n, vec3(n.x * x, n.y * y, n.z * z)), has_locks(pair))
}

/// Removes velocities along locked axes, which an impulse gave.
#[inline(always)]
pub fn keep_locks<L: Lane>(pair: &mut Pair<L>) {
    if L::any(has_locks(pair)) {
        pair.a.v = pair.mass_a.unlocked(pair.a.v);
        pair.b.v = pair.mass_b.unlocked(pair.b.v);
    }
}

/// Applies the angular impulse u to b, and -u to a.
#[inline(always)]
pub fn apply_angular_impulse<L: Lane>(rules: Rules, pair: &mut Pair<L>, u: Vec3<L>) {
    pair.a.w -= spin_of(rules, pair.mass_a.inv_inertia, u);
    pair.b.w += spin_of(rules, pair.mass_b.inv_inertia, u);
}

/// Angular velocity of b relative to a.
#[inline(always)]
pub fn relative_spin<L: Lane>(rules: Rules, pair: &Pair<L>) -> Vec3<L> {
    let w = pair.b.w - pair.a.w;
    if rules.from_start { w + (pair.start_b.w - pair.start_a.w) } else { w }
}

/// Velocity of b at r_b relative to a at r_a.
#[inline(always)]
pub fn relative_velocity<L: Lane>(rules: Rules, pair: &Pair<L>, r_a: Vec3<L>, r_b: Vec3<L>) -> Vec3<L> {
    let u = (pair.b.v + cross3(pair.b.w, r_b)) - (pair.a.v + cross3(pair.a.w, r_a));
    if rules.from_start {
        let (a, b) = (&pair.start_a, &pair.start_b);
        return u + ((b.v - a.v) + (cross3(b.w, r_b) - cross3(a.w, r_a)));
    }
    u
}

/// Movement of b at r_b relative to a at r_a since the step began.
#[inline(always)]
pub fn relative_movement<L: Lane>(pair: &Pair<L>, r_a: Vec3<L>, r_b: Vec3<L>) -> Vec3<L> {
    let moved_b = pair.b.dp + turned(pair.b.dq, r_b);
    let moved_a = pair.a.dp + turned(pair.a.dq, r_a);
    moved_b - moved_a
}

/// Records whether an impulse changes a velocity by more than the tolerance. `mass` is its effective mass.
#[inline(always)]
pub fn note_correction<L: Lane>(rules: Rules, params: &StepParams<L>, pair: &mut Pair<L>, impulse: L, mass: L) {
    if rules.measured {
        let above = larger(impulse, -impulse).gt(params.tolerance * mass);
        pair.moving = L::select(pair.moving, L::constant(1.0), above);
    }
}
