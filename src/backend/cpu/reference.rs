//! The CPU reference: one thread, one constraint at a time, in the order of the plan.

use super::super::Backend;
use super::begin_sweep;
use crate::error::Result;
use crate::kernels::contact::{clear_impulse, restitute_contact, solve_contact, warm_start};
use crate::kernels::integrate::{integrate_gyroscopic, integrate_positions, integrate_velocities};
use crate::kernels::joint::{solve_joint, warm_start_joint};
use crate::kernels::{Body, Contact, Free, Impulse, Inertia, Joint, Mass, Pair, Point, Rules, StepParams};
use crate::math::{Scalar, Vec3};
use crate::plan::{Kernel, Pass};
use crate::problem::{ConvergenceRow, StepProblem};

/// Runs the doubles of the kernels over `S`: `f32` for the reference, `f64` to see what rounding does.
#[derive(Debug, Default)]
pub struct Reference<S> {
    params: StepParams<S>,
    bodies: Vec<Body<S>>,
    masses: Vec<Mass<S>>,
    free: Vec<Free<S>>,
    inertias: Vec<Inertia<S>>,
    contacts: Vec<Contact<S>>,
    points: Vec<Point<S>>,
    impulses: Vec<Impulse<S>>,
    joints: Vec<Joint<S>>,
    joint_impulses: Vec<Vec3<S>>,
    convergence: ConvergenceRow,
}

impl<S: Scalar> Reference<S> {
    /// A reference with nothing loaded.
    pub fn new() -> Self {
        Self::default()
    }

    fn load(&mut self, problem: &StepProblem) {
        fn refill<R, T>(rows: &[R], kept: &mut Vec<T>, load: impl Fn(&R) -> T) {
            kept.clear();
            kept.extend(rows.iter().map(load));
        }
        self.params = StepParams::load(&problem.params);
        refill(&problem.bodies, &mut self.bodies, Body::load);
        refill(&problem.masses, &mut self.masses, Mass::load);
        self.free.resize(problem.bodies.len(), Free::default());
        refill(&problem.inertias, &mut self.inertias, Inertia::load);
        refill(&problem.contacts, &mut self.contacts, Contact::load);
        refill(&problem.points, &mut self.points, Point::load);
        refill(&problem.impulses, &mut self.impulses, Impulse::load);
        refill(&problem.joints, &mut self.joints, Joint::load);
        refill(&problem.joint_impulses, &mut self.joint_impulses, |r| Vec3::load(r.linear));
        self.convergence = problem.convergence;
    }

    fn store(&self, problem: &mut StepProblem) {
        for (row, body) in problem.bodies.iter_mut().zip(&self.bodies) {
            *row = body.store();
        }
        for (row, impulse) in problem.impulses.iter_mut().zip(&self.impulses) {
            *row = impulse.store();
        }
        for (row, impulse) in problem.joint_impulses.iter_mut().zip(&self.joint_impulses) {
            row.linear = impulse.store();
        }
        problem.convergence = self.convergence;
    }

    fn run_pass(&mut self, problem: &StepProblem, pass: &Pass) {
        let params = &self.params;
        match pass.kernel {
            Kernel::IntegrateVelocities { carry } => {
                for ((body, free), mass) in self.bodies.iter_mut().zip(&mut self.free).zip(&self.masses) {
                    integrate_velocities(carry, params, mass, body, free);
                }
            }
            Kernel::IntegrateGyroscopic => {
                for (row, inertia) in problem.inertias.iter().zip(&self.inertias) {
                    let i = row.body as usize;
                    let (body, free) = (&mut self.bodies[i], &mut self.free[i]);
                    integrate_gyroscopic(params, inertia, body, free, &mut self.masses[i]);
                }
            }
            Kernel::IntegratePositions => {
                for body in &mut self.bodies {
                    integrate_positions(params, body);
                }
            }
            Kernel::ClearImpulses => self.impulses.iter_mut().for_each(clear_impulse),
            Kernel::BeginSweep { first } => begin_sweep(first, &mut self.convergence),
            Kernel::WarmStartJoints => self.over_joints(problem, pass, |_, pair, joint, impulse| {
                warm_start_joint(pair, joint, *impulse);
            }),
            Kernel::SolveJoints(rules) => {
                if !self.is_converged(rules) {
                    self.over_joints(problem, pass, |params, pair, joint, impulse| {
                        solve_joint(rules, params, pair, joint, impulse);
                    });
                }
            }
            Kernel::WarmStart(rules) => {
                self.over_contacts(rules, problem, pass, |_, pair, contact, points, impulses| {
                    warm_start(rules, pair, contact, points, impulses);
                });
            }
            Kernel::SolveContacts(rules) => {
                if !self.is_converged(rules) {
                    self.over_contacts(rules, problem, pass, |params, pair, contact, points, impulses| {
                        solve_contact(rules, params, pair, contact, points, impulses);
                    });
                }
            }
            Kernel::ApplyRestitution(rules) => {
                self.over_contacts(rules, problem, pass, |params, pair, contact, points, impulses| {
                    restitute_contact(rules, params, pair, contact, points, impulses);
                });
            }
        }
    }

    /// One manifold after another.
    fn over_contacts(
        &mut self,
        rules: Rules,
        problem: &StepProblem,
        pass: &Pass,
        kernel: impl Fn(&StepParams<S>, &mut Pair<S>, &Contact<S>, &[Point<S>], &mut [Impulse<S>]),
    ) {
        for i in problem.rows_of(&pass.colors) {
            let row = &problem.contacts[i];
            let bodies = [row.body_a as usize, row.body_b as usize];
            let mut pair = self.load_pair(bodies);
            let first = row.first_point as usize;
            let rows = first..first + row.point_count as usize + usize::from(rules.patch);
            let (points, impulses) = (&self.points[rows.clone()], &mut self.impulses[rows]);
            kernel(&self.params, &mut pair, &self.contacts[i], points, impulses);
            self.store_pair(bodies, &pair);
        }
    }

    /// One joint after another.
    fn over_joints(
        &mut self,
        problem: &StepProblem,
        pass: &Pass,
        kernel: impl Fn(&StepParams<S>, &mut Pair<S>, &Joint<S>, &mut Vec3<S>),
    ) {
        for i in problem.rows_of(&pass.colors) {
            let row = &problem.joints[i];
            let bodies = [row.body_a as usize, row.body_b as usize];
            let mut pair = self.load_pair(bodies);
            kernel(&self.params, &mut pair, &self.joints[i], &mut self.joint_impulses[i]);
            self.store_pair(bodies, &pair);
        }
    }

    fn load_pair(&self, [a, b]: [usize; 2]) -> Pair<S> {
        let (mass_a, mass_b) = (self.masses[a], self.masses[b]);
        Pair { a: self.bodies[a], b: self.bodies[b], mass_a, mass_b, moving: S::constant(0.0) }
    }

    /// A body that cannot move is never written.
    fn store_pair(&mut self, [a, b]: [usize; 2], pair: &Pair<S>) {
        let zero = S::constant(0.0);
        if pair.mass_a.inv_mass > zero {
            (self.bodies[a].v, self.bodies[a].w) = (pair.a.v, pair.a.w);
        }
        if pair.mass_b.inv_mass > zero {
            (self.bodies[b].v, self.bodies[b].w) = (pair.b.v, pair.b.w);
        }
        if pair.moving > zero {
            self.convergence.moving = 1;
        }
    }

    fn is_converged(&self, rules: Rules) -> bool {
        rules.measured && self.convergence.done != 0
    }
}

impl<S: Scalar> Backend for Reference<S> {
    fn name(&self) -> &'static str {
        "reference"
    }

    fn adapter(&self) -> String {
        format!("one thread, scalar f{}", 8 * size_of::<S>())
    }

    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()> {
        self.load(problem);
        for pass in passes {
            self.run_pass(problem, pass);
        }
        self.store(problem);
        Ok(())
    }
}
