// What happens at one contact point. Doubles: src/kernels/contact.rs.

override BIASED: bool = true;
override FRICTION: bool = true;
override ROUND: bool = true;

// Two bodies while one thread works on them.
struct Pair { a: Body, b: Body, mass_a: Mass, mass_b: Mass }

fn inv_inertia_times(m: Mass, u: vec3f) -> vec3f {
    let p = m.inv_inertia_x;
    let q = m.inv_inertia_yz;
    return vec3f(
        p.x * u.x + p.y * u.y + p.z * u.z,
        p.y * u.x + q.x * u.y + q.y * u.z,
        p.z * u.x + q.y * u.y + q.z * u.z,
    );
}

// Applies the impulse p to b at r_b, and -p to a at r_a.
fn apply_impulse(pair: ptr<function, Pair>, point: Point, p: vec3f) {
    (*pair).a.v -= p * (*pair).mass_a.inv_mass;
    (*pair).a.w -= inv_inertia_times((*pair).mass_a, cross3(point.r_a, p));
    (*pair).b.v += p * (*pair).mass_b.inv_mass;
    (*pair).b.w += inv_inertia_times((*pair).mass_b, cross3(point.r_b, p));
}

// Velocity of b relative to a at the point.
fn relative_velocity(pair: ptr<function, Pair>, point: Point) -> vec3f {
    return ((*pair).b.v + cross3((*pair).b.w, point.r_b)) - ((*pair).a.v + cross3((*pair).a.w, point.r_a));
}

// Separation now: what it was when the step began, and what the bodies moved since.
fn current_separation(pair: ptr<function, Pair>, point: Point, normal: vec3f) -> f32 {
    var arm_a = point.r_a;
    var arm_b = point.r_b;
    // A round surface turns under its contact: what is carried along is the centre of its curvature.
    if ROUND {
        arm_a -= normal * point.radius_a;
        arm_b += normal * point.radius_b;
    }
    let moved_b = (*pair).b.dp + turned((*pair).b.dq, arm_b);
    let moved_a = (*pair).a.dp + turned((*pair).a.dq, arm_a);
    return point.separation + dot3(moved_b - moved_a, normal);
}

fn pair_softness(pair: ptr<function, Pair>) -> Softness {
    if (*pair).mass_a.inv_mass > 0.0 && (*pair).mass_b.inv_mass > 0.0 { return params.movable; }
    return params.fixed;
}

// Non-penetration: the sum of the impulses pushes, never pulls.
fn solve_normal(pair: ptr<function, Pair>, contact: Contact, point: Point, softness: Softness, impulse: ptr<function, Impulse>) {
    let s = current_separation(pair, point, contact.normal);
    // Apart: may close the gap in this substep. Overlapping: pushed out softly, or not at all in a relax sweep.
    let apart = s > 0.0;
    let pushed = larger(softness.bias_rate * s, -softness.push_limit);
    let bias = select(select(0.0, pushed, BIASED), s * params.inverse_substep, apart);
    let mass_scale = select(select(1.0, softness.mass_scale, BIASED), 1.0, apart);
    let impulse_scale = select(select(0.0, softness.impulse_scale, BIASED), 0.0, apart);
    let vn = dot3(relative_velocity(pair, point), contact.normal);
    let correction = -(point.normal_mass * mass_scale * (vn + bias)) - impulse_scale * (*impulse).normal;
    let sum = larger((*impulse).normal + correction, 0.0);
    let change = sum - (*impulse).normal;
    (*impulse).normal = sum;
    (*impulse).peak = larger((*impulse).peak, sum);
    apply_impulse(pair, point, contact.normal * change);
}

// Coulomb friction: the sum of the tangential impulses stays in the disc of radius mu times the normal impulse.
fn solve_friction(pair: ptr<function, Pair>, contact: Contact, tangent_2: vec3f, point: Point, impulse: ptr<function, Impulse>) {
    let u = relative_velocity(pair, point);
    let y_1 = (*impulse).tangent_1 - point.tangent_mass * dot3(u, contact.tangent);
    let y_2 = (*impulse).tangent_2 - point.tangent_mass * dot3(u, tangent_2);
    let radius = contact.friction * (*impulse).normal;
    let length_squared = y_1 * y_1 + y_2 * y_2;
    let scale = select(1.0, radius * inverse_sqrt(length_squared), length_squared > radius * radius);
    let sum_1 = y_1 * scale;
    let sum_2 = y_2 * scale;
    let change = contact.tangent * (sum_1 - (*impulse).tangent_1) + tangent_2 * (sum_2 - (*impulse).tangent_2);
    (*impulse).tangent_1 = sum_1;
    (*impulse).tangent_2 = sum_2;
    apply_impulse(pair, point, change);
}

fn load_pair(contact: Contact) -> Pair {
    return Pair(bodies[contact.body_a], bodies[contact.body_b], masses[contact.body_a], masses[contact.body_b]);
}

// A body that cannot move is never written: no color protects it.
fn store_pair(contact: Contact, pair: ptr<function, Pair>) {
    if (*pair).mass_a.inv_mass > 0.0 {
        bodies[contact.body_a].v = (*pair).a.v;
        bodies[contact.body_a].w = (*pair).a.w;
    }
    if (*pair).mass_b.inv_mass > 0.0 {
        bodies[contact.body_b].v = (*pair).b.v;
        bodies[contact.body_b].w = (*pair).b.w;
    }
}
