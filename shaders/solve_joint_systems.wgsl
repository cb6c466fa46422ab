// solve_joint_systems: one thread solves one system of joints.
// Reads joint_systems, joint_blocks, joints. Writes joint_nodes, joint_changes, joint_impulses; no other thread writes those of the same
// system. Double: solve_system in src/kernels/joint_system.rs.

// The velocity that row i of a node lacks, less what its softness gives way by; 0 where there is no row.
fn right_of_row(first_axis: u32, rows: u32, i: u32, softness: f32) -> f32 {
    let axis = axis_of_row(rows, i);
    if axis == 0u { return 0.0; }
    let k = first_axis + axis - 1u;
    return joint_changes[k].linear.x - joint_impulses[k].linear.x * softness;
}

// The change of the impulse of a limit, which does not pull: it lets go before.
fn limited_change(before: f32, change: f32) -> f32 { return select(-before, change, before * (before + change) > 0.0); }

// Keeps the correction of row i of a node.
fn change_row(first_axis: u32, rows: u32, i: u32, change: f32) {
    let axis = axis_of_row(rows, i);
    if axis == 0u { return; }
    let k = first_axis + axis - 1u;
    var own = change;
    if is_limit_row(rows, i) { own = limited_change(joint_impulses[k].linear.x, change); }
    joint_changes[k].linear.x = own;
    joint_impulses[k].linear.x += own;
}

fn right_of_node(node: u32) -> vec3f {
    let joint = joint_of_node(node);
    let rows = rows_of_node(node);
    let softness = joint_nodes[node].softness;
    if rows == ANCHORS { return joint_changes[joint].linear - joint_impulses[joint].linear * softness; }
    // Impulses of axes follow those of joints.
    let first = params.joint_count + joints[joint].first_axis;
    return vec3f(
        right_of_row(first, rows, 0u, softness),
        right_of_row(first, rows, 1u, softness),
        right_of_row(first, rows, 2u, softness),
    );
}

fn change_node(node: u32, change: vec3f) {
    let joint = joint_of_node(node);
    let rows = rows_of_node(node);
    if rows == ANCHORS {
        joint_changes[joint].linear = change;
        joint_impulses[joint].linear += change;
        return;
    }
    let first = params.joint_count + joints[joint].first_axis;
    change_row(first, rows, 0u, change.x);
    change_row(first, rows, 1u, change.y);
    change_row(first, rows, 2u, change.z);
}

fn solve_system(rules: Rules, system: u32) {
    if is_converged(rules.measured) { return; }
    let first = begin_of_system(system);
    let end = begin_of_system(system + 1u);
    for (var node = first; node < end; node++) { joint_nodes[node].right = right_of_node(node); }
    for (var node = first; node < end; node++) {
        let pivot = first_block_of_node(node);
        let end_block = end_block_of_node(node);
        let right = forward(joint_blocks[pivot].lower, joint_nodes[node].right);
        joint_nodes[node].right = right;
        for (var at = pivot + 1u; at < end_block; at++) {
            joint_nodes[node_of_block(at)].right -= block_times(joint_blocks[at].lower, right);
        }
    }
    for (var left = end - first; left > 0u; left--) {
        let node = first + left - 1u;
        let pivot = first_block_of_node(node);
        let end_block = end_block_of_node(node);
        let factors = joint_blocks[pivot].lower;
        var change = joint_nodes[node].right * diagonal_of(factors);
        for (var at = pivot + 1u; at < end_block; at++) {
            change -= transposed_block_times(joint_blocks[at].lower, joint_nodes[node_of_block(at)].right);
        }
        change = backward(factors, change);
        joint_nodes[node].right = change;
        change_node(node, change);
    }
}
