//! Converts the rows of a problem to the bytes of buffers.

use super::bindings::Binding;
use crate::kernels::momentum::{IMPULSES_PER_CHUNK, StepLength};
use crate::problem::{JointImpulseRow, JointSystems, StepProblem};

/// Size of a row in the buffers that stay on the device: two vectors (B).
pub const SCRATCH_ROW: usize = 32;

/// Size of the struct `JointNode` of the shaders (B).
pub const JOINT_NODE: usize = 272;
/// Size of the struct `JointBlock` of the shaders (B).
pub const JOINT_BLOCK: usize = 96;

/// The lists of the joint systems as one buffer: the starts of five lists, then the lists.
pub(super) fn pack_systems(problem: &StepProblem, packed: &mut Vec<u32>) {
    packed.clear();
    if !problem.has_systems() {
        return;
    }
    let JointSystems { begins, softness, nodes, blocks, terms } = &problem.systems;
    let lists: [&[u32]; 5] = [
        begins,
        bytemuck::cast_slice(softness),
        bytemuck::cast_slice(nodes),
        bytemuck::cast_slice(blocks),
        bytemuck::cast_slice(terms),
    ];
    let mut begin = lists.len();
    for list in lists {
        packed.push(begin as u32);
        begin += list.len();
    }
    lists.iter().for_each(|list| packed.extend_from_slice(list));
}

/// Rows that change little from step to step.
pub(super) fn small<'a>(problem: &'a StepProblem, colors: &'a [u32], systems: &'a [u32]) -> [(Binding, &'a [u8]); 15] {
    [
        (Binding::Params, bytemuck::bytes_of(&problem.params)),
        (Binding::Bodies, bytemuck::cast_slice(&problem.bodies)),
        (Binding::Masses, bytemuck::cast_slice(&problem.masses)),
        (Binding::Torques, bytemuck::cast_slice(&problem.torques)),
        (Binding::Dampings, bytemuck::cast_slice(&problem.dampings)),
        (Binding::Inertias, bytemuck::cast_slice(&problem.inertias)),
        (Binding::Colors, bytemuck::cast_slice(colors)),
        (Binding::Joints, bytemuck::cast_slice(&problem.joints)),
        (Binding::Axes, bytemuck::cast_slice(&problem.axes)),
        (Binding::JointImpulses, bytemuck::cast_slice(&problem.joint_impulses)),
        (Binding::JointTotals, bytemuck::cast_slice(&problem.joint_totals)),
        (Binding::JointSystems, bytemuck::cast_slice(systems)),
        (Binding::Turning, bytemuck::cast_slice(&problem.turning)),
        (Binding::Convergence, bytemuck::bytes_of(&problem.convergence)),
        (Binding::Momentum, bytemuck::bytes_of(&problem.momentum)),
    ]
}

/// Rows of the contacts, the largest part of a problem.
pub(super) fn of_contacts(problem: &StepProblem) -> [(Binding, &[u8]); 4] {
    [
        (Binding::Contacts, bytemuck::cast_slice(&problem.contacts)),
        (Binding::Points, bytemuck::cast_slice(&problem.points)),
        (Binding::Impulses, bytemuck::cast_slice(&problem.impulses)),
        (Binding::Totals, bytemuck::cast_slice(&problem.totals)),
    ]
}

/// Rows that the host reads back after every step.
pub(super) fn changed(problem: &mut StepProblem) -> [(Binding, &mut [u8]); 7] {
    [
        (Binding::Bodies, bytemuck::cast_slice_mut(&mut problem.bodies)),
        (Binding::JointImpulses, bytemuck::cast_slice_mut(&mut problem.joint_impulses)),
        (Binding::JointTotals, bytemuck::cast_slice_mut(&mut problem.joint_totals)),
        (Binding::Convergence, bytemuck::bytes_of_mut(&mut problem.convergence)),
        (Binding::Momentum, bytemuck::bytes_of_mut(&mut problem.momentum)),
        (Binding::Impulses, bytemuck::cast_slice_mut(&mut problem.impulses)),
        (Binding::Totals, bytemuck::cast_slice_mut(&mut problem.totals)),
    ]
}

/// Sizes of the buffers that stay on the device. All but the first are for accelerated sweeps.
pub(super) fn scratch_sizes(problem: &StepProblem, accelerated: bool) -> [(Binding, usize); 7] {
    let (bodies, impulses) = (problem.bodies.len(), if accelerated { problem.impulse_count() } else { 0 });
    let before = if accelerated { bodies } else { 0 };
    [
        (Binding::Free, SCRATCH_ROW * bodies),
        (Binding::VelocitiesBefore, SCRATCH_ROW * before),
        (Binding::ImpulseSteps, SCRATCH_ROW * impulses),
        (Binding::Lengths, size_of::<StepLength<f32>>() * impulses.div_ceil(IMPULSES_PER_CHUNK)),
        (Binding::JointNodes, JOINT_NODE * problem.systems.nodes.len()),
        (Binding::JointBlocks, JOINT_BLOCK * problem.systems.blocks.len()),
        (
            Binding::JointChanges,
            if problem.systems.is_empty() { 0 } else { size_of::<JointImpulseRow>() * problem.joint_impulses.len() },
        ),
    ]
}
