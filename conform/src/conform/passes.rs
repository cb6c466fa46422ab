//! Every kernel, and passes with one kernel.

use std::collections::HashSet;
use std::ops::Range;

use drystone::config::FrictionRule;
use drystone::stages::kernels::Rules;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::StepProblem;

/// Every combination of rules that makes a difference.
pub fn every_rules() -> Vec<Rules> {
    let mut all = Vec::new();
    for friction in [FrictionRule::None, FrictionRule::Slip, FrictionRule::Box, FrictionRule::Disc] {
        for bits in 0..1024 {
            let has = |bit: u32| bits >> bit & 1 == 1;
            let rules = Rules {
                biased: has(0),
                friction,
                patch: has(1),
                friction_first: has(2),
                accumulated: has(3),
                round: has(4),
                // Combines with both values of each of the other rules.
                as_one: has(0) ^ has(1) ^ has(4),
                measured: has(5),
                driven: has(6),
                passes: 1 + u8::from(has(6)),
                from_start: has(7),
                isotropic: has(8),
                bounces: has(4),
                rolls: has(9),
                axes: false,
            };
            // Velocities since the start of the step are combined with every sum of velocities without the rules below.
            let plain = rules.accumulated && !(rules.friction_first || rules.round || rules.measured || rules.driven);
            // Equal moments of inertia are combined with every impulse without the rules above. Without friction,
            // `friction_first` makes no difference. Belts and repeated passes are not combined with all other rules
            // again.
            let drivable = matches!(friction, FrictionRule::Box | FrictionRule::Disc)
                && rules.accumulated
                && !(rules.round || rules.measured);
            // Patches that resist rolling are combined with every rule of friction, and with belts.
            let rollable = friction != FrictionRule::None
                && rules.patch
                && rules.accumulated
                && !(rules.friction_first || rules.round || rules.measured);
            if (friction != FrictionRule::None || !rules.friction_first)
                && (rollable || !rules.rolls)
                && (drivable || !rules.driven)
                && (plain || !rules.from_start)
                && (plain && !rules.from_start || !rules.isotropic)
            {
                all.push(rules);
            }
        }
    }
    all
}

/// Every kernel with every combination of rules.
pub fn every_kernel() -> Vec<Kernel> {
    let mut all = vec![
        Kernel::IntegrateVelocities { warm_start: false, from_start: false },
        Kernel::IntegrateVelocities { warm_start: true, from_start: false },
        Kernel::IntegrateVelocities { warm_start: false, from_start: true },
        Kernel::BeginChanges,
        Kernel::EndChanges,
        Kernel::IntegrateTorques { from_start: false },
        Kernel::IntegrateTorques { from_start: true },
        Kernel::DampVelocities { from_start: false },
        Kernel::DampVelocities { from_start: true },
        Kernel::IntegrateGyroscopic { from_start: false },
        Kernel::IntegrateGyroscopic { from_start: true },
        Kernel::IntegratePositions { from_start: false },
        Kernel::IntegratePositions { from_start: true },
        Kernel::ClearImpulses,
        Kernel::SumImpulses { first: true },
        Kernel::SumImpulses { first: false },
        Kernel::SumJointImpulses { first: true },
        Kernel::SumJointImpulses { first: false },
        Kernel::BeginSweep { first: true },
        Kernel::BeginSweep { first: false },
        Kernel::MeasureStep,
        Kernel::UpdateMomentum,
        Kernel::WarmStartJoints { axes: false },
        Kernel::WarmStartJoints { axes: true },
        Kernel::TurnInertias,
        Kernel::BeginSystems,
    ];
    for (first, measured) in [(true, true), (true, false), (false, true), (false, false)] {
        all.push(Kernel::Extrapolate { first, measured });
    }
    for rules in every_rules() {
        all.push(Kernel::WarmStart(rules.of_warm_start()));
        all.push(Kernel::SolveJoints(rules.of_joints()));
        all.push(Kernel::SolveJoints(Rules { axes: true, ..rules.of_joints() }));
        let with_axes = Rules { axes: true, ..rules.of_joints() };
        all.push(Kernel::SolveAxes(with_axes));
        all.push(Kernel::MeasureJoints(with_axes));
        all.push(Kernel::SolveJointSystems(with_axes));
        all.push(Kernel::ApplyJointChanges(with_axes));
        all.push(Kernel::SolveContacts(rules));
        let Rules { patch, from_start, isotropic, .. } = rules;
        all.push(Kernel::ApplyRestitution(Rules { patch, from_start, isotropic, ..Rules::default() }));
    }
    let mut known = HashSet::new();
    all.retain(|kernel| known.insert(*kernel));
    all
}

/// A sweep with friction at the points of round surfaces.
pub fn sweep() -> Kernel {
    Kernel::SolveContacts(Rules { biased: true, friction: FrictionRule::Disc, round: true, ..Rules::default() })
}

/// Whether `kernel` needs manifolds with a patch.
pub fn has_patches(kernel: Kernel) -> bool {
    kernel.rules().is_some_and(|rules| rules.patch)
}

/// The colors that `kernel` processes; an empty range for a kernel that does not work by color.
fn colors_of(kernel: Kernel, problem: &StepProblem) -> Range<u32> {
    let [contacts, joints, bodies, inertias, systems, turning] = problem.blocks[0].colors();
    match kernel {
        Kernel::WarmStartJoints { .. } | Kernel::SolveJoints(_) | Kernel::SumJointImpulses { .. } => joints,
        Kernel::SolveAxes(_) | Kernel::MeasureJoints(_) | Kernel::ApplyJointChanges(_) => {
            problem.blocks[0].direct_joints()
        }
        Kernel::BeginSystems | Kernel::SolveJointSystems(_) => systems,
        Kernel::TurnInertias => turning,
        Kernel::ClearImpulses
        | Kernel::SumImpulses { .. }
        | Kernel::WarmStart(_)
        | Kernel::SolveContacts(_)
        | Kernel::ApplyRestitution(_) => contacts,
        Kernel::IntegrateVelocities { .. }
        | Kernel::IntegrateTorques { .. }
        | Kernel::DampVelocities { .. }
        | Kernel::BeginChanges
        | Kernel::EndChanges
        | Kernel::IntegratePositions { .. } => bodies,
        Kernel::IntegrateGyroscopic { .. } => inertias,
        _ => 0..0,
    }
}

/// `kernel` over all of `problem` in one pass.
pub fn in_one_pass(kernel: Kernel, problem: &StepProblem) -> Vec<Pass> {
    vec![Pass { kernel, block: 0, colors: colors_of(kernel, problem) }]
}

/// Several sweeps of the points and the joints of a problem. Each ends with the kernels between accelerated sweeps.
pub fn accelerated_sweeps(problem: &StepProblem, measured: bool) -> Vec<Pass> {
    let between = [Kernel::MeasureStep, Kernel::UpdateMomentum];
    let sweep = |first| {
        let own = [Kernel::Extrapolate { first, measured }, Kernel::SolveJoints(Rules::default()), sweep()];
        own.into_iter().chain(between).flat_map(|kernel| in_one_pass(kernel, problem))
    };
    [true, false, false, false, false].into_iter().flat_map(sweep).collect()
}

/// `kernel` over all of `problem`, one color in each pass.
pub fn color_by_color(kernel: Kernel, problem: &StepProblem) -> Vec<Pass> {
    let colors = colors_of(kernel, problem);
    if colors.is_empty() {
        return in_one_pass(kernel, problem);
    }
    colors.map(|c| Pass { kernel, block: 0, colors: c..c + 1 }).collect()
}

/// The sequences of passes that test a kernel: all colors in one pass, and color by color. If the kernel writes rows
/// that are not read back, a sweep follows.
pub fn ways_to_run(kernel: Kernel, problem: &StepProblem) -> Vec<Vec<Pass>> {
    // Data that one kernel leaves for the next is not read back.
    match kernel {
        Kernel::Extrapolate { measured, .. } => return vec![accelerated_sweeps(problem, measured)],
        Kernel::MeasureStep | Kernel::UpdateMomentum => return vec![accelerated_sweeps(problem, false)],
        _ => {}
    }
    let mut ways = vec![in_one_pass(kernel, problem), color_by_color(kernel, problem)];
    if matches!(
        kernel,
        Kernel::IntegrateTorques { from_start: false }
            | Kernel::DampVelocities { from_start: false }
            | Kernel::IntegrateGyroscopic { from_start: false }
    ) {
        let first = in_one_pass(Kernel::IntegrateVelocities { warm_start: false, from_start: false }, problem);
        ways.iter_mut().for_each(|passes| *passes = [&first, &passes[..], &color_by_color(sweep(), problem)].concat());
    }
    // Systems of joints: data that one of these kernels leaves for the next is not read back.
    if let Kernel::MeasureJoints(rules) | Kernel::SolveJointSystems(rules) | Kernel::ApplyJointChanges(rules) = kernel {
        let sweep = system_sweep(rules, problem);
        let changes = [Kernel::BeginChanges, Kernel::EndChanges].map(|kernel| in_one_pass(kernel, problem));
        let [begin, end] = changes.map(|passes| if rules.from_start { passes } else { Vec::new() });
        return vec![[begin, sweep, end].concat()];
    }
    if matches!(kernel, Kernel::TurnInertias | Kernel::BeginSystems) {
        return vec![system_sweep(Rules::default(), problem)];
    }
    // A warm start applies the impulses since the last warm start.
    if kernel == (Kernel::IntegrateVelocities { warm_start: true, from_start: false }) {
        let first = in_one_pass(Kernel::IntegrateVelocities { warm_start: false, from_start: false }, problem);
        ways.iter_mut().for_each(|passes| *passes = [&first, &color_by_color(sweep(), problem), &passes[..]].concat());
    }
    // Impacts read and write velocities without impulses, which the next warm start compares with those of the bodies.
    if matches!(kernel, Kernel::ApplyRestitution(Rules { from_start: false, .. })) {
        let [first, last] = [false, true]
            .map(|warm_start| in_one_pass(Kernel::IntegrateVelocities { warm_start, from_start: false }, problem));
        ways.iter_mut().for_each(|passes| *passes = [&first, &passes[..], &last].concat());
    }
    // Changes count from `BeginChanges`, and only their sums with the velocities at that time remain.
    if kernel.is_from_start() || kernel == Kernel::EndChanges {
        let integrate = Kernel::IntegrateVelocities { warm_start: false, from_start: true };
        let first = [Kernel::BeginChanges, integrate].map(|kernel| in_one_pass(kernel, problem)).concat();
        let end = in_one_pass(Kernel::EndChanges, problem);
        ways.iter_mut().for_each(|passes| *passes = [&first, &passes[..], &end].concat());
    }
    ways.dedup();
    ways
}

/// Moves bodies, then factors the joints of all systems and solves them twice. The second solution starts from the
/// corrections of the first.
fn system_sweep(rules: Rules, problem: &StepProblem) -> Vec<Pass> {
    let (turn, factor) = (Kernel::TurnInertias, Kernel::BeginSystems);
    let move_bodies = Kernel::IntegratePositions { from_start: rules.from_start };
    let first = [move_bodies, turn, factor].into_iter().flat_map(|kernel| in_one_pass(kernel, problem));
    let rules = Rules { axes: true, ..rules };
    let measured = in_one_pass(Kernel::MeasureJoints(rules), problem);
    let solved = in_one_pass(Kernel::SolveJointSystems(rules), problem);
    let sweep = [measured, solved, color_by_color(Kernel::ApplyJointChanges(rules), problem)].concat();
    first.chain(sweep.clone()).chain(sweep).collect()
}
