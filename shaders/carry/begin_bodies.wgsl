// begin_bodies: one thread lets one body begin a step: it has not moved yet.
// Writes bodies; no other thread writes the same one. Its double is BodyRow::AT_REST.

@compute @workgroup_size(WORKGROUP)
fn begin_bodies(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < carry.body_count; i += groups.x * WORKGROUP) {
        bodies[i].dp = vec3f();
        bodies[i].dq = vec4f(0.0, 0.0, 0.0, 1.0);
    }
}
