// Non-penetration at one contact point. Doubles: src/kernels/contact.rs.

// How two bodies moved along a normal since the step began: a separation is linear in the arms.
struct NormalMovement { shift: f32, turn_a: vec3f, turn_b: vec3f }

fn normal_movement(rules: Rules, pair: ptr<function, Pair>, contact: Contact) -> NormalMovement {
    let turn_a = turned(conjugate((*pair).a.dq), contact.normal);
    let turn_b = turned(conjugate((*pair).b.dq), contact.normal);
    var shift = dot3((*pair).b.dp - (*pair).a.dp, contact.normal);
    // A round surface turns under its contact: the contact moves with the center of curvature.
    if rules.round {
        shift = shift + contact.radius_a * dot3(turn_a, contact.normal) + contact.radius_b * dot3(turn_b, contact.normal);
    }
    return NormalMovement(shift, turn_a, turn_b);
}

// The separation that the solver uses: the separation at the begin of the step, less the preload, plus the movement since.
fn current_separation(movement: NormalMovement, contact: Contact, point: Point) -> f32 {
    return (point.separation - contact.preload) + (movement.shift + (dot3(movement.turn_b, point.r_b) - dot3(movement.turn_a, point.r_a)));
}

fn pair_softness(pair: ptr<function, Pair>) -> Softness {
    if (*pair).mass_a.inv_mass > 0.0 && (*pair).mass_b.inv_mass > 0.0 { return pass_row.movable; }
    return pass_row.fixed;
}

// The impulse pushes, never pulls: the sum of the corrections, or each by itself.
fn clamp_normal(rules: Rules, sum: f32, correction: f32) -> f32 {
    if rules.accumulated { return larger(sum + correction, 0.0); }
    return sum + larger(correction, 0.0);
}

fn solve_normal(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, softness: Softness, movement: NormalMovement, impulse: ptr<function, Impulse>) {
    let s = current_separation(movement, contact, point);
    // Apart: may close the gap in this substep. Overlapping: pushed out softly, or not at all in a relax sweep.
    let apart = s > 0.0;
    let pushed = softness.bias_rate * smaller(s + params.slop, 0.0);
    let bias = select(select(0.0, pushed, rules.biased), s * pass_row.inverse_substep, apart);
    let mass_scale = select(select(1.0, softness.mass_scale, rules.biased), 1.0, apart);
    let impulse_scale = select(select(0.0, softness.impulse_scale, rules.biased), 0.0, apart);
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let mass = point.normal_mass * mass_scale;
    let spring = -(mass * (vn + bias)) - impulse_scale * (*impulse).normal;
    // The limit is one of speed, not of force: at the limit a contact bears whatever load it carries.
    let correction = select(spring, smaller(spring, -(mass * (vn - softness.push_limit))), rules.biased);
    let sum = clamp_normal(rules, (*impulse).normal, params.relaxation * correction);
    let change = sum - (*impulse).normal;
    (*impulse).normal = sum;
    if rules.bounces { (*impulse).peak = larger((*impulse).peak, sum); }
    note_correction(rules.measured, change, point.normal_mass);
    apply_impulse(rules.isotropic, pair, point.r_a, point.r_b, contact.normal * change);
}
