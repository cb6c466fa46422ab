// solve_contacts: one thread sweeps one manifold of one color.
// Reads contacts, points, masses. Writes impulses, and bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

fn solve_contact(i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count;
    var pair = load_pair(contact);
    let softness = pair_softness(&pair);

    // All normals first, then friction within the cone they span.
    for (var k = contact.first_point; k < end; k++) {
        var impulse = impulses[k];
        solve_normal(&pair, contact, points[k], softness, &impulse);
        impulses[k] = impulse;
    }
    if FRICTION {
        let tangent_2 = cross3(contact.normal, contact.tangent);
        for (var k = contact.first_point; k < end; k++) {
            var impulse = impulses[k];
            solve_friction(&pair, contact, tangent_2, points[k], &impulse);
            impulses[k] = impulse;
        }
    }
    store_pair(contact, &pair);
}

@compute @workgroup_size(WORKGROUP)
fn solve_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var color = pass_colors.first; color < pass_colors.end; color++) {
        for (var i = colors[color] + id.x; i < colors[color + 1u]; i += groups.x * WORKGROUP) {
            solve_contact(i);
        }
        storageBarrier();
    }
}
