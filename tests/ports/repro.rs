//! Small programs in which an earlier version was wrong, as far as no other test has them.

use std::f32::consts::TAU;

use drystone::glam::Vec3;
use drystone::{Axis, Body, Joint, MassProperties, Shape, World};

use crate::scene::{at, energy, light, run, run_with, started, weightless};

/// The most kinetic energy of a world in some steps, over that of its start.
fn most_energy(world: World, steps: usize) -> f64 {
    let mut simulation = started(world);
    run(&mut simulation, 1);
    let start = energy(&simulation.world);
    let mut most = 0.0_f64;
    run_with(&mut simulation, steps, |simulation, _| most = most.max(energy(&simulation.world) / start));
    most
}

/// Limits of three angles gave up to 74 times the energy of the start. In Rapier it is 1.00 times at all limits.
#[test]
fn limits_of_three_angles_give_no_energy_to_a_limb() {
    for limit in [0.5, 1.0, 1.2, 1.5, 2.0] {
        for k in [0.0, 2.0, 5.0] {
            let mut world = weightless();
            let body = Body::dynamic().shape(Shape::capsule(0.25, 0.18)).can_sleep(false);
            let body = world.insert(body.velocity(Vec3::ZERO, Vec3::new(1.0 + k, 2.0, -1.5 * k)));
            let limb = Body::dynamic().shape(Shape::capsule(0.2, 0.07)).position(0.0, 0.6, 0.0);
            let limb = world.insert(limb.velocity(Vec3::ZERO, Vec3::new(-4.0, 3.0 - k, 5.0)));
            let joint = Joint::new(limb, Vec3::Y * -0.27, body, Vec3::Y * 0.33).along(Vec3::Y);
            world.insert_joint(joint.generic([Axis::LOCKED; 3], [Axis::limited(-limit, limit); 3]));
            let most = most_energy(world, 900);
            assert!(most < 1.005, "{limit} rad, {k}: {most} times the energy of the start");
        }
    }
}

/// The most kinetic energy of plates that three equal springs turn back, over that of the start. There, the springs are
/// at rest.
fn most_energy_of_springs(spring: impl Fn(f32, f32) -> Axis) -> f64 {
    let mut most = 0.0_f64;
    for frequency in [0.5, 1.0, 2.0] {
        for k in [0.0, 2.0, 5.0] {
            let mut world = weightless();
            let plate = Body::dynamic().shape(Shape::cuboid(0.1, 0.5, 0.2)).can_sleep(false);
            let inertia = plate.mass.principal_inertia.max_element();
            let plate = world.insert(plate.velocity(Vec3::ZERO, Vec3::new(2.0 + k, 5.0, 3.0)));
            let springs = [spring(frequency, inertia); 3];
            world.insert_joint(Joint::to_world(plate, Vec3::ZERO, Vec3::ZERO).generic([Axis::LOCKED; 3], springs));
            let start = energy(&world);
            let mut simulation = started(world);
            run_with(&mut simulation, 900, |simulation, _| most = most.max(energy(&simulation.world) / start));
        }
    }
    most
}

/// Undamped springs of three angles gave up to 9.9 times the energy of the start.
#[test]
fn springs_of_three_angles_with_a_stiffness_give_no_energy() {
    let most = most_energy_of_springs(|frequency, inertia| {
        let stiffness = inertia * (TAU * frequency).powi(2);
        Axis::FREE.spring_damper(0.0, stiffness, 0.0, f32::MAX)
    });
    assert!(most < 1.0, "{most} times the energy of the start");
}

/// The same springs, given by their frequency.
#[test]
fn springs_of_three_angles_with_a_frequency_give_no_energy() {
    let most = most_energy_of_springs(|frequency, _| Axis::FREE.spring(0.0, frequency, 0.0, f32::MAX));
    assert!(most < 1.0, "{most} times the energy of the start");
}

/// A wheel inside of its chassis had 922 kJ after 2.5 s. In Rapier a car of four such wheels has 0.6 kJ.
#[test]
fn a_wheel_inside_of_its_chassis_gains_less_than_in_rapier() {
    let mut world = weightless();
    let chassis = world.insert(Body::dynamic().shape(Shape::cuboid(0.65, 0.3, 0.9)).density(100.0).can_sleep(false));
    let side = Vec3::new(0.6874, -0.19, 0.0);
    let inertia = MassProperties { principal_inertia: Vec3::splat(0.29), ..MassProperties::point(9.2, Vec3::ZERO) };
    let axle = world.insert(at(Body::dynamic().mass_properties(inertia), side));
    let wheel = world.insert(at(Body::dynamic().shape(Shape::ball(0.28)).density(100.0), side));
    let strut = Axis::limited(0.0, 0.12).spring(0.0, 3.0, 0.5, 1e5);
    let strut = [Axis::LOCKED, strut, Axis::LOCKED];
    world.insert_joint(Joint::new(axle, Vec3::ZERO, chassis, side).generic(strut, [Axis::LOCKED; 3]));
    world.insert_joint(Joint::new(wheel, Vec3::ZERO, axle, Vec3::ZERO).hinge(Vec3::X));
    let mut simulation = started(world);
    run_with(&mut simulation, 600, |simulation, step| {
        let energy = simulation.world.kinetic_energy();
        assert!(energy < 600.0, "step {step}: {energy} J");
    });
}

/// Two welded boxes that collide with each other, 0.2 m deep, had 773 kJ. In Rapier they have 37 J.
#[test]
fn welded_boxes_inside_of_each_other_gain_less_than_in_rapier() {
    let mut world = weightless();
    let cube = || light().density(1000.0).shape(Shape::cuboid(0.5, 0.5, 0.5)).can_sleep(false);
    let a = world.insert(cube());
    let b = world.insert(cube().position(0.8, 0.0, 0.0));
    world.insert_joint(Joint::new(b, Vec3::X * -0.8, a, Vec3::ZERO).fixed().colliding());
    let mut simulation = started(world);
    run_with(&mut simulation, 600, |simulation, step| {
        let energy = simulation.world.kinetic_energy();
        assert!(energy < 37.0, "step {step}: {energy} J");
    });
}
