//! The dispatches of a plan: a program, its number of workgroups, and the row of its pass.

use std::collections::HashMap;

use super::pipelines::Pipelines;
use super::submissions::ROWS_OF_A_DISPATCH;
use super::timer::Timer;
use super::wgsl::{Program, WORKGROUP};
use crate::kernels::momentum::IMPULSES_PER_CHUNK;
use crate::plan::{Kernel, Pass};
use crate::problem::{PassRow, StepProblem};

pub(super) struct Dispatch {
    pub program: Program,
    /// Number of rows that its threads divide among them.
    pub rows: usize,
    /// Work: the rows of one thread or of all threads, plus the fixed cost of a dispatch.
    pub work: usize,
    /// Offset of the row of the pass in its buffer (B).
    pub pass_row: u32,
}

impl Dispatch {
    /// A dispatch over `rows` rows.
    pub fn over(program: Program, rows: usize) -> Self {
        Self { program, rows, work: rows + ROWS_OF_A_DISPATCH, pass_row: 0 }
    }

    /// Enough workgroups for every row. Beyond the limit of a dispatch, each thread takes more rows.
    fn workgroups(&self, rows_a_thread: u32) -> u32 {
        (self.rows as u32).div_ceil(WORKGROUP * rows_a_thread).clamp(1, 65_535)
    }
}

/// A dispatch for each pass, and the buffer of their rows. Offsets in the buffer are multiples of `stride` bytes.
pub(super) fn of_passes(problem: &StepProblem, passes: &[Pass], stride: usize) -> (Vec<Dispatch>, Vec<u8>) {
    let mut bytes = Vec::new();
    let mut known = HashMap::new();
    let mut place = |pass: &Pass| {
        *known.entry((pass.block, pass.colors.clone())).or_insert_with(|| {
            let at = bytes.len();
            bytes.resize(at + stride, 0);
            let substep = problem.blocks[pass.block as usize].substep;
            let row = PassRow { first: pass.colors.start, end: pass.colors.end, substep };
            bytes[at..at + size_of::<PassRow>()].copy_from_slice(bytemuck::bytes_of(&row));
            at as u32
        })
    };
    let dispatch = |pass: &Pass| {
        // For some kernels the order of the rows does not matter.
        let is_ordered = !matches!(
            pass.kernel,
            Kernel::ClearImpulses
                | Kernel::SumImpulses { .. }
                | Kernel::SumJointImpulses { .. }
                | Kernel::MeasureJoints(_)
        );
        let pass_row = place(pass);
        let dispatch = Dispatch { pass_row, ..Dispatch::over(Program::Pass(pass.kernel), rows_of(problem, pass)) };
        if pass.colors.len() > 1 && is_ordered {
            // One workgroup.
            Dispatch { program: Program::Fused(pass.kernel), rows: 1, ..dispatch }
        } else {
            dispatch
        }
    };
    let dispatches = passes.iter().map(dispatch).collect();
    (dispatches, bytes)
}

/// Rows of a pass that threads can divide among them.
fn rows_of(problem: &StepProblem, pass: &Pass) -> usize {
    match pass.kernel {
        Kernel::Extrapolate { .. } => problem.bodies.len().max(problem.impulse_count()),
        // One workgroup for each chunk.
        Kernel::MeasureStep => problem.impulse_count().div_ceil(IMPULSES_PER_CHUNK) * WORKGROUP as usize,
        Kernel::BeginSweep { .. } | Kernel::UpdateMomentum => 1,
        _ => problem.rows_of(&pass.colors).len(),
    }
}

/// Number of dispatches that fit into one submission with room for `room` rows: at least one.
pub(super) fn first_part(dispatches: &[Dispatch], room: usize) -> usize {
    let mut work = 0;
    let fits = dispatches.iter().take_while(|dispatch| {
        work += dispatch.work;
        work <= room
    });
    fits.count().max(1)
}

/// Encodes dispatches as one compute pass. A thread takes `rows_a_thread` rows if there are enough for every thread.
pub(super) fn encode(
    encoder: &mut wgpu::CommandEncoder,
    dispatches: &[Dispatch],
    pipelines: &Pipelines,
    rows_a_thread: u32,
    mut timer: Option<&mut Timer>,
) {
    let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    for run in dispatches.chunk_by(|a, b| a.program == b.program) {
        if let Some(timer) = &mut timer {
            timer.before(&mut compute, &run[0].program);
        }
        let compiled = pipelines.get(&run[0].program);
        compute.set_pipeline(&compiled.pipeline);
        for dispatch in run {
            let offsets: &[u32] = if compiled.has_pass_row() { &[dispatch.pass_row] } else { &[] };
            compute.set_bind_group(0, &compiled.bind_group, offsets);
            compute.dispatch_workgroups(dispatch.workgroups(rows_a_thread), 1, 1);
        }
    }
    if let Some(timer) = timer {
        timer.end(&mut compute);
    }
}
