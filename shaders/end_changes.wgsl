// end_changes: one thread makes velocities of the changes of one body.
// Reads free. Writes bodies; no other thread writes the same one. Double: src/kernels/integrate.rs.

fn end_change(i: u32) {
    bodies[i].v = free[i].v + bodies[i].v;
    bodies[i].w = free[i].w + bodies[i].w;
}
