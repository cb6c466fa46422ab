// update_momentum: one workgroup finds the step of the last sweep from the sums of measure_step, and how far the next
// one is extrapolated: further each time, and not at all after a step that was longer than the one before.
// Reads squares. Writes momentum. Double: src/kernels/momentum.rs.

@compute @workgroup_size(WORKGROUP)
fn update_momentum(@builtin(local_invocation_index) thread: u32) {
    var own = 0.0;
    let count = (params.point_count + params.joint_count + CHUNK - 1u) / CHUNK;
    for (var i = thread; i < count; i += WORKGROUP) { own += squares[i]; }
    let square = workgroup_sum(thread, own);
    if thread == 0u {
        let x = 1.0 + 4.0 * momentum.t * momentum.t;
        let t = 0.5 * (1.0 + x * inverse_sqrt(x));
        let factor = (momentum.t - 1.0) * reciprocal(t);
        let grew = square > momentum.square;
        let restarts = momentum.restarts + select(0u, 1u, grew);
        momentum = Momentum(select(t, 1.0, grew), select(factor, 0.0, grew), square, restarts);
    }
}
