// solve_axes: one thread sweeps the limits and drives of one joint of one color, whose locks are solved directly.
// Reads joints, axes, masses. Writes joint_impulses and movable bodies.
// No other thread of this dispatch writes those bodies, because of the colors (src/graph.rs).
// Twin: solve_axis in src/kernels/axis.rs.

fn solve_swept_axes(rules: Rules, i: u32) {
    if is_converged(rules.measured) { return; }
    let joint = joints[i];
    var pair = load_pair(joint.body_a, joint.body_b);
    solve_axes(rules, true, &pair, joint);
    store_pair(joint.body_a, joint.body_b, &pair);
}
