// apply_joint_changes: one thread applies the corrections of one joint of one color, and of its axes, to its bodies.
// Reads joints, axes, joint_changes, masses. Writes movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/joint_system.rs.

fn apply_joint_change(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    apply_axis_changes(&pair, joint);
    let anchors = current_anchors(&pair, joint);
    apply_impulse(false, &pair, anchors.r_a, anchors.r_b, joint_changes[i].linear);
    store_pair(joint.body_a, joint.body_b, &pair);
}
