// end_changes: one thread turns the changes of one body back into velocities.
// Reads free. Writes bodies; no other thread writes the same one. Twin: src/kernels/integrate.rs.

fn end_change(i: u32) {
    bodies[i].v = free[i].v + bodies[i].v;
    bodies[i].w = free[i].w + bodies[i].w;
}
