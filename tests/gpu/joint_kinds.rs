//! Joints of all kinds against closed forms.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use drystone::config::JointSolver;
use drystone::glam::{Quat, Vec3};
use drystone::stages::problem::StepProblem;
use drystone::{Axis, Body, Joint, Linear, Reference, Shape, Simulation, SolverConfig, World};

use crate::common::Open;
use crate::common::state::{joint_angular_impulses, reference};

const G: f32 = 9.81;
const DT: f32 = 1.0 / 240.0;

tests! {
    no_gpu {
        impulses_of_axes_follow_their_joint_and_its_substeps,
        a_saved_drum_has_counted_its_turns,
        a_hinge_with_limits_at_half_a_turn_stops_there,
    }
    every_backend {
        a_damped_spring_loses_the_share_that_its_ratio_says,
        a_generic_joint_moves_as_the_kind_that_it_describes,
        a_joint_whose_axes_are_all_free_holds_nothing,
        a_limited_hinge_stops_at_its_limits,
        a_drum_stops_after_the_turns_of_its_limits,
        a_motor_reaches_its_speed,
        a_rope_is_slack_and_then_holds,
        a_bead_on_a_turning_rod_flies_out_as_a_hyperbolic_cosine,
        a_slider_slides_as_on_an_incline_and_stops_at_its_limit,
        bodies_on_a_sliding_joint_keep_their_momentum,
    }
    every_backend_the_gpu_at_night {
        a_drive_pushes_no_axis_beyond_its_limit,
        a_fixed_cantilever_keeps_its_angle,
        a_hinge_about_any_axis_of_a_joint_turns_on_with_its_load,
        a_hinge_swings_with_the_period_of_a_physical_pendulum,
        a_free_angle_turns_on_while_the_others_keep_their_limits,
        an_arm_keeps_the_limit_of_its_height_all_around,
        limits_above_a_quarter_turn_are_those_of_a_swing,
        a_joint_with_two_free_angles_keeps_the_third_through_half_a_turn,
        a_limit_stands_where_it_is_however_far_the_other_one_is,
        a_motor_is_no_stronger_than_its_largest_torque,
        a_rod_keeps_its_length,
        a_spring_past_pi_pulls_back_the_shorter_way,
        a_spring_swings_with_its_frequency,
        a_turning_spring_bears_a_load_at_the_angle_that_its_stiffness_says,
    }
}

fn simulate(world: World, open: Open) -> Simulation {
    Simulation::with(world, SolverConfig::default().without_sleep(), open()).unwrap()
}

fn steps(simulation: &mut Simulation, seconds: f32, mut each: impl FnMut(f32, &World)) {
    for step in 1..=(seconds / DT).round() as u32 {
        simulation.step(DT).unwrap();
        each(step as f32 * DT, &simulation.world);
    }
}

fn angle(world: &World) -> f32 {
    world.joint_motion(&world.joints[0]).position[3]
}

fn place(world: &World) -> f32 {
    world.joint_motion(&world.joints[0]).position[0]
}

/// The mean time between two passages of zero in the same direction (s).
fn period(samples: &[(f32, f32)]) -> f32 {
    let up = samples.windows(2).filter(|pair| pair[0].1 < 0.0 && pair[1].1 >= 0.0);
    let times: Vec<f32> = up.map(|p| p[0].0 + DT * p[0].1 / (p[0].1 - p[1].1)).collect();
    assert!(times.len() > 2, "{} passages", times.len());
    (times[times.len() - 1] - times[0]) / (times.len() - 1) as f32
}

/// A rod of 1 m and 2 kg that hangs from a hinge about Z, turned by an angle. The hinge is `aside` of the rod: its locks bear a moment.
fn hung_rod(turned: f32, aside: f32) -> (World, Joint) {
    let mut world = World::new();
    let turn = Quat::from_rotation_z(turned);
    let anchor = Vec3::new(0.0, 0.5, aside);
    let center = turn * -anchor;
    let rod = Body::dynamic().shape(Shape::cuboid(0.02, 0.5, 0.02)).total_mass(2.0).rotation(turn);
    let rod = world.insert(rod.position(center.x, center.y, center.z));
    (world, Joint::to_world(rod, anchor, Vec3::ZERO).hinge(Vec3::Z))
}

fn a_hinge_swings_with_the_period_of_a_physical_pendulum(open: Open) {
    for amplitude in [0.05, 1.0] {
        let (mut world, hinge) = hung_rod(amplitude, 0.3);
        world.insert_joint(hinge);
        let mut simulation = simulate(world, open);
        let mut samples = Vec::new();
        let mut tilt: f32 = 0.0;
        steps(&mut simulation, 8.0, |t, world| {
            samples.push((t, angle(world)));
            tilt = tilt.max((world.bodies[0].rotation * Vec3::Z).distance(Vec3::Z));
        });
        let inertia = (1.0 + 0.04_f32.powi(2)) / 12.0 + 0.25;
        let large = 1.0 + amplitude.powi(2) / 16.0 + 11.0 * amplitude.powi(4) / 3072.0;
        let exact = TAU * (inertia / (0.5 * G)).sqrt() * large;
        let measured = period(&samples);
        assert!((measured / exact - 1.0).abs() < 2e-3, "{amplitude}: {measured} s, exact {exact} s");
        // The weight of 2 kg at 0.3 m pulls the axis of the hinge down.
        assert!(tilt < 2e-3, "{tilt}");
        assert!(simulation.world.joint_gap() < 1e-3);
    }
}

/// A chain of rods whirls about Z under a weight along Z, so that the locks of its hinges bear moments. The free axis may
/// be the second or third of a joint, whose quaternion changes its sign in every turn.
fn a_hinge_about_any_axis_of_a_joint_turns_on_with_its_load(open: Open) {
    const COUNT: usize = 4;
    let around = |free: usize| {
        let mut world = World { gravity: Vec3::NEG_Z * G, ..World::new() };
        let frame = Quat::from_rotation_arc(Vec3::AXES[free], Vec3::Z);
        let mut angular = [Axis::LOCKED; 3];
        angular[free] = Axis::FREE;
        let mut before = None;
        for i in 0..COUNT {
            let center = Vec3::X * (0.5 + i as f32);
            let rod = Body::dynamic().shape(Shape::cuboid(0.5, 0.05, 0.05)).position(center.x, 0.0, 0.0);
            let rod = world.insert(rod.velocity((Vec3::Z * 6.0).cross(center), Vec3::Z * 6.0));
            let joint = match before.replace(rod) {
                None => Joint::to_world(rod, Vec3::X * -0.5, Vec3::ZERO),
                Some(before) => Joint::new(rod, Vec3::X * -0.5, before, Vec3::X * 0.5),
            };
            world.insert_joint(Joint { frame_a: frame, frame_b: frame, ..joint.generic([Axis::LOCKED; 3], angular) });
        }
        let config = SolverConfig::default().without_sleep().with(|c| c.joint_solver = JointSolver::Sweeps);
        let mut simulation = Simulation::with(world, config, open()).unwrap();
        let mut tilt: f32 = 0.0;
        steps(&mut simulation, 3.0, |_, world| {
            tilt = tilt.max((world.bodies[COUNT - 1].rotation * Vec3::Z).distance(Vec3::Z));
        });
        assert!(tilt < 0.01, "{free}: {tilt}");
        simulation.world.bodies[0].position
    };
    let first = around(0);
    for free in [1, 2] {
        let other = around(free);
        assert!(other.distance(first) < 0.01, "{free}: at {other}, about the first axis at {first}");
    }
}

/// A body on a joint that locks one angle turns by up to a third of a radian a step.
fn a_joint_with_two_free_angles_keeps_the_third_through_half_a_turn(open: Open) {
    for locked in 0..3 {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let body = Body::dynamic().shape(Shape::cuboid(0.3, 0.2, 0.1)).position(0.3, 0.2, 0.1);
        let spin = Vec3::new(12.0, 16.0, 8.0);
        let body = world.insert(body.velocity(spin.cross(Vec3::new(0.3, 0.2, 0.1)), spin));
        let mut angular = [Axis::FREE; 3];
        angular[locked] = Axis::LOCKED;
        let joint = Joint::to_world(body, Vec3::new(-0.3, -0.2, -0.1), Vec3::ZERO);
        world.insert_joint(joint.generic([Axis::LOCKED; 3], angular));
        let mut simulation = simulate(world, open);
        simulation.step(4.0 * DT).unwrap();
        let begin = simulation.world.kinetic_energy();
        let (mut off, mut swing, mut most) = (0.0_f32, 0.0_f32, 0.0_f64);
        for _ in 0..480 {
            simulation.step(4.0 * DT).unwrap();
            let world = &simulation.world;
            let q = world.bodies[0].rotation;
            let first = q * Vec3::X;
            let angle = [2.0 * q.x, first.z, first.y][locked];
            (off, swing) = (off.max(angle.abs()), swing.max(first.angle_between(Vec3::X)));
            most = most.max(world.kinetic_energy() / begin);
        }
        assert!(off < 2e-3 && most < 1.01, "{locked}: {off} rad, {most} of the energy");
        assert!(swing > 3.0, "{locked}: {swing}");
    }
}

/// A cube turns about the free axis of its joint. Limits keep this axis close to where it was, or a limit and a lock.
fn a_free_angle_turns_on_while_the_others_keep_their_limits(open: Open) {
    let limit = 0.3;
    let other_axes = [[Axis::limited(-limit, limit); 2], [Axis::LOCKED, Axis::limited(-limit, limit)]];
    for (free, [next, last]) in (0..3).flat_map(|free| other_axes.map(|other| (free, other))) {
        let [along, second] = [0, 2].map(|i| Vec3::AXES[(free + i) % 3]);
        let mut angular = [Axis::FREE; 3];
        (angular[(free + 1) % 3], angular[(free + 2) % 3]) = (next, last);
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let cube =
            Body::dynamic().shape(Shape::cuboid(0.2, 0.2, 0.2)).velocity(Vec3::ZERO, along * 10.0 + second * 4.0);
        let cube = world.insert(cube);
        world.insert_joint(Joint::to_world(cube, Vec3::ZERO, Vec3::ZERO).generic([Axis::LOCKED; 3], angular));
        let mut simulation = simulate(world, open);
        let begin = simulation.world.kinetic_energy();
        let (mut off, mut tilt, mut most) = (0.0_f32, 0.0_f32, 0.0_f64);
        steps(&mut simulation, 3.0, |_, world| {
            let now = world.bodies[0].rotation * along;
            // The swing of the free axis along the axis of a lock.
            off = off.max(if next == Axis::LOCKED { now.dot(second).abs() } else { 0.0 });
            tilt = tilt.max(now.angle_between(along));
            most = most.max(world.kinetic_energy() / begin);
        });
        let spin = simulation.world.bodies[0].angular_velocity.dot(along);
        assert!((limit - 0.01..2.0_f32.sqrt() * limit + 0.01).contains(&tilt), "{free}, {next:?}: tilt {tilt}");
        assert!(off < 2e-3 && spin > 5.0 && most < 1.001, "{free}, {next:?}: {off} rad, {spin} rad/s, {most}");
    }
}

/// An arm turns about one axis without end, and its limits keep it close to the plane across this axis.
fn an_arm_keeps_the_limit_of_its_height_all_around(open: Open) {
    let limit = 0.3;
    for limited in [1, 2] {
        let mut angular = [Axis::FREE; 3];
        angular[limited] = Axis::limited(-limit, limit);
        let (around, up) = (Vec3::AXES[3 - limited], Vec3::AXES[limited]);
        let spin = around * 6.0 + up * 2.0;
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let arm = Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.1)).position(0.5, 0.0, 0.0);
        let arm = world.insert(arm.velocity(spin.cross(Vec3::X * 0.5), spin));
        let joint = Joint::to_world(arm, Vec3::X * -0.5, Vec3::ZERO);
        world.insert_joint(joint.generic([Axis::LOCKED; 3], angular));
        let mut simulation = simulate(world, open);
        let begin = simulation.world.kinetic_energy();
        let (mut highest, mut turned, mut before, mut most) = (0.0_f32, 0.0_f32, Vec3::X, 0.0_f64);
        steps(&mut simulation, 4.0, |_, world| {
            let now = world.bodies[0].rotation * Vec3::X;
            highest = highest.max(now.dot(around).abs().asin());
            turned += now.angle_between(before);
            (before, most) = (now, most.max(world.kinetic_energy() / begin));
        });
        assert!((limit - 0.01..limit + 0.01).contains(&highest), "{limited}: {highest}");
        assert!(turned > 2.0 * TAU && most < 1.002, "{limited}: {turned} rad, {most} of the energy");
    }
}

/// A height has no such angle, and the joint would push for ever.
fn limits_above_a_quarter_turn_are_those_of_a_swing(open: Open) {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    let cube = Body::dynamic().shape(Shape::cuboid(0.2, 0.2, 0.2)).rotation(Quat::from_rotation_z(2.2));
    let cube = world.insert(cube.velocity(Vec3::ZERO, Vec3::Z));
    let joint = Joint::to_world(cube, Vec3::ZERO, Vec3::ZERO);
    world.insert_joint(joint.generic([Axis::LOCKED; 3], [Axis::FREE, Axis::FREE, Axis::limited(2.0, 2.5)]));
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 2.0, |_, _| {});
    let world = &simulation.world;
    let turned = world.joint_motion(&world.joints[0]).position[5];
    let spin = world.bodies[0].angular_velocity.length();
    assert!((2.0..2.501).contains(&turned) && spin < 1.001, "{turned} rad, {spin} rad/s");
}

fn a_limited_hinge_stops_at_its_limits(open: Open) {
    let (mut world, hinge) = hung_rod(1.2, 0.0);
    world.insert_joint(hinge.limited(-0.4, 1.3));
    let mut simulation = simulate(world, open);
    let (mut least, mut most) = (0.0_f32, 0.0_f32);
    steps(&mut simulation, 1.0, |_, world| (least, most) = (least.min(angle(world)), most.max(angle(world))));
    assert!((-0.405..-0.395).contains(&least), "{least}");
    let rod = &mut simulation.world.bodies[0];
    rod.angular_velocity = Vec3::new(0.0, 0.0, 9.0);
    rod.linear_velocity = rod.angular_velocity.cross(rod.position);
    steps(&mut simulation, 1.0, |_, world| most = most.max(angle(world)));
    assert!((1.295..1.305).contains(&most), "{most}");
    // It does not bounce, and rests at the lower limit if that is above the lowest place.
    simulation.world.joints[0] = simulation.world.joints[0].limited(0.3, 1.3);
    steps(&mut simulation, 4.0, |_, _| {});
    assert!((angle(&simulation.world) - 0.3).abs() < 1e-3, "{}", angle(&simulation.world));
    let torque = joint_angular_impulses(&simulation)[0].z.abs() / (DT / simulation.config().substeps as f32);
    let exact = 2.0 * G * 0.5 * 0.3_f32.sin();
    assert!((torque / exact - 1.0).abs() < 0.02, "{torque} N m, exact {exact}");
}

fn a_motor_reaches_its_speed(open: Open) {
    let (mut world, hinge) = hung_rod(0.0, 0.0);
    world.insert_joint(hinge.motor(3.0, 40.0));
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 0.5, |_, _| {});
    let (mut slowest, mut fastest, begin) = (f32::MAX, 0.0_f32, angle(&simulation.world));
    let mut turned = 0.0;
    let mut before = begin;
    steps(&mut simulation, 3.0, |_, world| {
        let speed = world.bodies[0].angular_velocity.z;
        (slowest, fastest) = (slowest.min(speed), fastest.max(speed));
        turned += (angle(world) - before + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        before = angle(world);
    });
    assert!(slowest > 2.999 && fastest < 3.001, "{slowest} to {fastest} rad/s");
    assert!((turned - 9.0).abs() < 0.01, "{turned} rad");
}

/// Slowly lifted until the weight holds against the torque.
fn a_motor_is_no_stronger_than_its_largest_torque(open: Open) {
    let torque = 5.0;
    let (mut world, hinge) = hung_rod(0.3, 0.0);
    world.insert_joint(hinge.motor(0.05, torque));
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 9.0, |_, _| {});
    let (mut sum, mut count) = (0.0, 0);
    steps(&mut simulation, 6.0, |_, world| (sum, count) = (sum + angle(world), count + 1));
    let (stalled, exact) = (sum / count as f32, (torque / (2.0 * G * 0.5)).asin());
    assert!((stalled - exact).abs() < 5e-3, "{stalled} rad, exact {exact}");
    // Half of what it has lifted is too heavy for half of the torque.
    simulation.world.joints[0] = simulation.world.joints[0].motor(0.05, 0.0);
    steps(&mut simulation, 1.0, |_, _| {});
    assert!(angle(&simulation.world) < 0.3);
}

fn a_slider_slides_as_on_an_incline_and_stops_at_its_limit(open: Open) {
    let slope = 0.5_f32;
    let mut world = World::new();
    let down = Vec3::new(slope.cos(), -slope.sin(), 0.0);
    let cart = world.insert(Body::dynamic().shape(Shape::cuboid(0.3, 0.1, 0.2)));
    // The anchor is aside of the center: locks of angles bear a moment.
    let anchor = Vec3::new(0.0, 0.1, 0.2);
    world.insert_joint(Joint::to_world(cart, anchor, anchor).slider(down).limited(-0.5, 2.0));
    let mut simulation = simulate(world, open);
    let along = 0.5 * G * slope.sin();
    steps(&mut simulation, 0.8, |t, world| {
        let (place, exact) = (place(world), along * t * t);
        // Velocities stand half a substep ahead.
        assert!((place - exact).abs() < 1e-3 + 0.002 * exact, "{t} s: {place} m, exact {exact}");
        let aside = world.bodies[0].position - down * world.bodies[0].position.dot(down);
        assert!(aside.length() < 1e-3, "{aside}");
    });
    let mut most: f32 = 0.0;
    steps(&mut simulation, 1.0, |_, world| most = most.max(place(world)));
    assert!((1.999..2.002).contains(&most), "{most}");
    let speed = simulation.world.bodies[0].linear_velocity.length();
    assert!(speed < 1e-3, "{speed} m/s at the limit");
    assert!(simulation.world.bodies[0].rotation.angle_between(Quat::IDENTITY) < 1e-3);
}

/// A ball of 3 kg on a spring below the origin, 0.1 m above its place at rest.
fn hung_ball(frequency: f32, damping_ratio: f32, open: Open) -> (Simulation, f32) {
    let mut world = World::new();
    let sag = G / (TAU * frequency).powi(2);
    let ball = Body::dynamic().shape(Shape::ball(0.1)).total_mass(3.0);
    let ball = world.insert(ball.position(0.0, -1.0 - sag + 0.1, 0.0));
    world.insert_joint(Joint::to_world(ball, Vec3::ZERO, Vec3::ZERO).elastic(1.0, frequency, damping_ratio));
    (simulate(world, open), 1.0 + sag)
}

fn a_spring_swings_with_its_frequency(open: Open) {
    for frequency in [1.0, 4.0] {
        let (mut simulation, rest) = hung_ball(frequency, 0.0, open);
        let mut samples = Vec::new();
        steps(&mut simulation, 6.0, |t, world| samples.push((t, rest - place(world))));
        let measured = period(&samples);
        assert!((measured * frequency - 1.0).abs() < 1e-3, "{frequency} Hz: {measured} s");
        // Without a damper it keeps its energy.
        let late = samples[samples.len() / 2..].iter().map(|s| s.1).fold(0.0, f32::max);
        assert!((late / 0.1 - 1.0).abs() < 0.02, "{frequency} Hz: {late} m");
    }
}

fn a_damped_spring_loses_the_share_that_its_ratio_says(open: Open) {
    let (frequency, ratio) = (2.0, 0.1_f32);
    let (mut simulation, rest) = hung_ball(frequency, ratio, open);
    let mut samples = Vec::new();
    steps(&mut simulation, 3.0, |t, world| samples.push((t, rest - place(world))));
    let turns = (1.0 - ratio * ratio).sqrt();
    let peak = |from: f32, to: f32| {
        samples.iter().filter(|s| (from..to).contains(&(s.0 * frequency * turns))).map(|s| s.1).fold(0.0, f32::max)
    };
    let (first, third) = (peak(0.5, 1.5), peak(2.5, 3.5));
    let exact = (-2.0 * TAU * ratio / turns).exp();
    assert!((third / first / exact - 1.0).abs() < 0.02, "{} of the swing is left, exact {exact}", third / first);
}

fn a_rope_is_slack_and_then_holds(open: Open) {
    let mut world = World::new();
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(0.3, -0.2, 0.0));
    world.insert_joint(Joint::to_world(ball, Vec3::ZERO, Vec3::ZERO).rope(1.0));
    let mut simulation = simulate(world, open);
    let mut longest: f32 = 0.0;
    steps(&mut simulation, 4.0, |t, world| {
        if t < 0.35 {
            let exact = -0.2 - 0.5 * G * t * t;
            assert!((world.bodies[0].position.y - exact).abs() < 0.01, "{t} s: {}", world.bodies[0].position);
        }
        longest = longest.max(place(world));
    });
    assert!((0.999..1.002).contains(&longest), "{longest}");
}

/// Its period is that of a mathematical pendulum: the rod pulls at the center of the ball.
fn a_rod_keeps_its_length(open: Open) {
    let mut world = World::new();
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(0.3, -0.4, 0.0));
    world.insert_joint(Joint::to_world(ball, Vec3::ZERO, Vec3::ZERO).rod(0.5));
    let mut simulation = simulate(world, open);
    let mut samples = Vec::new();
    steps(&mut simulation, 8.0, |t, world| {
        samples.push((t, world.bodies[0].position.x));
        assert!((place(world) - 0.5).abs() < 1e-3, "{t} s: {} m", place(world));
    });
    let amplitude = 0.6_f32.asin();
    let large = 1.0 + amplitude.powi(2) / 16.0 + 11.0 * amplitude.powi(4) / 3072.0;
    let exact = TAU * (0.5 / G).sqrt() * large;
    let measured = period(&samples);
    assert!((measured / exact - 1.0).abs() < 2e-3, "{measured} s, exact {exact} s");
}

/// Two beams of 1 m, one fixed to the world and the other to its end.
fn a_fixed_cantilever_keeps_its_angle(open: Open) {
    let mut world = World::new();
    let beam = |x: f32| Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.1)).total_mass(10.0).position(x, 0.0, 0.0);
    let (near, far) = (world.insert(beam(0.5)), world.insert(beam(1.5)));
    let end = 0.5 * Vec3::X;
    world.insert_joint(Joint::to_world(near, -end, Vec3::ZERO).fixed());
    world.insert_joint(Joint::new(far, -end, near, end).fixed());
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 3.0, |_, _| {});
    for (body, place) in [(near, 0.5), (far, 1.5)] {
        let body = &simulation.world.bodies[body];
        let turned = body.rotation.angle_between(Quat::IDENTITY);
        assert!(turned < 2e-3, "{turned} rad");
        assert!(body.position.distance(place * Vec3::X) < 3e-3, "{}", body.position);
    }
    // The wall bears the weight of both at 1 m.
    let moment = joint_angular_impulses(&simulation)[0].length() / (DT / simulation.config().substeps as f32);
    assert!((moment / (20.0 * G) - 1.0).abs() < 0.02, "{moment} N m");
}

fn a_turning_spring_bears_a_load_at_the_angle_that_its_stiffness_says(open: Open) {
    let (frequency, inertia) = (3.0, 2.0 * ((1.0 + 0.04_f32.powi(2)) / 12.0 + 0.25));
    let (mut world, hinge) = hung_rod(FRAC_PI_2, 0.0);
    world.insert_joint(hinge.spring(FRAC_PI_2, frequency, 1.0));
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 3.0, |_, _| {});
    // Alone the spring sees the inertia of the rod about its center, and the ball joint adds the rest: see the effective mass of an axis.
    let about_center = 2.0 * (1.0 + 0.04_f32.powi(2)) / 12.0;
    let stiffness = about_center * (TAU * frequency).powi(2);
    let sagged = FRAC_PI_2 - angle(&simulation.world);
    let exact = 2.0 * G * 0.5 * sagged.cos() / stiffness;
    assert!((sagged / exact - 1.0).abs() < 0.03, "{sagged} rad, exact {exact}, {inertia}");
}

fn a_generic_joint_moves_as_the_kind_that_it_describes(open: Open) {
    let mut world = World::new();
    let mut carts = Vec::new();
    for z in 0..2 {
        let at = Vec3::new(0.0, 0.0, 3.0 * z as f32);
        let cart = world.insert(Body::dynamic().shape(Shape::cuboid(0.3, 0.1, 0.2)).position(at.x, at.y, at.z));
        let joint = Joint::to_world(cart, Vec3::ZERO, at);
        let fall = Axis::limited(-1.0, 5.0);
        world.insert_joint(match z {
            0 => joint.slider(Vec3::Y).limited(-1.0, 5.0),
            _ => joint.generic([Axis::LOCKED, fall, Axis::LOCKED], [Axis::LOCKED; 3]),
        });
        carts.push(cart);
    }
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 1.0, |t, world| {
        let [one, other] = [0, 1].map(|i| world.bodies[carts[i]].position.y);
        assert!((one - other).abs() < 1e-5, "{t} s: {one} {other}");
        assert!((one - (-0.5 * G * t * t).max(-1.0)).abs() < 0.02, "{t} s: {one}");
    });
    assert!(matches!(simulation.world.joints[1].linear, Linear::Axes(_)));
}

fn bodies_on_a_sliding_joint_keep_their_momentum(open: Open) {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let a = world.insert(Body::dynamic().shape(Shape::cuboid(0.4, 0.1, 0.1)).position(0.2, 0.5, 0.0));
    let b = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.2, 0.3)));
    world.bodies[a].linear_velocity = Vec3::new(0.6, 0.0, 0.4);
    world.bodies[b].angular_velocity = Vec3::new(0.0, 0.5, 1.0);
    world.insert_joint(Joint::new(a, Vec3::ZERO, b, 0.5 * Vec3::Y).slider(Vec3::X));
    let (linear, angular) = (world.linear_momentum(), world.angular_momentum());
    let mut simulation = simulate(world, open);
    let mut first = None;
    steps(&mut simulation, 2.0, |_, world| {
        // In the first step the joint makes one motion of two.
        let energy = *first.get_or_insert(world.kinetic_energy());
        assert!((world.kinetic_energy() / energy - 1.0).abs() < 0.02, "{} J of {energy}", world.kinetic_energy());
    });
    let world = &simulation.world;
    assert!(place(world) > 0.5, "{}", place(world));
    assert!(world.linear_momentum().distance(linear) < 1e-3 * linear.length(), "{}", world.linear_momentum());
    assert!(world.angular_momentum().distance(angular) < 5e-3 * angular.length(), "{}", world.angular_momentum());
    assert!(world.joint_gap() < 2e-3, "{}", world.joint_gap());
}

/// r'' = w² r on a rod that turns at w, and the axes of the joint turn with the rod: by 0.1 rad in a step.
fn a_bead_on_a_turning_rod_flies_out_as_a_hyperbolic_cosine(open: Open) {
    const SPIN: f32 = 25.0;
    const BEGIN: f32 = 0.5;
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    let bead = Body::dynamic().shape(Shape::ball(0.05)).position(BEGIN, 0.0, 0.0);
    let bead = world.insert(bead.velocity(Vec3::NEG_Z * SPIN * BEGIN, Vec3::Y * SPIN));
    let rod = Body::kinematic().shape(Shape::cuboid(3.0, 0.01, 0.01));
    let rod = world.insert(rod.velocity(Vec3::ZERO, Vec3::Y * SPIN));
    world.insert_joint(Joint::new(bead, Vec3::ZERO, rod, Vec3::ZERO).slider(Vec3::X));
    let mut simulation = simulate(world, open);
    let mut worst = 0.0_f32;
    steps(&mut simulation, 0.075, |time, world| {
        let exact = BEGIN * (SPIN * time).cosh();
        worst = worst.max((place(world) / exact - 1.0).abs());
        println!("{time} s: {} of {exact} m, gap {}", place(world), world.joint_gap());
    });
    assert!(worst < 0.02, "{worst}");
}

/// Two rods that rest on their limits; the joint of the first goes.
fn impulses_of_axes_follow_their_joint_and_its_substeps() {
    let mut world = World::new();
    let mut joints = Vec::new();
    for z in [0.0, 2.0] {
        let rod = Body::dynamic().shape(Shape::cuboid(0.5, 0.02, 0.02)).total_mass(2.0).position(0.5, 0.0, z);
        let rod = world.insert(rod);
        let hinge = Joint::to_world(rod, -0.5 * Vec3::X, z * Vec3::Z).hinge(Vec3::Z);
        joints.push(world.insert_joint(hinge.limited(0.0, 1.0)));
    }
    let mut simulation = simulate(world, || Box::new(Reference::<f32>::new()));
    steps(&mut simulation, 0.5, |_, _| {});
    let held = joint_angular_impulses(&simulation)[1];
    let weight = 2.0 * G * 0.5 * DT / simulation.config().substeps as f32;
    assert!((held.z.abs() / weight - 1.0).abs() < 0.01, "{held} N m s of {weight}");
    simulation.world.remove_joint(joints[0]).expect("a joint");
    let of_limit = |problem: &StepProblem| {
        let axis = problem.axes.iter().position(|axis| axis.left > -1.0).expect("a limit");
        assert_eq!((problem.joints.len(), problem.axes.len()), (1, 3));
        problem.joint_impulses[1 + axis].linear[0].abs()
    };
    let (problem, _) = simulation.next_problem(DT).unwrap();
    // The torque has the direction of the axis, which is rounded.
    assert!((of_limit(&problem) / held.z.abs() - 1.0).abs() < 1e-6, "{held}");
    // Half as long substeps bear the force with half of the impulse.
    let whole = of_limit(&problem);
    let (problem, _) = simulation.next_problem(0.5 * DT).unwrap();
    assert_eq!(of_limit(&problem), 0.5 * whole);
    // With a motor it has another list of axes.
    simulation.world.joints[0] = simulation.world.joints[0].motor(0.0, 1.0);
    let (problem, _) = simulation.next_problem(DT).unwrap();
    assert!(problem.joint_impulses[1..].iter().all(|row| row.linear[0] == 0.0));
}

/// Rods of 40 g on hinges, or boxes of 1 kg on sliders, in a row without gravity: one for each drive.
fn driven(is_hinge: bool, drives: &[&dyn Fn(Joint) -> Joint], open: Open) -> Simulation {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    for (i, drive) in drives.iter().enumerate() {
        let apart = Vec3::Z * (2.0 * i as f32);
        let body = Body::dynamic().shape(Shape::cuboid(0.1, 0.5, 0.1));
        let joint = if is_hinge {
            let rod = world.insert(body.density(1.0).position(0.0, 0.5, apart.z));
            Joint::to_world(rod, Vec3::Y * -0.5, apart).hinge(Vec3::Z)
        } else {
            let sled = world.insert(body.total_mass(1.0).position(0.0, 0.0, apart.z));
            Joint::to_world(sled, Vec3::ZERO, apart).slider(Vec3::X)
        };
        world.insert_joint(drive(joint));
    }
    simulate(world, open)
}

fn a_drive_pushes_no_axis_beyond_its_limit(open: Open) {
    for is_hinge in [true, false] {
        let limited = |joint: Joint| joint.limited(-1.0, 1.0);
        let drives: [&dyn Fn(Joint, f32) -> Joint; 5] = [
            &|joint, sign| limited(joint.motor(sign * 1.5, 1.0)),
            &|joint, sign| limited(joint.motor(sign * 1.5, 100.0)),
            &|joint, sign| limited(joint.motor(sign * 1.5, 1000.0)),
            &|joint, sign| limited(joint.spring(sign * 2.5, 2.0, 1.0)),
            &|joint, sign| limited(joint.spring(sign * 2.5, 20.0, 1.0)),
        ];
        for sign in [1.0, -1.0] {
            let signed = drives.map(|drive| move |joint| drive(joint, sign));
            let each: Vec<&dyn Fn(Joint) -> Joint> = signed.iter().map(|drive| drive as _).collect();
            let mut simulation = driven(is_hinge, &each, open);
            steps(&mut simulation, 2.0, |_, _| {});
            for (i, joint) in simulation.world.joints.iter().enumerate() {
                let at = simulation.world.joint_motion(joint).position[if is_hinge { 3 } else { 0 }];
                let beyond = sign * at - 1.0;
                assert!(beyond.abs() < 1e-3, "drive {i}: {beyond} beyond its limit");
            }
        }
    }
}

/// A body on a generic joint that leaves the angle about the first axis free, as a hinge does.
fn a_spring_past_pi_pulls_back_the_shorter_way(open: Open) {
    let targets = [2.5, 3.0, -2.5];
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    for (i, target) in targets.into_iter().enumerate() {
        let apart = Vec3::X * (2.0 * i as f32);
        let body = Body::dynamic().density(1.0).shape(Shape::cuboid(0.1, 0.5, 0.1));
        let body = world.insert(body.position(apart.x, 0.0, 0.0));
        let angular = [Axis::FREE.spring(target, 5.0, 0.2, f32::MAX), Axis::LOCKED, Axis::LOCKED];
        world.insert_joint(Joint::to_world(body, Vec3::ZERO, apart).generic([Axis::LOCKED; 3], angular));
    }
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 4.0, |_, _| {});
    for (joint, target) in simulation.world.joints.iter().zip(targets) {
        let motion = simulation.world.joint_motion(joint);
        let off = motion.position[3] - target;
        assert!(off.abs() < 1e-3, "target {target}: {off} rad off");
        assert!(motion.speed[3].abs() < 1e-2, "target {target}: {} rad/s", motion.speed[3]);
    }
}

fn a_limit_stands_where_it_is_however_far_the_other_one_is(open: Open) {
    let limits = [1e3, 1e6, 1e9, f32::INFINITY].map(|far| [(-far, 5.0), (-5.0, far)]).concat();
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    for (i, &(min, max)) in limits.iter().enumerate() {
        let apart = Vec3::Z * (2.0 * i as f32);
        let towards = if max == 5.0 { 3.0 } else { -3.0 };
        let ball = Body::dynamic().shape(Shape::ball(0.5)).velocity(Vec3::X * towards, Vec3::ZERO);
        let ball = world.insert(ball.position(0.0, 0.0, apart.z));
        world.insert_joint(Joint::to_world(ball, Vec3::ZERO, apart).slider(Vec3::X).limited(min, max));
    }
    let mut simulation = simulate(world, open);
    steps(&mut simulation, 3.0, |_, _| {});
    for (joint, (min, max)) in simulation.world.joints.iter().zip(limits) {
        let [at, aside, ..] = simulation.world.joint_motion(joint).position;
        let limit = if max == 5.0 { 5.0 } else { -5.0 };
        assert!((at - limit).abs() < 1e-4, "limits {min} and {max}: stops at {at}");
        assert_eq!(aside.abs(), 0.0);
    }
    // Without a limit on either side it goes on.
    let mut simulation = driven(false, &[&|j| j.motor(1.0, 1e3).limited(f32::NEG_INFINITY, f32::INFINITY)], open);
    steps(&mut simulation, 1.0, |_, _| {});
    assert!((place(&simulation.world) - 1.0).abs() < 0.01, "{}", place(&simulation.world));
}

/// A ball on a joint to the world falls, and two balls on one fly into each other without a blow, whether or not another joint has axes.
fn a_joint_whose_axes_are_all_free_holds_nothing(open: Open) {
    for (with_axes, is_distance, collide) in
        [(false, false, false), (true, false, false), (false, true, false), (false, false, true)]
    {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        let ball = |x: f32, v: f32| {
            Body::dynamic().shape(Shape::ball(0.5)).position(x, 0.0, 0.0).velocity(Vec3::X * v, Vec3::ZERO)
        };
        let [a, b] = [(-1.0, 1.0), (1.0, -1.0)].map(|(x, v)| world.insert(ball(x, v)));
        let free = |joint: Joint| match is_distance {
            true => joint.at_distance(Axis::FREE),
            false => joint.generic([Axis::FREE; 3], [Axis::FREE; 3]),
        };
        let pair = free(Joint::new(a, Vec3::ZERO, b, Vec3::ZERO));
        world.insert_joint(if collide { pair.colliding() } else { pair });
        world.insert_joint(free(Joint::to_world(a, Vec3::ZERO, Vec3::ZERO)));
        if with_axes {
            let c = world.insert(ball(9.0, 0.0));
            world.insert_joint(Joint::to_world(c, Vec3::ZERO, Vec3::X * 9.0).hinge(Vec3::Z));
        }
        let mut simulation = simulate(world, open);
        let mut rows = 0;
        steps(&mut simulation, 1.0, |_, _| {});
        rows += simulation.step(DT).unwrap().joints;
        assert_eq!(rows, usize::from(with_axes));
        let [a, b] = [0, 1].map(|i| simulation.world.bodies[i].position.x);
        if collide {
            assert!(a < -0.4 && b > 0.4, "{a} {b}");
        } else {
            assert!((a - DT).abs() < 1e-4 && (b + DT).abs() < 1e-4, "{a} {b}");
        }
    }
}

/// A drum on a hinge that a motor turns at 9 rad/s.
fn drum(limits: [f32; 2], speed: f32) -> World {
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    let drum = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.1, 0.2)).total_mass(3.0));
    world.insert_joint(
        Joint::to_world(drum, Vec3::ZERO, Vec3::ZERO).hinge(Vec3::Y).limited(limits[0], limits[1]).motor(speed, 20.0),
    );
    world
}

/// Runs a drum, and follows its angle through all turns (rad).
fn turned(simulation: &mut Simulation, seconds: f32) -> f32 {
    let (mut all, mut before) = (0.0_f32, angle(&simulation.world));
    steps(simulation, seconds, |_, world| {
        let now = angle(world);
        all += (now - before + PI).rem_euclid(TAU) - PI;
        before = now;
    });
    all
}

fn a_drum_stops_after_the_turns_of_its_limits(open: Open) {
    for (limits, speed, stop) in
        [([-2.0, 20.0], 9.0, 20.0), ([-20.0, 2.0], -9.0, -20.0), ([-4.0, f32::INFINITY], -9.0, -4.0)]
    {
        let mut simulation = simulate(drum(limits, speed), open);
        let end = turned(&mut simulation, 3.0);
        assert!((end - stop).abs() < 1e-3, "{end}, not {stop}");
        // Back to the other end.
        simulation.world.joints[0].angular[0] = Axis::limited(limits[0], limits[1]).motor(-speed, 20.0);
        let back = end + turned(&mut simulation, 3.0);
        if speed > 0.0 || limits[1].is_finite() {
            let other = if speed > 0.0 { limits[0] } else { limits[1] };
            assert!((back - other).abs() < 1e-3, "{back}, not {other}");
        } else {
            assert!(back > 2.0 * TAU, "{back}: stopped without a limit");
        }
    }
}

fn a_hinge_with_limits_at_half_a_turn_stops_there() {
    for (speed, stop) in [(9.0, PI), (-9.0, -PI)] {
        let mut simulation = simulate(drum([-PI, PI], speed), reference);
        let end = turned(&mut simulation, 3.0);
        assert!((end - stop).abs() < 1e-3, "{end}, not {stop}");
    }
}

fn a_saved_drum_has_counted_its_turns() {
    let mut simulation = simulate(drum([-2.0, 20.0], 9.0), reference);
    let begin = turned(&mut simulation, 1.5);
    let mut loaded = Simulation::load(&simulation.save(), reference()).expect("a saved state");
    let [end, of_loaded] = [&mut simulation, &mut loaded].map(|simulation| begin + turned(simulation, 1.5));
    assert!((end - 20.0).abs() < 1e-3 && end == of_loaded, "{end}, {of_loaded}");
}
