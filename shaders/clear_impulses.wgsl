// clear_impulses: one thread forgets the impulses of one manifold, where every correction is clamped by itself.
// Reads contacts. Writes impulses; one thread a manifold. Double: src/kernels/contact.rs.

fn clear_contact(i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count + params.patches;
    for (var k = contact.first_point; k < end; k++) { impulses[k] = Impulse(0.0, 0.0, 0.0, impulses[k].peak); }
}

@compute @workgroup_size(WORKGROUP)
fn clear_impulses(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var at = colors[pass_colors.first] + id.x; at < colors[pass_colors.end]; at += groups.x * WORKGROUP) {
        clear_contact(colors[at]);
    }
}
