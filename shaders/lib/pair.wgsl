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

// A vector without its components along locked axes.
fn unlocked(m: Mass, v: vec3f) -> vec3f {
    let z = m.locks > 3.5;
    let rest = m.locks - select(0.0, 4.0, z);
    let y = rest > 1.5;
    let x = rest - select(0.0, 2.0, y) > 0.5;
    return vec3f(select(v.x, 0.0, x), select(v.y, 0.0, y), select(v.z, 0.0, z));
}

// An immovable body is never written, because no color protects it. One with locked axes does not move along them.
fn store_pair(a: u32, b: u32, pair: ptr<function, Pair>) {
    if (*pair).mass_a.inv_mass > 0.0 {
        bodies[a].v = unlocked((*pair).mass_a, (*pair).a.v);
        bodies[a].w = (*pair).a.w;
    }
    if (*pair).mass_b.inv_mass > 0.0 {
        bodies[b].v = unlocked((*pair).mass_b, (*pair).b.v);
        bodies[b].w = (*pair).b.w;
    }
}
