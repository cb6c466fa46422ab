//! The report of a run: groups, joints and sweeps.

use drystone::glam::Vec3;
use drystone::{Reference, Simulation, SolverConfig};
use drystone_cli::report::RunReport;
use drystone_scenes::Scene;

#[test]
fn the_report_names_the_largest_tower_that_stands() {
    let mut scene = Scene::find("tallest", &["n=6".into(), "step=2".into()]).expect("towers");
    let (config, reference) = (SolverConfig::default().without_sleep(), Box::new(Reference::<f32>::new()));
    let mut simulation = Simulation::with(scene.world.clone(), config.clone(), reference).expect("a simulation");
    for _ in 0..10 {
        simulation.step(scene.dt).expect("a step");
    }
    // The measurement begins with a moved body of the tallest tower.
    scene.world.bodies[12].position += Vec3::X;
    let mut report = RunReport::new(&scene, &config, simulation.backend());
    let hash = format!("{:016x}", simulation.hash());
    report.measure(&scene, simulation);
    assert_eq!(report.hash, hash);
    assert_eq!((report.in_place, report.bodies), (11, 12));
    let standing: Vec<_> = report.standing.iter().map(|s| (s.group.as_str(), s.bodies, s.in_place)).collect();
    assert_eq!(standing, [("2 cubes", 2, 2), ("4 cubes", 4, 4), ("6 cubes", 6, 5)]);
    let rows = report.rows();
    let row = |what: &str| rows.iter().find(|r| r.0 == what).map(|r| r.1.as_str());
    assert_eq!(row("in place"), Some("11 of 12"));
    assert_eq!(row("standing"), Some("2 of 3 groups; the largest is 4 cubes"));
    assert_eq!((row("joints"), row("sweeps")), (None, None));
    assert_eq!(row("hash"), Some(hash.as_str()));
}

#[test]
fn the_report_counts_joints_and_the_sweeps_that_a_tolerance_saved() {
    let scene = Scene::find("pendulum", &[]).expect("a pendulum");
    let config = SolverConfig::default().without_sleep().with(|c| {
        c.tolerance = 1e-3;
        c.iterations = 8;
    });
    let reference = Box::new(Reference::<f32>::new());
    let mut report = RunReport::new(&scene, &config, &*reference);
    let mut simulation = Simulation::with(scene.world.clone(), config, reference).expect("a simulation");
    for _ in 0..5 {
        report.add(&simulation.step(scene.dt).expect("a step"));
    }
    let gap = simulation.world.joint_gap();
    report.measure(&scene, simulation);
    assert_eq!((report.joints, report.joint_gap), (1, Some(gap.into())));
    let (sweeps, planned) = (report.sweeps.expect("sweeps"), report.planned_sweeps.expect("planned sweeps"));
    assert!(0 < sweeps && sweeps < planned, "{sweeps} of {planned}");
    assert!(report.rows().iter().any(|r| r == &("sweeps".to_owned(), format!("{sweeps} of {planned}"))));
}
