//! Threads share the memory of a step. Miri also runs these tests, with portable lanes, and reports races.

use super::super::calibrate::pile;
use super::{Cpu, Reference};
use crate::backend::Backend;
use crate::config::SolverConfig;
use crate::plan::StepPlan;
use crate::problem::{JointRow, StepProblem};

/// Bodies of a pile in relative motion, with two colors of its contacts, and as many joints as the last color has
/// contacts. Each color has enough constraints for two threads.
fn moving_pile() -> StepProblem {
    let mut problem = pile(if cfg!(miri) { 4 } else { 7 });
    let starts = problem.colors.clone();
    let [first, last] = [0, problem.contact_colors().len() - 2].map(|color| starts[color]..starts[color + 1]);
    for (i, body) in (0_u16..).zip(&mut problem.bodies) {
        body.v = [f32::from(i % 3), f32::from(i % 5), f32::from(i % 7)].map(|v| 0.1 * v - 0.2);
    }
    problem.joints = problem.contacts[last.start as usize..last.end as usize]
        .iter()
        .map(|c| JointRow { body_a: c.body_a, body_b: c.body_b, ..JointRow::default() })
        .collect();
    problem.params.joint_count = problem.joints.len() as u32;
    problem.joint_impulses = vec![Default::default(); problem.joints.len()];
    problem.order = first.clone().chain(last).chain(0..problem.params.joint_count).collect();
    let all = problem.order.len() as u32;
    problem.colors = vec![0, first.end, all - problem.params.joint_count, all];
    problem.in_one_block(2, problem.blocks[0].substep);
    problem
}

#[test]
fn two_threads_have_the_bits_of_the_reference() {
    let config = SolverConfig::default().with(|c| {
        (c.substeps, c.iterations, c.relax) = (1, 1, 0);
    });
    let (begin, mut expected, mut found) = (moving_pile(), moving_pile(), moving_pile());
    let plan = StepPlan::new(&config, &begin);
    Reference::<f32>::new().run(&mut expected, &plan.passes).expect("it runs");
    assert!(begin.bodies.iter().zip(&expected.bodies).all(|(a, b)| a != b), "a body stands still");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    pool.install(|| Cpu::new().run(&mut found, &plan.passes)).expect("it runs");
    assert_eq!(found.bodies, expected.bodies);
    assert_eq!(found.impulses, expected.impulses);
    assert_eq!(found.joint_impulses, expected.joint_impulses);
    assert!(found.joint_impulses.iter().all(|impulse| *impulse != Default::default()), "a joint without an impulse");
}
