//! Worlds beside each other: each goes its own way to the last bit, as if it were alone.

use crate::common::state::{all_bits, bits, reference};
use drystone::config::FrictionAt;
use drystone::{Backend, BodyHandle, Cpu, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

fn scene(name: &str, parameters: &[&str], worlds: usize, vary: Option<&str>) -> Scene {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    Scene::find_worlds(name, &parameters, worlds, vary).expect("the scene")
}

fn end(scene: &Scene, backend: fn() -> Box<dyn Backend>, config: &SolverConfig, steps: u32) -> World {
    let mut simulation = Simulation::with(scene.world.clone(), config.clone(), backend()).expect("a simulation");
    for _ in 0..steps {
        simulation.step(scene.dt).expect("a step");
    }
    simulation.world
}

#[test]
fn every_copy_of_a_world_goes_as_it_goes_alone() {
    let at_manifold = SolverConfig::default().without_sleep().with(|c| c.friction_at = FrictionAt::Manifold);
    let asleep = SolverConfig::default().with(|c| c.sleep_after = 0.5);
    for (name, parameters, config, steps) in [
        ("pile", &["n=60"][..], SolverConfig::default().without_sleep(), 90),
        ("pile", &["n=27"], at_manifold, 60),
        ("tower", &["n=5"], asleep, 120),
        ("bridge", &["planks=6", "boxes=2"], SolverConfig::default().without_sleep(), 60),
        ("drop", &[], SolverConfig::default().without_sleep(), 60),
    ] {
        for backend in [reference, cpu] {
            let alone = end(&scene(name, parameters, 1, None), backend, &config, steps);
            let alone = all_bits(&alone);
            let all = end(&scene(name, parameters, 5, None), backend, &config, steps);
            for (k, bodies) in all.worlds().into_iter().enumerate() {
                assert_eq!(bits(&all, bodies.into_iter().map(BodyHandle::index)), alone, "{name}: world {k}");
            }
        }
    }
}

/// The neighbors come, touch and part at other times, and take no part in it.
#[test]
fn a_world_does_not_see_what_other_worlds_do() {
    let alone: Vec<_> = (1..=4)
        .map(|seed| {
            end(
                &scene("pile", &["n=60", &format!("seed={seed}")], 1, None),
                cpu,
                &SolverConfig::default().without_sleep(),
                90,
            )
        })
        .collect();
    let all = end(&scene("pile", &["n=60"], 4, Some("seed")), cpu, &SolverConfig::default().without_sleep(), 90);
    for (bodies, alone) in all.worlds().into_iter().zip(&alone) {
        assert_eq!(bits(&all, bodies.into_iter().map(BodyHandle::index)), all_bits(alone));
    }
    assert_ne!(all_bits(&alone[0]), all_bits(&alone[1]));
}

#[test]
fn the_number_of_threads_changes_no_bit_of_many_worlds() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let world =
                end(&scene("pile", &["n=30"], 12, Some("seed")), cpu, &SolverConfig::default().without_sleep(), 80);
            all_bits(&world)
        })
    };
    let one = run(1);
    assert!([2, 5].into_iter().all(|threads| run(threads) == one));
}

/// Without worlds the towers would stand in each other.
#[test]
fn bodies_of_different_worlds_never_meet() {
    let mut towers = scene("tower", &["n=3"], 3, None);
    let apart = SolverConfig::default().without_sleep();
    let contacts = |scene: &Scene| {
        let mut simulation = Simulation::with(scene.world.clone(), apart.clone(), cpu()).expect("a simulation");
        let stats = simulation.step(scene.dt).expect("a step");
        (stats.manifolds, simulation.penetration().max)
    };
    let (manifolds, deepest) = contacts(&towers);
    assert!(manifolds == 9 && deepest < 1e-3, "{manifolds} {deepest}");
    towers.world.bodies = towers.world.bodies.iter().cloned().collect();
    let (manifolds, deepest) = contacts(&towers);
    assert!(manifolds > 30 && deepest > 0.5, "{manifolds} {deepest}");
}

#[test]
fn what_cannot_stand_beside_each_other_is_refused_in_one_line() {
    let refusal = |name: &str, worlds: usize, vary: Option<&str>| {
        Scene::find_worlds(name, &[], worlds, vary).expect_err("a refusal").to_string()
    };
    assert_eq!(
        refusal("tower", 2, Some("offset")),
        "tower has no whole-number parameter \"offset\" to vary; it has: n"
    );
    assert!(
        refusal(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/two_boxes.json"), 2, Some("n"))
            .contains("being a file")
    );
    assert!(refusal("pile", 0, None).starts_with("0 worlds of 1000 dynamic bodies"));
    assert!(refusal("pile", 1_000_000, None).contains("at most 4000000 such bodies"));
    // The ends of ranges hold for every world.
    assert!(refusal("arch", 200, Some("voussoirs")).contains("must be a whole number from 3 to 201"));
}
