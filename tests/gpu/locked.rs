//! Bodies that turn about some axes of the world only.

use crate::common::state::{all_bits, reference};
use crate::common::{Open, gpu};
use drystone::config::JointSolver;
use drystone::glam::{DVec3, Mat3, Quat, Vec3};
use drystone::{Body, BodyHandle, Cpu, Joint, MassProperties, Shape, Simulation, SolverConfig, World};

tests! {
    every_backend {
        a_body_with_locked_translations_stays_in_its_plane,
        contacts_bear_on_a_locked_body_as_on_a_fixed_one,
        a_cart_on_a_rail_and_its_pendulum_swing_as_on_paper,
        axes_of_joints_bear_on_a_locked_body_as_on_a_fixed_one,
        no_body_ends_a_step_faster_than_its_largest_speeds,
        a_body_with_locked_rotations_never_turns,
        bodies_of_a_plane_turn_about_its_normal_only,
        a_board_turns_about_the_free_axis_as_on_bearings,
        a_hit_beside_the_center_of_a_locked_body_is_a_central_one,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_locked_translations,
        a_gpu_has_the_bits_of_the_reference_with_locked_axes,
    }
    no_gpu {
        lanes_have_the_bits_of_the_reference_with_locked_translations,
        the_law_of_energy_holds_bodies_with_locked_axes,
        lanes_have_the_bits_of_the_reference_with_locked_axes,
        free_axes_keep_their_momentum,
        axes_that_a_caller_locks_stop_in_the_next_step,
        the_inertia_of_a_locked_body_turns_with_no_joint,
        a_contact_problem_of_locked_bodies_is_refused_by_name,
    }
}

const DT: f32 = 1.0 / 60.0;

/// A cube of 6 kg with sides of 1 m: 1 kg m² about every axis.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0)
}

fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

fn simulation(world: World, substeps: u32, open: Open) -> Simulation {
    let config = SolverConfig::default().with(|c| c.substeps = substeps);
    Simulation::with(world, config, open()).expect("a simulation")
}

fn after(world: World, substeps: u32, steps: u32, open: Open) -> World {
    let mut simulation = simulation(world, substeps, open);
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
    simulation.world
}

/// Boards that fall on an edge, balls that hit them beside their middle, and a pendulum, with the axes of each locked that `axes` gives.
fn mixture(axes: impl Fn(usize) -> [bool; 3]) -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let turn = Quat::from_scaled_axis(Vec3::new(0.4, -0.9, 0.3));
    for k in 0..4 {
        let board = Body::dynamic().shape(Shape::cuboid(0.6, 0.1, 0.3)).rotation(turn);
        world.insert(board.position(3.0 * k as f32, 1.2, 0.0).velocity(Vec3::X, Vec3::new(1.0, 2.0, -3.0)));
        let ball = Body::dynamic().shape(Shape::ball(0.2)).position(3.0 * k as f32 + 0.4, 2.5, 0.1);
        world.insert(ball.velocity(Vec3::Y * -3.0, Vec3::ZERO));
    }
    let bob = Body::dynamic().shape(Shape::cuboid(0.3, 0.1, 0.2)).position(-3.0, 3.0, 0.0).rotation(turn);
    let bob = world.insert(bob.velocity(Vec3::Z * 2.0, Vec3::Y));
    world.insert_joint(Joint::to_world(bob, Vec3::Y, Vec3::new(-3.0, 4.0, 0.0)));
    (0..world.bodies.len()).for_each(|k| world.bodies[k].locked_rotations = axes(k));
    world
}

fn a_body_with_locked_rotations_never_turns(open: Open) {
    for substeps in [8, 64] {
        let before = mixture(|_| [true; 3]);
        let world = after(before.clone(), substeps, 60, open);
        for (body, before) in world.bodies.iter().zip(&before.bodies) {
            assert_eq!(body.rotation.to_array().map(f32::to_bits), before.rotation.to_array().map(f32::to_bits));
            assert_eq!(body.angular_velocity, Vec3::ZERO);
        }
        // They still move, and the floor holds them.
        assert!(world.bodies.iter().skip(1).all(|body| body.position.y > 0.1));
        assert!(world.bodies[1].position.y < 0.7, "{}", world.bodies[1].position);
    }
}

fn bodies_of_a_plane_turn_about_its_normal_only(open: Open) {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for k in 0..8 {
        // Hits out of the plane, and edges that tip.
        let body = cube().position(0.4 * (k % 3) as f32, 0.9 + 1.3 * k as f32, 0.05 * k as f32);
        world.insert(body.rotation(Quat::from_rotation_z(0.3 * k as f32)).locked_rotations([true, true, false]));
    }
    let world = after(world, 8, 120, open);
    let mut turned = 0.0_f32;
    for body in world.bodies.iter().skip(1) {
        assert_eq!((body.rotation.x, body.rotation.y), (0.0, 0.0));
        assert_eq!((body.angular_velocity.x, body.angular_velocity.y), (0.0, 0.0));
        turned = turned.max(body.rotation.z.abs());
    }
    assert!(turned > 0.1);
}

/// A board whose principal axes are none of the world turns about a fixed axis n by the moment n I n, whatever its other moments are.
fn a_board_turns_about_the_free_axis_as_on_bearings(open: Open) {
    let inertia = Vec3::new(1.0, 2.0, 2.5);
    let mass =
        MassProperties { mass: 3.0, principal_inertia: inertia, principal_frame: Quat::IDENTITY, center: Vec3::ZERO };
    let rotation = Quat::from_scaled_axis(Vec3::new(0.7, -0.5, 0.9));
    for (k, free) in Vec3::AXES.into_iter().enumerate() {
        let mut world = weightless();
        let axes = [0, 1, 2].map(|axis| axis != k);
        world.insert(Body::dynamic().mass_properties(mass).rotation(rotation).locked_rotations(axes));
        world.bodies[0].torque = Vec3::new(2.0, -3.0, 1.5);
        let moment = free.dot(Mat3::from_quat(rotation) * (inertia * (rotation.inverse() * free)));
        let wanted = free * (0.5 * world.bodies[0].torque.dot(free) / moment);
        for substeps in [8, 64] {
            let spin = after(world.clone(), substeps, 30, open).bodies[0].angular_velocity;
            assert!((spin - wanted).length() < 2e-5 * wanted.length(), "{spin}, not {wanted}");
            assert!((0..3).all(|axis| axis == k || spin[axis] == 0.0), "{spin}");
        }
    }
}

/// A ball without friction that hits a locked cube beside its center, without restitution: both go on with m v/(m + M).
fn a_hit_beside_the_center_of_a_locked_body_is_a_central_one(open: Open) {
    let mut world = weightless();
    world.insert(cube().locked_rotations([true; 3]).friction(0.0));
    let ball = Body::dynamic().shape(Shape::ball(0.2)).total_mass(2.0).friction(0.0).position(-1.0, 0.4, 0.3);
    world.insert(ball.velocity(Vec3::X * 4.0, Vec3::ZERO));
    let world = after(world, 8, 60, open);
    for body in &world.bodies {
        let v = body.linear_velocity;
        assert!((v - Vec3::X).length() < 1e-5, "{v}");
    }
}

fn alternating(k: usize) -> [bool; 3] {
    [k & 1 > 0, k & 2 > 0, k & 4 > 0]
}

fn same_as_the_reference(open: Open) {
    for substeps in [8, 32] {
        let [ours, theirs] = [reference, open].map(|open| after(mixture(alternating), substeps, 40, open));
        assert_eq!(all_bits(&ours), all_bits(&theirs), "{substeps} substeps");
        for body in &ours.bodies {
            assert!((0..3).all(|axis| !body.locked_rotations[axis] || body.angular_velocity[axis] == 0.0));
        }
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_locked_axes() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_locked_axes() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}

/// Locks take momentum about their own axes only: what meets in a plane moves as without locks, and keeps its linear momentum.
fn free_axes_keep_their_momentum() {
    let meet = |axes: [bool; 3]| {
        let mut world = weightless();
        // A cube and a ball that meet beside their centers, in a plane across z; friction takes steps by the inertia about all axes.
        world.insert(cube().locked_rotations(axes).restitution(0.5).friction(0.0));
        let ball = Body::dynamic().shape(Shape::ball(0.3)).total_mass(2.0).position(-1.5, 0.4, 0.0).restitution(0.5);
        world.insert(ball.friction(0.0).velocity(Vec3::X * 3.0, Vec3::Z).locked_rotations(axes));
        after(world, 8, 60, reference)
    };
    let [free, locked] = [[false; 3], [true, true, false]].map(meet);
    for world in [&free, &locked] {
        assert!((world.linear_momentum() - DVec3::X * 6.0).length() < 1e-5, "{}", world.linear_momentum());
    }
    let [free_momentum, momentum] = [&free, &locked].map(|world| world.angular_momentum().z);
    assert!((momentum - free_momentum).abs() < 1e-5, "{momentum}, not {free_momentum}");
    for (body, free) in locked.bodies.iter().zip(&free.bodies) {
        assert!((body.angular_velocity - free.angular_velocity).length() < 1e-5, "{}", body.angular_velocity);
        assert_eq!(body.position.z, 0.0);
    }
    assert!(locked.bodies[0].angular_velocity.z.abs() > 0.1);
}

fn axes_that_a_caller_locks_stop_in_the_next_step() {
    let mut world = weightless();
    world.insert(cube().velocity(Vec3::X, Vec3::new(1.0, 2.0, 3.0)));
    let mut simulation = simulation(world, 8, reference);
    simulation.step(DT).expect("a step");
    simulation.world.bodies[0].locked_rotations = [true, false, true];
    let before = simulation.world.bodies[0].rotation;
    simulation.step(DT).expect("a step");
    let body = &simulation.world.bodies[0];
    // It does not turn about these axes in that step either; 1 rad/s would be 1/120.
    let turned = body.rotation * before.inverse();
    assert!(turned.x.abs().max(turned.z.abs()) < 1e-5 && turned.y.abs() > 0.01, "{turned}");
    assert_eq!((body.angular_velocity, body.linear_velocity), (Vec3::Y * body.angular_velocity.y, Vec3::X));
    assert!((body.angular_velocity.y - 2.0).abs() < 1e-5);
    simulation.world.bodies[0].locked_rotations = [false; 3];
    simulation.world.bodies[0].apply_angular_impulse(Vec3::X);
    simulation.step(DT).expect("a step");
    assert!((simulation.world.bodies[0].angular_velocity.x - 1.0).abs() < 1e-5);
}

/// Locked axes are axes of the world, and so no row turns the inertia of a body with them.
fn the_inertia_of_a_locked_body_turns_with_no_joint() {
    for axes in [[true; 3], [true, false, false], [false, true, false]] {
        for substeps in [8, 32, 64] {
            let mut simulation = simulation(mixture(|_| axes), substeps, reference);
            simulation.step(DT).expect("a step");
            assert!(simulation.problem().turning.is_empty(), "{axes:?}, {substeps} substeps");
        }
    }
}

fn a_contact_problem_of_locked_bodies_is_refused_by_name() {
    let mut world = World::new();
    world.insert(cube().named("crate").locked_rotations([false, true, false]));
    let error = drystone_problems::step_with_contacts(&mut simulation(world, 8, reference), "one", DT)
        .map(|_| ())
        .expect_err("a lock")
        .to_string();
    assert_eq!(error, "body 0 \"crate\" has locked axes: a contact problem cannot have locked axes");
}

/// A pile of boxes and chains between them, all in the plane of x and y, pushed out of it.
fn plane(joints: bool) -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::new(0.0, 1.0, 0.2).normalize())));
    let insert = |k: i32| {
        let at = [1.5 * (k % 4) as f32, 0.8 + 1.6 * (k / 4) as f32, 0.02 * k as f32];
        let body = if k % 3 == 0 { Body::dynamic().shape(Shape::ball(0.4)) } else { cube() };
        let body = body.position(at[0], at[1], at[2]).rotation(Quat::from_rotation_z(0.2 * k as f32));
        let body = body.locked_translations([false, false, true]).locked_rotations([true, true, false]);
        world.insert(body.velocity(Vec3::new(1.0, -1.0, 2.0), Vec3::ONE))
    };
    let bodies: Vec<BodyHandle> = (0..12).map(insert).collect();
    if joints {
        for (a, b) in [(bodies[10], bodies[11]), (bodies[9], bodies[10])] {
            let [body_a, body_b] = [a, b].map(|body| &world.bodies[body]);
            let middle = body_a.position.midpoint(body_b.position);
            let [on_a, on_b] = [body_a, body_b].map(|body| body.rotation.inverse() * (middle - body.position));
            world.insert_joint(Joint::new(a, on_a, b, on_b));
        }
    }
    world
}

fn a_body_with_locked_translations_stays_in_its_plane(open: Open) {
    for (joints, substeps) in [(false, 8), (true, 8), (false, 64)] {
        let before = plane(joints);
        let world = after(before.clone(), substeps, 120, open);
        for (body, before) in world.bodies.iter().zip(&before.bodies).skip(1) {
            assert_eq!((body.position.z.to_bits(), body.linear_velocity.z), (before.position.z.to_bits(), 0.0));
            assert_eq!((body.angular_velocity.x, body.angular_velocity.y), (0.0, 0.0));
        }
        let moved = world.bodies[5].position.distance(before.bodies[5].position);
        assert!(moved > 0.1 && world.bodies.iter().skip(1).all(|body| body.position.y > 0.2), "{moved}");
        assert!(world.joint_gap() < 5e-3, "{} m", world.joint_gap());
    }
}

/// A locked board of 1 kg stops 20 kg that fall on either end, and carries them. Before: the points of a manifold saw the
/// velocities that impulses at other points gave the board, and of three crates one flew off again at 0.5 m/s.
fn contacts_bear_on_a_locked_body_as_on_a_fixed_one(open: Open) {
    for gap in [0.02, 0.08, 0.1, 0.15] {
        a_locked_board_carries(gap, open);
    }
}

fn a_locked_board_carries(gap: f32, open: Open) {
    let mut world = World::new();
    let board = Body::dynamic().shape(Shape::cuboid(2.0, 0.1, 0.5)).total_mass(1.0).position(0.0, 1.0, 0.0);
    let board = world.insert(board.locked_translations([true; 3]).locked_rotations([true; 3]));
    let crates = [-1.5, 1.5].map(|x| {
        world.insert(Body::dynamic().shape(Shape::cuboid(0.3, 0.3, 0.3)).total_mass(20.0).position(x, 1.4 + gap, 0.0))
    });
    let mut simulation = simulation(world, 8, open);
    let (mut lowest, mut fastest) = (f32::INFINITY, 0.0_f32);
    for _ in 0..120 {
        simulation.step(DT).expect("a step");
        let bodies = || crates.iter().map(|&i| &simulation.world.bodies[i]);
        lowest = bodies().fold(lowest, |y, body| y.min(body.position.y));
        fastest = bodies().fold(fastest, |v, body| v.max(body.linear_velocity.y));
    }
    assert!(fastest < 0.02, "{fastest} m/s up after a fall by {gap} m");
    assert!(lowest > 1.4 - 2e-3, "{lowest} m");
    let world = simulation.world;
    assert_eq!(world.bodies[board].position, Vec3::Y);
    for body in crates.map(|i| &world.bodies[i]) {
        assert!((body.position.y - 1.4).abs() < 2e-3, "{}", body.position);
        assert!(body.linear_velocity.length() < 1e-2, "{}", body.linear_velocity);
    }
}

/// A cart of M on a rail along x, with a pendulum of m and I at the length l, swings with w² = m g l/(I + l² m M/(m + M)).
/// Its joint bears the bob from the first step on.
fn a_cart_on_a_rail_and_its_pendulum_swing_as_on_paper(open: Open) {
    for (mass, solver) in [1.0, 1000.0].into_iter().flat_map(|m| [(m, JointSolver::Sweeps), (m, JointSolver::Direct)]) {
        let mut world = World::new();
        let rail = cube().total_mass(1.0).locked_translations([false, true, true]).locked_rotations([true; 3]);
        let cart = world.insert(rail);
        // A small swing: the bob also rises, with 1000 times the mass of the cart.
        let swing = Quat::from_rotation_z(2e-3);
        let at = swing * Vec3::NEG_Y;
        let bob = Body::dynamic().shape(Shape::ball(0.05)).total_mass(mass).position(at.x, at.y, 0.0).rotation(swing);
        let bob = world.insert(bob);
        world.insert_joint(Joint::new(bob, Vec3::Y, cart, Vec3::ZERO));
        // Their common center of mass stays.
        let share = mass / (1.0 + mass);
        world.bodies[cart].position.x = -share * at.x;
        world.bodies[bob].position.x = at.x - share * at.x;
        let inertia = world.bodies[bob].mass.principal_inertia.x;
        let omega = (mass * 9.81 / (inertia + share)).sqrt();
        let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = solver);
        let mut simulation = Simulation::with(world, config, open()).expect("a simulation");
        let (mut worst, mut gap) = (0.0_f32, 0.0_f32);
        let step = 0.05 / omega;
        for k in 1..=120 {
            simulation.step(step).expect("a step");
            let [at_cart, at_bob] = [cart, bob].map(|i| simulation.world.bodies[i].position);
            worst = worst.max((at_bob.x - at_cart.x - at.x * (omega * step * k as f32).cos()).abs());
            gap = gap.max(simulation.world.joint_gap());
            assert_eq!((at_cart.y, at_cart.z), (0.0, 0.0));
        }
        let worst = worst / at.x.abs();
        assert!(worst < 0.05 && gap < 1e-4, "{mass} kg, {solver:?}: {worst} of the swing, and a gap of {gap} m");
    }
}

/// A carriage of 1 kg on a rail bears a ton on a weld, and a spring between them has the stiffness of its own.
fn axes_of_joints_bear_on_a_locked_body_as_on_a_fixed_one(open: Open) {
    for solver in [JointSolver::Sweeps, JointSolver::Direct] {
        let mut world = World::new();
        let rail = cube().total_mass(1.0).locked_translations([false, true, true]).locked_rotations([true; 3]);
        let [weld, spring] = [0.0, 4.0].map(|x| world.insert(rail.clone().position(x, 0.0, 0.0)));
        let load = |x: f32| cube().total_mass(1000.0).position(x, -2.0, 0.0);
        let [welded, sprung] = [0.0, 4.0].map(|x| world.insert(load(x)));
        world.insert_joint(Joint::new(welded, Vec3::Y * 2.0, weld, Vec3::ZERO).fixed());
        let stiffness = 1000.0 * 9.81 / 0.1;
        let axis = Joint::new(sprung, Vec3::Y * 2.0, spring, Vec3::ZERO).slider(Vec3::Y);
        world.insert_joint(axis.spring_damper(0.0, stiffness, 2.0 * (stiffness * 1000.0).sqrt()));
        let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = solver);
        let mut simulation = Simulation::with(world, config, open()).expect("a simulation");
        let mut sunk = 0.0_f32;
        for _ in 0..120 {
            simulation.step(DT).expect("a step");
            sunk = sunk.max(-2.0 - simulation.world.bodies[welded].position.y);
        }
        let stretched = -2.0 - simulation.world.bodies[sprung].position.y;
        assert!(sunk < 1e-3 && (stretched - 0.1).abs() < 1e-3, "{solver:?}: sunk {sunk} m, stretched {stretched} m");
    }
}

fn no_body_ends_a_step_faster_than_its_largest_speeds(open: Open) {
    let mut world = weightless();
    let fast = world.insert(cube().velocity(Vec3::new(30.0, 40.0, 0.0), Vec3::Y * 20.0).max_speeds(10.0, 2.0));
    let falls = world.insert(cube().position(20.0, 0.0, 0.0).max_speeds(5.0, f32::INFINITY));
    world.bodies[falls].force = Vec3::X * 60.0;
    let mut simulation = Simulation::with(world, SolverConfig::default(), open()).expect("a simulation");
    for step in 1..=60 {
        simulation.step(DT).expect("a step");
        let [fast, falls] = [fast, falls].map(|i| &simulation.world.bodies[i]);
        assert!((fast.linear_velocity - Vec3::new(6.0, 8.0, 0.0)).length() < 1e-5, "{}", fast.linear_velocity);
        assert!((fast.angular_velocity - Vec3::Y * 2.0).length() < 1e-5, "{}", fast.angular_velocity);
        let wanted = (10.0 * DT * step as f32).min(5.0);
        assert!((falls.linear_velocity.x - wanted).abs() < 1e-4, "{}, not {wanted}", falls.linear_velocity.x);
    }
    // The first step already moves it at that speed.
    assert!((simulation.world.bodies[fast].position - Vec3::new(6.0, 8.0, 0.0)).length() < 1e-3);
    simulation.world.bodies[fast].max_linear_speed = -1.0;
    let error = simulation.step(DT).expect_err("it is refused").to_string();
    assert!(error.contains("max_linear_speed = -1"), "{error}");
}

fn same_in_the_plane(open: Open) {
    for (joints, substeps) in [(false, 8), (true, 8), (true, 64)] {
        let [ours, theirs] = [reference, open].map(|open| {
            let config = SolverConfig::default().with(|c| c.substeps = substeps);
            let mut simulation = Simulation::with(plane(joints), config, open()).expect("a simulation");
            for step in 0..40 {
                if step == 20 {
                    simulation.world.bodies[3].locked_translations = [false; 3];
                    simulation.world.bodies[4].locked_translations = [true, true, false];
                }
                simulation.step(DT).expect("a step");
            }
            simulation.world
        });
        assert_eq!(all_bits(&ours), all_bits(&theirs), "{joints}, {substeps} substeps");
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_locked_translations() {
    same_in_the_plane(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_locked_translations() {
    same_in_the_plane(|| Box::new(Cpu::new()));
}

/// Bodies with locked axes exchange momentum with what locks them. A brake that kept the momentum of their island would
/// give them a motion that they cannot have.
fn the_law_of_energy_holds_bodies_with_locked_axes() {
    let mut world = weightless();
    let [a, b] = [(0.0, 3.0), (0.9, -3.0)].map(|(x, speed)| {
        let body = cube().position(x, 0.0, 0.0).locked_translations([false, true, true]);
        world.insert(body.velocity(Vec3::X * speed, Vec3::new(0.0, 5.0, -8.0)))
    });
    world.insert_joint(Joint::new(a, Vec3::X * 0.45, b, Vec3::X * -0.45).colliding());
    let energy = |world: &World| world.bodies.iter().map(Body::kinetic_energy).sum::<f64>();
    let before = energy(&world);
    let mut simulation = Simulation::with(world, SolverConfig::default(), reference()).expect("a simulation");
    for _ in 0..120 {
        simulation.step(DT).expect("a step");
        assert!(energy(&simulation.world) < 1.01 * before, "{} J from {before}", energy(&simulation.world));
    }
}
