//! Surfaces that move by themselves, and contacts that resist rolling and spinning, against closed forms.

use drystone::config::FrictionAt;
use drystone::glam::{Quat, Vec3};
use drystone::{Body, ContactHooks, Cpu, Material, PendingContact, Shape, Simulation, SolverConfig, World};

use crate::common::state::{all_bits, reference};
use crate::common::{Open, gpu};

tests! {
    every_backend {
        a_belt_takes_a_box_along_by_friction_up_to_its_speed,
        a_belt_on_a_turned_body_runs_along_the_axes_of_the_body,
        a_box_with_a_belt_and_the_board_under_it_part_at_the_speed_of_the_belt,
        a_ball_slows_down_by_rolling_friction_and_stops,
        a_ball_that_spins_slows_down_by_spinning_friction,
        a_ball_lies_on_slopes_below_the_angle_of_rolling_friction,
        a_hook_drives_a_contact_and_lets_it_resist_rolling,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_belts_and_rolling_friction,
    }
    no_gpu {
        lanes_have_the_bits_of_the_reference_with_belts_and_rolling_friction,
        bodies_beside_a_ball_with_rolling_friction_move_as_without_it,
        a_body_on_a_belt_stays_awake_and_a_ball_with_rolling_friction_sleeps,
        settings_that_cannot_follow_a_material_name_the_body,
    }
}

const DT: f32 = 1.0 / 60.0;
const G: f32 = 9.81;
const RADIUS: f32 = 0.5;

fn of(friction: f32) -> Material {
    Material { friction, ..Material::default() }
}

fn belt(velocity: Vec3) -> Material {
    Material { surface_velocity: velocity, ..of(0.5) }
}

fn floor(material: Material) -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y)).material(material)
}

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0)
}

fn ball(material: Material) -> Body {
    Body::dynamic().shape(Shape::ball(RADIUS)).total_mass(2.0).material(material)
}

fn simulation(world: World, config: SolverConfig, open: Open) -> Simulation {
    Simulation::with(world, config, open()).expect("a good world")
}

fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

/// v = mu g t up to the speed of the belt, with friction at points and at manifolds, and no energy is taken.
fn a_belt_takes_a_box_along_by_friction_up_to_its_speed(open: Open) {
    for (at, substeps) in [(FrictionAt::Points, 8), (FrictionAt::Manifold, 8), (FrictionAt::Points, 64)] {
        let mut world = World::new();
        world.insert(floor(belt(Vec3::new(2.0, 3.0, -1.0))));
        let cube = world.insert(cube().position(0.0, 0.5, 0.0));
        let config = SolverConfig::default().with(|c| (c.friction_at, c.substeps) = (at, substeps));
        let mut simulation = simulation(world, config, open);
        // The component across the surface does nothing.
        let along = Vec3::new(2.0, 0.0, -1.0);
        for step in 1..60 {
            let stats = simulation.step(DT).expect("a step");
            assert_eq!(stats.energy_taken, 0.0, "step {step}");
            let wanted = along * (0.5 * G * DT * step as f32 / along.length()).min(1.0);
            let v = simulation.world.bodies[cube].linear_velocity;
            // One sweep a substep leaves a little where slip ends.
            assert!((v - wanted).length() < 5e-3, "{at:?}, step {step}: {v}, not {wanted}");
        }
        let v = simulation.world.bodies[cube].linear_velocity;
        assert!((v - along).length() < 1e-4, "{at:?}: {v}, not {along}");
    }
}

fn a_belt_on_a_turned_body_runs_along_the_axes_of_the_body(open: Open) {
    let mut world = World::new();
    let plate = Body::fixed().shape(Shape::cuboid(10.0, 0.5, 10.0)).material(belt(Vec3::X));
    world.insert(plate.position(0.0, -0.5, 0.0).rotation(Quat::from_rotation_y(1.1)));
    let cube = world.insert(cube().position(0.0, 0.5, 0.0));
    let mut simulation = simulation(world, SolverConfig::default(), open);
    steps(&mut simulation, 60);
    let (v, wanted) = (simulation.world.bodies[cube].linear_velocity, Quat::from_rotation_y(1.1) * Vec3::X);
    assert!((v - wanted).length() < 1e-3, "{v}, not {wanted}");
}

/// Nothing outside pushes along the floor, so the momentum of both stays zero: m v = M V, and v + V is the speed.
fn a_box_with_a_belt_and_the_board_under_it_part_at_the_speed_of_the_belt(open: Open) {
    let mut world = World::new();
    world.insert(floor(of(0.0)));
    let board = Body::dynamic().shape(Shape::cuboid(4.0, 0.1, 1.0)).total_mass(12.0).position(0.0, 0.1, 0.0);
    let board = world.insert(board.friction(0.5));
    let cube = world.insert(cube().position(0.0, 0.7, 0.0).material(belt(Vec3::X * -1.2)));
    let mut simulation = simulation(world, SolverConfig::default(), open);
    steps(&mut simulation, 60);
    let [v_board, v_cube] = [board, cube].map(|i| simulation.world.bodies[i].linear_velocity.x);
    assert!((v_cube - 0.8).abs() < 2e-3 && (v_board + 0.4).abs() < 2e-3, "{v_cube} and {v_board} m/s");
}

/// A ball rolls with (1 + 2/5) m v' = -c m g / r, where c is the lever.
fn a_ball_slows_down_by_rolling_friction_and_stops(open: Open) {
    let (lever, speed) = (0.02, 1.5);
    let rough = Material { rolling_friction: lever, ..of(0.5) };
    let slowing = 5.0 / 7.0 * G * lever / RADIUS;
    for substeps in [8, 64] {
        let mut world = World::new();
        world.insert(floor(of(0.5)));
        let rolling = ball(rough).velocity(Vec3::X * speed, Vec3::Z * (-speed / RADIUS));
        let rolls = world.insert(rolling.position(0.0, RADIUS, 0.0));
        let mut simulation = simulation(world, SolverConfig::default().with(|c| c.substeps = substeps), open);
        steps(&mut simulation, 60);
        let v = simulation.world.bodies[rolls].linear_velocity.x;
        assert!((v - (speed - slowing)).abs() < 2e-3, "{v}, not {} m/s", speed - slowing);
        steps(&mut simulation, 300);
        let Body { position, linear_velocity, .. } = &simulation.world.bodies[rolls];
        let wanted = speed * speed / (2.0 * slowing);
        assert!((position.x - wanted).abs() < 5e-3 * wanted, "{} m, not {wanted}", position.x);
        assert!(linear_velocity.length() < 1e-4, "{linear_velocity}");
    }
}

/// 2/5 m r² w' = -c m g.
fn a_ball_that_spins_slows_down_by_spinning_friction(open: Open) {
    let lever = 0.01;
    let mut world = World::new();
    world.insert(floor(Material { spinning_friction: lever, ..of(0.5) }));
    let spins = world.insert(ball(of(0.5)).position(0.0, RADIUS, 0.0).velocity(Vec3::ZERO, Vec3::Y * 10.0));
    let free = world.insert(ball(of(0.5)).position(20.0, 1e3, 0.0).velocity(Vec3::ZERO, Vec3::Y * 10.0));
    let mut simulation = simulation(world, SolverConfig::default(), open);
    steps(&mut simulation, 60);
    let [w, w_free] = [spins, free].map(|i| simulation.world.bodies[i].angular_velocity.y);
    let wanted = 10.0 - lever * G / (0.4 * RADIUS * RADIUS);
    assert!((w - wanted).abs() < 2e-3 && (w_free - 10.0).abs() < 1e-4, "{w}, not {wanted} rad/s; {w_free}");
    steps(&mut simulation, 600);
    let w = simulation.world.bodies[spins].angular_velocity;
    assert!(w.length() < 1e-4, "{w}");
}

/// A ball rolls down a slope if its tangent is above c/r, with a = 5/7 g (sin - c/r cos).
fn a_ball_lies_on_slopes_below_the_angle_of_rolling_friction(open: Open) {
    let lever = 0.1_f32;
    for share in [0.9, 1.2] {
        let angle = (share * lever / RADIUS).atan();
        let mut world = World::new();
        world.gravity = Vec3::new(angle.sin(), -angle.cos(), 0.0) * G;
        world.insert(floor(of(0.9)));
        let ball = ball(Material { rolling_friction: lever, ..of(0.9) }).position(0.0, RADIUS, 0.0);
        let ball = world.insert(ball);
        let mut simulation = simulation(world, SolverConfig::default().without_sleep(), open);
        // The normal force is there after the first substeps.
        let [before, v] = [10, 60].map(|count| {
            steps(&mut simulation, count);
            simulation.world.bodies[ball].linear_velocity.x
        });
        let v = v - before;
        let wanted = (5.0 / 7.0 * G * (angle.sin() - lever / RADIUS * angle.cos())).max(0.0);
        assert!((v - wanted).abs() < 1e-4, "{v}, not {wanted} m/s at {share} of the angle");
    }
}

struct Hooks;

impl ContactHooks for Hooks {
    fn modify(&mut self, world: &World, contact: &mut PendingContact) {
        let is_ball = world.body(contact.b.body).expect("it is there").colliders[0].shape.as_ball().is_some();
        if is_ball {
            contact.rolling_friction = 0.02;
        } else {
            // The normal points from the floor to the body, and friction takes the body against this velocity.
            contact.surface_velocity = Vec3::X * -2.0;
        }
    }
}

fn a_hook_drives_a_contact_and_lets_it_resist_rolling(open: Open) {
    let mut world = World::new();
    world.insert(floor(of(0.5)));
    let cube = world.insert(cube().position(0.0, 0.5, 0.0));
    let rolling = ball(of(0.5)).velocity(Vec3::X * 1.5, Vec3::Z * (-1.5 / RADIUS));
    let ball = world.insert(rolling.position(20.0, RADIUS, 0.0));
    let mut simulation = simulation(world, SolverConfig::default(), open);
    simulation.set_hooks(Some(Box::new(Hooks)));
    steps(&mut simulation, 60);
    let [v, v_ball] = [cube, ball].map(|i| simulation.world.bodies[i].linear_velocity.x);
    let wanted = 1.5 - 5.0 / 7.0 * G * 0.02 / RADIUS;
    assert!((v - 2.0).abs() < 2e-3 && (v_ball - wanted).abs() < 2e-3, "{v}, not 2; {v_ball}, not {wanted} m/s");
}

/// Belts under and on boxes, and balls that roll on them and on each other.
fn mixture() -> World {
    let mut world = World::new();
    world.insert(floor(Material { surface_velocity: Vec3::X, spinning_friction: 0.01, ..of(0.6) }));
    for k in 0..4 {
        let (x, turn) = (3.0 * k as f32, Quat::from_scaled_axis(Vec3::new(0.1, 0.5, 0.2) * k as f32));
        let board = Body::dynamic().shape(Shape::cuboid(0.8, 0.1, 0.4)).rotation(turn).position(x, 0.6, 0.0);
        world.insert(board.material(belt(Vec3::new(0.3, 0.1, -1.0))));
        let rough = Material { rolling_friction: 0.03, spinning_friction: 0.02, ..of(0.5) };
        world.insert(ball(rough).position(x + 0.3, 1.6, 0.1).velocity(Vec3::X, Vec3::new(1.0, 5.0, -2.0)));
        world.insert(ball(of(0.7)).position(x + 0.1, 2.8, 0.0));
    }
    world
}

fn same_as_the_reference(open: Open) {
    for substeps in [8, 64] {
        let run = |open: Open| {
            let config = SolverConfig::default().with(|c| c.substeps = substeps);
            let mut simulation = simulation(mixture(), config, open);
            steps(&mut simulation, 20);
            // A part of the rolling friction goes, and then all.
            simulation.world.bodies[2].material.rolling_friction = 0.0;
            steps(&mut simulation, 10);
            simulation.world.bodies.iter_mut().for_each(|body| body.material = of(0.5));
            steps(&mut simulation, 10);
            // A body with rolling friction comes to those without.
            simulation.world.insert(ball(Material { rolling_friction: 0.03, ..of(0.5) }).position(-3.0, 1.0, 0.0));
            steps(&mut simulation, 10);
            simulation.world
        };
        assert_eq!(all_bits(&run(open)), all_bits(&run(reference)), "{substeps} substeps");
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_belts_and_rolling_friction() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_belts_and_rolling_friction() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}

fn bodies_beside_a_ball_with_rolling_friction_move_as_without_it() {
    let run = |rolling_friction: f32| {
        let mut world = World::new();
        world.insert(floor(of(0.5)));
        for k in 0..5 {
            world.insert(cube().position(0.1 * k as f32, 0.5 + 1.01 * k as f32, 0.0).velocity(Vec3::X, Vec3::Y));
        }
        let ball = world.insert(ball(of(0.5)).position(30.0, RADIUS, 0.0));
        let mut simulation = simulation(world, SolverConfig::default(), || Box::new(Cpu::new()));
        // It comes while the boxes are in contact.
        steps(&mut simulation, 20);
        simulation.world.bodies[ball].material = Material { rolling_friction, ..of(0.4) };
        steps(&mut simulation, 60);
        simulation.world.bodies.iter().take(6).map(|b| (b.position, b.linear_velocity)).collect::<Vec<_>>()
    };
    assert_eq!(run(0.0), run(0.1));
}

fn a_body_on_a_belt_stays_awake_and_a_ball_with_rolling_friction_sleeps() {
    let mut world = World::new();
    world.insert(floor(of(0.5)));
    let line = Body::fixed().shape(Shape::cuboid(5.0, 0.5, 1.0)).position(0.0, -0.4, 20.0);
    let line = world.insert(line);
    world.insert(Body::fixed().shape(Shape::cuboid(0.5, 2.0, 2.0)).position(1.5, 1.0, 20.0));
    let held = world.insert(cube().position(0.45, 0.6, 20.0));
    let rolling = ball(Material { rolling_friction: 0.001, ..of(0.5) }).velocity(Vec3::X * 0.02, Vec3::Z * -0.04);
    let ball = world.insert(rolling.position(0.0, RADIUS, 0.0));
    let mut simulation = simulation(world, SolverConfig::default(), || Box::new(Cpu::new()));
    steps(&mut simulation, 240);
    assert!(simulation.is_asleep(ball) && simulation.is_asleep(held));
    // The belt starts, wakes the cube, and presses it against the wall for as long as it runs.
    simulation.world.bodies[line].material = belt(Vec3::X);
    steps(&mut simulation, 240);
    assert!(simulation.is_asleep(ball) && !simulation.is_asleep(held));
    let x = simulation.world.bodies[held].position.x;
    assert!((x - 0.5).abs() < 2e-3, "{x}");
}

fn settings_that_cannot_follow_a_material_name_the_body() {
    let refused = |material: Material, config: SolverConfig| {
        let mut world = World::new();
        world.insert(floor(of(0.5)).named("floor"));
        world.insert(cube().position(0.0, 0.5, 0.0).material(material).named("crate"));
        let simulation = Simulation::with(world, config, Box::new(Cpu::new()));
        simulation.and_then(|mut s| s.step(DT).map(drop)).expect_err("it is refused").to_string()
    };
    let at_manifolds = SolverConfig::default().with(|c| c.friction_at = FrictionAt::Manifold);
    let slips = SolverConfig::default().with(|c| c.rules.slip_friction = true);
    for (material, config, wanted) in [
        (Material { rolling_friction: 0.1, ..of(0.5) }, at_manifolds, "friction_at = points"),
        (belt(Vec3::X), slips, "slip_friction = false"),
        (Material { rolling_friction: -0.1, ..of(0.5) }, SolverConfig::default(), "rolling_friction = -0.1 m"),
        (Material { spinning_friction: f32::NAN, ..of(0.5) }, SolverConfig::default(), "spinning_friction = NaN m"),
        (belt(Vec3::X * f32::INFINITY), SolverConfig::default(), "surface_velocity"),
    ] {
        let error = refused(material, config);
        assert!(error.contains("crate") && error.contains(wanted), "{error}");
    }
}
