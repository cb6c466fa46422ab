//! What lies still sleeps, stays where it is, costs nothing, and wakes when it is disturbed.

use crate::common::state::joint_impulses;
use drystone::{Axis, Body, Cpu, Joint, Shape, Simulation, SolverConfig, StepStats, World};
use drystone_scenes::Scene;
use glam::{Quat, Vec3};

const DT: f32 = 1.0 / 60.0;

fn sleepy() -> SolverConfig {
    SolverConfig::default().with(|c| c.sleep_after = 0.5)
}

fn simulation(world: World, config: SolverConfig) -> Simulation {
    Simulation::with(world, config, Box::new(Cpu::new())).expect("good settings")
}

fn run(simulation: &mut Simulation, steps: u32) -> StepStats {
    let mut stats = StepStats::default();
    for _ in 0..steps {
        stats = simulation.step(DT).expect("a step");
    }
    stats
}

/// Every bit of every pose and velocity.
fn bits(world: &World) -> Vec<u32> {
    let of = |b: &Body| {
        let vectors = [b.position, b.linear_velocity, b.angular_velocity].map(|v| v.to_array()).concat();
        [&vectors[..], &b.rotation.to_array()].concat().into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    world.bodies.iter().flat_map(of).collect()
}

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

fn floor() -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y))
}

/// A floor and two stacks of three, 10 m apart; bodies 1 to 3 and 4 to 6.
fn stacks() -> World {
    let mut world = World::new();
    world.insert(floor());
    for x in [0.0, 10.0] {
        for k in 0..3 {
            world.insert(cube(x, 0.5 + k as f32));
        }
    }
    world
}

fn asleep(simulation: &Simulation, bodies: std::ops::Range<usize>) -> bool {
    let is_asleep = |b: &usize| simulation.is_asleep(simulation.world.bodies.handle(*b).expect("a body"));
    let count = bodies.clone().filter(is_asleep).count();
    assert!(count == 0 || count == bodies.len(), "{count} of {bodies:?} sleep: an island sleeps as a whole");
    count > 0
}

/// It keeps its island awake and no other, wakes when it may no longer sleep, and sleeps when it may again.
#[test]
fn a_body_that_may_not_sleep_keeps_its_island_awake() {
    let mut world = stacks();
    world.bodies[2].can_sleep = false;
    let mut simulation = simulation(world, sleepy());
    // In every single step: what falls asleep all the same is woken in the next one.
    for _ in 0..120 {
        run(&mut simulation, 1);
        assert!(!asleep(&simulation, 1..4));
    }
    assert!(asleep(&simulation, 4..7));
    simulation.world.bodies[2].can_sleep = true;
    run(&mut simulation, 60);
    assert!(asleep(&simulation, 1..4));
    simulation.world.bodies[5].can_sleep = false;
    run(&mut simulation, 60);
    assert!(asleep(&simulation, 1..4) && !asleep(&simulation, 4..7));
    let mut loaded = Simulation::load(&simulation.save(), Box::new(Cpu::new())).expect("what was saved");
    run(&mut loaded, 60);
    assert!(asleep(&loaded, 1..4) && !asleep(&loaded, 4..7));
}

/// A cube 16 mm deep in the floor comes out at 5 mm/s, which is slow enough to sleep: it slept 12 mm deep.
#[test]
fn what_still_comes_out_of_another_body_stays_awake() {
    let mut world = World::new();
    world.insert(floor());
    let deep = world.insert(cube(0.0, 0.484));
    // Walls hold this one for ever. It sleeps all the same.
    for x in [9.02, 11.0 - 0.02] {
        world.insert(Body::fixed().shape(Shape::cuboid(0.5, 1.0, 1.0)).position(x, 1.0, 0.0));
    }
    let held = world.insert(cube(10.0, 0.5));
    let mut simulation = simulation(world, sleepy().with(|c| c.push_limit = 5e-3));
    run(&mut simulation, 90);
    let height = simulation.world.bodies[deep].position.y;
    assert!((0.485..0.495).contains(&height) && !simulation.is_asleep(deep), "{height}");
    run(&mut simulation, 510);
    let height = simulation.world.bodies[deep].position.y;
    assert!((height - 0.5).abs() < 2e-3 && simulation.is_asleep(deep), "{height}");
    assert!(simulation.is_asleep(held) && simulation.penetration().max > 0.015);
}

/// Two stacks that have fallen asleep.
fn sleeping() -> Simulation {
    let mut simulation = simulation(stacks(), sleepy());
    let stats = run(&mut simulation, 300);
    assert_eq!(stats.asleep, 6);
    simulation
}

#[test]
fn stacks_fall_asleep_and_stay_where_they_are_to_the_last_bit() {
    let mut simulation = sleeping();
    let before = bits(&simulation.world);
    let deepest = simulation.penetration().max;
    let stats = run(&mut simulation, 600);
    assert_eq!((stats.asleep, stats.manifolds, stats.pairs), (6, 0, 0), "nothing is worked on");
    assert_eq!(before, bits(&simulation.world));
    assert_eq!(simulation.penetration().max, deepest);
    assert!(deepest < 1e-3, "{deepest}");
}

#[test]
fn what_rests_sleeps_unless_told_otherwise() {
    let asleep = |config: SolverConfig| run(&mut simulation(stacks(), config), 300).asleep;
    assert_eq!(asleep(SolverConfig::default()), 6);
    assert_eq!(asleep(SolverConfig::default().without_sleep()), 0);
}

#[test]
fn where_nothing_sleeps_sleeping_changes_no_bit() {
    let world = || Scene::find("pile", &["n=100".into()]).expect("the scene").world;
    let mut with = simulation(world(), sleepy());
    let mut without = simulation(world(), SolverConfig::default().without_sleep());
    for step in 0..60 {
        let stats = with.step(DT).expect("a step");
        without.step(DT).expect("a step");
        assert_eq!(stats.asleep, 0);
        assert_eq!(bits(&with.world), bits(&without.world), "step {step}");
    }
}

#[test]
fn a_thrown_box_wakes_the_stack_that_it_hits_and_no_other() {
    let mut world = stacks();
    let thrown = world.insert(cube(30.0, 50.0));
    let mut simulation = simulation(world, sleepy());
    // On its way for 3 s: the stacks sleep by then, and the box does not, though it touches nothing.
    run(&mut simulation, 170);
    assert!(asleep(&simulation, 1..4) && asleep(&simulation, 4..7) && !simulation.is_asleep(thrown));
    let body = &mut simulation.world.bodies[thrown];
    (body.position, body.linear_velocity) = (Vec3::new(4.0, 1.5, 0.0), Vec3::new(-20.0, 0.0, 0.0));
    let before = simulation.world.bodies[2].position;
    run(&mut simulation, 30);
    assert!(!asleep(&simulation, 1..4) && asleep(&simulation, 4..7));
    assert!(simulation.world.bodies[2].position.distance(before) > 0.5);
}

#[test]
fn whatever_is_changed_from_outside_wakes_its_island() {
    type Change = fn(&mut World);
    let changes: [(&str, Change); 5] = [
        ("velocity", |w| w.bodies[3].linear_velocity.y = 1.0),
        ("position", |w| w.bodies[1].position.x += 0.01),
        ("rotation", |w| w.bodies[2].rotation = Quat::from_rotation_y(0.1)),
        ("force", |w| w.bodies[1].force = Vec3::X),
        ("spin", |w| w.bodies[1].angular_velocity = Vec3::Y),
    ];
    for (what, change) in changes {
        let mut simulation = sleeping();
        change(&mut simulation.world);
        run(&mut simulation, 1);
        assert!(!asleep(&simulation, 1..4) && asleep(&simulation, 4..7), "{what}");
    }
    let mut simulation = sleeping();
    simulation.world.gravity = Vec3::new(5.0, -9.81, 0.0);
    run(&mut simulation, 1);
    assert!(!asleep(&simulation, 1..4) && !asleep(&simulation, 4..7));
}

/// A cube on a kinematic plate.
fn on_a_plate() -> Simulation {
    let mut world = World::new();
    world.insert(Body::kinematic().shape(Shape::cuboid(2.0, 0.5, 2.0)).position(0.0, -0.5, 0.0));
    world.insert(cube(0.0, 0.5));
    let mut simulation = simulation(world, sleepy());
    run(&mut simulation, 300);
    assert!(asleep(&simulation, 1..2));
    simulation
}

#[test]
fn a_kinematic_body_that_moves_wakes_what_lies_on_it_and_lets_nothing_sleep() {
    let mut simulation = on_a_plate();
    simulation.world.bodies[0].linear_velocity = Vec3::new(5e-4, 0.0, 0.0);
    run(&mut simulation, 300);
    assert!(!asleep(&simulation, 1..2), "slow, but carried");
    let ahead = simulation.world.bodies[1].position.x;
    assert!((ahead - 5e-4 * 5.0).abs() < 1e-4, "{ahead}");
    simulation.world.bodies[0].linear_velocity = Vec3::ZERO;
    run(&mut simulation, 120);
    assert!(asleep(&simulation, 1..2));
}

#[test]
fn what_lay_on_a_body_that_is_taken_away_falls() {
    let mut simulation = on_a_plate();
    simulation.world.bodies[0].position.y = -50.0;
    run(&mut simulation, 60);
    assert!(simulation.world.bodies[1].position.y < -3.0, "{}", simulation.world.bodies[1].position);
}

#[test]
fn a_chain_sleeps_and_wakes_as_a_whole() {
    let mut world = World::new();
    let link = |y: f32| Body::dynamic().shape(Shape::ball(0.2)).position(0.0, y, 0.0);
    let first = world.insert(link(-0.5));
    world.insert_joint(Joint::to_world(first, Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO));
    let mut last = first;
    for k in 1..4 {
        let next = world.insert(link(-0.5 - k as f32));
        world.insert_joint(Joint::new(last, Vec3::new(0.0, -0.5, 0.0), next, Vec3::new(0.0, 0.5, 0.0)));
        last = next;
    }
    // Beside it a body that stays awake, so that steps go on.
    let awake = world.insert(cube(100.0, 0.0));
    let mut simulation = simulation(world, sleepy());
    run(&mut simulation, 120);
    assert!(asleep(&simulation, 0..4) && !simulation.is_asleep(awake));
    assert!(simulation.problem().joint_colors().is_empty());
    let impulse = joint_impulses(&simulation)[0];
    simulation.world.bodies[last].linear_velocity.x = 0.5;
    let stats = run(&mut simulation, 1);
    assert!(!asleep(&simulation, 0..4) && stats.joints == 4);
    // It carries what it carried.
    assert!(joint_impulses(&simulation)[0].distance(impulse) < 0.05 * impulse.length());
    run(&mut simulation, 60);
    assert!(simulation.world.joint_gap() < 1e-3);
}

#[test]
fn a_pile_that_sleeps_and_is_hit_gives_the_same_bits_for_any_number_of_threads() {
    let after = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut world = Scene::find("pile", &["n=100".into()]).expect("the scene").world;
            let thrown = world.insert(cube(0.0, 300.0));
            let mut simulation = simulation(world, sleepy());
            let sleeping = run(&mut simulation, 360).asleep;
            assert!(sleeping >= 90, "{sleeping} sleep");
            let body = &mut simulation.world.bodies[thrown];
            (body.position, body.linear_velocity) = (Vec3::new(0.0, 8.0, 0.0), Vec3::new(0.0, -10.0, 0.0));
            let woken = run(&mut simulation, 40).asleep;
            assert!(woken < sleeping, "{woken} of {sleeping}");
            run(&mut simulation, 40);
            bits(&simulation.world)
        })
    };
    let one = after(1);
    for threads in [2, 5] {
        assert!(one == after(threads), "{threads} threads");
    }
}

#[test]
fn every_domino_of_a_row_still_falls() {
    let scene = Scene::find("dominoes", &[]).expect("the scene");
    let mut with = simulation(scene.world.clone(), sleepy());
    let mut without = simulation(scene.world, SolverConfig::default());
    run(&mut with, scene.steps);
    run(&mut without, scene.steps);
    let fallen = |s: &Simulation| s.world.bodies.iter().filter(|b| (b.rotation * Vec3::Y).y < 0.7).count();
    assert!(fallen(&without) > 5, "{}", fallen(&without));
    assert_eq!(fallen(&with), fallen(&without));
}

/// A cube without friction that slides over the floor without gravity, turning about the vertical, and what became of it.
fn drifting(velocity: Vec3, spin: f32, config: SolverConfig) -> Simulation {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world.insert(floor().friction(0.0));
    world.insert(cube(0.0, 0.5).friction(0.0).velocity(velocity, Vec3::Y * spin));
    simulation(world, config)
}

/// Islands are looked for in every eighth step: half a second is 30 steps, the next eighth is 32.
#[test]
fn what_is_still_falls_asleep_after_the_time_that_was_set() {
    for (after, step) in [(0.5, 32), (0.25, 16), (1.0, 64)] {
        let mut simulation = drifting(Vec3::ZERO, 0.0, SolverConfig::default().with(|c| c.sleep_after = after));
        assert_eq!(run(&mut simulation, step - 1).asleep, 0, "{after} s");
        assert_eq!(run(&mut simulation, 1).asleep, 1, "{after} s");
    }
}

/// The fastest point counts: a corner of the cube is sqrt(3)/2 m from its middle.
#[test]
fn speed_and_spin_just_above_the_limit_keep_awake() {
    let limit = 0.02;
    let config = || sleepy().with(|c| c.sleep_speed = limit);
    for (share, asleep) in [(0.95, 1), (1.05, 0)] {
        let speed = share * limit;
        assert_eq!(run(&mut drifting(Vec3::X * speed, 0.0, config()), 64).asleep, asleep, "{speed} m/s");
        let spin = speed / 0.75_f32.sqrt();
        assert_eq!(run(&mut drifting(Vec3::ZERO, spin, config()), 64).asleep, asleep, "{spin} rad/s");
        let both = drifting(Vec3::X * 0.5 * speed, 0.5 * spin, config());
        assert_eq!(run(&mut { both }, 64).asleep, asleep, "{spin} rad/s and {speed} m/s, half of each");
    }
}

#[test]
fn what_falls_asleep_stands_still() {
    let mut simulation = drifting(Vec3::X * 5e-3, 5e-3, sleepy());
    run(&mut simulation, 31);
    let before = simulation.world.bodies[1].clone();
    assert!(before.linear_velocity.x > 4e-3 && before.angular_velocity.y > 4e-3 && before.position.x > 2e-3);
    assert_eq!(run(&mut simulation, 1).asleep, 1);
    let after = &simulation.world.bodies[1];
    assert_eq!((after.linear_velocity, after.angular_velocity), (Vec3::ZERO, Vec3::ZERO));
}

#[test]
fn what_touches_nothing_never_sleeps() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let alone = world.insert(cube(0.0, 50.0));
    world.insert(floor());
    let held = world.insert(cube(0.0, 0.5));
    let mut simulation = simulation(world, sleepy());
    assert_eq!(run(&mut simulation, 120).asleep, 1);
    assert!(!simulation.is_asleep(alone) && simulation.is_asleep(held));
}

/// In every single step: what falls asleep there is woken in the next one.
#[test]
fn what_a_moving_body_carries_is_never_asleep() {
    let mut simulation = on_a_plate();
    simulation.world.bodies[0].linear_velocity = Vec3::new(5e-4, 0.0, 0.0);
    for step in 0..120 {
        assert_eq!(run(&mut simulation, 1).asleep, 0, "step {step}");
    }
}

#[test]
fn what_was_woken_stays_awake_for_the_time_that_was_set() {
    let mut simulation = sleeping();
    simulation.wake(simulation.world.bodies.handle(1).expect("a cube"));
    // Its island wakes with it, before any step.
    assert!(!asleep(&simulation, 1..4) && asleep(&simulation, 4..7));
    for step in 1..=30 {
        let stats = run(&mut simulation, 1);
        assert_eq!(stats.asleep, 3, "{step} steps are not half a second");
    }
    assert_eq!(run(&mut simulation, 8).asleep, 6);
}

/// Slow for 0.4 s, fast for one step, slow for 0.4 s: half a second is never in one piece.
#[test]
fn what_moves_now_and_then_does_not_sleep() {
    let mut simulation = drifting(Vec3::ZERO, 0.0, sleepy());
    for _ in 0..8 {
        assert_eq!(run(&mut simulation, 24).asleep, 0);
        simulation.world.bodies[1].linear_velocity.x = 0.1;
        assert_eq!(run(&mut simulation, 1).asleep, 0);
        simulation.world.bodies[1].linear_velocity.x = 0.0;
    }
}

/// A cube with a ball on an arm of 2 m, which its middle hardly moves with.
#[test]
fn a_shape_on_a_long_arm_counts_with_its_arm() {
    let limit = sleepy().sleep_speed;
    for (share, asleep) in [(0.9, 1), (1.1, 0)] {
        let mut world = World::new();
        world.gravity = Vec3::ZERO;
        world.insert(floor().friction(0.0));
        let ball = Shape::ball(0.5);
        let arms = Body::dynamic().shape_at(ball.clone(), Vec3::X * 2.0, Quat::IDENTITY);
        let arms = arms.shape_at(ball, Vec3::X * -2.0, Quat::IDENTITY).friction(0.0).position(0.0, 0.5, 0.0);
        world.insert(arms.velocity(Vec3::ZERO, Vec3::Y * share * limit / 2.5));
        assert_eq!(run(&mut simulation(world, sleepy()), 64).asleep, asleep, "{share} of the limit");
    }
}

/// A cube that drifts on and one that lies against it: one island.
#[test]
fn what_touches_what_moves_does_not_sleep() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world.insert(floor().friction(0.0));
    world.insert(cube(0.0, 0.5).friction(0.0));
    world.insert(cube(1.0, 0.5).friction(0.0).velocity(Vec3::Z * 0.1, Vec3::ZERO));
    let mut simulation = simulation(world, sleepy());
    for step in 0..120 {
        assert_eq!(run(&mut simulation, 1).asleep, 0, "step {step}");
    }
}

#[test]
fn a_body_that_was_put_elsewhere_is_at_rest_again() {
    let mut simulation = on_a_plate();
    simulation.world.bodies[0].position.x += 0.01;
    assert_eq!(run(&mut simulation, 1).asleep, 0);
    assert_eq!(run(&mut simulation, 120).asleep, 1);
}

/// A load that sleeps on a joint to a body that a caller moves in any way wakes and follows.
#[test]
fn what_is_tied_to_a_body_that_moves_wakes() {
    type Tie = fn(Joint) -> Joint;
    let ties: [(&str, Tie); 6] = [
        ("ball", |joint| joint),
        ("hinge with friction", |joint| joint.hinge(Vec3::Z).motor(0.0, 0.1)),
        ("fixed", |joint| joint.fixed()),
        ("rope", |joint| Joint { anchor_a: Vec3::ZERO, ..joint }.rope(2.0)),
        ("rod", |joint| Joint { anchor_a: Vec3::ZERO, ..joint }.rod(2.0)),
        ("spring", |joint| Joint { anchor_a: Vec3::ZERO, ..joint }.elastic(1.8, 2.0, 1.0)),
    ];
    type Change = fn(&mut Body);
    let changes: [(&str, Body, Change); 5] = [
        ("a velocity", Body::kinematic(), |hand| hand.linear_velocity = Vec3::X * 3.0),
        ("move_to", Body::kinematic(), |hand| hand.move_to(hand.position + Vec3::X * 0.05, hand.rotation, DT)),
        ("a place", Body::kinematic(), |hand| hand.position.x += 0.5),
        ("a place of a fixed body", Body::fixed(), |hand| hand.position.x += 0.5),
        ("a kind", Body::kinematic(), |hand| *hand = Body::dynamic().shape(Shape::ball(0.2))),
    ];
    for (tie, tied) in ties {
        for (change, hand, changed) in &changes {
            for swap in [false, true] {
                let mut world = World::new();
                let hand = world.insert(hand.clone().shape(Shape::ball(0.2)));
                let load = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, -2.0, 0.0));
                let joint = tied(Joint::new(load, Vec3::Y * 2.0, hand, Vec3::ZERO));
                let Joint { body_a, anchor_a, anchor_b, .. } = joint;
                world.insert_joint(match swap {
                    true => {
                        Joint { body_a: hand, body_b: Some(body_a), anchor_a: anchor_b, anchor_b: anchor_a, ..joint }
                    }
                    false => joint,
                });
                let mut simulation = simulation(world, sleepy());
                run(&mut simulation, 300);
                assert!(simulation.is_asleep(load), "{tie}: awake");
                changed(&mut simulation.world.bodies[hand]);
                run(&mut simulation, 1);
                assert!(!simulation.is_asleep(load), "{tie}: {change} of the other body leaves it asleep, {swap}");
                run(&mut simulation, 60);
                let gap = simulation.world.joint_gap();
                assert!(gap < 0.05, "{tie}: {change}, {gap} m");
            }
        }
    }
}

/// Bodies in free fall are not held by a joint that only keeps them from colliding.
#[test]
fn what_a_joint_of_free_axes_ties_never_sleeps() {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    let [a, b] = [0.0, 0.5].map(|x| world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(x, 0.0, 0.0)));
    world.insert_joint(Joint::new(a, Vec3::ZERO, b, Vec3::ZERO).generic([Axis::FREE; 3], [Axis::FREE; 3]));
    let mut simulation = simulation(world, sleepy());
    run(&mut simulation, 120);
    assert!(!asleep(&simulation, 0..2));
}
