// integrate_positions: one thread moves one body by its velocity.
// Writes bodies; no other thread writes the same one. Double: src/kernels/integrate.rs.

fn integrate_position(i: u32) {
    let body = bodies[i];
    bodies[i].dp = body.dp + body.v * pass_row.substep;
    bodies[i].dq = renormalized(quat_mul(exp_rotation(body.w * pass_row.substep), body.dq));
}
