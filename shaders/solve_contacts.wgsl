// solve_contacts: one thread sweeps one manifold of one color.
// Reads contacts, points, masses. Writes impulses, and bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/contact.rs.

// How often a manifold is swept before the next one.
override PASSES: u32 = 1u;

fn solve_contact(i: u32) {
    let contact = contacts[i];
    var pair = load_pair(contact.body_a, contact.body_b);
    for (var k = 0u; k < PASSES; k++) {
        if FRICTION != FRICTION_NONE && FRICTION_FIRST { sweep_friction(&pair, contact); }
        sweep_normals(&pair, contact);
        if FRICTION != FRICTION_NONE && !FRICTION_FIRST { sweep_friction(&pair, contact); }
    }
    store_pair(contact.body_a, contact.body_b, &pair);
}

@compute @workgroup_size(WORKGROUP)
fn solve_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let converged = is_converged();
    for (var color = pass_colors.first; color < pass_colors.end; color++) {
        for (var at = colors[color] + id.x; at < colors[color + 1u]; at += groups.x * WORKGROUP) {
            if !converged { solve_contact(colors[at]); }
        }
        storageBarrier();
    }
}
