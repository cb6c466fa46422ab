//! The solver: it finds known solutions, in a known number of sweeps, and visits every contact.

use crate::common::contacts::{bearing, curve, sweeps_to, tower};
use crate::common::{Open, gpu};
use drystone::config::Method;
use drystone::{Backend, Cpu, Reference};
use drystone_problems::ContactProblem;
use drystone_problems::residuals::{Measure, Residuals};
use drystone_problems::solver::{Order, Sequence, Solver, solution};
use glam::DVec3;

tests! {
    exact_gpu {
        the_gpu_has_the_bits_of_the_reference_in_exact_mode,
    }
    every_backend {
        belts_and_gaps_are_what_the_offsets_say_in_single_precision,
    }
    no_gpu {
        a_tower_takes_as_many_sweeps_as_an_independent_program_took,
        a_tower_stands_whatever_the_method_order_and_precision,
        a_solution_stays_one,
        a_velocity_that_is_no_number_is_never_solved,
        every_contact_is_visited_once_a_sweep,
        contacts_of_a_manifold_follow_each_other_and_those_with_the_ground_are_last,
        a_manifold_has_one_frame_one_friction_and_at_most_four_points,
        belts_and_gaps_are_what_the_offsets_say,
        a_left_handed_frame_is_taken_and_one_that_is_none_is_refused,
        sweeps_in_one_run_are_those_one_by_one,
        accelerated_sweeps_are_never_more_and_far_fewer,
        the_lanes_have_the_bits_of_the_reference,
    }
}

fn reference() -> Option<Box<dyn Backend>> {
    Some(Box::new(Reference::<f32>::new()))
}

const METHODS: [Method; 2] = [Method::Plain, Method::Accelerated];
const ORDERS: [Order; 2] = [Order::Contacts, Order::Manifolds];

fn a_tower_takes_as_many_sweeps_as_an_independent_program_took() {
    // Sweeps to 1e-1 and 1e-2 of a program in another language, contact by contact; another order takes others.
    let problem = tower(&[1.0; 10]);
    for (method, expected) in [(Method::Plain, [79, 189]), (Method::Accelerated, [20, 47])] {
        let sweeps = |order| sweeps_to(&problem, (method, order), None, &[1e-1, 1e-2], 1000);
        assert_eq!(sweeps(Order::Contacts), expected.map(Some), "{method:?}");
        assert_ne!(sweeps(Order::Manifolds), expected.map(Some), "{method:?}: the order is not looked at");
        let rounded = sweeps_to(&problem, (method, Order::Contacts), reference(), &[1e-1, 1e-2], 1000);
        for (sweeps, expected) in rounded.into_iter().zip(expected) {
            let sweeps = f64::from(sweeps.expect("reached"));
            assert!((sweeps / f64::from(expected) - 1.0).abs() <= 0.1, "{method:?} in f32: {sweeps}, not {expected}");
        }
    }
}

/// After `sweeps` of a tower of three of different masses: what is left, and the fastest body [m/s].
fn solved(methods: (Method, Order), backend: Option<Box<dyn Backend>>, sweeps: u32) -> (Residuals, f64) {
    let problem = tower(&[2.0, 1.0, 3.0]);
    let mut solver = Solver::new(&problem, methods.0, methods.1, backend).expect("good frames");
    solver.advance(sweeps).expect("it runs");
    let fastest = solver.velocities().iter().fold(0.0, |most: f64, v| most.max(v.linear.length()));
    (Measure::new(&problem).of(&solver.impulses(), &solver.velocities()), fastest)
}

fn a_tower_stands_whatever_the_method_order_and_precision() {
    for methods in METHODS.into_iter().flat_map(|method| ORDERS.map(|order| (method, order))) {
        let (exact, fastest) = solved(methods, None, 4000);
        assert!(exact.e_vel < 1e-9 && fastest < 1e-9, "{methods:?}: {fastest} m/s, {exact:?}");
        assert!(exact.eom < 1e-12, "velocities and impulses part: {exact:?}");
        let (rounded, fastest) = solved(methods, reference(), 4000);
        assert!(rounded.e_vel < 1e-5 && fastest < 1e-5, "{methods:?}: {fastest} m/s, {rounded:?}");
        let (early, _) = solved(methods, None, 4);
        assert!(early.e_vel > 1e-2, "{methods:?}: solved before it was, {early:?}");
    }
}

fn a_solution_stays_one() {
    // A single box is found in a few sweeps and kept to the last bits by all that follow.
    let problem = tower(&[1.0]);
    let mut solver = Solver::new(&problem, Method::Accelerated, Order::Manifolds, None).expect("good frames");
    solver.advance(500).expect("it runs");
    let bears: f64 = solver.impulses().iter().map(|r| r.x).sum();
    let weight: f64 = bearing(&[1.0]).iter().map(|r| r.x).sum();
    assert!((bears / weight - 1.0).abs() < 1e-12, "{bears} N s under {weight} N s");
}

fn a_velocity_that_is_no_number_is_never_solved() {
    for (velocity, expected) in [(f64::NAN, None), (0.1, Some(1))] {
        let mut problem = tower(&[1.0; 2]);
        problem.bodies[1].free.linear.y = velocity;
        for order in [Order::Contacts, Order::Manifolds] {
            for backend in [None, reference()] {
                let sweeps = sweeps_to(&problem, (Method::Accelerated, order), backend, &[1e300], 10);
                assert_eq!(sweeps, [expected], "{velocity} m/s, {order:?}");
            }
        }
    }
}

fn every_contact_is_visited_once_a_sweep() {
    let problem = tower(&[1.0; 7]);
    for (order, colors) in [(Order::Contacts, 8), (Order::Manifolds, 3)] {
        let sequence = Sequence::new(order, &problem);
        let mut contacts = sequence.manifolds.concat();
        contacts.sort_unstable();
        assert_eq!(contacts, Vec::from_iter(0..28), "{order:?}");
        assert_eq!(sequence.offsets.len() - 1, colors, "{order:?}");
    }
}

fn contacts_of_a_manifold_follow_each_other_and_those_with_the_ground_are_last() {
    let sequence = Sequence::new(Order::Manifolds, &tower(&[1.0; 3]));
    assert_eq!(sequence.manifolds, [[4, 5, 6, 7], [8, 9, 10, 11], [0, 1, 2, 3]]);
    let sequence = Sequence::new(Order::Contacts, &tower(&[1.0; 3]));
    assert_eq!(sequence.manifolds.concat(), [0, 8, 1, 9, 2, 10, 3, 11, 4, 5, 6, 7]);
}

/// A tower whose faces touch at five points, one of them with another normal, and one with another friction.
fn uneven() -> ContactProblem {
    let mut problem = tower(&[1.0; 2]);
    let mut middle = problem.contacts[4];
    (middle.r_a, middle.r_b) = (DVec3::Z * 0.5, DVec3::Z * -0.5);
    problem.contacts.push(middle);
    let mut rough = problem.contacts[0];
    rough.friction = 0.9;
    let turned = glam::DQuat::from_rotation_x(1e-3);
    let mut tilted = problem.contacts[1];
    tilted.frame = tilted.frame.map(|d| turned * d);
    problem.contacts.extend([rough, tilted]);
    problem
}

fn a_manifold_has_one_frame_one_friction_and_at_most_four_points() {
    let sequence = Sequence::new(Order::Manifolds, &uneven());
    assert_eq!(sequence.manifolds, [&[4, 5, 6, 7][..], &[8], &[0, 1, 2, 3], &[9], &[10]]);
    let solved = |order| solution(&uneven(), 1e-11, 20_000).map(|s| (s.residuals.e_vel, order));
    assert!(solved(Order::Manifolds).expect("good frames").0 < 1e-11);
}

/// A box on a belt that runs at 0.3 m/s, and one that may fall 0.05 m/s further; the impulses are the same in both orders.
fn assert_belts_and_gaps(open: impl Fn() -> Option<Box<dyn Backend>>) {
    let mut problem = tower(&[1.0]);
    problem.contacts.iter_mut().for_each(|c| c.offset = DVec3::new(0.05, 0.03, -0.04));
    for order in ORDERS {
        let mut solver = Solver::new(&problem, Method::Plain, order, open()).expect("good frames");
        solver.advance(300).expect("it runs");
        let v = solver.velocities()[0].linear;
        assert!(v.distance(DVec3::new(-0.03, 0.04, -0.05)) < 1e-6, "{order:?} on {}: {v}", solver.adapter());
    }
}

fn belts_and_gaps_are_what_the_offsets_say() {
    assert_belts_and_gaps(|| None);
    // Pushed apart where an offset is negative.
    let mut problem = tower(&[1.0]);
    problem.contacts.iter_mut().for_each(|c| c.offset = DVec3::NEG_X * 0.05);
    let v = solution(&problem, 1e-12, 1000).expect("good frames").velocities[0].linear;
    assert!(v.distance(DVec3::Z * 0.05) < 1e-9, "{v}");
}

fn belts_and_gaps_are_what_the_offsets_say_in_single_precision(open: Open) {
    assert_belts_and_gaps(|| Some(open()));
}

fn a_left_handed_frame_is_taken_and_one_that_is_none_is_refused() {
    let mut problem = tower(&[1.0; 2]);
    problem.bodies[1].free.linear += DVec3::new(1.0, 2.0, 0.0);
    let right = solution(&problem, 1e-12, 5000).expect("good frames");
    problem.contacts.iter_mut().for_each(|c| c.frame[2] = -c.frame[2]);
    let left = solution(&problem, 1e-12, 5000).expect("good frames");
    assert!(left.residuals.e_vel <= 1e-12, "{:?}", left.residuals);
    assert!(left.velocities[1].linear.distance(right.velocities[1].linear) < 1e-12);
    problem.contacts[5].frame[2] = DVec3::new(0.1, 1.0, 0.0);
    let refused = solution(&problem, 1e-12, 10).expect_err("refused").to_string();
    assert!(refused.starts_with("contact 5: second tangent"), "{refused}");
}

/// Fails unless a backend leaves after every sweep what the reference leaves, to the last bit.
fn assert_bits(open: Open) {
    let mut problem = tower(&[1.0, 3.0, 2.0, 1.0, 50.0]);
    problem.bodies[2].free.linear += DVec3::new(0.3, 0.1, 0.0);
    for methods in METHODS.into_iter().flat_map(|method| ORDERS.map(|order| (method, order))) {
        let expected = curve(&problem, methods, reference(), 150);
        assert_eq!(expected, curve(&problem, methods, Some(open()), 150), "{methods:?}");
    }
}

fn the_lanes_have_the_bits_of_the_reference() {
    assert_bits(|| Box::new(Cpu::new()));
}

fn the_gpu_has_the_bits_of_the_reference_in_exact_mode() {
    assert_bits(|| Box::new(gpu::exact()));
}

fn sweeps_in_one_run_are_those_one_by_one() {
    let problem = tower(&[1.0, 2.0, 1.0]);
    for methods in METHODS.map(|method| (method, Order::Manifolds)) {
        for backend in [|| None, reference] {
            let mut solver = Solver::new(&problem, methods.0, methods.1, backend()).expect("good frames");
            solver.advance(100).expect("it runs");
            let together = Measure::new(&problem).of(&solver.impulses(), &solver.velocities()).e_vel;
            assert_eq!(Some(&together), curve(&problem, methods, backend(), 100).last(), "{methods:?}");
        }
    }
}

fn accelerated_sweeps_are_never_more_and_far_fewer() {
    // Predicted: about the square root of the sweeps, with both precisions.
    for problem in [tower(&[1.0; 10]), tower(&[1.0, 10.0]), tower(&[1.0; 3]), tower(&[3.0, 1.0, 2.0, 5.0])] {
        for backend in [|| None, reference] {
            let [plain, accelerated] = METHODS
                .map(|method| sweeps_to(&problem, (method, Order::Manifolds), backend(), &[1e-1, 1e-2, 1e-3], 10_000));
            measured!("{}: {plain:?} and {accelerated:?}", problem.name);
            for (plain, accelerated) in plain.iter().zip(&accelerated) {
                assert!(accelerated.expect("reached") <= plain.expect("reached"), "{}", problem.name);
            }
        }
    }
}
