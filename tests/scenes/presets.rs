//! Every number that a preset promises.

use drystone::load::Load;
use drystone::preset::Preset;
use drystone::{BodyKind, Cpu, Simulation, metrics};
use drystone_scenes::Scene;

/// A tower whose cubes fall at 1 mm/s, so that none begins with the impulses that it rests with.
fn falling(parameters: &[String]) -> Scene {
    let mut scene = Scene::find("tower", parameters).expect("a scene");
    scene.world.bodies.iter_mut().filter(|b| b.kind == BodyKind::Dynamic).for_each(|b| b.linear_velocity.y = -1e-3);
    scene
}

/// Deepest overlap at any time and at the end [m], and bodies that are not in place, after `seconds` of a tower.
fn tower(preset: Preset, seconds: u32, scene: &Scene) -> (f64, f64, usize) {
    let mut simulation = Simulation::with(scene.world.clone(), preset.config().without_sleep(), Box::new(Cpu::new()))
        .expect("a simulation");
    let (mut deepest, mut last) = (0.0_f64, 0.0);
    for step in 1..=60 * seconds {
        simulation.step(scene.dt).expect("a step");
        if step % 5 == 0 {
            last = simulation.penetration().max;
            deepest = deepest.max(last);
        }
    }
    let fallen = scene.world.dynamic_count() - metrics::in_place_count(&scene.world, &simulation.world);
    (deepest, last, fallen)
}

fn five() -> Scene {
    falling(&["n=5".into(), "offset=0.01".into()])
}

fn keeps(preset: Preset) {
    let promise = preset.promise();
    let built = |seconds: u32, parameters: &[String]| {
        tower(preset, seconds, &Scene::find("tower", parameters).expect("a scene")).2
    };
    let fallen = built(20, &[format!("n={}", promise.tower), "offset=0.01".into()]);
    assert_eq!(fallen, 0, "{preset}: of {} cubes", promise.tower);
    let fallen = built(10, &["n=10".into(), format!("top_ratio={}", promise.heavy_top)]);
    assert_eq!(fallen, 0, "{preset}: under {} times their weight", promise.heavy_top);
    let (deepest, last, _) = tower(preset, 10, &five());
    println!("{preset}: {:.4} mm deepest, {:.4} mm at rest", deepest * 1e3, last * 1e3);
    assert!(deepest <= promise.deepest, "{preset}: {deepest:e} m deep");
    assert!(last <= promise.at_rest, "{preset}: {last:e} m at rest");
}

#[test]
fn fast_holds_what_it_promises_and_not_what_the_next_one_does() {
    keeps(Preset::Fast);
    let deepest = tower(Preset::Fast, 10, &five()).0;
    assert!(deepest > Preset::Balanced.promise().deepest, "fast is as good as balanced: {deepest:e} m");
}

#[test]
fn balanced_holds_what_it_promises() {
    keeps(Preset::Balanced);
    assert_eq!(Preset::default().config(), drystone::SolverConfig::default());
}

#[test]
fn accurate_holds_what_it_promises() {
    keeps(Preset::Accurate);
}

#[test]
fn reference_holds_what_it_promises() {
    keeps(Preset::Reference);
}

/// The substeps that the load of a scene asks for, and the deepest overlap with them at any time and after 1 s [m].
fn with_at_most(most: f64, parameters: &[String]) -> (u32, f64, f64) {
    let scene = falling(parameters);
    let mut config = Preset::default().config().without_sleep();
    let load = Load::heaviest(&scene.world, &config).expect("a load");
    config.substeps = load.substeps(most, scene.dt, &config).expect("substeps");
    let substeps = config.substeps;
    let mut simulation = Simulation::with(scene.world.clone(), config, Box::new(Cpu::new())).expect("a simulation");
    let step = |_| {
        simulation.step(scene.dt).expect("a step");
        simulation.penetration().max
    };
    let overlaps: Vec<f64> = (0..60).map(step).collect();
    (substeps, overlaps.iter().copied().fold(0.0, f64::max), overlaps[59])
}

/// Loads come on at once here: a heavy one on a soft stack swings beyond where it will rest, at most to twice as deep.
#[test]
fn substeps_chosen_for_a_load_keep_its_overlap_as_small_as_asked_and_no_smaller_than_needed() {
    for (top, n, most, overshoot) in
        [(1, 10, 1e-3, 1.0), (1, 20, 0.3e-3, 1.0), (100, 10, 1e-3, 1.4), (1000, 10, 1e-3, 2.0)]
    {
        let (substeps, deepest, last) = with_at_most(most, &[format!("n={n}"), format!("top_ratio={top}")]);
        let share = |x: f64| 100.0 * x / most;
        println!("{n} cubes, top {top} times: {substeps} substeps, {:.0} %, then {:.0} %", share(deepest), share(last));
        assert!(last <= most && deepest <= overshoot * most, "{top}: {deepest:e}, then {last:e} of {most:e}");
        assert!(deepest > 0.5 * most, "{top}: {substeps} substeps are more than needed: {deepest:e} of {most:e}");
    }
}
