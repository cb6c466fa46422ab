//! Every kernel against its Rust twin, pass by pass, on random problems.
//!
//! A driver compiles each variant of a kernel, over a thousand programs in all. Of the variants that differ in rules these tests run a
//! covering array: any three rules meet in every combination that they have. `drystone conform` runs all of them, in both modes and forms.

use std::collections::HashSet;
use std::sync::LazyLock;

use crate::common::difference::{differing, largest};
use crate::common::gpu;
use crate::common::kernels::{
    accelerated_sweeps, color_by_color, every_kernel, has_patches, in_one_pass, sweep, ways_to_run,
};
use crate::common::{random, tolerance};
use drystone::config::FrictionRule;
use drystone::stages::kernels::Rules;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::ConvergenceRow;
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Reference};

tests! {
    any_gpu {
        every_kernel_is_near_its_double_as_plain_wgsl,
    }
    exact_gpu {
        every_kernel_gives_the_bits_of_its_double_in_exact_mode,
        sweeps_of_hardware_give_the_bits_of_their_double,
        tiny_numbers_keep_their_bits_in_exact_mode,
        fast_spins_keep_their_bits_in_exact_mode,
        light_and_heavy_joints_keep_their_bits_in_exact_mode,
        sweeps_end_where_no_correction_is_above_the_tolerance,
    }
    no_gpu {
        any_three_rules_meet_in_a_variant_that_is_tried,
        every_kernel_changes_a_random_problem,
        masses_of_other_powers_of_two_change_no_velocity,
        must_fail::an_impulse_that_is_one_percent_off_is_found,
        must_fail::two_swapped_colors_are_found,
        must_fail::a_dropped_pass_is_found,
        must_fail::a_pass_of_momentum_that_is_dropped_is_found,
        must_fail::a_number_that_is_none_is_found,
    }
}

const MEASURED: Rules = Rules {
    biased: true,
    friction: FrictionRule::Disc,
    rolls: false,
    patch: false,
    friction_first: false,
    accumulated: true,
    round: true,
    as_one: true,
    driven: false,
    passes: 1,
    measured: true,
    from_start: false,
    isotropic: false,
    bounces: false,
    axes: false,
};

const SEEDS: std::ops::Range<u64> = 0..2;

fn after(backend: &mut dyn Backend, problem: &StepProblem, passes: &[Pass]) -> StepProblem {
    let mut result = problem.clone();
    backend.run(&mut result, passes).expect("the problem is small");
    result
}

fn by_the_reference(problem: &StepProblem, passes: &[Pass]) -> StepProblem {
    after(&mut Reference::<f32>::new(), problem, passes)
}

/// A random problem whose manifolds carry no patches, and one whose manifolds do.
fn problems(seed: u64) -> [StepProblem; 2] {
    [false, true].map(|patches| random::problem(seed, patches))
}

/// Any three rules of a kernel, and the values that they have there.
fn triples(kernel: Kernel) -> HashSet<[(usize, u8); 3]> {
    let Some(rules) = kernel.rules() else { return HashSet::new() };
    let Rules { biased, friction, patch, friction_first, accumulated, round, as_one, driven, .. } = rules;
    let Rules { passes, measured, from_start, isotropic, bounces, axes, rolls, .. } = rules;
    let values = [
        [biased, patch, friction_first, accumulated, round, as_one, driven].map(u8::from).to_vec(),
        [measured, from_start, isotropic, bounces, axes, rolls].map(u8::from).to_vec(),
        vec![friction as u8, passes],
    ];
    let values: Vec<_> = values.concat().into_iter().enumerate().collect();
    let mut found = HashSet::new();
    for (i, &a) in values.iter().enumerate() {
        for (j, &b) in values.iter().enumerate().skip(i + 1) {
            found.extend(values[j + 1..].iter().map(|&c| [a, b, c]));
        }
    }
    found
}

/// Every kernel, of those with rules so many variants that any three rules have met in each combination that they have: always the one
/// that brings most together that did not meet yet.
static TRIED: LazyLock<Vec<Kernel>> = LazyLock::new(|| {
    let (with_rules, mut chosen): (Vec<_>, Vec<_>) = every_kernel().into_iter().partition(|k| k.rules().is_some());
    let named = |kernel: Kernel| triples(kernel).into_iter().map(move |triple| (kernel.name(), triple));
    // Each with the combinations that did not meet yet.
    let mut waiting: Vec<(Kernel, HashSet<_>)> =
        with_rules.iter().map(|&kernel| (kernel, named(kernel).collect())).collect();
    loop {
        waiting.retain(|(_, new)| !new.is_empty());
        // The first of equals, so that it is the same in every run.
        let Some((best, met)) = waiting.iter().rev().max_by_key(|(_, new)| new.len()).cloned() else { return chosen };
        waiting.iter_mut().for_each(|(_, new)| new.retain(|triple| !met.contains(triple)));
        chosen.push(best);
    }
});

fn any_three_rules_meet_in_a_variant_that_is_tried() {
    let (all, tried) = (every_kernel(), &*TRIED);
    let met = |kernels: &[Kernel]| -> HashSet<_> {
        kernels.iter().flat_map(|kernel| triples(*kernel).into_iter().map(|triple| (kernel.name(), triple))).collect()
    };
    assert_eq!(met(&all), met(tried));
    assert!(all.iter().filter(|kernel| kernel.rules().is_none()).all(|kernel| tried.contains(kernel)));
    let sweeps = |kernels: &[Kernel]| kernels.iter().filter(|k| matches!(k, Kernel::SolveContacts(_))).count();
    measured!("{} of {} kernels, {} of {} sweeps", tried.len(), all.len(), sweeps(tried), sweeps(&all));
    assert!(sweeps(tried) * 4 < sweeps(&all), "{} of {}", sweeps(tried), sweeps(&all));
}

/// How the driver gets a kernel: a program for one color, or one that goes over all colors.
#[derive(Clone, Copy)]
enum Form {
    Pass,
    Fused,
}

/// Runs kernels on the problem that each asks for, on the reference and on `gpu`.
fn run_all(
    gpu: &mut dyn Backend,
    form: Form,
    problems: &[StepProblem; 2],
    mut compare: impl FnMut(&StepProblem, &StepProblem, &str),
) {
    for &kernel in TRIED.iter() {
        let problem = &problems[usize::from(has_patches(kernel))];
        let mut ways = ways_to_run(kernel, problem);
        let passes = match form {
            Form::Pass => ways.pop().expect("a way"),
            Form::Fused => ways.swap_remove(0),
        };
        let what = format!("{kernel} in {} passes", passes.len());
        compare(&by_the_reference(problem, &passes), &after(gpu, problem, &passes), &what);
    }
}

/// Fails unless all kernels agree to the last bit.
fn assert_same(gpu: &mut dyn Backend, problems: &[StepProblem; 2], name: &str) {
    run_all(gpu, Form::Fused, problems, |ours, theirs, what| {
        let count = differing(ours, theirs);
        assert_eq!(count, 0, "{name}, {what}: {count} numbers differ");
    });
}

fn every_kernel_gives_the_bits_of_its_double_in_exact_mode() {
    let mut gpu = gpu::exact();
    for seed in SEEDS {
        assert_same(&mut gpu, &problems(seed), &format!("seed {seed}"));
    }
}

/// Sweeps over contacts have a text of their own for hardware. A software adapter compiles one of it for seconds.
fn sweeps_of_hardware_give_the_bits_of_their_double() {
    let (problems, mut gpu) = (problems(0), gpu::own_exact().cut_as_hardware());
    let sweeps: Vec<_> = TRIED.iter().filter(|kernel| matches!(kernel, Kernel::SolveContacts(_))).collect();
    let (mut tried, mut rules) = (0, HashSet::new());
    for &&kernel in sweeps.iter().step_by(sweeps.len() / 8) {
        let problem = &problems[usize::from(has_patches(kernel))];
        let passes = color_by_color(kernel, problem);
        let (ours, theirs) = (by_the_reference(problem, &passes), after(&mut gpu, problem, &passes));
        assert_eq!(differing(&ours, &theirs), 0, "{kernel}");
        let Rules { patch, as_one, friction_first, .. } = kernel.rules().expect("a sweep has rules");
        rules.extend([("patch", patch), ("as one", as_one), ("friction first", friction_first)]);
        tried += 1;
    }
    measured!("{tried} of {} sweeps, {rules:?}", sweeps.len());
    assert_eq!(rules.len(), 6, "each with and without: {rules:?}");
}

fn tiny_numbers_keep_their_bits_in_exact_mode() {
    let mut gpu = gpu::exact();
    // Squares that are subnormal, and numbers that are.
    for scale in [1e-20, 1e-22, 1e-40] {
        let tiny = problems(0).map(|problem| random::scaled(problem, scale));
        assert_same(&mut gpu, &tiny, &format!("scale {scale:e}"));
    }
}

/// The spins of a problem after the kernel, and its passes.
fn spun(problem: &StepProblem) -> (StepProblem, Vec<Pass>) {
    let passes = ways_to_run(Kernel::IntegrateGyroscopic { from_start: false }, problem).remove(0);
    (by_the_reference(problem, &passes), passes)
}

/// From spins that torque hardly turns to those that it would turn by 1e5 rad a substep.
fn fast_spins_keep_their_bits_in_exact_mode() {
    let mut gpu = gpu::exact();
    for factor in [0.01, 0.3, 1.0, 3.0, 30.0, 1e3, 1e5] {
        let problem = random::faster(random::problem(0, false), factor);
        let (ours, passes) = spun(&problem);
        let apart = largest(&ours, &problem);
        assert!(apart > 1e-3 && apart.is_finite(), "{factor} times as fast: {apart:e}");
        let theirs = after(&mut gpu, &problem, &passes);
        assert_eq!(differing(&ours, &theirs), 0, "{factor} times as fast");
    }
}

/// Powers of two round nothing: a problem of masses so many times as large has the same velocities to the last bit, and
/// impulses as many times as large. 2^40 is 1e12.
fn masses_of_other_powers_of_two_change_no_velocity() {
    let mut joints = 0;
    for (seed, factor) in [(0, 2_f32.powi(40)), (1, 2_f32.powi(-40))] {
        for kernel in every_kernel() {
            let problem = &problems(seed)[usize::from(has_patches(kernel))];
            let heavy = random::heavier(problem.clone(), factor);
            for passes in ways_to_run(kernel, problem) {
                let usual = random::heavier(by_the_reference(problem, &passes), factor);
                let scaled = by_the_reference(&heavy, &passes);
                // The square of a step is one of impulses.
                let (momentum, convergence) = (usual.momentum, usual.convergence);
                let scaled = StepProblem { momentum, convergence, ..scaled };
                assert_eq!(differing(&usual, &scaled), 0, "{kernel}, {factor:e} times as heavy");
                joints += usize::from(matches!(kernel, Kernel::SolveJoints(_)));
            }
        }
    }
    assert!(joints > 0);
}

fn light_and_heavy_joints_keep_their_bits_in_exact_mode() {
    let mut gpu = gpu::exact();
    // Arms of 1000 are those of blocks that rounding makes indefinite.
    for (factor, arms) in [(1e-15, 1.0), (1e-9, 1.0), (1e7, 1.0), (1e15, 1.0), (1.0, 1e3), (1e7, 1e4)] {
        let mut problem = random::heavier(random::problem(0, false), factor);
        problem.joints.iter_mut().flat_map(|row| row.r_a.iter_mut().chain(&mut row.r_b)).for_each(|x| *x *= arms);
        for rules in [Rules::default(), MEASURED.of_joints()] {
            let passes = color_by_color(Kernel::SolveJoints(rules), &problem);
            let (ours, theirs) = (by_the_reference(&problem, &passes), after(&mut gpu, &problem, &passes));
            let apart = crate::common::difference::of_velocities(&ours, &problem);
            assert!(apart > 1.0 && apart.is_finite(), "{factor:e} times as heavy: {apart:e} m/s");
            assert_eq!(differing(&ours, &theirs), 0, "{factor:e} times as heavy");
        }
    }
}

fn every_kernel_is_near_its_double_as_plain_wgsl() {
    let mut gpu = gpu::plain();
    let mut worst = (0.0, String::new());
    for seed in SEEDS {
        run_all(&mut gpu, Form::Pass, &problems(seed), |ours, theirs, what| {
            let apart = largest(ours, theirs);
            if apart > worst.0 {
                worst = (apart, format!("seed {seed}, {what}"));
            }
        });
    }
    measured!("largest difference {:e}: {}", worst.0, worst.1);
    assert!(worst.0 <= tolerance::PLAIN_PASS, "{:e}: {}", worst.0, worst.1);
}

fn sweeps_end_where_no_correction_is_above_the_tolerance() {
    let mut gpu = gpu::exact();
    for (tolerance, sweeps) in [(1e9, 1), (0.0, 3)] {
        for kernel in [Kernel::SolveJoints(MEASURED), Kernel::SolveContacts(MEASURED)] {
            let mut problem = random::problem(0, false);
            problem.params.tolerance = tolerance;
            problem.convergence = ConvergenceRow::default();
            let once = |first| {
                [
                    vec![Pass { kernel: Kernel::BeginSweep { first }, block: 0, colors: 0..0 }],
                    in_one_pass(kernel, &problem),
                ]
                .concat()
            };
            let passes = [once(true), once(false), once(false)].concat();
            let (ours, theirs) = (by_the_reference(&problem, &passes), after(&mut gpu, &problem, &passes));
            assert_eq!(ours.convergence, theirs.convergence, "{kernel}");
            assert_eq!((ours.convergence.sweeps, ours.convergence.planned), (sweeps, 3), "{kernel}");
            // Sweeps that did not run changed nothing.
            let done = by_the_reference(&problem, &passes[..2 * sweeps as usize]);
            assert_eq!(
                (&ours.bodies, &ours.impulses, &ours.joint_impulses),
                (&done.bodies, &done.impulses, &done.joint_impulses)
            );
            assert_eq!(differing(&ours, &theirs), 0, "{kernel}");
        }
    }
}

fn every_kernel_changes_a_random_problem() {
    let problems = problems(0);
    for kernel in every_kernel() {
        let problem = &problems[usize::from(has_patches(kernel))];
        // Against the same passes without it.
        let passes = ways_to_run(kernel, problem).remove(0);
        let others: Vec<_> = passes.iter().filter(|p| p.kernel != kernel).cloned().collect();
        let apart = largest(&by_the_reference(problem, &others), &by_the_reference(problem, &passes));
        assert!(apart > 0.01 && apart.is_finite(), "{kernel}: {apart:e}");
    }
}

/// The comparers find what they are there to find.
mod must_fail {
    use super::*;

    fn assert_found(good: &StepProblem, bad: &StepProblem) {
        assert!(differing(good, bad) > 0);
        assert!(largest(good, bad) > tolerance::PLAIN_PASS, "{:e}", largest(good, bad));
    }

    pub fn an_impulse_that_is_one_percent_off_is_found() {
        let problem = random::problem(0, false);
        let good = by_the_reference(&problem, &in_one_pass(sweep(), &problem));
        let mut bad = good.clone();
        let impulse = bad.impulses.iter_mut().find(|i| i.normal > 0.1).expect("some point pushes");
        impulse.normal *= 1.01;
        assert_found(&good, &bad);
    }

    pub fn two_swapped_colors_are_found() {
        let problem = random::problem(0, false);
        let mut passes = color_by_color(sweep(), &problem);
        let good = by_the_reference(&problem, &passes);
        passes.swap(0, 1);
        assert_found(&good, &by_the_reference(&problem, &passes));
    }

    pub fn a_dropped_pass_is_found() {
        let problem = random::problem(0, false);
        let passes = color_by_color(sweep(), &problem);
        let good = by_the_reference(&problem, &passes);
        for dropped in 0..passes.len() {
            let mut passes = passes.clone();
            passes.remove(dropped);
            assert_found(&good, &by_the_reference(&problem, &passes));
        }
    }

    pub fn a_pass_of_momentum_that_is_dropped_is_found() {
        let problem = random::problem(0, false);
        let passes = accelerated_sweeps(&problem, false);
        let good = by_the_reference(&problem, &passes);
        for kernel in
            [Kernel::MeasureStep, Kernel::UpdateMomentum, Kernel::Extrapolate { first: false, measured: false }]
        {
            let mut passes = passes.clone();
            let last = passes.iter().rposition(|p| p.kernel == kernel).expect("there are some");
            passes.remove(last);
            assert_found(&good, &by_the_reference(&problem, &passes));
        }
    }

    pub fn a_number_that_is_none_is_found() {
        let good = random::problem(0, false);
        let mut bad = good.clone();
        bad.bodies[0].v[0] = f32::NAN;
        assert_eq!((differing(&good, &bad), largest(&good, &bad)), (1, f64::INFINITY));
    }
}
