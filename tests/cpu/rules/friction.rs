//! Friction: its limit, its direction, and what of it a step hands to the next.

use drystone::config::{Friction, FrictionAt};
use drystone::stages::problem::ContactRow;
use drystone::stages::problem::StepProblem;
use drystone::world::Collider;
use drystone::{Body, CombineRule, Material, Shape, Simulation, SolverConfig, World};
use glam::{Quat, Vec3};

use super::{DT, G, bounced, cube, floor, near, on_a_slope, on_a_slope_that_falls, run, simulation};

/// How far a cube slides that begins at 4 m/s [m]; `friction` of the cube and of the ground.
fn slid(config: SolverConfig, friction: [f32; 2]) -> f32 {
    let mut world = World::new();
    world.insert(floor().friction(friction[1]));
    world.insert(cube().friction(friction[0]).velocity(Vec3::X * 4.0, Vec3::ZERO));
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
    let material = |friction, restitution| Material { friction, restitution, ..Material::default() };
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

/// The later rule in the list counts, and a material without rule follows the other.
#[test]
fn surfaces_combine_by_the_later_of_their_rules() {
    use CombineRule::{Average, GeometricMean, Maximum, Minimum, Multiply};
    let of = |number: f32, rule: Option<CombineRule>| Material {
        friction: number,
        restitution: number,
        friction_rule: rule,
        restitution_rule: rule,
        ..Material::default()
    };
    let rules = [Average, GeometricMean, Minimum, Multiply, Maximum];
    let (a, b) = (0.9, 0.4);
    let numbers = [0.65, 0.6, 0.4, 0.36, 0.9];
    for (i, (&rule, number)) in rules.iter().zip(numbers).enumerate() {
        for other in [None].into_iter().chain(rules[..=i].iter().copied().map(Some)) {
            for both in [of(a, Some(rule)).combine(of(b, other)), of(a, other).combine(of(b, Some(rule)))] {
                near(&format!("friction by {rule:?} and {other:?}"), both.friction, number, 1e-6);
                near(&format!("restitution by {rule:?} and {other:?}"), both.restitution, number, 1e-6);
                assert_eq!((both.friction_rule, both.restitution_rule), (None, None));
            }
        }
    }
    // In a step: 0.65 of 0.9 and 0.4.
    let mut world = World::new();
    let rough = |friction| Material { friction, friction_rule: Some(Average), ..Material::default() };
    world.insert(floor().friction(0.4));
    world.insert(cube().material(rough(0.9)).velocity(Vec3::X * 4.0, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    run(&mut simulation, 360, 1.0 / 240.0);
    let expected = 16.0 / (2.0 * 0.65 * G);
    near("slide", simulation.world.bodies[1].position.x, expected, 0.005 * expected);
}

/// A sled on two runners, whose own friction is 0.1 on a floor of 0.9: 0.3 brakes it, whatever the friction of its
/// seat. The runners get rougher while it slides.
#[test]
fn a_shape_has_its_own_friction() {
    let runner = |z: f32| Collider {
        position: Vec3::new(0.0, -0.55, z),
        material: Some(Material { friction: 0.1, ..Material::default() }),
        ..Collider::new(Shape::cuboid(0.5, 0.05, 0.1))
    };
    let mut world = World::new();
    world.insert(floor().friction(0.9));
    let sled = cube().position(0.0, 0.6, 0.0).collider(runner(-0.4)).collider(runner(0.4)).friction(2.0);
    let sled = world.insert(sled.velocity(Vec3::X * 4.0, Vec3::ZERO));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep());
    let speed = |simulation: &Simulation| simulation.world.bodies[sled].linear_velocity.x;
    run(&mut simulation, 60, 1.0 / 240.0);
    near("speed on ice", speed(&simulation), 4.0 - 0.3 * G * 0.25, 0.01);
    for collider in &mut simulation.world.bodies[sled].colliders {
        collider.material.iter_mut().for_each(|material| material.friction = 0.4);
    }
    run(&mut simulation, 60, 1.0 / 240.0);
    near("speed on rough runners", speed(&simulation), 4.0 - 0.9 * G * 0.25, 0.03);
    simulation.world.bodies[sled].colliders[1].material = Some(Material { friction: -1.0, ..Material::default() });
    let line = simulation.step(DT).expect_err("a negative friction").to_string();
    assert!(line.ends_with("shapes[1]: friction = -1: must be 0 or more"), "{line}");
}

/// A dumbbell whose two ends bounce differently.
#[test]
fn a_shape_has_its_own_restitution() {
    let end = |x: f32, restitution: f32| Collider {
        position: Vec3::X * x,
        material: Some(Material { restitution, ..Material::default() }),
        ..Collider::new(Shape::ball(0.2))
    };
    for (turn, e) in [(0.0, 0.8), (std::f32::consts::PI, 0.3)] {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        world.insert(floor());
        // One end is below the other.
        let upright = Quat::from_rotation_z(turn) * Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2);
        let dumbbell = Body::dynamic().collider(end(0.5, 0.8)).collider(end(-0.5, 0.3)).rotation(upright);
        world.insert(dumbbell.position(0.0, 0.71, 0.0).velocity(Vec3::NEG_Y * 3.0, Vec3::ZERO));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        run(&mut simulation, 6, DT);
        near("bounce", simulation.world.bodies[1].linear_velocity.y, 3.0 * e, 1e-3);
    }
}

/// Friction mu N at each corner, a distance d from the axis, brakes a spin by mu m g d / I, with I = m/6 of a cube and d the half
/// of its diagonal. Measured 2e-3 of it.
#[test]
fn a_spinning_box_is_braked_by_its_load_times_mu_times_the_distance_of_its_corners() {
    for friction_at in [FrictionAt::Points, FrictionAt::Manifold] {
        let mut world = World::new();
        world.insert(floor().friction(0.4));
        world.insert(cube().friction(0.4));
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

/// Slip friction acts against the slip, which goes along neither tangent here.
#[test]
fn slip_friction_acts_against_the_slip() {
    let mut world = World::new();
    world.insert(floor().friction(0.4));
    let direction = Vec3::new(0.6, 0.0, 0.8);
    world.insert(cube().friction(0.4).velocity(direction * 4.0, Vec3::ZERO));
    let config = SolverConfig::default().without_sleep().with(|c| c.rules.slip_friction = true);
    let mut simulation = simulation(world, config);
    run(&mut simulation, 120, 1.0 / 240.0);
    let velocity = simulation.world.bodies[1].linear_velocity;
    near("along [m/s]", velocity.dot(direction), 4.0 - 0.4 * G * 0.5, 0.02);
    near("across [m/s]", velocity.cross(direction).y, 0.0, 0.02);
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
