//! Costs of the pieces of a step: detection, coloring and rows a manifold, each kernel a constraint and sweep.
//! Whole steps are what `drystone bench` measures.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use drystone::config::FrictionAt;
use drystone::stages::collide::Detector;
use drystone::stages::effort::Effort;
use drystone::stages::graph::{ConstraintGraph, Edge, IMMOVABLE};
use drystone::stages::plan::{Kernel, Pass};

use drystone::stages::plan::StepPlan;
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{ContactRows, JointRows, begin, lay_out};
use drystone::{Backend, BodyKind, Cpu, Reference, Simulation, SolverConfig};
use drystone_scenes::Scene;

/// Sweeps of a kernel in one run, so that taking the rows over hardly counts.
const SWEEPS: usize = 50;

fn settled(scene: &str, config: SolverConfig) -> (Simulation, f32) {
    let scene = Scene::find_spec(scene).expect("a scene of the catalogue");
    let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new())).expect("good settings");
    for _ in 0..240 {
        simulation.step(scene.dt).expect("the processor runs anywhere");
    }
    (simulation, scene.dt)
}

fn stages(c: &mut Criterion) {
    let (mut simulation, dt) = settled("pile:n=1000", SolverConfig::default().without_sleep());
    let (world, config) = (simulation.world.clone(), SolverConfig::default().without_sleep());
    let anew = config.clone().with(|c| c.recycle_distance = 0.0);
    let mut group = c.benchmark_group("a manifold");
    group.throughput(Throughput::Elements(simulation.next_problem(dt).expect("a step").0.contacts.len() as u64));

    let mut detector = Detector::new(&world);
    detector.detect(&world, &config, dt, &[], None);
    group.bench_function("detect, reused", |b| b.iter(|| detector.detect(&world, &config, dt, &[], None)));
    let mut fresh = Detector::new(&world);
    group.bench_function("detect, computed", |b| b.iter(|| fresh.detect(&world, &anew, dt, &[], None)));

    let movable = |body: u32| if world.bodies[body as usize].kind == BodyKind::Dynamic { body } else { IMMOVABLE };
    let touching = detector.pairs().filter(|p| p.is_touching());
    let mut edges: Vec<_> =
        touching.map(|p| Edge { a: movable(p.body_a), b: movable(p.body_b), color: None, rank: p.rank() }).collect();
    let (mut graph, bodies) = (ConstraintGraph::default(), world.bodies.len());
    group.bench_function("color, from nothing", |b| {
        b.iter_batched_ref(
            || edges.clone(),
            |edges| graph.color(bodies, edges, config.max_colors),
            BatchSize::LargeInput,
        );
    });
    graph.color(bodies, &mut edges, config.max_colors);
    group.bench_function("color, kept", |b| b.iter(|| graph.color(bodies, &mut edges, config.max_colors)));

    let mut problem = StepProblem::default();
    let mut contacts = ContactRows::default();
    let effort = Effort::default();
    begin(&world, &[], &config, &mut problem);
    contacts.follow(&world, &mut detector);
    contacts.color(&world, config.max_colors);
    group.bench_function("rows, written again", |b| {
        b.iter(|| {
            contacts.write_again();
            contacts.write(&world, &detector, &config, &effort, dt, &mut problem);
        });
    });
    group.bench_function("rows, carried", |b| {
        b.iter(|| contacts.write(&world, &detector, &config, &effort, dt, &mut problem));
    });
    let joints = JointRows::default();
    lay_out(&world, &[], &config, &effort, dt, (&contacts, &joints), &mut problem);
    group.bench_function("plan", |b| b.iter(|| StepPlan::new(&config, &problem)));
}

fn kernels(c: &mut Criterion) {
    let at_manifold = SolverConfig::default().without_sleep().with(|c| c.friction_at = FrictionAt::Manifold);
    for (title, scene, config) in [
        ("pile:n=1000", "pile:n=1000", SolverConfig::default().without_sleep()),
        ("pile:n=1000, friction a manifold", "pile:n=1000", at_manifold),
        ("joint-grid:n=40", "joint-grid:n=40", SolverConfig::default().without_sleep()),
    ] {
        let (mut simulation, dt) = settled(scene, config);
        let (problem, plan) = simulation.next_problem(dt).expect("a step");
        let mut kernels: Vec<Kernel> = Vec::new();
        for pass in &plan.passes {
            if !kernels.contains(&pass.kernel) {
                kernels.push(pass.kernel);
            }
        }
        let mut group = c.benchmark_group(title);
        for kernel in kernels {
            // All the passes of one sweep, over and over.
            let of_kernel = plan.passes.iter().filter(|p| p.kernel == kernel);
            let mut sweep: Vec<&Pass> = Vec::new();
            of_kernel.for_each(|pass| sweep.extend((!sweep.contains(&pass)).then_some(pass)));
            let passes: Vec<_> = sweep.iter().copied().cycle().take(SWEEPS * sweep.len()).cloned().collect();
            let of_pass =
                |p: &&Pass| if p.colors.is_empty() { problem.bodies.len() } else { problem.rows_of(&p.colors).len() };
            let elements = sweep.iter().map(of_pass).sum::<usize>() * SWEEPS;
            group.throughput(Throughput::Elements(elements as u64));
            let backends: [Box<dyn Backend>; 2] = [Box::new(Reference::<f32>::new()), Box::new(Cpu::new())];
            for mut backend in backends {
                group.bench_function(format!("{kernel} on {}", backend.name()), |b| {
                    b.iter_batched_ref(
                        || problem.clone(),
                        |problem| backend.run(problem, &passes).expect("the processor runs anywhere"),
                        BatchSize::LargeInput,
                    );
                });
            }
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(std::time::Duration::from_secs(1)).warm_up_time(std::time::Duration::from_millis(300));
    targets = stages, kernels
}
criterion_main!(benches);
