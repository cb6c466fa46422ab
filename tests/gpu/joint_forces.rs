//! Forces and torques of joints against closed forms.

use drystone::glam::Vec3;
use drystone::{Body, Joint, JointHandle, Listen, Shape, Simulation, SolverConfig, World};

use crate::common::Open;
use crate::common::state::{all_bits, reference};

tests! {
    every_backend {
        a_motor_gives_the_mean_torque_that_its_wheel_gained,
        a_weld_bears_the_weight_and_the_moment_of_its_beam,
        every_link_of_a_chain_pulls_with_what_hangs_on_it,
    }
    no_gpu {
        a_joint_without_a_step_has_no_force,
        forces_change_no_bit_and_sleep_with_their_bodies,
    }
}

const DT: f32 = 1.0 / 60.0;
const G: f32 = 9.81;

fn simulation(world: World, config: SolverConfig, open: Open) -> Simulation {
    Simulation::with(world, config, open()).expect("a good world")
}

fn awake() -> SolverConfig {
    SolverConfig::default().without_sleep()
}

fn summing() -> Listen {
    Listen { impulses: true, ..Listen::default() }
}

/// Links of 1 kg that hang from the world and from each other.
fn chain(links: usize) -> (World, Vec<JointHandle>) {
    let mut world = World::new();
    let (mut above, mut joints) = (None, Vec::new());
    for i in 0..links {
        let link = Body::dynamic().shape(Shape::cuboid(0.05, 0.25, 0.05)).total_mass(1.0);
        let link = world.insert(link.position(0.0, -0.25 - 0.5 * i as f32, 0.0));
        let top = Vec3::new(0.0, 0.25, 0.0);
        let joint = above.map_or(Joint::to_world(link, top, Vec3::ZERO), |a| Joint::new(a, -top, link, top));
        joints.push(world.insert_joint(joint));
        above = Some(link);
    }
    (world, joints)
}

fn every_link_of_a_chain_pulls_with_what_hangs_on_it(open: Open) {
    for listens in [false, true] {
        let (world, joints) = chain(6);
        let mut simulation = simulation(world, awake(), open);
        if listens {
            simulation.listen(summing()).expect("in range");
        }
        (0..120).for_each(|_| drop(simulation.step(DT).expect("a step")));
        for (i, &joint) in joints.iter().enumerate() {
            // A joint to the world has its body as a: the force on the world points down.
            let pull = (joints.len() - i) as f32 * G * if i == 0 { -1.0 } else { 1.0 };
            let force = simulation.joint_force(joint).expect("a step ran");
            assert!((force - pull * Vec3::Y).length() < 0.01 * pull.abs(), "joint {i}: {force} N, not {pull}");
            assert_eq!(simulation.joint_torque(joint), Some(Vec3::ZERO));
        }
        // The joint that is gone has no force, and those behind it keep theirs.
        simulation.world.remove_joint(joints[1]);
        assert_eq!(simulation.joint_force(joints[1]), None);
        let force = simulation.joint_force(joints[2]).expect("still there");
        assert!((force.y - 4.0 * G).abs() < 0.04 * G, "{force} N");
    }
}

fn a_weld_bears_the_weight_and_the_moment_of_its_beam(open: Open) {
    let mut world = World::new();
    let wall = world.insert(Body::fixed());
    let beam = Body::dynamic().shape(Shape::cuboid(0.5, 0.05, 0.05)).total_mass(3.0);
    let beam = world.insert(beam.position(0.5, 0.0, 0.0));
    let weld = world.insert_joint(Joint::new(wall, Vec3::ZERO, beam, -0.5 * Vec3::X).fixed());
    let mut simulation = simulation(world, awake(), open);
    (0..120).for_each(|_| drop(simulation.step(DT).expect("a step")));
    let [force, torque] =
        [simulation.joint_force(weld), simulation.joint_torque(weld)].map(|load| load.expect("a step ran"));
    assert!((force - 3.0 * G * Vec3::Y).length() < 0.01 * G, "{force} N");
    assert!((torque - 1.5 * G * Vec3::Z).length() < 0.01 * G, "{torque} N m");
}

/// A wheel of 2 kg m² reaches the speed of its motor within a step: the mean torque is the gain of angular momentum
/// over the step, and not the torque of any substep.
fn a_motor_gives_the_mean_torque_that_its_wheel_gained(open: Open) {
    let (speed, most) = (1.0, 200.0);
    let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    let wheel = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.1)).total_mass(12.0));
    let motor = Joint::to_world(wheel, Vec3::ZERO, Vec3::ZERO).hinge(Vec3::Z).motor(speed, most);
    let motor = world.insert_joint(motor);
    let mut simulation = simulation(world, awake(), open);
    simulation.step(DT).expect("a step");
    let spin = simulation.world.bodies[wheel].angular_velocity.z;
    let torque = simulation.joint_torque(motor).expect("a step ran");
    // 200 N m turn the wheel by 1 rad/s in 10 ms of 16.7.
    let mean = 2.0 * spin / DT;
    assert!((spin - speed).abs() < 1e-3 && mean < 0.7 * most, "{spin} rad/s, {mean} N m");
    // The torque on the world.
    assert!((torque + mean * Vec3::Z).length() < 1e-3 * mean, "{torque} N m, not {mean}");
}

fn a_joint_without_a_step_has_no_force() {
    let (world, joints) = chain(1);
    let stranger = World::new().insert_joint(world.joints[0]);
    let mut simulation = simulation(world, awake(), reference);
    assert_eq!((simulation.joint_force(joints[0]), simulation.joint_force(stranger)), (None, None));
    simulation.step(DT).expect("a step");
    assert!(simulation.joint_force(joints[0]).is_some());
    assert_eq!((simulation.joint_force(stranger), simulation.joint_torque(stranger)), (None, None));
    let mut simulation = Simulation::load(&simulation.save(), reference()).expect("its own bytes");
    let joint = simulation.world.joints.handles()[0];
    assert_eq!(simulation.joint_force(joint), None);
    simulation.step(DT).expect("a step");
    assert!(simulation.joint_force(joint).is_some());
}

fn forces_change_no_bit_and_sleep_with_their_bodies() {
    let (world, joints) = chain(3);
    let mut each = [false, true].map(|listens| {
        let mut simulation = simulation(world.clone(), SolverConfig::default(), reference);
        simulation.listen(if listens { summing() } else { Listen::default() }).expect("in range");
        simulation
    });
    for _ in 0..120 {
        each.iter_mut().for_each(|simulation| drop(simulation.step(DT).expect("a step")));
        assert_eq!(all_bits(&each[0].world), all_bits(&each[1].world));
    }
    // Something else moves while the chain sleeps.
    for simulation in &mut each {
        simulation.world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(5.0, 0.0, 0.0));
        simulation.step(DT).expect("a step");
        assert!(simulation.is_asleep(simulation.world.bodies.handle(0).expect("a link")));
        let force = simulation.joint_force(joints[0]).expect("a step ran");
        assert!((force + 3.0 * G * Vec3::Y).length() < 0.01 * G, "{force} N");
    }
}
