// turn_inertias: one thread turns the inverse inertia of one body of a system of joints with the body.
// Reads turning, bodies. Writes masses; no other thread writes the same one. Twin: src/kernels/joint_system.rs.

fn turn_inertia(i: u32) {
    let row = turning[i];
    let q = bodies[row.body].dq;
    var x = row.inv_inertia_x;
    var y = vec3f(row.inv_inertia_x.y, row.inv_inertia_yz.x, row.inv_inertia_yz.y);
    var z = vec3f(row.inv_inertia_x.z, row.inv_inertia_yz.y, row.inv_inertia_yz.z);
    // R A, then R (R A)^T.
    x = x + turned(q, x);
    y = y + turned(q, y);
    z = z + turned(q, z);
    var p = vec3f(x.x, y.x, z.x);
    var r = vec3f(x.y, y.y, z.y);
    var s = vec3f(x.z, y.z, z.z);
    p = p + turned(q, p);
    r = r + turned(q, r);
    s = s + turned(q, s);
    masses[row.body].inv_inertia_x = p;
    masses[row.body].inv_inertia_yz = vec3f(r.y, r.z, s.z);
}
