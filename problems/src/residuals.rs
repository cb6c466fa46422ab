//! Errors of impulses for a contact problem, in f64. They depend only on the problem and the impulses.
//!
//! The natural map of a contact compares its impulse r with the projection on Coulomb's cone K of r minus a step along
//! the velocity: F = r - P_K(r - rho (u + mu |u_t| n)). For every rho > 0, it is zero exactly at a solution (De Saxcé
//! and Feng 1998; Acary, Brémond and Huber 2018).

use glam::{DMat3, DVec2, DVec3};

use crate::contacts::{ContactProblem, LocalProblem, Operator, Velocity};

/// The errors of impulses. All of them are NaN if any of them is not finite.
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
/// use drystone_problems::residuals::Residuals;
///
/// // The ball stops falling, and slides on at 0.7 m/s against full friction.
/// let solved = Residuals::of(&problem, &[DVec3::new(6.0, 0.0, -0.6)]);
/// assert!(solved.e_vel < 1e-12 && solved.cone < 1e-12);
/// // Without impulses it approaches the ground.
/// assert_eq!(Residuals::of(&problem, &[DVec3::ZERO]).pen_rate, 3.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Residuals {
    /// The natural map in velocities: the norm of F/rho over all contacts with rho = 3/trace(W_ii), divided by the norm
    /// of the free relative velocities. It does not depend on units. Use this number for decisions.
    pub e_vel: f64,
    /// The natural map with rho = 1, like published error curves. It adds impulses and velocities as numbers, so it
    /// depends on units.
    pub e_fclib: f64,
    /// The largest contribution of one contact to `e_vel`, |F|/rho (m/s).
    pub vmax: f64,
    /// The contact with this contribution; `None` without contacts.
    pub worst_contact: Option<usize>,
    /// Largest approach speed of two touching surfaces (m/s).
    pub pen_rate: f64,
    /// Largest |u_n r_n| (J): the contact pushes although it separates.
    pub compl: f64,
    /// Largest distance of an impulse from its cone, |r_t| - mu r_n or -r_n (N s).
    pub cone: f64,
    /// Largest |u_t · r_t + mu r_n |u_t|| (J): friction does not fully oppose the slip.
    pub diss: f64,
    /// Difference between the velocities that a solver carried and those of its impulses, relative to the free
    /// velocities, both in the norm of kinetic energy.
    pub eom: f64,
}

impl Residuals {
    /// The errors of `impulses`, one for each contact in its coordinates (N s). Keep a [`Measure`] to measure many
    /// times.
    ///
    /// # Panics
    /// The number of impulses differs from the number of contacts.
    pub fn of(problem: &ContactProblem, impulses: &[DVec3]) -> Self {
        let measure = Measure::new(problem);
        measure.of(impulses, &measure.operator.velocities(impulses))
    }

    /// The errors of impulses for a problem without bodies, one for each contact in its coordinates (N s). No
    /// velocities are carried, so `eom` is zero.
    ///
    /// ```
    /// # use drystone_problems::contacts::LocalProblem;
    /// # use drystone::glam::{DMat3, DVec3};
    /// # let rows = vec![vec![(0, DMat3::IDENTITY * 0.5)]];
    /// # let problem = LocalProblem { name: "one contact".into(), friction: vec![0.1], free: vec![DVec3::X * -3.0], rows };
    /// use drystone_problems::residuals::Residuals;
    ///
    /// assert!(Residuals::of_blocks(&problem, &[DVec3::X * 6.0]).e_vel < 1e-12);
    /// ```
    ///
    /// # Panics
    /// The number of impulses differs from the number of contacts.
    pub fn of_blocks(problem: &LocalProblem, impulses: &[DVec3]) -> Self {
        assert_eq!(impulses.len(), problem.rows.len(), "one impulse a contact");
        let contact = |i: usize| At {
            mu: problem.friction[i],
            rho: step(problem.block(i)),
            r: impulses[i],
            u: problem.free[i] + problem.response(i, impulses),
        };
        let free = problem.free.iter().map(|q| q.length_squared()).sum::<f64>().sqrt();
        Self::of_contacts((0..impulses.len()).map(contact), free).spoiled()
    }

    fn of_contacts(contacts: impl Iterator<Item = At>, free_norm: f64) -> Self {
        let (mut squares, mut squares_at_one) = (0.0, 0.0);
        let (mut worst, mut approach, mut complement, mut cone, mut dissipation) =
            (Largest::default(), Largest::default(), Largest::default(), Largest::default(), Largest::default());
        for (i, At { mu, rho, r, u }) in contacts.enumerate() {
            let (r_t, u_t) = (DVec2::new(r.y, r.z), DVec2::new(u.y, u.z));
            let residual = natural_map(mu, r, u, rho).length() / rho;
            squares += residual * residual;
            squares_at_one += natural_map(mu, r, u, 1.0).length_squared();
            worst.add(i, residual);
            approach.add(i, -u.x);
            complement.add(i, (u.x * r.x).abs());
            cone.add(i, r_t.length() - mu * r.x);
            cone.add(i, -r.x);
            dissipation.add(i, (u_t.dot(r_t) + mu * r.x * u_t.length()).abs());
        }
        Self {
            e_vel: ratio(squares.sqrt(), free_norm),
            e_fclib: ratio(squares_at_one.sqrt(), free_norm),
            vmax: worst.value,
            worst_contact: worst.place,
            pen_rate: approach.value,
            compl: complement.value,
            cone: cone.value,
            diss: dissipation.value,
            eom: 0.0,
        }
    }

    fn numbers_mut(&mut self) -> [&mut f64; 8] {
        let Self { e_vel, e_fclib, vmax, worst_contact: _, pen_rate, compl, cone, diss, eom } = self;
        [e_vel, e_fclib, vmax, pen_rate, compl, cone, diss, eom]
    }

    /// Any NaN makes all numbers NaN, so that no remaining number looks better than it is.
    fn spoiled(mut self) -> Self {
        if self.numbers_mut().iter().any(|x| !x.is_finite()) {
            self.numbers_mut().into_iter().for_each(|x| *x = f64::NAN);
        }
        self
    }
}

/// The data of a contact that its errors depend on.
struct At {
    mu: f64,
    rho: f64,
    r: DVec3,
    u: DVec3,
}

/// rho of a contact with the block W_ii: 3/trace(W_ii) (kg).
fn step(block: DMat3) -> f64 {
    3.0 / (block.x_axis.x + block.y_axis.y + block.z_axis.z)
}

/// A problem with the data that does not depend on the impulses.
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
/// use drystone_problems::{contacts::Operator, residuals::Measure};
///
/// let (measure, operator) = (Measure::new(&problem), Operator::new(&problem));
/// let impulses = [DVec3::new(6.0, 0.0, -0.6)];
/// assert!(measure.of(&impulses, &operator.velocities(&impulses)).e_vel < 1e-12);
/// ```
pub struct Measure<'a> {
    operator: Operator<'a>,
    /// rho of each contact: 3/trace(W_ii) (kg).
    steps: Vec<f64>,
    /// Norm of the relative velocities without impulses (m/s).
    free_norm: f64,
}

impl<'a> Measure<'a> {
    /// Prepares the measurement of a problem.
    pub fn new(problem: &'a ContactProblem) -> Self {
        let operator = Operator::new(problem);
        let steps = (0..problem.contacts.len()).map(|i| step(operator.block(i))).collect();
        let free: Vec<_> = problem.bodies.iter().map(|b| b.free).collect();
        let squares = (0..problem.contacts.len()).map(|i| operator.relative_velocity(i, &free).length_squared());
        let free_norm = squares.sum::<f64>().sqrt();
        Self { operator, steps, free_norm }
    }

    /// The errors of `impulses`, one for each contact in its coordinates (N s), with the velocities that a solver
    /// carried.
    ///
    /// # Panics
    /// The number of impulses differs from the number of contacts, or that of velocities from that of bodies.
    pub fn of(&self, impulses: &[DVec3], carried: &[Velocity]) -> Residuals {
        assert_eq!(carried.len(), self.operator.problem().bodies.len(), "one velocity a body");
        let velocities = self.operator.velocities(impulses);
        let contact = |i: usize| At {
            mu: self.operator.problem().contacts[i].friction,
            rho: self.steps[i],
            r: impulses[i],
            u: self.operator.relative_velocity(i, &velocities),
        };
        let residuals = Residuals::of_contacts((0..impulses.len()).map(contact), self.free_norm);
        Residuals { eom: self.drift(&velocities, carried), ..residuals }.spoiled()
    }

    fn drift(&self, velocities: &[Velocity], carried: &[Velocity]) -> f64 {
        let (mut apart, mut whole) = (0.0, 0.0);
        for (body, (v, carried)) in self.operator.problem().bodies.iter().zip(velocities.iter().zip(carried)) {
            let twice_energy = |v: DVec3, w: DVec3| body.mass * v.length_squared() + w.dot(body.inertia * w);
            apart += twice_energy(carried.linear - v.linear, carried.angular - v.angular);
            whole += twice_energy(body.free.linear, body.free.angular);
        }
        ratio(apart.sqrt(), whole.sqrt())
    }
}

/// r - P_K(r - rho (u + mu |u_t| n)).
pub(crate) fn natural_map(mu: f64, r: DVec3, u: DVec3, rho: f64) -> DVec3 {
    let slip = DVec2::new(u.y, u.z).length();
    r - projected_on_cone(mu, r - (u + DVec3::X * (mu * slip)) * rho)
}

/// The point of the cone |x_t| <= mu x_n that is nearest to x.
fn projected_on_cone(mu: f64, x: DVec3) -> DVec3 {
    let length = DVec2::new(x.y, x.z).length();
    if mu * length <= -x.x {
        DVec3::ZERO
    } else if length <= mu * x.x {
        x
    } else {
        let normal = (x.x + mu * length) / (1.0 + mu * mu);
        let scale = mu * normal / length;
        DVec3::new(normal, x.y * scale, x.z * scale)
    }
}

/// The ratio of two numbers; 0 divided by 0 is 0.
fn ratio(x: f64, y: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x / y }
}

/// The largest of some numbers: 0 if all are negative, NaN if any is NaN.
#[derive(Default)]
struct Largest {
    value: f64,
    place: Option<usize>,
}

impl Largest {
    fn add(&mut self, place: usize, x: f64) {
        if x > self.value || x.is_nan() || self.place.is_none() {
            *self = Self { value: if x <= 0.0 { 0.0 } else { x }, place: Some(place) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_is_the_nearest_point_of_the_cone() {
        let mu = 0.5;
        for x in [
            DVec3::new(1.0, 2.0, -1.0),
            DVec3::new(-0.1, 1.0, 0.0),
            DVec3::new(-3.0, 1.0, 1.0),
            DVec3::new(-0.7, 1.0, 0.0),
            DVec3::X,
        ] {
            let nearest = projected_on_cone(mu, x);
            assert!(DVec2::new(nearest.y, nearest.z).length() <= mu * nearest.x * (1.0 + 1e-15) + 1e-300);
            for k in 0..1000 {
                let (angle, normal) = (0.1 * f64::from(k), 0.01 * f64::from(k % 400));
                let other = DVec3::new(normal, mu * normal * angle.cos(), mu * normal * angle.sin());
                assert!(nearest.distance(x) <= other.distance(x), "{x}: {other} is nearer than {nearest}");
            }
        }
    }
}
