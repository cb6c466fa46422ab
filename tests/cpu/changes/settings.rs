//! Settings that change on a world that runs.

use drystone::config::{Clamping, Friction, FrictionAt, FrictionOrder, FrictionSweeps, Method, Stabilization};
use drystone::glam::{Quat, Vec3};
use drystone::{Simulation, SolverConfig};
use drystone_conform::compare::Difference;

use super::{BOTH, DT, cpu, fastest, net, reference, run, simulation, standing};

/// Every setting away from its default, and what has to go with it.
fn other_settings() -> Vec<(&'static str, SolverConfig)> {
    let of = |change: &dyn Fn(&mut SolverConfig)| {
        let mut config = SolverConfig::default().without_sleep();
        change(&mut config);
        config.check().expect("a setting");
        config
    };
    vec![
        ("substeps", of(&|c| c.substeps = 16)),
        ("fewer substeps", of(&|c| c.substeps = 4)),
        ("iterations", of(&|c| c.iterations = 3)),
        ("relax", of(&|c| c.relax = 2)),
        ("method", of(&|c| (c.method, c.iterations, c.relax) = (Method::Accelerated, 6, 4))),
        ("manifold_passes", of(&|c| c.rules.manifold_passes = 2)),
        (
            "clamping",
            of(&|c| (c.rules.clamping, c.stabilization, c.relax) = (Clamping::PerCorrection, Stabilization::None, 0)),
        ),
        ("stabilization", of(&|c| (c.stabilization, c.relax, c.iterations) = (Stabilization::Baumgarte, 0, 4))),
        (
            "baumgarte",
            of(&|c| (c.stabilization, c.relax, c.iterations, c.baumgarte) = (Stabilization::Baumgarte, 0, 4, 0.1)),
        ),
        ("slop", of(&|c| (c.stabilization, c.relax, c.iterations, c.slop) = (Stabilization::Baumgarte, 0, 4, 0.005))),
        ("relaxation", of(&|c| c.relaxation = 0.9)),
        ("tolerance", of(&|c| (c.tolerance, c.iterations, c.relax) = (1e-3, 4, 4))),
        ("contact_frequency", of(&|c| c.contact_frequency = 0.1)),
        ("contact_damping", of(&|c| c.contact_damping = 5.0)),
        ("fixed_contact_frequency_ratio", of(&|c| c.fixed_contact_frequency_ratio = 1.0)),
        ("preload_rate", of(&|c| c.preload_rate = 0.0)),
        ("push_limit", of(&|c| c.push_limit = 1.0)),
        ("friction none", of(&|c| c.friction = Friction::None)),
        ("friction box", of(&|c| c.friction = Friction::Box)),
        ("friction slip", of(&|c| c.rules.slip_friction = true)),
        ("friction_at", of(&|c| c.friction_at = FrictionAt::Manifold)),
        ("friction_order", of(&|c| c.rules.friction_order = FrictionOrder::FrictionFirst)),
        ("friction_sweeps", of(&|c| c.friction_sweeps = FrictionSweeps::All)),
        ("joint_frequency", of(&|c| c.joint_frequency = 0.1)),
        ("joint_damping", of(&|c| c.joint_damping = 5.0)),
        ("warm_start", of(&|c| (c.warm_start, c.iterations) = (false, 8))),
        ("restitution_threshold", of(&|c| c.restitution_threshold = 0.5)),
        ("gyroscopic", of(&|c| c.gyroscopic = false)),
        ("speculative_margin", of(&|c| c.speculative_margin = 0.1)),
        ("recycle_distance", of(&|c| c.recycle_distance = 0.0)),
        ("fuse_colors_below", of(&|c| c.fuse_colors_below = 0)),
        ("max_colors", of(&|c| c.max_colors = 1)),
    ]
}

/// A setting that changes on a settled world acts as in a world that is made with it from the same state. That world begins without
/// impulses, so the two are not the same to the bit; but no body may be further from it than such a beginning accounts for, no
/// joint may open, and all backends take the same steps.
#[test]
fn every_setting_may_change_on_a_settled_world() {
    let mut settled = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
    run(&mut settled, 300);
    assert!(fastest(&settled.world) < 2e-3, "{}", fastest(&settled.world));
    for (name, config) in other_settings() {
        let begun = |backend| {
            let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), backend);
            run(&mut simulation, 300);
            simulation
        };
        let [mut changed, mut again] = BOTH.map(begun);
        changed.set_config(config.clone()).expect("a setting");
        again.set_config(config.clone()).expect("a setting");
        let mut anew = simulation(&settled.world, &config, cpu);
        for step in 0..30 {
            changed.step(DT).expect("a step");
            again.step(DT).expect("a step");
            anew.step(DT).expect("a step");
            assert_eq!(Difference::between(&changed.world, &again.world).bodies, 0, "{name}, step {step}");
            changed.problem().check().unwrap_or_else(|e| panic!("{name}, step {step}: {e}"));
        }
        let apart = Difference::between(&changed.world, &anew.world);
        let (speed, speed_anew) = (fastest(&changed.world), fastest(&anew.world));
        let gap = changed.world.joint_gap();
        println!("{name}: {:.1e} m apart, {speed:.1e} and {speed_anew:.1e} m/s, gap {gap:.1e} m", apart.position);
        assert!(apart.position < 2e-2, "{name}: {apart:?}");
        assert!(gap < 1e-3 + 2.0 * anew.world.joint_gap(), "{name}: {gap}");
        // Some settings let things slide, or compute all contacts anew; under all others a world at rest stays at rest.
        let moves = ["clamping", "friction none", "friction slip", "speculative_margin"].contains(&name);
        let most = if moves { 2.0 * speed_anew } else { 2e-3 };
        assert!(speed < most, "{name}: {speed} m/s, and {speed_anew} in a world made with it");
    }
}

#[test]
fn a_slope_is_slippery_from_the_step_on_in_which_friction_is_switched_off_and_holds_again_afterwards() {
    for (backend, at) in BOTH.into_iter().zip([FrictionAt::Points, FrictionAt::Manifold]) {
        let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = at);
        let none = config.clone().with(|c| c.friction = Friction::None);
        let mut simulation = simulation(&standing(), &config, backend);
        run(&mut simulation, 60);
        let block = 17;
        let along = Quat::from_rotation_z(0.2) * Vec3::X;
        let speed = |s: &Simulation| s.world.bodies[block].linear_velocity.dot(along);
        assert!(speed(&simulation).abs() < 1e-3);
        simulation.set_config(none).expect("a setting");
        run(&mut simulation, 30);
        let free = -9.81 * 0.2_f32.sin() * 30.0 * DT;
        assert!((speed(&simulation) - free).abs() < 0.02 * free.abs(), "{} and not {free} m/s", speed(&simulation));
        simulation.set_config(config).expect("a setting");
        run(&mut simulation, 30);
        let held = free + (0.5 * 0.2_f32.cos() - 0.2_f32.sin()) * 9.81 * 30.0 * DT;
        assert!((speed(&simulation) - held.min(0.0)).abs() < 0.02, "{} and not {held} m/s", speed(&simulation));
    }
}

#[test]
fn bodies_may_fall_asleep_once_the_settings_say_so() {
    let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
    run(&mut simulation, 120);
    assert!(!simulation.world.bodies.handles().any(|body| simulation.is_asleep(body)));
    let cube = simulation.world.bodies.handle(1).expect("a cube");
    let asleep = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    simulation.set_config(asleep.clone()).expect("a setting");
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(cube), "0.3 s of rest are over");
    simulation.set_config(asleep.clone().with(|c| c.sleep_speed = 1e-9)).expect("a setting");
    simulation.world.bodies[cube].linear_velocity.x = 1e-4;
    run(&mut simulation, 60);
    assert!(!simulation.is_asleep(cube), "nothing is slower than 1e-9 m/s");
    simulation.set_config(asleep).expect("a setting");
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(cube));
    simulation.set_config(SolverConfig::default().without_sleep()).expect("a setting");
    run(&mut simulation, 1);
    assert!(!simulation.is_asleep(cube), "nothing sleeps any more");
}

#[test]
fn a_setting_that_changes_wakes_what_sleeps() {
    let mut simulation = simulation(&standing(), &SolverConfig::default().with(|c| c.sleep_after = 0.3), cpu);
    run(&mut simulation, 240);
    let block = simulation.world.bodies.handle(17).expect("a block");
    assert!(simulation.is_asleep(block));
    let slippery = simulation.config().clone().with(|c| c.friction = Friction::None);
    simulation.set_config(slippery).expect("a setting");
    run(&mut simulation, 30);
    let slid = simulation.world.bodies[block].linear_velocity.length();
    assert!((slid - 9.81 * 0.2_f32.sin() * 30.0 * DT).abs() < 0.02, "{slid} m/s");
}

/// Neither a setting of sleeping nor a mass that changed long ago keeps anything awake.
#[test]
fn what_was_changed_once_sleeps_again() {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut simulation = simulation(&standing(), &config, cpu);
    run(&mut simulation, 240);
    let top = simulation.world.bodies.handle(5).expect("a cube");
    assert!(simulation.is_asleep(top));
    simulation.world.bodies[top].mass.mass *= 1.5;
    run(&mut simulation, 1);
    assert!(!simulation.is_asleep(top), "its mass changed");
    run(&mut simulation, 120);
    assert!(simulation.is_asleep(top), "its mass changed two seconds ago");
    simulation.set_config(config.with(|c| c.sleep_after = 0.4)).expect("a setting");
    run(&mut simulation, 1);
    assert!(simulation.is_asleep(top), "only the time until bodies sleep changed");
}

#[test]
fn as_many_colors_as_are_allowed_are_taken_from_the_step_on_in_which_they_are() {
    let config = SolverConfig::default().without_sleep();
    let mut simulation = simulation(&net(), &config, cpu);
    run(&mut simulation, 3);
    let colors = |s: &mut Simulation| s.problem().joint_colors().len();
    let many = colors(&mut simulation);
    assert!(many > 2, "{many} colors");
    simulation.set_config(config.clone().with(|c| c.max_colors = 1)).expect("a setting");
    run(&mut simulation, 1);
    let mut anew = Simulation::with(net(), simulation.config().clone(), cpu()).expect("a good world");
    run(&mut anew, 1);
    assert_eq!(colors(&mut simulation), colors(&mut anew));
    assert_ne!(colors(&mut simulation), many);
    simulation.set_config(config).expect("a setting");
    run(&mut simulation, 1);
    assert_eq!(colors(&mut simulation), many);
}

#[test]
fn friction_that_acts_elsewhere_begins_without_impulses() {
    let config = SolverConfig::default().without_sleep();
    let mut simulation = simulation(&standing(), &config, reference);
    run(&mut simulation, 60);
    assert!(simulation.problem().impulses.iter().any(|i| i.tangent_1 != 0.0 || i.tangent_2 != 0.0));
    for friction_at in [FrictionAt::Manifold, FrictionAt::Points] {
        // All contacts are computed anew.
        let other = config.clone().with(|c| {
            c.friction_at = friction_at;
            c.recycle_distance = 0.0;
        });
        simulation.set_config(other).expect("a setting");
        let (next, _) = simulation.next_problem(DT).expect("a step");
        assert!(next.impulses.iter().all(|i| i.tangent_1 == 0.0 && i.tangent_2 == 0.0), "{friction_at:?}");
        run(&mut simulation, 60);
        assert!(simulation.problem().impulses.iter().any(|i| i.tangent_1 != 0.0 || i.tangent_2 != 0.0));
    }
}
