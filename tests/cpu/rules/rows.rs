//! Rows of contacts: radii of round surfaces, patches, impulses, colors.

use std::collections::HashMap;
use std::f32::consts::FRAC_PI_2;

use drystone::config::FrictionAt;
use drystone::stages::problem::PointRow;
use drystone::{Body, Shape, SolverConfig, World};
use drystone_scenes::Scene;
use glam::{Quat, Vec3};

use super::{DT, G, empty, floor, near, on_a_slope, run, simulation};

/// A sphere that turns shows the floor the same surface. Without its radius the point that touched would turn away from the floor,
/// and the body would fall after it: 3 mm in a step.
#[test]
fn a_round_body_that_spins_in_place_stays_at_its_height() {
    let lying = Quat::from_rotation_x(FRAC_PI_2);
    for (what, shape) in
        [("ball", Shape::ball(0.3)), ("capsule", Shape::capsule(0.5, 0.3)), ("cylinder", Shape::cylinder(0.5, 0.3))]
    {
        let mut world = World::new();
        world.insert(floor().friction(0.0));
        let body = Body::dynamic().shape(shape).friction(0.0).position(0.0, 0.3, 0.0);
        world.insert(body.rotation(lying).velocity(Vec3::ZERO, Vec3::Z * 10.0));
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

/// The end of a cylinder is flat: tilted, it stands on its edge, which turns with it.
#[test]
fn a_cylinder_that_stands_is_flat_and_one_that_lies_is_round() {
    for (turn, radius) in [(Quat::IDENTITY, 0.0), (Quat::from_rotation_x(FRAC_PI_2), 0.3)] {
        let mut world = World::new();
        world.insert(floor());
        let height = if radius == 0.0 { 0.5 } else { 0.3 };
        world.insert(Body::dynamic().shape(Shape::cylinder(0.5, 0.3)).rotation(turn).position(0.0, height, 0.0));
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        run(&mut simulation, 1, DT);
        let row = *simulation.problem().swept_contacts().next().expect("it touches");
        assert_eq!(row.radius_a.max(row.radius_b), radius);
    }
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
        let simulation = on_a_slope(SolverConfig::default().without_sleep().with(|c| c.friction_at = friction_at));
        let up = -1000.0 * simulation.world.gravity * DT / 8.0;
        let manifold = simulation.manifolds().next().expect("it lies");
        let pushed = manifold.points().iter().map(|p| manifold.normal * p.normal_impulse + p.friction_impulse);
        let total = pushed.sum::<Vec3>() + manifold.friction_impulse;
        let total = if manifold.a.body.index() == 1 { -total } else { total };
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

/// While a pile comes down its contacts begin and end, are reused and are computed anew.
#[test]
fn a_contact_keeps_its_color_while_it_lasts() {
    let scene = Scene::find("pile", &["n=64".into()]).expect("the scene");
    let mut simulation = simulation(scene.world, SolverConfig::default().without_sleep());
    let mut known = HashMap::new();
    let (mut kept, mut anew, mut begun) = (0, 0, 0);
    for step in 0..90 {
        anew += run(&mut simulation, 1, DT).computed;
        let colors = simulation.manifolds().map(|m| ((m.a.body, m.b.body), m.color));
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

/// A small ball on a large one, in either order: each row names which radius is whose.
#[test]
fn a_row_has_the_radius_of_each_of_its_surfaces() {
    for radii in [[1.0, 0.2], [0.2, 1.0]] {
        let mut world = empty();
        for (radius, y) in radii.into_iter().zip([0.0, 1.2]) {
            world.insert(Body::dynamic().shape(Shape::ball(radius)).position(0.0, y, 0.0));
        }
        let mut simulation = simulation(world, SolverConfig::default().without_sleep());
        let problem = simulation.next_problem(DT).expect("a step").0;
        let [row] = problem.contacts[..] else { panic!("one contact") };
        for (body, radius) in [(row.body_a, row.radius_a), (row.body_b, row.radius_b)] {
            assert_eq!(radius, radii[body as usize]);
        }
    }
}
