// The axes of a joint, along which or about which body a is held, limited or driven. Twins: src/kernels/axis.rs.

struct AxisMotion { along: vec3f, about_a: vec3f, about_b: vec3f, moved: f32 }

// The rotation vector of a against b since the step began.
fn relative_turn(pair: ptr<function, Pair>) -> vec3f {
    let q = quat_mul((*pair).a.dq, conjugate((*pair).b.dq));
    let half = q.xyz * select(1.0, -1.0, 0.0 > q.w);
    return half * (2.0 + dot3(half, half) * (1.0 / 3.0));
}

struct AngleMotion { about: vec3f, moved: f32 }

// The axis of an angle between the frames on both bodies, and the change of the angle since the step began.
fn angle_motion(pair: ptr<function, Pair>, joint: Joint, axis: Axis) -> AngleMotion {
    let on_b = quat_mul((*pair).b.dq, joint.frame_b);
    let now = quat_mul(conjugate(on_b), quat_mul((*pair).a.dq, joint.frame_a));
    var angles = angles_of(now);
    var value = angles.values[0];
    var direction = angles.directions[0];
    var last = -1.5;
    for (var i = 1u; i < 8u; i++) {
        let is_beyond = last > axis.coordinate;
        value = select(value, angles.values[i], is_beyond);
        direction = select(direction, angles.directions[i], is_beyond);
        last -= 1.0;
    }
    if -8.5 > axis.coordinate {
        let is_third = -9.5 > axis.coordinate;
        let height = select(angles.values[6], angles.values[7], is_third);
        let unit = select(vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0), is_third);
        let angle = elevation(height, select(angles.directions[6], angles.directions[7], is_third), unit);
        value = angle.value;
        direction = angle.direction;
    }
    // A twist continues beyond pi.
    let is_twist = axis.coordinate > -1.5;
    let moved = value - axis.start;
    let back = select(0.0, 6.2831855, is_twist && -3.1415927 > moved);
    let forth = select(0.0, 6.2831855, is_twist && moved > 3.1415927);
    return AngleMotion(direction + turned(on_b, direction), moved + back - forth);
}

// Distances below the root of this have no direction (m^2).
const MIN_SQUARE: f32 = 1e-12;

struct AnchorMotion { now: vec3f, longer: f32 }

// The direction between the anchors, and the growth of their distance since the step began, after a shift of the anchor
// of a. Without a length the direction is the carried one.
fn along_anchors(carried: vec3f, shift: vec3f, length: f32) -> AnchorMotion {
    let apart = carried * length + shift;
    let square = dot3(apart, apart);
    let has_direction = length > 0.0 && square > MIN_SQUARE;
    let now = select(carried, apart * inverse_sqrt(square), has_direction);
    // This form avoids the cancellation of a difference of two lengths, unless the anchors passed each other.
    let cosine = dot3(carried, now);
    let longer = dot3(carried + now, shift) * reciprocal(1.0 + cosine);
    return AnchorMotion(now, select(square * inverse_sqrt(square) - length, longer, cosine > 0.0));
}

// The present axis. It turned with b since the step began. The axis of a distance follows the anchors, and that of an
// angle both bodies.
fn axis_motion(pair: ptr<function, Pair>, joint: Joint, axis: Axis) -> AxisMotion {
    let carried = axis.direction + turned((*pair).b.dq, axis.direction);
    if 0.0 > axis.coordinate {
        let angle = angle_motion(pair, joint, axis);
        return AxisMotion(vec3f(), angle.about, angle.about, angle.moved);
    }
    let shift = -relative_movement(pair, joint.r_a, joint.r_b);
    let anchors = along_anchors(carried, shift, axis.start);
    let now = anchors.now;
    let arm_a = joint.r_a + turned((*pair).a.dq, joint.r_a);
    let arm_b = joint.r_b + turned((*pair).b.dq, joint.r_b) + shift;
    let shifted = select(dot3(carried, shift), anchors.longer, axis.start > 0.0);
    let is_linear = axis.coordinate > 0.0;
    return AxisMotion(
        select(vec3f(), now, is_linear),
        select(carried, cross3(arm_a, now), is_linear),
        select(carried, cross3(arm_b, now), is_linear),
        select(dot3(carried, relative_turn(pair)), shifted, is_linear),
    );
}

// Speed of a against b.
fn axis_speed(rules: Rules, pair: ptr<function, Pair>, motion: AxisMotion) -> f32 {
    let u = dot3(motion.along, (*pair).a.v - (*pair).b.v)
        + (dot3(motion.about_a, (*pair).a.w) - dot3(motion.about_b, (*pair).b.w));
    if rules.from_start {
        let a = (*pair).start_a;
        let b = (*pair).start_b;
        return u + (dot3(motion.along, a.v - b.v) + (dot3(motion.about_a, a.w) - dot3(motion.about_b, b.w)));
    }
    return u;
}

// Applies an impulse along the axis to a, and its opposite to b.
fn apply_axis_impulse(pair: ptr<function, Pair>, motion: AxisMotion, p: f32) {
    (*pair).a.v += motion.along * (p * (*pair).mass_a.inv_mass);
    (*pair).a.w += inv_inertia_times((*pair).mass_a, motion.about_a) * p;
    (*pair).b.v -= motion.along * (p * (*pair).mass_b.inv_mass);
    (*pair).b.w -= inv_inertia_times((*pair).mass_b, motion.about_b) * p;
    keep_locks(pair);
}

// The least movement of bodies with locked axes, relative to that of free ones: 2^-20.
const MIN_MOVED: f32 = 9.5367431640625e-7;

// The speed that a unit impulse along the axis gives. Bodies with locked axes move by MIN_MOVED of those without at
// least.
fn axis_inverse_mass(pair: ptr<function, Pair>, motion: AxisMotion) -> f32 {
    let turn_a = dot3(motion.about_a, inv_inertia_times((*pair).mass_a, motion.about_a));
    let turn_b = dot3(motion.about_b, inv_inertia_times((*pair).mass_b, motion.about_b));
    let along = motion.along;
    let free = dot3(along, along) * ((*pair).mass_a.inv_mass + (*pair).mass_b.inv_mass) + (turn_a + turn_b);
    if !has_locks(pair) { return free; }
    return larger(dot3(along, along * inverse_masses(pair)) + (turn_a + turn_b), free * MIN_MOVED);
}

// Rows that are no limits are more than this above their upper limit (m, rad).
const MIN_LEFT: f32 = -5e17;

// Whether a row is a lock: neither a limit nor a drive.
fn is_lock(axis: Axis) -> bool { return MIN_LEFT > axis.left && 0.5 > axis.mass_scale + axis.impulse_scale; }

// Position relative to the nearer of the two limits of an axis.
struct NearerLimit { is_limit: bool, is_upper: bool, gap: f32, apart: bool }

fn nearer_limit(axis: Axis, motion: AxisMotion) -> NearerLimit {
    let is_limit = axis.left > MIN_LEFT;
    let place = axis.gap + motion.moved;
    let left = axis.left - motion.moved;
    let is_upper = is_limit && place > left;
    let gap = select(place, left, is_upper);
    return NearerLimit(is_limit, is_upper, gap, is_limit && gap > 0.0);
}

// Sweeps one axis. With `but_locks` it leaves out locks.
fn solve_axis(rules: Rules, but_locks: bool, pair: ptr<function, Pair>, joint: Joint, axis: Axis, k: u32) {
    let motion = axis_motion(pair, joint, axis);
    let mass = reciprocal(axis_inverse_mass(pair, motion));

    // The nearer of the two limits acts. It pushes the body inward.
    let limit = nearer_limit(axis, motion);
    let gap = limit.gap;
    let apart = limit.apart;
    let sign = select(1.0, -1.0, limit.is_upper);

    // A motor acts in every sweep, and a spring in biased sweeps. Locks and limits close gaps softly, or not at all in
    // a relax sweep.
    let is_drive = axis.mass_scale + axis.impulse_scale > 0.0;
    var rate = 0.0;
    var mass_scale = select(1.0, 0.0, axis.impulse_scale > 0.0);
    var impulse_scale = 0.0;
    if rules.biased {
        rate = select(pass_row.joint.bias_rate * pass_row.joint.mass_scale, axis.rate, is_drive);
        mass_scale = select(pass_row.joint.mass_scale, axis.mass_scale, is_drive);
        impulse_scale = select(pass_row.joint.impulse_scale, axis.impulse_scale, is_drive);
    }
    // A body away from its limit may reach it within this substep.
    rate = select(rate, pass_row.inverse_substep, apart);
    mass_scale = select(mass_scale, 1.0, apart);
    impulse_scale = select(impulse_scale, 0.0, apart);

    let before = joint_impulses[k].linear.x * sign;
    let wanted = (axis_speed(rules, pair, motion) - axis.speed) * sign;
    // The impulse of a spring by its gap does not depend on the mass that it moves at present.
    let is_spring = axis.impulse_scale > 0.0;
    let push = select(0.0, axis.rate, rules.biased);
    let of_gap = select(wanted * mass_scale + gap * rate, wanted * mass_scale, is_spring);
    let correction = select(mass * of_gap, mass * of_gap + gap * push, is_spring) + before * impulse_scale;
    let least = select(-axis.max_impulse, 0.0, limit.is_limit);
    var sum = smaller(larger(before - params.relaxation * correction, least), axis.max_impulse);
    if but_locks { sum = select(sum, before, is_lock(axis)); }
    let change = (sum - before) * sign;
    joint_impulses[k].linear.x = sum * sign;
    note_correction(rules.measured, change, mass);
    apply_axis_impulse(pair, motion, change);
}

// Impulses of axes follow those of joints.
fn solve_axes(rules: Rules, but_locks: bool, pair: ptr<function, Pair>, joint: Joint) {
    for (var k = joint.first_axis; k < joint.first_axis + joint.axis_count; k++) {
        solve_axis(rules, but_locks, pair, joint, axes[k], params.joint_count + k);
    }
}

// The velocity that a lock lacks, or a limit that holds like a lock; 0 for a drive.
fn measure_axis(rules: Rules, pair: ptr<function, Pair>, joint: Joint, axis: Axis, k: u32) {
    let motion = axis_motion(pair, joint, axis);
    let limit = nearer_limit(axis, motion);
    var rate = 0.0;
    if rules.biased { rate = pass_row.joint.bias_rate; }
    // A body away from its limit may reach it within this substep.
    let pull = limit.gap * select(rate, pass_row.inverse_substep, limit.apart);
    let speed = axis_speed(rules, pair, motion);
    let wanted = select(speed + pull, speed - pull, limit.is_upper);
    let of_lock = select(0.0, wanted, is_lock(axis));
    note_correction(rules.measured, of_lock, 1.0);
    joint_changes[k].linear.x = select(of_lock, wanted, limit.is_limit) * -params.relaxation;
}

fn measure_axes(rules: Rules, pair: ptr<function, Pair>, joint: Joint) {
    for (var k = joint.first_axis; k < joint.first_axis + joint.axis_count; k++) {
        measure_axis(rules, pair, joint, axes[k], params.joint_count + k);
    }
}

fn apply_axis_changes(pair: ptr<function, Pair>, joint: Joint) {
    for (var k = joint.first_axis; k < joint.first_axis + joint.axis_count; k++) {
        apply_axis_impulse(pair, axis_motion(pair, joint, axes[k]), joint_changes[params.joint_count + k].linear.x);
    }
}

fn warm_start_axes(pair: ptr<function, Pair>, joint: Joint) {
    for (var k = joint.first_axis; k < joint.first_axis + joint.axis_count; k++) {
        apply_axis_impulse(pair, axis_motion(pair, joint, axes[k]), joint_impulses[params.joint_count + k].linear.x);
    }
}

// The correction of the anchors of a joint; zero if axes guide them.
fn of_anchors(joint: Joint, change: vec3f) -> vec3f {
    return select(change, vec3f(), joint.is_loose > 0.0);
}
