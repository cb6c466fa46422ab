// apply_restitution: one thread makes the points of one manifold bounce that approached faster than the threshold:
// first together, then each alone.
// Reads contacts, points, masses. Writes impulses and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/contact.rs.

fn bounce(rules: Rules, pair: ptr<function, Pair>, contact: Contact, point: Point, impulse: Impulse) -> Wanted {
    let bounces = -params.restitution_threshold > point.approach_velocity && impulse.peak > 0.0;
    let vn = dot3(relative_velocity(rules, pair, point.r_a, point.r_b), contact.normal);
    let lacking = -(vn + contact.restitution * point.approach_velocity);
    let sum = larger(impulse.normal + point.normal_mass * lacking, 0.0);
    return Wanted(select(impulse.normal, sum, bounces), lacking);
}

fn restitute_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    var together = Together();
    for (var k = 0u; k < contact.point_count; k++) {
        let point = points[contact.first_point + k];
        let impulse = impulses[contact.first_point + k];
        add_point(&together, k, point, impulse.normal, bounce(rules, &pair, contact, point, impulse));
    }
    press_as_one(rules, &pair, contact, &together);
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        let point = points[k];
        var impulse = impulses[k];
        let sum = bounce(rules, &pair, contact, point, impulse).sum;
        let change = sum - impulse.normal;
        impulse.normal = sum;
        impulse.peak = larger(impulse.peak, impulse.normal);
        impulses[k] = impulse;
        apply_impulse(rules.isotropic, &pair, point.r_a, point.r_b, contact.normal * change);
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}
