//! Runs a small world in one dispatch: one workgroup runs the whole plan, with a barrier after every pass.
//!
//! A dispatch costs as much as a sweep over hundreds of contacts. If every pass has few rows, so that one workgroup
//! needs only a few rounds, one shader holds all kernels of the plan. A uniform holds the passes, and the shader calls
//! their kernels in this order. Results are the same to the last bit.
//!
//! For a tower of ten on the software adapter, 33 passes: 1.15 ms a step in 33 dispatches, 1.05 ms in one dispatch of
//! 64 threads, and 0.39 ms in one of 8 threads. There 8 threads are one subgroup, and a barrier inside a subgroup costs
//! nothing. On an NVIDIA H200, it takes 0.50 ms in 35 dispatches and 0.27 ms in one; a pile of 200 takes 1.30 ms and
//! 0.95 ms, a pile of 800 1.83 ms and 2.34 ms.

use super::wgsl::{PASS_ROWS, Program, Target};
use crate::collide::MAX_POINTS;
use crate::plan::{Kernel, Pass};
use crate::problem::StepProblem;

/// Largest number of rows of a pass for each thread.
const ROWS_A_THREAD: usize = 4;
/// Largest number of passes. The first row of the uniform is their number.
const MAX_PASSES: usize = PASS_ROWS - 1;
/// Largest number of loop iterations of one thread. Mesa's llvmpipe silently leaves a program after 65,535 iterations
/// in total: a step of 770 passes lost its last ones.
const MAX_ITERATIONS: usize = 60_000;
/// Smallest number of passes for a shader of their own.
const MIN_PASSES: usize = 4;

/// The program for all passes, and its uniform: the number of passes, then a row for each pass. Returns `None` if the
/// world is too large for one workgroup, or if a kernel needs more than one.
pub(super) fn of(problem: &StepProblem, passes: &[Pass], target: Target) -> Option<(Program, Vec<[u32; 4]>)> {
    let rows = |pass: &Pass| {
        let colors = pass.colors.clone().map(|color| problem.rows_of(&(color..color + 1)).len());
        colors.max().unwrap_or(0)
    };
    let most_threads = target.threads_of_step() as usize;
    let most_rows = ROWS_A_THREAD * most_threads;
    // All passes share the substep of one block.
    let fits = problem.blocks.len() == 1
        && problem.points.len() <= 4 * most_rows
        && (MIN_PASSES..=MAX_PASSES).contains(&passes.len())
        && passes.iter().all(|pass| shares_only_rows(pass.kernel) && rows(pass) <= most_rows);
    // Systems of joints need five more buffers.
    if !fits || problem.has_systems() || needs_many_buffers(problem, passes) {
        return None;
    }
    let mut kernels: Vec<Kernel> = Vec::new();
    let mut table = vec![[passes.len() as u32, 0, 0, 0]];
    for pass in passes {
        let known = kernels.iter().position(|kernel| *kernel == pass.kernel).unwrap_or(kernels.len());
        if known == kernels.len() {
            kernels.push(pass.kernel);
        }
        table.push([known as u32, pass.colors.start, pass.colors.end, 0]);
    }
    // The uniform has the same size for every plan.
    table.resize(PASS_ROWS, [0; 4]);
    // One thread for each row of the largest color: barriers inside one subgroup cost nothing.
    let threads = passes.iter().map(rows).max().unwrap_or(0).next_power_of_two().clamp(8, most_threads);
    let iterations = |pass: &Pass| {
        let of_color = |color| 2 + problem.rows_of(&(color..color + 1)).len().div_ceil(threads) * of_row(pass.kernel);
        2 + pass.colors.clone().map(of_color).sum::<usize>()
    };
    if passes.iter().map(iterations).sum::<usize>() > MAX_ITERATIONS {
        return None;
    }
    Some((Program::OneDispatch(kernels.into(), threads as u32), table))
}

/// Largest number of iterations for a row of a kernel: twice over its points, or over the axes of a joint. Points that
/// change together take two more loops.
fn of_row(kernel: Kernel) -> usize {
    let (sweeps, loops) = match kernel {
        Kernel::SolveContacts(rules) => (rules.passes.max(1) as usize, if rules.as_one { 4 } else { 2 }),
        Kernel::ApplyRestitution(_) => (1, 3),
        _ => (1, 2),
    };
    2 + sweeps * (1 + loops * (1 + MAX_POINTS))
}

/// Whether threads of a kernel share only rows, so that one program can hold the kernel with others.
fn shares_only_rows(kernel: Kernel) -> bool {
    !matches!(kernel, Kernel::Extrapolate { .. } | Kernel::MeasureStep | Kernel::UpdateMomentum)
}

/// Whether all kernels together need more than the eight storage buffers of a stage. Bodies, masses, free, contacts,
/// points, impulses and colors are seven.
fn needs_many_buffers(problem: &StepProblem, passes: &[Pass]) -> bool {
    let measured = passes.iter().any(|pass| matches!(pass.kernel, Kernel::BeginSweep { .. }));
    let contacts = if problem.contacts.is_empty() { 0 } else { 3 };
    let joints = if problem.joints.is_empty() { 0 } else { 2 + usize::from(!problem.axes.is_empty()) };
    let colors = usize::from(contacts + joints > 0);
    let totals = [!problem.totals.is_empty(), !problem.joint_totals.is_empty()].map(usize::from);
    let turning = problem.turning.is_empty();
    let of_bodies = [problem.torques.is_empty(), problem.dampings.is_empty(), problem.inertias.is_empty(), turning];
    let of_bodies = of_bodies.map(|is_empty| usize::from(!is_empty));
    let all = [3, contacts, joints, colors, usize::from(measured)];
    all.iter().chain(&totals).chain(&of_bodies).sum::<usize>() > 8
}
