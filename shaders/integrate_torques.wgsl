// integrate_torques: one thread adds the angular acceleration of a torque to the angular velocity of one body. With
// `is_from_start` velocities are changes since the step began, and `free` stays.
// Reads torques. Writes bodies and free; no other thread writes the same ones. Twin: src/kernels/integrate.rs.

fn integrate_torque(is_from_start: bool, i: u32) {
    let turn = torques[i].angular_acceleration * pass_row.substep;
    if !is_from_start { free[i].w += turn; }
    bodies[i].w += turn;
}
