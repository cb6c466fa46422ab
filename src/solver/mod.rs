//! Projected sweeps over one contact problem from zero impulses, plain or accelerated, in `f64` or `f32`.
//!
//! A sweep visits one contact after another and corrects its normal impulse, then its friction, each clamped to what
//! Coulomb's cone allows (docs/derivation.md, sections 4 and 6). The accelerated method treats the sweep S as a step of
//! steepest descent and adds Nesterov's momentum to it, with a restart as soon as steps grow (O'Donoghue and Candès 2015):
//!
//! ```text
//! x_k = S(r_k-1)        f_k = |x_k - r_k-1|
//! if f_k > f_k-1:       t_k = 1,  r_k = x_k
//! else:                 t_k = (1 + sqrt(1 + 4 t_k-1²))/2,  r_k = x_k + (t_k-1 - 1)/t_k (x_k - x_k-1)
//! ```
//!
//! The result is x_k. Velocities are linear in the impulses and are carried along with the same factor, so that a step
//! costs one sweep.

mod order;
mod row;

pub use order::{Order, Sequence};

use glam::{DMat3, DVec3};

use crate::contacts::{ContactProblem, Operator, Velocity};
use crate::kernels::{Body, Mass, Pair, Sym3};
use crate::math::{Scalar, Vec3, vec3};
use row::{Row, sweep_contact};

/// What is done with the sweeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// One after another: projected Gauss-Seidel.
    Plain,
    /// With momentum, and a restart as soon as steps grow.
    #[default]
    Accelerated,
}

/// The numbers that a solver calculates in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Double precision.
    #[default]
    F64,
    /// Single precision, as on a GPU.
    F32,
}

/// A contact problem while it is solved.
#[derive(Clone, Debug)]
pub struct Solver<S> {
    method: Method,
    colors: usize,
    /// Contacts in the order of a sweep.
    rows: Vec<Row<S>>,
    /// Masses of the bodies; one more that nothing moves, which stands for all that is fixed.
    masses: Vec<Mass<S>>,
    /// After the last sweep.
    now: State<S>,
    /// After the sweep before that; only where there is momentum.
    before: State<S>,
    momentum: Momentum,
}

/// Impulses, and the velocities that belong to them.
#[derive(Clone, Debug, Default)]
struct State<S> {
    /// In the coordinates of their contacts, in the order of a sweep.
    impulses: Vec<Vec3<S>>,
    /// One a mass.
    bodies: Vec<Body<S>>,
}

#[derive(Clone, Copy, Debug)]
struct Momentum {
    /// t_k.
    t: f64,
    /// (t_k-1 - 1)/t_k.
    factor: f64,
    /// f_k.
    step: f64,
}

impl<S: Scalar> Solver<S> {
    /// From zero impulses.
    pub fn new(problem: &ContactProblem, method: Method, order: Order) -> Self {
        let operator = Operator::new(problem);
        let sequence = Sequence::new(order, problem);
        let rows: Vec<_> = sequence.contacts.iter().map(|&i| Row::new(&operator, i as usize)).collect();
        let mut masses: Vec<_> = (0..problem.bodies.len()).map(|i| mass(&operator, i)).collect();
        masses.push(Mass::default());
        let mut bodies: Vec<_> = problem.bodies.iter().map(|b| at(b.free)).collect();
        bodies.push(Body::default());
        let now = State { impulses: vec![Vec3::default(); rows.len()], bodies };
        let before = if method == Method::Plain { State::default() } else { now.clone() };
        let momentum = Momentum { t: 1.0, factor: 0.0, step: f64::INFINITY };
        Self { method, colors: sequence.colors, rows, masses, now, before, momentum }
    }

    /// Colors that the order of the contacts forms.
    pub fn colors(&self) -> usize {
        self.colors
    }

    /// One sweep, with what the method does besides.
    pub fn advance(&mut self) {
        if self.method == Method::Accelerated {
            self.now.extrapolate(&mut self.before, S::constant(self.momentum.factor));
        }
        let step = self.sweep();
        self.momentum = self.momentum.after(step);
    }

    /// The impulses of the last sweep in the order of the problem, each in its contact's coordinates [N s].
    pub fn impulses(&self) -> Vec<DVec3> {
        let mut impulses = vec![DVec3::ZERO; self.rows.len()];
        for (row, &r) in self.rows.iter().zip(&self.now.impulses) {
            impulses[row.contact] = to_f64(r);
        }
        impulses
    }

    /// The velocities of the last sweep, carried along with the impulses.
    pub fn velocities(&self) -> Vec<Velocity> {
        let movable = &self.now.bodies[..self.now.bodies.len() - 1];
        movable.iter().map(|b| Velocity { linear: to_f64(b.v), angular: to_f64(b.w) }).collect()
    }

    /// Visits every contact once; returns the norm of what that changed in the impulses [N s].
    fn sweep(&mut self) -> f64 {
        let State { impulses, bodies } = &mut self.now;
        let mut squares = 0.0;
        for (row, impulse) in self.rows.iter().zip(impulses) {
            let (a, b) = (row.body_a, row.body_b);
            let mut pair = Pair {
                a: bodies[a],
                b: bodies[b],
                mass_a: self.masses[a],
                mass_b: self.masses[b],
                moving: S::default(),
            };
            let before = *impulse;
            sweep_contact(&mut pair, row, impulse);
            (bodies[a], bodies[b]) = (pair.a, pair.b);
            squares += to_f64(*impulse - before).length_squared();
        }
        squares.sqrt()
    }
}

impl<S: Scalar> State<S> {
    /// Goes on from `before` through this state by `factor` of the way between them; `before` becomes this state.
    fn extrapolate(&mut self, before: &mut Self, factor: S) {
        let go_on = |x: &mut Vec3<S>, before: &mut Vec3<S>| {
            let further = *x + (*x - *before) * factor;
            *before = *x;
            *x = further;
        };
        for (x, before) in self.impulses.iter_mut().zip(&mut before.impulses) {
            go_on(x, before);
        }
        for (body, before) in self.bodies.iter_mut().zip(&mut before.bodies) {
            go_on(&mut body.v, &mut before.v);
            go_on(&mut body.w, &mut before.w);
        }
    }
}

impl Momentum {
    /// After a step of norm `step`.
    fn after(self, step: f64) -> Self {
        if step > self.step {
            return Self { t: 1.0, factor: 0.0, step };
        }
        let t = 0.5 * (1.0 + (1.0 + 4.0 * self.t * self.t).sqrt());
        Self { t, factor: (self.t - 1.0) / t, step }
    }
}

fn mass<S: Scalar>(operator: &Operator, body: usize) -> Mass<S> {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = operator.inverse_inertia(body);
    Mass {
        inv_inertia: Sym3 { x: rounded(x), yz: rounded(DVec3::new(y.y, y.z, z.z)) },
        inv_mass: S::constant(1.0 / operator.problem().bodies[body].mass),
        acceleration: Vec3::default(),
    }
}

fn at<S: Scalar>(velocity: Velocity) -> Body<S> {
    Body { v: rounded(velocity.linear), w: rounded(velocity.angular), ..Body::default() }
}

fn rounded<S: Scalar>(x: DVec3) -> Vec3<S> {
    vec3(S::constant(x.x), S::constant(x.y), S::constant(x.z))
}

fn to_f64<S: Scalar>(x: Vec3<S>) -> DVec3 {
    DVec3::new(x.x.to_f64(), x.y.to_f64(), x.z.to_f64())
}
