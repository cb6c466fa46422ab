// update_momentum: one workgroup finds the step of the last sweep from the sums of measure_step, and how far the next
// one is extrapolated: further each time, and not at all after a step back, or one twice as long as the shortest since momentum
// last began. Reads lengths. Writes momentum. Double: src/kernels/momentum.rs.

fn update_momentum(thread: u32) {
    var own = vec2f();
    let count = (params.point_count + params.joint_count + CHUNK - 1u) / CHUNK;
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
