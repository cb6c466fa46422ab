// solve_contacts: one thread sweeps one manifold of one color.
// Reads contacts, points, masses. Writes impulses, and bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn sweep_normals(rules: Rules, framed: ptr<function, FramedPair>, contact: Contact, softness: Softness, movement: NormalMovement) {
    if rules.as_one { solve_as_one(rules, framed, contact, softness, movement); }
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        var impulse = impulses[k];
        solve_normal(rules, framed, contact, framed_point((*framed).frame, points[k]), softness, movement, &impulse);
        impulses[k] = impulse;
    }
}

fn sweep_friction(rules: Rules, framed: ptr<function, FramedPair>, contact: Contact) {
    let end = contact.first_point + contact.point_count;
    if rules.at_patch {
        var pressed = 0.0;
        var lever = 0.0;
        for (var k = contact.first_point; k < end; k++) {
            pressed += impulses[k].normal;
            lever += impulses[k].normal * points[k].slip_1;
        }
        var impulse = impulses[end];
        let patch_point = framed_point((*framed).frame, points[end]);
        solve_twist(rules, framed, contact, patch_point, lever, &impulse);
        solve_friction(rules, framed, contact, patch_point, pressed, &impulse);
        impulses[end] = impulse;
    } else {
        for (var k = contact.first_point; k < end; k++) {
            var impulse = impulses[k];
            solve_friction(rules, framed, contact, framed_point((*framed).frame, points[k]), impulse.normal, &impulse);
            impulses[k] = impulse;
        }
    }
}

fn solve_contact(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    var framed = framed_pair(rules, &pair, contact);
    let softness = pair_softness(&pair);
    let movement = framed_movement(framed.frame, normal_movement(rules, &pair, contact));
    for (var k = 0u; k < rules.passes; k++) {
        if rules.friction != FRICTION_NONE && rules.friction_first { sweep_friction(rules, &framed, contact); }
        sweep_normals(rules, &framed, contact, softness, movement);
        if rules.friction != FRICTION_NONE && !rules.friction_first { sweep_friction(rules, &framed, contact); }
    }
    change_pair(rules, &framed, &pair);
    store_pair(contact.body_a, contact.body_b, &pair);
}
