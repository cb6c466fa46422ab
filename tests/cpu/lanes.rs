//! Sixteen lanes and all threads against one constraint at a time: the same bits.

use crate::common::sample::one_in;
use crate::common::settings::set;
use drystone::glam::Vec3;
use drystone::{Backend, Body, Cpu, Reference, Shape, Simulation, SolverConfig, World};
use drystone_conform::compare::{Comparison, compare};
use drystone_scenes::Scene;

/// Compares a backend with the reference on a scene of the catalogue, on a pool of `threads`.
fn against_reference(
    backend: impl Fn() -> Box<dyn Backend> + Sync,
    scene: &str,
    settings: &[&str],
    steps: u32,
    threads: usize,
) -> Comparison {
    let scene = Scene::find_spec(scene).unwrap();
    let mut config = SolverConfig::default().without_sleep();
    settings.iter().for_each(|s| set(&mut config, s));
    let mut open = |which: usize| Ok(if which == 0 { Box::new(Reference::<f32>::new()) as Box<_> } else { backend() });
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| compare(&scene, &config, &mut open, steps, || ()).unwrap())
}

fn best() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

/// The backend on each instruction set that there is.
fn each() -> impl Iterator<Item = impl Fn() -> Box<dyn Backend> + Sync> {
    (0..Cpu::each().count()).map(|i| move || Box::new(Cpu::each().nth(i).expect("counted")) as Box<_>)
}

/// The sets of this processor that have lanes: the tests below can try no others.
#[test]
fn the_sets_that_are_tried_are_those_that_the_processor_has() {
    let tried: Vec<String> = each().map(|backend| backend().adapter()).collect();
    println!("tried: {}", tried.join("; "));
    let has = |set: &str| tried.iter().any(|adapter| adapter.contains(set));
    let baseline = if cfg!(target_arch = "x86_64") { "SSE2" } else { "portable" };
    assert!(has(baseline), "{tried:?}");
    #[cfg(target_arch = "x86_64")]
    {
        let known = [
            ("AVX2", std::arch::is_x86_feature_detected!("avx2")),
            ("AVX-512", std::arch::is_x86_feature_detected!("avx512f")),
        ];
        for (set, expected) in known {
            assert_eq!(has(set), expected, "{set}: {tried:?}");
            if !expected {
                eprintln!("not tried: {set}, which this processor lacks");
            }
        }
        assert!(best().adapter().contains(tried.last().expect("one at least")), "{}", best().adapter());
    }
}

#[track_caller]
fn same_bits(comparison: &Comparison) {
    assert!(comparison.first.is_none(), "{:?}", comparison.first);
    assert!(comparison.steps.iter().all(|s| s.bodies == 0));
}

#[test]
fn a_falling_pile_has_the_same_bits_on_one_thread_and_on_two() {
    for threads in [1, 2] {
        same_bits(&against_reference(best, "pile:n=1500", &[], 40, threads));
    }
}

#[test]
fn every_instruction_set_has_the_same_bits() {
    for backend in each() {
        println!("{}", backend().adapter());
        same_bits(&against_reference(&backend, "pile:n=200", &[], 40, 1));
        same_bits(&against_reference(&backend, "drop", &[], 60, 2));
    }
}

#[test]
fn every_rule_has_the_same_bits() {
    let rules: [&[&str]; 11] = [
        &["friction=none"],
        &["rules.slip_friction=true"],
        &["rules.manifold_passes=3"],
        &["friction=box"],
        &["friction_at=manifold"],
        &["rules.friction_order=friction-first", "friction_sweeps=all"],
        &["stabilization=baumgarte", "relax=0", "rules.clamping=per-correction"],
        &["tolerance=0.001", "iterations=8"],
        &["method=accelerated", "iterations=6", "relax=5"],
        &["method=accelerated", "tolerance=0.001", "iterations=8", "friction_at=manifold"],
        &["relaxation=1.2", "max_colors=2"],
    ];
    for settings in rules {
        for backend in each() {
            println!("{settings:?}, {}", backend().adapter());
            same_bits(&against_reference(backend, "pile:n=150", settings, 40, 2));
        }
    }
}

/// The plan left out what friction per manifold needs, the rows kept it, and lanes took it for a contact point.
#[test]
fn friction_per_manifold_without_friction_has_the_same_bits() {
    for backend in each() {
        same_bits(&against_reference(&backend, "slide:mu=0", &["friction_at=manifold"], 20, 1));
        same_bits(&against_reference(&backend, "pile:n=50", &["friction_at=manifold", "friction=none"], 40, 2));
        same_bits(&against_reference(&backend, "slide:mu=0", &["friction_at=manifold", "friction_sweeps=all"], 20, 1));
    }
}

/// No pass over a scene without restitution keeps bounces.
#[test]
fn bounces_that_no_pass_keeps_stay_in_the_rows() {
    let scene = Scene::find_spec("pile:n=50").unwrap();
    let mut simulation = Simulation::with(scene.world, SolverConfig::default().without_sleep(), best()).unwrap();
    for _ in 0..40 {
        simulation.step(scene.dt).unwrap();
    }
    let (mut problem, plan) = simulation.next_problem(scene.dt).unwrap();
    assert!(problem.swept_contacts().count() > 0 && !plan.passes.iter().any(|pass| pass.kernel.keeps_bounces()));
    problem.impulses.iter_mut().for_each(|impulse| impulse.bounce = 0.5);
    for backend in each() {
        let mut solved = problem.clone();
        backend().run(&mut solved, &plan.passes).unwrap();
        assert!(solved.impulses.iter().all(|impulse| impulse.bounce == 0.5), "{}", backend().adapter());
    }
}

#[test]
fn every_shape_and_unequal_moments_of_inertia_have_the_same_bits() {
    same_bits(&against_reference(best, "drop", &[], 90, 2));
    same_bits(&against_reference(best, "wall:rows=6,columns=6", &[], 40, 2));
}

/// Bricks that rotate by 1e-4 to 6 rad in a substep: slow and fast spins, and cubes without a gyroscopic torque, share
/// groups of lanes.
#[test]
fn slow_and_fast_spins_have_the_same_bits() {
    let run = |backend: Box<dyn Backend>, substeps: u32| {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        for k in 0..50_u8 {
            let (at, spin) = (f32::from(k), 0.05 * 1.25_f32.powi(k.into()));
            let half = if k % 5 == 4 { [0.2; 3] } else { [0.1, 0.2 + 0.001 * at, 0.35] };
            let brick = Body::dynamic().shape(Shape::cuboid(half[0], half[1], half[2])).position(2.0 * at, 0.0, 0.0);
            world.insert(brick.velocity(Vec3::ZERO, Vec3::new(1.0, -0.7, 0.4).normalize() * spin));
        }
        let mut config = SolverConfig::default().without_sleep();
        config.substeps = substeps;
        let mut simulation = Simulation::with(world, config, backend).expect("a world");
        (0..30).for_each(|_| drop(simulation.step(1.0 / 60.0).expect("a step")));
        simulation.hash()
    };
    for substeps in [8, 32] {
        let expected = run(Box::new(Reference::<f32>::new()), substeps);
        assert!(each().all(|backend| run(backend(), substeps) == expected), "{substeps} substeps");
    }
}

#[test]
fn joints_have_the_same_bits() {
    let settings: [&[&str]; 4] = [
        &[],
        &["tolerance=0.001", "iterations=8"],
        &["method=accelerated", "iterations=6", "relax=5"],
        &["max_colors=1"],
    ];
    for settings in settings {
        for backend in each() {
            same_bits(&against_reference(&backend, "joint-grid", settings, 10, 2));
            same_bits(&against_reference(&backend, "chain", settings, 40, 1));
            // Limits of joints of one form side by side are reached, and let go, at different times.
            same_bits(&against_reference(&backend, "ragdoll:n=9", settings, 10, 2));
            same_bits(&against_reference(backend, "ragdolls:n=9", settings, 30, 2));
        }
    }
}

#[test]
fn worlds_in_parts_have_the_same_bits() {
    let in_parts = || Box::new(Cpu::new().dividing_above(0)) as Box<dyn Backend>;
    for threads in [2, 1].into_iter().step_by(one_in(2)) {
        // More worlds than a part holds, one island that is too large for any, joints, driven bodies, spins.
        same_bits(&against_reference(in_parts, "pile:n=20,worlds=300", &[], 40, threads));
        same_bits(&against_reference(in_parts, "pyramid:base=110", &[], 2, threads));
        for scene in ["chain", "joint-grid", "drum", "drop", "bridge", "car"] {
            same_bits(&against_reference(in_parts, &format!("{scene}:worlds=30"), &[], 10, threads));
        }
    }
    for settings in [
        &["stabilization=baumgarte", "relax=0", "rules.clamping=per-correction"][..],
        &["tolerance=0.001", "iterations=8"],
        &["method=accelerated", "iterations=6", "friction_at=manifold"],
    ] {
        same_bits(&against_reference(in_parts, "pile:n=30,worlds=20", settings, 40, 2));
        same_bits(&against_reference(in_parts, "chain:worlds=20", settings, 10, 2));
    }
}

/// Runs the plan without its last pass.
struct Lazy(Cpu);

impl Backend for Lazy {
    fn name(&self) -> &'static str {
        "lazy"
    }
    fn adapter(&self) -> String {
        String::new()
    }
    fn run_checked(&mut self, step: drystone::stages::backend::CheckedStep) -> drystone::Result<()> {
        let (problem, passes) = step.into_parts();
        self.0.run(problem, &passes[..passes.len() - 1])
    }
}

#[test]
fn a_backend_that_leaves_out_a_pass_is_found() {
    let lazy = || Box::new(Lazy(Cpu::new())) as Box<dyn Backend>;
    let found = against_reference(lazy, "pile:n=50", &[], 40, 1);
    assert!(found.first.is_some());
}
