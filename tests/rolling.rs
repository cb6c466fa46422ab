//! SimBenchmark's rolling test: 25 balls on a plate that is pushed. All move along the push with accelerations known on
//! paper; published errors are the mean over 4 s of the squared velocity errors of the plate and the first ball [m²/s²].

use drystone::config::FrictionRule;
use drystone::{Backend, Cpu, Reference, Scene, Simulation, SolverConfig};
use glam::{DVec3, Vec3};

/// Mean over the run of |dv|² of the plate plus that of the first ball.
fn error(angle: f32, config: SolverConfig, backend: Box<dyn Backend>) -> f64 {
    let scene = Scene::find("rolling", &[format!("angle={angle}")]).expect("a scene");
    let (m, plate, g, mu, balls, push) = (1.0, 10.0, 9.81, 0.4, 25.0, 150.0);
    // A ball that rolls on the plate takes 2/7 of its acceleration.
    let slip = push - mu * (plate + balls * m) * g;
    let a_ball = slip / plate / (3.5 + balls * m / plate);
    let a_plate = 3.5 * a_ball;
    assert!((a_plate - 0.7385_f64).abs() < 5e-5 && (a_ball - 0.2110_f64).abs() < 5e-5);
    let along = DVec3::new(f64::from(angle).to_radians().cos(), 0.0, f64::from(angle).to_radians().sin());
    let mut simulation = Simulation::new(scene.world.clone(), config, backend).expect("a simulation");
    let mut sum = 0.0;
    for step in 1..=scene.steps {
        simulation.step(scene.dt).expect("a step");
        let time = f64::from(step) * f64::from(scene.dt);
        for (body, a) in [(1, a_plate), (2, a_ball)] {
            let v: Vec3 = simulation.world.bodies[body].linear_velocity;
            sum += (v.as_dvec3() - along * a * time).length_squared();
        }
    }
    sum / f64::from(scene.steps)
}

#[test]
fn the_disc_is_right_in_every_direction() {
    for angle in [90.0, 60.0] {
        let error = error(angle, SolverConfig::default(), Box::new(Cpu::new()));
        println!("{angle} degrees: {error:.1e}");
        assert!(error < 1e-5, "{angle} degrees: {error:e}");
    }
}

#[test]
fn in_box_mode_a_plate_that_is_pushed_across_its_tangents_does_not_move() {
    let config = || SolverConfig { friction: FrictionRule::Box, ..SolverConfig::default() };
    let across = error(60.0, config(), Box::new(Reference::<f32>::new()));
    println!("60 degrees, box: {across:.4}");
    assert!((across - 3.145).abs() < 0.005, "{across}");
    let along = error(90.0, config(), Box::new(Reference::<f32>::new()));
    println!("90 degrees, box: {along:.1e}");
    assert!(along < 1e-5, "{along:e}");
}
