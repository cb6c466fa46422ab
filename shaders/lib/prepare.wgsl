// Effective masses of contact points. Twins: src/problem/arithmetic.rs.

const MIN_JAMMING: f32 = 0.53;

fn inverse_or_zero(x: f32) -> f32 {
    let is_positive = x > 0.0;
    let safe = select(1.0, x, is_positive);
    let y = reciprocal(safe);
    return select(0.0, y + y * (1.0 - safe * y), is_positive);
}

fn square_root(x: f32) -> f32 {
    let is_normal = x > 1e-30;
    let safe = select(1.0, x, is_normal);
    return select(0.0, safe * inverse_sqrt(safe), is_normal);
}

// A unit vector perpendicular to a unit normal.
fn tangent_of(n: vec3f) -> vec3f {
    let sign = select(1.0, -1.0, 0.0 > n.z);
    let a = -(sign * inverse_or_zero(1.0 + sign * n.z));
    return vec3f(n.x * n.y * a, sign + n.y * n.y * a, -n.y);
}

fn entry_of(mass: Mass, r: vec3f, d: vec3f, e: vec3f) -> f32 {
    return mass.inv_mass * dot3(d, e) + dot3(cross3(r, d), inv_inertia_times(mass, cross3(r, e)));
}

// The entry (d, e) of G M^-1 G^T at the arms of a and b.
fn entry(a: Mass, b: Mass, r_a: vec3f, r_b: vec3f, d: vec3f, e: vec3f) -> f32 {
    return entry_of(a, r_a, d, e) + entry_of(b, r_b, d, e);
}

// One over the largest eigenvalue of the tangential block; 0 if the block is zero.
fn tangent_mass(s_11: f32, s_22: f32, s_12: f32) -> f32 {
    // The squares of the entries of a light body would leave single precision.
    let scale = inverse_power(s_11 + s_22);
    let scaled_11 = s_11 * scale;
    let scaled_22 = s_22 * scale;
    let scaled_12 = s_12 * scale;
    let apart = scaled_11 - scaled_22;
    let root = square_root(apart * apart + 4.0 * scaled_12 * scaled_12);
    return scale * inverse_or_zero(0.5 * (scaled_11 + scaled_22 + root));
}

// The ratio of the largest change of the normal velocity by friction to the change by the normal impulse.
fn jamming(friction: f32, parted: f32, pressed_1: f32, pressed_2: f32) -> f32 {
    let scale = inverse_power(parted);
    let scaled_1 = pressed_1 * scale;
    let scaled_2 = pressed_2 * scale;
    let pressed = square_root(scaled_1 * scaled_1 + scaled_2 * scaled_2);
    let ratio = friction * pressed * inverse_or_zero(parted * scale);
    return select(0.0, ratio, friction > MIN_JAMMING);
}

fn normal_step(ratio: f32) -> f32 { return select(1.0, inverse_or_zero(1.0 + ratio), ratio > 1.0); }

// One over the sum of the inverse inertias of both bodies about the normal.
fn twist_mass(frame: Contact, a: Mass, b: Mass) -> f32 {
    let n = frame.normal;
    return inverse_or_zero(dot3(n, inv_inertia_times(a, n)) + dot3(n, inv_inertia_times(b, n)));
}

struct PointMasses { normal: f32, tangent: f32, jamming: f32 }

// The effective masses of a point. `tangents`: friction has two directions.
fn point_masses(tangents: bool, frame: Contact, a: Mass, b: Mass, r_a: vec3f, r_b: vec3f) -> PointMasses {
    let n = frame.normal;
    let t_1 = frame.tangent;
    let t_2 = cross3(n, t_1);
    let parted = entry(a, b, r_a, r_b, n, n);
    var result = PointMasses(inverse_or_zero(parted), 0.0, 0.0);
    if frame.friction > MIN_JAMMING {
        let pressed_1 = entry(a, b, r_a, r_b, n, t_1);
        result.jamming = jamming(frame.friction, parted, pressed_1, entry(a, b, r_a, r_b, n, t_2));
        result.normal = result.normal * normal_step(result.jamming);
    }
    if tangents {
        let s_11 = entry(a, b, r_a, r_b, t_1, t_1);
        let s_22 = entry(a, b, r_a, r_b, t_2, t_2);
        result.tangent = tangent_mass(s_11, s_22, entry(a, b, r_a, r_b, t_1, t_2));
    }
    return result;
}
