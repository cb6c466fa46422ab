//! Motions whose answer is known on paper, on every backend.
//!
//! The GPU runs plain WGSL here: its exact mode is held to the reference bit for bit elsewhere. Beside every tolerance
//! stands the largest error that was measured on any backend, and where it comes from.

use crate::common::state::reference;
use std::f64::consts::{FRAC_PI_6, PI};

use crate::common::Open;
use crate::common::measurement::{below, holds, is_near};
use drystone::metrics::rms_speed;
use drystone::{Backend, Body, Shape, Simulation, SolverConfig, World};
use glam::{DVec3, Quat, Vec3};

const G: f64 = 9.81;

tests! {
    every_backend {
        a_body_falls_along_its_parabola_to_the_last_bit,
        a_free_ball_turns_by_its_angular_velocity,
        boxes_at_rest_sink_in_as_far_as_soft_contacts_say,
        preloaded_contacts_come_up_again_at_the_rate_of_their_preload,
        what_a_load_leaves_behind_stays_where_it_is,
        a_sliding_box_stops_where_friction_says,
        a_box_below_the_friction_angle_stays_where_it_is,
        a_box_above_the_friction_angle_slides_as_fast_as_coulomb_says,
        a_sliding_ball_ends_up_rolling_at_five_sevenths_of_its_speed,
        an_isolated_collision_keeps_momentum,
        substeps_keep_linear_momentum_exactly_and_angular_momentum_to_first_order_in_the_step,
        balls_that_meet_head_on_part_as_newton_says,
        every_shape_comes_to_rest_on_a_half_space,
    }
    no_gpu {
        the_comparisons_refuse_what_is_one_percent_off,
    }
}

fn simulation(world: World, config: SolverConfig, backend: Box<dyn Backend>) -> Simulation {
    Simulation::with(world, config, backend).expect("good settings")
}

/// Runs `seconds` of `world` in steps of 1/`rate` s, with 4 substeps each, and returns what became of it.
fn run(world: World, backend: Box<dyn Backend>, seconds: f64, rate: u32) -> World {
    let mut simulation = simulation(world, SolverConfig::default().without_sleep().with(|c| c.substeps = 4), backend);
    for _ in 0..(seconds * f64::from(rate)).round() as u32 {
        simulation.step(1.0 / rate as f32).expect("a step");
    }
    simulation.world
}

/// A world with a half-space below y = 0 and gravity turned by `slope` about z, as if the ground were inclined: what
/// slides goes to +x.
fn ground(slope: f64, friction: f32) -> World {
    let mut world = World::new();
    world.gravity = Vec3::new((G * slope.sin()) as f32, (-G * slope.cos()) as f32, 0.0);
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(friction));
    world
}

/// A cube of 1 m and 1000 kg.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5))
}

/// Numbers chosen so that every sum is a multiple of 10/65536 and below 2^24 of them: f32 has to be exact.
fn a_body_falls_along_its_parabola_to_the_last_bit(open: Open) {
    let backend = open();
    let mut world = World::new();
    world.gravity = Vec3::new(0.0, -10.0, 0.0);
    let (start, v) = (Vec3::new(1.0, 20.0, -3.0), Vec3::new(2.0, 5.0, -0.5));
    let ball = Body::dynamic().shape(Shape::ball(0.5)).position(start.x, start.y, start.z);
    world.insert(ball.velocity(v, Vec3::ZERO));
    let fallen = &run(world, backend, 1.0, 64).bodies[0];
    // After one second.
    assert_eq!(fallen.linear_velocity, v - 10.0 * Vec3::Y);
    assert_eq!(fallen.position, start + v - 5.0 * Vec3::Y);
    assert_eq!(fallen.rotation, Quat::IDENTITY);
}

/// Measured 2.5e-7 rad: 240 roundings of a rotation.
fn a_free_ball_turns_by_its_angular_velocity(open: Open) {
    let backend = open();
    let name = backend.name();
    let mut world = World::new();
    let spin = Vec3::new(1.0, -2.0, 0.5);
    world.insert(Body::dynamic().shape(Shape::ball(0.5)).velocity(Vec3::ZERO, spin));
    let turned = run(world, backend, 1.0, 60).bodies[0].rotation;
    // Not from the cosine of the angle, in which rounding hides 1e-4 rad.
    let error = (turned * Quat::from_scaled_axis(spin).conjugate()).xyz().length() * 2.0;
    below(&format!("{name}, turn"), error.into(), 1e-6);
}

/// Overlap at rest of a cube on the ground and of one on top of it [m], with 2 substeps, so that it is large in f32.
fn sag_of_two_cubes(backend: Box<dyn Backend>, frequency: f32, preload_rate: f32, steps: u32) -> [f64; 2] {
    let mut world = ground(0.0, 0.5);
    for y in [0.5, 1.5] {
        // A body that moves begins without impulses and preloads.
        world.insert(cube().position(0.0, y, 0.0).velocity(1e-3 * Vec3::NEG_Y, Vec3::ZERO));
    }
    let soft = SolverConfig::default().without_sleep().with(|c| {
        c.substeps = 2;
        c.contact_frequency = frequency;
        c.preload_rate = preload_rate;
    });
    let mut simulation = simulation(world, soft, backend);
    for _ in 0..steps {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    let [lower, upper] = [1, 2].map(|i| f64::from(simulation.world.bodies[i].position.y));
    [0.5 - lower, 1.0 - (upper - lower)]
}

/// The closed form: overlap = F / (m w²) for each of four corners, m the mass that a corner feels: a quarter of the cube
/// against the ground, an eighth of it between two cubes, where inverse masses add.
fn soft_contact_law(frequency: f64) -> [f64; 2] {
    let w = 2.0 * PI * frequency * 120.0;
    let ground_w = SolverConfig::default().fixed_contact_frequency_ratio as f64 * w;
    [(2.0 * G / 4.0) / (0.25 * ground_w * ground_w), (G / 4.0) / (0.125 * w * w)]
}

/// Measured 2e-4 and 5e-4: positions near 1 m are multiples of 1e-7 m, and the overlaps are 0.55 and 2.2 mm.
fn boxes_at_rest_sink_in_as_far_as_soft_contacts_say(open: Open) {
    let backend = open();
    let name = backend.name();
    let sag = sag_of_two_cubes(backend, 0.125, 0.0, 300);
    let law = soft_contact_law(0.125);
    holds(&format!("{name}, cube on the ground"), sag[0], law[0], 0.01);
    holds(&format!("{name}, cube on a cube"), sag[1], law[1], 0.01);
}

/// Each step takes its share of what is left: overlaps fall by e in a second. Measured 0.4 %: positions near 1 m are multiples
/// of 1e-7 m.
fn preloaded_contacts_come_up_again_at_the_rate_of_their_preload(open: Open) {
    let name = open().name();
    let [early, late] = [180, 240].map(|steps| sag_of_two_cubes(open(), 0.125, 1.0, steps));
    let left = (61.0_f64 / 60.0).powi(-60);
    holds(&format!("{name}, cube on the ground"), late[0] / early[0], left, 0.01);
    holds(&format!("{name}, cube on a cube"), late[1] / early[1], left, 0.01);
    let end = sag_of_two_cubes(open(), 0.125, 1.0, 600);
    below(&format!("{name}, overlap after 10 s"), end[0].abs().max(end[1].abs()), 5e-6);
}

/// Two cubes under one a hundred times as heavy, which is taken away once all are at rest: springs that hold up what is no
/// longer there would throw them. Measured 1.8 mm, with preloads and without; with 8 substeps 28 mm: one sweep takes out what
/// is left of an impulse a hundred times too large only in part.
fn what_a_load_leaves_behind_stays_where_it_is(open: Open) {
    let backend = open();
    let name = backend.name();
    let mut world = ground(0.0, 0.5);
    for (y, density) in [(0.5, 1e3), (1.5, 1e3), (2.5, 1e5)] {
        world.insert(cube().density(density).position(0.0, y, 0.0));
    }
    let mut simulation = simulation(world, SolverConfig::default().without_sleep().with(|c| c.substeps = 32), backend);
    let height = |s: &Simulation| f64::from(s.world.bodies[2].position.y);
    let mut highest = f64::MIN;
    for step in 0..240 {
        simulation.step(1.0 / 60.0).expect("a step");
        if step == 120 {
            simulation.world.bodies[3].position.x += 10.0;
        } else if step > 120 {
            highest = highest.max(height(&simulation));
        }
    }
    below(&format!("{name}, jump"), highest - 1.5, 3e-3);
}

/// How far a cube with `speed` slides on level ground [m].
fn slide(backend: Box<dyn Backend>, speed: f32, friction: f32) -> f64 {
    let mut world = ground(0.0, friction);
    world.insert(cube().position(0.0, 0.5, 0.0).friction(friction).velocity(Vec3::X * speed, Vec3::ZERO));
    f64::from(run(world, backend, 1.5, 240).bodies[1].position.x)
}

/// Measured 1.0e-3, which is h v / 2 for substeps of 1/960 s: the first of them moves with the speed at its end.
fn a_sliding_box_stops_where_friction_says(open: Open) {
    let backend = open();
    let name = backend.name();
    holds(&format!("{name}, slide"), slide(backend, 4.0, 0.4), 16.0 / (2.0 * 0.4 * G), 0.005);
}

/// Measured 0.21 mm, nearly all of it in the first tenth of a second, while the contact that holds it builds up.
fn a_box_below_the_friction_angle_stays_where_it_is(open: Open) {
    let backend = open();
    let name = backend.name();
    // tan 30 degrees is 0.577.
    let mut world = ground(FRAC_PI_6, 0.6);
    let start = Vec3::new(0.0, 0.5, 0.0);
    world.insert(cube().position(start.x, start.y, start.z).friction(0.6));
    let mut simulation = simulation(world, SolverConfig::default().without_sleep(), backend);
    let mut farthest = 0.0_f32;
    for _ in 0..600 {
        simulation.step(1.0 / 60.0).expect("a step");
        farthest = farthest.max(simulation.world.bodies[1].position.distance(start));
    }
    below(&format!("{name}, moved in 10 s [m]"), farthest.into(), 1e-3);
}

/// Acceleration of a cube on a slope of 30° [m/s²], from where it is after 2 s.
fn slip(backend: Box<dyn Backend>, friction: f32) -> f64 {
    let mut world = ground(FRAC_PI_6, friction);
    world.insert(cube().position(0.0, 0.5, 0.0).friction(friction));
    let slid = run(world, backend, 2.0, 240);
    f64::from(slid.bodies[1].position.x) * 2.0 / (2.0 * 2.0)
}

/// Measured 7e-4: h / t of it is the integrator's, for substeps of 1/960 s and t = 2 s.
fn a_box_above_the_friction_angle_slides_as_fast_as_coulomb_says(open: Open) {
    let expected = G * (FRAC_PI_6.sin() - 0.3 * FRAC_PI_6.cos());
    let backend = open();
    let name = backend.name();
    holds(&format!("{name}, slip"), slip(backend, 0.3), expected, 0.005);
}

/// Final speed and spin of a ball that starts sliding without spin.
fn roll(backend: Box<dyn Backend>, speed: f32) -> (f64, f64) {
    let mut world = ground(0.0, 0.3);
    let ball = Body::dynamic().shape(Shape::ball(0.5)).friction(0.3).position(0.0, 0.5, 0.0);
    world.insert(ball.velocity(Vec3::X * speed, Vec3::ZERO));
    let ball = &run(world, backend, 1.0, 240).bodies[1];
    (ball.linear_velocity.x.into(), (-ball.angular_velocity.z).into())
}

/// Measured 1e-6 and 4e-6: friction that stops slipping leaves nothing of the integrator's first order behind.
fn a_sliding_ball_ends_up_rolling_at_five_sevenths_of_its_speed(open: Open) {
    let backend = open();
    let name = backend.name();
    let (v, w) = roll(backend, 4.0);
    holds(&format!("{name}, speed"), v, 4.0 * 5.0 / 7.0, 0.005);
    holds(&format!("{name}, spin"), w, v / 0.5, 0.005);
}

/// A cube that hits a turned brick beside its center, in no gravity: change of linear and of angular momentum in 1/4 s,
/// relative to the sum of their sizes.
fn collision(backend: Box<dyn Backend>, config: SolverConfig, rate: u32) -> [f64; 2] {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    world.insert(cube().position(-1.1875, 0.125, 0.0625).velocity(Vec3::new(3.0, 0.5, -0.2), Vec3::new(0.3, 0.2, 1.0)));
    let brick = Body::dynamic().shape(Shape::cuboid(0.6, 0.4, 0.3)).rotation(Quat::from_rotation_z(0.4));
    world.insert(brick.position(0.25, 0.5, 0.0).velocity(Vec3::new(-1.0, 0.0, 0.3), Vec3::new(0.0, -0.5, 0.0)));
    let momentum = |b: &Body| b.linear_velocity.as_dvec3() * f64::from(b.mass.mass);
    let sizes = |of: &dyn Fn(&Body) -> DVec3| world.bodies.iter().map(|b| of(b).length()).sum::<f64>();
    let (linear, angular) = (sizes(&momentum), sizes(&Body::angular_momentum));
    let mut simulation = simulation(world.clone(), config, backend);
    for _ in 0..rate / 4 {
        simulation.step(1.0 / rate as f32).expect("a step");
    }
    let after = simulation.world;
    assert!((momentum(&after.bodies[0]) - momentum(&world.bodies[0])).length() > 0.1 * linear, "they never met");
    [
        (after.linear_momentum() - world.linear_momentum()).length() / linear,
        (after.angular_momentum() - world.angular_momentum()).length() / angular,
    ]
}

/// Settings with which every impulse acts where its arms say: one sweep a step, before anything moves.
fn impulses_in_place() -> SolverConfig {
    SolverConfig::default().without_sleep().with(|c| {
        c.substeps = 1;
        c.relax = 0;
        c.recycle_distance = 0.0;
    })
}

/// Measured 1e-7, and 3.4e-6 at 1024 steps a second, at which positions before the impact are exact sums.
fn an_isolated_collision_keeps_momentum(open: Open) {
    let backend = open();
    let name = backend.name();
    let [linear, angular] = collision(backend, impulses_in_place(), 1024);
    below(&format!("{name}, momentum"), linear, 1e-6);
    below(&format!("{name}, angular momentum"), angular, 1e-5);
}

/// Arms are those of the beginning of the step, and bodies that slip past each other in a step carry them along: measured
/// 6.6e-3 at 60 steps a second and 1.9e-3 at 240. Linear momentum knows no arms.
fn substeps_keep_linear_momentum_exactly_and_angular_momentum_to_first_order_in_the_step(open: Open) {
    let backend = open();
    let name = backend.name();
    let [linear, coarse] = collision(backend, SolverConfig::default().without_sleep(), 60);
    let [_, fine] = collision(reference(), SolverConfig::default().without_sleep(), 240);
    below(&format!("{name}, momentum"), linear, 1e-6);
    below(&format!("{name}, angular momentum at 60 steps a second"), coarse, 1e-2);
    below(&format!("{name}, angular momentum at 240 steps a second"), fine, 2.5e-3);
}

/// Velocities after balls of 1 kg and `mass` met head-on at 3 and -1 m/s.
fn bounce(backend: Box<dyn Backend>, mass: f32, restitution: f32) -> [f64; 2] {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    for (x, mass, v) in [(-1.0, 1.0, 3.0), (1.0, mass, -1.0)] {
        let ball = Body::dynamic().shape(Shape::ball(0.5)).total_mass(mass).restitution(restitution);
        world.insert(ball.position(x, 0.0, 0.0).velocity(Vec3::X * v, Vec3::ZERO));
    }
    let after = run(world, backend, 1.0, 60);
    [0, 1].map(|i| after.bodies[i].linear_velocity.x.into())
}

/// Their closed forms.
fn newton(m: f64, e: f64) -> [f64; 2] {
    let momentum = 3.0 - m;
    [(momentum - m * e * 4.0) / (1.0 + m), (momentum + e * 4.0) / (1.0 + m)]
}

/// Measured 1.4e-7 m/s, of an approach at 4 m/s.
fn balls_that_meet_head_on_part_as_newton_says(open: Open) {
    for (mass, e) in [(1.0, 1.0), (1.0, 0.5), (3.0, 1.0), (1000.0, 0.8), (0.001, 0.25)] {
        let backend = open();
        let what = format!("{}, mass {mass}, restitution {e}", backend.name());
        let (v, expected) = (bounce(backend, mass, e), newton(mass.into(), e.into()));
        below(&what, (v[0] - expected[0]).abs().max((v[1] - expected[1]).abs()), 1e-5);
    }
}

fn every_shape_comes_to_rest_on_a_half_space(open: Open) {
    let lying = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let corners =
        [(0.6, 0.0, 0.1), (-0.5, 0.1, 0.0), (0.1, 0.5, 0.0), (0.0, -0.4, 0.1), (0.0, 0.1, 0.6), (0.1, 0.0, -0.5)];
    let hull = Shape::convex_hull(&corners.map(Vec3::from)).expect("a hull");
    let at = |x: f32| Vec3::new(x, 0.0, 0.0);
    let shapes = [
        ("ball", Body::dynamic().shape(Shape::ball(0.5))),
        ("cuboid", Body::dynamic().shape(Shape::cuboid(0.5, 0.4, 0.3))),
        ("capsule", Body::dynamic().shape(Shape::capsule(0.5, 0.3)).rotation(lying)),
        ("cylinder", Body::dynamic().shape(Shape::cylinder(0.5, 0.4))),
        ("cylinder on its side", Body::dynamic().shape(Shape::cylinder(0.5, 0.4)).rotation(lying)),
        ("cone", Body::dynamic().shape(Shape::cone(0.5, 0.5))),
        ("hull", Body::dynamic().shape(hull)),
        (
            "compound",
            Body::dynamic().shape_at(Shape::ball(0.3), at(-0.5), Quat::IDENTITY).shape_at(
                Shape::cuboid(0.3, 0.3, 0.3),
                at(0.5),
                Quat::IDENTITY,
            ),
        ),
    ];
    let backend = open();
    let name = backend.name();
    let mut world = ground(0.0, 0.5);
    for (k, (shape, body)) in shapes.iter().enumerate() {
        world.insert(body.clone().named(*shape).position(3.0 * k as f32, 0.8, 0.0));
    }
    let rested = run(world, backend, 5.0, 60);
    for body in &rested.bodies[1..] {
        let speed = rms_speed(&World { bodies: [body.clone()].into_iter().collect(), ..World::new() });
        below(&format!("{name}, {} [m/s]", body.name), speed, 1e-3);
        assert!((0.2..0.6).contains(&body.position.y), "{name}: {} is at {}", body.name, body.position);
    }
}

/// Each comparison above, on a world that is a little wrong.
fn the_comparisons_refuse_what_is_one_percent_off() {
    assert!(is_near(1.0049, 1.0, 0.005));
    for bad in [1.0051, 0.9949, f64::NAN, f64::INFINITY] {
        assert!(!is_near(bad, 1.0, 0.005), "{bad}");
    }
    let [ground, pair] = sag_of_two_cubes(reference(), 0.125 * 1.01, 0.0, 300);
    assert!(!is_near(ground, soft_contact_law(0.125)[0], 0.01) && !is_near(pair, soft_contact_law(0.125)[1], 0.01));
    assert!(!is_near(slide(reference(), 4.0, 0.404), 16.0 / (2.0 * 0.4 * G), 0.005));
    assert!(!is_near(slip(reference(), 0.303), G * (FRAC_PI_6.sin() - 0.3 * FRAC_PI_6.cos()), 0.005));
    assert!(!is_near(roll(reference(), 4.04).0, 4.0 * 5.0 / 7.0, 0.005));
    assert!((bounce(reference(), 3.0, 0.99)[0] - newton(3.0, 1.0)[0]).abs() > 1e-5);
    let still = impulses_in_place().with(|c| c.gyroscopic = false);
    assert!(collision(reference(), still, 1024)[1] > 1e-5, "without the gyroscopic term angular momentum turns away");
}
