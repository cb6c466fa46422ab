//! Forces, torques, impulses and gravity against closed forms.

use crate::common::state::{bits, reference};
use crate::common::{Open, gpu};
use drystone::glam::{Quat, Vec3};
use drystone::{Body, BodyHandle, Cpu, Joint, MassProperties, Shape, Simulation, SolverConfig, World};

tests! {
    every_backend {
        a_torque_makes_the_angular_velocity_torque_times_time_over_inertia,
        a_torque_about_a_principal_axis_turns_a_board_about_that_axis,
        a_torque_does_the_work_torque_times_angle,
        an_impulse_at_a_point_changes_velocity_and_spin,
        a_force_at_a_point_acts_in_one_step,
        a_gravity_scale_of_zero_floats_and_of_minus_one_rises,
        moon_beside_earth_fall_by_their_own_gravity,
        a_torque_beyond_friction_and_weight_tips_a_box,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_torques_and_gravities,
    }
    no_gpu {
        lanes_have_the_bits_of_the_reference_with_torques_and_gravities,
        a_world_is_the_same_alone_and_beside_one_of_other_gravity,
        a_body_without_torque_keeps_its_bits_beside_one_with_torque,
        every_change_of_a_load_wakes_a_body_that_sleeps,
        gravity_of_one_world_wakes_its_bodies_and_no_others,
        energy_counts_the_gravity_that_bodies_feel,
        a_body_of_large_gravity_scale_meets_a_thin_plate,
        joints_bear_the_gravity_that_their_bodies_feel,
        towers_of_other_gravity_begin_at_rest,
        loads_that_are_no_numbers_are_refused_by_name,
        impulses_and_forces_leave_fixed_and_kinematic_bodies_alone,
    }
}

const DT: f32 = 1.0 / 60.0;

fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

/// A cube of 6 kg with sides of 1 m: 1 kg m² about every axis.
fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0)
}

fn simulation(world: World, open: Open) -> Simulation {
    Simulation::with(world, SolverConfig::default(), open()).expect("a simulation")
}

fn run(simulation: &mut Simulation, steps: u32) {
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

/// Refuses vectors that differ by more than rounding does in a hundred substeps.
fn near(x: Vec3, y: Vec3) {
    assert!((x - y).length() < 2e-5 * (1.0 + y.length()), "{x}, not {y}");
}

fn a_torque_makes_the_angular_velocity_torque_times_time_over_inertia(open: Open) {
    let mut world = weightless();
    let torque = Vec3::new(0.5, -1.0, 2.0);
    let turned = world.insert(cube());
    world.bodies[turned].torque = torque;
    let still = world.insert(cube().position(5.0, 0.0, 0.0));
    let mut simulation = simulation(world, open);
    run(&mut simulation, 30);
    let bodies = &simulation.world.bodies;
    near(bodies[turned].angular_velocity, 0.5 * torque);
    assert_eq!((bodies[turned].linear_velocity, bodies[still].angular_velocity), (Vec3::ZERO, Vec3::ZERO));
    // The torque lasts until it ends.
    simulation.world.bodies[turned].torque = Vec3::ZERO;
    run(&mut simulation, 10);
    near(simulation.world.bodies[turned].angular_velocity, 0.5 * torque);
}

/// Axes of the board and of its moments are turned against each other and against the world.
fn a_torque_about_a_principal_axis_turns_a_board_about_that_axis(open: Open) {
    let (frame, rotation) =
        (Quat::from_scaled_axis(Vec3::new(0.3, -0.7, 0.4)), Quat::from_scaled_axis(Vec3::new(-0.2, 0.5, 0.9)));
    let inertia = Vec3::new(1.0, 2.0, 2.5);
    let mass = MassProperties { mass: 3.0, principal_inertia: inertia, principal_frame: frame, center: Vec3::ZERO };
    let mut world = weightless();
    for k in 0..3 {
        let axis = rotation * frame * Vec3::AXES[k];
        let board = world.insert(Body::dynamic().mass_properties(mass).rotation(rotation));
        world.bodies[board].torque = 4.0 * axis;
    }
    let axes: Vec<Vec3> = world.bodies.iter().map(|b| b.torque / 4.0).collect();
    let mut simulation = simulation(world, open);
    run(&mut simulation, 30);
    for (k, body) in simulation.world.bodies.iter().enumerate() {
        near(body.angular_velocity, axes[k] * (2.0 / inertia[k]));
    }
}

fn a_torque_does_the_work_torque_times_angle(open: Open) {
    let mut world = weightless();
    world.insert(cube());
    world.bodies[0].torque = Vec3::Z * 2.0;
    let mut simulation = simulation(world, open);
    run(&mut simulation, 30);
    let body = &simulation.world.bodies[0];
    let angle = 2.0 * body.rotation.z.atan2(body.rotation.w);
    assert!((angle - 0.25).abs() < 1e-6, "{angle} rad");
    let work = f64::from(2.0 * angle);
    assert!((body.kinetic_energy() - work).abs() < 2e-5, "{} J, not {work}", body.kinetic_energy());
}

fn an_impulse_at_a_point_changes_velocity_and_spin(open: Open) {
    let mut world = weightless();
    world.insert(cube().position(1.0, 2.0, 3.0));
    world.insert(cube().position(9.0, 2.0, 3.0));
    let mut simulation = simulation(world, open);
    let (impulse, arm) = (Vec3::new(3.0, -6.0, 12.0), Vec3::new(0.5, 0.5, -0.25));
    let body = &mut simulation.world.bodies[0];
    body.apply_impulse_at(impulse, body.center_of_mass() + arm);
    let body = &mut simulation.world.bodies[1];
    body.apply_impulse(impulse);
    body.apply_angular_impulse(arm.cross(impulse));
    for steps in [0, 10] {
        run(&mut simulation, steps);
        for body in &simulation.world.bodies {
            near(body.linear_velocity, impulse / 6.0);
            near(body.angular_velocity, arm.cross(impulse));
        }
    }
}

fn a_force_at_a_point_acts_in_one_step(open: Open) {
    let mut world = weightless();
    world.insert(cube());
    world.bodies[0].force = Vec3::Y * 6.0;
    let mut simulation = simulation(world, open);
    let (force, arm) = (Vec3::new(60.0, 0.0, -120.0), Vec3::new(0.0, 0.5, 0.25));
    let body = &mut simulation.world.bodies[0];
    body.apply_force_at(force, arm);
    body.apply_force(Vec3::X * 60.0);
    body.apply_torque(Vec3::Z * 6.0);
    let (whole, torque) = (force + Vec3::X * 60.0, arm.cross(force) + Vec3::Z * 6.0);
    assert_eq!((body.whole_force(), body.whole_torque()), (whole + Vec3::Y * 6.0, torque));
    for steps in 1..4 {
        run(&mut simulation, 1);
        let body = &simulation.world.bodies[0];
        near(body.linear_velocity, whole * DT / 6.0 + Vec3::Y * (steps as f32 * DT));
        near(body.angular_velocity, torque * DT);
        assert_eq!((body.whole_force(), body.whole_torque()), (Vec3::Y * 6.0, Vec3::ZERO));
    }
}

fn a_gravity_scale_of_zero_floats_and_of_minus_one_rises(open: Open) {
    let mut world = World::new();
    for (k, scale) in [1.0, 0.0, -1.0, 0.5].into_iter().enumerate() {
        world.insert(cube().position(3.0 * k as f32, 0.0, 0.0).gravity_scale(scale));
    }
    let mut simulation = simulation(world, open);
    run(&mut simulation, 30);
    let [falls, floats, rises, half] = [0, 1, 2, 3].map(|k| &simulation.world.bodies[k]);
    near(falls.linear_velocity, Vec3::Y * (-9.81 * 0.5));
    assert_eq!((floats.position, floats.linear_velocity), (Vec3::X * 3.0, Vec3::ZERO));
    assert_eq!((rises.position.y, rises.linear_velocity.y), (-falls.position.y, -falls.linear_velocity.y));
    assert!(rises.position.y > 1.2);
    near(half.linear_velocity, falls.linear_velocity * 0.5);
}

fn moon_beside_earth_fall_by_their_own_gravity(open: Open) {
    let world = |gravity: f32| {
        let mut world = World { gravity: Vec3::Y * -gravity, ..World::new() };
        world.insert(cube());
        world
    };
    let mut both = world(9.81);
    both.beside(&world(1.62));
    both.beside(&world(9.81));
    let mut simulation = simulation(both, open);
    run(&mut simulation, 30);
    for (body, gravity) in simulation.world.bodies.iter().zip([9.81, 1.62, 9.81]) {
        near(body.linear_velocity, Vec3::Y * (-0.5 * gravity));
        near(body.position, Vec3::Y * (-0.125 * gravity));
    }
    // The plain gravity is that of all worlds without one of their own.
    simulation.world.gravity = Vec3::ZERO;
    let before: Vec<Vec3> = simulation.world.bodies.iter().map(|b| b.linear_velocity).collect();
    run(&mut simulation, 30);
    let gained = |k: usize| simulation.world.bodies[k].linear_velocity - before[k];
    assert_eq!((gained(0), gained(2)), (Vec3::ZERO, Vec3::ZERO));
    near(gained(1), Vec3::Y * (-0.5 * 1.62));
}

/// The weight of a cube holds its side down with m g/2 times its length, 29.43 N m; friction of 1 holds the edge about which it tips.
fn a_torque_beyond_friction_and_weight_tips_a_box(open: Open) {
    for (torque, tips) in [(28.0, false), (31.0, true)] {
        let mut world = World::new();
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(1.0));
        world.insert(cube().position(0.0, 0.5, 0.0).friction(1.0));
        world.bodies[1].torque = Vec3::Z * torque;
        let mut simulation = simulation(world, open);
        run(&mut simulation, 60);
        let turned = simulation.world.bodies[1].rotation.z.abs();
        assert!(if tips { turned > 0.1 } else { turned < 1e-3 }, "{torque} N m: {turned}");
    }
}

/// Towers, a chain and free bodies in worlds of three gravities, some of them pushed and turned.
fn mixture() -> World {
    let world = |gravity: Vec3, torque: f32| {
        let mut world = World { gravity, ..World::new() };
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
        for i in 0..4 {
            let mut body = cube().position(0.0, 0.5 + i as f32, 0.0).gravity_scale(1.0 + 0.5 * i as f32);
            body.torque = Vec3::new(0.3, 1.0, -0.2) * torque;
            world.insert(body);
        }
        let plank = Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.2)).position(3.0, 2.0, 0.0).gravity_scale(-0.1);
        let plank = world.insert(plank);
        let ball = world.insert(Body::dynamic().shape(Shape::ball(0.3)).position(3.0, 4.0, 0.0));
        world.bodies[plank].torque = Vec3::ONE * 0.3 * torque;
        world.insert_joint(Joint::new(plank, Vec3::Y, ball, Vec3::NEG_Y));
        world
    };
    let mut all = world(Vec3::Y * -9.81, 0.0);
    all.beside(&world(Vec3::new(1.0, -1.62, 0.0), 2.0));
    all.beside(&world(Vec3::Y * -25.0, -9.0));
    all
}

/// The mixture after 40 steps with hits and pushes, with substeps long and short.
fn after_a_while(world: World, backend: Box<dyn drystone::Backend>, substeps: u32) -> World {
    let config = SolverConfig::default().with(|c| c.substeps = substeps);
    let mut simulation = Simulation::with(world, config, backend).expect("a simulation");
    for step in 0..40 {
        let body = &mut simulation.world.bodies[4];
        if step % 7 == 3 {
            body.apply_impulse_at(Vec3::X, body.position + Vec3::Y * 0.3);
        }
        if step % 5 == 2 {
            body.apply_force_at(Vec3::Z * 20.0, body.position + Vec3::X * 0.5);
        }
        simulation.step(DT).expect("a step");
    }
    simulation.world
}

fn same_as_the_reference(backend: fn() -> Box<dyn drystone::Backend>) {
    for substeps in [8, 32] {
        let [ours, theirs] = [reference(), backend()].map(|backend| after_a_while(mixture(), backend, substeps));
        let all = 0..ours.bodies.len();
        assert_eq!(bits(&ours, all.clone()), bits(&theirs, all.clone()), "{substeps} substeps");
        assert!(all.into_iter().any(|i| ours.bodies[i].angular_velocity.length() > 1.0));
    }
}

fn a_gpu_has_the_bits_of_the_reference_with_torques_and_gravities() {
    same_as_the_reference(|| Box::new(gpu::exact()));
}

fn lanes_have_the_bits_of_the_reference_with_torques_and_gravities() {
    same_as_the_reference(|| Box::new(Cpu::new()));
}

fn a_world_is_the_same_alone_and_beside_one_of_other_gravity() {
    let all = mixture();
    let beside = after_a_while(all.clone(), reference(), 8);
    for (part, own) in all.worlds().into_iter().enumerate().skip(1) {
        let own: Vec<usize> = own.into_iter().map(BodyHandle::index).collect();
        let mut alone = World { gravity: all.gravity_of(part), ..World::new() };
        let bodies: Vec<BodyHandle> = own.iter().map(|&i| alone.insert(all.bodies[i].clone())).collect();
        let first = own[0];
        alone.insert_joint(Joint::new(bodies[5], Vec3::Y, bodies[6], Vec3::NEG_Y));
        let mut simulation = simulation(alone, reference);
        run(&mut simulation, 40);
        assert_eq!(bits(&simulation.world, 0..own.len()), bits(&beside, own), "world {part} from {first} on");
    }
}

fn a_body_without_torque_keeps_its_bits_beside_one_with_torque() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..5 {
        world.insert(cube().position(0.0, 0.5 + i as f32, 0.0).velocity(Vec3::ZERO, -Vec3::ZERO));
    }
    // It falls freely, so that nothing but its torque acts on the sign of its spin.
    world.insert(cube().position(20.0, 90.0, 0.0).velocity(Vec3::ZERO, -Vec3::ZERO));
    let lone = world.insert(cube().position(50.0, 9.0, 0.0));
    let mut both = [0.0, 1.0].map(|torque| {
        let mut world = world.clone();
        world.bodies[lone].torque = Vec3::Y * torque;
        simulation(world, reference)
    });
    for _ in 0..20 {
        both.iter_mut().for_each(|simulation| run(simulation, 1));
        assert_eq!(bits(&both[0].world, 0..lone.index()), bits(&both[1].world, 0..lone.index()));
    }
    assert_ne!(bits(&both[0].world, [lone.index()]), bits(&both[1].world, [lone.index()]));
    // Adding negative zero changes no number.
    let torques = both[1].problem().torques.iter().map(|row| row.angular_acceleration);
    let without: Vec<[f32; 3]> = torques.filter(|torque| torque[1] == 0.0).collect();
    assert!(without.len() >= lone.index(), "{without:?}");
    assert!(without.iter().flatten().all(|torque| torque.is_sign_negative()), "{without:?}");
}

/// Two cubes that sleep on the floor far from each other.
fn sleepers(gravity: f32) -> World {
    let mut world = World { gravity: Vec3::Y * -gravity, ..World::new() };
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world.insert(cube().position(0.0, 0.5, 0.0));
    world.insert(cube().position(9.0, 0.5, 0.0));
    world
}

fn asleep(world: World) -> Simulation {
    let mut simulation = simulation(world, reference);
    let bodies = &simulation.world.bodies;
    let dynamic: Vec<BodyHandle> = bodies.handles().filter(|&i| bodies[i].mass.mass > 0.0).collect();
    while !dynamic.iter().all(|&i| simulation.is_asleep(i)) {
        run(&mut simulation, 1);
    }
    simulation
}

fn every_change_of_a_load_wakes_a_body_that_sleeps() {
    type Change = (&'static str, fn(&mut Body));
    let changes: [Change; 8] = [
        ("torque", |b| b.torque.y = 1.0),
        ("gravity_scale", |b| b.gravity_scale = 1.5),
        ("apply_force", |b| b.apply_force(Vec3::X)),
        ("apply_force_at", |b| b.apply_force_at(Vec3::X, b.position + Vec3::Y)),
        ("apply_torque", |b| b.apply_torque(Vec3::X)),
        ("apply_impulse", |b| b.apply_impulse(Vec3::X)),
        ("apply_impulse_at", |b| b.apply_impulse_at(Vec3::X, b.position + Vec3::Y)),
        ("apply_angular_impulse", |b| b.apply_angular_impulse(Vec3::Y)),
    ];
    for (name, change) in changes {
        let mut simulation = asleep(sleepers(9.81));
        run(&mut simulation, 1);
        let [changed, other] = [1, 2].map(|i| simulation.world.bodies.handle(i).expect("a cube"));
        assert!(simulation.is_asleep(changed), "{name}: woke without a change");
        change(&mut simulation.world.bodies[changed]);
        run(&mut simulation, 1);
        assert!(!simulation.is_asleep(changed) && simulation.is_asleep(other), "{name}");
        let body = &simulation.world.bodies[changed];
        assert_eq!((body.whole_force(), body.whole_torque()), (body.force, body.torque), "{name}");
    }
}

fn gravity_of_one_world_wakes_its_bodies_and_no_others() {
    let mut world = sleepers(9.81);
    world.beside(&sleepers(1.62));
    let mut simulation = asleep(world);
    simulation.world.own_gravity[1] = Some(Vec3::Y * -3.7);
    run(&mut simulation, 1);
    let cubes = [1, 2, 4, 5].map(|i| simulation.world.bodies.handle(i).expect("a cube"));
    assert_eq!(cubes.map(|cube| simulation.is_asleep(cube)), [true, true, false, false]);
}

/// Kinetic and potential energy of bodies that fall, rise and float in two worlds, against their sum at the start.
fn energy_counts_the_gravity_that_bodies_feel() {
    for (first, second) in [(9.81, 0.0), (0.0, 1.62), (9.81, 1.62)] {
        let mut world = floating(first);
        world.beside(&floating(second));
        let expected: f64 = [first, second].iter().map(|g| 6.0 * f64::from(*g) * 10.0 * (1.0 - 2.0 + 0.3)).sum();
        assert!((world.potential_energy() - expected).abs() < 1e-3, "{} J", world.potential_energy());
        let mut simulation = simulation(world, reference);
        run(&mut simulation, 30);
        let kinetic = simulation.world.kinetic_energy();
        let sum = kinetic + simulation.world.potential_energy();
        assert!((sum - expected).abs() < 1e-4 * kinetic && kinetic > 1.0, "{sum} J, not {expected}");
    }
}

/// Cubes 10 m up that feel more and less of a gravity.
fn floating(gravity: f32) -> World {
    let mut world = World { gravity: Vec3::Y * -gravity, ..World::new() };
    for (k, scale) in [1.0, -2.0, 0.0, 0.3].into_iter().enumerate() {
        world.insert(cube().position(3.0 * k as f32, 10.0, 0.0).gravity_scale(scale));
    }
    world
}

/// In its first step the ball falls by 77 mm, from 30 mm above the plate of 10 mm.
fn a_body_of_large_gravity_scale_meets_a_thin_plate() {
    let mut world = World::new();
    // A small plate, because contacts are also looked for within 4% of the size. The first step is 77 mm, the gap 60 mm.
    world.insert(Body::fixed().shape(Shape::cuboid(0.1, 0.005, 0.1)));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.02)).position(0.0, 0.085, 0.0).gravity_scale(50.0));
    let mut simulation = simulation(world, reference);
    for _ in 0..30 {
        run(&mut simulation, 1);
        let height = simulation.world.bodies[ball].position.y;
        assert!(height > 0.024, "the ball is at {height}");
    }
}

fn joints_bear_the_gravity_that_their_bodies_feel() {
    let gap = |scale: f32, own: Option<f32>| {
        let mut world = World::new();
        if let Some(own) = own {
            world.own_gravity = vec![Some(Vec3::Y * -own)];
        }
        let [a, b, c] = [0.0, -2.0, -4.0].map(|y| world.insert(cube().position(0.0, y, 0.0).gravity_scale(scale)));
        world.insert_joint(Joint::to_world(a, Vec3::Y, Vec3::Y));
        world.insert_joint(Joint::new(a, Vec3::NEG_Y, b, Vec3::Y));
        world.insert_joint(Joint::new(b, Vec3::NEG_Y, c, Vec3::Y));
        let mut simulation = simulation(world, reference);
        let first = simulation.step(DT).expect("a step").swept_joint_gap;
        // A change between steps counts as well.
        simulation.world.bodies.iter_mut().for_each(|body| body.gravity_scale *= 0.5);
        [first, simulation.step(DT).expect("a step").swept_joint_gap]
    };
    let [whole, half] = gap(1.0, None);
    assert!(whole > 0.0 && (half / whole - 0.5).abs() < 1e-5, "{whole} {half}");
    assert_eq!(gap(0.0, None), [0.0; 2]);
    assert_eq!(gap(1.0, Some(0.0)), [0.0; 2]);
    assert!((gap(2.0, None)[0] / whole - 2.0).abs() < 1e-5);
    assert!((gap(1.0, Some(2.0 * 9.81))[0] / whole - 2.0).abs() < 1e-5);
}

/// Statics gives the impulses with which a tower begins: by the gravity of its world and of its bodies.
fn towers_of_other_gravity_begin_at_rest() {
    let tower = |gravity: f32, scale: f32| {
        let mut world = World { gravity: Vec3::Y * -gravity, ..World::new() };
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
        for i in 0..6 {
            world.insert(cube().position(0.0, 0.5 + i as f32, 0.0).gravity_scale(scale));
        }
        world
    };
    let mut world = tower(9.81, 1.0);
    world.beside(&tower(1.62, 1.0));
    world.beside(&tower(9.81, 3.0));
    world.beside(&tower(25.0, 0.5));
    let mut simulation = simulation(world, reference);
    run(&mut simulation, 1);
    for (i, body) in simulation.world.bodies.iter().enumerate() {
        assert!(body.linear_velocity.length() < 1e-4, "body {i}: {} m/s", body.linear_velocity);
    }
}

fn loads_that_are_no_numbers_are_refused_by_name() {
    type Change = (&'static str, fn(&mut World));
    let changes: [Change; 4] = [
        ("body 1 \"\": torque = ", |w| w.bodies[1].torque.y = f32::NAN),
        ("body 1 \"\": force = ", |w| w.bodies[1].apply_force(Vec3::INFINITY)),
        ("body 1 \"\": gravity_scale = inf: must be at most 1e9 in size", |w| {
            w.bodies[1].gravity_scale = f32::INFINITY
        }),
        ("gravity = [0, 0, inf]: must be at most 1e9 m/s² along every axis", |w| {
            w.own_gravity = vec![None, Some(Vec3::new(0.0, 0.0, f32::INFINITY))];
        }),
    ];
    for (line, change) in changes {
        let mut world = sleepers(9.81);
        change(&mut world);
        let error = Simulation::with(world, SolverConfig::default(), reference()).err().expect("a refusal").to_string();
        assert!(error.contains(line) && !error.contains('\n'), "{error}");
    }
}

fn impulses_and_forces_leave_fixed_and_kinematic_bodies_alone() {
    for mut body in [Body::fixed(), Body::kinematic()] {
        body.apply_impulse_at(Vec3::X, Vec3::Y);
        body.apply_force_at(Vec3::X, Vec3::Y);
        assert_eq!((body.linear_velocity, body.angular_velocity), (Vec3::ZERO, Vec3::ZERO));
        assert_eq!((body.whole_force(), body.whole_torque()), (Vec3::ZERO, Vec3::ZERO));
    }
}
