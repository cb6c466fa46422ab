// Friction at one point or over one manifold. Twins: src/kernels/friction.rs.

// x, at most the limit away from 0.
fn clamp_abs(x: f32, limit: f32) -> f32 { return larger(smaller(x, limit), -limit); }

// The tangential impulse nearest to y that the rule allows. `limit` follows from the normal impulse.
fn allowed_friction(friction: u32, y: vec2f, limit: f32) -> vec2f {
    if friction != FRICTION_DISC { return vec2f(clamp_abs(y.x, limit), clamp_abs(y.y, limit)); }
    let length_squared = y.x * y.x + y.y * y.y;
    let scale = select(1.0, limit * inverse_sqrt(length_squared), length_squared > limit * limit);
    return vec2f(y.x * scale, y.y * scale);
}

// Coulomb friction. It keeps the sum of the tangential impulses within the limit of the normal impulse. Both tangents
// share one step length. With a matrix step the clamped point would slip in a wrong direction.
fn solve_friction(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, normal_impulse: f32, impulse: ptr<function, Impulse>) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let u = relative_velocity(rules, pair, point.r_a, point.r_b);
    var u_1 = dot3(u, contact.tangent);
    var u_2 = dot3(u, tangent_2);
    if rules.driven {
        u_1 += point.slip_1;
        u_2 += point.slip_2;
    }
    let limit = contact.friction * normal_impulse;
    let mass = params.relaxation * point.tangent_mass;
    var sum: vec2f;
    if rules.friction == FRICTION_SLIP {
        // The impulses along both tangents are the components of one impulse along the slip.
        let along = (*impulse).tangent_1 * point.slip_1 + (*impulse).tangent_2 * point.slip_2;
        let s = clamp_abs(along - mass * (u_1 * point.slip_1 + u_2 * point.slip_2), limit);
        sum = vec2f(s * point.slip_1, s * point.slip_2);
    } else {
        sum = allowed_friction(rules.friction, vec2f((*impulse).tangent_1 - mass * u_1, (*impulse).tangent_2 - mass * u_2), limit);
    }
    let change_1 = sum.x - (*impulse).tangent_1;
    let change_2 = sum.y - (*impulse).tangent_2;
    (*impulse).tangent_1 = sum.x;
    (*impulse).tangent_2 = sum.y;
    note_correction(rules.measured, change_1, point.tangent_mass);
    note_correction(rules.measured, change_2, point.tangent_mass);
    apply_impulse(rules.isotropic, pair, point.r_a, point.r_b, contact.tangent * change_1 + tangent_2 * change_2);
}

// Friction against the spin about the normal, limited by the sum of the normal impulses times their distances from the
// middle.
fn solve_twist(rules: Rules, pair: ptr<function, Pair>, contact: Contact, patch_point: Point, lever: f32, impulse: ptr<function, Impulse>) {
    let spin = dot3(relative_spin(rules, pair), contact.normal);
    let mass = params.relaxation * patch_point.normal_mass;
    let sum = clamp_abs((*impulse).normal - mass * spin, contact.friction * lever);
    let change = contact.normal * (sum - (*impulse).normal);
    (*impulse).normal = sum;
    apply_angular_impulse(rules.isotropic, pair, change);
}

// Friction against the relative spin of two bodies, at the patch of a manifold whose normal impulses add up to
// `pressed`. `slip_1` of the patch is the lever of friction against spin about the normal, `slip_2` that against rolling.
fn solve_rolling(rules: Rules, pair: ptr<function, Pair>, contact: Contact, patch_point: Point, pressed: f32, impulse: ptr<function, Impulse>) {
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let w = relative_spin(rules, pair);
    let masses = params.relaxation * vec2f(patch_point.normal_mass, patch_point.tangent_mass);
    let spun = clamp_abs((*impulse).normal - masses.x * dot3(w, contact.normal), patch_point.slip_1 * pressed);
    let rolled = allowed_friction(
        FRICTION_DISC,
        vec2f((*impulse).tangent_1 - masses.y * dot3(w, contact.tangent), (*impulse).tangent_2 - masses.y * dot3(w, tangent_2)),
        patch_point.slip_2 * pressed,
    );
    let turn = contact.normal * (spun - (*impulse).normal)
        + (contact.tangent * (rolled.x - (*impulse).tangent_1) + tangent_2 * (rolled.y - (*impulse).tangent_2));
    (*impulse).normal = spun;
    (*impulse).tangent_1 = rolled.x;
    (*impulse).tangent_2 = rolled.y;
    apply_angular_impulse(rules.isotropic, pair, turn);
}
