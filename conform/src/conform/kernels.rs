//! Compares every kernel with its Rust twin on random problems.

use super::difference::{differing, largest};
use super::passes::{every_kernel, has_patches, ways_to_run};
use super::{Group, Outcome, PLAIN_PASS, Run, failed, random};
use drystone::stages::backend::CheckedStep;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Reference};

/// Variants of a kernel in a short run.
const FEW: usize = 3;

/// Scales at which the numbers of a problem, or their squares, are subnormal.
const TINY: [f32; 3] = [1e-20, 1e-22, 1e-40];

pub(super) async fn check(run: &mut Run<'_>) {
    let all = every_kernel();
    let mut names: Vec<&str> = Vec::new();
    for kernel in &all {
        if !names.contains(&kernel.name()) {
            names.push(kernel.name());
        }
    }
    let seeds = if run.options.short { 0..1 } else { 0..2 };
    let problems: Vec<_> = seeds.flat_map(|seed| [random::problem(seed, false), random::problem(seed, true)]).collect();
    for name in names {
        let own: Vec<_> = all.iter().filter(|kernel| kernel.name() == name).copied().collect();
        run.check(Group::Kernels, name, async |run| of_kernel(run, &some(run, own), &problems).await).await;
    }
    if run.is_exact() {
        let tiny: Vec<_> = [false, true]
            .into_iter()
            .flat_map(|patches| TINY.map(|scale| random::scaled(random::problem(0, patches), scale)))
            .collect();
        // Variants differ in their operations, and hardly in the numbers.
        let few = |name: &&str| all.iter().find(|kernel| kernel.name() == *name).copied();
        let few: Vec<_> = ["solve_contacts", "solve_joints", "integrate_positions"].iter().filter_map(few).collect();
        run.check(Group::Kernels, "subnormal numbers", async |run| of_kernel(run, &few, &tiny).await).await;
    }
}

/// All variants, or an even selection of them.
fn some(run: &Run, all: Vec<Kernel>) -> Vec<Kernel> {
    let step = if run.options.short { all.len().div_ceil(FEW).max(1) } else { 1 };
    all.into_iter().step_by(step).collect()
}

/// Runs variants of a kernel on the device and on the reference, for each problem that has the data that the kernel
/// needs.
async fn of_kernel(run: &mut Run<'_>, kernels: &[Kernel], problems: &[StepProblem]) -> Outcome {
    let mut gpu = run.take_gpu().await?;
    let (mut worst, mut count) = (0.0_f64, 0);
    for &kernel in kernels {
        for problem in problems.iter().filter(|problem| problem.has_patches() == has_patches(kernel)) {
            for passes in ways_to_run(kernel, problem) {
                let ours = after(&mut Reference::<f32>::new(), problem, &passes).await?;
                let theirs = after(&mut *gpu, problem, &passes).await?;
                let (count_of_numbers, apart) = (differing(&ours, &theirs), largest(&ours, &theirs));
                worst = worst.max(apart);
                count += 1;
                let is_wrong = if run.is_exact() { count_of_numbers > 0 } else { apart > PLAIN_PASS };
                if is_wrong {
                    run.give_back(gpu);
                    return failed!(
                        "{kernel} in {} passes: {count_of_numbers} numbers differ, by {apart:.1e} of 1 plus their size",
                        passes.len()
                    );
                }
            }
        }
    }
    run.give_back(gpu);
    Ok(if run.is_exact() {
        format!("{count} runs, the same bits")
    } else {
        format!("{count} runs, largest difference {worst:.1e}, limit {PLAIN_PASS:.0e}")
    })
}

async fn after(backend: &mut dyn Backend, problem: &StepProblem, passes: &[Pass]) -> drystone::Result<StepProblem> {
    let mut result = problem.clone();
    backend.run_async(CheckedStep::new(&mut result, passes)?).await?;
    Ok(result)
}
