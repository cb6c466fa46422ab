//! What happens to one body between the sweeps. Doubles of `integrate_velocities`, `integrate_gyroscopic` and
//! `integrate_positions`.

use super::rows::{Body, Free, Inertia, Mass, StepParams};
use crate::math::{Lane, Vec3, cross3, dot3, exp_rotation, quat_mul, reciprocal, renormalized, turned, vec3};

/// Adds gravity and force; with `carry` also the impulses that the substep before ended with.
///
/// What they did then, M⁻¹ Gᵀ λ, is what they do now, since neither masses nor arms change within a step, and what they did
/// then is what the velocities differ from the free ones by. So the warm start of every substep but the first costs one
/// subtraction and one addition a body, and no pass over the contacts.
#[inline(always)]
pub fn integrate_velocities<L: Lane>(
    carry: bool,
    params: &StepParams<L>,
    mass: &Mass<L>,
    body: &mut Body<L>,
    free: &mut Free<L>,
) {
    let (carried_v, carried_w) = (body.v - free.v, body.w - free.w);
    body.v += mass.acceleration * params.substep;
    (free.v, free.w) = (body.v, body.w);
    if carry {
        body.v += carried_v;
        body.w += carried_w;
    }
}

/// Moves a body by its velocity.
#[inline(always)]
pub fn integrate_positions<L: Lane>(params: &StepParams<L>, body: &mut Body<L>) {
    body.dp += body.v * params.substep;
    body.dq = renormalized(quat_mul(exp_rotation(body.w * params.substep), body.dq));
}

/// Solves rows x = g by Cramer's rule.
#[inline(always)]
fn solve_3x3<L: Lane>(row_0: Vec3<L>, row_1: Vec3<L>, row_2: Vec3<L>, g: Vec3<L>) -> Vec3<L> {
    let c_0 = cross3(row_1, row_2);
    let c_1 = cross3(row_2, row_0);
    let c_2 = cross3(row_0, row_1);
    (c_0 * g.x + c_1 * g.y + c_2 * g.z) * reciprocal(dot3(row_0, c_0))
}

/// Turns the spin of a body with unequal moments of inertia, by implicit midpoint: I (x - w) + h m x I m = 0 with m
/// midway, which keeps energy and momentum (to 1e-9 over 20 s in f64, where explicit Euler gains eightfold and implicit
/// Euler loses most of it). Two Newton steps.
#[inline(always)]
pub fn integrate_gyroscopic<L: Lane>(
    params: &StepParams<L>,
    inertia: &Inertia<L>,
    body: &mut Body<L>,
    free: &mut Free<L>,
) {
    let (zero, one, half) = (L::constant(0.0), L::constant(1.0), L::constant(0.5));
    let (p, k) = (inertia.principal, inertia.inv_principal);

    // The principal axes now.
    let q = quat_mul(body.dq, inertia.frame);
    let (unit_x, unit_y, unit_z) = (vec3(one, zero, zero), vec3(zero, one, zero), vec3(zero, zero, one));
    let x = turned(q, unit_x) + unit_x;
    let y = turned(q, unit_y) + unit_y;
    let z = turned(q, unit_z) + unit_z;

    // The free spin: impulses come after. Two Newton steps on (next - spin) + h I^-1 (m x I m) = 0 with m midway.
    let spin = vec3(dot3(x, free.w), dot3(y, free.w), dot3(z, free.w));
    let mut next = spin;
    for _ in 0..2 {
        let m = (spin + next) * half;
        let l = p * m;
        let residual = (next - spin) + k * (cross3(m, l) * params.substep);
        let f = k * (params.substep * half);
        let row_0 = vec3(one, f.x * (l.z - m.z * p.y), f.x * (m.y * p.z - l.y));
        let row_1 = vec3(f.y * (m.z * p.x - l.z), one, f.y * (l.x - m.x * p.z));
        let row_2 = vec3(f.z * (l.y - m.y * p.x), f.z * (m.x * p.y - l.x), one);
        next -= solve_3x3(row_0, row_1, row_2, residual);
    }
    // Only the change is turned back: rounding of the axes would otherwise stretch a spin that nothing changes.
    let change = next - spin;
    let turn = x * change.x + y * change.y + z * change.z;
    free.w += turn;
    body.w += turn;
}
