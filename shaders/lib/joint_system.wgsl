// All joints of a connected set of bodies, solved directly by S = L D L^T in blocks of 3 x 3. Twins:
// src/kernels/joint_system.rs.

// The smallest pivot of a row, relative to the trace of its block in S: 2^-20.
const MIN_PIVOT: f32 = 9.5367431640625e-7;

// The lists of the systems in their common buffer. Its first numbers are the starts of the lists. Layout:
// src/backend/gpu/rows.rs.
fn begin_of_system(system: u32) -> u32 { return joint_systems[joint_systems[0] + system]; }
fn softness_of_system(system: u32) -> f32 { return bitcast<f32>(joint_systems[joint_systems[1] + system]); }
fn joint_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node]; }
fn first_block_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node + 1u]; }
fn end_block_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node + 2u]; }
fn rows_of_node(node: u32) -> u32 { return joint_systems[joint_systems[2] + 4u * node + 3u]; }
fn node_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block]; }
fn shared_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 1u]; }
fn first_term_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 2u]; }
fn end_term_of_block(block: u32) -> u32 { return joint_systems[joint_systems[3] + 4u * block + 3u]; }
fn left_of_term(term: u32) -> u32 { return joint_systems[joint_systems[4] + 2u * term]; }
fn right_of_term(term: u32) -> u32 { return joint_systems[joint_systems[4] + 2u * term + 1u]; }

// The share of its softness by which a row yields to its whole impulse.
const YIELDING: f32 = 0.125;

// Marks, as a softness, a node whose system has not been factored since it began.
const NOT_FACTORED: f32 = -1.0;

// The rows of a node that keeps anchors together.
const ANCHORS: u32 = 0xffffffffu;

// The number of the axis that is row i of a node, among those of the joint, plus 1; 0 for no row.
fn axis_of_row(rows: u32, i: u32) -> u32 { return (rows >> (8u * i)) & 0x7fu; }

// Whether row i of a node is a limit. A limit takes part only while its impulse is not zero.
fn is_limit_row(rows: u32, i: u32) -> bool { return ((rows >> (8u * i)) & 0x80u) != 0u; }

fn block_times(m: mat3x3f, u: vec3f) -> vec3f { return m[0] * u.x + m[1] * u.y + m[2] * u.z; }

fn transposed_block_times(m: mat3x3f, u: vec3f) -> vec3f { return vec3f(dot3(m[0], u), dot3(m[1], u), dot3(m[2], u)); }

fn block_product(left: mat3x3f, right: mat3x3f) -> mat3x3f {
    return mat3x3f(block_times(left, right[0]), block_times(left, right[1]), block_times(left, right[2]));
}

// The product of one block with the transpose of another.
fn product_with_transpose(left: mat3x3f, right: mat3x3f) -> mat3x3f {
    return mat3x3f(
        block_times(left, vec3f(right[0].x, right[1].x, right[2].x)),
        block_times(left, vec3f(right[0].y, right[1].y, right[2].y)),
        block_times(left, vec3f(right[0].z, right[1].z, right[2].z)),
    );
}

fn block_sum(a: mat3x3f, b: mat3x3f) -> mat3x3f { return mat3x3f(a[0] + b[0], a[1] + b[1], a[2] + b[2]); }

fn block_less(a: mat3x3f, b: mat3x3f) -> mat3x3f { return mat3x3f(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

// The block with these rows.
fn block_of_rows(x: vec3f, y: vec3f, z: vec3f) -> mat3x3f {
    return mat3x3f(vec3f(x.x, y.x, z.x), vec3f(x.y, y.y, z.y), vec3f(x.z, y.z, z.z));
}

fn diagonal_of(m: mat3x3f) -> vec3f { return vec3f(m[0].x, m[1].y, m[2].z); }

// A block with more on its diagonal.
fn with_diagonal(m: mat3x3f, more: f32) -> mat3x3f {
    return mat3x3f(
        vec3f(m[0].x + more, m[0].y, m[0].z),
        vec3f(m[1].x, m[1].y + more, m[1].z),
        vec3f(m[2].x, m[2].y, m[2].z + more),
    );
}

// One over a pivot of at least `least`; 0 for a row whose diagonal was zero in S.
fn inverse_of_row(d: f32, least: f32, own: f32) -> f32 { return select(0.0, reciprocal(larger(d, least)), own > 0.0); }

// The factors l d l^T of a pivot, whose diagonal in S was `own`. The result has l below the diagonal, and 1/d on it. In
// a missing row, whose diagonal in S is zero, 1/d is zero.
fn factored_pivot(pivot: mat3x3f, own: vec3f) -> mat3x3f {
    let x = pivot[0];
    let y = pivot[1];
    let z = pivot[2];
    let least = (own.x + own.y + own.z) * MIN_PIVOT;
    let d_x = inverse_of_row(x.x, least, own.x);
    let l_xy = x.y * d_x;
    let l_xz = x.z * d_x;
    let d_y = inverse_of_row(y.y - l_xy * x.y, least, own.y);
    let below = y.z - l_xy * x.z;
    let l_yz = below * d_y;
    let d_z = inverse_of_row(z.z - l_xz * x.z - l_yz * below, least, own.z);
    return mat3x3f(vec3f(d_x, l_xy, l_xz), vec3f(0.0, d_y, l_yz), vec3f(0.0, 0.0, d_z));
}

// The block of L D below a factored pivot, from the block of S less its products.
fn block_over(block: mat3x3f, pivot: mat3x3f) -> mat3x3f {
    let y = block[1] - block[0] * pivot[0].y;
    return mat3x3f(block[0], y, block[2] - block[0] * pivot[0].z - y * pivot[1].z);
}

// l^-1 u, where `pivot` is factored.
fn forward(pivot: mat3x3f, u: vec3f) -> vec3f {
    let second = u.y - pivot[0].y * u.x;
    return vec3f(u.x, second, u.z - pivot[0].z * u.x - pivot[1].z * second);
}

// l^-T u, where `pivot` is factored.
fn backward(pivot: mat3x3f, u: vec3f) -> vec3f {
    let second = u.y - pivot[1].z * u.z;
    return vec3f(u.x - pivot[0].y * second - pivot[0].z * u.z, second, u.z);
}

// Movement of one side of a row of S under one side of a column: shift and rotation.
fn movement(shift: mat3x3f, inv_mass: f32, about: mat3x3f, turn: mat3x3f) -> mat3x3f {
    return block_sum(block_product(about, turn), mat3x3f(shift[0] * inv_mass, shift[1] * inv_mass, shift[2] * inv_mass));
}

// The sides that a joint shares with itself, in the bits of `shared_sides`.
const OWN_SIDES: u32 = 9u;

// The shift of a row of S under a column, for a body with these locked axes.
fn shift_under(column: u32, row: u32, locks: f32) -> mat3x3f {
    var along = joint_nodes[column].along;
    if locks > 0.0 {
        let free = unlocked(locks, vec3f(1.0));
        along = mat3x3f(along[0] * free.x, along[1] * free.y, along[2] * free.z);
    }
    return product_with_transpose(joint_nodes[row].along, along);
}

// The block of S in the column of one node and the row of another node, or of the same.
fn coupling(column: u32, row: u32, shared_sides: u32) -> mat3x3f {
    let mass_a = joint_nodes[column].mass_a;
    let mass_b = joint_nodes[column].mass_b;
    let shift_a = shift_under(column, row, joint_nodes[column].locks_a);
    var shift_b = shift_a;
    if joint_nodes[column].locks_b != joint_nodes[column].locks_a {
        shift_b = shift_under(column, row, joint_nodes[column].locks_b);
    }
    var block = mat3x3f(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    if (shared_sides & 1u) != 0u {
        block = block_sum(block, movement(shift_a, mass_a, joint_nodes[row].about_a, joint_nodes[column].turn_a));
    }
    if (shared_sides & 2u) != 0u {
        block = block_less(block, movement(shift_a, mass_a, joint_nodes[row].about_b, joint_nodes[column].turn_a));
    }
    if (shared_sides & 4u) != 0u {
        block = block_less(block, movement(shift_b, mass_b, joint_nodes[row].about_a, joint_nodes[column].turn_b));
    }
    if (shared_sides & 8u) != 0u {
        block = block_sum(block, movement(shift_b, mass_b, joint_nodes[row].about_b, joint_nodes[column].turn_b));
    }
    return block;
}

// Factors a system after its nodes are written.
fn factor_blocks(system: u32) {
    let end = begin_of_system(system + 1u);
    for (var node = begin_of_system(system); node < end; node++) {
        let pivot = first_block_of_node(node);
        let end_block = end_block_of_node(node);
        for (var at = pivot; at < end_block; at++) {
            var block = coupling(node, node_of_block(at), select(shared_of_block(at), OWN_SIDES, at == pivot));
            let own = diagonal_of(block);
            if at == pivot {
                let softness = (own.x + own.y + own.z) * softness_of_system(system);
                joint_nodes[node].softness = softness;
                block = with_diagonal(block, softness);
            }
            let end_term = end_term_of_block(at);
            for (var term = first_term_of_block(at); term < end_term; term++) {
                let left = joint_blocks[left_of_term(term)].lower;
                block = block_less(block, product_with_transpose(left, joint_blocks[right_of_term(term)].upper));
            }
            if at == pivot {
                joint_blocks[at].lower = factored_pivot(block, own);
            } else {
                let factors = joint_blocks[pivot].lower;
                let inverse = diagonal_of(factors);
                let upper = block_over(block, factors);
                joint_blocks[at].lower = mat3x3f(upper[0] * inverse.x, upper[1] * inverse.y, upper[2] * inverse.z);
                joint_blocks[at].upper = upper;
            }
        }
    }
}
