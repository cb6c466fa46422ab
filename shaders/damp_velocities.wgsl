// damp_velocities: one thread damps the velocities that one body has without the impulses of this substep. With
// `is_from_start` velocities are changes since the step began, and `free` stays.
// Reads dampings. Writes bodies and free; no other thread writes the same ones. Twin: src/kernels/integrate.rs.

fn damp_velocity(is_from_start: bool, i: u32) {
    let damping = dampings[i];
    var v = free[i].v;
    var w = free[i].w;
    if is_from_start {
        v = v + bodies[i].v;
        w = w + bodies[i].w;
    }
    let change_v = damping.linear_gain - v * damping.linear_loss;
    let change_w = damping.angular_gain - w * damping.angular_loss;
    if damping.linear_loss > 0.0 {
        if !is_from_start { free[i].v += change_v; }
        bodies[i].v += change_v;
    }
    if damping.angular_loss > 0.0 {
        if !is_from_start { free[i].w += change_w; }
        bodies[i].w += change_w;
    }
}
