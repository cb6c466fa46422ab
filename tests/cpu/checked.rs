//! Problems from any source are checked before threads or drivers rely on them.

use crate::common::settings::set;
use drystone::stages::backend::CheckedStep;
use drystone::stages::plan::StepPlan;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{AxisRow, DampingRow, InertiaRow, JointImpulseRow, TorqueRow};
use drystone::{Backend, Cpu, Reference, Simulation, SolverConfig};
use drystone_scenes::Scene;

/// The problem of a step with contacts, joints and spins, and its plan.
fn step(settings: &[&str]) -> (StepProblem, StepPlan) {
    let mut config = SolverConfig::default();
    settings.iter().for_each(|s| set(&mut config, s));
    let scene = Scene::find("bridge", &[]).expect("the scene");
    let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new())).expect("a simulation");
    for _ in 0..60 {
        simulation.step(scene.dt).expect("a step");
    }
    let (problem, plan) = simulation.next_problem(scene.dt).expect("a step");
    assert!(!problem.contacts.is_empty() && !problem.joints.is_empty() && !problem.inertias.is_empty());
    (problem, plan)
}

fn refusal(mut problem: StepProblem, passes: &[Pass]) -> Option<String> {
    let line = CheckedStep::new(&mut problem, passes).err().map(|e| e.to_string());
    // Every backend refuses it, in the same words, and leaves it as it is.
    for mut backend in [Box::new(Cpu::new()) as Box<dyn Backend>, Box::new(Reference::<f32>::new())] {
        if line.is_some() {
            let before = problem.clone();
            assert_eq!(backend.run(&mut problem, passes).err().map(|e| e.to_string()), line);
            assert_eq!(before, problem);
        }
    }
    line
}

#[test]
fn every_step_that_a_simulation_builds_keeps_what_backends_rely_on() {
    let rules: [&[&str]; 6] = [
        &[],
        &["friction_at=manifold"],
        &["friction_at=manifold", "friction=none"],
        &["max_colors=1"],
        &["method=accelerated", "iterations=5", "tolerance=0.01"],
        &["stabilization=baumgarte", "relax=0", "rules.clamping=per-correction"],
    ];
    for name in ["pile:n=60", "drop", "bridge", "joint-grid", "drum", "slide:mu=0", "chain:worlds=3", "rolling"] {
        for rule in rules {
            let scene = Scene::find_spec(name).expect("the scene");
            let mut config = SolverConfig::default().with(|c| c.sleep_after = 0.2);
            rule.iter().for_each(|s| set(&mut config, s));
            let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new())).expect("a simulation");
            for step in 0..60 {
                simulation.step(scene.dt).expect("a step");
                let plan = simulation.plan().clone();
                let mut problem = simulation.problem().clone();
                let checked = CheckedStep::new(&mut problem, &plan.passes);
                assert!(checked.is_ok(), "{name} {rule:?} step {step}: {checked:?}");
            }
        }
    }
}

/// Where the rows of one kind of colors stand in the order: contacts, joints, bodies, rows of inertia, systems of joints or rows of turning
/// inertia.
fn places(problem: &StepProblem, kind: usize) -> std::ops::Range<usize> {
    let colors = &problem.blocks[0].colors()[kind];
    problem.colors[colors.start as usize] as usize..problem.colors[colors.end as usize] as usize
}

/// Puts a row into a place of one kind of colors.
fn put(problem: &mut StepProblem, kind: usize, place: usize, row: u32) {
    let first = places(problem, kind).start;
    problem.order[first + place] = row;
}

/// Gives the first of two blocks all constraints, and the second all bodies.
fn second_block(problem: &mut StepProblem) {
    let mut second = problem.blocks[0];
    second.contacts = [second.contacts[1]; 2];
    second.joints = [second.joints[1]; 2];
    second.direct = second.joints[1];
    let bodies = second.bodies;
    for kind in 0..4 {
        let first = (bodies + 2 * kind) as usize;
        problem.colors.insert(first, problem.colors[first]);
    }
    let first = &mut problem.blocks[0];
    [first.bodies, first.inertias, first.systems, first.turning] = [0, 2, 4, 6].map(|kind| bodies + kind);
    [second.bodies, second.inertias, second.systems, second.turning] = [1, 3, 5, 7].map(|kind| bodies + kind);
    problem.blocks.push(second);
}

/// Gives the second of two blocks everything.
fn first_block_of_nothing(problem: &mut StepProblem) {
    second_block(problem);
    let [first, second] = &mut problem.blocks[..] else { unreachable!("two blocks") };
    (second.contacts, first.contacts) = (first.contacts, [0; 2]);
    (second.joints, first.joints) = (first.joints, [second.contacts[1]; 2]);
    (second.direct, first.direct) = (first.direct, second.contacts[1]);
}

/// Gives the second of two blocks everything but the rows of inertia.
fn inertias_of_another_block(problem: &mut StepProblem) {
    first_block_of_nothing(problem);
    let own = problem.blocks[0].inertias as usize;
    problem.colors[own + 1] = problem.colors[own + 2];
}

#[test]
fn what_is_not_there_is_refused_by_row_and_field() {
    let (problem, plan) = step(&["joint_solver=sweeps"]);
    assert_eq!(refusal(problem.clone(), &plan.passes), None);
    let bodies = problem.bodies.len() as u32;
    type Break = fn(&mut StepProblem, u32);
    let cases: [(&str, Break); 44] = [
        ("masses: ", |p, _| p.masses.truncate(1)),
        ("impulses: ", |p, _| p.impulses.truncate(1)),
        ("joint_impulses: ", |p, _| p.joint_impulses.clear()),
        ("joint_totals: ", |p, _| p.joint_totals.push(JointImpulseRow::default())),
        ("params.body_count: ", |p, _| p.params.body_count += 1),
        ("params.point_count: ", |p, _| p.params.point_count += 1),
        ("params.joint_count: ", |p, _| p.params.joint_count += 1),
        ("params.axis_count: ", |p, _| p.params.axis_count += 1),
        ("joints[0].axis_count = 13", |p, _| p.joints[0].axis_count = 13),
        ("joints[0].first_axis = 0", |p, _| p.joints[0].axis_count = 1),
        ("joints[1].first_axis = 0: overlaps the axes of joints", |p, _| {
            p.axes.push(AxisRow::default());
            p.joint_impulses.push(JointImpulseRow::default());
            p.params.axis_count = 1;
            (p.joints[0].axis_count, p.joints[1].axis_count) = (1, 1);
        }),
        ("order: ", |p, _| p.inertias.push(p.inertias[0])),
        ("order: ", |p, _| {
            let bodies = p.blocks[0].bodies as usize;
            p.order.remove(p.colors[bodies] as usize);
            p.colors[bodies + 1..].iter_mut().for_each(|end| *end -= 1);
        }),
        ("contacts[1]: bodies", |p, n| p.contacts[1].body_b = n),
        ("contacts[2]: bodies", |p, _| p.contacts[2].body_a = u32::MAX),
        ("joints[0]: bodies", |p, n| p.joints[0].body_a = n),
        ("joints[1]: bodies", |p, n| p.joints[1].body_b = n),
        ("torques: 1, but", |p, _| p.torques.push(TorqueRow::NONE)),
        ("dampings: 1, but", |p, _| p.dampings.push(DampingRow::default())),
        ("inertias[0]: body", |p, n| p.inertias[0].body = n),
        ("inertias[1]: body", |p, _| p.inertias[1] = InertiaRow { ..p.inertias[0] }),
        ("contacts[0].point_count = 0", |p, _| p.contacts[0].point_count = 0),
        ("contacts[0].point_count = 5", |p, _| p.contacts[0].point_count = 5),
        ("contacts[0].first_point", |p, _| p.contacts[0].first_point = p.points.len() as u32),
        ("contacts[2].first_point = 0: overlaps the points of contacts[0]", |p, _| {
            p.contacts[2].first_point = 0;
            p.order = vec![0, 2];
            p.colors = vec![0, 2];
            p.in_one_block(1, p.blocks[0].substep);
        }),
        ("blocks[0]: colors", |p, _| p.blocks[0].contacts[1] = p.colors.len() as u32),
        ("blocks[0]: colors", |p, _| p.blocks[0].joints[0] += 1),
        ("blocks[0]: colors", |p, _| p.blocks[0].bodies += 1),
        ("blocks[0]: colors", |p, _| p.blocks[0].inertias -= 1),
        ("blocks: 0 colors, but there are", |p, _| p.blocks.clear()),
        ("blocks[1]: colors", |p, _| {
            second_block(p);
            // The contacts of the second end before they begin, and the joints begin there.
            p.blocks[1].contacts[1] -= 1;
            p.blocks[0].joints[0] -= 1;
        }),
        ("color 0: body", |p, _| second_block(p)),
        ("inertias[0]: body", |p, _| inertias_of_another_block(p)),
        ("colors: must ascend", |p, _| p.colors[1] = u32::MAX),
        ("colors: must ascend", |p, _| p.colors[0] = 1),
        ("colors: must ascend", |p, _| *p.colors.last_mut().expect("joints") += 1),
        ("colors: must ascend", |p, _| p.colors.clear()),
        ("order: contact 999999, but there are", |p, _| p.order[0] = 999_999),
        ("order: contact 0 occurs twice", |p, _| p.order[..2].fill(0)),
        ("order: joint 999999, but there are", |p, _| put(p, 1, 0, 999_999)),
        ("order: joint 0 occurs twice", |p, _| {
            let joints = places(p, 1);
            p.order[joints].fill(0);
        }),
        ("order: body 999999, but there are", |p, _| put(p, 2, 0, 999_999)),
        ("order: body 0 occurs twice", |p, _| put(p, 2, 1, 0)),
        ("color 0: body", |p, _| {
            // All contacts in one color.
            p.order = (0..p.contacts.len() as u32).collect();
            p.colors = vec![0, p.order.len() as u32];
            p.in_one_block(1, p.blocks[0].substep);
        }),
    ];
    for (start, spoil) in cases {
        let mut broken = problem.clone();
        spoil(&mut broken, bodies);
        let line = refusal(broken, &plan.passes).unwrap_or_else(|| panic!("{start}: was taken"));
        let known = line.starts_with(&format!("step problem: {start}"));
        assert!(known && !line.contains('\n'), "{start}: {line}");
    }
}

#[test]
fn systems_of_joints_that_are_not_there_are_refused_by_row_and_field() {
    let (problem, plan) = step(&["joint_solver=direct"]);
    assert_eq!(refusal(problem.clone(), &plan.passes), None);
    assert!(problem.systems.terms.len() > 1 && problem.turning.len() > 1);
    type Break = fn(&mut StepProblem);
    let cases: [(&str, Break); 21] = [
        ("systems: 1 with 0 softnesses", |p| p.systems.softness.clear()),
        ("systems: ", |p| p.systems.begins[1] -= 1),
        ("systems: ", |p| p.systems.begins[0] = 1),
        ("systems.nodes[0]: blocks", |p| p.systems.nodes[0].end_block = p.systems.nodes[0].first_block),
        ("systems.nodes[0]: blocks", |p| p.systems.nodes[0].end_block = u32::MAX),
        ("systems.nodes[1]: blocks", |p| p.systems.nodes[1].first_block += 1),
        ("systems.nodes[1]: blocks", |p| p.systems.blocks[p.systems.nodes[1].first_block as usize].node = 0),
        ("systems.blocks[1]: node 999999", |p| p.systems.blocks[1].node = 999_999),
        ("systems.blocks[", |p| p.systems.blocks[1].end_term = u32::MAX),
        ("systems.blocks[", |p| p.systems.terms[0] = [u32::MAX, 0]),
        ("systems.blocks[", |p| p.systems.terms[0] = [0, u32::MAX]),
        ("blocks[0]: the rows of its systems", |p| p.systems.nodes[0].joint = p.systems.nodes[1].joint),
        ("blocks[0]: the rows of its systems", |p| p.blocks[0].direct = p.blocks[0].joints[1]),
        ("blocks[0]: the rows of its systems", |p| p.systems.nodes[0].rows = 1),
        ("blocks[0]: the rows of its systems", |p| p.joints[0].is_loose = 1.0),
        ("blocks[0]: colors", |p| p.blocks[0].direct = p.blocks[0].joints[1] + 1),
        ("order: system 999999, but there are", |p| put(p, 4, 0, 999_999)),
        ("order: turning 0 occurs twice", |p| put(p, 5, 1, 0)),
        ("order: ", |p| p.turning.push(p.turning[0])),
        ("turning[0]: body", |p| {
            first_block_of_nothing(p);
            let own = p.blocks[0].turning as usize;
            p.colors[own + 1] = p.colors[own + 2];
        }),
        ("turning[1]: body", |p| p.turning[1].body = p.bodies.len() as u32),
    ];
    for (start, spoil) in cases {
        let mut broken = problem.clone();
        spoil(&mut broken);
        let line = refusal(broken, &plan.passes).unwrap_or_else(|| panic!("{start}: was taken"));
        let known = line.starts_with(&format!("step problem: {start}"));
        assert!(known && !line.contains('\n'), "{start}: {line}");
    }
    // A pass over systems goes over their color and no other.
    for wanted in [Kernel::BeginSystems, Kernel::TurnInertias] {
        let at = plan.passes.iter().position(|pass| pass.kernel == wanted).expect("a pass");
        let mut passes = plan.passes.clone();
        passes[at].colors = 0..1;
        let line = refusal(problem.clone(), &passes).expect("refused");
        assert!(line.contains(wanted.name()) && line.contains("colors 0..1"), "{line}");
    }
}

#[test]
fn a_joint_color_with_a_body_twice_is_refused() {
    let (mut problem, plan) = step(&[]);
    let (contacts, joints) = (problem.contact_colors().len(), places(&problem, 1));
    problem.order.truncate(joints.end);
    problem.colors.truncate(contacts + 1);
    problem.colors.push(joints.end as u32);
    problem.in_one_block(contacts as u32, problem.blocks[0].substep);
    let line = refusal(problem, &plan.passes[..0]).expect("refused");
    assert!(line.contains("can move, but occurs twice"), "{line}");
}

#[test]
fn passes_over_colors_that_are_not_there_are_refused() {
    let (problem, plan) = step(&["joint_solver=sweeps"]);
    let of = |wanted: fn(Kernel) -> bool| plan.passes.iter().position(|p| wanted(p.kernel)).expect("a pass");
    let contacts = of(|k| matches!(k, Kernel::SolveContacts(_)));
    let joints = of(|k| matches!(k, Kernel::SolveJoints(_)));
    let bodies = of(|k| matches!(k, Kernel::IntegratePositions { .. }));
    let (first_joint, all) = (problem.blocks[0].joints[0], problem.colors.len() as u32 - 1);
    #[allow(clippy::reversed_empty_ranges)]
    for (pass, colors) in [
        (contacts, 0..first_joint + 1),
        (contacts, first_joint..first_joint + 1),
        (contacts, 2..1),
        (joints, 0..1),
        (joints, first_joint..all + 1),
        (bodies, 0..1),
    ] {
        let mut passes = plan.passes.clone();
        passes[pass].colors = colors.clone();
        let line = refusal(problem.clone(), &passes).unwrap_or_else(|| panic!("pass {pass}, {colors:?}: was taken"));
        assert!(line.starts_with(&format!("pass {pass}, ")) && line.contains("must be within"), "{line}");
    }
}

#[test]
fn a_pass_with_patches_over_rows_without_is_refused_and_the_other_way_round() {
    let (without, plan) = step(&[]);
    let (with, patched) = step(&["friction_at=manifold"]);
    assert_eq!(refusal(with.clone(), &patched.passes), None);
    for (problem, passes) in [(without, patched.passes), (with, plan.passes)] {
        // The colors may differ as well: only the first pass over contacts counts here.
        let first = passes.iter().find(|p| matches!(p.kernel, Kernel::WarmStart(_) | Kernel::SolveContacts(_)));
        let pass = Pass { colors: 0..1, ..first.expect("a pass").clone() };
        let line = refusal(problem, &[pass]).expect("refused");
        assert!(line.contains("patch = "), "{line}");
    }
}

/// A backend would add to sums that are not there.
#[test]
fn sums_of_a_problem_without_room_for_them_are_refused() {
    let (mut problem, _) = step(&[]);
    let sums = Pass { kernel: Kernel::SumImpulses { first: false }, block: 0, colors: 0..1 };
    let line = refusal(problem.clone(), std::slice::from_ref(&sums)).expect("refused");
    assert_eq!(line, "pass 0, sum_impulses: needs totals, but the problem has none");
    let of_joints = Kernel::SumJointImpulses { first: false };
    let of_joints = Pass { kernel: of_joints, block: 0, colors: problem.joint_colors() };
    let line = refusal(problem.clone(), std::slice::from_ref(&of_joints)).expect("refused");
    assert_eq!(line, "pass 0, sum_joint_impulses: needs joint_totals, but the problem has none");
    problem.totals = problem.impulses.clone();
    problem.joint_totals = problem.joint_impulses.clone();
    assert_eq!(refusal(problem.clone(), &[sums, of_joints]), None);
    problem.totals.pop();
    let line = refusal(problem, &[]).expect("refused");
    assert!(line.contains("totals: "), "{line}");
}

#[test]
fn momentum_over_several_blocks_is_refused_and_so_is_a_pass_of_no_block() {
    let (mut problem, plan) = step(&["method=accelerated", "iterations=5"]);
    assert_eq!(refusal(problem.clone(), &plan.passes), None);
    let momentum = plan.passes.iter().find(|p| matches!(p.kernel, Kernel::Extrapolate { .. })).expect("a pass");
    let mut beyond = momentum.clone();
    beyond.block = 1;
    let line = refusal(problem.clone(), &[beyond]).expect("refused");
    assert!(line.starts_with("pass 0, extrapolate: block 1: must be less than 1"), "{line}");
    first_block_of_nothing(&mut problem);
    assert_eq!(refusal(problem.clone(), &[]), None);
    let line = refusal(problem, std::slice::from_ref(momentum)).expect("refused");
    assert!(line.contains("the problem must have one block"), "{line}");
}
