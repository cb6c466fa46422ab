// Non-penetration at one contact point. Twins: src/kernels/contact.rs.

// Movement of two bodies along a normal since the step began. A separation is linear in the arms.
struct NormalMovement { shift: f32, turn_a: vec3f, turn_b: vec3f }

fn normal_movement(rules: Rules, pair: ptr<function, Pair>, contact: Contact) -> NormalMovement {
    let turn_a = turned(conjugate((*pair).a.dq), contact.normal);
    let turn_b = turned(conjugate((*pair).b.dq), contact.normal);
    var shift = dot3((*pair).b.dp - (*pair).a.dp, contact.normal);
    // A round surface turns beneath its contact, so the contact moves with the center of curvature.
    if rules.round {
        shift = shift + contact.radius_a * dot3(turn_a, contact.normal) + contact.radius_b * dot3(turn_b, contact.normal);
    }
    return NormalMovement(shift, turn_a, turn_b);
}

// The separation that the solver uses: the separation when the step began, less the preload, plus the movement since.
fn current_separation(movement: NormalMovement, contact: Contact, point: Point) -> f32 {
    return (point.separation - contact.preload) + (movement.shift + (dot3(movement.turn_b, point.r_b) - dot3(movement.turn_a, point.r_a)));
}

fn pair_softness(pair: ptr<function, Pair>) -> Softness {
    if (*pair).mass_a.inv_mass > 0.0 && (*pair).mass_b.inv_mass > 0.0 { return pass_row.movable; }
    return pass_row.fixed;
}

// Clamps the normal impulse, which pushes and never pulls. The rules clamp the sum of the corrections, or each
// correction.
fn clamp_normal(rules: Rules, sum: f32, correction: f32) -> f32 {
    if rules.accumulated { return larger(sum + correction, 0.0); }
    return sum + larger(correction, 0.0);
}

// The change of the normal impulse that a point needs by itself.
fn normal_correction(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, softness: Softness, movement: NormalMovement, impulse: Impulse) -> f32 {
    let s = current_separation(movement, contact, point);
    // Surfaces apart may close the gap in this substep. Overlapping surfaces are pushed apart softly, or not at all in
    // a relax sweep.
    let apart = s > 0.0;
    let pushed = softness.bias_rate * smaller(s + params.slop, 0.0);
    let bias = select(select(0.0, pushed, rules.biased), s * pass_row.inverse_substep, apart);
    let mass_scale = select(select(1.0, softness.mass_scale, rules.biased), 1.0, apart);
    let impulse_scale = select(select(0.0, softness.impulse_scale, rules.biased), 0.0, apart);
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let mass = point.normal_mass * mass_scale;
    let spring = -(mass * (vn + bias)) - impulse_scale * impulse.normal;
    // This limits the speed and not the force, so a contact at the limit still carries any load.
    let correction = select(spring, smaller(spring, -(mass * (vn - softness.push_limit))), rules.biased);
    // Sweeps leave a body that was struck to the next impact.
    if rules.bounces && will_bounce(contact, vn, impulse) { return 0.0; }
    return params.relaxation * correction;
}

// Whether a point with this normal velocity bounces when it touches. A point that sweeps press has met its surface. One
// that came again at once after it bounced is pressed from its other side, and sweeps stop it.
fn will_bounce(contact: Contact, vn: f32, impulse: Impulse) -> bool {
    let is_pressed = impulse.normal > 0.0 || impulse.bounce < 0.0;
    return contact.restitution > 0.0 && !is_pressed && -vn > params.restitution_threshold;
}

fn solve_normal(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, softness: Softness, movement: NormalMovement, impulse: ptr<function, Impulse>) {
    let correction = normal_correction(rules, pair, contact, point, softness, movement, *impulse);
    let sum = clamp_normal(rules, (*impulse).normal, correction);
    let change = sum - (*impulse).normal;
    (*impulse).normal = sum;
    note_correction(rules.measured, change, point.normal_mass);
    apply_impulse(rules.isotropic, pair, point.r_a, point.r_b, contact.normal * change);
}

// The change of the impulse that a point needs by itself, and the normal velocity that it lacks.
struct Wanted { change: f32, lacking: f32 }

// The normal impulse of a point in the substep, which limits friction.
fn pressing(rules: Rules, impulse: Impulse) -> f32 {
    if rules.bounces { return impulse.normal + larger(impulse.bounce, 0.0); }
    return impulse.normal;
}

// The points of a manifold together: the change of each, the sums of their arms weighted by changes and unweighted,
// their number, and the sums of changes, gains and masses.
struct Together {
    changes: array<f32, 4>, arms_a: vec3f, arms_b: vec3f, middle_a: vec3f, middle_b: vec3f, count: f32, all: f32, gain: f32, mass: f32
}

fn add_point(together: ptr<function, Together>, k: u32, point: Point, wanted: Wanted) {
    let change = wanted.change;
    (*together).changes[k] = change;
    (*together).arms_a += point.r_a * change;
    (*together).arms_b += point.r_b * change;
    (*together).all = (*together).all + change;
    (*together).gain = (*together).gain + change * wanted.lacking;
    let share = select(0.0, 1.0, point.normal_mass > 0.0);
    (*together).middle_a += point.r_a * share;
    (*together).middle_b += point.r_b * share;
    (*together).count = (*together).count + share;
    (*together).mass = (*together).mass + point.normal_mass;
}

// Applies impulses at all points of a manifold together, by steepest descent: a share of the changes that the points
// need by themselves, which it returns. It minimizes the energy of the velocities that the points still lack.
fn press_as_one(rules: Rules, pair: ptr<function, Pair>, contact: Contact, together: ptr<function, Together>) -> f32 {
    let turn_a = cross3((*together).arms_a, contact.normal);
    let turn_b = cross3((*together).arms_b, contact.normal);
    let spin_a = spin_of(rules.isotropic, (*pair).mass_a, turn_a);
    let spin_b = spin_of(rules.isotropic, (*pair).mass_b, turn_b);
    let turned = dot3(turn_a, spin_a) + dot3(turn_b, spin_b);
    let all = (*together).all;
    let moving = inverse_mass_along(rules.isotropic, pair, contact.normal);
    let moved = (all * all) * moving + turned;
    let inverse = reciprocal(larger((*together).count, 1.0));
    let about_a = cross3((*together).middle_a * inverse, contact.normal);
    let about_b = cross3((*together).middle_b * inverse, contact.normal);
    let turning = dot3(about_a, spin_of(rules.isotropic, (*pair).mass_a, about_a)) + dot3(about_b, spin_of(rules.isotropic, (*pair).mass_b, about_b));
    let alike = reciprocal((*together).mass * (moving + turning));
    let best = smaller((*together).gain * reciprocal(moved), larger(alike, 1.0));
    let share = select(0.0, best, (*together).count > 1.0 && (*together).gain > 0.0);
    let push = contact.normal * (share * all);
    (*pair).a.v -= push * (*pair).mass_a.inv_mass;
    (*pair).a.w -= spin_a * share;
    (*pair).b.v += push * (*pair).mass_b.inv_mass;
    (*pair).b.w += spin_b * share;
    if !rules.isotropic { keep_locks(pair); }
    return share;
}

// Non-penetration of all points together, before each is solved alone.
fn solve_as_one(rules: Rules, pair: ptr<function, Pair>, contact: Contact, softness: Softness, movement: NormalMovement) {
    var together = Together();
    for (var k = 0u; k < contact.point_count; k++) {
        let point = points[contact.first_point + k];
        let impulse = impulses[contact.first_point + k];
        let correction = normal_correction(rules, pair, contact, point, softness, movement, impulse);
        let lacking = select(0.0, correction * reciprocal(point.normal_mass), point.normal_mass > 0.0);
        add_point(&together, k, point, Wanted(clamp_normal(rules, impulse.normal, correction) - impulse.normal, lacking));
    }
    let share = press_as_one(rules, pair, contact, &together);
    for (var k = 0u; k < contact.point_count; k++) {
        let i = contact.first_point + k;
        impulses[i].normal = impulses[i].normal + share * together.changes[k];
    }
}
