//! The sweeps of one manifold. Twins of `shaders/lib/contact.wgsl` and of the kernels `clear_impulses`, `sum_impulses`,
//! `warm_start`, `solve_contacts` and `apply_restitution`.
//!
//! A point with zero effective masses and impulses changes nothing, so manifolds with fewer points can share lanes with
//! fuller ones. With friction per manifold, the last row is the patch.

use super::Rules;
use super::friction::{solve_friction, solve_rolling, solve_twist};
use super::pair::{
    apply_angular_impulse, apply_impulse, inverse_mass_along, keep_locks, note_correction, relative_velocity, spin_of,
};
use super::rows::{Body, Contact, Free, Impulse, Mass, Pair, Point, SoftnessOf, StepParams};
use crate::collide::MAX_POINTS;
use crate::config::FrictionRule;
use crate::math::{
    Lane, NormalMovement, Quat, Vec3, cross3, dot3, exp_rotation, larger, quat_mul, reciprocal, renormalized, select3,
    smaller, vec3,
};

/// The points of a manifold and their impulses, in any storage.
pub trait PointRows<L> {
    /// Number of points, including the patch.
    fn count(&self) -> usize;
    /// The point `k`.
    fn point(&self, k: usize) -> Point<L>;
    /// The impulse of the point `k`.
    fn impulse(&self, k: usize) -> Impulse<L>;
    /// Changes the normal impulse of a point.
    fn set_normal(&mut self, k: usize, normal: L);
    /// Changes the friction of a point.
    fn set_friction(&mut self, k: usize, tangent_1: L, tangent_2: L);
    /// Changes the impulse by which a point bounced.
    fn set_bounce(&mut self, k: usize, bounce: L);
}

impl<L: Lane> PointRows<L> for (&[Point<L>], &mut [Impulse<L>]) {
    fn count(&self) -> usize {
        self.0.len()
    }
    fn point(&self, k: usize) -> Point<L> {
        self.0[k]
    }
    fn impulse(&self, k: usize) -> Impulse<L> {
        self.1[k]
    }
    fn set_normal(&mut self, k: usize, normal: L) {
        self.1[k].normal = normal;
    }
    fn set_friction(&mut self, k: usize, tangent_1: L, tangent_2: L) {
        (self.1[k].tangent_1, self.1[k].tangent_2) = (tangent_1, tangent_2);
    }
    fn set_bounce(&mut self, k: usize, bounce: L) {
        self.1[k].bounce = bounce;
    }
}

/// Movement of the bodies of a contact along its normal since the step began.
#[inline(always)]
pub fn normal_movement<L: Lane>(rules: Rules, pair: &Pair<L>, contact: &Contact<L>) -> NormalMovement<L> {
    let movement = NormalMovement::new(contact.normal, pair.b.dp - pair.a.dp, pair.a.dq, pair.b.dq);
    if rules.round { movement.round(contact.normal, contact.radius_a, contact.radius_b) } else { movement }
}

/// The separation that the solver uses: the separation when the step began, less the preload, plus the movement since.
#[inline(always)]
pub fn current_separation<L: Lane>(movement: &NormalMovement<L>, contact: &Contact<L>, point: &Point<L>) -> L {
    (point.separation - contact.preload) + movement.between(point.r_a, point.r_b)
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

/// Clamps the normal impulse, which pushes and never pulls. The rules clamp the sum of the corrections, or each
/// correction.
#[inline(always)]
fn clamp_normal<L: Lane>(rules: Rules, sum: L, correction: L) -> L {
    let zero = L::constant(0.0);
    if rules.accumulated { larger(sum + correction, zero) } else { sum + larger(correction, zero) }
}

/// The values that the points of a manifold share in a sweep.
struct Common<L> {
    softness: SoftnessOf<L>,
    movement: NormalMovement<L>,
}

/// The change of the normal impulse that a point needs by itself.
///
/// The soft law jumps where the surfaces just touch, from rigid on one side to soft on the other. If rounding moves a
/// separation of 1e-11 m to the other side, the sweep changes by the softness of the spring. For this reason, plain
/// WGSL agrees with the reference to 1e-6 m/s in a typical step and to a few hundredths in the worst one.
#[inline(always)]
fn normal_correction<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    Common { softness, movement }: &Common<L>,
    pair: &Pair<L>,
    contact: &Contact<L>,
    point: &Point<L>,
    impulse: &Impulse<L>,
) -> L {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let s = current_separation(movement, contact, point);
    // Surfaces apart may close the gap in this substep. Overlapping surfaces are pushed apart softly, or not at all in
    // a relax sweep.
    let apart = s.gt(zero);
    let pushed = softness.bias_rate * smaller(s + params.slop, zero);
    let bias = L::select(if rules.biased { pushed } else { zero }, s * params.inverse_substep, apart);
    let mass_scale = L::select(if rules.biased { softness.mass_scale } else { one }, one, apart);
    let impulse_scale = L::select(if rules.biased { softness.impulse_scale } else { zero }, zero, apart);
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let mass = point.normal_mass * mass_scale;
    let spring = -(mass * (vn + bias)) - impulse_scale * impulse.normal;
    // This limits the speed and not the force, so a contact at the limit still carries any load.
    let correction = if rules.biased { smaller(spring, -(mass * (vn - softness.push_limit))) } else { spring };
    let correction = params.relaxation * correction;
    if !rules.bounces {
        return correction;
    }
    // Sweeps leave a body that was struck to the next impact.
    L::select(correction, zero, will_bounce(params, contact, vn, impulse))
}

/// Whether a point with this normal velocity bounces when it touches. A point that sweeps press has met its surface. One
/// that came again at once after it bounced is pressed from its other side, and sweeps stop it.
#[inline(always)]
fn will_bounce<L: Lane>(params: &StepParams<L>, contact: &Contact<L>, vn: L, impulse: &Impulse<L>) -> L::Mask {
    let zero = L::constant(0.0);
    let speed = L::select(-vn, zero, impulse.normal.gt(zero));
    let speed = L::select(speed, zero, zero.gt(impulse.bounce));
    L::and(contact.restitution.gt(zero), speed.gt(params.restitution_threshold))
}

/// Non-penetration at one point.
#[inline(always)]
fn solve_normal<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    common: &Common<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    point: &Point<L>,
    impulse: &mut Impulse<L>,
) {
    let correction = normal_correction(rules, params, common, pair, contact, point, impulse);
    let sum = clamp_normal(rules, impulse.normal, correction);
    let change = sum - impulse.normal;
    impulse.normal = sum;
    note_correction(rules, params, pair, change, point.normal_mass);
    apply_impulse(rules, pair, point.r_a, point.r_b, contact.normal * change);
}

/// Applies impulses at all points of a manifold together, by steepest descent: a share of the `changes` that the points
/// need by themselves, which it returns. It minimizes the energy of the velocities that the points still lack. `wanted`
/// has the change of each point, and the normal velocity that the point lacks. The common change of all points is one
/// impulse at their middle, and no point takes more than its share because it comes first. A point may pull after this,
/// until it is solved alone. `wanted` is an array, because a closure would be compiled without SIMD instructions.
#[inline(always)]
fn press_as_one<L: Lane>(
    rules: Rules,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &impl PointRows<L>,
    wanted: &[(L, L); MAX_POINTS],
) -> L {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let (mut arms_a, mut arms_b) = (Vec3::default(), Vec3::default());
    let (mut count, mut all, mut gain, mut mass) = (zero, zero, zero, zero);
    let (mut middle_a, mut middle_b) = (Vec3::default(), Vec3::default());
    for (k, &(change, lacking)) in wanted.iter().enumerate().take(rules.contact_points(rows.count())) {
        let point = rows.point(k);
        arms_a += point.r_a * change;
        arms_b += point.r_b * change;
        all = all + change;
        gain = gain + change * lacking;
        let share = L::select(zero, one, point.normal_mass.gt(zero));
        middle_a += point.r_a * share;
        middle_b += point.r_b * share;
        count = count + share;
        mass = mass + point.normal_mass;
    }
    let (turn_a, turn_b) = (cross3(arms_a, contact.normal), cross3(arms_b, contact.normal));
    let (spin_a, spin_b) =
        (spin_of(rules, pair.mass_a.inv_inertia, turn_a), spin_of(rules, pair.mass_b.inv_inertia, turn_b));
    let turned = dot3(turn_a, spin_a) + dot3(turn_b, spin_b);
    let moving = inverse_mass_along(rules, pair, contact.normal);
    let moved = (all * all) * moving + turned;
    // The share is at most that of points that all lack the same velocity. The sweep handles the differences between
    // points.
    let inverse = reciprocal(larger(count, one));
    let (about_a, about_b) = (cross3(middle_a * inverse, contact.normal), cross3(middle_b * inverse, contact.normal));
    let turning = dot3(about_a, spin_of(rules, pair.mass_a.inv_inertia, about_a))
        + dot3(about_b, spin_of(rules, pair.mass_b.inv_inertia, about_b));
    let alike = reciprocal(mass * (moving + turning));
    let best = smaller(gain * reciprocal(moved), larger(alike, one));
    let share = L::select(zero, best, L::and(count.gt(one), gain.gt(zero)));
    let push = contact.normal * (share * all);
    pair.a.v -= push * pair.mass_a.inv_mass;
    pair.a.w -= spin_a * share;
    pair.b.v += push * pair.mass_b.inv_mass;
    pair.b.w += spin_b * share;
    if !rules.isotropic {
        keep_locks(pair);
    }
    share
}

/// The velocity that a point lacks, from its unclamped `correction`; 0 if the point has no mass.
#[inline(always)]
fn lacking<L: Lane>(point: &Point<L>, correction: L) -> L {
    let zero = L::constant(0.0);
    L::select(zero, correction * reciprocal(point.normal_mass), point.normal_mass.gt(zero))
}

/// Non-penetration of all points together, before each is solved alone. It changes nothing if each point is solved. If
/// points were only swept one after another, those of a flat impact would turn the body, because the first one takes more
/// than its share.
#[inline(always)]
fn solve_as_one<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    common: &Common<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &mut impl PointRows<L>,
) {
    let mut wanted = [(L::constant(0.0), L::constant(0.0)); MAX_POINTS];
    for (k, wanted) in wanted.iter_mut().enumerate().take(rules.contact_points(rows.count())) {
        let (point, impulse) = (rows.point(k), rows.impulse(k));
        let correction = normal_correction(rules, params, common, pair, contact, &point, &impulse);
        let change = clamp_normal(rules, impulse.normal, correction) - impulse.normal;
        *wanted = (change, lacking(&point, correction));
    }
    let share = press_as_one(rules, pair, contact, rows, &wanted);
    for (k, &(change, _)) in wanted.iter().enumerate().take(rules.contact_points(rows.count())) {
        let normal = rows.impulse(k).normal + share * change;
        rows.set_normal(k, normal);
    }
}

/// Clears the impulse of one point. Kernel `clear_impulses`.
#[inline(always)]
pub fn clear_impulse<L: Lane>(impulse: &mut Impulse<L>) {
    *impulse = Impulse::default();
}

/// Adds the impulse of one point in a substep to the sum of earlier substeps. Kernel `sum_impulses`.
#[inline(always)]
pub fn sum_impulse<L: Lane>(is_first: bool, impulse: &Impulse<L>, total: &mut Impulse<L>) {
    let Vec3 { x, y, z } = impulse.components();
    total.set_components(summed(
        is_first,
        total.components(),
        vec3(x + larger(impulse.bounce, L::constant(0.0)), y, z),
    ));
    total.bounce = L::constant(0.0);
}

/// The impulse of a substep added to the sum of earlier substeps. The first substep begins the sum. Kernel
/// `sum_joint_impulses`.
#[inline(always)]
pub fn summed<L: Lane>(is_first: bool, before: Vec3<L>, now: Vec3<L>) -> Vec3<L> {
    if is_first { now } else { before + now }
}

/// Applies the carried impulses of a manifold. Kernel `warm_start`.
#[inline(always)]
pub fn warm_start<L: Lane>(rules: Rules, pair: &mut Pair<L>, contact: &Contact<L>, rows: &impl PointRows<L>) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let end = rules.contact_points(rows.count());
    for k in 0..end {
        let (point, impulse) = (rows.point(k), rows.impulse(k));
        let mut p = contact.normal * impulse.normal;
        if rules.friction != FrictionRule::None && !rules.is_at_patch() {
            p += contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        }
        apply_impulse(rules, pair, point.r_a, point.r_b, p);
    }
    if rules.friction != FrictionRule::None && rules.patch {
        let (patch, impulse) = (rows.point(end), rows.impulse(end));
        let twist = contact.normal * impulse.normal;
        let p = contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        apply_angular_impulse(rules, pair, if rules.rolls { twist + p } else { twist });
        if !rules.rolls {
            apply_impulse(rules, pair, patch.r_a, patch.r_b, p);
        }
    }
}

/// Sweeps one manifold. Kernel `solve_contacts`.
#[inline(always)]
pub fn solve_contact<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &mut impl PointRows<L>,
) {
    let has_friction = rules.friction != FrictionRule::None;
    let common = Common { softness: pair_softness(params, pair), movement: normal_movement(rules, pair, contact) };
    for _ in 0..rules.passes {
        if has_friction && rules.friction_first {
            sweep_friction(rules, params, pair, contact, rows);
        }
        if rules.as_one {
            solve_as_one(rules, params, &common, pair, contact, rows);
        }
        for k in 0..rules.contact_points(rows.count()) {
            let mut impulse = rows.impulse(k);
            solve_normal(rules, params, &common, pair, contact, &rows.point(k), &mut impulse);
            rows.set_normal(k, impulse.normal);
        }
        if has_friction && !rules.friction_first {
            sweep_friction(rules, params, pair, contact, rows);
        }
    }
}

#[inline(always)]
fn sweep_friction<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &mut impl PointRows<L>,
) {
    let end = rules.contact_points(rows.count());
    if rules.is_at_patch() {
        let (mut pressed, mut lever) = (L::constant(0.0), L::constant(0.0));
        for k in 0..end {
            let normal = rows.impulse(k).pressing(rules);
            pressed = pressed + normal;
            lever = lever + normal * rows.point(k).slip_1;
        }
        let (patch, mut impulse) = (rows.point(end), rows.impulse(end));
        solve_twist(rules, params, pair, contact, &patch, lever, &mut impulse);
        solve_friction(rules, params, pair, contact, &patch, pressed, &mut impulse);
        rows.set_normal(end, impulse.normal);
        rows.set_friction(end, impulse.tangent_1, impulse.tangent_2);
        return;
    }
    let mut pressed = L::constant(0.0);
    for k in 0..end {
        let mut impulse = rows.impulse(k);
        let normal = impulse.pressing(rules);
        solve_friction(rules, params, pair, contact, &rows.point(k), normal, &mut impulse);
        rows.set_friction(k, impulse.tangent_1, impulse.tangent_2);
        if rules.rolls {
            pressed = pressed + normal;
        }
    }
    if rules.rolls {
        let (patch, mut impulse) = (rows.point(end), rows.impulse(end));
        solve_rolling(rules, params, pair, contact, &patch, pressed, &mut impulse);
        rows.set_normal(end, impulse.normal);
        rows.set_friction(end, impulse.tangent_1, impulse.tangent_2);
    }
}

/// The impact of a point within a substep.
#[derive(Clone, Copy)]
struct Impact<L> {
    /// Normal velocity before any impact.
    approach: L,
    /// Speed at which the surfaces meet; 0 if the point does not bounce.
    speed: L,
    /// Time from the start of the substep.
    time: L,
    /// That speed of a point that bounced in the substep before, and comes again instead of bouncing.
    again: L,
}

/// The impact of a point, if it closes within the substep and faster than the threshold. Its time is below zero if the
/// surfaces met in the substep before, whose sweeps left them to this impact.
///
/// Until the end of the step, a free body is further along its acceleration by half a substep times the change of its
/// velocity ([`crate::problem::follow_parabolas`]).
#[inline(always)]
fn impact<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    movement: &NormalMovement<L>,
    pair: &Pair<L>,
    contact: &Contact<L>,
    point: &Point<L>,
    impulse: &Impulse<L>,
) -> Impact<L> {
    let (zero, half, h) = (L::constant(0.0), L::constant(0.5), params.substep);
    let s = current_separation(movement, contact, point);
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let elapsed = L::select(pair.b.time, pair.a.time, pair.mass_a.inv_mass.gt(zero));
    let start = smaller(vn - point.pull * h, zero);
    let gap = s - point.pull * (half * h * elapsed);
    let square = start * start - (point.pull + point.pull) * gap;
    let root = L::select(zero, square * square.inverse_sqrt(), square.gt(zero));
    // Exact without acceleration.
    let speed = -start - (point.pull + point.pull) * gap * reciprocal(root - start);
    let time = larger((gap + gap) * reciprocal(speed - start), -h);
    let bounces = L::and(L::and((-s).gt(vn * h), will_bounce(params, contact, vn, impulse)), square.gt(zero));
    let met = L::select(zero, speed, bounces);
    // A point that bounced in the substep before comes again.
    let again = L::select(zero, met, impulse.bounce.gt(zero));
    Impact { approach: vn, speed: met - again, time: L::select(zero, time, bounces), again }
}

/// Takes the velocities of a movable body without the impulses of this substep, with which it strikes others. Those of
/// a warm start belong to the substep before.
#[inline(always)]
pub fn begin_bounces<L: Lane>(mass: &Mass<L>, body: &mut Body<L>, free: &Free<L>) {
    let is_movable = mass.inv_mass.gt(L::constant(0.0));
    (body.v, body.w) = (select3(body.v, free.v, is_movable), select3(body.w, free.w, is_movable));
}

/// Adds the bounces of a body to its velocities `v` and `w` with impulses, and to those without.
#[inline(always)]
pub fn end_bounces<L: Lane>([v, w]: [Vec3<L>; 2], body: &mut Body<L>, free: &mut Free<L>) {
    let changes = [body.v - free.v, body.w - free.w];
    // Velocities of bodies that do not bounce keep every bit.
    let bounces = (dot3(changes[0], changes[0]) + dot3(changes[1], changes[1])).gt(L::constant(0.0));
    *free = Free { v: body.v, w: body.w };
    (body.v, body.w) = (select3(v, v + changes[0], bounces), select3(w, w + changes[1], bounces));
}

/// Makes the points bounce that meet in this substep: first together, then each alone by its remaining approach. The
/// impulses act when the surfaces meet, so the bodies move before that time with the velocities before them. Kernel
/// `apply_restitution`.
#[inline(always)]
pub fn restitute_contact<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    contact: &Contact<L>,
    rows: &mut impl PointRows<L>,
) {
    let (zero, factor) = (L::constant(0.0), L::constant(1.0) + contact.restitution);
    let movement = normal_movement(rules, pair, contact);
    let before = [pair.a, pair.b];
    let mut wanted = [(zero, zero); MAX_POINTS];
    let mut impacts = [Impact { approach: zero, speed: zero, time: zero, again: zero }; MAX_POINTS];
    let end = rules.contact_points(rows.count());
    for k in 0..end {
        let point = rows.point(k);
        impacts[k] = impact(rules, params, &movement, pair, contact, &point, &rows.impulse(k));
        let lacking = factor * impacts[k].speed;
        wanted[k] = (point.normal_mass * lacking, lacking);
    }
    let share = press_as_one(rules, pair, contact, rows, &wanted);
    let (mut all, mut delay) = (zero, zero);
    for k in 0..end {
        let (point, Impact { approach, speed, time, again }) = (rows.point(k), impacts[k]);
        let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
        let left = L::select(zero, larger(speed + (approach - vn), zero), speed.gt(zero));
        let own = point.normal_mass * (factor * left);
        apply_impulse(rules, pair, point.r_a, point.r_b, contact.normal * own);
        let bounce = share * wanted[k].0 + own;
        rows.set_bounce(k, bounce - again);
        all = all + bounce;
        delay = delay + bounce * time;
    }
    if L::any(all.gt(zero)) {
        let bounces = all.gt(zero);
        let delay = L::select(zero, delay * reciprocal(all), bounces);
        for (body, before) in [&mut pair.a, &mut pair.b].into_iter().zip(&before) {
            body.dp -= (body.v - before.v) * delay;
            let dq = renormalized(quat_mul(exp_rotation((before.w - body.w) * delay), body.dq));
            body.dq = Quat { axis: select3(body.dq.axis, dq.axis, bounces), w: L::select(body.dq.w, dq.w, bounces) };
        }
    }
}
