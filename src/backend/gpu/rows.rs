//! The rows of a problem as the bytes of buffers.

use super::bindings::Binding;
use crate::kernels::momentum::{IMPULSES_PER_CHUNK, StepLength};
use crate::problem::StepProblem;

/// Size of a row of the buffers that stay on the device: two vectors (B).
pub const SCRATCH_ROW: usize = 32;

/// Rows of which a step changes little.
pub(super) fn small<'a>(problem: &'a StepProblem, colors: &'a [u32]) -> [(Binding, &'a [u8]); 9] {
    [
        (Binding::Params, bytemuck::bytes_of(&problem.params)),
        (Binding::Bodies, bytemuck::cast_slice(&problem.bodies)),
        (Binding::Masses, bytemuck::cast_slice(&problem.masses)),
        (Binding::Inertias, bytemuck::cast_slice(&problem.inertias)),
        (Binding::Colors, bytemuck::cast_slice(colors)),
        (Binding::Joints, bytemuck::cast_slice(&problem.joints)),
        (Binding::JointImpulses, bytemuck::cast_slice(&problem.joint_impulses)),
        (Binding::Convergence, bytemuck::bytes_of(&problem.convergence)),
        (Binding::Momentum, bytemuck::bytes_of(&problem.momentum)),
    ]
}

/// Rows of the contacts: most of a problem.
pub(super) fn of_contacts(problem: &StepProblem) -> [(Binding, &[u8]); 3] {
    [
        (Binding::Contacts, bytemuck::cast_slice(&problem.contacts)),
        (Binding::Points, bytemuck::cast_slice(&problem.points)),
        (Binding::Impulses, bytemuck::cast_slice(&problem.impulses)),
    ]
}

/// Rows that the host reads back after every step.
pub(super) fn moved(problem: &mut StepProblem) -> Vec<(Binding, &mut [u8])> {
    vec![
        (Binding::Bodies, bytemuck::cast_slice_mut(&mut problem.bodies)),
        (Binding::JointImpulses, bytemuck::cast_slice_mut(&mut problem.joint_impulses)),
        (Binding::Convergence, bytemuck::bytes_of_mut(&mut problem.convergence)),
        (Binding::Momentum, bytemuck::bytes_of_mut(&mut problem.momentum)),
    ]
}

/// Bytes of the buffers that stay on the device. All but the first are for accelerated sweeps.
pub(super) fn scratch_sizes(problem: &StepProblem, accelerated: bool) -> [(Binding, usize); 4] {
    let (bodies, impulses) = (problem.bodies.len(), if accelerated { problem.impulse_count() } else { 0 });
    let before = if accelerated { bodies } else { 0 };
    [
        (Binding::Free, SCRATCH_ROW * bodies),
        (Binding::VelocitiesBefore, SCRATCH_ROW * before),
        (Binding::ImpulseSteps, SCRATCH_ROW * impulses),
        (Binding::Lengths, size_of::<StepLength<f32>>() * impulses.div_ceil(IMPULSES_PER_CHUNK)),
    ]
}
