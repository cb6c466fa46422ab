//! What the caller changes between two steps: the next step follows it, whatever it is, or says why not.

#[allow(dead_code)]
#[path = "../cli/src/compare.rs"]
mod compare;

use compare::Difference;
use drystone::config::{Clamping, Friction, FrictionAt, FrictionOrder, FrictionSweeps, Method, Stabilization};
use drystone::glam::{Quat, Vec3};
use drystone::{Backend, BallJoint, Body, Cpu, Reference, Scene, Shape, Simulation, SolverConfig, StepProblem, World};

const DT: f32 = 1.0 / 60.0;

fn reference() -> Box<dyn Backend> {
    Box::new(Reference::<f32>::new())
}

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

const BOTH: [fn() -> Box<dyn Backend>; 2] = [reference, cpu];

fn simulation(world: &World, config: &SolverConfig, backend: fn() -> Box<dyn Backend>) -> Simulation {
    Simulation::new(world.clone(), config.clone(), backend()).expect("a good world")
}

fn run(simulation: &mut Simulation, steps: u32) {
    for _ in 0..steps {
        simulation.step(DT).expect("a step");
    }
}

fn fastest(world: &World) -> f32 {
    world.bodies.iter().map(|b| b.linear_velocity.length() + b.angular_velocity.length()).fold(0.0, f32::max)
}

fn ground() -> Body {
    Body::fixed().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0)
}

fn cube(x: f32, y: f32, z: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, z)
}

/// Three towers of cubes, a block on a slope and a chain of rods: contacts of every kind and joints.
fn standing() -> World {
    let mut world = World::new();
    world.add(ground());
    for tower in 0..3 {
        for level in 0..5 {
            let offset = 0.05 * ((tower + level) % 2) as f32;
            world.add(cube(3.0 * tower as f32 + offset, 0.5 + level as f32, 0.0));
        }
    }
    let tilt = Quat::from_rotation_z(0.2);
    let up = tilt * Vec3::Y;
    let at = Vec3::new(-8.0, 3.0, 0.0);
    world.add(Body::fixed().shape(Shape::cuboid(3.0, 0.5, 3.0)).position(at.x, at.y, at.z).rotation(tilt));
    let block = at + up * 0.75;
    world.add(Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.5)).position(block.x, block.y, block.z).rotation(tilt));
    let mut above = None;
    for i in 0..6 {
        let rod = world.add(Body::dynamic().shape(Shape::cuboid(0.25, 0.5, 0.25)).position(12.0, 8.0 - i as f32, 0.0));
        let end = Vec3::new(0.0, 0.5, 0.0);
        world.join(match above {
            None => BallJoint::to_world(rod, end, Vec3::new(12.0, 8.5, 0.0)),
            Some(above) => BallJoint::new(above, -end, rod, end),
        });
        above = Some(rod);
    }
    world
}

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

/// Preloads and impulses belong to a length of substep. Before they were rescaled, this pile rattled at 0.8 m/s.
#[test]
fn a_pile_at_rest_stays_so_with_fewer_substeps_and_with_longer_steps() {
    let scene = Scene::find("pile", &["n=100".into()]).expect("the scene");
    let fine = SolverConfig::default().without_sleep().with(|c| c.substeps = 32);
    for (substeps, dt) in [(8, DT), (32, 2.0 * DT), (16, 0.5 * DT)] {
        let mut simulation = simulation(&scene.world, &fine, cpu);
        run(&mut simulation, 400);
        let before = fastest(&simulation.world);
        simulation.set_config(fine.clone().with(|c| c.substeps = substeps)).expect("a setting");
        let mut worst = 0.0_f32;
        for _ in 0..60 {
            simulation.step(dt).expect("a step");
            worst = worst.max(fastest(&simulation.world));
        }
        println!("{substeps} substeps of {dt} s: {before:.1e} m/s before, up to {worst:.1e} after");
        assert!(worst < 2e-2, "{substeps} substeps of {dt} s: {worst} m/s");
    }
}

/// Every impulse of a world at rest is a force times the length of a substep: a step of another length begins with the same forces.
#[test]
fn forces_stay_as_they_are_in_a_step_of_another_length() {
    let config = SolverConfig::default().without_sleep();
    for backend in BOTH {
        let mut simulation = simulation(&standing(), &config, backend);
        run(&mut simulation, 300);
        let problem = simulation.problem();
        assert!(problem.impulses.iter().all(|i| i.normal > 0.0) && problem.impulses.iter().any(|i| i.tangent_1 != 0.0));
        assert!(problem.joint_impulses.iter().all(|j| j.linear[1] != 0.0));
        for dt in [0.5 * DT, DT, 2.0 * DT, DT] {
            let (next, _) = simulation.next_problem(dt).expect("a step");
            let substep = dt / config.substeps as f32;
            let old = simulation.problem().clone();
            let factor = substep / old.blocks[0].substep.length;
            assert_eq!(old.points.len(), next.points.len(), "the same contacts");
            let all = |p: &StepProblem| -> Vec<f32> {
                let contacts = p.impulses.iter().flat_map(|i| [i.normal, i.tangent_1, i.tangent_2]);
                contacts.chain(p.joint_impulses.iter().flat_map(|j| [j.linear[0], j.linear[1], j.linear[2]])).collect()
            };
            for (old, next) in all(&old).into_iter().zip(all(&next)) {
                assert!((next - factor * old).abs() <= 1e-6 * old.abs(), "{next} and not {factor} x {old} N s");
            }
            simulation.step(dt).expect("a step");
            // A joint has no preload: its gap closes or opens to what the other substep asks for.
            let speed = simulation.world.bodies[..18].iter().map(|b| b.linear_velocity.length()).fold(0.0, f32::max);
            assert!(speed < 2e-3, "{dt} s: {speed} m/s");
        }
    }
}

/// A preload is an overlap at rest, which goes with the square of the substep where the contact is as stiff as the substep is short.
#[test]
fn preloads_follow_the_length_of_a_step() {
    let config = SolverConfig::default().without_sleep().with(|c| c.preload_rate = 0.0);
    let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), reference);
    run(&mut simulation, 300);
    simulation.set_config(config).expect("a setting");
    run(&mut simulation, 1);
    let before: Vec<f32> = simulation.problem().contacts.iter().map(|c| c.preload).collect();
    assert!(before.iter().all(|&p| p > 0.0), "{before:?} m");
    let (half, _) = simulation.next_problem(0.5 * DT).expect("a step");
    for (contact, before) in half.contacts.iter().zip(before) {
        assert!((contact.preload / before - 0.25).abs() < 1e-3, "{} of {before} m", contact.preload);
    }
}

#[test]
fn bodies_may_fall_asleep_once_the_settings_say_so() {
    let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
    run(&mut simulation, 120);
    assert!(!(0..simulation.world.bodies.len()).any(|i| simulation.is_asleep(i)));
    let asleep = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    simulation.set_config(asleep.clone()).expect("a setting");
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(1), "0.3 s of rest are over");
    simulation.set_config(asleep.clone().with(|c| c.sleep_speed = 1e-9)).expect("a setting");
    simulation.world.bodies[1].linear_velocity.x = 1e-4;
    run(&mut simulation, 60);
    assert!(!simulation.is_asleep(1), "nothing is slower than 1e-9 m/s");
    simulation.set_config(asleep).expect("a setting");
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(1));
    simulation.set_config(SolverConfig::default().without_sleep()).expect("a setting");
    run(&mut simulation, 1);
    assert!(!simulation.is_asleep(1), "nothing sleeps any more");
}

#[test]
fn a_setting_that_changes_wakes_what_sleeps() {
    let mut simulation = simulation(&standing(), &SolverConfig::default().with(|c| c.sleep_after = 0.3), cpu);
    run(&mut simulation, 240);
    let block = 17;
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
    assert!(simulation.is_asleep(5));
    simulation.world.bodies[5].mass.mass *= 1.5;
    run(&mut simulation, 1);
    assert!(!simulation.is_asleep(5), "its mass changed");
    run(&mut simulation, 120);
    assert!(simulation.is_asleep(5), "its mass changed two seconds ago");
    simulation.set_config(config.with(|c| c.sleep_after = 0.4)).expect("a setting");
    run(&mut simulation, 1);
    assert!(simulation.is_asleep(5), "only the time until bodies sleep changed");
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
    let mut anew = Simulation::new(net(), simulation.config().clone(), cpu()).expect("a good world");
    run(&mut anew, 1);
    assert_eq!(colors(&mut simulation), colors(&mut anew));
    assert_ne!(colors(&mut simulation), many);
    simulation.set_config(config).expect("a setting");
    run(&mut simulation, 1);
    assert_eq!(colors(&mut simulation), many);
}

/// The plan of a step is that of its problem, whatever began or ended before it.
#[test]
fn a_plan_is_always_that_of_its_problem() {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut world = standing();
    // A ball that comes down after the rest fell asleep, and bounces; cubes and balls turn without a gyroscopic pass.
    let ball = world.add(Body::dynamic().shape(Shape::ball(0.3)).position(-20.0, 60.0, 0.0).restitution(0.8));
    let mut simulation = simulation(&world, &config, cpu);
    let (mut plans, mut steps) = (Vec::new(), 0);
    for step in 0..420 {
        if step == 200 {
            simulation.world.joints.pop();
        }
        if simulation.step(DT).expect("a step").dispatches == 0 {
            continue;
        }
        steps += 1;
        let fresh = drystone::StepPlan::new(&config, &simulation.problem().clone());
        assert_eq!(simulation.plan(), &fresh, "step {step}");
        if plans.last() != Some(&fresh) {
            plans.push(fresh);
        }
    }
    assert!(!simulation.is_asleep(ball) || steps > 100);
    assert!(plans.len() > 4, "{} plans in {steps} steps: hardly a test", plans.len());
}

/// Asserts that the plan of the last step is that of its problem, and that its colors are still `colors`.
#[track_caller]
fn assert_planned_anew(simulation: &mut Simulation, colors: &[u32]) {
    let config = simulation.config().clone();
    let problem = simulation.problem().clone();
    assert_eq!(problem.colors, colors, "other colors ask for another plan anyway");
    assert_eq!(simulation.plan(), &drystone::StepPlan::new(&config, &problem));
}

#[test]
fn a_plan_follows_contacts_and_lengths_of_steps_where_its_colors_stay() {
    let mut world = World::new();
    world.add(ground());
    let cube = world.add(cube(0.0, 0.5, 0.0));
    let ball = world.add(Body::dynamic().shape(Shape::ball(0.3)).position(5.0, 9.0, 0.0).restitution(0.5));
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), cpu);
    run(&mut simulation, 10);
    let colors = simulation.problem().colors.clone();
    simulation.step(1e-4).expect("a step");
    assert_planned_anew(&mut simulation, &colors);
    run(&mut simulation, 1);
    // A flat contact goes, and a round one that bounces comes.
    for (body, height) in [(cube, 9.0), (ball, 0.3)] {
        let body = &mut simulation.world.bodies[body];
        (body.position.y, body.linear_velocity) = (height, Vec3::ZERO);
    }
    run(&mut simulation, 1);
    assert_planned_anew(&mut simulation, &colors);
}

/// A ball falls asleep and a rod wakes: as many joints as before, but a spin that turns.
#[test]
fn a_plan_follows_spins_where_its_colors_stay() {
    let mut world = World::new();
    let rod = world.add(Body::dynamic().shape(Shape::cuboid(0.1, 0.5, 0.1)).position(0.0, -0.5, 0.0));
    world.join(BallJoint::to_world(rod, Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO));
    let ball = world.add(Body::dynamic().shape(Shape::ball(0.3)).position(5.0, 0.0, 0.0));
    world.join(BallJoint::to_world(ball, Vec3::ZERO, Vec3::new(5.0, 0.0, 0.0)));
    let mut simulation = simulation(&world, &SolverConfig::default().with(|c| c.sleep_after = 0.3), cpu);
    for _ in 0..60 {
        simulation.world.bodies[ball].linear_velocity.y = 0.1;
        run(&mut simulation, 1);
    }
    assert!(simulation.is_asleep(rod) && !simulation.is_asleep(ball));
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(ball) && simulation.problem().inertias.is_empty());
    let colors = simulation.problem().colors.clone();
    simulation.wake(rod);
    run(&mut simulation, 1);
    assert!(!simulation.problem().inertias.is_empty());
    assert_planned_anew(&mut simulation, &colors);
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

/// Asking for the next step is no step: whatever is asked, the run goes on with the same bits.
#[test]
fn asking_for_the_next_problem_changes_no_bit_of_the_run() {
    let scene = Scene::find("pile", &["n=60".into()]).expect("the scene");
    let [mut asked, mut left] =
        [cpu, cpu].map(|b| simulation(&scene.world, &SolverConfig::default().without_sleep(), b));
    for step in 0..120 {
        let (problem, plan) = asked.next_problem(DT).expect("a step");
        let (other, _) = asked.next_problem(0.5 * DT).expect("a step");
        assert_ne!(problem.params, other.params);
        let (again, plan_again) = asked.next_problem(DT).expect("a step");
        assert!(problem == again && plan == plan_again, "step {step}: a second answer");
        asked.step(DT).expect("a step");
        left.step(DT).expect("a step");
        assert_eq!(Difference::between(&asked.world, &left.world).bodies, 0, "step {step}");
        assert_eq!(asked.problem(), left.problem(), "step {step}");
    }
    assert!(left.problem().contacts.iter().any(|c| c.preload > 0.0), "nothing bears anything");
}

/// A square of balls that are tied to their neighbors, and pulled out of shape.
fn net() -> World {
    let mut world = World::new();
    let ball = |x: u32, z: u32| Body::dynamic().shape(Shape::ball(0.2)).position(x as f32, 0.0, z as f32);
    for i in 0..16 {
        world.add(ball(i % 4, i / 4));
    }
    let half = 0.5 * Vec3::X;
    for i in 0..16 {
        if i % 4 < 3 {
            world.join(BallJoint::new(i, half, i + 1, -half));
        }
        if i < 12 {
            world.join(BallJoint::new(i, 0.5 * Vec3::Z, i + 4, -0.5 * Vec3::Z));
        }
    }
    world.join(BallJoint::to_world(0, Vec3::ZERO, Vec3::ZERO));
    world.join(BallJoint::to_world(3, Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0)));
    world
}

/// Joints are known by their bodies and anchors: the same number of other joints are other joints.
#[test]
fn joints_that_take_the_place_of_others_hold_what_they_tie() {
    let mut gaps = Vec::new();
    for backend in BOTH {
        let mut simulation = simulation(&net(), &SolverConfig::default().without_sleep(), backend);
        run(&mut simulation, 60);
        // The balls of the first row hang from other points now, and the rest hangs from them the other way round.
        let joints = &mut simulation.world.joints;
        joints.reverse();
        let count = joints.len();
        joints.retain(|j| j.body_b.is_some());
        for corner in [0, 3] {
            let at = simulation.world.bodies[corner + 12].position;
            simulation.world.join(BallJoint::to_world(corner + 12, Vec3::ZERO, at));
        }
        assert_eq!(simulation.world.joints.len(), count);
        for step in 0..120 {
            simulation.step(DT).expect("a step");
            simulation.problem().check().unwrap_or_else(|e| panic!("step {step}: {e}"));
        }
        gaps.push(simulation.world.joint_gap());
    }
    println!("{gaps:?}");
    assert!(gaps[0] < 0.02 && gaps[0] == gaps[1], "{gaps:?}");
}

#[test]
fn a_joint_that_ends_leaves_the_impulses_of_the_others_alone() {
    let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), reference);
    run(&mut simulation, 120);
    // The top of a tower is held where it is, by a joint that stands first in the list.
    let top = simulation.world.bodies[5].position;
    simulation.world.joints.insert(0, BallJoint::to_world(5, Vec3::ZERO, top));
    run(&mut simulation, 60);
    let before = simulation.joint_impulses().to_vec();
    assert!(before.iter().skip(1).all(|carried| carried.distance(before[0]) > 0.1 * carried.length()), "{before:?}");
    let heights: Vec<f32> = simulation.world.bodies.iter().map(|b| b.position.y).collect();
    simulation.world.joints.remove(0);
    simulation.step(DT).expect("a step");
    for (now, before) in simulation.joint_impulses().iter().zip(&before[1..]) {
        assert!(now.distance(*before) < 1e-3 * before.length(), "{now} and not {before}");
    }
    run(&mut simulation, 20);
    for (body, before) in simulation.world.bodies.iter().zip(heights) {
        assert!((body.position.y - before).abs() < 1e-3);
    }
}

#[test]
fn whether_jointed_bodies_collide_may_change() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    // Two balls that overlap, tied at their centers by a joint of no length.
    let a = world.add(Body::dynamic().shape(Shape::ball(0.5)));
    let b = world.add(Body::dynamic().shape(Shape::ball(0.5)).position(0.6, 0.0, 0.0));
    world.join(BallJoint::new(a, Vec3::new(0.3, 0.0, 0.0), b, Vec3::new(-0.3, 0.0, 0.0)));
    for backend in BOTH {
        let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), backend);
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
        simulation.world.joints[0].collide = true;
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
        simulation.world.joints[0].collide = false;
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
        simulation.world.joints.clear();
        assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
        run(&mut simulation, 60);
        let apart = simulation.world.bodies[a].position.distance(simulation.world.bodies[b].position);
        assert!(apart > 0.99, "{apart} m");
    }
}

#[test]
fn a_changed_joint_wakes_what_it_held() {
    let config = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    let mut simulation = simulation(&standing(), &config, cpu);
    run(&mut simulation, 240);
    let rod = 18;
    assert!(simulation.is_asleep(rod), "the chain hangs still");
    simulation.world.joints.retain(|j| j.body_b.is_some());
    run(&mut simulation, 30);
    let fallen = simulation.world.bodies[rod].linear_velocity.y;
    assert!((fallen + 9.81 * 30.0 * DT).abs() < 0.1, "{fallen} m/s");
}

/// Two chains hang still. What changes of one wakes that one.
#[test]
fn a_changed_joint_wakes_only_what_it_holds() {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut world = World::new();
    for x in [0.0, 5.0] {
        let upper = world.add(cube(x, -1.0, 0.0));
        let lower = world.add(cube(x, -2.5, 0.0));
        world.join(BallJoint::to_world(upper, Vec3::Y, Vec3::new(x, 0.0, 0.0)));
        world.join(BallJoint::new(upper, -0.75 * Vec3::Y, lower, 0.75 * Vec3::Y));
    }
    let mut simulation = simulation(&world, &config, cpu);
    let asleep = |s: &Simulation| [0, 1, 2, 3].map(|i| s.is_asleep(i));
    run(&mut simulation, 300);
    assert_eq!(asleep(&simulation), [true; 4]);
    // The same joints in another order are no change.
    simulation.world.joints.reverse();
    run(&mut simulation, 1);
    assert_eq!(asleep(&simulation), [true; 4]);
    simulation.world.joints.reverse();
    // An anchor that moves wakes its chain.
    simulation.world.joints[3].anchor_a.y -= 0.1;
    run(&mut simulation, 1);
    assert_eq!(asleep(&simulation), [true, true, false, false]);
    run(&mut simulation, 300);
    assert_eq!(asleep(&simulation), [true; 4]);
    // So does the end of a joint.
    simulation.world.joints.remove(1);
    run(&mut simulation, 1);
    assert_eq!(asleep(&simulation), [false, false, true, true]);
}

#[test]
fn a_new_joint_wakes_both_of_its_bodies() {
    let config = SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3);
    for swap in [false, true] {
        let mut simulation = simulation(&standing(), &config, cpu);
        run(&mut simulation, 240);
        let (one, other) = (5, 10);
        assert!(simulation.is_asleep(one) && simulation.is_asleep(other));
        let [a, b] = if swap { [other, one] } else { [one, other] };
        let at = |i: usize| simulation.world.bodies[i].position;
        let half = 0.5 * (at(b) - at(a));
        simulation.world.join(BallJoint::new(a, half, b, -half));
        run(&mut simulation, 1);
        assert!(!simulation.is_asleep(one) && !simulation.is_asleep(other));
    }
}

#[test]
fn a_body_that_is_untied_rests_on_a_half_space() {
    let mut world = World::new();
    let ground = world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let ball = world.add(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.49, 0.0));
    world.join(BallJoint::new(ball, Vec3::ZERO, ground, 0.49 * Vec3::Y));
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), cpu);
    run(&mut simulation, 10);
    assert_eq!(simulation.step(DT).expect("a step").manifolds, 0);
    simulation.world.joints.clear();
    assert_eq!(simulation.step(DT).expect("a step").manifolds, 1);
    run(&mut simulation, 60);
    let height = simulation.world.bodies[ball].position.y;
    assert!((height - 0.5).abs() < 0.01, "{height} m");
}

#[test]
fn masses_and_materials_may_change() {
    let mut simulation =
        simulation(&standing(), &SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3), cpu);
    run(&mut simulation, 240);
    let (slope, block) = (16, 17);
    assert!(simulation.is_asleep(block));
    // The slope becomes ice, though what lies on it sleeps.
    simulation.world.bodies[slope].material.friction = 0.0;
    run(&mut simulation, 30);
    let slid = simulation.world.bodies[block].linear_velocity.length();
    assert!((slid - 9.81 * 0.2_f32.sin() * 30.0 * DT).abs() < 0.02, "{slid} m/s");
    // A cube becomes a hundred times as heavy under its own weight, and what it lies on bears that.
    let force = |s: &mut Simulation| -> f32 {
        let of_top = s.manifolds().filter(|m| [m.body_a, m.body_b] == [4, 5] || [m.body_a, m.body_b] == [5, 4]);
        of_top.map(|m| m.normal_impulse()).sum::<f32>() * 8.0 / DT
    };
    let light = force(&mut simulation);
    assert!((light / 9810.0 - 1.0).abs() < 0.02, "{light} N");
    let mass = &mut simulation.world.bodies[5].mass;
    (mass.mass, mass.principal_inertia) = (1e5, mass.principal_inertia * 100.0);
    run(&mut simulation, 200);
    let heavy = force(&mut simulation);
    assert!((heavy / 981_000.0 - 1.0).abs() < 0.05, "{heavy} N");
}

type Change = fn(&mut World);

/// Bodies cannot come, go or change kind or shape yet: the step says so and does nothing.
#[test]
fn bodies_that_come_go_or_change_shape_are_refused_in_one_line() {
    let cases: [(&str, Change); 10] = [
        ("there are 25 bodies", |w| {
            w.add(cube(0.0, 20.0, 0.0));
        }),
        ("there are 23 bodies", |w| {
            w.bodies.pop();
        }),
        ("there are 24 bodies in 2 worlds", |w| w.begins.push(5)),
        ("body 3 \"\" changed", |w| w.bodies[3].kind = drystone::BodyKind::Fixed),
        ("body 3 \"\" changed", |w| w.bodies[3] = cube(0.0, 2.5, 0.0).shape(Shape::ball(0.5))),
        ("body 3 \"\" changed", |w| w.bodies[3].colliders[0].shape = Shape::ball(0.5)),
        ("body 3 \"\" changed", |w| w.bodies[3].colliders[0].position.x = 0.1),
        ("body 3 \"\" changed", |w| w.bodies[3].colliders.clear()),
        ("body 3 \"\" changed", |w| w.bodies.swap(3, 4)),
        ("body 3 \"\" changed", |w| {
            let shape = w.bodies[4].colliders.remove(0);
            w.bodies[3].colliders.push(shape);
        }),
    ];
    for (start, change) in cases {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
        run(&mut simulation, 10);
        let good = simulation.world.clone();
        change(&mut simulation.world);
        let changed = simulation.world.clone();
        let line = simulation.step(DT).expect_err(start).to_string();
        assert!(line.starts_with(start) && line.contains("make a new simulation") && !line.contains('\n'), "{line}");
        assert_eq!(Difference::between(&changed, &simulation.world), Difference::default());
        // Put right, it goes on.
        simulation.world = good;
        run(&mut simulation, 10);
    }
}

#[test]
fn a_step_of_no_length_is_refused_and_leaves_the_world_as_it_was() {
    for backend in BOTH {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), backend);
        run(&mut simulation, 5);
        let before = simulation.world.clone();
        for dt in [0.0, -DT, f32::NAN, f32::INFINITY, 1e9, 1.1, 1e-30, f32::MIN_POSITIVE] {
            let line = simulation.step(dt).expect_err("no length").to_string();
            assert!(line.starts_with("dt = "), "{line}");
            assert!(simulation.next_problem(dt).is_err());
            assert_eq!(Difference::between(&before, &simulation.world), Difference::default(), "{dt}");
        }
        for dt in [drystone::config::SHORTEST_STEP, 1e-6, DT, drystone::config::LONGEST_STEP] {
            let stats = simulation.step(dt).expect("a length");
            assert_eq!(stats.first_non_finite, None, "{dt} s");
        }
    }
}

/// The plan depends on the length of a step: a substep of less than 1/4100 s does not carry impulses as velocities.
#[test]
fn a_plan_belongs_to_a_length_of_step() {
    let [mut one, mut other] =
        BOTH.map(|backend| simulation(&standing(), &SolverConfig::default().without_sleep(), backend));
    for (step, dt) in [DT, DT, 1e-4, 1e-4, DT, 1e-3, 1e-3].into_iter().enumerate() {
        one.step(dt).expect("a step");
        let (problem, _) = other.next_problem(dt).expect("a step");
        other.step(dt).expect("a step");
        let fresh = drystone::StepPlan::new(other.config(), &problem);
        assert_eq!(other.plan(), &fresh, "step {step}, {dt} s");
        assert_eq!(Difference::between(&one.world, &other.world).bodies, 0, "step {step}, {dt} s");
    }
}

#[test]
fn a_wrong_joint_or_mass_between_steps_is_refused_by_name() {
    let cases: [(&str, Change); 6] = [
        ("gravity", |w| w.gravity.y = f32::NAN),
        ("joint 6: names a body beyond", |w| w.joints.push(BallJoint::to_world(99, Vec3::ZERO, Vec3::ZERO))),
        ("joint 0: ties body 1 to itself", |w| w.joints[0] = BallJoint::new(1, Vec3::ZERO, 1, Vec3::ZERO)),
        ("joint 0: its anchors", |w| w.joints[0].anchor_b.x = f32::NAN),
        ("body 2 \"\": mass", |w| w.bodies[2].mass.mass = -1.0),
        ("body 2 \"\": friction", |w| w.bodies[2].material.friction = f32::NAN),
    ];
    for (start, change) in cases {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
        run(&mut simulation, 3);
        change(&mut simulation.world);
        let line = simulation.step(DT).expect_err(start).to_string();
        assert!(line.starts_with(start), "{line}");
    }
}

/// Trouble in the numbers is data, wherever it comes from.
#[test]
fn no_number_that_a_body_can_have_makes_a_step_panic() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -1e25, 1e19, 1e-40] {
        let changes: [fn(&mut Body, f32); 6] = [
            |b, x| b.position.y = x,
            |b, x| b.rotation.x = x,
            |b, x| b.linear_velocity.x = x,
            |b, x| b.angular_velocity.z = x,
            |b, x| b.force.y = x,
            |b, x| (b.position, b.linear_velocity) = (Vec3::splat(x), Vec3::splat(-x)),
        ];
        for (k, change) in changes.into_iter().enumerate() {
            for early in [true, false] {
                let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
                run(&mut simulation, if early { 0 } else { 3 });
                change(&mut simulation.world.bodies[4], bad);
                let others: Vec<usize> = (6..15).collect();
                for _ in 0..5 {
                    simulation.step(DT).expect("a step");
                }
                simulation.penetration();
                simulation.manifolds().count();
                // What does not touch it does not mind.
                assert!(others.iter().all(|&i| simulation.world.bodies[i].is_finite()), "{bad} in change {k}");
            }
        }
    }
}

/// A body whose numbers are none touches nothing: its neighbors stay numbers, and what falls is still found.
#[test]
fn a_body_whose_numbers_are_none_touches_nothing() {
    let changes: [fn(&mut Body, f32); 4] = [
        |b, x| b.position.y = x,
        |b, x| b.rotation.x = x,
        |b, x| b.linear_velocity.x = x,
        |b, x| b.angular_velocity.z = x,
    ];
    for bad in [f32::NAN, f32::INFINITY] {
        for (k, change) in changes.into_iter().enumerate() {
            for early in [true, false] {
                let mut world = standing();
                let ball = world.add(Body::dynamic().shape(Shape::ball(0.3)).position(-20.0, 1.5, 0.0));
                let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), cpu);
                run(&mut simulation, if early { 0 } else { 3 });
                change(&mut simulation.world.bodies[4], bad);
                run(&mut simulation, 1);
                assert!(simulation.manifolds().all(|m| ![m.body_a, m.body_b].contains(&4)));
                run(&mut simulation, 90);
                let bodies = &simulation.world.bodies;
                let others = bodies.iter().enumerate().filter(|(i, _)| *i != 4);
                assert!(others.clone().all(|(_, b)| b.is_finite()), "{bad} in change {k}");
                assert!((bodies[ball].position.y - 0.3).abs() < 0.01, "{bad} in change {k}: {}", bodies[ball].position);
            }
        }
    }
}
