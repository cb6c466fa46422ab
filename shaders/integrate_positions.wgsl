// integrate_positions: one thread moves one body by its velocity.
// Writes bodies; no other thread writes the same one. Double: src/kernels/integrate.rs.

@compute @workgroup_size(WORKGROUP)
fn integrate_positions(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < params.body_count; i += groups.x * WORKGROUP) {
        let body = bodies[i];
        bodies[i].dp = body.dp + body.v * params.substep;
        bodies[i].dq = renormalized(quat_mul(exp_rotation(body.w * params.substep), body.dq));
    }
}
