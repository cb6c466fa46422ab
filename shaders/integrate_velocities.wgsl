// integrate_velocities: one thread adds gravity and force to the velocity of one body. With `is_warm_start` it also
// adds the change of velocity by the impulses of the substep before, which is the difference between the velocities and
// the free velocities. With `is_from_start` velocities are changes since the step began, and `free` stays.
// Reads masses. Writes bodies and free; no other thread writes the same ones. Twin: src/kernels/integrate.rs.

fn integrate_velocity(is_warm_start: bool, is_from_start: bool, i: u32) {
    let free_v = bodies[i].v + masses[i].acceleration * pass_row.substep;
    let free_w = bodies[i].w;
    if is_warm_start {
        let warm_v = bodies[i].v - free[i].v;
        let warm_w = bodies[i].w - free[i].w;
        bodies[i].v = free_v + warm_v;
        bodies[i].w = free_w + warm_w;
    } else {
        bodies[i].v = free_v;
    }
    if !is_from_start { free[i] = Free(free_v, free_w); }
}
