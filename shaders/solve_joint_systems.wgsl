// solve_joint_systems: one thread solves one system of joints.
// Reads joint_systems, joint_blocks. Writes joint_nodes, joint_changes, joint_impulses; no other thread writes those of the same system.
// Double: solve_system in src/kernels/joint_system.rs.

fn solve_system(rules: Rules, system: u32) {
    if is_converged(rules.measured) { return; }
    let first = begin_of_system(system);
    let end = begin_of_system(system + 1u);
    for (var node = first; node < end; node++) {
        let joint = joint_of_node(node);
        joint_nodes[node].right = joint_changes[joint].linear - joint_impulses[joint].linear * joint_nodes[node].softness;
    }
    for (var node = first; node < end; node++) {
        let right = joint_nodes[node].right;
        let end_block = end_block_of_node(node);
        for (var at = first_block_of_node(node) + 1u; at < end_block; at++) {
            joint_nodes[node_of_block(at)].right -= block_times(joint_blocks[at].lower, right);
        }
    }
    for (var left = end - first; left > 0u; left--) {
        let node = first + left - 1u;
        let pivot = first_block_of_node(node);
        let end_block = end_block_of_node(node);
        var change = block_times(joint_blocks[pivot].lower, joint_nodes[node].right);
        for (var at = pivot + 1u; at < end_block; at++) {
            change -= transposed_block_times(joint_blocks[at].lower, joint_nodes[node_of_block(at)].right);
        }
        joint_nodes[node].right = change;
        let joint = joint_of_node(node);
        joint_changes[joint].linear = change;
        joint_impulses[joint].linear += change;
    }
}
