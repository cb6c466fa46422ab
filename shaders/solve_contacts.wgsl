// solve_contacts: one thread sweeps one manifold of one color.
// Reads contacts, points, masses. Writes impulses and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/contact.rs.

fn solve_contact(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    var held = load_points(rules, contact);
    for (var k = 0u; k < rules.passes; k++) {
        if rules.friction != FRICTION_NONE && rules.friction_first { sweep_friction(rules, &pair, contact, &held); }
        sweep_normals(rules, &pair, contact, &held);
        if rules.friction != FRICTION_NONE && !rules.friction_first { sweep_friction(rules, &pair, contact, &held); }
    }
    store_points(rules, contact, &held);
    store_pair(contact.body_a, contact.body_b, &pair);
}
