// Convergence of the sweeps of a substep, for programs with a kernel that measures corrections. Other programs use
// lib/unmeasured.wgsl.

// Records whether an impulse changes a velocity by more than the tolerance. `mass` is its effective mass.
fn note_correction(measured: bool, impulse: f32, mass: f32) {
    if measured && larger(impulse, -impulse) > params.tolerance * mass { atomicStore(&convergence.moving, 1u); }
}

// Whether the sweeps of this substep are over.
fn is_converged(measured: bool) -> bool {
    return measured && convergence.done != 0u;
}
