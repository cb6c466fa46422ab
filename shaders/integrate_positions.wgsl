// integrate_positions: one thread moves one body by its velocity.
// Reads free. Writes bodies; no other thread writes the same one. Twin: src/kernels/integrate.rs.

fn integrate_position(is_from_start: bool, i: u32) {
    let body = bodies[i];
    var v = body.v;
    var w = body.w;
    if is_from_start {
        v = free[i].v + v;
        w = free[i].w + w;
    }
    bodies[i].time = body.time + pass_row.substep;
    bodies[i].dp = body.dp + v * pass_row.substep;
    bodies[i].dq = renormalized(quat_mul(exp_rotation(w * pass_row.substep), body.dq));
}
