//! Whole steps of the GPU against the reference.

#[path = "../common/efforts.rs"]
mod efforts;
#[path = "../common/settings.rs"]
mod settings;

use crate::common::difference::of_velocities;
use crate::common::gpu;
use crate::common::sample::one_in;
use crate::common::state::reference;
use crate::common::tolerance;
use drystone::backend::gpu::GpuOptions;
use drystone::config::Method;
use drystone::glam::Vec3;
use drystone::stages::backend::{CheckedStep, step_times};
use drystone::stages::plan::Kernel;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::Carry;
use drystone::stages::problem::ContactSummary;
use drystone::stages::problem::StepProblem;
use drystone::stats::median;
use drystone::{Backend, Body, Cpu, Error, Event, Gpu, Joint, Shape, Simulation, SolverConfig};
use drystone_conform::compare::{Difference, compare};
use drystone_scenes::{Scene, Spawners};
use settings::set;

tests! {
    exact_gpu {
        a_falling_pile_has_the_bits_of_the_reference_in_exact_mode,
        work_cut_as_for_hardware_has_the_bits_of_the_reference,
        every_rule_has_the_bits_of_the_reference_in_exact_mode,
        several_efforts_have_the_bits_of_the_reference_in_exact_mode,
        friction_per_manifold_without_friction_has_the_bits_of_the_reference,
        a_small_world_in_one_dispatch_has_the_bits_of_the_reference,
        joints_with_axes_have_the_bits_of_the_reference,
        sensors_tell_what_they_tell_on_the_reference,
    }
    exact_and_timed_gpu {
        kernels_that_are_timed_have_the_bits_of_the_reference,
    }
    any_gpu {
        plain_wgsl_lets_every_ball_pass_the_sensors,
        a_step_of_plain_wgsl_is_near_the_reference_during_a_fall,
        a_problem_too_large_for_the_adapter_is_refused_by_name,
        any_adapter_can_be_measured_against_the_processor,
        pipelines_stay_from_one_run_to_the_next,
        guarded_wgsl_runs_many_passes_to_their_end,
    }
    timed_gpu {
        a_device_tells_how_long_it_was_at_what,
    }
    no_gpu {
        a_mixture_has_work_for_every_kernel,
        a_step_that_lacks_one_sweep_of_one_color_is_found,
    }
}

fn pile() -> Scene {
    Scene::find("pile", &[]).expect("a scene of the catalogue")
}

fn after(backend: &mut dyn Backend, problem: &StepProblem, plan: &StepPlan) -> StepProblem {
    let mut result = problem.clone();
    backend.run(&mut result, &plan.passes).expect("the problem is small");
    result
}

/// The reference, and the GPU in exact mode.
fn opened(which: usize) -> drystone::Result<Box<dyn Backend>> {
    if which == 0 {
        return Ok(reference());
    }
    Ok(Box::new(gpu::exact()))
}

/// Fails unless the GPU in exact mode takes `scene` where the reference takes it, to the last bit.
fn assert_same(scene: &Scene, config: &SolverConfig, steps: u32, what: &str) {
    let found = compare(scene, config, &mut opened, steps, || ()).expect("both run");
    assert_eq!(found.steps.len(), steps as usize);
    assert_eq!(found.first, None, "{what}: {:?}", found.steps);
    assert!(found.steps.iter().all(|d| d.bodies == 0), "{what}");
}

fn a_falling_pile_has_the_bits_of_the_reference_in_exact_mode() {
    assert_same(&pile(), &SolverConfig::default().without_sleep(), 60, "pile");
}

/// A thread of hardware goes over one row, and one of a software adapter over some.
fn work_cut_as_for_hardware_has_the_bits_of_the_reference() {
    let mut config = SolverConfig::default().without_sleep();
    config.fuse_colors_below = 0;
    let scene = pile();
    let after = |backend: Box<dyn Backend>| {
        let mut simulation = Simulation::with(scene.world.clone(), config.clone(), backend).expect("good settings");
        (0..LANDED).for_each(|_| drop(simulation.step(scene.dt).expect("a step")));
        simulation.world
    };
    let (ours, theirs) = (after(reference()), after(Box::new(gpu::own_exact().cut_as_hardware())));
    assert_eq!(Difference::between(&ours, &theirs).bodies, 0);
    // Colors in one pass have a dispatch each if they have more rows than a workgroup of hardware has threads.
    config.fuse_colors_below = u32::MAX;
    let scene = Scene::find("pyramid", &["base=40".into()]).expect("a scene of the catalogue");
    let mut simulation =
        Simulation::with(scene.world, config, Box::new(gpu::own_exact().cut_as_hardware())).expect("good settings");
    let stats = simulation.step(scene.dt).expect("a step");
    let (dispatches, passes) = (stats.traffic.dispatches, simulation.plan().passes.len());
    assert!(dispatches > passes + 20, "{dispatches} dispatches of {passes} passes");
}

/// One body of every shape, all of which bounce, and a chain of long links: every kernel has work.
fn mixture() -> Scene {
    let mut scene = Scene::find("drop", &[]).expect("a scene of the catalogue");
    scene.world.bodies.iter_mut().for_each(|body| body.material.restitution = 0.3);
    let end = Vec3::new(0.0, 0.25, 0.0);
    let mut above = None;
    for i in 0..8 {
        let link = Body::dynamic().shape(Shape::cuboid(0.05, 0.25, 0.1)).position(10.0, 8.0 - 0.5 * i as f32, 0.0);
        let link = scene.world.insert(link.velocity(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)));
        scene.world.insert_joint(match above {
            None => Joint::to_world(link, end, Vec3::new(10.0, 8.25, 0.0)),
            Some(above) => Joint::new(above, -end, link, end),
        });
        above = Some(link);
    }
    scene
}

/// Settings that differ from the defaults in one rule each.
const RULES: [&[&str]; 17] = [
    &[],
    &["friction=none"],
    &["rules.slip_friction=true"],
    &["friction=box"],
    &["friction_at=manifold"],
    &["rules.friction_order=friction-first"],
    &["friction_sweeps=all"],
    &["relax=0", "stabilization=baumgarte"],
    &["relax=0", "stabilization=none", "rules.clamping=per-correction"],
    &["tolerance=0.01", "iterations=4", "relax=4"],
    &["relaxation=1.3"],
    &["rules.manifold_passes=2"],
    &["method=accelerated", "iterations=6", "relax=5"],
    &["method=accelerated", "iterations=8", "relax=0", "friction_at=manifold", "tolerance=0.01"],
    &["warm_start=false"],
    &["max_colors=2"],
    &["substeps=1", "iterations=10", "fuse_colors_below=0"],
];

/// By then every body of the mixture has met the ground.
const LANDED: u32 = 80;

fn every_rule_has_the_bits_of_the_reference_in_exact_mode() {
    for rule in RULES.iter().step_by(one_in(2)) {
        let mut config = SolverConfig::default().without_sleep();
        rule.iter().for_each(|assignment| set(&mut config, assignment));
        assert_same(&mixture(), &config, LANDED, &rule.join(" "));
    }
}

fn several_efforts_have_the_bits_of_the_reference_in_exact_mode() {
    assert_same(&efforts::islands(), &SolverConfig::default().without_sleep(), 20, "islands of several efforts");
}

fn friction_per_manifold_without_friction_has_the_bits_of_the_reference() {
    let config =
        SolverConfig::default().without_sleep().with(|c| c.friction_at = drystone::config::FrictionAt::Manifold);
    let scene = Scene::find("slide", &["mu=0".into()]).expect("a scene of the catalogue");
    assert_same(&scene, &config, 20, "slide without friction");
}

fn a_mixture_has_work_for_every_kernel() {
    let scene = mixture();
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), reference()).expect("good settings");
    for _ in 0..LANDED {
        simulation.step(scene.dt).expect("the reference runs");
    }
    let problem = simulation.problem();
    let swept = ContactSummary::of(problem);
    let bounces = problem.swept_contacts().any(|contact| contact.restitution > 0.0);
    assert!(swept.friction && bounces && swept.round);
    assert!(problem.contacts.len() >= 5, "{} contacts", problem.contacts.len());
    assert_eq!(problem.joints.len(), 8);
    assert!(problem.inertias.len() > 8);
}

/// How far `step` takes the velocities of a falling pile from where the reference takes them, at several moments between
/// the first contact and rest. Each step begins from the reference's state: trajectories part, single steps do not.
fn apart_during_a_fall(mut step: impl FnMut(&StepProblem, &StepPlan) -> StepProblem) -> Vec<f64> {
    let scene = pile();
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), reference()).expect("good settings");
    let mut apart = Vec::new();
    for now in 1..=100 {
        let (problem, plan) = simulation.next_problem(scene.dt).expect("a step");
        if !problem.contacts.is_empty() && now % 5 == 1 {
            apart.push(of_velocities(&after(&mut *reference(), &problem, &plan), &step(&problem, &plan)));
        }
        simulation.step(scene.dt).expect("the reference runs");
    }
    assert!(simulation.problem().contacts.len() > 3000, "the pile never came to lie");
    apart
}

fn largest(apart: &[f64]) -> f64 {
    apart.iter().copied().fold(0.0, f64::max)
}

fn a_step_of_plain_wgsl_is_near_the_reference_during_a_fall() {
    let mut gpu = gpu::plain();
    let apart = apart_during_a_fall(|problem, plan| after(&mut gpu, problem, plan));
    measured!("apart by {:.1e} in the middle, {:.1e} at most: {apart:?}", median(&apart), largest(&apart));
    assert!(median(&apart) <= tolerance::PLAIN_STEP, "{apart:?}");
    assert!(largest(&apart) <= tolerance::PLAIN_JUMP, "{apart:?}");
}

fn a_step_that_lacks_one_sweep_of_one_color_is_found() {
    let apart = apart_during_a_fall(|problem, plan| {
        let mut plan = plan.clone();
        let last = plan.passes.iter().rposition(|p| matches!(p.kernel, Kernel::SolveContacts(_))).expect("a sweep");
        plan.passes.remove(last);
        after(&mut *reference(), problem, &plan)
    });
    measured!("apart by {:.1e} in the middle, {:.1e} at most: {apart:?}", median(&apart), largest(&apart));
    assert!(median(&apart) > tolerance::PLAIN_STEP, "{apart:?}");
    assert!(largest(&apart) > tolerance::PLAIN_JUMP, "{apart:?}");
}

fn a_problem_too_large_for_the_adapter_is_refused_by_name() {
    let mut gpu = gpu::plain();
    let summary = gpu.summary().clone();
    // Zeros that nobody touches cost no memory.
    let colors = vec![0; (summary.buffer_limit / 4 + 1) as usize];
    let mut problem = StepProblem { colors, ..StepProblem::default() };
    problem.in_one_block(problem.colors.len() as u32 - 1, Default::default());
    let Err(Error::TooLarge(line)) = gpu.run(&mut problem, &[]) else { panic!("{summary} took it") };
    assert!(line.starts_with("the colors of this problem take "), "{line}");
    assert!(line.contains(&summary.name) && line.ends_with("use --backend cpu"), "{line}");
}

/// A backend, and of each of its steps whether the step went on from the rows of the one before.
struct Watched<B>(B, Vec<bool>);

impl<B: Backend> Backend for Watched<B> {
    fn name(&self) -> &'static str {
        self.0.name()
    }
    fn adapter(&self) -> String {
        self.0.adapter()
    }
    fn run_checked(&mut self, step: CheckedStep) -> drystone::Result<()> {
        self.0.run_checked(step)
    }
    fn step(&mut self, step: CheckedStep, carry: &Carry) -> drystone::Result<()> {
        self.1.push(carry.on_device);
        self.0.step(step, carry)
    }
    fn keeps_rows(&self) -> bool {
        self.0.keeps_rows()
    }
}

fn any_adapter_can_be_measured_against_the_processor() {
    let (mut cpu, mut gpu) = (Watched(Cpu::new(), Vec::new()), Watched(gpu::plain(), Vec::new()));
    let found = step_times(&mut cpu, &mut gpu, 1_000).expect("both run a small pile");
    measured!("{}: {found:?}", gpu.adapter());
    // Only the first step of the pile sends all of it.
    assert_eq!((cpu.1, gpu.1), (vec![false; 6], vec![false, true, true, true, true, true]));
}

fn a_device_tells_how_long_it_was_at_what() {
    let (gpu, bandwidth) = gpu::timed(gpu::own_plain());
    let scene = Scene::find("pile", &["n=60".into()]).expect("a scene of the catalogue");
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(gpu)).expect("good settings");
    for step in 1..=60 {
        let start = std::time::Instant::now();
        let stats = simulation.step(scene.dt).expect("a step");
        let (wall, sum) = (start.elapsed(), stats.kernels.iter().map(|k| k.time).sum::<std::time::Duration>());
        assert!(sum <= wall && !sum.is_zero(), "{sum:?} of {wall:?}");
        let planned = simulation.plan().passes.iter().map(|pass| pass.kernel.name());
        let carried = ["begin_bodies", "write_contacts", "begin_contacts"];
        let named = |name: &str| stats.kernels.iter().filter(|k| k.kernel == name).count();
        assert!(planned.clone().all(|name| named(name) == 1), "{:?}", stats.kernels);
        let known = |name: &str| planned.clone().any(|p| p == name) || (step > 1 && carried.contains(&name));
        assert!(stats.kernels.iter().all(|k| known(k.kernel)), "{:?}", stats.kernels);
        let bytes: u64 = stats.kernels.iter().map(|k| k.bytes).sum();
        assert_eq!(bytes, stats.bytes_moved);
    }
    assert!(bandwidth > 0.0 && bandwidth.is_finite(), "{bandwidth:e} B/s");
}

/// Standing and jointed scenes that one workgroup follows, and whether all of it can be one dispatch.
fn a_small_world_in_one_dispatch_has_the_bits_of_the_reference() {
    for name in ["tower", "stack", "chain", "slide", "roll"] {
        let scene = Scene::find(name, &[]).expect("a scene of the catalogue");
        assert_same(&scene, &SolverConfig::default().without_sleep(), 30, name);
    }
}

/// Hinges, ropes with winches, springs, limits and motors; with contacts, and in sweeps that end early or gain momentum.
fn joints_with_axes_have_the_bits_of_the_reference() {
    let config = SolverConfig::default().without_sleep();
    for name in ["four-bar", "drawbridge", "car", "ragdoll"] {
        let scene = Scene::find(name, &[]).expect("a scene of the catalogue");
        assert_same(&scene, &config, 40, name);
    }
    let scene = Scene::find("ragdoll", &["n=3".into()]).expect("a scene of the catalogue");
    let accelerated = config.clone().with(|c| (c.method, c.iterations, c.relax) = (Method::Accelerated, 4, 4));
    assert_same(&scene, &accelerated, 15, "ragdolls with momentum");
    let measured = config.with(|c| (c.tolerance, c.iterations) = (1e-3, 6));
    assert_same(&scene, &measured, 15, "ragdolls with a tolerance");
}

/// The events of a board whose bins count balls that come while it runs.
fn told_by_a_board(backend: Box<dyn Backend>) -> Vec<(u32, Event)> {
    const STEPS: u32 = 12 * 6 + 150;
    let scene = Scene::find("galton", &["n=6".into(), "rows=2".into(), "every=12".into()]).expect("a scene");
    let mut spawners = Spawners::new(&scene);
    let mut simulation = Simulation::with(scene.world, SolverConfig::default(), backend).expect("good settings");
    let mut told = Vec::new();
    for step in 0..STEPS {
        spawners.before_step(&mut simulation.world, scene.dt);
        simulation.step(scene.dt).expect("a step");
        told.extend(simulation.events().iter().map(|&event| (step, event)));
    }
    told
}

fn sensors_tell_what_they_tell_on_the_reference() {
    let (ours, theirs) = (told_by_a_board(reference()), told_by_a_board(Box::new(gpu::exact())));
    assert_eq!(ours, theirs);
}

/// Six balls enter and leave the gate, and each enters a bin. Which one depends on the last bits.
fn plain_wgsl_lets_every_ball_pass_the_sensors() {
    let told = told_by_a_board(Box::new(gpu::plain()));
    let entered = told.iter().filter(|(_, event)| matches!(event, Event::Entered { .. })).count();
    assert_eq!((entered, told.len() - entered), (12, 6));
}

/// The kernels of the mixture, each in dispatches of its own because they are timed.
fn kernels_that_are_timed_have_the_bits_of_the_reference() {
    let (gpu, _) = gpu::timed(gpu::own_exact());
    let scene = mixture();
    let mut ours = Simulation::with(scene.world.clone(), SolverConfig::default().without_sleep(), reference())
        .expect("good settings");
    let mut theirs =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(gpu)).expect("good settings");
    for _ in 0..LANDED {
        ours.step(scene.dt).expect("the reference runs");
        theirs.step(scene.dt).expect("the GPU runs");
    }
    assert_eq!(Difference::between(&ours.world, &theirs.world).bodies, 0);
}

fn pipelines_stay_from_one_run_to_the_next() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = || GpuOptions { cache: Some(folder.path().join("new")), ..GpuOptions::default() };
    let run = || {
        let gpu = Gpu::open(options()).expect("an adapter");
        let Scene { world, dt, .. } = pile();
        let mut simulation = Simulation::with(world, SolverConfig::default(), Box::new(gpu)).expect("a pile");
        simulation.step(dt).expect("a step");
        simulation.hash()
    };
    let first = run();
    let files = || -> Vec<std::fs::DirEntry> {
        std::fs::read_dir(folder.path().join("new")).map_or(Vec::new(), |files| files.flatten().collect())
    };
    let [file] = &files()[..] else { panic!("one file: {:?}", files()) };
    let kept = std::fs::read(file.path()).expect("the file");
    assert_eq!(run(), first);
    // A file that was changed counts as none, and the run writes it again.
    std::fs::write(file.path(), [&kept[..kept.len() - 1], &[0]].concat()).expect("a file");
    assert_eq!(run(), first);
    assert_eq!(std::fs::read(file.path()).expect("the file").len(), kept.len());
    assert_eq!(files().len(), 1);
}

/// 960 passes over a small world. In one dispatch the software adapter left them before the last ones.
fn guarded_wgsl_runs_many_passes_to_their_end() {
    let hash = |backend: Box<dyn Backend>| {
        let Scene { world, dt, .. } = Scene::find("pile", &["n=60".into()]).expect("a scene of the catalogue");
        let config = SolverConfig::default().with(|c| c.substeps = 160);
        let mut simulation = Simulation::with(world, config, backend).expect("a pile");
        for _ in 0..40 {
            simulation.step(dt).expect("a step");
        }
        simulation.hash()
    };
    let submission = std::time::Duration::from_secs(60);
    let options = GpuOptions { exact: true, guarded: true, submission, ..GpuOptions::default() };
    assert_eq!(hash(Box::new(Gpu::open(options).expect("an adapter"))), hash(reference()));
}
