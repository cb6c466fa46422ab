// apply_restitution: one thread makes the points of one manifold bounce that meet in this substep: first together, then
// each alone by its remaining approach. The impulses act when the surfaces meet, so the bodies move before that time with
// the velocities before them.
// Reads contacts, points, masses. Writes impulses, free and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/contact.rs.

// The impact of a point: its normal velocity before any impact, the speed at which the surfaces meet (0 if the point does
// not bounce), the time from the start of the substep, and the speed of a point that bounced in the substep before, and
// comes again instead of bouncing.
struct Impact { approach: f32, speed: f32, time: f32, again: f32 }

fn impact_at(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, impulse: Impulse, movement: NormalMovement) -> Impact {
    let h = pass_row.substep;
    let s = current_separation(movement, contact, point);
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let elapsed = select((*pair).b.time, (*pair).a.time, (*pair).mass_a.inv_mass > 0.0);
    let start = smaller(vn - point.pull * h, 0.0);
    let gap = s - point.pull * (0.5 * h * elapsed);
    let square = start * start - (point.pull + point.pull) * gap;
    let root = select(0.0, square * inverse_sqrt(square), square > 0.0);
    // Exact without acceleration.
    let speed = -start - (point.pull + point.pull) * gap * reciprocal(root - start);
    let time = larger((gap + gap) * reciprocal(speed - start), -h);
    if -s > vn * h && will_bounce(contact, vn, impulse) && square > 0.0 {
        if impulse.bounce > 0.0 { return Impact(vn, 0.0, time, speed); }
        return Impact(vn, speed, time, 0.0);
    }
    return Impact(vn, 0.0, 0.0, 0.0);
}

// Moves a body back by the time in which it still had its former velocities.
fn delayed(body: Body, before: Body, delay: f32) -> Body {
    let dp = body.dp - (body.v - before.v) * delay;
    let dq = renormalized(quat_mul(exp_rotation((before.w - body.w) * delay), body.dq));
    return Body(body.v, body.w, dp, body.time, dq);
}

// The velocities of a movable body without the impulses of this substep, with which it strikes others. Those of a warm
// start belong to the substep before.
fn begin_bounces(is_from_start: bool, i: u32, mass: Mass, body: Body) -> Body {
    if is_from_start || !(mass.inv_mass > 0.0) { return body; }
    return Body(free[i].v, free[i].w, body.dp, body.time, body.dq);
}

// Stores the movement and the bounces of a body that can move, in its velocities with and without impulses.
fn end_bounces(is_from_start: bool, i: u32, mass: Mass, body: Body) {
    if !(mass.inv_mass > 0.0) { return; }
    bodies[i].dp = body.dp;
    bodies[i].dq = body.dq;
    if is_from_start {
        bodies[i].v = unlocked(mass.locks, body.v);
        bodies[i].w = body.w;
        return;
    }
    let v = body.v - free[i].v;
    let w = body.w - free[i].w;
    free[i].v = body.v;
    free[i].w = body.w;
    if dot3(v, v) + dot3(w, w) > 0.0 {
        bodies[i].v = unlocked(mass.locks, bodies[i].v + v);
        bodies[i].w = bodies[i].w + w;
    }
}

fn restitute_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    let factor = 1.0 + contact.restitution;
    var pair = load_pair(contact.body_a, contact.body_b);
    pair.a = begin_bounces(rules.from_start, contact.body_a, pair.mass_a, pair.a);
    pair.b = begin_bounces(rules.from_start, contact.body_b, pair.mass_b, pair.b);
    let movement = normal_movement(rules, &pair, contact);
    let before_a = pair.a;
    let before_b = pair.b;
    var impacts: array<Impact, 4>;
    var together = Together();
    for (var k = 0u; k < contact.point_count; k++) {
        let point = points[contact.first_point + k];
        impacts[k] = impact_at(rules, &pair, contact, point, impulses[contact.first_point + k], movement);
        let lacking = factor * impacts[k].speed;
        add_point(&together, k, point, Wanted(point.normal_mass * lacking, lacking));
    }
    let share = press_as_one(rules, &pair, contact, &together);
    var all = 0.0;
    var delay = 0.0;
    for (var k = 0u; k < contact.point_count; k++) {
        let point = points[contact.first_point + k];
        let impact = impacts[k];
        let vn = dot3(relative_velocity(rules, &pair, point.r_a, point.r_b), contact.normal);
        let left = select(0.0, larger(impact.speed + (impact.approach - vn), 0.0), impact.speed > 0.0);
        let own = point.normal_mass * (factor * left);
        apply_impulse(rules.isotropic, &pair, point.r_a, point.r_b, contact.normal * own);
        let bounce = share * together.changes[k] + own;
        impulses[contact.first_point + k].bounce = bounce - impact.again;
        all = all + bounce;
        delay = delay + bounce * impact.time;
    }
    if all > 0.0 {
        delay = delay * reciprocal(all);
        pair.a = delayed(pair.a, before_a, delay);
        pair.b = delayed(pair.b, before_b, delay);
    }
    end_bounces(rules.from_start, contact.body_a, pair.mass_a, pair.a);
    end_bounces(rules.from_start, contact.body_b, pair.mass_b, pair.b);
}
