// measure_joints: one thread computes the velocities that the anchors and axes of one joint lack.
// Reads joints, axes, bodies, masses. Writes joint_changes; no other thread writes the same ones. Twin:
// src/kernels/joint_system.rs.

fn measure_joint(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    measure_axes(rules, &pair, joint);
    let anchors = current_anchors(&pair, joint);
    var wanted = relative_velocity(rules, &pair, anchors.r_a, anchors.r_b);
    if rules.biased {
        wanted += anchors.gap * pass_row.joint.bias_rate;
    }
    wanted = of_anchors(joint, wanted);
    note_correction(rules.measured, wanted.x, 1.0);
    note_correction(rules.measured, wanted.y, 1.0);
    note_correction(rules.measured, wanted.z, 1.0);
    joint_changes[i].linear = wanted * -params.relaxation;
}
