// warm_start: one thread applies the carried impulses of one manifold.
// Reads contacts, points, impulses, masses. Writes movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/contact.rs.

fn warm_start_contact(rules: Rules, i: u32) {
    let contact = contacts[i];
    let tangent_2 = cross3(contact.normal, contact.tangent);
    let end = contact.first_point + contact.point_count;
    var pair = load_pair(contact.body_a, contact.body_b);
    for (var k = contact.first_point; k < end; k++) {
        let impulse = impulses[k];
        var p = contact.normal * impulse.normal;
        if rules.friction != FRICTION_NONE && !is_at_patch(rules) {
            p += contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        }
        apply_impulse(rules.isotropic, &pair, points[k].r_a, points[k].r_b, p);
    }
    if rules.friction != FRICTION_NONE && rules.has_patch {
        let impulse = impulses[end];
        let twist = contact.normal * impulse.normal;
        let p = contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        var turn = twist;
        if rules.rolls { turn = twist + p; }
        apply_angular_impulse(rules.isotropic, &pair, turn);
        if !rules.rolls { apply_impulse(rules.isotropic, &pair, points[end].r_a, points[end].r_b, p); }
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}
