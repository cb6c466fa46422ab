// The end of the sweeps of a substep, in programs with a kernel that measures corrections. Other programs have lib/unmeasured.wgsl.

// Notes that a correction was above the tolerance: an impulse, against the mass that it moved.
fn note_correction(measured: bool, impulse: f32, mass: f32) {
    if measured && larger(impulse, -impulse) > params.tolerance * mass { atomicStore(&convergence.moving, 1u); }
}

// Whether the sweeps of this substep are over.
fn is_converged(measured: bool) -> bool {
    return measured && convergence.done != 0u;
}
