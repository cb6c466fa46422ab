// Two bodies that one thread works on. Twins: src/kernels/pair.rs.

struct Pair { a: Body, b: Body, mass_a: Mass, mass_b: Mass, start_a: Free, start_b: Free }

// The change of a body's spin by an impulse with the moment u: its inverse inertia times u.
fn spin_of(isotropic: bool, m: Mass, u: vec3f) -> vec3f {
    if isotropic { return u * m.inv_inertia_x.x; }
    return inv_inertia_times(m, u);
}

// Applies the impulse p to b at r_b, and -p to a at r_a.
fn apply_impulse(isotropic: bool, pair: ptr<function, Pair>, r_a: vec3f, r_b: vec3f, p: vec3f) {
    (*pair).a.v -= p * (*pair).mass_a.inv_mass;
    (*pair).a.w -= spin_of(isotropic, (*pair).mass_a, cross3(r_a, p));
    (*pair).b.v += p * (*pair).mass_b.inv_mass;
    (*pair).b.w += spin_of(isotropic, (*pair).mass_b, cross3(r_b, p));
    if !isotropic { keep_locks(pair); }
}

// Whether a body of the pair has locked axes.
fn has_locks(pair: ptr<function, Pair>) -> bool { return (*pair).mass_a.locks + (*pair).mass_b.locks > 0.0; }

// The sum of the inverse masses of the two bodies along each axis of the world.
fn inverse_masses(pair: ptr<function, Pair>) -> vec3f {
    let a = (*pair).mass_a;
    let b = (*pair).mass_b;
    if !has_locks(pair) { return vec3f(a.inv_mass + b.inv_mass); }
    return unlocked(a.locks, vec3f(a.inv_mass)) + unlocked(b.locks, vec3f(b.inv_mass));
}

// The sum of the inverse masses of the two bodies along a direction of length 1.
fn inverse_mass_along(isotropic: bool, pair: ptr<function, Pair>, n: vec3f) -> f32 {
    if isotropic || !has_locks(pair) { return (*pair).mass_a.inv_mass + (*pair).mass_b.inv_mass; }
    return dot3(n, n * inverse_masses(pair));
}

// Removes velocities along locked axes, which an impulse gave.
fn keep_locks(pair: ptr<function, Pair>) {
    if has_locks(pair) {
        (*pair).a.v = unlocked((*pair).mass_a.locks, (*pair).a.v);
        (*pair).b.v = unlocked((*pair).mass_b.locks, (*pair).b.v);
    }
}

// Applies the angular impulse u to b, and -u to a.
fn apply_angular_impulse(isotropic: bool, pair: ptr<function, Pair>, u: vec3f) {
    (*pair).a.w -= spin_of(isotropic, (*pair).mass_a, u);
    (*pair).b.w += spin_of(isotropic, (*pair).mass_b, u);
}

// Angular velocity of b relative to a.
fn relative_spin(rules: Rules, pair: ptr<function, Pair>) -> vec3f {
    let w = (*pair).b.w - (*pair).a.w;
    if rules.from_start { return w + ((*pair).start_b.w - (*pair).start_a.w); }
    return w;
}

// Velocity of b at r_b relative to a at r_a.
fn relative_velocity(rules: Rules, pair: ptr<function, Pair>, r_a: vec3f, r_b: vec3f) -> vec3f {
    let u = ((*pair).b.v + cross3((*pair).b.w, r_b)) - ((*pair).a.v + cross3((*pair).a.w, r_a));
    if rules.from_start {
        let a = (*pair).start_a;
        let b = (*pair).start_b;
        return u + ((b.v - a.v) + (cross3(b.w, r_b) - cross3(a.w, r_a)));
    }
    return u;
}

// Movement of b at r_b relative to a at r_a since the step began.
fn relative_movement(pair: ptr<function, Pair>, r_a: vec3f, r_b: vec3f) -> vec3f {
    let moved_b = (*pair).b.dp + turned((*pair).b.dq, r_b);
    let moved_a = (*pair).a.dp + turned((*pair).a.dq, r_a);
    return moved_b - moved_a;
}

fn load_pair(a: u32, b: u32) -> Pair {
    return Pair(bodies[a], bodies[b], masses[a], masses[b], load_start(masses[a], a), load_start(masses[b], b));
}

// An immovable body is never written, because no color protects it. One with locked axes does not move along them.
fn store_pair(a: u32, b: u32, pair: ptr<function, Pair>) {
    if (*pair).mass_a.inv_mass > 0.0 {
        bodies[a].v = unlocked((*pair).mass_a.locks, (*pair).a.v);
        bodies[a].w = (*pair).a.w;
    }
    if (*pair).mass_b.inv_mass > 0.0 {
        bodies[b].v = unlocked((*pair).mass_b.locks, (*pair).b.v);
        bodies[b].w = (*pair).b.w;
    }
}
