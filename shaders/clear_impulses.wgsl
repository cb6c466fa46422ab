// clear_impulses: one thread forgets the impulses of one point, where every correction is clamped by itself.
// Writes impulses; one thread a point. Double: src/kernels/contact.rs.

@compute @workgroup_size(WORKGROUP)
fn clear_impulses(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < params.point_count; i += groups.x * WORKGROUP) {
        impulses[i] = Impulse(0.0, 0.0, 0.0, impulses[i].peak);
    }
}
