//! Each island takes the substeps that its loads ask for, and no other island pays.

#[path = "common/efforts.rs"]
mod efforts;

use drystone::metrics::{in_place, rms_speed};

use drystone::stages::compare::compare;
use drystone::{Backend, Body, BodyKind, Cpu, Reference, Scene, Shape, Simulation, SolverConfig};

const DT: f32 = 1.0 / 60.0;

fn find(name: &str, parameters: &[&str]) -> Scene {
    Scene::find(name, &parameters.iter().map(|p| (*p).to_owned()).collect::<Vec<_>>())
        .expect("a scene of the catalogue")
}

fn started(scene: &Scene, config: SolverConfig) -> Simulation {
    Simulation::new(scene.world.clone(), config.without_sleep(), Box::new(Cpu::new())).expect("a good scene")
}

fn run(simulation: &mut Simulation, steps: u32) {
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

fn out_of_place(scene: &Scene, simulation: &Simulation) -> usize {
    let both = scene.world.bodies.iter().zip(&simulation.world.bodies);
    both.filter(|(before, after)| before.kind == BodyKind::Dynamic && !in_place(before, after)).count()
}

fn most_substeps(simulation: &Simulation) -> u32 {
    (0..simulation.world.bodies.len()).map(|body| simulation.substeps_of(body)).max().expect("a body")
}

/// Towers that fall with 8 substeps stand at the default, and their cubes overlap by half a millimeter at most.
#[test]
fn heavy_tops_stand_with_the_substeps_that_they_need() {
    for (name, parameters, least) in [
        ("tower", vec!["n=10", "top_ratio=1000"], 32),
        ("tower", vec!["n=20", "top_ratio=1000"], 64),
        ("tower", vec!["n=30", "top_ratio=100"], 16),
        ("mass-ratio", vec!["n=20", "ratio=1000"], 64),
    ] {
        let scene = find(name, &parameters);
        let mut fixed = started(&scene, SolverConfig::default().with(|c| c.max_substeps = c.substeps));
        run(&mut fixed, 1200);
        assert!(out_of_place(&scene, &fixed) > 0, "{name} {parameters:?} stands with 8 substeps");
        let mut simulation = started(&scene, SolverConfig::default());
        run(&mut simulation, 1200);
        let substeps = most_substeps(&simulation);
        assert!((least..=4 * least).contains(&substeps), "{name} {parameters:?}: {substeps} substeps");
        assert_eq!(out_of_place(&scene, &simulation), 0, "{name} {parameters:?}");
        let deepest = simulation.penetration().max;
        assert!(deepest < 0.5e-3, "{name} {parameters:?}: {deepest} m");
    }
}

/// An island without need takes the same steps, to the last bit, whatever the substeps of another island are.
#[test]
fn an_island_without_need_keeps_its_substeps() {
    let scene = efforts::islands();
    let mut simulation = started(&scene, SolverConfig::default());
    run(&mut simulation, 120);
    let substeps = |wanted: fn(&Body) -> bool| -> Vec<u32> {
        let bodies =
            simulation.world.bodies.iter().enumerate().filter(|(_, b)| b.kind == BodyKind::Dynamic && wanted(b));
        let mut all: Vec<u32> = bodies.map(|(i, _)| simulation.substeps_of(i)).collect();
        all.dedup();
        all
    };
    assert_eq!(substeps(|b| b.position.x < 15.0), [8], "the pile");
    assert_eq!(substeps(|b| (19.0..25.0).contains(&b.position.x)), [64], "the tower under 1000 times");
    assert_eq!(substeps(|b| (29.0..35.0).contains(&b.position.x)), [16], "the tower under 60 times");
    assert_eq!(substeps(|b| (35.0..65.0).contains(&b.position.x)), [8], "what hangs free");
    let mut fixed = started(&scene, SolverConfig::default().with(|c| c.max_substeps = c.substeps));
    run(&mut fixed, 120);
    for (a, b) in simulation.world.bodies.iter().zip(&fixed.world.bodies).filter(|(a, _)| a.position.x < 15.0) {
        assert_eq!((a.position, a.rotation, a.linear_velocity), (b.position, b.rotation, b.linear_velocity));
    }
}

#[test]
fn several_efforts_have_the_bits_of_the_reference_on_all_lanes_and_threads() {
    let scene = efforts::islands();
    for (threads, size) in [(1, usize::MAX), (1, 0), (3, 0), (3, usize::MAX)] {
        for which in 0..Cpu::each().count() {
            let lanes = || Box::new(Cpu::each().nth(which).expect("counted").dividing_above(size)) as Box<dyn Backend>;
            let mut open = |i: usize| Ok(if i == 0 { Box::new(Reference::<f32>::new()) as Box<_> } else { lanes() });
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let found = pool
                .install(|| compare(&scene, &SolverConfig::default().without_sleep(), &mut open, 40, || ()))
                .expect("both run");
            assert!(found.first.is_none(), "{threads} threads, {size}: {:?}", found.first);
            assert!(found.steps.iter().all(|d| d.bodies == 0));
        }
    }
}

/// A system of joints takes the substeps of the island of its bodies, and each chain stays together with its own.
#[test]
fn joints_that_are_solved_at_once_belong_to_the_block_of_their_bodies() {
    let scene = efforts::islands();
    let mut simulation = started(&scene, SolverConfig::default());
    for step in 0..120 {
        let stats = simulation.step(DT).expect("a step").clone();
        let problem = simulation.problem();
        assert_eq!((problem.systems.len(), stats.direct_joints), (2, 62), "step {step}");
        let systems = problem.blocks.iter().map(|block| problem.rows_of(&block.colors()[4]));
        let of_systems: Vec<u32> = systems.clone().flatten().copied().collect();
        assert_eq!(of_systems, [0, 1], "step {step}");
        // The chain whose end lies begins with 32 substeps, and needs less later.
        if step < 50 {
            assert!(systems.filter(|own| !own.is_empty()).count() == 2, "step {step}: one block has both");
        }
        let gap = simulation.world.joint_gap();
        assert!(gap < 1e-3, "step {step}: {gap} m");
    }
}

/// A class changes without a jolt: a load comes on, stays and is taken away.
#[test]
fn an_island_goes_up_with_a_load_and_down_after_it() {
    let mut scene = find("stack", &["n=6"]);
    let load = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).density(3e5).position(9.0, 0.5, 0.0);
    let load = scene.world.add(load);
    let mut simulation = started(&scene, SolverConfig::default());
    run(&mut simulation, 120);
    assert_eq!(most_substeps(&simulation), 8);
    let fastest = |simulation: &Simulation| rms_speed(&simulation.world);
    simulation.world.bodies[load].position = drystone::glam::Vec3::new(0.0, 6.5, 0.0);
    run(&mut simulation, 20);
    assert!(most_substeps(&simulation) >= 16, "{} substeps under the load", most_substeps(&simulation));
    run(&mut simulation, 280);
    let at_rest = fastest(&simulation);
    assert!(at_rest < 5e-3, "{at_rest} m/s under the load");
    let under_load = most_substeps(&simulation);
    run(&mut simulation, 300);
    assert_eq!(most_substeps(&simulation), under_load, "a load at rest keeps the class");
    let mut fixed = started(&scene, SolverConfig::default().with(|c| c.substeps = under_load));
    fixed.world.clone_from(&simulation.world);
    run(&mut fixed, 300);
    let swiftest = |simulation: &mut Simulation| {
        simulation.world.bodies[load].position = drystone::glam::Vec3::new(9.0, 0.5, 0.0);
        let speeds = (0..600).map(|_| {
            run(simulation, 1);
            rms_speed(&simulation.world)
        });
        speeds.fold(0.0, f64::max)
    };
    let (own, of_fixed) = (swiftest(&mut simulation), swiftest(&mut fixed));
    assert_eq!(most_substeps(&simulation), 8, "the load is gone");
    assert!(own < 1.2 * of_fixed, "{own} m/s after the load was taken away, {of_fixed} with {under_load} substeps");
    assert_eq!(out_of_place(&find("stack", &["n=6"]), &simulation), 0);
}
