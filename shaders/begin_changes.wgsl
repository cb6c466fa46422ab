// begin_changes: one thread turns the velocities of one body into changes since the step began, which are zero at
// first. A body that nothing pushes keeps its velocities. Bodies at rest are in no block, and no pass writes their rows
// of `free`.
// Reads masses. Writes bodies and free; no other thread writes the same ones. Twin: src/kernels/integrate.rs.

fn begin_change(i: u32) {
    let is_movable = masses[i].inv_mass > 0.0;
    let v = select(vec3f(0.0), bodies[i].v, is_movable);
    let w = select(vec3f(0.0), bodies[i].w, is_movable);
    free[i] = Free(v, w);
    bodies[i].v = bodies[i].v - v;
    bodies[i].w = bodies[i].w - w;
}
