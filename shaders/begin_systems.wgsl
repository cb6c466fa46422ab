// begin_systems: one thread begins one system of joints at the present poses of its bodies. The next solution factors
// it.
// Reads joint_systems, joints, axes, bodies, masses. Writes joint_nodes; no other thread writes those of the same
// system.
// Twin: begin_system in src/kernels/joint_system.rs.

// One of the three rows of the anchors of a joint, along an axis of the world.
fn anchor_motion(anchors: Anchors, along: vec3f) -> AxisMotion {
    return AxisMotion(along, cross3(anchors.r_a, along), cross3(anchors.r_b, along), 0.0);
}

// Row i of a node; zero if the row is missing.
fn row_motion(pair: ptr<function, Pair>, joint: Joint, rows: u32, i: u32) -> AxisMotion {
    let axis = axis_of_row(rows, i);
    if axis == 0u { return AxisMotion(vec3f(), vec3f(), vec3f(), 0.0); }
    return axis_motion(pair, joint, axes[joint.first_axis + axis - 1u]);
}

fn begin_node(node: u32) {
    let joint = joints[joint_of_node(node)];
    let rows = rows_of_node(node);
    var pair = load_pair(joint.body_a, joint.body_b);
    let anchors = current_anchors(&pair, joint);
    var x = anchor_motion(anchors, vec3f(-1.0, 0.0, 0.0));
    var y = anchor_motion(anchors, vec3f(0.0, -1.0, 0.0));
    var z = anchor_motion(anchors, vec3f(0.0, 0.0, -1.0));
    if rows != ANCHORS {
        x = row_motion(&pair, joint, rows, 0u);
        y = row_motion(&pair, joint, rows, 1u);
        z = row_motion(&pair, joint, rows, 2u);
    }
    joint_nodes[node].along = block_of_rows(x.along, y.along, z.along);
    joint_nodes[node].about_a = block_of_rows(x.about_a, y.about_a, z.about_a);
    joint_nodes[node].about_b = block_of_rows(x.about_b, y.about_b, z.about_b);
    joint_nodes[node].turn_a = mat3x3f(
        inv_inertia_times(pair.mass_a, x.about_a),
        inv_inertia_times(pair.mass_a, y.about_a),
        inv_inertia_times(pair.mass_a, z.about_a),
    );
    joint_nodes[node].turn_b = mat3x3f(
        inv_inertia_times(pair.mass_b, x.about_b),
        inv_inertia_times(pair.mass_b, y.about_b),
        inv_inertia_times(pair.mass_b, z.about_b),
    );
    joint_nodes[node].mass_a = pair.mass_a.inv_mass;
    joint_nodes[node].mass_b = pair.mass_b.inv_mass;
    joint_nodes[node].locks_a = pair.mass_a.locks;
    joint_nodes[node].locks_b = pair.mass_b.locks;
    joint_nodes[node].softness = NOT_FACTORED;
}

fn begin_system(system: u32) {
    let end = begin_of_system(system + 1u);
    for (var node = begin_of_system(system); node < end; node++) { begin_node(node); }
}
