//! The loads on interfaces of scenes, and the substeps that they ask for.

use drystone::SolverConfig;
use drystone::load::Load;
use drystone_scenes::Scene;

fn heaviest(scene: &str, parameters: &[&str]) -> (Load, Scene) {
    let parameters: Vec<String> = parameters.iter().map(|p| p.to_string()).collect();
    let scene = Scene::find(scene, &parameters).unwrap();
    (Load::heaviest(&scene.world, &SolverConfig::default()).expect("a load"), scene)
}

#[test]
fn the_lowest_pair_of_a_tower_sinks_in_deepest() {
    let (load, scene) = heaviest("tower", &["n=10"]);
    assert_eq!((load.upper.index(), load.lower.index()), (2, 1));
    assert!((load.force - 9.0 * 9810.0).abs() < 1.0);
    // A corner between two cubes feels an eighth of a cube.
    assert!((load.stress - load.force / 4.0 / 125.0).abs() < 1e-3 * load.stress);
    let config = SolverConfig::default();
    // accuracy of the law: tower of 10 at 30 Hz, 4.97 mm
    let overlap = load.overlap(4, scene.dt, &config);
    assert!((overlap - 4.97e-3).abs() < 0.01e-3, "{overlap}");
    let substeps = load.substeps(1e-3, scene.dt, &config).unwrap();
    assert!(load.overlap(substeps, scene.dt, &config) <= 1e-3);
    assert!(load.overlap(substeps - 1, scene.dt, &config) > 1e-3);
}

/// Worlds beside each other stand at the same place.
#[test]
fn no_body_bears_one_of_another_world() {
    let scene = Scene::find_worlds("tower", &["n=10".into()], 3, None).unwrap();
    let loads = Load::all(&scene.world, &SolverConfig::default(), |_, _| true);
    let alone =
        Load::all(&Scene::find("tower", &["n=10".into()]).unwrap().world, &SolverConfig::default(), |_, _| true);
    let count = scene.world.bodies.len() / 3;
    assert_eq!(loads.len(), 3 * alone.len());
    assert!(loads.iter().all(|load| load.upper.index() / count == load.lower.index() / count));
    let force = |loads: &[Load]| loads.iter().map(|load| load.force).fold(0.0, f64::max);
    assert_eq!(force(&loads), force(&alone));
}

#[test]
fn a_pyramid_hands_its_weight_to_both_sides() {
    // Its lowest rows bear ten rows' weight over eleven boxes.
    let (load, _) = heaviest("pyramid", &["base=20"]);
    let mean = 9810.0 * (19.0 * 20.0 / 2.0) / 20.0;
    assert!(load.force > 0.4 * mean && load.force < 1.5 * mean, "{load:?}");
}
