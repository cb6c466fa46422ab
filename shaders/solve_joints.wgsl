// solve_joints: one thread sweeps one joint of one color.
// Reads joints, axes, masses. Writes joint_impulses and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/joint.rs.

fn solve_joint(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    solve_axes(rules, false, &pair, joint);
    let anchors = current_anchors(&pair, joint);
    let m = inverse_masses(&pair);
    let x = joint_column(&pair, anchors, vec3f(1.0, 0.0, 0.0), m.x);
    let y = joint_column(&pair, anchors, vec3f(0.0, 1.0, 0.0), m.y);
    let z = joint_column(&pair, anchors, vec3f(0.0, 0.0, 1.0), m.z);

    // The gap is closed softly, or not at all in a relax sweep.
    let before = joint_impulses[i].linear;
    var wanted = relative_velocity(rules, &pair, anchors.r_a, anchors.r_b);
    var mass_scale = 1.0;
    var impulse_scale = 0.0;
    if rules.biased {
        wanted += anchors.gap * pass_row.joint.bias_rate;
        mass_scale = pass_row.joint.mass_scale;
        impulse_scale = pass_row.joint.impulse_scale;
    }
    let correction = solve_block(x, y, z, wanted) * mass_scale + before * impulse_scale;
    let change = of_anchors(joint, correction * -params.relaxation);
    joint_impulses[i].linear = before + change;
    note_correction(rules.measured, change.x, reciprocal(x.x));
    note_correction(rules.measured, change.y, reciprocal(y.y));
    note_correction(rules.measured, change.z, reciprocal(z.z));
    apply_impulse(false, &pair, anchors.r_a, anchors.r_b, change);
    store_pair(joint.body_a, joint.body_b, &pair);
}
