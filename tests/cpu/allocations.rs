//! A settled step allocates nothing.

use crate::common::counting;
use drystone::glam::Vec3;
use drystone::{Body, Cpu, Listen, Shape, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

/// Allocations of the steps that compute no contact, and of the others, in 40 steps of a pile of 500 boxes on `threads` threads.
/// `listens`: to all that there is, and with a sensor around the pile.
/// Of several threads each keeps memory of its own from the first task that it gets, in whichever step it wakes up for.
/// So the 40 steps are measured up to five times there, until those without a contact to compute ask for nothing.
fn allocations(threads: usize, config: SolverConfig, listens: bool) -> [usize; 2] {
    counting::in_pool(threads, || {
        let mut scene = Scene::find("pile", &["n=500".into()]).expect("the scene");
        if listens {
            scene.world.insert(Body::fixed().sensor(Shape::ball(3.0)));
        }
        let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new())).expect("good settings");
        if listens {
            let all = Listen { contacts: true, hits_above: Some(0.0), impulses: true };
            simulation.listen(all).expect("a good threshold");
        }
        for _ in 0..400 {
            simulation.step(scene.dt).expect("a step");
        }
        let mut asked = [0; 2];
        for _ in 0..if threads == 1 { 1 } else { 5 } {
            asked = [0; 2];
            let mut steps = [0; 2];
            for _ in 0..40 {
                let before = counting::asked();
                let stats = simulation.step(scene.dt).expect("a step");
                let which = usize::from(stats.computed > 0);
                asked[which] += counting::asked() - before;
                steps[which] += 1;
            }
            println!("{steps:?} steps without and with contacts computed: {asked:?} allocations");
            assert!(steps[0] >= 20 || steps[1] == 40, "the pile has not settled: {steps:?}");
            if asked[0] == 0 {
                break;
            }
        }
        asked
    })
}

#[test]
fn a_settled_step_allocates_nothing_and_one_that_computes_its_contacts_does() {
    for threads in [1, 2] {
        for listens in [false, true] {
            let asked = allocations(threads, SolverConfig::default().without_sleep(), listens);
            assert_eq!(asked[0], 0, "{threads} threads, listens: {listens}");
        }
    }
    let anew = SolverConfig::default().without_sleep().with(|c| c.recycle_distance = 0.0);
    assert!(allocations(1, anew, false)[1] > 0, "the counter counts nothing");
}

/// Each of many small simulations pays for its own rows, in its first step alone. One thread: detection keeps a workspace for each
/// thread, and a second one takes its first task in whichever step it wakes up for.
#[test]
fn a_small_simulation_allocates_in_its_first_step_alone() {
    let asked = counting::in_pool(1, || {
        let mut asked = [0; 2];
        for simulation_number in 0..20 {
            let mut world = World::new();
            world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
            for i in 0..10 {
                world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5 + i as f32, 0.0));
            }
            let mut simulation = Simulation::new(world).expect("a good world");
            for of_step in &mut asked {
                let before = counting::asked();
                simulation.step(1.0 / 60.0).expect("a step");
                *of_step = counting::asked() - before;
            }
            assert_eq!(asked[1], 0, "the second step of simulation {simulation_number} allocates");
        }
        asked
    });
    println!("allocations of the first step: {}", asked[0]);
    assert!((1..=250).contains(&asked[0]), "{} allocations in the first step", asked[0]);
}
