//! The dispatches of a plan: a program, its number of workgroups, and the row of its pass.

use std::collections::HashMap;

use super::pipelines::Pipelines;
use super::submissions::ROWS_OF_A_DISPATCH;
use super::timer::Timer;
use super::wgsl::{Program, Target, WORKGROUP};
use crate::kernels::momentum::IMPULSES_PER_CHUNK;
use crate::plan::{Kernel, Pass, color_groups};
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
    fn workgroups(&self, target: Target) -> u32 {
        (self.rows as u32).div_ceil(self.program.threads(target) * target.rows_a_thread()).clamp(1, 65_535)
    }
}

/// The dispatches of the passes, and the buffer of their rows. Offsets in the buffer are multiples of `stride` bytes.
pub(super) fn of_passes(
    problem: &StepProblem,
    passes: &[Pass],
    target: Target,
    stride: usize,
) -> (Vec<Dispatch>, Vec<u8>) {
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
    let dispatch = |part: Pass| {
        let (program, rows) = match part.colors.len() > 1 && is_ordered(part.kernel) {
            // One workgroup.
            true => (Program::Fused(part.kernel), 1),
            false => (Program::Pass(part.kernel), rows_of(problem, &part)),
        };
        Dispatch { pass_row: place(&part), ..Dispatch::over(program, rows) }
    };
    let dispatches = passes.iter().flat_map(|pass| parts(problem, pass, target)).map(dispatch).collect();
    (dispatches, bytes)
}

/// Whether a kernel needs its colors in order.
fn is_ordered(kernel: Kernel) -> bool {
    !matches!(
        kernel,
        Kernel::ClearImpulses | Kernel::SumImpulses { .. } | Kernel::SumJointImpulses { .. } | Kernel::MeasureJoints(_)
    )
}

/// The parts of a pass that are one dispatch each. A workgroup sweeps several colors, but only if each of its threads
/// takes all its rows of a color at a time.
fn parts(problem: &StepProblem, pass: &Pass, target: Target) -> Vec<Pass> {
    if pass.colors.len() < 2 || !is_ordered(pass.kernel) {
        return vec![pass.clone()];
    }
    let most_rows = WORKGROUP * target.rows_a_thread();
    let groups = color_groups(&problem.colors, pass.colors.clone(), most_rows + 1);
    groups.into_iter().map(|colors| Pass { colors, ..pass.clone() }).collect()
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

/// Encodes dispatches as one compute pass.
pub(super) fn encode(
    encoder: &mut wgpu::CommandEncoder,
    dispatches: &[Dispatch],
    pipelines: &Pipelines,
    target: Target,
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
            compute.dispatch_workgroups(dispatch.workgroups(target), 1, 1);
        }
    }
    if let Some(timer) = timer {
        timer.end(&mut compute);
    }
}
