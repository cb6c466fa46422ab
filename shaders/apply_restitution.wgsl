// apply_restitution: one thread lets the points of one manifold bounce that approached faster than the threshold.
// Reads contacts, points, masses. Writes impulses, and bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn restitute_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        let point = points[k];
        var impulse = impulses[k];
        let bounces = -params.restitution_threshold > point.approach_velocity && impulse.peak > 0.0;
        let vn = dot3(relative_velocity(rules, &pair, point.r_a, point.r_b), contact.normal);
        let correction = -(point.normal_mass * (vn + contact.restitution * point.approach_velocity));
        let sum = select(impulse.normal, larger(impulse.normal + correction, 0.0), bounces);
        let change = sum - impulse.normal;
        impulse.normal = sum;
        impulse.peak = larger(impulse.peak, sum);
        impulses[k] = impulse;
        apply_impulse(rules.isotropic, &pair, point.r_a, point.r_b, contact.normal * change);
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}
