//! SimBenchmark's rolling test: a force pushes a plate with 25 balls. The accelerations have a closed form; published errors are the
//! mean over 4 s of the squared velocity errors of the plate and the first ball (m²/s²).

use drystone::config::Friction;
use drystone::{Backend, Cpu, Reference, Simulation, SolverConfig};
use drystone_cli::hard::rolling_error;

use crate::common::sample::one_in;

fn error(angle: f32, config: SolverConfig, backend: Box<dyn Backend>) -> f64 {
    rolling_error(angle, |world| Simulation::with(world, config, backend)).expect("a run")
}

#[test]
fn the_disc_is_right_in_every_direction() {
    for angle in [90.0, 60.0] {
        let error = error(angle, SolverConfig::default().without_sleep(), Box::new(Cpu::new()));
        println!("{angle} degrees: {error:.1e}");
        assert!(error < 1e-5, "{angle} degrees: {error:e}");
    }
}

#[test]
fn in_box_mode_a_plate_that_is_pushed_across_its_tangents_does_not_move() {
    let config = || SolverConfig::default().without_sleep().with(|c| c.friction = Friction::Box);
    let across = error(60.0, config(), Box::new(Reference::<f32>::new()));
    println!("60 degrees, box: {across:.4}");
    assert!((across - 3.145).abs() < 0.005, "{across}");
    let along = error(90.0, config(), Box::new(Reference::<f32>::new()));
    println!("90 degrees, box: {along:.1e}");
    assert!(along < 1e-5, "{along:e}");
}

/// Sums of velocities instead of changes had 2.8e-4 with 32 substeps and 2e-3 with 128; the sums of double precision have 6e-10 and 5e-11.
#[test]
fn many_short_substeps_in_single_precision_are_as_right_as_in_double_precision() {
    for (substeps, limit) in [(32, 1e-8), (128, 1e-9)].into_iter().step_by(one_in(2)) {
        let config = SolverConfig::default().without_sleep().with(|c| c.substeps = substeps);
        let error = error(90.0, config, Box::new(Cpu::new()));
        println!("{substeps} substeps: {error:.1e}");
        assert!(error < limit, "{substeps} substeps: {error:e}");
    }
}
