//! What the stages of a step cost on a settled pile of 1,000 boxes.

use criterion::{Criterion, criterion_group, criterion_main};
use drystone::{Backend, Reference, Scene, Simulation, SolverConfig};

fn settled() -> (Simulation, f32) {
    let scene = Scene::find("pile", &[]).expect("a scene of the catalogue");
    let backend = Box::new(Reference::<f32>::new());
    let mut simulation = Simulation::new(scene.world, SolverConfig::default(), backend).expect("good settings");
    for _ in 0..300 {
        simulation.step(scene.dt).expect("the reference runs anywhere");
    }
    (simulation, scene.dt)
}

fn stages(c: &mut Criterion) {
    let (mut simulation, dt) = settled();
    c.bench_function("detect, color, prepare and plan", |b| b.iter(|| simulation.next_problem(dt).0.contacts.len()));

    let (problem, plan) = simulation.next_problem(dt);
    let (problem, plan) = (problem.clone(), plan.clone());
    let mut reference = Reference::<f32>::new();
    c.bench_function("run on the reference", |b| {
        b.iter_batched(
            || problem.clone(),
            |mut p| reference.run(&mut p, &plan.passes),
            criterion::BatchSize::LargeInput,
        );
    });
}

criterion_group!(benches, stages);
criterion_main!(benches);
