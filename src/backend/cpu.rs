//! The CPU reference: one thread, one constraint at a time, in the order of the plan.

use super::Backend;
use crate::error::Result;
use crate::kernels::contact::{restitute_contact, solve_contact, warm_start};
use crate::kernels::integrate::{integrate_gyroscopic, integrate_positions, integrate_velocities};
use crate::kernels::{Body, Contact, Impulse, Inertia, Mass, Pair, Point, StepParams};
use crate::math::Scalar;
use crate::plan::{Kernel, Pass, contact_range};
use crate::problem::StepProblem;

/// Runs the doubles of the kernels over `S`: `f32` for the reference, `f64` to see what rounding does.
#[derive(Debug, Default)]
pub struct Reference<S> {
    params: StepParams<S>,
    bodies: Vec<Body<S>>,
    masses: Vec<Mass<S>>,
    inertias: Vec<Inertia<S>>,
    contacts: Vec<Contact<S>>,
    points: Vec<Point<S>>,
    impulses: Vec<Impulse<S>>,
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
        refill(&problem.inertias, &mut self.inertias, Inertia::load);
        refill(&problem.contacts, &mut self.contacts, Contact::load);
        refill(&problem.points, &mut self.points, Point::load);
        refill(&problem.impulses, &mut self.impulses, Impulse::load);
    }

    fn store(&self, problem: &mut StepProblem) {
        for (row, body) in problem.bodies.iter_mut().zip(&self.bodies) {
            *row = body.store();
        }
        for (row, impulse) in problem.impulses.iter_mut().zip(&self.impulses) {
            *row = impulse.store();
        }
    }

    fn run_pass(&mut self, problem: &StepProblem, pass: &Pass) {
        let params = &self.params;
        match pass.kernel {
            Kernel::IntegrateVelocities => {
                for (body, mass) in self.bodies.iter_mut().zip(&self.masses) {
                    integrate_velocities(params, mass, body);
                }
            }
            Kernel::IntegrateGyroscopic => {
                for (row, inertia) in problem.inertias.iter().zip(&self.inertias) {
                    let i = row.body as usize;
                    integrate_gyroscopic(params, inertia, &mut self.bodies[i], &mut self.masses[i]);
                }
            }
            Kernel::IntegratePositions => {
                for body in &mut self.bodies {
                    integrate_positions(params, body);
                }
            }
            Kernel::WarmStart(rules) => self.over_contacts(problem, pass, |_, pair, contact, points, impulses| {
                warm_start(rules, pair, contact, points, impulses);
            }),
            Kernel::SolveContacts(rules) => {
                self.over_contacts(problem, pass, |params, pair, contact, points, impulses| {
                    solve_contact(rules, params, pair, contact, points, impulses);
                });
            }
            Kernel::ApplyRestitution(_) => self.over_contacts(problem, pass, restitute_contact),
        }
    }

    /// One manifold after another: its two bodies in, the kernel, the velocities of those that can move out.
    fn over_contacts(
        &mut self,
        problem: &StepProblem,
        pass: &Pass,
        kernel: impl Fn(&StepParams<S>, &mut Pair<S>, &Contact<S>, &[Point<S>], &mut [Impulse<S>]),
    ) {
        for i in contact_range(&problem.colors, &pass.colors) {
            let row = &problem.contacts[i];
            let (a, b) = (row.body_a as usize, row.body_b as usize);
            let points = row.first_point as usize..(row.first_point + row.point_count) as usize;
            let (mass_a, mass_b) = (self.masses[a], self.masses[b]);
            let mut pair = Pair { a: self.bodies[a], b: self.bodies[b], mass_a, mass_b };
            let impulses = &mut self.impulses[points.clone()];
            kernel(&self.params, &mut pair, &self.contacts[i], &self.points[points], impulses);
            let zero = S::constant(0.0);
            if mass_a.inv_mass > zero {
                (self.bodies[a].v, self.bodies[a].w) = (pair.a.v, pair.a.w);
            }
            if mass_b.inv_mass > zero {
                (self.bodies[b].v, self.bodies[b].w) = (pair.b.v, pair.b.w);
            }
        }
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
