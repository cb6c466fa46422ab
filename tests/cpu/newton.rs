//! Newton's method on contact problems: it solves what sweeps take thousands of passes for, in tens of steps, and says what ended it.

use crate::common::contacts::{FRICTION, tower};
use drystone::config::Method;
use drystone::{Cpu, Simulation, SolverConfig};
use drystone_problems::contacts::{ContactProblem, LocalProblem, Operator};
use drystone_problems::residuals::Residuals;
use drystone_problems::solver::newton::{Blocks, Bodies, Ended, NewtonEnded, Outcome, Sweeps, System, newton};
use drystone_scenes::Scene;
use glam::{DMat3, DVec3};

/// The error that every problem is solved to.
const TOLERANCE: f64 = 1e-8;

/// Newton's method alone: no sweep before it or after it.
fn alone(problem: &ContactProblem) -> Outcome {
    newton(&mut Bodies::new(problem), TOLERANCE, 0)
}

/// u = W r + q of a problem of bodies, column by column.
fn without_bodies(problem: &ContactProblem) -> LocalProblem {
    let operator = Operator::new(problem);
    let count = problem.contacts.len();
    let free: Vec<_> = problem.bodies.iter().map(|b| b.free).collect();
    let q: Vec<_> = (0..count).map(|i| operator.relative_velocity(i, &free)).collect();
    let mut rows = vec![Vec::new(); count];
    for j in 0..count {
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let mut impulses = vec![DVec3::ZERO; count];
            impulses[j] = axis;
            let velocities = operator.velocities(&impulses);
            (0..count).map(|i| operator.relative_velocity(i, &velocities) - q[i]).collect::<Vec<_>>()
        });
        for (i, row) in rows.iter_mut().enumerate() {
            let block = DMat3::from_cols(columns[0][i], columns[1][i], columns[2][i]);
            if block.abs_diff_eq(DMat3::ZERO, 0.0) {
                continue;
            }
            row.push((j as u32, block));
        }
    }
    LocalProblem { name: "W".into(), friction: problem.contacts.iter().map(|c| c.friction).collect(), free: q, rows }
}

/// Piles, walls and what falls onto the ground: some contacts slide, some stick, some open.
fn steps() -> Vec<ContactProblem> {
    let scenes = [("pile", &["n=40"][..], 60), ("wall", &["rows=4", "columns=4"], 40), ("drop", &[], 70)];
    let problem = |(name, parameters, steps): (&str, &[&str], u32)| {
        let parameters: Vec<String> = parameters.iter().map(|p| (*p).into()).collect();
        let scene = Scene::find(name, &parameters).expect("a scene of the catalogue");
        let config = SolverConfig::default().without_sleep();
        let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new())).expect("it is sound");
        (0..steps).for_each(|_| drop(simulation.step(1.0 / 60.0).expect("a step")));
        drystone_problems::step_with_contacts(&mut simulation, name, 1.0 / 60.0).expect("no joints").0
    };
    scenes.map(problem).into()
}

#[test]
fn towers_of_every_ratio_take_tens_of_steps() {
    let alternating: Vec<f64> = (0..20).map(|i| if i % 2 == 0 { 1.0 } else { 1000.0 }).collect();
    let topped = [&[1.0; 10][..], &[1000.0]].concat();
    for masses in [&[1.0, 1000.0][..], &[1.0; 10], &[1.0; 40], &topped, &alternating, &[1.0, 1e6]] {
        let problem = tower(masses);
        let outcome = alone(&problem);
        let residuals = Residuals::of(&problem, &outcome.impulses);
        println!("{}: {} steps, {residuals:?}", problem.name, outcome.steps);
        assert_eq!((outcome.ended, outcome.newton, outcome.sweeps), (Ended::Newton, NewtonEnded::Reached, 0));
        assert!((5..=25).contains(&outcome.steps), "{}: {} steps", problem.name, outcome.steps);
        assert!(residuals.e_vel <= TOLERANCE && residuals.cone <= 1e-12, "{}: {residuals:?}", problem.name);
        // Each face bears what is above, whatever its four contacts share.
        for (face, pushed) in outcome.impulses.chunks(4).enumerate() {
            let borne: f64 = pushed.iter().map(|r| r.x).sum();
            let weight =
                masses[face..].iter().sum::<f64>() * crate::common::contacts::GRAVITY * crate::common::contacts::STEP;
            assert!((borne / weight - 1.0).abs() < 1e-5, "{}, face {face}: {borne} N s, not {weight}", problem.name);
        }
    }
}

#[test]
fn a_light_box_takes_off_beside_a_heavy_one() {
    for (friction, rise) in [(0.02, 0.1), (0.02, 0.3), (0.1, 0.1), (0.1, 0.3), (0.1, 1.0), (0.5, 0.1)] {
        let (mut problem, mut heavy) = (tower(&[1.0]), tower(&[1000.0]));
        heavy.contacts.iter_mut().for_each(|c| c.b = Some(1));
        problem.bodies.append(&mut heavy.bodies);
        problem.contacts.append(&mut heavy.contacts);
        problem.contacts.iter_mut().for_each(|c| c.friction = friction);
        problem.bodies[0].free.linear.z += rise;
        problem.bodies[1].free.linear.x += 0.1;
        let outcome = alone(&problem);
        let said = format!("friction {friction}, {rise} m/s: {:?} after {} steps", outcome.newton, outcome.steps);
        assert!(outcome.newton == NewtonEnded::Reached && outcome.steps <= 15, "{said}");
        assert!(Residuals::of(&problem, &outcome.impulses).e_vel <= TOLERANCE, "{said}");
    }
}

/// 16 contacts under one box: 48 rows of a body with six freedoms, so W is singular.
#[test]
fn more_contacts_than_freedoms_are_no_obstacle() {
    let mut problem = tower(&[2.0, 1.0]);
    let ground = problem.contacts[0];
    for i in 0..12 {
        let r_b = DVec3::new(0.5 - 0.09 * f64::from(i), 0.04 * f64::from(i) - 0.2, -0.5);
        problem.contacts.push(drystone_problems::contacts::PointContact { r_b, ..ground });
    }
    problem.bodies[0].free.linear.x += 0.3;
    problem.bodies[1].free.angular.z += 0.2;
    assert!(alone(&problem).e_vel <= 1e-7, "Newton's method alone");
    let outcome = newton(&mut Bodies::new(&problem), TOLERANCE, 20_000);
    let residuals = Residuals::of(&problem, &outcome.impulses);
    assert!(residuals.e_vel <= 1.01 * TOLERANCE && outcome.steps <= 60, "{} steps, {residuals:?}", outcome.steps);
}

#[test]
fn steps_of_scenes_are_solved_with_any_friction() {
    for mut problem in steps() {
        for friction in [None, Some(0.0), Some(0.05), Some(1.0)] {
            problem.contacts.iter_mut().for_each(|c| c.friction = friction.unwrap_or(c.friction));
            let outcome = newton(&mut Bodies::new(&problem), TOLERANCE, 20_000);
            let residuals = Residuals::of(&problem, &outcome.impulses);
            println!("{}, {friction:?}: {} steps, {} sweeps", problem.name, outcome.steps, outcome.sweeps);
            // With next to no friction many contacts of the pile all but slide, and the last digits are lost.
            let asked = if friction == Some(0.05) { 1e-6 } else { 1.01 * TOLERANCE };
            assert!(residuals.e_vel <= asked, "{}, {friction:?}: {residuals:?}", problem.name);
            assert!((outcome.e_vel - residuals.e_vel).abs() <= 0.01 * asked, "it says {}", outcome.e_vel);
            let alone = alone(&problem);
            assert!(alone.steps <= 110 && alone.e_vel < 1e-4, "{}, {friction:?}: {}", problem.name, alone.e_vel);
        }
    }
}

#[test]
fn impulses_that_are_one_percent_off_are_no_solution() {
    let problem = tower(&[1.0, 1000.0]);
    let solved = alone(&problem).impulses;
    for i in 0..solved.len() {
        let mut wrong = solved.clone();
        wrong[i] *= 1.01;
        assert!(Residuals::of(&problem, &wrong).e_vel > 1e3 * TOLERANCE, "contact {i}");
    }
    let mut slippery = problem.clone();
    slippery.bodies[1].free.linear.x += 10.0;
    let impulses = newton(&mut Bodies::new(&slippery), TOLERANCE, 20_000).impulses;
    assert!(Residuals::of(&slippery, &impulses).e_vel <= 1.01 * TOLERANCE);
    slippery.contacts.iter_mut().for_each(|c| c.friction = 1.01 * FRICTION);
    let error = Residuals::of(&slippery, &impulses).e_vel;
    assert!(error > 1e3 * TOLERANCE, "another friction is seen: {error:e}");
}

#[test]
fn a_problem_without_bodies_is_the_same_problem() {
    let mut problem = tower(&[1.0, 5.0, 0.2, 3.0]);
    problem.bodies[2].free.angular = DVec3::new(0.3, 0.1, -0.4);
    problem.contacts[5].offset = DVec3::new(0.1, 0.05, 0.0);
    let local = without_bodies(&problem);
    let (mut bodies, mut blocks) = (Bodies::new(&problem), Blocks::new(&local));
    assert_eq!(bodies.sequence(), blocks.sequence(), "both are swept color by color");
    // The same sweeps, to rounding.
    let zero = vec![DVec3::ZERO; problem.contacts.len()];
    for method in [Method::Plain, Method::Accelerated] {
        let [mut one, mut other] =
            [Sweeps::new(&bodies, method, zero.clone()), Sweeps::new(&blocks, method, zero.clone())];
        for _ in 0..30 {
            one.advance(&bodies);
            other.advance(&blocks);
        }
        let apart = one.impulses().iter().zip(other.impulses()).map(|(r, s)| r.distance(*s)).fold(0.0, f64::max);
        let largest = one.impulses().iter().map(|r| r.length()).fold(0.0, f64::max);
        assert!(apart < 1e-12 * largest, "{method:?}: {apart} N s");
        let [r, s] = [Residuals::of(&problem, one.impulses()), Residuals::of_blocks(&local, one.impulses())];
        assert!((r.e_vel / s.e_vel - 1.0).abs() < 1e-9 && (r.vmax / s.vmax - 1.0).abs() < 1e-9, "{r:?}, {s:?}");
    }
    for system in [&mut bodies as &mut dyn Solved, &mut blocks] {
        let outcome = system.solved();
        let e_vel = Residuals::of_blocks(&local, &outcome.impulses).e_vel;
        assert!(e_vel <= TOLERANCE && outcome.steps <= 30, "{} steps, {e_vel:e}", outcome.steps);
    }
}

/// Newton's method alone on either form.
trait Solved {
    fn solved(&mut self) -> Outcome;
}

impl<S: System> Solved for S {
    fn solved(&mut self) -> Outcome {
        newton(self, TOLERANCE, 0)
    }
}

#[test]
fn a_slightly_unsymmetric_w_is_solved() {
    // The wall. Signs that differ by entry leave most piles without a solution to 1e-8.
    let mut local = without_bodies(&steps()[1]);
    let mut sign = 1.0;
    for (i, row) in (0..).zip(&mut local.rows) {
        for (_, w) in row.iter_mut().filter(|(j, _)| *j != i) {
            *w *= 1.0 + 1e-3 * sign;
            sign = -sign;
        }
    }
    let outcome = newton(&mut Blocks::new(&local), TOLERANCE, 20_000);
    let e_vel = Residuals::of_blocks(&local, &outcome.impulses).e_vel;
    assert!(e_vel <= 1.01 * TOLERANCE, "{e_vel:e}: {:?} {:?}", outcome.ended, outcome.newton);
    let symmetric = without_bodies(&steps()[1]);
    assert!(Residuals::of_blocks(&symmetric, &outcome.impulses).e_vel > TOLERANCE, "it is another problem");
}

#[test]
fn what_ended_a_solve_is_said() {
    let problem = tower(&[1.0; 4]);
    let solve = |tolerance, most| newton(&mut Bodies::new(&problem), tolerance, most);
    let early = solve(1e-1, 1000);
    assert_eq!((early.ended, early.newton, early.steps), (Ended::FirstSweeps, NewtonEnded::NotBegun, 0));
    assert!(early.sweeps > 0 && early.e_vel <= 1e-1);
    assert_eq!(solve(TOLERANCE, 0).ended, Ended::Newton);
    let never = solve(0.0, 200);
    assert!(never.ended == Ended::Limit && never.sweeps >= 200 && never.e_vel > 0.0, "{never:?}");
    assert!(matches!(never.newton, NewtonEnded::Stalled | NewtonEnded::Blocked) && never.e_vel < 1e-9, "{never:?}");
    // Nothing to solve.
    let nothing = ContactProblem { contacts: Vec::new(), ..problem.clone() };
    assert_eq!(newton(&mut Bodies::new(&nothing), TOLERANCE, 10).e_vel, 0.0);
    // Numbers that overflow are no solution.
    let mut fast = problem.clone();
    fast.bodies[0].free.linear = DVec3::NEG_Z * 1e300;
    let outcome = newton(&mut Bodies::new(&fast), TOLERANCE, 100);
    assert!(outcome.ended == Ended::Limit && (outcome.e_vel.is_nan() || outcome.e_vel > TOLERANCE), "{outcome:?}");
}

#[test]
fn the_same_problem_has_the_same_bits() {
    for problem in steps() {
        let solve = || newton(&mut Bodies::new(&problem), TOLERANCE, 1000);
        assert_eq!(solve().impulses, solve().impulses, "{}", problem.name);
    }
}
