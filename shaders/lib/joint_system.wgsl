// All joints of a connected set of bodies, solved at once: S = L D L^T in blocks of 3 x 3. Doubles: src/kernels/joint_system.rs.

// Rounding of the products that a pivot is made of changes its determinant, at a trace of 1 to 2, by 3e-7 a joint; this is 2^-17.
const PIVOT_STIFFENING: f32 = 7.62939453125e-6;

// Where the lists of the systems begin in their buffer, in numbers. Layout: src/backend/gpu/rows.rs.
fn begin_of_system(system: u32) -> u32 { return joint_systems[joint_systems[0] + system]; }
fn softness_of_system(system: u32) -> f32 { return bitcast<f32>(joint_systems[joint_systems[1] + system]); }
fn joint_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node]; }
fn first_block_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node + 1u]; }
fn end_block_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node + 2u]; }
fn node_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block]; }
fn shared_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 1u]; }
fn first_term_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 2u]; }
fn end_term_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 3u]; }
fn left_of_term(term: u32) -> u32 { return joint_systems[joint_systems[4] + 2u * term]; }
fn right_of_term(term: u32) -> u32 { return joint_systems[joint_systems[4] + 2u * term + 1u]; }

fn block_times(m: mat3x3f, u: vec3f) -> vec3f { return m[0] * u.x + m[1] * u.y + m[2] * u.z; }

fn transposed_block_times(m: mat3x3f, u: vec3f) -> vec3f { return vec3f(dot3(m[0], u), dot3(m[1], u), dot3(m[2], u)); }

fn block_product(left: mat3x3f, right: mat3x3f) -> mat3x3f {
    return mat3x3f(block_times(left, right[0]), block_times(left, right[1]), block_times(left, right[2]));
}

// A block less the product of one block with the transpose of another.
fn less_product(block: mat3x3f, left: mat3x3f, right: mat3x3f) -> mat3x3f {
    return mat3x3f(
        block[0] - block_times(left, vec3f(right[0].x, right[1].x, right[2].x)),
        block[1] - block_times(left, vec3f(right[0].y, right[1].y, right[2].y)),
        block[2] - block_times(left, vec3f(right[0].z, right[1].z, right[2].z)),
    );
}

fn block_sum(a: mat3x3f, b: mat3x3f) -> mat3x3f { return mat3x3f(a[0] + b[0], a[1] + b[1], a[2] + b[2]); }

// A block with more on its diagonal.
fn with_diagonal(m: mat3x3f, more: f32) -> mat3x3f {
    return mat3x3f(
        vec3f(m[0].x + more, m[0].y, m[0].z),
        vec3f(m[1].x, m[1].y + more, m[1].z),
        vec3f(m[2].x, m[2].y, m[2].z + more),
    );
}

// The inverse of a pivot. A pivot that rounding may have made indefinite is made stiffer by a little.
fn inverse_pivot(pivot: mat3x3f) -> mat3x3f {
    let c = cofactors(pivot[0], pivot[1], pivot[2], PIVOT_STIFFENING);
    let inverse = reciprocal(c.determinant) * c.scale;
    return mat3x3f(c.x * inverse, c.y * inverse, c.z * inverse);
}

// The turn that a unit impulse at the arm r gives a body, axis by axis: I^-1 (r x e).
fn turn_of_impulse(m: Mass, r: vec3f) -> mat3x3f {
    let x = m.inv_inertia_x;
    let y = vec3f(m.inv_inertia_x.y, m.inv_inertia_yz.x, m.inv_inertia_yz.y);
    let z = vec3f(m.inv_inertia_x.z, m.inv_inertia_yz.y, m.inv_inertia_yz.z);
    return mat3x3f(y * r.z - z * r.y, z * r.x - x * r.z, x * r.y - y * r.x);
}

// The movement of the point at the arm r of a body that unit impulses move by `inv_mass` and turn by `turn`.
fn movement_at(inv_mass: f32, turn: mat3x3f, r: vec3f) -> mat3x3f {
    return with_diagonal(mat3x3f(cross3(turn[0], r), cross3(turn[1], r), cross3(turn[2], r)), inv_mass);
}

fn negated(m: mat3x3f) -> mat3x3f { return mat3x3f(-m[0], -m[1], -m[2]); }

// The block of S in the column of one joint and the row of another.
fn coupling(column: u32, row: u32, shared_sides: u32) -> mat3x3f {
    var block = mat3x3f(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    if (shared_sides & 1u) != 0u {
        block = block_sum(block, movement_at(joint_nodes[column].mass_a, joint_nodes[column].turn_a, joint_nodes[row].r_a));
    }
    if (shared_sides & 2u) != 0u {
        block = block_sum(block, negated(movement_at(joint_nodes[column].mass_a, joint_nodes[column].turn_a, joint_nodes[row].r_b)));
    }
    if (shared_sides & 4u) != 0u {
        block = block_sum(block, negated(movement_at(joint_nodes[column].mass_b, joint_nodes[column].turn_b, joint_nodes[row].r_a)));
    }
    if (shared_sides & 8u) != 0u {
        block = block_sum(block, movement_at(joint_nodes[column].mass_b, joint_nodes[column].turn_b, joint_nodes[row].r_b));
    }
    return block;
}
