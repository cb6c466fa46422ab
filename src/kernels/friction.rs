//! Friction at one point or over one manifold. Twins of `shaders/lib/friction.wgsl`.

use super::Rules;
use super::pair::{apply_angular_impulse, apply_impulse, note_correction, relative_spin, relative_velocity};
use super::rows::{Contact, Impulse, Pair, Point, StepParams};
use crate::config::FrictionRule;
use crate::math::{Lane, cross3, dot3, larger, smaller};

/// x, at most the limit away from 0.
#[inline(always)]
fn clamp_abs<L: Lane>(x: L, limit: L) -> L {
    larger(smaller(x, limit), -limit)
}

/// The tangential impulse nearest to y that the rule allows. `limit` follows from the normal impulse.
#[inline(always)]
pub fn allowed_friction<L: Lane>(rule: FrictionRule, y: [L; 2], limit: L) -> [L; 2] {
    if rule != FrictionRule::Disc {
        return [clamp_abs(y[0], limit), clamp_abs(y[1], limit)];
    }
    let length_squared = y[0] * y[0] + y[1] * y[1];
    let outside = length_squared.gt(limit * limit);
    let scale = L::select(L::constant(1.0), limit * length_squared.inverse_sqrt(), outside);
    [y[0] * scale, y[1] * scale]
}

/// Coulomb friction. It keeps the sum of the tangential impulses within the limit of the normal impulse.
///
/// Both tangents share one step length, one over the larger eigenvalue of the tangential block. With a matrix step the
/// clamped point would slip in a wrong direction, unless the block is isotropic.
#[inline(always)]
pub fn solve_friction<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    point: &Point<L>,
    normal_impulse: L,
    impulse: &mut Impulse<L>,
) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let u = relative_velocity(rules, pair, point.r_a, point.r_b);
    let mut u_1 = dot3(u, contact.tangent);
    let mut u_2 = dot3(u, tangent_2);
    if rules.driven {
        u_1 = u_1 + point.slip_1;
        u_2 = u_2 + point.slip_2;
    }
    let limit = contact.friction * normal_impulse;
    let mass = params.relaxation * point.tangent_mass;
    let sum = if rules.friction == FrictionRule::Slip {
        // The impulses along both tangents are the components of one impulse along the slip.
        let along = impulse.tangent_1 * point.slip_1 + impulse.tangent_2 * point.slip_2;
        let s = clamp_abs(along - mass * (u_1 * point.slip_1 + u_2 * point.slip_2), limit);
        [s * point.slip_1, s * point.slip_2]
    } else {
        allowed_friction(rules.friction, [impulse.tangent_1 - mass * u_1, impulse.tangent_2 - mass * u_2], limit)
    };
    let change_1 = sum[0] - impulse.tangent_1;
    let change_2 = sum[1] - impulse.tangent_2;
    impulse.tangent_1 = sum[0];
    impulse.tangent_2 = sum[1];
    note_correction(rules, params, pair, change_1, point.tangent_mass);
    note_correction(rules, params, pair, change_2, point.tangent_mass);
    apply_impulse(rules, pair, point.r_a, point.r_b, contact.tangent * change_1 + tangent_2 * change_2);
}

/// Friction against the spin about the normal, limited by the sum of the normal impulses times their distances from the
/// middle.
#[inline(always)]
pub fn solve_twist<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    patch: &Point<L>,
    lever: L,
    impulse: &mut Impulse<L>,
) {
    let spin = dot3(relative_spin(rules, pair), contact.normal);
    let mass = params.relaxation * patch.normal_mass;
    let sum = clamp_abs(impulse.normal - mass * spin, contact.friction * lever);
    let change = contact.normal * (sum - impulse.normal);
    impulse.normal = sum;
    apply_angular_impulse(rules, pair, change);
}

/// Friction against the relative spin of two bodies, at the patch of a manifold whose normal impulses add up to
/// `pressed`. `slip_1` of the patch is the lever of friction against spin about the normal, and `slip_2` that against
/// rolling, which is spin about the tangents (m). Both tangents share one step length, as in [`solve_friction`].
#[inline(always)]
pub fn solve_rolling<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    patch: &Point<L>,
    pressed: L,
    impulse: &mut Impulse<L>,
) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let w = relative_spin(rules, pair);
    let [about_normal, rolling] = [patch.normal_mass, patch.tangent_mass].map(|mass| params.relaxation * mass);
    let spun = clamp_abs(impulse.normal - about_normal * dot3(w, contact.normal), patch.slip_1 * pressed);
    let rolled =
        [impulse.tangent_1 - rolling * dot3(w, contact.tangent), impulse.tangent_2 - rolling * dot3(w, tangent_2)];
    let rolled = allowed_friction(FrictionRule::Disc, rolled, patch.slip_2 * pressed);
    let turn = contact.normal * (spun - impulse.normal)
        + (contact.tangent * (rolled[0] - impulse.tangent_1) + tangent_2 * (rolled[1] - impulse.tangent_2));
    (impulse.normal, impulse.tangent_1, impulse.tangent_2) = (spun, rolled[0], rolled[1]);
    apply_angular_impulse(rules, pair, turn);
}
