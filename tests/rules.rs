//! What single rules and settings do, each in a world that is small enough to be followed by hand.
//!
//! They run on the reference: the other backends have its bits, which `lanes` and `gpu` hold.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_6, PI};

use drystone::config::{FrictionAt, FrictionRule};
use drystone::{BallJoint, Body, Material, Reference, Shape, Simulation, SolverConfig, StepStats, World};
use glam::{Quat, Vec3};

const G: f32 = 9.81;
const DT: f32 = 1.0 / 60.0;

fn simulation(world: World, config: SolverConfig) -> Simulation {
    Simulation::new(world, config, Box::new(Reference::<f32>::new())).expect("good settings")
}

fn run(simulation: &mut Simulation, steps: u32, dt: f32) -> StepStats {
    let mut stats = StepStats::default();
    for _ in 0..steps {
        stats = simulation.step(dt).expect("a step");
    }
    stats
}

/// A world without gravity and without bodies.
fn empty() -> World {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world
}

fn floor() -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y))
}

/// A cube of 1 m and 1000 kg that lies on y = 0.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0)
}

fn ball() -> Body {
    Body::dynamic().shape(Shape::ball(0.5))
}

#[track_caller]
fn near(what: &str, measured: f32, expected: f32, tolerance: f32) {
    println!("{what}: {measured} measured, {expected} expected");
    assert!((measured - expected).abs() <= tolerance, "{what}: {measured}, not {expected}");
}

/// Velocity of a ball upwards after it met the floor at `speed`; `restitution` of the ball and of the floor.
fn bounced(speed: f32, restitution: [f32; 2]) -> f32 {
    let mut world = empty();
    world.add(floor().restitution(restitution[1]));
    let approach = Vec3::NEG_Y * speed;
    let thrown = ball().restitution(restitution[0]).position(0.0, 0.51, 0.0).velocity(approach, Vec3::ZERO);
    world.add(thrown);
    let mut simulation = simulation(world, SolverConfig::default());
    run(&mut simulation, 6, DT);
    simulation.world.bodies[1].linear_velocity.y
}

#[test]
fn a_ball_bounces_only_if_it_comes_faster_than_the_threshold() {
    let threshold = SolverConfig::default().restitution_threshold;
    near("just above", bounced(1.1 * threshold, [0.5; 2]), 0.55 * threshold, 1e-5);
    near("just below", bounced(0.9 * threshold, [0.5; 2]), 0.0, 1e-5);
}

/// How far a cube slides that begins at 4 m/s [m]; `friction` of the cube and of the ground.
fn slid(config: SolverConfig, friction: [f32; 2]) -> f32 {
    let mut world = World::new();
    world.add(floor().friction(friction[1]));
    world.add(cube().friction(friction[0]).velocity(Vec3::X * 4.0, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig { substeps: 4, ..config });
    run(&mut simulation, 360, 1.0 / 240.0);
    simulation.world.bodies[1].position.x
}

/// Along a tangent a box of two directions allows as much as the disc. Measured 1.0e-3 of it: h v / 2 for substeps of 1/960 s.
#[test]
fn a_sliding_box_stops_where_friction_says_under_every_rule() {
    use FrictionAt::{Manifold, Points};
    use FrictionRule::{Box, Disc, Slip};
    let expected = 16.0 / (2.0 * 0.4 * G);
    for (friction, friction_at) in [(Slip, Points), (Box, Points), (Disc, Points), (Box, Manifold), (Disc, Manifold)] {
        let config = SolverConfig { friction, friction_at, ..SolverConfig::default() };
        near(&format!("{friction:?} at {friction_at:?}"), slid(config, [0.4; 2]), expected, 0.005 * expected);
    }
}

#[test]
fn surfaces_combine_to_the_mean_friction_and_the_larger_restitution() {
    let material = |friction, restitution| Material { friction, restitution };
    for (a, b) in [(material(0.8, 0.1), material(0.2, 0.6)), (material(0.2, 0.6), material(0.8, 0.1))] {
        let both = a.combine(b);
        assert_eq!((both.friction, both.restitution), ((0.8_f32 * 0.2).sqrt(), 0.6));
    }
    // Mean in the sense of a product: 0.4 of 0.8 and 0.2.
    let expected = 16.0 / (2.0 * 0.4 * G);
    near("slide", slid(SolverConfig::default(), [0.8, 0.2]), expected, 0.005 * expected);
    near("lively ball", bounced(3.0, [0.8, 0.0]), 2.4, 1e-5);
    near("lively floor", bounced(3.0, [0.0, 0.8]), 2.4, 1e-5);
}

/// Friction mu N at each corner, a distance d from the axis, brakes a spin by mu m g d / I, with I = m/6 of a cube and d the half
/// of its diagonal. Measured 2e-3 of it.
#[test]
fn a_spinning_box_is_braked_by_its_load_times_mu_times_the_distance_of_its_corners() {
    for friction_at in [FrictionAt::Points, FrictionAt::Manifold] {
        let mut world = World::new();
        world.add(floor().friction(0.4));
        world.add(cube().friction(0.4));
        let mut simulation = simulation(world, SolverConfig { friction_at, ..SolverConfig::default() });
        run(&mut simulation, 60, 1.0 / 240.0);
        simulation.world.bodies[1].angular_velocity = Vec3::Y * 6.0;
        run(&mut simulation, 48, 1.0 / 240.0);
        let braking = 0.4 * G * 0.5_f32.sqrt() * 6.0;
        let spin = simulation.world.bodies[1].angular_velocity.y;
        near(&format!("{friction_at:?}, lost [rad/s]"), 6.0 - spin, braking * 0.2, 0.01 * braking * 0.2);
        // It goes on until it stands.
        run(&mut simulation, 120, 1.0 / 240.0);
        near("spin [rad/s]", simulation.world.bodies[1].angular_velocity.y, 0.0, 1e-3);
    }
}

/// A sphere that turns shows the floor the same surface. Without its radius the point that touched would turn away from the floor,
/// and the body would fall after it: 3 mm in a step.
#[test]
fn a_round_body_that_spins_in_place_stays_at_its_height() {
    let lying = Quat::from_rotation_x(FRAC_PI_2);
    for (what, shape) in
        [("ball", Shape::ball(0.3)), ("capsule", Shape::capsule(0.5, 0.3)), ("cylinder", Shape::cylinder(0.5, 0.3))]
    {
        let mut world = World::new();
        world.add(floor().friction(0.0));
        let body = Body::dynamic().shape(shape).friction(0.0).position(0.0, 0.3, 0.0);
        world.add(body.rotation(lying).velocity(Vec3::ZERO, Vec3::Z * 10.0));
        let mut simulation = simulation(world, SolverConfig::default());
        let mut farthest = 0.0_f32;
        for _ in 0..120 {
            run(&mut simulation, 1, DT);
            farthest = farthest.max((simulation.world.bodies[1].position.y - 0.3).abs());
        }
        let spin = simulation.world.bodies[1].angular_velocity;
        near(&format!("{what}, farthest [m]"), farthest, 0.0, 5e-5);
        near(&format!("{what}, spin [rad/s]"), spin.z, 10.0, 1e-3);
    }
}

/// A ball that flies 0.9 m a step and has 0.81 m to go when a step begins: farther than any margin, nearer than its way.
#[test]
fn what_comes_fast_stops_at_the_surface() {
    let way = 0.9;
    let mut world = empty();
    world.add(Body::fixed().shape(Shape::cuboid(0.5, 5.0, 5.0)));
    world.add(ball().position(-1.0 - 1.9 * way, 0.0, 0.0).velocity(Vec3::X * way / DT, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default());
    for (step, gap) in [(1, 0.9 * way), (2, 0.0), (3, 0.0)] {
        run(&mut simulation, 1, DT);
        near(&format!("gap after step {step} [m]"), -1.0 - simulation.world.bodies[1].position.x, gap, 1e-3);
    }
    near("speed [m/s]", simulation.world.bodies[1].linear_velocity.x, 0.0, 1e-3);
}

/// Implicit Euler on a spring m w² with damper 2 z m w. One joint that nothing else touches is solved exactly by one sweep.
#[test]
fn a_joint_is_the_damped_spring_that_its_settings_say() {
    for (frequency, damping) in [(0.02, 0.3), (0.02, 3.0), (0.1, 0.1)] {
        let mut world = empty();
        let hung = world.add(ball().position(0.1, 0.0, 0.0));
        world.join(BallJoint::to_world(hung, Vec3::ZERO, Vec3::ZERO));
        let h = DT / 4.0;
        let config = SolverConfig {
            substeps: 4,
            relax: 0,
            joint_frequency: frequency,
            joint_damping: damping,
            ..SolverConfig::default()
        };
        let mut simulation = simulation(world, config);
        let (w, mut x, mut v) = (2.0 * PI * frequency / h, 0.1_f32, 0.0_f32);
        for step in 1..=20 {
            run(&mut simulation, 1, DT);
            for _ in 0..4 {
                v = (v - h * w * w * x) / (1.0 + 2.0 * damping * w * h + (w * h) * (w * h));
                x += h * v;
            }
            let body = &simulation.world.bodies[hung];
            near(&format!("{frequency}, {damping}, step {step} [m]"), body.position.x, x, 2e-5);
        }
    }
}

/// A cube on a slope of 30 degrees that friction holds, after a second.
fn on_a_slope(config: SolverConfig) -> Simulation {
    let mut world = World::new();
    world.gravity = Quat::from_rotation_z(FRAC_PI_6) * Vec3::NEG_Y * G;
    world.add(floor().friction(0.7));
    world.add(cube().friction(0.7));
    let mut simulation = simulation(world, config);
    run(&mut simulation, 60, DT);
    simulation
}

#[test]
fn friction_that_a_surface_lost_is_not_carried_over() {
    let mut simulation = on_a_slope(SolverConfig::default());
    let held: f32 = simulation.problem().impulses.iter().map(|i| i.tangent_1.hypot(i.tangent_2)).sum();
    assert!(held > 1.0, "{held} N s hold it");
    // So far that the manifold is computed anew, and with it what its surfaces are.
    simulation.world.bodies[1].position.x += 0.02;
    simulation.world.bodies.iter_mut().for_each(|b| b.material.friction = 0.0);
    let impulses = &simulation.next_problem(DT).0.impulses;
    assert!(impulses.iter().all(|i| i.normal > 0.0 && (i.tangent_1, i.tangent_2) == (0.0, 0.0)), "{impulses:?}");
}

#[test]
fn without_warm_start_a_step_begins_without_impulses() {
    for warm_start in [true, false] {
        let mut simulation = on_a_slope(SolverConfig { warm_start, ..SolverConfig::default() });
        let impulses = &simulation.next_problem(DT).0.impulses;
        assert_eq!(impulses.len(), 4);
        let sums = impulses.iter().map(|i| i.normal + i.tangent_1.hypot(i.tangent_2));
        assert!(sums.into_iter().all(|sum| (sum > 0.0) == warm_start), "{warm_start}: {impulses:?}");
    }
}

/// Springs as soft as those that sink in by half a millimeter, and are preloaded by as much.
#[test]
fn a_pair_says_how_far_its_surfaces_are_apart_whatever_they_are_preloaded_by() {
    let mut world = World::new();
    world.add(floor());
    world.add(cube());
    let mut simulation = simulation(world, SolverConfig { substeps: 2, ..SolverConfig::default() });
    for _ in 0..5 {
        run(&mut simulation, 60, DT);
        let above = simulation.world.bodies[1].position.y - 0.5;
        let pair = simulation.pairs().next().expect("they touch").clone();
        let [manifold] = &pair.manifolds[..] else { panic!("one manifold") };
        assert!(manifold.preload > 1e-4, "{} m", manifold.preload);
        for point in manifold.points() {
            // Of the step that has run: as it was when that began.
            near("separation [m]", point.separation, above, 2e-5);
        }
    }
}

#[test]
fn bodies_that_part_are_no_pair_any_more() {
    let mut world = empty();
    world.add(ball());
    world.add(ball().position(1.01, 0.0, 0.0).velocity(Vec3::X * 3.0, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default());
    assert_eq!(run(&mut simulation, 1, DT).pairs, 1);
    assert_eq!(run(&mut simulation, 60, DT).pairs, 0);
    // And a pair again when they come back.
    simulation.world.bodies[1].linear_velocity = Vec3::X * -3.0;
    assert_eq!(run(&mut simulation, 60, DT).pairs, 1);
}
