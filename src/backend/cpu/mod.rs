//! The CPU backends: the reference, one constraint at a time, and the same kernels over sixteen lanes and all threads.

mod crew;
mod groups;
mod joints;
mod lanes;
mod parts;
pub(crate) mod peak;
mod reference;
mod shared;
mod sweep;
mod wide;

pub use lanes::Cpu;
pub use reference::Reference;

use crate::problem::ConvergenceRow;

/// Decides whether the sweep that follows is still needed, and counts. Double of the kernel `begin_sweep`.
fn begin_sweep(first: bool, convergence: &mut ConvergenceRow) {
    let done = !first && (convergence.done != 0 || convergence.moving == 0);
    convergence.done = u32::from(done);
    convergence.sweeps += u32::from(!done);
    convergence.planned += 1;
    convergence.moving = 0;
}
