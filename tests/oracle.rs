//! The oracle against an interior point solver, which knows nothing of sweeps, colors or momentum.
//!
//! With the slip of a solution known, its velocities are those of one convex program: least change of kinetic energy from the
//! free velocities such that every u + mu |u_t| n lies in the dual of Coulomb's cone. Without friction, and where everything
//! sticks, the slip is zero and one program is the whole truth; otherwise the slip is found by repeating it (De Saxcé and
//! Feng 1998).

mod common;

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};
use common::contacts::tower;
use drystone::contacts::{ContactProblem, Operator, Velocity};
use drystone::residuals::Residuals;
use drystone::solver::{Solution, solution};
use drystone::{Cpu, Scene, Simulation, SolverConfig};
use glam::{DVec2, DVec3};

/// What the interior point method is asked for: more than that it does not reach.
const ASKED: f64 = 1e-10;
/// Largest difference of two velocities, over the largest free velocity. Worst measured: 1.1e-8.
const SAME: f64 = 1e-6;

/// Velocities and impulses of the convex program under the slip speeds `slip`.
fn convex(problem: &ContactProblem, slip: &[f64]) -> (Vec<Velocity>, Vec<DVec3>) {
    let columns = 6 * problem.bodies.len();
    let mut upper = vec![vec![0.0; columns]; columns];
    let mut linear = vec![0.0; columns];
    for (i, body) in problem.bodies.iter().enumerate() {
        let momentum = [body.free.linear * body.mass, body.inertia * body.free.angular];
        for k in 0..3 {
            upper[6 * i + k][6 * i + k] = body.mass;
            (linear[6 * i + k], linear[6 * i + 3 + k]) = (-momentum[0][k], -momentum[1][k]);
            for j in 0..=k {
                upper[6 * i + 3 + j][6 * i + 3 + k] = body.inertia.col(k)[j];
            }
        }
    }
    // Row d of a contact: b gets [d, r x d], a the opposite. A x + slack = b, so -J, with the slip rows times mu.
    let (mut rows, mut right, mut cones) = (Vec::new(), Vec::new(), Vec::new());
    for (contact, &slip) in problem.contacts.iter().zip(slip) {
        let offset = contact.offset + DVec3::X * (contact.friction * slip);
        let directions = if contact.friction > 0.0 { 3 } else { 1 };
        for (k, d) in contact.frame.into_iter().enumerate().take(directions) {
            let scale = if k == 0 { 1.0 } else { contact.friction };
            let mut row = vec![0.0; columns];
            for (body, arm, sign) in [(contact.b, contact.r_b, -scale), (contact.a, contact.r_a, scale)] {
                let Some(at) = body.map(|i| 6 * i as usize) else { continue };
                row[at..at + 3].copy_from_slice(&(d * sign).to_array());
                row[at + 3..at + 6].copy_from_slice(&(arm.cross(d) * sign).to_array());
            }
            rows.push(row);
            right.push(scale * offset[k]);
        }
        cones.push(if directions == 3 { SecondOrderConeT(3) } else { NonnegativeConeT(1) });
    }
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(ASKED)
        .tol_gap_rel(ASKED)
        .tol_feas(ASKED)
        .max_iter(200)
        .build()
        .expect("good settings");
    let (p, a) = (CscMatrix::from(&upper), CscMatrix::from(&rows));
    let mut solver = DefaultSolver::new(&p, &linear, &a, &right, &cones, settings).expect("a convex program");
    solver.solve();
    // Where it ends earlier, it must still be far better than what is compared.
    let (status, info) = (solver.solution.status, &solver.info);
    let reached = info.gap_rel.min(info.gap_abs).max(info.res_primal).max(info.res_dual);
    let near = status == SolverStatus::AlmostSolved && reached < 100.0 * ASKED;
    assert!(status == SolverStatus::Solved || near, "{}: {status:?} with {reached:e}", problem.name);
    let vector = |x: &[f64]| DVec3::new(x[0], x[1], x[2]);
    let velocities =
        solver.solution.x.chunks(6).map(|x| Velocity { linear: vector(&x[..3]), angular: vector(&x[3..]) });
    let mut duals = solver.solution.z.iter();
    let mut next = || *duals.next().expect("a dual a row");
    let impulses = problem.contacts.iter().map(|c| match c.friction > 0.0 {
        true => DVec3::new(next(), c.friction * next(), c.friction * next()),
        false => DVec3::X * next(),
    });
    (velocities.collect(), impulses.collect())
}

/// How fast bodies slip at each contact [m/s].
fn slip(problem: &ContactProblem, velocities: &[Velocity]) -> Vec<f64> {
    let operator = Operator::new(problem);
    let speed = |i| operator.relative_velocity(i, velocities);
    (0..problem.contacts.len()).map(speed).map(|u| DVec2::new(u.y, u.z).length()).collect()
}

/// Largest difference of two velocities of a problem, over the largest free velocity.
fn apart(problem: &ContactProblem, a: &[Velocity], b: &[Velocity]) -> f64 {
    let size = |v: Velocity| v.linear.length().max(v.angular.length());
    let free = problem.bodies.iter().map(|body| size(body.free)).fold(0.0, f64::max);
    let difference =
        |(a, b): (&Velocity, &Velocity)| size(Velocity { linear: a.linear - b.linear, angular: a.angular - b.angular });
    a.iter().zip(b).map(difference).fold(0.0, f64::max) / free
}

fn exact(problem: &ContactProblem) -> Solution {
    let solved = solution(problem, 1e-12, 200_000).expect("good frames");
    assert!(solved.residuals.e_vel <= 1e-12, "{}: {:?}", problem.name, solved.residuals);
    solved
}

/// A pile of six boxes as it lands.
fn pile() -> ContactProblem {
    let scene = Scene::find("pile", &["n=6".into()]).expect("a scene of the catalogue");
    let mut simulation =
        Simulation::new(scene.world, SolverConfig::default(), Box::new(Cpu::new())).expect("it is sound");
    for _ in 0..30 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    simulation.step_with_contacts("pile", 1.0 / 60.0).expect("no joints").0
}

/// Towers of equal and unequal boxes and a pile, with one friction coefficient.
fn problems(friction: f64) -> Vec<ContactProblem> {
    let mut problems = vec![tower(&[1.0; 3]), tower(&[1.0, 5.0, 2.0]), pile()];
    // Pushed and turned, so that something is left to find out.
    problems[1].bodies[1].free.linear += DVec3::new(0.2, -0.1, 0.05);
    problems[1].bodies[2].free.angular += DVec3::new(0.3, 0.2, -0.4);
    problems.iter_mut().flat_map(|p| &mut p.contacts).for_each(|c| c.friction = friction);
    problems
}

#[test]
fn without_friction_it_is_the_convex_program() {
    for problem in problems(0.0) {
        let (velocities, impulses, rounds) = by_interior_point(&problem);
        let difference = apart(&problem, &exact(&problem).velocities, &velocities);
        println!("{}: {difference:.1e} apart, theirs {:.1e}", problem.name, Residuals::of(&problem, &impulses).e_vel);
        assert!(difference < SAME && rounds <= 2, "{}: {difference:e} after {rounds} rounds", problem.name);
    }
}

#[test]
fn where_everything_sticks_it_is_the_convex_program() {
    let problem = &mut tower(&[1.0, 2.0, 0.5]);
    problem.bodies[1].free.linear.x += 0.05;
    problem.contacts.iter_mut().for_each(|c| c.friction = 2.0);
    let (velocities, _) = convex(problem, &[0.0; 12]);
    let ours = exact(problem);
    let operator = Operator::new(problem);
    let slip = |v: &[Velocity]| (0..12).map(|i| operator.relative_velocity(i, v).length()).fold(0.0, f64::max);
    assert!(slip(&ours.velocities) < 1e-10, "it slips at {} m/s", slip(&ours.velocities));
    assert!(apart(problem, &ours.velocities, &velocities) < SAME);
}

#[test]
fn where_it_slips_it_is_the_fixed_point_of_the_convex_programs() {
    for problem in problems(0.2) {
        let (velocities, impulses, rounds) = by_interior_point(&problem);
        let difference = apart(&problem, &exact(&problem).velocities, &velocities);
        let theirs = Residuals::of(&problem, &impulses).e_vel;
        println!("{}: {difference:.1e} apart after {rounds} programs, theirs {theirs:.1e}", problem.name);
        assert!(difference < SAME && theirs < 1e-6, "{}: {difference:e}, {theirs:e}", problem.name);
    }
}

#[test]
fn another_solution_is_told_apart() {
    let problem = &problems(0.2)[1];
    let (velocities, ..) = by_interior_point(problem);
    let operator = Operator::new(problem);
    // One impulse that is 1 % too large, a coefficient that is 1 % off, and sweeps that ended early.
    let mut impulses = exact(problem).impulses;
    let largest = (0..impulses.len()).max_by(|&i, &j| impulses[i].x.total_cmp(&impulses[j].x)).expect("some push");
    impulses[largest] *= 1.01;
    let mut rough = problem.clone();
    rough.contacts.iter_mut().for_each(|c| c.friction *= 1.01);
    let early = solution(problem, 0.0, 10).expect("good frames");
    for wrong in [operator.velocities(&impulses), exact(&rough).velocities, early.velocities] {
        let difference = apart(problem, &wrong, &velocities);
        assert!(difference > 10.0 * SAME, "{difference:e}");
    }
}
