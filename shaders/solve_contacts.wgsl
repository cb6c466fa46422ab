// solve_contacts: one thread sweeps one manifold of one color.
// Reads contacts, points, masses. Writes impulses and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/contact.rs.

fn sweep_normals(rules: Rules, pair: ptr<function, Pair>, contact: Contact) {
    let softness = pair_softness(pair);
    let movement = normal_movement(rules, pair, contact);
    if rules.as_one { solve_as_one(rules, pair, contact, softness, movement); }
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        var impulse = impulses[k];
        solve_normal(rules, pair, contact, points[k], softness, movement, &impulse);
        impulses[k] = impulse;
    }
}

fn sweep_friction(rules: Rules, pair: ptr<function, Pair>, contact: Contact) {
    let end = contact.first_point + contact.point_count;
    if rules.at_patch {
        var pressed = 0.0;
        var lever = 0.0;
        for (var k = contact.first_point; k < end; k++) {
            pressed += impulses[k].normal;
            lever += impulses[k].normal * points[k].slip_1;
        }
        var impulse = impulses[end];
        solve_twist(rules, pair, contact, points[end], lever, &impulse);
        solve_friction(rules, pair, contact, points[end], pressed, &impulse);
        impulses[end] = impulse;
    } else {
        for (var k = contact.first_point; k < end; k++) {
            var impulse = impulses[k];
            solve_friction(rules, pair, contact, points[k], impulse.normal, &impulse);
            impulses[k] = impulse;
        }
    }
}

fn solve_contact(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    for (var k = 0u; k < rules.passes; k++) {
        if rules.friction != FRICTION_NONE && rules.friction_first { sweep_friction(rules, &pair, contact); }
        sweep_normals(rules, &pair, contact);
        if rules.friction != FRICTION_NONE && !rules.friction_first { sweep_friction(rules, &pair, contact); }
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}
