//! Solves a contact problem by sweeps from zero impulses, on any backend or in f64. It uses the kernels of a step on a
//! step without duration.
//!
//! A sweep visits one manifold after another. It corrects the normal impulses, then friction, and clamps both to
//! Coulomb's cone (docs/derivation.md, sections 4 and 6). The accelerated method adds momentum
//! (`extrapolate` in the kernels of the engine).
//!
//! Sweeps update velocities together with impulses, and rounding makes the two drift apart: in f32 by about 3e-8 of the
//! free velocities per sweep, and by more with momentum. So velocities are recomputed from the impulses in f64 after
//! every 64 plain sweeps and after each end of momentum. Errors e_vel in f32 without and with this correction, after
//! 1000 accelerated sweeps: Spheres-i099 4e-5 and 2e-7, KaplaTower-135 4e-5 and 1e-7, mj_wall 2e-3 and 6e-5, tower10
//! 5e-4 and 1e-4.

mod assemble;
pub mod newton;
mod oracle;
mod order;

pub use oracle::{Solution, solution};
pub use order::{Order, Sequence};

use glam::DVec3;

use crate::contacts::{ContactProblem, Operator, Velocity};
use assemble::Assembled;
use drystone::config::Method;
use drystone::stages::kernels::{Body, Impulse};
use drystone::stages::math::Vec3;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Reference, Result};

/// Number of plain sweeps between two corrections of the velocities.
const DRIFT_SWEEPS: u32 = 64;

/// Number of sweeps after which momentum restarts: it multiplies rounding errors by its age.
const LONGEST_MOMENTUM: u32 = 1024;

/// The solver state of a contact problem.
///
/// ```
/// # use drystone_problems::contacts::{FreeBody, PointContact, Velocity};
/// # use drystone_problems::ContactProblem;
/// # use drystone::glam::{DMat3, DVec3};
/// # let free = Velocity { linear: DVec3::new(1.0, -3.0, 0.0), angular: DVec3::ZERO };
/// # let ball = FreeBody { mass: 2.0, inertia: DMat3::IDENTITY, free };
/// # let frame = [DVec3::Y, DVec3::Z, DVec3::X];
/// # let (offset, r_a, r_b) = (DVec3::ZERO, DVec3::ZERO, DVec3::Y * -0.5);
/// # let contact = PointContact { a: None, b: Some(0), friction: 0.1, offset, frame, r_a, r_b };
/// # let problem = ContactProblem { name: "a ball".into(), bodies: vec![ball], contacts: vec![contact] };
/// use drystone::{Reference, config::Method};
/// use drystone_problems::{residuals::Residuals, solver::{Order, Solver}};
///
/// let mut solver = Solver::new(&problem, Method::Plain, Order::default(), None)?.with_passes(1);
/// assert_eq!((solver.colors(), solver.adapter().is_empty()), (1, false));
/// solver.advance(20)?;
/// assert!(Residuals::of(&problem, &solver.impulses()).e_vel < 1e-9);
/// assert!(solver.velocities()[0].linear.y.abs() < 1e-9);
/// // The same in single precision on a backend.
/// let mut rounded = Solver::new(&problem, Method::Plain, Order::Contacts, Some(Box::new(Reference::<f32>::new())))?;
/// rounded.advance(20)?;
/// assert!(Residuals::of(&problem, &rounded.impulses()).e_vel < 1e-5);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Solver<'a> {
    operator: Operator<'a>,
    work: Work,
    method: Method,
    passes: u8,
    problem: StepProblem,
    /// The impulse of each contact, and the sign of its second tangent.
    points: Vec<u32>,
    hands: Vec<f64>,
    sweeps: u32,
    /// Sweeps since the last start of momentum, or since the last correction of the velocities.
    since: u32,
}

/// The backend of the sweeps.
enum Work {
    /// In f64, on rows that the solver owns.
    Exact(Box<Reference<f64>>),
    /// In f32.
    Rounded(Box<dyn Backend>),
}

impl<'a> Solver<'a> {
    /// A solver with zero impulses, in f64 or in f32 on a backend.
    ///
    /// # Errors
    /// The second tangent of a contact is not the normal times the first, up to sign.
    pub fn new(
        contacts: &'a ContactProblem,
        method: Method,
        order: Order,
        backend: Option<Box<dyn Backend>>,
    ) -> Result<Self> {
        let Assembled { problem, rows, points, hands } = Assembled::new(contacts, order)?;
        let work = match backend {
            None => Work::Exact(Box::new(Reference::holding(rows))),
            Some(backend) => Work::Rounded(backend),
        };
        Ok(Self {
            operator: Operator::new(contacts),
            work,
            method,
            passes: order.passes(),
            problem,
            points,
            hands,
            sweeps: 0,
            since: 0,
        })
    }

    /// Sweeps every manifold `passes` times before the next one, instead of the number that its order proposes.
    pub fn with_passes(self, passes: u8) -> Self {
        Self { passes, ..self }
    }

    /// Number of colors in the order of the contacts.
    pub fn colors(&self) -> usize {
        self.problem.contact_colors().len()
    }

    /// The name of the backend, for messages.
    pub fn adapter(&self) -> String {
        match &self.work {
            Work::Exact(reference) => reference.adapter(),
            Work::Rounded(backend) => backend.adapter(),
        }
    }

    /// Runs sweeps, with the other work of the method.
    ///
    /// # Errors
    /// The problem does not fit the device, or the device is lost.
    pub fn advance(&mut self, sweeps: u32) -> Result<()> {
        let end = self.sweeps + sweeps;
        while self.sweeps < end {
            // Momentum can end after any sweep.
            let count = match self.method {
                Method::Plain => (end - self.sweeps).min(DRIFT_SWEEPS - self.since),
                _ => 1,
            };
            let range = self.since..self.since + count;
            let plan = StepPlan::of_sweeps(&self.problem, self.method, self.passes, range);
            (self.sweeps, self.since) = (self.sweeps + count, self.since + count);
            let restarts = self.restarts();
            match &mut self.work {
                Work::Exact(reference) => reference.advance(&self.problem, &plan.passes),
                Work::Rounded(backend) => backend.run(&mut self.problem, &plan.passes)?,
            }
            // Right after a restart, the result does not depend on the velocities of the sweep before: it is a new
            // start, too.
            let is_new = self.since == if self.method == Method::Plain { DRIFT_SWEEPS } else { LONGEST_MOMENTUM };
            if is_new {
                self.since = 0;
            }
            if is_new || self.restarts() > restarts {
                self.set_right();
            }
        }
        Ok(())
    }

    /// The impulses after the last sweep in the order of the problem, each in its contact's coordinates (N s).
    pub fn impulses(&self) -> Vec<DVec3> {
        let impulse = |(&point, &hand): (&u32, &f64)| {
            let impulse = match &self.work {
                Work::Exact(reference) => reference.rows().impulses[point as usize],
                Work::Rounded(_) => Impulse::load(&self.problem.impulses[point as usize]),
            };
            to_f64(impulse.components()) * DVec3::new(1.0, 1.0, hand)
        };
        self.points.iter().zip(&self.hands).map(impulse).collect()
    }

    /// The velocities after the last sweep, updated together with the impulses.
    pub fn velocities(&self) -> Vec<Velocity> {
        let velocity = |i: usize| {
            let body = match &self.work {
                Work::Exact(reference) => reference.rows().bodies[i],
                Work::Rounded(_) => Body::load(&self.problem.bodies[i]),
            };
            Velocity { linear: to_f64(body.v), angular: to_f64(body.w) }
        };
        (0..self.problem.bodies.len() - 1).map(velocity).collect()
    }

    fn restarts(&self) -> u32 {
        match &self.work {
            Work::Exact(reference) => reference.rows().momentum.restarts,
            Work::Rounded(_) => self.problem.momentum.restarts,
        }
    }

    /// Recomputes the velocity of every body from the impulses.
    fn set_right(&mut self) {
        let right = self.operator.velocities(&self.impulses()).into_iter().map(assemble::body);
        match &mut self.work {
            Work::Exact(reference) => {
                reference.rows_mut().bodies.iter_mut().zip(right).for_each(|(row, body)| *row = body)
            }
            Work::Rounded(_) => self.problem.bodies.iter_mut().zip(right).for_each(|(row, body)| *row = body.store()),
        }
    }
}

fn to_f64(x: Vec3<f64>) -> DVec3 {
    DVec3::new(x.x, x.y, x.z)
}
