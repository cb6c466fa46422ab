//! Whether sweeps still move anything.

use crate::problem::ConvergenceRow;

/// Decides whether the next sweep is still needed, and counts it. Kernel `begin_sweep`.
pub fn begin_sweep(first: bool, convergence: &mut ConvergenceRow) {
    let done = !first && (convergence.done != 0 || convergence.moving == 0);
    convergence.done = u32::from(done);
    convergence.sweeps += u32::from(!done);
    convergence.planned += 1;
    convergence.moving = 0;
}
