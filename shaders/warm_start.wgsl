// warm_start: one thread applies the impulses that one manifold already carries.
// Reads contacts, points, impulses, masses. Writes bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn warm_start_contact(i: u32) {
    let contact = contacts[i];
    let tangent_2 = cross3(contact.normal, contact.tangent);
    var pair = load_pair(contact);
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        let impulse = impulses[k];
        var p = contact.normal * impulse.normal;
        if FRICTION {
            p += contact.tangent * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
        }
        apply_impulse(&pair, points[k], p);
    }
    store_pair(contact, &pair);
}

@compute @workgroup_size(WORKGROUP)
fn warm_start(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var color = pass_colors.first; color < pass_colors.end; color++) {
        for (var i = colors[color] + id.x; i < colors[color + 1u]; i += groups.x * WORKGROUP) {
            warm_start_contact(i);
        }
        storageBarrier();
    }
}
