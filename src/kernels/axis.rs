//! One axis of a joint, along which or about which body a is held, limited or driven. Twins of `shaders/lib/axes.wgsl`.

use super::Rules;
use super::pair::{has_locks, inverse_masses, keep_locks, note_correction, relative_movement};
use super::rows::{Axis, Joint, Pair, StepParams};
use crate::constants::MIN_MOVED;
use crate::math::angles::{self, Angles};
use crate::math::{
    Lane, Quat, Vec3, conjugate, cross3, dot3, larger, quat_mul, reciprocal, select3, smaller, turned, vec3,
};

/// Motion of the bodies along an axis. Twin of the WGSL struct `AxisMotion`.
#[derive(Clone, Copy, Debug, Default)]
pub struct AxisMotion<L> {
    /// The direction in which the bodies shift; zero for an axis to turn about.
    pub along: Vec3<L>,
    /// The axis about which a turns.
    pub about_a: Vec3<L>,
    /// The axis about which b turns.
    pub about_b: Vec3<L>,
    /// Movement of a against b since the step began.
    pub moved: L,
}

/// The rotation vector of a against b since the step began, to 3e-4 at 1 rad.
#[inline(always)]
pub fn relative_turn<L: Lane>(pair: &Pair<L>) -> Vec3<L> {
    let q = quat_mul(pair.a.dq, conjugate(pair.b.dq));
    let sign = L::select(L::constant(1.0), L::constant(-1.0), L::constant(0.0).gt(q.w));
    let half = q.axis * sign;
    half * (L::constant(2.0) + dot3(half, half) * L::constant(1.0 / 3.0))
}

/// A joint with its frames at the present poses of its bodies. The rows of a joint share them.
#[derive(Clone, Copy)]
pub struct Frames<'a, L> {
    joint: &'a Joint<L>,
    /// The rotation of a in the frame on b.
    angles: Angles<L>,
    /// Rotation of the frame on b.
    on_b: Quat<L>,
}

impl<'a, L: Lane> Frames<'a, L> {
    /// The frames; zeros for a joint without frames.
    #[inline(always)]
    pub fn of(pair: &Pair<L>, joint: &'a Joint<L>) -> Self {
        let frame = joint.frame_b;
        let square = frame.w * frame.w + dot3(frame.axis, frame.axis);
        if !L::any(square.gt(L::constant(0.5))) {
            let (values, directions) = ([L::default(); angles::COUNT], [Vec3::default(); angles::COUNT]);
            return Self { joint, angles: Angles { values, directions }, on_b: Quat::default() };
        }
        let on_b = quat_mul(pair.b.dq, joint.frame_b);
        let angles = Angles::of(quat_mul(conjugate(on_b), quat_mul(pair.a.dq, joint.frame_a)));
        Self { joint, angles, on_b }
    }

    /// The axis of an angle between the frames, and the change of the angle since the step began.
    #[inline(always)]
    fn angle_motion(&self, axis: &Axis<L>) -> (Vec3<L>, L) {
        let Angles { values, directions } = &self.angles;
        let (mut value, mut direction) = (values[0], directions[0]);
        for i in 1..angles::COUNT {
            let is_beyond = L::constant(-0.5 - i as f64).gt(axis.coordinate);
            value = L::select(value, values[i], is_beyond);
            direction = select3(direction, directions[i], is_beyond);
        }
        let is_elevation = L::constant(-0.5 - angles::ELEVATION as f64).gt(axis.coordinate);
        if L::any(is_elevation) {
            let (zero, one) = (L::constant(0.0), L::constant(1.0));
            let is_third = L::constant(-1.5 - angles::ELEVATION as f64).gt(axis.coordinate);
            let [second, third] = [angles::HEIGHT, angles::HEIGHT + 1];
            let (angle, about) = angles::elevation(
                L::select(values[second], values[third], is_third),
                select3(directions[second], directions[third], is_third),
                select3(vec3(zero, one, zero), vec3(zero, zero, one), is_third),
            );
            value = L::select(value, angle, is_elevation);
            direction = select3(direction, about, is_elevation);
        }
        // A twist continues beyond pi.
        let turn = L::constant(std::f64::consts::TAU);
        let is_twist = axis.coordinate.gt(L::constant(-1.5));
        let moved = value - axis.start;
        let back = L::select(L::constant(0.0), turn, L::and(is_twist, L::constant(-std::f64::consts::PI).gt(moved)));
        let forth = L::select(L::constant(0.0), turn, L::and(is_twist, moved.gt(L::constant(std::f64::consts::PI))));
        (direction + turned(self.on_b, direction), moved + back - forth)
    }
}

/// Distances below the root of this have no direction (m²).
const MIN_SQUARE: f64 = 1e-12;

/// The direction between the anchors, and the growth of their distance since the step began, after a shift of the
/// anchor of a. Without a length the direction is the carried one.
#[inline(always)]
fn along_anchors<L: Lane>(carried: Vec3<L>, shift: Vec3<L>, length: L) -> (Vec3<L>, L) {
    let apart = carried * length + shift;
    let square = dot3(apart, apart);
    let has_direction = L::and(length.gt(L::constant(0.0)), square.gt(L::constant(MIN_SQUARE)));
    let now = select3(carried, apart * square.inverse_sqrt(), has_direction);
    // This form avoids the cancellation of a difference of two lengths, unless the anchors passed each other.
    let cosine = dot3(carried, now);
    let longer = dot3(carried + now, shift) * reciprocal(L::constant(1.0) + cosine);
    (now, L::select(square * square.inverse_sqrt() - length, longer, cosine.gt(L::constant(0.0))))
}

/// The present axis. It turned with b since the step began. The axis of a distance follows the anchors, and that of an
/// angle both bodies.
#[inline(always)]
pub fn axis_motion<L: Lane>(pair: &Pair<L>, frames: &Frames<L>, axis: &Axis<L>) -> AxisMotion<L> {
    let joint = frames.joint;
    let zero = L::constant(0.0);
    let is_linear = axis.coordinate.gt(zero);
    let carried = axis.direction + turned(pair.b.dq, axis.direction);
    // The anchor of a relative to the point of b that was at the same place when the step began.
    let shift = -relative_movement(pair, joint.r_a, joint.r_b);
    let (now, distance) = along_anchors(carried, shift, axis.start);
    let arm_a = joint.r_a + turned(pair.a.dq, joint.r_a);
    let arm_b = joint.r_b + turned(pair.b.dq, joint.r_b) + shift;
    let shifted = L::select(dot3(carried, shift), distance, axis.start.gt(zero));
    let mut motion = AxisMotion {
        along: select3(Vec3::default(), now, is_linear),
        about_a: select3(carried, cross3(arm_a, now), is_linear),
        about_b: select3(carried, cross3(arm_b, now), is_linear),
        moved: L::select(dot3(carried, relative_turn(pair)), shifted, is_linear),
    };
    let is_angle = zero.gt(axis.coordinate);
    if L::any(is_angle) {
        let (about, moved) = frames.angle_motion(axis);
        motion.about_a = select3(motion.about_a, about, is_angle);
        motion.about_b = select3(motion.about_b, about, is_angle);
        motion.moved = L::select(motion.moved, moved, is_angle);
    }
    motion
}

/// Speed of a against b.
#[inline(always)]
pub fn axis_speed<L: Lane>(rules: Rules, pair: &Pair<L>, motion: &AxisMotion<L>) -> L {
    let u = dot3(motion.along, pair.a.v - pair.b.v) + (dot3(motion.about_a, pair.a.w) - dot3(motion.about_b, pair.b.w));
    if rules.from_start {
        let (a, b) = (&pair.start_a, &pair.start_b);
        return u + (dot3(motion.along, a.v - b.v) + (dot3(motion.about_a, a.w) - dot3(motion.about_b, b.w)));
    }
    u
}

/// Applies an impulse along the axis to a, and its opposite to b.
#[inline(always)]
fn apply_axis_impulse<L: Lane>(pair: &mut Pair<L>, motion: &AxisMotion<L>, p: L) {
    pair.a.v += motion.along * (p * pair.mass_a.inv_mass);
    pair.a.w += pair.mass_a.inv_inertia.times(motion.about_a) * p;
    pair.b.v -= motion.along * (p * pair.mass_b.inv_mass);
    pair.b.w -= pair.mass_b.inv_inertia.times(motion.about_b) * p;
    keep_locks(pair);
}

/// The speed that a unit impulse along the axis gives. Bodies with locked axes move by `MIN_MOVED` of those without
/// at least.
#[inline(always)]
pub fn axis_inverse_mass<L: Lane>(pair: &Pair<L>, motion: &AxisMotion<L>) -> L {
    let turn_a = dot3(motion.about_a, pair.mass_a.inv_inertia.times(motion.about_a));
    let turn_b = dot3(motion.about_b, pair.mass_b.inv_inertia.times(motion.about_b));
    let along = motion.along;
    let free = dot3(along, along) * (pair.mass_a.inv_mass + pair.mass_b.inv_mass) + (turn_a + turn_b);
    if !L::any(has_locks(pair)) {
        return free;
    }
    let m = inverse_masses(pair);
    let moved = dot3(along, vec3(along.x * m.x, along.y * m.y, along.z * m.z));
    let least = free * L::constant(MIN_MOVED);
    L::select(free, larger(moved + (turn_a + turn_b), least), has_locks(pair))
}

/// Applies the carried impulse of an axis. Kernel `warm_start_joints`.
#[inline(always)]
pub fn warm_start_axis<L: Lane>(pair: &mut Pair<L>, frames: &Frames<L>, axis: &Axis<L>, impulse: L) {
    let motion = axis_motion(pair, frames, axis);
    apply_axis_impulse(pair, &motion, impulse);
}

/// Rows that are no limits are more than this above their upper limit (m, rad). It is half of `NO_LIMIT`.
const MIN_LEFT: f64 = -5e17;

/// Whether a row is a lock: neither a limit nor a drive.
#[inline(always)]
pub fn is_lock<L: Lane>(axis: &Axis<L>) -> L::Mask {
    let of_drive = axis.mass_scale + axis.impulse_scale;
    L::and(L::constant(MIN_LEFT).gt(axis.left), L::constant(0.5).gt(of_drive))
}

/// Position relative to the nearer of the two limits of an axis.
#[derive(Clone, Copy)]
pub(super) struct NearerLimit<L: Lane> {
    /// Whether the row is a limit, and whether the upper limit is nearer.
    pub is_limit: L::Mask,
    pub is_upper: L::Mask,
    /// Distance to the limit, negative beyond it. For a lock, its position.
    pub gap: L,
    /// Whether the limit is not reached.
    pub apart: L::Mask,
}

impl<L: Lane> NearerLimit<L> {
    #[inline(always)]
    pub fn of(axis: &Axis<L>, motion: &AxisMotion<L>) -> Self {
        let is_limit = axis.left.gt(L::constant(MIN_LEFT));
        let (place, left) = (axis.gap + motion.moved, axis.left - motion.moved);
        let is_upper = L::and(is_limit, place.gt(left));
        let gap = L::select(place, left, is_upper);
        Self { is_limit, is_upper, gap, apart: L::and(is_limit, gap.gt(L::constant(0.0))) }
    }
}

/// Sweeps one axis. With `but_locks` it leaves out locks. Kernels `solve_joints` and `solve_axes`.
#[inline(always)]
pub fn solve_axis<L: Lane>(
    rules: Rules,
    but_locks: bool,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    frames: &Frames<L>,
    axis: &Axis<L>,
    impulse: &mut L,
) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let motion = axis_motion(pair, frames, axis);
    let mass = reciprocal(axis_inverse_mass(pair, &motion));

    // The nearer of the two limits acts. It pushes the body inward.
    let NearerLimit { is_limit, is_upper, gap, apart } = NearerLimit::of(axis, &motion);
    let sign = L::select(one, L::constant(-1.0), is_upper);

    // A motor acts in every sweep, and a spring in biased sweeps. Locks and limits close gaps softly, or not at all in
    // a relax sweep.
    let is_drive = (axis.mass_scale + axis.impulse_scale).gt(zero);
    let (mut rate, mut mass_scale, mut impulse_scale);
    if rules.biased {
        rate = L::select(params.joint.bias_rate * params.joint.mass_scale, axis.rate, is_drive);
        mass_scale = L::select(params.joint.mass_scale, axis.mass_scale, is_drive);
        impulse_scale = L::select(params.joint.impulse_scale, axis.impulse_scale, is_drive);
    } else {
        rate = zero;
        mass_scale = L::select(one, zero, axis.impulse_scale.gt(zero));
        impulse_scale = zero;
    }
    // A body away from its limit may reach it within this substep.
    rate = L::select(rate, params.inverse_substep, apart);
    mass_scale = L::select(mass_scale, one, apart);
    impulse_scale = L::select(impulse_scale, zero, apart);

    let before = *impulse * sign;
    let wanted = (axis_speed(rules, pair, &motion) - axis.speed) * sign;
    // The impulse of a spring by its gap does not depend on the mass that it moves at present.
    let is_spring = axis.impulse_scale.gt(zero);
    let push = if rules.biased { axis.rate } else { zero };
    let of_gap = L::select(wanted * mass_scale + gap * rate, wanted * mass_scale, is_spring);
    let correction = L::select(mass * of_gap, mass * of_gap + gap * push, is_spring) + before * impulse_scale;
    let least = L::select(-axis.max_impulse, zero, is_limit);
    let mut sum = smaller(larger(before - params.relaxation * correction, least), axis.max_impulse);
    if but_locks {
        sum = L::select(sum, before, is_lock(axis));
    }
    let change = (sum - before) * sign;
    *impulse = sum * sign;
    note_correction(rules, params, pair, change, mass);
    apply_axis_impulse(pair, &motion, change);
}
