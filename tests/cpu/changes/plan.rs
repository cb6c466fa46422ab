//! The length of a step: impulses and preloads follow it, and so does the plan.

use drystone::glam::Vec3;
use drystone::stages::problem::StepProblem;
use drystone::{Body, Joint, Shape, Simulation, SolverConfig, World};
use drystone_conform::compare::Difference;
use drystone_scenes::Scene;

use super::{BOTH, DT, cpu, cube, fastest, ground, reference, run, simulation, standing};

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

/// The plan of a step is that of its problem, whatever began or ended before it.
#[test]
fn a_plan_is_always_that_of_its_problem() {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut world = standing();
    // A ball that comes down after the rest fell asleep, and bounces; cubes and balls turn without a gyroscopic pass.
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.3)).position(-20.0, 60.0, 0.0).restitution(0.8));
    let mut simulation = simulation(&world, &config, cpu);
    let (mut plans, mut steps) = (Vec::new(), 0);
    for step in 0..420 {
        if step == 200 {
            let last = *simulation.world.joints.handles().last().expect("a joint");
            simulation.world.remove_joint(last);
        }
        if simulation.step(DT).expect("a step").dispatches == 0 {
            continue;
        }
        steps += 1;
        let fresh = drystone::stages::plan::StepPlan::new(&config, &simulation.problem().clone());
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
    let bodies = problem.blocks[0].bodies as usize;
    assert_eq!(problem.colors[..=bodies], colors[..=bodies], "other colors ask for another plan anyway");
    assert_eq!(simulation.plan(), &drystone::stages::plan::StepPlan::new(&config, &problem));
}

#[test]
fn a_plan_follows_contacts_and_lengths_of_steps_where_its_colors_stay() {
    let mut world = World::new();
    world.insert(ground());
    let cube = world.insert(cube(0.0, 0.5, 0.0));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.3)).position(5.0, 9.0, 0.0).restitution(0.5));
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
    let rod = world.insert(Body::dynamic().shape(Shape::cuboid(0.1, 0.5, 0.1)).position(0.0, -0.5, 0.0));
    world.insert_joint(Joint::to_world(rod, Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.3)).position(5.0, 0.0, 0.0));
    world.insert_joint(Joint::to_world(ball, Vec3::ZERO, Vec3::new(5.0, 0.0, 0.0)));
    let mut simulation = simulation(&world, &SolverConfig::default().with(|c| c.sleep_after = 0.3), cpu);
    for _ in 0..60 {
        simulation.world.bodies[ball].linear_velocity.y = 0.1;
        run(&mut simulation, 1);
    }
    assert!(simulation.is_asleep(rod) && !simulation.is_asleep(ball));
    run(&mut simulation, 60);
    assert!(simulation.is_asleep(ball) && simulation.problem().inertias.is_empty());
    let colors = simulation.problem().colors.clone();
    assert_planned_anew(&mut simulation, &colors);
    simulation.wake(rod);
    run(&mut simulation, 1);
    assert!(!simulation.problem().inertias.is_empty());
    assert_planned_anew(&mut simulation, &colors);
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
        assert_ne!(problem.blocks, other.blocks);
        let (again, plan_again) = asked.next_problem(DT).expect("a step");
        assert!(problem == again && plan == plan_again, "step {step}: a second answer");
        asked.step(DT).expect("a step");
        left.step(DT).expect("a step");
        assert_eq!(Difference::between(&asked.world, &left.world).bodies, 0, "step {step}");
        assert_eq!(asked.problem(), left.problem(), "step {step}");
    }
    assert!(left.problem().contacts.iter().any(|c| c.preload > 0.0), "nothing bears anything");
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
        let fresh = drystone::stages::plan::StepPlan::new(other.config(), &problem);
        assert_eq!(other.plan(), &fresh, "step {step}, {dt} s");
        assert_eq!(Difference::between(&one.world, &other.world).bodies, 0, "step {step}, {dt} s");
    }
}
