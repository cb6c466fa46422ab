// solve_joint_systems: one thread solves one system of joints.
// Reads joint_systems, joints. Writes joint_blocks, joint_nodes, joint_changes, joint_impulses; no other thread writes
// those of the same system.
// Twin: solve_system in src/kernels/joint_system.rs.

// The velocity that row i of a node lacks, less the velocity by which its softness yields; 0 for a missing row.
fn right_of_row(first_axis: u32, rows: u32, i: u32, softness: f32) -> f32 {
    let axis = axis_of_row(rows, i);
    if axis == 0u { return 0.0; }
    let k = first_axis + axis - 1u;
    return joint_changes[k].linear.x - joint_impulses[k].linear.x * softness;
}

// Stores the correction of row i of a node, and adds it to the impulse. A limit that was let go loses its impulse.
fn change_row(first_axis: u32, rows: u32, i: u32, held: bool, change: f32) {
    let axis = axis_of_row(rows, i);
    if axis == 0u { return; }
    let k = first_axis + axis - 1u;
    let own = select(change, joint_changes[k].linear.x, is_limit_row(rows, i) && !held);
    joint_changes[k].linear.x = own;
    joint_impulses[k].linear.x += own;
}

fn right_of_node(node: u32) -> vec3f {
    let joint = joint_of_node(node);
    let rows = rows_of_node(node);
    let softness = joint_nodes[node].softness * YIELDING;
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
    let held = diagonal_of(joint_blocks[first_block_of_node(node)].lower);
    change_row(first, rows, 0u, held.x > 0.0, change.x);
    change_row(first, rows, 1u, held.y > 0.0, change.y);
    change_row(first, rows, 2u, held.z > 0.0, change.z);
}

// Leaves row i of a node as sweeps left it if it is a limit that does not hold.
fn leave_out_row(first_axis: u32, rows: u32, i: u32, held: bool) {
    if !is_limit_row(rows, i) || held { return; }
    joint_changes[first_axis + axis_of_row(rows, i) - 1u].linear.x = 0.0;
}

fn leave_out_free(node: u32) {
    let rows = rows_of_node(node);
    if rows == ANCHORS { return; }
    let first = params.joint_count + joints[joint_of_node(node)].first_axis;
    let held = diagonal_of(joint_blocks[first_block_of_node(node)].lower);
    leave_out_row(first, rows, 0u, held.x > 0.0);
    leave_out_row(first, rows, 1u, held.y > 0.0);
    leave_out_row(first, rows, 2u, held.z > 0.0);
}

// Adds a velocity to the one that row i of a node lacks, unless it is the row that is taken back.
fn add_lacking(first_axis: u32, rows: u32, i: u32, more: f32, own: bool) {
    let axis = axis_of_row(rows, i);
    if axis == 0u || own { return; }
    joint_changes[first_axis + axis - 1u].linear.x += more;
}

fn add_lacking_of_node(node: u32, more: vec3f, is_own: bool, i: u32) {
    let joint = joint_of_node(node);
    let rows = rows_of_node(node);
    if rows == ANCHORS {
        joint_changes[joint].linear += more;
        return;
    }
    let first = params.joint_count + joints[joint].first_axis;
    add_lacking(first, rows, 0u, more.x, is_own && i == 0u);
    add_lacking(first, rows, 1u, more.y, is_own && i == 1u);
    add_lacking(first, rows, 2u, more.z, is_own && i == 2u);
}

// Number i of a vector.
fn number_of(u: vec3f, i: u32) -> f32 { return select(select(u.x, u.y, i == 1u), u.z, i == 2u); }

// Column i of a block.
fn column_of(m: mat3x3f, i: u32) -> vec3f { return select(select(m[0], m[1], i == 1u), m[2], i == 2u); }

// Takes the impulse `before` of row i of a node back: adds the velocities that other rows lose by that to those that
// they lack.
fn take_back(system: u32, node: u32, i: u32, before: f32) {
    let end = begin_of_system(system + 1u);
    for (var column = begin_of_system(system); column < end; column++) {
        let pivot = first_block_of_node(column);
        let end_block = end_block_of_node(column);
        for (var at = pivot; at < end_block; at++) {
            let row = node_of_block(at);
            if column != node && row != node { continue; }
            let block = coupling(column, row, select(shared_of_block(at), OWN_SIDES, at == pivot));
            if column == node {
                add_lacking_of_node(row, column_of(block, i) * before, row == node, i);
            } else {
                let coupled = vec3f(number_of(block[0], i), number_of(block[1], i), number_of(block[2], i));
                add_lacking_of_node(column, coupled * before, false, i);
            }
        }
    }
}

fn without_number(u: vec3f, i: u32) -> vec3f {
    return vec3f(select(u.x, 0.0, i == 0u), select(u.y, 0.0, i == 1u), select(u.z, 0.0, i == 2u));
}

fn without_row(m: mat3x3f, i: u32) -> mat3x3f {
    return mat3x3f(without_number(m[0], i), without_number(m[1], i), without_number(m[2], i));
}

fn without_column(m: mat3x3f, i: u32) -> mat3x3f {
    let zero = vec3f(0.0);
    return mat3x3f(select(m[0], zero, i == 0u), select(m[1], zero, i == 1u), select(m[2], zero, i == 2u));
}

// Removes row i of a node if it is a limit that holds but has no impulse, or would pull; then it loses its impulse.
// Returns whether it did.
fn let_go_of_row(system: u32, node: u32, first_axis: u32, rows: u32, i: u32, held: bool, change: f32) -> bool {
    if !is_limit_row(rows, i) || !held { return false; }
    let at = first_axis + axis_of_row(rows, i) - 1u;
    let before = joint_impulses[at].linear.x;
    if before * (before + change) > 0.0 { return false; }
    if larger(before, -before) > 0.0 { take_back(system, node, i, before); }
    joint_changes[at].linear.x = -before;
    let along = joint_nodes[node].along;
    let about_a = joint_nodes[node].about_a;
    let about_b = joint_nodes[node].about_b;
    let turn_a = joint_nodes[node].turn_a;
    let turn_b = joint_nodes[node].turn_b;
    joint_nodes[node].along = without_row(along, i);
    joint_nodes[node].about_a = without_row(about_a, i);
    joint_nodes[node].about_b = without_row(about_b, i);
    joint_nodes[node].turn_a = without_column(turn_a, i);
    joint_nodes[node].turn_b = without_column(turn_b, i);
    return true;
}

// Removes from a system the limits that hold but have no impulse, or would pull after the changes found. Returns
// whether there were any. In a new system, all limits hold.
fn let_go(system: u32, is_new: bool) -> bool {
    var any = false;
    let end = begin_of_system(system + 1u);
    for (var node = begin_of_system(system); node < end; node++) {
        let rows = rows_of_node(node);
        if rows == ANCHORS { continue; }
        let first = params.joint_count + joints[joint_of_node(node)].first_axis;
        let held = diagonal_of(joint_blocks[first_block_of_node(node)].lower);
        let change = joint_nodes[node].right;
        any = let_go_of_row(system, node, first, rows, 0u, is_new || held.x > 0.0, change.x) || any;
        any = let_go_of_row(system, node, first, rows, 1u, is_new || held.y > 0.0, change.y) || any;
        any = let_go_of_row(system, node, first, rows, 2u, is_new || held.z > 0.0, change.z) || any;
    }
    return any;
}

// Finds the changes of the impulses of a system, and stores them as the right-hand sides of its nodes.
fn find_changes(system: u32) {
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
        joint_nodes[node].right = backward(factors, change);
    }
}

fn solve_system(rules: Rules, system: u32) {
    if is_converged(rules.measured) { return; }
    let first = begin_of_system(system);
    let end = begin_of_system(system + 1u);
    // Sweeps may have let go of limits since the system was factored.
    let is_new = 0.0 > joint_nodes[first].softness;
    for (var node = first; node < end; node++) {
        joint_nodes[node].right = vec3f(0.0);
        if !is_new { leave_out_free(node); }
    }
    var changed = let_go(system, is_new) || is_new;
    loop {
        if changed { factor_blocks(system); }
        find_changes(system);
        changed = let_go(system, false);
        if !changed { break; }
    }
    for (var node = first; node < end; node++) { change_node(node, joint_nodes[node].right); }
}
