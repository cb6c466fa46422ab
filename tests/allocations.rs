//! A settled step allocates nothing. One test only: what another one allocates would be counted, too.

#[path = "common/counting.rs"]
mod counting;

use drystone::{Body, Cpu, Listen, Scene, Shape, Simulation, SolverConfig};

/// Allocations of the steps that compute no contact, and of the others, of a pile of 500 boxes on `threads` threads.
/// `listens`: to all that there is, and with a sensor around the pile.
fn allocations(threads: usize, config: SolverConfig, listens: bool) -> [usize; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| {
        let mut scene = Scene::find("pile", &["n=500".into()]).expect("the scene");
        if listens {
            scene.world.add(Body::fixed().sensor(Shape::ball(3.0)));
        }
        let mut simulation = Simulation::new(scene.world, config, Box::new(Cpu::new())).expect("good settings");
        if listens {
            let all = Listen { contacts: true, hits_above: Some(0.0), impulses: true };
            simulation.listen(all).expect("a good threshold");
        }
        for _ in 0..400 {
            simulation.step(scene.dt).expect("a step");
        }
        let (mut asked, mut steps) = ([0; 2], [0; 2]);
        for _ in 0..40 {
            let before = counting::asked();
            let stats = simulation.step(scene.dt).expect("a step");
            let which = usize::from(stats.computed > 0);
            asked[which] += counting::asked() - before;
            steps[which] += 1;
        }
        println!("{steps:?} steps without and with contacts computed: {asked:?} allocations");
        assert!(steps[0] >= 20 || steps[1] == 40, "the pile has not settled: {steps:?}");
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
