//! Faults of a device: runs go on with the bits of a run without faults, and what cannot be done is refused in one line.

use std::time::Duration;

use drystone::backend::gpu::{Faults, GpuOptions, Loss};
use drystone::{Backend, Cpu, Error, Gpu, Reference, Simulation, SolverConfig, StepStats};
use drystone_conform::compare::Difference;
use drystone_scenes::Scene;

/// No submission is as long.
const HOURS: Duration = Duration::from_secs(10_000);

tests! {
    exact_gpu {
        a_device_that_is_lost_between_two_steps_costs_no_bit,
        a_device_that_is_lost_during_a_step_costs_no_bit,
        the_processor_goes_on_after_the_third_device_without_a_lost_bit,
        a_device_that_is_lost_inside_a_long_plan_costs_no_bit,
        a_long_plan_in_several_submissions_has_the_bits_of_one,
        a_pile_that_outgrows_a_buffer_is_refused_and_another_backend_goes_on_with_its_bits,
    }
    any_gpu {
        a_problem_without_a_step_before_it_that_loses_its_device_is_refused_as_lost,
        memory_that_is_not_there_is_refused_in_one_line,
        a_mistake_in_a_shader_is_one_line,
        no_submission_of_a_plan_of_thousands_of_passes_takes_half_of_it,
    }
}

fn pile(n: usize) -> Scene {
    Scene::find("pile", &[format!("n={n}")]).expect("a scene of the catalogue")
}

/// Exact mode, each step in one submission: losses are counted in submissions, and a plan is cut by time on a busy machine.
fn exact() -> GpuOptions {
    GpuOptions { exact: true, submission: HOURS, ..GpuOptions::default() }
}

fn losses(losses: &[(u32, bool)]) -> Faults {
    let losses = losses.iter().map(|&(submission, during)| Loss { submission, during }).collect();
    Faults { losses, ..Faults::default() }
}

fn open(options: GpuOptions) -> Box<dyn Backend> {
    Box::new(Gpu::open(options).unwrap_or_else(|e| panic!("{e}")))
}

/// Runs a scene on the reference and on a device, asserts the same bits after every step, and returns the steps with a fault, the lines and
/// the name of the backend in the end.
fn run(scene: &Scene, config: &SolverConfig, options: GpuOptions, steps: u32) -> (Vec<(u32, String)>, &'static str) {
    let [mut ours, mut theirs] = [Box::new(Reference::<f32>::new()) as Box<dyn Backend>, open(options)]
        .map(|backend| Simulation::with(scene.world.clone(), config.clone(), backend).expect("good settings"));
    let mut faults = Vec::new();
    for step in 1..=steps {
        ours.step(scene.dt).expect("the reference runs");
        let stats = theirs.step(scene.dt).unwrap_or_else(|e| panic!("step {step}: {e}"));
        faults.extend(stats.fault.map(|line| (step, line)));
        let apart = Difference::between(&ours.world, &theirs.world);
        assert_eq!(apart.bodies, 0, "step {step}: {apart:?}");
    }
    assert_same_impulses(&mut ours, &mut theirs);
    (faults, theirs.backend().name())
}

fn assert_same_impulses(ours: &mut Simulation, theirs: &mut Simulation) {
    let [ours, theirs] = [ours, theirs].map(|s| s.manifolds().map(|m| format!("{m:?}")).collect::<Vec<_>>());
    assert!(ours.len() > 20, "{} manifolds", ours.len());
    let first = ours.iter().zip(&theirs).find(|(a, b)| a != b);
    assert!(ours.len() == theirs.len() && first.is_none(), "{first:?}");
}

fn assert_one_line(line: &str, parts: &[&str]) {
    assert!(line.lines().count() == 1 && parts.iter().all(|part| line.contains(part)), "{line}");
}

/// By 60 steps the pile lies, and its bodies have impulses that a run without them would lack.
fn a_device_that_is_lost_between_two_steps_costs_no_bit() {
    let config = SolverConfig::default().without_sleep();
    let options = GpuOptions { faults: losses(&[(60, false)]), ..exact() };
    let (faults, name) = run(&pile(60), &config, options, 75);
    let [(61, line)] = &faults[..] else { panic!("{faults:?}") };
    assert_one_line(line, &["the device was lost (destroyed)", "gpu (", "repeats the step and continues"]);
    assert_eq!(name, "gpu");
}

fn a_device_that_is_lost_during_a_step_costs_no_bit() {
    let config = SolverConfig::default().without_sleep();
    for submission in [1, 2, 60] {
        let options = GpuOptions { faults: losses(&[(submission, true)]), ..exact() };
        let (faults, name) = run(&pile(60), &config, options, submission + 15);
        assert_eq!(faults.iter().map(|fault| fault.0).collect::<Vec<_>>(), [submission], "{faults:?}");
        assert_eq!(name, "gpu");
    }
}

fn the_processor_goes_on_after_the_third_device_without_a_lost_bit() {
    let config = SolverConfig::default().without_sleep();
    // The second device is lost in the step that it repeats, the third one ten steps later.
    let options = GpuOptions { faults: losses(&[(50, true), (1, true), (11, false)]), ..exact() };
    let (faults, name) = run(&pile(60), &config, options, 75);
    let [(50, twice), (61, line)] = &faults[..] else { panic!("{faults:?}") };
    assert_eq!(twice.matches("was lost").count(), 2, "{twice}");
    assert_one_line(line, &["cpu ("]);
    assert_eq!(name, "cpu");
}

fn cut() -> GpuOptions {
    GpuOptions { submission: Duration::from_micros(500), ..exact() }
}

fn a_device_that_is_lost_inside_a_long_plan_costs_no_bit() {
    // The first step has one submission, the others some more.
    let options = GpuOptions { faults: losses(&[(30, false), (25, true)]), ..cut() };
    let (faults, _) = run(&pile(60), &SolverConfig::default().without_sleep(), options, 40);
    assert!(faults.len() == 2 && faults[0].0 < 20, "{faults:?}");
}

fn a_long_plan_in_several_submissions_has_the_bits_of_one() {
    let scene = pile(200);
    for substeps in [8, 40] {
        let config = SolverConfig::default().without_sleep().with(|c| c.substeps = substeps);
        run(&scene, &config, cut(), 20);
        let mut simulation = Simulation::with(scene.world.clone(), config, open(cut())).expect("good settings");
        let traffic: Vec<_> = (0..10).map(|_| simulation.step(scene.dt).expect("a step").traffic).collect();
        let most = traffic.iter().map(|t| t.submissions).max();
        measured!(
            "{substeps} substeps: {:?}",
            traffic.iter().map(|t| (t.submissions, t.dispatches)).collect::<Vec<_>>()
        );
        assert!(most > Some(1), "{traffic:?}");
    }
}

/// The host measures, on a machine of any speed: the device is asked for submissions of a 16th of what the whole step takes.
fn no_submission_of_a_plan_of_thousands_of_passes_takes_half_of_it() {
    // A step that holds a software adapter for seconds.
    let scene = pile(400);
    let config = SolverConfig::default().without_sleep().with(|c| (c.substeps, c.fuse_colors_below) = (400, 0));
    let begun = |submission: Duration, steps: usize| {
        let gpu = open(GpuOptions { submission, ..GpuOptions::default() });
        let mut simulation = Simulation::with(scene.world.clone(), config.clone(), gpu).expect("good settings");
        // The first step compiles, and the second knows how fast the device is.
        (0..2).for_each(|_| drop(simulation.step(scene.dt).expect("a step")));
        (0..steps).map(|_| simulation.step(scene.dt).expect("a step")).collect::<Vec<_>>()
    };
    let whole = begun(HOURS, 1).remove(0);
    assert_eq!(whole.traffic.submissions, 1);
    // A machine with other work lets the host wait now and then, and a step may compile: the fastest of some steps counts.
    let asked = whole.times.run / 16;
    let steps = begun(asked, 5);
    let share = |stats: &StepStats| stats.traffic.longest_submission.as_secs_f64() / stats.times.run.as_secs_f64();
    let best = steps.iter().min_by_key(|stats| stats.times.run).expect("some steps");
    measured!("{:?} of {:?}, {} submissions", share(best), best.times.run, best.traffic.submissions);
    assert!(share(best) < 0.5, "{:?} in {:?}", best.traffic, best.times.run);
    // The whole step may have taken longer than a step takes now.
    assert!(
        best.times.run < 8 * best.traffic.submissions as u32 * asked,
        "{:?} in {:?}, asked {asked:?}",
        best.traffic,
        best.times.run
    );
}

fn a_problem_without_a_step_before_it_that_loses_its_device_is_refused_as_lost() {
    let scene = pile(27);
    let mut simulation = Simulation::new(scene.world.clone()).expect("good settings");
    let (problem, plan) = simulation.next_problem(scene.dt).expect("a step");
    let mut gpu = open(GpuOptions { faults: losses(&[(1, true)]), ..GpuOptions::default() });
    let mut changed = problem.clone();
    for _ in 0..2 {
        let Err(Error::Lost(line)) = gpu.run(&mut changed, &plan.passes) else { panic!("it ran") };
        assert_one_line(&line, &["the device was lost"]);
        assert!(changed == problem, "a step that failed changed its problem");
    }
}

fn a_pile_that_outgrows_a_buffer_is_refused_and_another_backend_goes_on_with_its_bits() {
    let (scene, config) = (pile(60), SolverConfig::default().without_sleep());
    // Room for what falls, and not for what lies.
    let options = GpuOptions { buffer_limit: 20_000, ..exact() };
    let [mut ours, mut theirs] = [Box::new(Reference::<f32>::new()) as Box<dyn Backend>, open(options)]
        .map(|backend| Simulation::with(scene.world.clone(), config.clone(), backend).expect("good settings"));
    let (mut refused, mut before) = (None, 0);
    for step in 1..=75 {
        ours.step(scene.dt).expect("the reference runs");
        if let Err(error) = theirs.step(scene.dt) {
            let Error::TooLarge(line) = error else { panic!("step {step}: {error}") };
            assert_one_line(&line, &["of this problem take", "use --backend cpu"]);
            assert!(refused.is_none(), "twice");
            (refused, before) = (Some(step), step - 1);
            theirs.set_backend(Box::new(Cpu::new()));
            theirs.step(scene.dt).expect("the processor takes it");
        }
        let apart = Difference::between(&ours.world, &theirs.world);
        assert_eq!(apart.bodies, 0, "step {step}, refused in step {refused:?}: {apart:?}");
    }
    assert!(refused.is_some() && before > 10, "refused in step {refused:?}");
    assert_same_impulses(&mut ours, &mut theirs);
}

fn memory_that_is_not_there_is_refused_in_one_line() {
    let scene = pile(27);
    let gpu = open(GpuOptions { memory: 10_000, ..GpuOptions::default() });
    let mut simulation = Simulation::with(scene.world.clone(), SolverConfig::default(), gpu).expect("good settings");
    let Err(Error::TooLarge(line)) = simulation.step(scene.dt) else { panic!("there was memory") };
    assert_one_line(&line, &["cannot allocate ", " B for the ", "use --backend cpu"]);
    simulation.set_backend(Box::new(Cpu::new()));
    simulation.step(scene.dt).expect("the processor has memory");
}

fn a_mistake_in_a_shader_is_one_line() {
    let scene = pile(27);
    type Mistake = fn(&str, String) -> String;
    let mistakes: [(Mistake, &str); 2] = [
        // More threads than any device promises: wgpu refuses the pipeline.
        (|_, source| source.replace("@workgroup_size(WORKGROUP)", "@workgroup_size(4096)"), "workgroup"),
        (|_, source| source.replace("fn main(", "fn other("), "main"),
    ];
    for (shader, part) in mistakes {
        let faults = Faults { shader: Some(shader), ..Faults::default() };
        let gpu = open(GpuOptions { faults, ..GpuOptions::default() });
        let mut simulation =
            Simulation::with(scene.world.clone(), SolverConfig::default(), gpu).expect("good settings");
        let error = simulation.step(scene.dt).expect_err("a wrong shader");
        assert!(matches!(error, Error::Adapter(_)), "{error:?}");
        assert_one_line(&error.to_string(), &[part]);
    }
}
