// factor_joints: one thread factors one system of joints.
// Reads joint_systems, joints, bodies, masses. Writes joint_nodes and joint_blocks; no other thread writes those of the same system.
// Double: factor_system in src/kernels/joint_system.rs.

fn factor_system(system: u32) {
    let first = begin_of_system(system);
    let end = begin_of_system(system + 1u);
    for (var node = first; node < end; node++) {
        let joint = joints[joint_of_node(node)];
        var pair = load_pair(joint.body_a, joint.body_b);
        let anchors = current_anchors(&pair, joint);
        joint_nodes[node].r_a = anchors.r_a;
        joint_nodes[node].mass_a = pair.mass_a.inv_mass;
        joint_nodes[node].r_b = anchors.r_b;
        joint_nodes[node].mass_b = pair.mass_b.inv_mass;
        joint_nodes[node].turn_a = turn_of_impulse(pair.mass_a, anchors.r_a);
        joint_nodes[node].turn_b = turn_of_impulse(pair.mass_b, anchors.r_b);
    }
    for (var node = first; node < end; node++) {
        let pivot = first_block_of_node(node);
        let end_block = end_block_of_node(node);
        for (var at = pivot; at < end_block; at++) {
            var block: mat3x3f;
            if at == pivot {
                block = block_sum(
                    movement_at(joint_nodes[node].mass_a, joint_nodes[node].turn_a, joint_nodes[node].r_a),
                    movement_at(joint_nodes[node].mass_b, joint_nodes[node].turn_b, joint_nodes[node].r_b),
                );
                let more = (block[0].x + block[1].y + block[2].z) * softness_of_system(system);
                block = with_diagonal(block, more);
                joint_nodes[node].softness = more;
            } else {
                block = coupling(node, node_of_block(at), shared_of_block(at));
            }
            let end_term = end_term_of_block(at);
            for (var term = first_term_of_block(at); term < end_term; term++) {
                block = less_product(block, joint_blocks[left_of_term(term)].lower, joint_blocks[right_of_term(term)].upper);
            }
            if at == pivot {
                joint_blocks[at].lower = inverse_pivot(block);
            } else {
                joint_blocks[at].lower = block_product(block, joint_blocks[pivot].lower);
                joint_blocks[at].upper = block;
            }
        }
    }
}
