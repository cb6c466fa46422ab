// One joint, which keeps the anchors of two bodies together. Twins: src/kernels/joint.rs.

struct Anchors { r_a: vec3f, r_b: vec3f, gap: vec3f }

// The present arms, and the present gap from the anchor of a to that of b. Both arms end in the middle of the gap, so
// that the impulses of a joint have no moment together.
fn current_anchors(pair: ptr<function, Pair>, joint: Joint) -> Anchors {
    let gap = joint.gap + relative_movement(pair, joint.r_a, joint.r_b);
    let half = gap * 0.5;
    let r_a = joint.r_a + turned((*pair).a.dq, joint.r_a);
    let r_b = joint.r_b + turned((*pair).b.dq, joint.r_b);
    return Anchors(r_a + half, r_b - half, gap);
}

// The column for the axis e of one body's contribution to G M^-1 G^T: (I^-1 (r x e)) x r.
fn turning_column(m: Mass, r: vec3f, e: vec3f) -> vec3f {
    return cross3(inv_inertia_times(m, cross3(r, e)), r);
}

// One column of the joint's block of G M^-1 G^T: that of the axis e, along which the bodies have this inverse mass.
fn joint_column(pair: ptr<function, Pair>, anchors: Anchors, e: vec3f, inverse_mass: f32) -> vec3f {
    let turning = turning_column((*pair).mass_a, anchors.r_a, e) + turning_column((*pair).mass_b, anchors.r_b, e);
    return e * inverse_mass + turning;
}

// 2^-19. Rounding changes the determinant of a block with a trace of 1 to 2 by 3e-7.
const STIFFENING: f32 = 1.9073486328125e-6;

// Solves the symmetric block with these columns for u, by Cramer's rule.
fn solve_block(column_x: vec3f, column_y: vec3f, column_z: vec3f, u: vec3f) -> vec3f {
    let c = cofactors(column_x, column_y, column_z, STIFFENING);
    return vec3f(dot3(c.x, u), dot3(c.y, u), dot3(c.z, u)) * reciprocal(c.determinant) * c.scale;
}
