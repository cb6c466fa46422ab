// warm_start_joints: one thread applies the impulse that one joint carries from the step before.
// Reads joints, axes, joint_impulses, masses. Writes bodies that can move.
// No other thread of this dispatch writes those bodies: colors guarantee it (src/graph.rs).
// Double: src/kernels/joint.rs.

fn warm_start_joint(i: u32) {
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    warm_start_axes(&pair, joint);
    let anchors = current_anchors(&pair, joint);
    apply_impulse(false, &pair, anchors.r_a, anchors.r_b, joint_impulses[i].linear);
    store_pair(joint.body_a, joint.body_b, &pair);
}
