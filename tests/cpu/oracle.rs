//! The oracle against an interior point solver, which knows nothing of sweeps, colors or momentum.
//!
//! Under the slip of a solution its velocities are those of one convex program: least change of kinetic energy from the free
//! velocities such that every u + mu |u_t| n lies in the dual of Coulomb's cone (De Saxcé and Feng 1998). That program has one
//! solution, and velocities that are not those of the program with their own slip solve nothing. So one program proves velocities
//! right or wrong, also where friction allows several.

use crate::common::contacts::tower;
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};
use drystone::{Cpu, Simulation, SolverConfig};
use drystone_problems::contacts::{ContactProblem, FreeBody, Operator, Velocity};
use drystone_problems::residuals::Residuals;
use drystone_problems::solver::newton::{Bodies, NewtonEnded, newton};
use drystone_problems::solver::{Solution, solution};
use drystone_scenes::Scene;
use glam::{DVec2, DVec3};

/// Tolerance of the interior point method, which reaches no smaller one.
const ASKED: f64 = 1e-10;
/// Largest energy of a difference: kinetic energy is what the program is about. Worst measured: 1.1e-12.
const SAME: f64 = ASKED;

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

/// Kinetic energy of the difference of two velocities, as a share of that of the free velocities.
fn apart(problem: &ContactProblem, a: &[Velocity], b: &[Velocity]) -> f64 {
    let energy = |velocity: &dyn Fn(usize) -> Velocity| -> f64 {
        let of = |(i, body): (usize, &FreeBody)| {
            let Velocity { linear, angular } = velocity(i);
            body.mass * linear.length_squared() + angular.dot(body.inertia * angular)
        };
        problem.bodies.iter().enumerate().map(of).sum()
    };
    let difference = |i: usize| Velocity { linear: a[i].linear - b[i].linear, angular: a[i].angular - b[i].angular };
    energy(&difference) / energy(&|i| problem.bodies[i].free)
}

/// How far velocities are from those of the convex program with their own slip: zero for a solution, and for nothing else.
fn from_own_program(problem: &ContactProblem, velocities: &[Velocity]) -> f64 {
    apart(problem, velocities, &convex(problem, &slip(problem, velocities)).0)
}

fn exact(problem: &ContactProblem) -> Solution {
    let solved = solution(problem, 1e-12, 200_000).expect("good frames");
    assert!(solved.residuals.e_vel <= 1e-12, "{}: {:?}", problem.name, solved.residuals);
    solved
}

/// A pile of six boxes as it lands.
fn pile() -> ContactProblem {
    let scene = Scene::find("pile", &["n=6".into()]).expect("a scene of the catalogue");
    let mut simulation = Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(Cpu::new()))
        .expect("it is sound");
    for _ in 0..28 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    drystone_problems::step_with_contacts(&mut simulation, "pile", 1.0 / 60.0).expect("no joints").0
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
fn without_friction_and_where_all_sticks_it_is_the_convex_program() {
    let mut sticking = tower(&[1.0, 2.0, 0.5]);
    sticking.bodies[1].free.linear.x += 0.05;
    sticking.contacts.iter_mut().for_each(|c| c.friction = 2.0);
    for problem in problems(0.0).into_iter().chain([sticking]) {
        let ours = exact(&problem).velocities;
        let fastest = slip(&problem, &ours).into_iter().fold(0.0, f64::max);
        assert!(problem.contacts[0].friction == 0.0 || fastest < 1e-10, "{}: slips at {fastest} m/s", problem.name);
        let (velocities, impulses) = convex(&problem, &vec![0.0; problem.contacts.len()]);
        let (difference, theirs) = (apart(&problem, &ours, &velocities), Residuals::of(&problem, &impulses).e_vel);
        println!("{}: {difference:.1e} apart, theirs {theirs:.1e}", problem.name);
        assert!(difference < SAME && theirs < 1e-8, "{}: {difference:e}, {theirs:e}", problem.name);
    }
}

#[test]
fn where_it_slips_it_is_the_convex_program_of_its_own_slip() {
    for friction in [0.05, 0.2, 0.7] {
        for problem in problems(friction) {
            let ours = exact(&problem).velocities;
            let difference = from_own_program(&problem, &ours);
            let slipping = slip(&problem, &ours).iter().filter(|&&speed| speed > 1e-6).count();
            println!("{}, {friction}: {difference:.1e} apart, {slipping} contacts slip", problem.name);
            assert!(difference < SAME, "{}, {friction}: {difference:e}", problem.name);
        }
        let pushed = &problems(friction)[1];
        assert!(slip(pushed, &exact(pushed).velocities).iter().any(|&speed| speed > 1e-3), "nothing slips");
    }
}

#[test]
fn newtons_method_finds_what_the_convex_program_of_its_slip_finds() {
    let mut reached = 0;
    for friction in [0.0, 0.05, 0.2, 0.7] {
        for problem in problems(friction) {
            // Newton's method alone, and with sweeps before and after it.
            for (tolerance, sweeps) in [(1e-9, 0), (1e-11, 20_000)] {
                let found = newton(&mut Bodies::new(&problem), tolerance, sweeps);
                if sweeps == 0 && found.newton != NewtonEnded::Reached {
                    continue;
                }
                reached += u32::from(found.newton == NewtonEnded::Reached);
                let velocities = Operator::new(&problem).velocities(&found.impulses);
                let difference = from_own_program(&problem, &velocities);
                println!("{}, {friction}: {difference:.1e} apart after {} steps", problem.name, found.steps);
                assert!(difference < SAME && found.e_vel <= tolerance, "{}, {friction}: {difference:e}", problem.name);
            }
        }
    }
    assert!(reached >= 9, "Newton's method came to the end {reached} times");
}

#[test]
fn what_is_no_solution_is_told_apart() {
    let problem = &problems(0.2)[1];
    let operator = Operator::new(problem);
    // One impulse that is 1 % too large, a coefficient that is 1 % off, and sweeps that ended early.
    let mut impulses = exact(problem).impulses;
    let largest = (0..impulses.len()).max_by(|&i, &j| impulses[i].x.total_cmp(&impulses[j].x)).expect("some push");
    impulses[largest] *= 1.01;
    let mut rough = problem.clone();
    rough.contacts.iter_mut().for_each(|c| c.friction *= 1.01);
    let early = solution(problem, 0.0, 10).expect("good frames");
    for wrong in [operator.velocities(&impulses), exact(&rough).velocities, early.velocities] {
        let difference = from_own_program(problem, &wrong);
        assert!(difference > 10.0 * SAME, "{difference:e}");
    }
}
