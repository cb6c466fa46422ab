// begin_sweep: one thread decides whether the next sweep is still needed, and counts sweeps.
// Reads and writes convergence. Twin: src/kernels/convergence.rs.

fn begin_sweep(first: bool) {
    // The first sweep of a substep is always needed. A later one is needed if the sweep before moved an impulse by more
    // than the tolerance.
    let done = !first && (convergence.done != 0u || atomicLoad(&convergence.moving) == 0u);
    convergence.done = select(0u, 1u, done);
    convergence.sweeps += select(1u, 0u, done);
    convergence.planned += 1u;
    atomicStore(&convergence.moving, 0u);
}
