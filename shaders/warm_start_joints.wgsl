// warm_start_joints: one thread applies the carried impulses of one joint.
// Reads joints, axes, joint_impulses, masses. Writes movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: src/kernels/joint.rs.

fn warm_start_joint(i: u32) {
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    warm_start_axes(&pair, joint);
    let anchors = current_anchors(&pair, joint);
    apply_impulse(false, &pair, anchors.r_a, anchors.r_b, joint_impulses[i].linear);
    store_pair(joint.body_a, joint.body_b, &pair);
}
