// sum_joint_impulses: one thread adds the impulses of one joint in a substep to the sums of earlier substeps. The first
// substep begins the sums.
// Reads joints, joint_impulses. Writes joint_totals; one thread for each joint. Twin: src/kernels/contact.rs.

fn sum_row(is_first: bool, k: u32) {
    let now = joint_impulses[k].linear;
    let sum = joint_totals[k].linear + now;
    if is_first { joint_totals[k].linear = now; } else { joint_totals[k].linear = sum; }
}

fn sum_joint(is_first: bool, i: u32) {
    let joint = joints[i];
    sum_row(is_first, i);
    for (var k = joint.first_axis; k < joint.first_axis + joint.axis_count; k++) { sum_row(is_first, params.joint_count + k); }
}
