// integrate_gyroscopic: one thread turns the spin of one body with unequal moments of inertia, by implicit midpoint.
// Reads inertias. Writes bodies and free; one thread a body.
// Double: src/kernels/integrate.rs.

// Solves rows x = g by Cramer's rule.
fn solve_3x3(row_0: vec3f, row_1: vec3f, row_2: vec3f, g: vec3f) -> vec3f {
    let c_0 = cross3(row_1, row_2);
    let c_1 = cross3(row_2, row_0);
    let c_2 = cross3(row_0, row_1);
    return (c_0 * g.x + c_1 * g.y + c_2 * g.z) * reciprocal(dot3(row_0, c_0));
}

@compute @workgroup_size(WORKGROUP)
fn integrate_gyroscopic(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < params.inertia_count; i += groups.x * WORKGROUP) {
        let inertia = inertias[i];
        let k = inertia.inv_principal;

        // The principal axes now.
        let q = quat_mul(bodies[inertia.body].dq, inertia.frame);
        let x = turned(q, vec3f(1.0, 0.0, 0.0)) + vec3f(1.0, 0.0, 0.0);
        let y = turned(q, vec3f(0.0, 1.0, 0.0)) + vec3f(0.0, 1.0, 0.0);
        let z = turned(q, vec3f(0.0, 0.0, 1.0)) + vec3f(0.0, 0.0, 1.0);

        // The free spin: impulses come after. Two Newton steps on (next - spin) + h I^-1 (m x I m) = 0 with m midway.
        let w = free[inertia.body].w;
        let spin = vec3f(dot3(x, w), dot3(y, w), dot3(z, w));
        var next = spin;
        for (var step = 0u; step < 2u; step++) {
            let m = (spin + next) * 0.5;
            let l = inertia.principal * m;
            let residual = (next - spin) + k * (cross3(m, l) * params.substep);
            let f = k * (params.substep * 0.5);
            let p = inertia.principal;
            let row_0 = vec3f(1.0, f.x * (l.z - m.z * p.y), f.x * (m.y * p.z - l.y));
            let row_1 = vec3f(f.y * (m.z * p.x - l.z), 1.0, f.y * (l.x - m.x * p.z));
            let row_2 = vec3f(f.z * (l.y - m.y * p.x), f.z * (m.x * p.y - l.x), 1.0);
            next -= solve_3x3(row_0, row_1, row_2, residual);
        }
        // Only the change is turned back: rounding of the axes would otherwise stretch a spin that nothing changes.
        let change = next - spin;
        let turn = x * change.x + y * change.y + z * change.z;
        free[inertia.body].w = w + turn;
        bodies[inertia.body].w += turn;
    }
}
