// update_momentum: one workgroup computes the step of the last sweep from the sums of measure_step, and the factor of
// the next extrapolation. The factor grows with each sweep. It is zero after a step back, and after a step more than
// twice as long as the shortest since it was last zero.
// Reads lengths. Writes momentum. Twin: src/kernels/momentum.rs.

fn update_momentum(thread: u32) {
    var own = vec2f();
    let count = (params.point_count + params.joint_count + params.axis_count + IMPULSES_PER_CHUNK - 1u) / IMPULSES_PER_CHUNK;
    for (var i = thread; i < count; i += WORKGROUP) { own += lengths[i]; }
    let sum = workgroup_sum(thread, own);
    if thread == 0u {
        let x = 1.0 + 4.0 * momentum.t * momentum.t;
        let t = 0.5 * (1.0 + x * inverse_sqrt(x));
        let factor = (momentum.t - 1.0) * reciprocal(t);
        let square = sum.x;
        let ends = sum.y < 0.0 || square > 4.0 * momentum.square;
        let shorter = ends || square < momentum.square;
        momentum.t = select(t, 1.0, ends);
        momentum.factor = select(factor, 0.0, ends);
        momentum.square = select(momentum.square, square, shorter);
        momentum.restarts += select(0u, 1u, ends);
    }
}
