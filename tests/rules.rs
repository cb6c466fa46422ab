//! What single rules and settings do, each in a world that is small enough to be followed by hand.
//!
//! They run on the reference: the other backends have its bits, which `lanes` and `gpu` hold, and the last of these for what a
//! device carries from step to step.

use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_6, PI};

use drystone::config::{Friction, FrictionAt};
use drystone::stages::problem::{ContactRow, PointRow};
use drystone::{
    BallJoint, Body, Material, Reference, Scene, Shape, Simulation, SolverConfig, StepProblem, StepStats, World,
};
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
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
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
    let mut simulation = simulation(world, config.with(|c| c.substeps = 4));
    run(&mut simulation, 360, 1.0 / 240.0);
    simulation.world.bodies[1].position.x
}

/// Along a tangent a box of two directions allows as much as the disc. Measured 1.0e-3 of it: h v / 2 for substeps of 1/960 s.
#[test]
fn a_sliding_box_stops_where_friction_says_under_every_rule() {
    use Friction::{Box, Disc};
    use FrictionAt::{Manifold, Points};
    let expected = 16.0 / (2.0 * 0.4 * G);
    let rules = [
        (Disc, true, Points),
        (Box, false, Points),
        (Disc, false, Points),
        (Box, false, Manifold),
        (Disc, false, Manifold),
    ];
    for (friction, slip, friction_at) in rules {
        let config = SolverConfig::default().without_sleep().with(|c| {
            c.friction = friction;
            c.rules.slip_friction = slip;
            c.friction_at = friction_at;
        });
        near(
            &format!("{friction:?}, slip {slip}, at {friction_at:?}"),
            slid(config, [0.4; 2]),
            expected,
            0.005 * expected,
        );
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
    near("slide", slid(SolverConfig::default().without_sleep(), [0.8, 0.2]), expected, 0.005 * expected);
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
        let mut simulation =
            simulation(world, SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at));
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
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
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
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
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
        let config = SolverConfig::default().without_sleep().with(|c| {
            c.substeps = 4;
            c.relax = 0;
            c.joint_frequency = frequency;
            c.joint_damping = damping;
        });
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
    on_a_slope_that_falls(Quat::IDENTITY, config)
}

/// The same with the slope turned about the vertical.
fn on_a_slope_that_falls(turn: Quat, config: SolverConfig) -> Simulation {
    let mut world = World::new();
    world.gravity = turn * Quat::from_rotation_z(FRAC_PI_6) * Vec3::NEG_Y * G;
    world.add(floor().friction(0.7));
    world.add(cube().friction(0.7));
    let mut simulation = simulation(world, config);
    run(&mut simulation, 60, DT);
    simulation
}

#[test]
fn friction_that_a_surface_lost_is_not_carried_over() {
    let mut simulation = on_a_slope(SolverConfig::default().without_sleep());
    let held: f32 = simulation.problem().impulses.iter().map(|i| i.tangent_1.hypot(i.tangent_2)).sum();
    assert!(held > 1.0, "{held} N s hold it");
    // So far that the manifold is computed anew, and with it what its surfaces are.
    simulation.world.bodies[1].position.x += 0.02;
    simulation.world.bodies.iter_mut().for_each(|b| b.material.friction = 0.0);
    let impulses = &simulation.next_problem(DT).expect("a step").0.impulses;
    assert!(impulses.iter().all(|i| i.normal > 0.0 && (i.tangent_1, i.tangent_2) == (0.0, 0.0)), "{impulses:?}");
}

#[test]
fn without_warm_start_a_step_begins_without_impulses() {
    for warm_start in [true, false] {
        let mut simulation = on_a_slope(SolverConfig::default().without_sleep().with(|c| c.warm_start = warm_start));
        let impulses = &simulation.next_problem(DT).expect("a step").0.impulses;
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
    let mut simulation = simulation(world, SolverConfig::default().without_sleep().with(|c| c.substeps = 2));
    for _ in 0..5 {
        run(&mut simulation, 60, DT);
        let above = simulation.world.bodies[1].position.y - 0.5;
        let manifolds: Vec<_> = simulation.manifolds().collect();
        let [manifold] = &manifolds[..] else { panic!("one manifold") };
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
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    assert_eq!(run(&mut simulation, 1, DT).pairs, 1);
    assert_eq!(run(&mut simulation, 60, DT).pairs, 0);
    // And a pair again when they come back.
    simulation.world.bodies[1].linear_velocity = Vec3::X * -3.0;
    assert_eq!(run(&mut simulation, 60, DT).pairs, 1);
}

/// Dropped from 2 m above its height at rest: up again to e² of that. Measured 2e-3 of it.
#[test]
fn a_ball_bounces_to_the_square_of_its_restitution() {
    for e in [0.5, 0.9] {
        let mut world = World::new();
        world.add(floor());
        world.add(ball().restitution(e).position(0.0, 2.5, 0.0));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        let (mut highest, mut bounced) = (0.0_f32, false);
        for _ in 0..600 {
            run(&mut simulation, 1, 1.0 / 240.0);
            let body = &simulation.world.bodies[1];
            if bounced && body.linear_velocity.y < 0.0 {
                break;
            }
            bounced |= body.linear_velocity.y > 0.0;
            highest = if bounced { highest.max(body.position.y - 0.5) } else { 0.0 };
        }
        near(&format!("height of the bounce of {e} [m]"), highest, 2.0 * e * e, 2e-3 * e * e);
    }
}

/// A bounce asks for a push within its own step: a ball that lies still has one from the step before.
#[test]
fn what_was_pressed_in_the_step_before_does_not_bounce() {
    let mut world = World::new();
    world.add(floor().restitution(0.5));
    world.add(ball().restitution(0.5).position(0.0, 0.5, 0.0));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let problem = simulation.next_problem(DT).expect("a step").0;
    let impulses: Vec<_> = problem.swept_contacts().map(|c| problem.impulses[c.first_point as usize]).collect();
    assert!(impulses.len() == 1 && impulses[0].normal > 0.0 && impulses[0].peak == 0.0, "{impulses:?}");
}

/// Slip friction acts against the slip, which goes along neither tangent here.
#[test]
fn slip_friction_acts_against_the_slip() {
    let mut world = World::new();
    world.add(floor().friction(0.4));
    let direction = Vec3::new(0.6, 0.0, 0.8);
    world.add(cube().friction(0.4).velocity(direction * 4.0, Vec3::ZERO));
    let config = SolverConfig::default().without_sleep().with(|c| c.rules.slip_friction = true);
    let mut simulation = simulation(world, config);
    run(&mut simulation, 120, 1.0 / 240.0);
    let velocity = simulation.world.bodies[1].linear_velocity;
    near("along [m/s]", velocity.dot(direction), 4.0 - 0.4 * G * 0.5, 0.02);
    near("across [m/s]", velocity.cross(direction).y, 0.0, 0.02);
}

#[test]
fn arms_end_midway_between_the_surfaces() {
    let mut world = empty();
    world.add(floor());
    world.add(ball().position(0.0, 0.51, 0.0));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 1, DT);
    let manifold = simulation.manifolds().next().expect("near enough");
    let point = manifold.points()[0];
    let bodies = [manifold.body_a, manifold.body_b].map(|b| simulation.world.bodies[b].position);
    for (center, arm) in bodies.into_iter().zip([point.r_a, point.r_b]) {
        near("height of the contact [m]", (center + arm).y, 0.005, 1e-6);
    }
}

/// A manifold is computed anew once its bodies moved by 2 % of their half extents, seen from each other, or turned by as much.
#[test]
fn a_contact_is_computed_anew_once_its_bodies_moved_or_turned() {
    let computed = |velocity: Vec3, spin: Vec3| {
        let mut world = empty();
        world.add(floor().friction(0.0));
        world.add(cube().friction(0.0).velocity(velocity, spin));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        run(&mut simulation, 1, DT);
        (1..=30).find(|_| run(&mut simulation, 1, DT).computed > 0)
    };
    // 1 cm: at 2 mm a step after five, where rounding lets it.
    assert!(
        matches!(computed(Vec3::X * 0.002 / DT, Vec3::ZERO), Some(5 | 6)),
        "{:?}",
        computed(Vec3::X * 0.12, Vec3::ZERO)
    );
    assert_eq!(computed(Vec3::ZERO, Vec3::ZERO), None);
    // The corner, 0.87 m from the middle, goes 1 cm: 12 mrad.
    let turned = computed(Vec3::ZERO, Vec3::Y * 0.002 / DT);
    assert!(matches!(turned, Some(5..=7)), "{turned:?}");
}

/// Slow, so that the contact is looked for nearby; then fast, within the distance at which it would be reused.
#[test]
fn what_comes_slowly_and_then_fast_stops_at_the_surface() {
    let mut world = empty();
    world.add(Body::fixed().shape(Shape::cuboid(0.5, 5.0, 5.0)));
    world.add(ball().position(-1.06, 0.0, 0.0));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 2, DT);
    simulation.world.bodies[1].linear_velocity.x = 0.5 / DT;
    for _ in 0..3 {
        run(&mut simulation, 1, DT);
        let gap = -1.0 - simulation.world.bodies[1].position.x;
        near("gap [m]", gap, 0.0, 1e-3);
    }
}

/// A plank 1 cm above the floor, farther than the margin of 4 mm. Its end comes down by more within the step if it turns.
#[test]
fn what_turns_fast_is_looked_ahead_for() {
    for (spin, manifolds) in [(8.0, 1), (0.0, 0)] {
        let mut world = empty();
        world.add(floor());
        let plank = Body::dynamic().shape(Shape::cuboid(1.0, 0.1, 0.1)).position(0.0, 0.11, 0.0);
        world.add(plank.velocity(Vec3::ZERO, Vec3::Z * -spin));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        assert_eq!(run(&mut simulation, 1, DT).manifolds, manifolds, "{spin} rad/s");
    }
}

/// The end of a cylinder is flat: tilted, it stands on its edge, which turns with it.
#[test]
fn a_cylinder_that_stands_is_flat_and_one_that_lies_is_round() {
    for (turn, radius) in [(Quat::IDENTITY, 0.0), (Quat::from_rotation_x(FRAC_PI_2), 0.3)] {
        let mut world = World::new();
        world.add(floor());
        let height = if radius == 0.0 { 0.5 } else { 0.3 };
        world.add(Body::dynamic().shape(Shape::cylinder(0.5, 0.3)).rotation(turn).position(0.0, height, 0.0));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        run(&mut simulation, 1, DT);
        let row = *simulation.problem().swept_contacts().next().expect("it touches");
        assert_eq!(row.radius_a.max(row.radius_b), radius);
    }
}

#[test]
fn bodies_that_nothing_pushes_are_no_pair() {
    let mut world = World::new();
    world.add(floor());
    for x in [0.0, 0.5] {
        world.add(Body::kinematic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, 0.5, 0.0));
    }
    assert_eq!(run(&mut simulation(world, SolverConfig::default().without_sleep()), 1, DT).pairs, 0);
}

#[test]
fn the_row_of_a_patch_is_the_middle_of_its_points_with_the_masses_there() {
    let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = FrictionAt::Manifold);
    let mut simulation = on_a_slope(config);
    let problem = simulation.next_problem(DT).expect("a step").0;
    let [points @ .., patch] = &problem.points[..] else { panic!("points and a patch") };
    assert_eq!(points.len(), 4);
    let near_middle = |arm: [f32; 3], of: fn(&PointRow) -> [f32; 3]| {
        let middle = points.iter().map(|p| Vec3::from(of(p))).sum::<Vec3>() / 4.0;
        assert!(middle.distance(arm.into()) < 1e-6, "{arm:?}, not {middle}");
    };
    near_middle(patch.r_a, |p| p.r_a);
    near_middle(patch.r_b, |p| p.r_b);
    // About the vertical a cube of 1000 kg has 1000/6 kg m²; pushed below its middle it feels 1/m + 1/4 over m/6.
    near("twist [kg m²]", patch.normal_mass, 1000.0 / 6.0, 0.01);
    near("push [kg]", patch.tangent_mass, 1000.0 / (1.0 + 0.25 * 6.0), 0.5);
    for point in points {
        near("distance from the middle [m]", point.slip_1, 0.5_f32.sqrt(), 1e-3);
    }
}

#[test]
fn what_a_manifold_is_given_back_is_the_impulse_that_held_its_body() {
    for friction_at in [FrictionAt::Points, FrictionAt::Manifold] {
        let mut simulation = on_a_slope(SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at));
        let up = -1000.0 * simulation.world.gravity * DT / 8.0;
        let manifold = simulation.manifolds().next().expect("it lies");
        let pushed = manifold.points().iter().map(|p| manifold.normal * p.normal_impulse + p.friction_impulse);
        let total = pushed.sum::<Vec3>() + manifold.friction_impulse;
        let total = if manifold.body_a == 1 { -total } else { total };
        assert!(total.distance(up) < 0.01 * up.length(), "{friction_at:?}: {total} N s, not {up}");
    }
    // A spin that friction stops: its impulse about the vertical, -mu N d at the most.
    let mut simulation =
        on_a_slope(SolverConfig::default().without_sleep().with(|c| c.friction_at = FrictionAt::Manifold));
    simulation.world.gravity = Vec3::NEG_Y * G;
    simulation.world.bodies[1].angular_velocity = Vec3::Y * 6.0;
    run(&mut simulation, 6, DT);
    let manifold = simulation.manifolds().next().expect("it lies");
    let borne = manifold.normal_impulse();
    near("twist [N m s]", manifold.twist_impulse.abs(), 0.7 * borne * 0.5_f32.sqrt(), 0.02 * borne);
}

/// A ball with its middle of mass 0.3 m off its origin. Hung there it does not turn, nor swing.
#[test]
fn a_body_hung_by_its_center_of_mass_does_not_turn() {
    let mut world = World::new();
    let mut body = ball().position(1.0, 2.0, 3.0);
    body.mass.center = Vec3::new(0.3, 0.0, 0.0);
    let hung = world.add(body);
    world.join(BallJoint::to_world(hung, Vec3::new(0.3, 0.0, 0.0), Vec3::new(1.3, 2.0, 3.0)));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let body = &simulation.world.bodies[hung];
    near("spin [rad/s]", body.angular_velocity.length(), 0.0, 1e-5);
    assert!(body.position.distance(Vec3::new(1.0, 2.0, 3.0)) < 1e-3, "{}", body.position);
}

/// Two bricks: one as it is, and one that is the same about axes that are turned in its body.
#[test]
fn a_body_tumbles_about_its_principal_axes_wherever_they_lie_in_it() {
    let mut world = empty();
    let spin = Vec3::new(0.5, 4.0, 0.3);
    let frame = Quat::from_rotation_z(0.7) * Quat::from_rotation_y(-0.4);
    for (x, frame) in [(0.0, Quat::IDENTITY), (10.0, frame)] {
        let mut brick = Body::dynamic().shape(Shape::cuboid(0.5, 0.3, 0.2)).position(x, 0.0, 0.0);
        brick.mass.principal_frame = frame;
        // Turned back, so that the axes lie alike in the world.
        world.add(brick.rotation(frame.inverse()).velocity(Vec3::ZERO, spin));
    }
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let [one, other] = &simulation.world.bodies[..] else { panic!("two bodies") };
    let apart = one.angular_velocity.distance(other.angular_velocity);
    assert!(one.angular_velocity.distance(spin) > 0.5, "it tumbles: {}", one.angular_velocity);
    assert!(apart < 1e-4 * spin.length(), "{} and {}", one.angular_velocity, other.angular_velocity);
}

/// While a pile comes down its contacts begin and end, are reused and are computed anew.
#[test]
fn a_contact_keeps_its_color_while_it_lasts() {
    let scene = Scene::find("pile", &["n=64".into()]).expect("the scene");
    let mut simulation = simulation(scene.world, SolverConfig::default().without_sleep());
    let mut known = HashMap::new();
    let (mut kept, mut anew, mut begun) = (0, 0, 0);
    for step in 0..90 {
        anew += run(&mut simulation, 1, DT).computed;
        let colors = simulation.manifolds().map(|m| ((m.body_a, m.body_b), m.color));
        let now: HashMap<_, _> = colors.collect();
        for (pair, color) in &now {
            match known.get(pair) {
                Some(before) => assert_eq!(color, before, "step {step}: {pair:?}"),
                None => begun += 1,
            }
            kept += usize::from(known.contains_key(pair));
        }
        known = now;
    }
    assert!(kept > 1000 && anew > 1000 && begun > 100, "{kept} kept, {anew} computed, {begun} begun");
}

#[test]
fn a_force_accelerates_by_its_share_of_the_mass() {
    let mut world = empty();
    let pushed = world.add(ball().total_mass(4.0));
    world.bodies[pushed].force = Vec3::new(2.0, -8.0, 0.0);
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 60, DT);
    let velocity = simulation.world.bodies[pushed].linear_velocity;
    assert!(velocity.distance(Vec3::new(0.5, -2.0, 0.0)) < 1e-4, "{velocity}");
}

/// A small ball on a large one, in either order: each row names which radius is whose.
#[test]
fn a_row_has_the_radius_of_each_of_its_surfaces() {
    for radii in [[1.0, 0.2], [0.2, 1.0]] {
        let mut world = empty();
        for (radius, y) in radii.into_iter().zip([0.0, 1.2]) {
            world.add(Body::dynamic().shape(Shape::ball(radius)).position(0.0, y, 0.0));
        }
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        let problem = simulation.next_problem(DT).expect("a step").0;
        let [row] = problem.contacts[..] else { panic!("one contact") };
        for (body, radius) in [(row.body_a, row.radius_a), (row.body_b, row.radius_b)] {
            assert_eq!(radius, radii[body as usize]);
        }
    }
}

/// A slope that falls along neither tangent. Moved so far that its manifold is computed anew, the cube is held as before.
#[test]
fn friction_is_carried_over_whichever_way_a_surface_slopes() {
    for angle in [0.3, 1.2, 2.5] {
        let mut held = [FrictionAt::Points, FrictionAt::Manifold].map(|friction_at| {
            let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at);
            on_a_slope_that_falls(Quat::from_rotation_y(angle), config)
        });
        for simulation in &mut held {
            let before = friction(simulation.problem());
            simulation.world.bodies[1].position.x += 0.02;
            let after = friction(&simulation.next_problem(DT).expect("a step").0);
            assert!(before.length() > 5.0 && after.distance(before) < 1e-3 * before.length(), "{after}, not {before}");
        }
    }
}

/// The sum of the impulses along the tangents [N s].
fn friction(problem: &StepProblem) -> Vec3 {
    let along = |row: &ContactRow| {
        let (t_1, t_2) = row.tangents();
        // The patch, if there is one, is the row after the points.
        let own =
            row.first_point as usize..problem.impulses.len().min((row.first_point + row.point_count) as usize + 1);
        problem.impulses[own].iter().map(|i| t_1 * i.tangent_1 + t_2 * i.tangent_2).sum::<Vec3>()
    };
    problem.contacts.iter().map(along).sum()
}

/// An end of a plank that turns comes down by 0.13 m a step, the plank itself by nothing.
#[test]
fn a_plank_that_turns_onto_a_board_meets_it() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world.add(Body::fixed().shape(Shape::cuboid(5.0, 0.02, 5.0)).position(0.0, -0.02, 0.0));
    let plank = Body::dynamic().shape(Shape::cuboid(1.0, 0.05, 0.1)).position(0.0, 0.3, 0.0);
    // One end is 3 cm above the board, further than contacts are made.
    let plank = plank.rotation(Quat::from_rotation_z(-0.2227)).velocity(Vec3::ZERO, Vec3::new(0.0, 0.0, -8.0));
    let plank = world.add(plank);
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    let mut lowest = f32::INFINITY;
    for _ in 0..30 {
        simulation.step(DT).expect("a step");
        let body = &simulation.world.bodies[plank];
        let ends = [-1.0, 1.0].map(|x| body.position + body.rotation * Vec3::new(x, -0.05, 0.0));
        lowest = ends.iter().map(|end| end.y).fold(lowest, f32::min);
    }
    assert!(lowest > -0.02, "an end is {lowest} m above the board");
    assert!(simulation.world.bodies[plank].linear_velocity.y > 0.5, "the board pushes it up");
}

#[test]
fn settings_that_contradict_each_other_are_refused_together() {
    use drystone::config::{Clamping, Method, Stabilization};
    let hard = || {
        SolverConfig::default().without_sleep().with(|c| {
            c.stabilization = Stabilization::None;
            c.relax = 0;
        })
    };
    let refused = |config: SolverConfig, words: [&str; 2]| {
        let line = config.check().expect_err(words[0]).to_string();
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    };
    hard().check().expect("good settings");
    refused(hard().with(|c| c.relax = 1), ["stabilization = none", "relax = 1"]);
    let single = Clamping::PerCorrection;
    refused(
        SolverConfig::default().without_sleep().with(|c| c.rules.clamping = single),
        ["rules.clamping = per-correction", "soft"],
    );
    let both = hard().with(|c| {
        c.rules.clamping = single;
        c.method = Method::Accelerated;
    });
    refused(both, ["rules.clamping = per-correction", "method = accelerated"]);
}
