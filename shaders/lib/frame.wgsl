// Two bodies in the frame of the contact between them: x along the first tangent, y along the second, z along the normal.
// Doubles: src/kernels/frame.rs.

struct Frame { tangent_1: vec3f, tangent_2: vec3f, normal: vec3f }

fn frame_of(contact: Contact) -> Frame {
    return Frame(contact.tangent, cross3(contact.normal, contact.tangent), contact.normal);
}

// A vector of the world in these axes.
fn components(frame: Frame, v: vec3f) -> vec3f {
    return vec3f(dot3(v, frame.tangent_1), dot3(v, frame.tangent_2), dot3(v, frame.normal));
}

// A point with its arms in these axes.
fn framed_point(frame: Frame, point: Point) -> Point {
    var framed = point;
    framed.r_a = components(frame, point.r_a);
    framed.r_b = components(frame, point.r_b);
    return framed;
}

// The inverse inertia in these axes.
fn framed_mass(isotropic: bool, frame: Frame, mass: Mass) -> Mass {
    if isotropic { return mass; }
    let along_1 = inv_inertia_times(mass, frame.tangent_1);
    let along_2 = inv_inertia_times(mass, frame.tangent_2);
    let along_3 = inv_inertia_times(mass, frame.normal);
    var framed = mass;
    framed.inv_inertia_x = vec3f(dot3(frame.tangent_1, along_1), dot3(frame.tangent_1, along_2), dot3(frame.tangent_1, along_3));
    framed.inv_inertia_yz = vec3f(dot3(frame.tangent_2, along_2), dot3(frame.tangent_2, along_3), dot3(frame.normal, along_3));
    return framed;
}

// Velocities of two bodies: that of the center of b relative to that of a, and both angular velocities.
struct Motion { u: vec3f, w_a: vec3f, w_b: vec3f }

fn motion_of(frame: Frame, v_a: vec3f, w_a: vec3f, v_b: vec3f, w_b: vec3f) -> Motion {
    return Motion(components(frame, v_b - v_a), components(frame, w_a), components(frame, w_b));
}

// Velocity of b at r_b relative to a at r_a.
fn motion_at(motion: Motion, r_a: vec3f, r_b: vec3f) -> vec3f {
    return motion.u + (cross3(motion.w_b, r_b) - cross3(motion.w_a, r_a));
}

// `start` has the velocities when the step began, if the others are changes since. `impulse` is the sum of the impulses on b,
// `inv_mass` that of the inverse masses. The inertia of `mass_a` and `mass_b` is in these axes.
struct FramedPair { frame: Frame, motion: Motion, start: Motion, impulse: vec3f, inv_mass: f32, mass_a: Mass, mass_b: Mass }

// Two bodies in the frame of a contact, before any impulse.
fn framed_pair(rules: Rules, pair: ptr<function, Pair>, contact: Contact) -> FramedPair {
    let frame = frame_of(contact);
    var start = Motion(vec3f(), vec3f(), vec3f());
    if rules.from_start {
        start = motion_of(frame, (*pair).start_a.v, (*pair).start_a.w, (*pair).start_b.v, (*pair).start_b.w);
    }
    let motion = motion_of(frame, (*pair).a.v, (*pair).a.w, (*pair).b.v, (*pair).b.w);
    let inv_mass = (*pair).mass_a.inv_mass + (*pair).mass_b.inv_mass;
    let mass_a = framed_mass(rules.isotropic, frame, (*pair).mass_a);
    let mass_b = framed_mass(rules.isotropic, frame, (*pair).mass_b);
    return FramedPair(frame, motion, start, vec3f(), inv_mass, mass_a, mass_b);
}

fn framed_velocity(rules: Rules, framed: ptr<function, FramedPair>, r_a: vec3f, r_b: vec3f) -> vec3f {
    let u = motion_at((*framed).motion, r_a, r_b);
    if rules.from_start { return u + motion_at((*framed).start, r_a, r_b); }
    return u;
}

// How an impulse along the normal at r turns a body: its inverse inertia times (r.y, -r.x, 0).
fn spin_by_normal(isotropic: bool, m: Mass, r: vec3f, impulse: f32) -> vec3f {
    let x = m.inv_inertia_x;
    let yz = m.inv_inertia_yz;
    if isotropic {
        let turn = x.x * impulse;
        return vec3f(r.y * turn, -(r.x * turn), 0.0);
    }
    return vec3f(x.x * r.y - x.y * r.x, x.y * r.y - yz.x * r.x, x.z * r.y - yz.y * r.x) * impulse;
}

// How impulses along the tangents at r turn a body.
fn spin_by_tangents(isotropic: bool, m: Mass, r: vec3f, along_1: f32, along_2: f32) -> vec3f {
    return spin_of(isotropic, m, vec3f(-(r.z * along_2), r.z * along_1, r.x * along_2 - r.y * along_1));
}

// Applies an impulse along the normal to b at r_b, and its opposite to a at r_a.
fn press(isotropic: bool, framed: ptr<function, FramedPair>, r_a: vec3f, r_b: vec3f, impulse: f32) {
    (*framed).impulse.z = (*framed).impulse.z + impulse;
    (*framed).motion.u.z = (*framed).motion.u.z + impulse * (*framed).inv_mass;
    (*framed).motion.w_a -= spin_by_normal(isotropic, (*framed).mass_a, r_a, impulse);
    (*framed).motion.w_b += spin_by_normal(isotropic, (*framed).mass_b, r_b, impulse);
}

// Applies impulses along the tangents to b at r_b, and their opposites to a at r_a.
fn rub(isotropic: bool, framed: ptr<function, FramedPair>, r_a: vec3f, r_b: vec3f, along_1: f32, along_2: f32) {
    (*framed).impulse.x = (*framed).impulse.x + along_1;
    (*framed).impulse.y = (*framed).impulse.y + along_2;
    (*framed).motion.u.x = (*framed).motion.u.x + along_1 * (*framed).inv_mass;
    (*framed).motion.u.y = (*framed).motion.u.y + along_2 * (*framed).inv_mass;
    (*framed).motion.w_a -= spin_by_tangents(isotropic, (*framed).mass_a, r_a, along_1, along_2);
    (*framed).motion.w_b += spin_by_tangents(isotropic, (*framed).mass_b, r_b, along_1, along_2);
}

// Applies a moment about the normal to b, and its opposite to a.
fn twist(isotropic: bool, framed: ptr<function, FramedPair>, moment: f32) {
    (*framed).motion.w_a -= spin_of(isotropic, (*framed).mass_a, vec3f(0.0, 0.0, moment));
    (*framed).motion.w_b += spin_of(isotropic, (*framed).mass_b, vec3f(0.0, 0.0, moment));
}

// Changes two bodies by what happened in their frame.
fn change_pair(rules: Rules, framed: ptr<function, FramedPair>, pair: ptr<function, Pair>) {
    let frame = (*framed).frame;
    let impulse = (*framed).impulse;
    let has_friction = rules.friction != FRICTION_NONE;
    var p = frame.normal * impulse.z;
    if has_friction { p += frame.tangent_1 * impulse.x + frame.tangent_2 * impulse.y; }
    (*pair).a.v -= p * (*pair).mass_a.inv_mass;
    (*pair).b.v += p * (*pair).mass_b.inv_mass;
    let turn_a = (*framed).motion.w_a - components(frame, (*pair).a.w);
    let turn_b = (*framed).motion.w_b - components(frame, (*pair).b.w);
    (*pair).a.w += frame.tangent_1 * turn_a.x + frame.tangent_2 * turn_a.y;
    (*pair).b.w += frame.tangent_1 * turn_b.x + frame.tangent_2 * turn_b.y;
    // A normal impulse turns no body with equal moments of inertia about the normal.
    if has_friction || !rules.isotropic {
        (*pair).a.w += frame.normal * turn_a.z;
        (*pair).b.w += frame.normal * turn_b.z;
    }
}
