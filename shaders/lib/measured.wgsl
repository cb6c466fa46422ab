// Convergence of the sweeps of a substep, for programs with a kernel that measures corrections. Other programs use
// lib/unmeasured.wgsl.

// Records a correction above the tolerance. The impulse is compared with the mass that it moved.
fn note_correction(measured: bool, impulse: f32, mass: f32) {
    if measured && larger(impulse, -impulse) > params.tolerance * mass { atomicStore(&convergence.moving, 1u); }
}

// Whether the sweeps of this substep are over.
fn is_converged(measured: bool) -> bool {
    return measured && convergence.done != 0u;
}
