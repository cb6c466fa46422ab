// integrate_velocities: one thread adds gravity and force to the velocity of one body.
// Reads masses. Writes bodies; no other thread writes the same one. Double: src/kernels/integrate.rs.

@compute @workgroup_size(WORKGROUP)
fn integrate_velocities(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < params.body_count; i += groups.x * WORKGROUP) {
        bodies[i].v += masses[i].acceleration * params.substep;
    }
}
