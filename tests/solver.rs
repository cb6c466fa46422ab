//! The solver: it finds known solutions, in a known number of sweeps, and visits every contact.

mod common;

use common::contacts::{bearing, sweeps_to, tower};
use drystone::math::Scalar;
use drystone::residuals::{Measure, Residuals};
use drystone::solver::{Method, Order, Sequence, Solver};

#[test]
fn a_tower_takes_as_many_sweeps_as_an_independent_program_took() {
    // Sweeps to 1e-1 and 1e-2 of a program in another language, contact by contact; another order takes others.
    let problem = tower(&[1.0; 10]);
    for (method, expected) in [(Method::Plain, [79, 189]), (Method::Accelerated, [20, 48])] {
        let sweeps = |order| sweeps_to::<f64>(&problem, (method, order), &[1e-1, 1e-2], 1000);
        assert_eq!(sweeps(Order::Contacts), expected.map(Some), "{method:?}");
        assert_ne!(sweeps(Order::Manifolds), expected.map(Some), "{method:?}: the order is not looked at");
        let rounded = sweeps_to::<f32>(&problem, (method, Order::Contacts), &[1e-1, 1e-2], 1000);
        for (sweeps, expected) in rounded.into_iter().zip(expected) {
            let sweeps = f64::from(sweeps.expect("reached"));
            assert!((sweeps / f64::from(expected) - 1.0).abs() <= 0.1, "{method:?} in f32: {sweeps}, not {expected}");
        }
    }
}

/// After `sweeps` of a tower of three of different masses: what is left, and the fastest body [m/s].
fn solved<S: Scalar>(method: Method, order: Order, sweeps: u32) -> (Residuals, f64) {
    let problem = tower(&[2.0, 1.0, 3.0]);
    let mut solver = Solver::<S>::new(&problem, method, order);
    (0..sweeps).for_each(|_| solver.advance());
    let fastest = solver.velocities().iter().fold(0.0, |most: f64, v| most.max(v.linear.length()));
    (Measure::new(&problem).of(&solver.impulses(), &solver.velocities()), fastest)
}

#[test]
fn a_tower_stands_whatever_the_method_order_and_precision() {
    for method in [Method::Plain, Method::Accelerated] {
        for order in [Order::Contacts, Order::Manifolds] {
            let (exact, fastest) = solved::<f64>(method, order, 4000);
            assert!(exact.e_vel < 1e-9 && fastest < 1e-9, "{method:?}, {order:?}: {fastest} m/s, {exact:?}");
            assert!(exact.eom < 1e-12, "velocities and impulses part: {exact:?}");
            let (rounded, fastest) = solved::<f32>(method, order, 4000);
            assert!(rounded.e_vel < 1e-4 && fastest < 1e-4, "{method:?}, {order:?}: {fastest} m/s, {rounded:?}");
            let (early, _) = solved::<f64>(method, order, 4);
            assert!(early.e_vel > 1e-2, "{method:?}, {order:?}: solved before it was, {early:?}");
        }
    }
}

#[test]
fn a_solution_stays_one() {
    // A single box is found in a few sweeps and kept to the last bits by all that follow.
    let problem = tower(&[1.0]);
    let mut solver = Solver::<f64>::new(&problem, Method::Accelerated, Order::Manifolds);
    (0..500).for_each(|_| solver.advance());
    let bears: f64 = solver.impulses().iter().map(|r| r.x).sum();
    let weight: f64 = bearing(&[1.0]).iter().map(|r| r.x).sum();
    assert!((bears / weight - 1.0).abs() < 1e-12, "{bears} N s under {weight} N s");
}

#[test]
fn a_velocity_that_is_no_number_is_never_solved() {
    for (velocity, expected) in [(f64::NAN, None), (0.1, Some(1))] {
        let mut problem = tower(&[1.0; 2]);
        problem.bodies[1].free.linear.y = velocity;
        for order in [Order::Contacts, Order::Manifolds] {
            let sweeps = sweeps_to::<f64>(&problem, (Method::Accelerated, order), &[1e300], 10);
            assert_eq!(sweeps, [expected], "{velocity} m/s, {order:?}");
        }
    }
}

#[test]
fn every_contact_is_visited_once_a_sweep() {
    let problem = tower(&[1.0; 7]);
    for (order, colors) in [(Order::Contacts, 8), (Order::Manifolds, 3)] {
        let sequence = Sequence::new(order, &problem);
        let mut contacts = sequence.contacts.clone();
        contacts.sort_unstable();
        assert_eq!(contacts, Vec::from_iter(0..28), "{order:?}");
        assert_eq!(sequence.colors, colors, "{order:?}");
    }
}

#[test]
fn contacts_of_a_manifold_follow_each_other_and_those_with_the_ground_are_last() {
    let sequence = Sequence::new(Order::Manifolds, &tower(&[1.0; 3]));
    assert_eq!(sequence.contacts, [4, 5, 6, 7, 8, 9, 10, 11, 0, 1, 2, 3]);
    let sequence = Sequence::new(Order::Contacts, &tower(&[1.0; 3]));
    assert_eq!(sequence.contacts, [0, 8, 1, 9, 2, 10, 3, 11, 4, 5, 6, 7]);
}
