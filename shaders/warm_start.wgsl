// warm_start: one thread applies the impulses that one manifold carries from the step before.
// Reads contacts, points, impulses, masses. Writes bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn warm_start_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count;
    var pair = load_pair(contact.body_a, contact.body_b);
    var framed = framed_pair(rules, &pair, contact);
    for (var k = contact.first_point; k < end; k++) {
        let point = framed_point(framed.frame, points[k]);
        let impulse = impulses[k];
        press(rules.isotropic, &framed, point.r_a, point.r_b, impulse.normal);
        if rules.friction != FRICTION_NONE && !rules.at_patch {
            rub(rules.isotropic, &framed, point.r_a, point.r_b, impulse.tangent_1, impulse.tangent_2);
        }
    }
    if rules.friction != FRICTION_NONE && rules.at_patch {
        let patch_point = framed_point(framed.frame, points[end]);
        let impulse = impulses[end];
        twist(rules.isotropic, &framed, impulse.normal);
        rub(rules.isotropic, &framed, patch_point.r_a, patch_point.r_b, impulse.tangent_1, impulse.tangent_2);
    }
    change_pair(rules, &framed, &pair);
    store_pair(contact.body_a, contact.body_b, &pair);
}
