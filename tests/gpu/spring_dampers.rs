//! Springs of a stiffness, and joints that are switched off, against closed forms.

use std::f32::consts::TAU;

use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, BodyHandle, Joint, Shape, Simulation, SolverConfig, World};

use crate::common::Open;
use crate::common::state::{all_bits, reference};

tests! {
    every_backend {
        a_damper_slows_a_mass_by_its_constant,
        a_joint_that_is_off_holds_nothing_until_it_is_on,
        a_spring_between_two_bodies_swings_with_their_reduced_mass,
    }
    every_backend_the_gpu_at_night {
        a_torsion_spring_turns_a_rod_about_its_end,
        a_spring_of_a_stiffness_swings_with_the_mass_that_it_moves,
    }
    no_gpu {
        bodies_of_a_joint_that_is_off_collide_and_wake,
        constants_out_of_range_are_refused,
        springs_of_both_kinds_agree,
        a_spring_of_a_frequency_has_the_mass_of_two_free_bodies_at_its_anchors,
        springs_of_a_frequency_keep_their_energy_in_every_pose,
    }
}

const DT: f32 = 1.0 / 240.0;

fn simulation(world: World, open: Open) -> Simulation {
    Simulation::with(world, SolverConfig::default().without_sleep(), open()).expect("a good world")
}

fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

fn cube(mass: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.1, 0.1, 0.1)).total_mass(mass)
}

/// The mean times between two passages of zero upwards, of all that `measure` gives, in 8 s (s).
fn periods<const N: usize>(simulation: &mut Simulation, measure: impl Fn(&World) -> [f32; N]) -> [f32; N] {
    let (mut times, mut before) = ([const { Vec::new() }; N], measure(&simulation.world));
    for step in 1..=1920 {
        simulation.step(DT).expect("a step");
        let now = measure(&simulation.world);
        for i in 0..N {
            if before[i] < 0.0 && now[i] >= 0.0 {
                times[i].push((step as f32 - now[i] / (now[i] - before[i])) * DT);
            }
        }
        before = now;
    }
    times.map(|times| {
        assert!(times.len() > 2, "{} passages", times.len());
        (times[times.len() - 1] - times[0]) / (times.len() - 1) as f32
    })
}

fn near(what: &str, measured: f32, exact: f32, share: f32) {
    assert!((measured / exact - 1.0).abs() < share, "{what}: {measured}, not {exact}");
}

/// Adds a mass that a slider leads along X, away from the place of its spring.
fn add_on_a_slider(world: &mut World, mass: f32, spring: Axis) {
    let apart = Vec3::Z * world.bodies.len() as f32;
    let body = world.insert(cube(mass).position(0.2, 0.0, apart.z));
    let slider = Joint::to_world(body, Vec3::ZERO, apart).along(Vec3::X);
    world.insert_joint(slider.generic([spring, Axis::LOCKED, Axis::LOCKED], [Axis::LOCKED; 3]));
}

fn on_a_slider(mass: f32, spring: Axis) -> World {
    let mut world = weightless();
    add_on_a_slider(&mut world, mass, spring);
    world
}

fn a_spring_of_a_stiffness_swings_with_the_mass_that_it_moves(open: Open) {
    let (stiffness, masses) = (100.0_f32, [0.5_f32, 2.0, 8.0]);
    let mut world = weightless();
    for mass in masses {
        add_on_a_slider(&mut world, mass, Axis::FREE.spring_damper(0.0, stiffness, 0.0, f32::MAX));
    }
    let measured = periods(&mut simulation(world, open), |world| [0, 1, 2].map(|i| world.bodies[i].position.x));
    for (mass, measured) in masses.into_iter().zip(measured) {
        near(&format!("period of {mass} kg"), measured, TAU * (mass / stiffness).sqrt(), 2e-3);
    }
}

/// A weak spring and a strong damper: v decays as exp(-c t/m).
fn a_damper_slows_a_mass_by_its_constant(open: Open) {
    for (mass, damping) in [(2.0_f32, 3.0_f32), (8.0, 3.0), (2.0, 9.0)] {
        let mut world = on_a_slider(mass, Axis::FREE.spring_damper(0.0, 1e-6, damping, f32::MAX));
        world.bodies[0].linear_velocity = Vec3::X;
        let mut simulation = simulation(world, open);
        (0..120).for_each(|_| drop(simulation.step(DT).expect("a step")));
        let speed = simulation.world.bodies[0].linear_velocity.x;
        near(&format!("{mass} kg, {damping} N s/m"), speed, (-damping * 0.5 / mass).exp(), 0.01);
    }
}

/// A rod of 1 m and 2 kg on a hinge at its end: its inertia there and not the one about its center counts; and it hangs
/// askew by its weight.
fn a_torsion_spring_turns_a_rod_about_its_end(open: Open) {
    let stiffness = 30.0;
    let rod = |turned: f32| {
        let turn = Quat::from_rotation_z(turned);
        let center = turn * Vec3::X * 0.5;
        let rod = Body::dynamic().shape(Shape::cuboid(0.5, 0.02, 0.02)).total_mass(2.0).rotation(turn);
        rod.position(center.x, center.y, center.z)
    };
    let hinge = |body: BodyHandle, damping: f32| {
        let hinge = Joint::to_world(body, Vec3::X * -0.5, Vec3::ZERO).hinge(Vec3::Z);
        hinge.spring_damper(0.0, stiffness, damping)
    };
    let angle = |world: &World| world.joint_motion(&world.joints[0]).position[3];
    let mut world = weightless();
    let body = world.insert(rod(0.1));
    world.insert_joint(hinge(body, 0.0));
    let mut free = simulation(world, open);
    let inertia = 2.0 * ((1.0 + 0.04_f32.powi(2)) / 12.0 + 0.25);
    let [measured] = periods(&mut free, |world| [angle(world)]);
    near("period", measured, TAU * (inertia / stiffness).sqrt(), 4e-3);

    let mut world = World::new();
    let body = world.insert(rod(0.0));
    world.insert_joint(hinge(body, 5.0));
    let mut hanging = simulation(world, open);
    (0..1200).for_each(|_| drop(hanging.step(DT).expect("a step")));
    let turned = angle(&hanging.world);
    near("torque", -stiffness * turned, 2.0 * 9.81 * 0.5 * turned.cos(), 0.01);
}

fn a_spring_between_two_bodies_swings_with_their_reduced_mass(open: Open) {
    let (stiffness, masses) = (60.0_f32, [1.0_f32, 3.0]);
    let mut world = weightless();
    let [a, b] = [0, 1].map(|k| world.insert(cube(masses[k]).position(1.2 * k as f32, 0.0, 0.0)));
    let spring = Axis::FREE.spring_damper(1.0, stiffness, 0.0, f32::MAX);
    world.insert_joint(Joint::new(a, Vec3::ZERO, b, Vec3::ZERO).at_distance(spring));
    let mut simulation = simulation(world, open);
    let reduced = masses[0] * masses[1] / (masses[0] + masses[1]);
    let apart = |world: &World| [world.bodies[1].position.x - world.bodies[0].position.x - 1.0];
    let [measured] = periods(&mut simulation, apart);
    near("period", measured, TAU * (reduced / stiffness).sqrt(), 2e-3);
    assert!(simulation.world.linear_momentum().length() < 1e-4);
}

/// On one mass, frequency and ratio say the same as stiffness and damping.
fn springs_of_both_kinds_agree() {
    let (mass, frequency, ratio) = (3.0_f32, 2.0_f32, 0.2_f32);
    let omega = TAU * frequency;
    let (stiffness, damping) = (mass * omega * omega, 2.0 * ratio * omega * mass);
    let run = |spring: Axis| {
        let mut simulation = simulation(on_a_slider(mass, spring), reference);
        (0..100).for_each(|_| drop(simulation.step(DT).expect("a step")));
        simulation.world.bodies[0].position.x
    };
    let [one, other] =
        [Axis::FREE.spring(0.0, frequency, ratio, 25.0), Axis::FREE.spring_damper(0.0, stiffness, damping, 25.0)]
            .map(run);
    assert!((one - other).abs() < 1e-5 && one.abs() > 1e-3, "{one} m, {other} m");
}

fn constants_out_of_range_are_refused() {
    let line = |stiffness: f32, damping: f32| {
        let world = on_a_slider(1.0, Axis::FREE.spring_damper(0.0, stiffness, damping, f32::MAX));
        world.check().expect_err("out of range").to_string()
    };
    assert_eq!(line(0.0, 0.0), "joint 0: linear: stiffness = 0: must be above 0 and at most 1e30");
    assert_eq!(line(f32::NAN, 0.0), "joint 0: linear: stiffness = NaN: must be above 0 and at most 1e30");
    assert_eq!(line(1.0, -1.0), "joint 0: linear: damping = -1: must be 0 to 1e30");
}

fn a_joint_that_is_off_holds_nothing_until_it_is_on(open: Open) {
    let world = |joint: Option<bool>| {
        let mut world = World::new();
        let body = world.insert(cube(2.0).velocity(Vec3::X, Vec3::Z));
        if let Some(enabled) = joint {
            world.insert_joint(
                Joint::to_world(body, Vec3::Y * 0.3, Vec3::Y * 0.3).hinge(Vec3::Z).motor(1.0, 50.0).enabled(enabled),
            );
        }
        world
    };
    let [mut off, mut none] = [Some(false), None].map(|joint| simulation(world(joint), open));
    for _ in 0..60 {
        off.step(DT).expect("a step");
        none.step(DT).expect("a step");
        assert_eq!(all_bits(&off.world), all_bits(&none.world));
    }
    let hinge = off.world.joints.handles()[0];
    assert_eq!((off.joint_force(hinge), off.joint_torque(hinge)), (Some(Vec3::ZERO), Some(Vec3::ZERO)));
    assert_eq!(off.world.joint_gap(), 0.0);
    // On, it catches the body where it is.
    let body = &off.world.bodies[0];
    let anchor = body.position + body.rotation * (Vec3::Y * 0.3);
    (off.world.joints[0].enabled, off.world.joints[0].anchor_b) = (true, anchor);
    (0..240).for_each(|_| drop(off.step(DT).expect("a step")));
    assert!(off.world.joint_gap() < 1e-3 && off.world.bodies[0].position.distance(anchor) < 0.301);
    assert!(off.joint_force(hinge).is_some_and(|force| force.length() > 1.0));
    off.world.joints[0].enabled = false;
    let height = off.world.bodies[0].position.y;
    (0..60).for_each(|_| drop(off.step(DT).expect("a step")));
    assert!(off.world.bodies[0].position.y < height - 0.2);
}

/// Two cubes one on the other, whose weld keeps them from colliding; off, the upper one lies on the lower one.
fn bodies_of_a_joint_that_is_off_collide_and_wake() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let [low, high] = [0.1, 0.25].map(|y| world.insert(cube(1.0).position(0.0, y, 0.0)));
    world.insert_joint(Joint::new(high, Vec3::ZERO, low, Vec3::Y * 0.15).fixed());
    let mut simulation = Simulation::with(world, SolverConfig::default(), reference()).expect("a good world");
    let steps = |simulation: &mut Simulation| (0..480).for_each(|_| drop(simulation.step(DT).expect("a step")));
    steps(&mut simulation);
    assert!(simulation.is_asleep(high) && (simulation.world.bodies[high].position.y - 0.25).abs() < 1e-3);
    simulation.world.joints[0].enabled = false;
    simulation.step(DT).expect("a step");
    assert!(!simulation.is_asleep(high));
    steps(&mut simulation);
    assert!(
        (simulation.world.bodies[high].position.y - 0.3).abs() < 2e-3,
        "{}",
        simulation.world.bodies[high].position
    );
}

/// The first pull of a spring at a deflection of 0.1 m gives its stiffness: that of a ball by 1/m + 2 r²/(3 I), since an impulse across the arm r
/// turns it and one along the arm does not.
fn a_spring_of_a_frequency_has_the_mass_of_two_free_bodies_at_its_anchors() {
    let (mass, radius, frequency, dt) = (3.0_f32, 0.2_f32, 2.0_f32, 1e-4);
    for arm in [Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.4] {
        let mut world = weightless();
        let ball = world.insert(Body::dynamic().shape(Shape::ball(radius)).total_mass(mass));
        world.insert_joint(Joint::to_world(ball, arm, arm + Vec3::X * 1.1).elastic(1.0, frequency, 0.0));
        let mut simulation =
            Simulation::with(world, SolverConfig::default(), Box::new(drystone::Cpu::new())).expect("a world");
        simulation.step(dt).expect("a step");
        let pull = simulation.world.bodies[ball].linear_velocity.x * mass / (0.1 * dt);
        let inverse_mass = 1.0 / mass + 2.0 * arm.length_squared() / (3.0 * 0.4 * mass * radius * radius);
        near(&format!("stiffness at {arm}"), pull, (TAU * frequency).powi(2) / inverse_mass, 2e-3);
    }
}

/// Angles of a long body whose inertia differs about its axes, and a spring from end to end of two bars.
fn springs_of_a_frequency_keep_their_energy_in_every_pose() {
    let bar = || Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.2)).total_mass(2.0);
    for frequency in [0.5, 2.0] {
        let spring = Axis::FREE.spring(0.0, frequency, 0.0, f32::MAX);
        let mut angles = weightless();
        let turned = Quat::from_scaled_axis(Vec3::new(0.4, 0.9, -0.6));
        let body = angles.insert(bar().rotation(turned));
        angles.insert_joint(Joint::to_world(body, Vec3::ZERO, Vec3::ZERO).generic([Axis::LOCKED; 3], [spring; 3]));
        let mut ends = weightless();
        let bars = [0.0, 1.0].map(|z| ends.insert(bar().position(0.0, 0.0, z)));
        ends.insert_joint(Joint::new(bars[0], Vec3::X * 0.5, bars[1], Vec3::X * -0.5).elastic(1.0, frequency, 0.0));
        for (name, world) in [("angles", angles), ("ends", ends)] {
            let mut simulation = simulation(world, || Box::new(drystone::Cpu::new()));
            let (mut early, mut late) = (0.0_f64, 0.0_f64);
            for step in 0..3600 {
                simulation.step(DT).expect("a step");
                let most = if step < 900 { &mut early } else { &mut late };
                *most = most.max(simulation.world.kinetic_energy());
            }
            assert!(late < 1.02 * early, "{name} at {frequency} Hz: at most {early} J in 4 s, {late} J later");
        }
    }
}
