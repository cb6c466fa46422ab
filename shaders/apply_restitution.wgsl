// apply_restitution: one thread lets the points of one manifold bounce that approached faster than the threshold: together, then each.
// Reads contacts, points, masses. Writes impulses, and bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn bounce(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, impulse: Impulse) -> Wanted {
    let bounces = -params.restitution_threshold > point.approach_velocity && impulse.peak > 0.0;
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    return Wanted(bounces, -(vn + contact.restitution * point.approach_velocity));
}

fn restitute_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    var some = Some();
    for (var k = 0u; k < contact.point_count; k++) {
        let point = points[contact.first_point + k];
        add_point(&some, k, point, bounce(rules, &pair, contact, point, impulses[contact.first_point + k]));
    }
    press_as_one(rules, &pair, contact, &some);
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        let point = points[k];
        var impulse = impulses[k];
        let wanted = bounce(rules, &pair, contact, point, impulse);
        let sum = select(impulse.normal, larger(impulse.normal + point.normal_mass * wanted.speed, 0.0), wanted.takes_part);
        let change = sum - impulse.normal;
        impulse.normal = sum;
        impulse.peak = larger(impulse.peak, sum);
        impulses[k] = impulse;
        apply_impulse(rules.isotropic, &pair, point.r_a, point.r_b, contact.normal * change);
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}
