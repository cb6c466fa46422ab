//! Joints that break at a force: the impulse of the whole step over its length, against closed forms.

use crate::common::state::reference;
use std::f32::consts::FRAC_PI_2;

use crate::common::{Open, gpu};
use drystone::config::JointSolver;
use drystone::glam::{Quat, Vec3};
use drystone::stages::plan::Kernel;
use drystone::{
    Axis, Backend, Body, BodyHandle, Cpu, Event, Joint, JointHandle, Shape, Simulation, SolverConfig, World,
};

tests! {
    exact_gpu {
        a_weight_breaks_a_joint_of_any_kind_that_bears_less,
        a_blow_breaks_a_joint_that_bears_less_in_any_number_of_substeps,
        a_run_that_goes_through_bytes_breaks_the_same_joints,
        a_joint_of_bodies_that_sleep_bears_nothing_and_breaks_once_it_may_bear_less,
    }
    no_gpu {
        a_body_gets_the_summed_impulse_of_its_joint_in_every_step,
        joints_that_can_break_have_a_pass_and_change_no_bit_of_the_motion,
    }
}

const DT: f32 = 1.0 / 60.0;
const SUBSTEPS: [u32; 4] = [1, 2, 4, 8];
const EXACT: [Open; 4] = [reference, cpu, cpu_in_parts, exact];

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

fn cpu_in_parts() -> Box<dyn Backend> {
    Box::new(Cpu::new().dividing_above(0))
}

fn exact() -> Box<dyn Backend> {
    Box::new(gpu::exact())
}

fn of_substeps(substeps: u32) -> SolverConfig {
    SolverConfig::default().without_sleep().with(|c| (c.substeps, c.max_substeps) = (substeps, substeps))
}

fn simulation(world: &World, config: &SolverConfig, open: Open) -> Simulation {
    Simulation::with(world.clone(), config.clone(), open()).expect("a good world")
}

/// The joints that break in one step, and what they bore (N).
fn broken(simulation: &mut Simulation) -> Vec<(JointHandle, f32)> {
    simulation.step(DT).expect("a step");
    let broke = simulation.events().iter().map(|event| match *event {
        Event::Broke { joint, force } => (joint, force),
        other => panic!("{other:?}"),
    });
    broke.collect()
}

/// Number of kinds of joints.
const KINDS: usize = 11;

/// Joints of every kind that hold a cube up whose top is under `top`.
fn hangers(cube: BodyHandle, top: Vec3) -> [Joint; KINDS] {
    let at = |above: f32| Joint::to_world(cube, 0.5 * Vec3::Y, top + above * Vec3::Y);
    let upright = [Axis::FREE, Axis::LOCKED, Axis::FREE];
    [
        at(0.0),
        at(0.0).fixed(),
        at(0.0).hinge(Vec3::Z),
        at(0.0).slider(Vec3::X),
        at(0.0).slider(Vec3::Y).limited(0.0, 1.0),
        at(0.0).slider(Vec3::Y).motor(0.0, 1000.0),
        at(0.0).generic(upright, [Axis::FREE; 3]),
        at(0.0).generic(upright, [Axis::LOCKED; 3]),
        at(1.0).rope(1.0),
        at(1.0).rod(1.0),
        at(1.0).elastic(1.0, 2.0, 1.0),
    ]
}

/// Two cubes of 2 kg hang on joints of each kind. One joint of a kind breaks a thousandth below the weight, the other one a thousandth above.
fn a_weight_breaks_a_joint_of_any_kind_that_bears_less() {
    let weight = 2.0 * 9.81;
    for substeps in SUBSTEPS {
        let mut told = Vec::new();
        for open in EXACT {
            let mut world = World::new();
            let mut joints = Vec::new();
            for kind in 0..KINDS {
                let pair = [0.0, 3.0].map(|z| {
                    let top = Vec3::new(3.0 * kind as f32, 0.0, z);
                    let shape = Shape::cuboid(0.5, 0.5, 0.5);
                    let cube = world.insert(Body::dynamic().shape(shape).total_mass(2.0).position(top.x, -0.5, z));
                    world.insert_joint(hangers(cube, top)[kind])
                });
                joints.push(pair);
            }
            let mut simulation = simulation(&world, &of_substeps(substeps), open);
            for step in 0..240 {
                assert_eq!(broken(&mut simulation), [], "{substeps} substeps, step {step}");
            }
            for [strong, weak] in &joints {
                simulation.world.joint_mut(*strong).expect("a joint").break_force = 1.001 * weight;
                simulation.world.joint_mut(*weak).expect("a joint").break_force = 0.999 * weight;
            }
            let broke = broken(&mut simulation);
            let weak: Vec<_> = joints.iter().map(|pair| pair[1]).collect();
            assert_eq!(broke.iter().map(|broke| broke.0).collect::<Vec<_>>(), weak, "{substeps} substeps");
            for (kind, (_, force)) in broke.iter().enumerate() {
                assert!((force / weight - 1.0).abs() < 5e-4, "{substeps} substeps, joint {kind}: {force} N");
            }
            for step in 0..30 {
                assert_eq!(broken(&mut simulation), [], "{substeps} substeps, step {step} after");
            }
            told.push(broke);
        }
        assert!(told.iter().all(|other| *other == told[0]), "{told:?}");
    }
}

/// Balls of 1 kg fly at 10 m/s at plates of 1,000 kg, each held by a joint, and stop: the impulse is 10 N s. The joints break at 0.905 to 1.095
/// of 600 N. Ball `k` begins `gap(k)` before its plate.
fn shots(gap: impl Fn(usize) -> f32) -> World {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    for k in 0..20 {
        let at = Vec3::new(0.0, 0.0, 3.0 * k as f32);
        let plate = Body::dynamic().shape(Shape::cuboid(0.05, 0.5, 0.5)).total_mass(1000.0).position(0.0, 0.0, at.z);
        let plate = world.insert(plate.restitution(0.0));
        let ball = Body::dynamic().shape(Shape::ball(0.1)).total_mass(1.0).position(-0.15 - gap(k), 0.0, at.z);
        world.insert(ball.restitution(0.0).velocity(10.0 * Vec3::X, Vec3::ZERO));
        let joint = Joint::to_world(plate, Vec3::ZERO, at);
        let joint =
            [joint, joint.fixed(), joint.slider(Vec3::Y), Joint::to_world(plate, Vec3::ZERO, at + Vec3::X).rod(1.0)]
                [k % 4];
        world.insert_joint(joint.breaking_at((0.905 + 0.01 * k as f32) * 600.0));
    }
    world
}

fn momentum(world: &World, bodies: [usize; 2]) -> f32 {
    bodies.map(|body| world.bodies[body].mass.mass * world.bodies[body].linear_velocity.x).iter().sum()
}

fn a_blow_breaks_a_joint_that_bears_less_in_any_number_of_substeps() {
    // A ball that flies 8 cm arrives in the fourth of eight substeps.
    for (substeps, gap) in SUBSTEPS.map(|substeps| (substeps, 1e-4)).into_iter().chain([(8, 0.08)]) {
        for solver in [JointSolver::Sweeps, JointSolver::Direct] {
            let mut told = Vec::new();
            for open in EXACT {
                let world = shots(|_| gap);
                let handles = world.joints.handles().to_vec();
                let mut simulation = simulation(&world, &of_substeps(substeps).with(|c| c.joint_solver = solver), open);
                let broke = broken(&mut simulation);
                let weak: Vec<_> = broke.iter().map(|broke| broke.0).collect();
                assert_eq!(weak, handles[..10], "{substeps} substeps, {solver:?}, {gap} m: {broke:?}");
                for (k, (_, force)) in broke.iter().enumerate() {
                    let lost = 10.0 - momentum(&simulation.world, [2 * k, 2 * k + 1]);
                    assert!((force * DT - lost).abs() < 1e-4, "{substeps} substeps, joint {k}: {force} N, {lost} N s");
                }
                for step in 0..30 {
                    assert_eq!(broken(&mut simulation), [], "{substeps} substeps, step {step} after");
                }
                told.push(broke);
            }
            assert!(told.iter().all(|other| *other == told[0]), "{told:?}");
        }
    }
}

/// A pendulum of 2 kg falls from the side: m (v' - v) = m g h less what the world gets.
fn a_body_gets_the_summed_impulse_of_its_joint_in_every_step() {
    for substeps in [1, 2, 4, 8, 32] {
        let mut world = World::new();
        let cube =
            world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(2.0).position(1.0, 0.0, 0.0));
        world.insert_joint(Joint::to_world(cube, -Vec3::X, Vec3::ZERO).breaking_at(1e9));
        let mut simulation = simulation(&world, &of_substeps(substeps), reference);
        let mut most = 0.0_f32;
        for step in 0..120 {
            let before = simulation.world.bodies[cube].linear_velocity;
            let taken = simulation.step(DT).expect("a step").energy_taken;
            assert!(simulation.events().is_empty());
            // Where long substeps make energy, the law of energy scales the velocity.
            let unbraked = (1.0 + taken / simulation.world.kinetic_energy()).sqrt() as f32;
            let change = 2.0 * (simulation.world.bodies[cube].linear_velocity * unbraked - before);
            let total = Vec3::from(simulation.problem().joint_totals[0].linear);
            let apart = (change - 2.0 * simulation.world.gravity * DT + total).length();
            assert!(apart < 2e-5, "{substeps} substeps, step {step}: {total} N s, apart by {apart}");
            assert!(substeps < 4 || taken == 0.0, "{substeps} substeps, step {step}: {taken} J taken");
            most = most.max(total.length());
        }
        assert!(most > 2.0 * 9.81 * DT * 2.0, "{substeps} substeps: at most {most} N s");
    }
}

/// Balls arrive in different steps; a run that is saved before each step goes on as the whole run.
fn a_run_that_goes_through_bytes_breaks_the_same_joints() {
    let world = shots(|k| 0.05 * k as f32);
    let counts = EXACT.map(|open| {
        let mut whole = simulation(&world, &SolverConfig::default(), open);
        let mut count = 0;
        for step in 0..12 {
            let mut loaded = Simulation::load(&whole.save(), open()).expect("the bytes of a run");
            let broke = broken(&mut whole);
            assert_eq!(broken(&mut loaded), broke, "step {step}");
            assert_eq!(loaded.hash(), whole.hash(), "step {step}");
            count += broke.len();
        }
        count
    });
    assert!(counts[0] >= 5 && counts == [counts[0]; 4], "{counts:?}");
}

fn a_joint_of_bodies_that_sleep_bears_nothing_and_breaks_once_it_may_bear_less() {
    for open in EXACT {
        let mut world = World::new();
        let cube = |x: f32| Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(2.0).position(x, -0.5, 0.0);
        let hung = world.insert(cube(0.0));
        let joint = world.insert_joint(Joint::to_world(hung, 0.5 * Vec3::Y, Vec3::ZERO).breaking_at(25.0));
        // Another one falls, so that steps go on.
        world.insert(cube(100.0).rotation(Quat::from_rotation_z(FRAC_PI_2)));
        let mut simulation = simulation(&world, &SolverConfig::default().with(|c| c.sleep_after = 0.5), open);
        for _ in 0..60 {
            assert_eq!(broken(&mut simulation), []);
        }
        assert!(simulation.is_asleep(hung));
        assert_eq!(simulation.problem().joint_totals[0].linear, [0.0; 3]);
        simulation.world.joint_mut(joint).expect("the joint").break_force = 15.0;
        let broke = broken(&mut simulation);
        assert!(broke.len() == 1 && (broke[0].1 / 19.62 - 1.0).abs() < 1e-3, "{broke:?}");
    }
}

fn joints_that_can_break_have_a_pass_and_change_no_bit_of_the_motion() {
    for open in [reference, cpu] {
        let worlds = [f32::MAX, f32::INFINITY].map(|force| {
            let mut world = shots(|k| 0.05 * k as f32);
            for joint in world.joints.handles().to_vec() {
                world.joint_mut(joint).expect("a joint").break_force = force;
            }
            world
        });
        let [mut can, mut cannot] = worlds.map(|world| simulation(&world, &of_substeps(4), open));
        for _ in 0..30 {
            assert_eq!([broken(&mut can), broken(&mut cannot)], [[], []]);
            assert_eq!(can.hash(), cannot.hash());
        }
        assert!(cannot.problem().joint_totals.is_empty() && !can.problem().joint_totals.is_empty());
        let is_sum = |kernel: Kernel| matches!(kernel, Kernel::SumJointImpulses { .. });
        let (sums, others): (Vec<_>, Vec<_>) = can.plan().passes.iter().cloned().partition(|pass| is_sum(pass.kernel));
        assert_eq!((sums.len(), &others), (4, &cannot.plan().passes));
        let firsts = sums.iter().map(|pass| pass.kernel == Kernel::SumJointImpulses { first: true });
        assert!(firsts.eq([true, false, false, false]), "{sums:?}");
    }
}
