//! Computes velocities from impulses: v = v_free + M⁻¹ Jᵀ r and u = J v + w, in f64.

use glam::{DMat3, DVec3};

use super::{ContactProblem, Velocity};

/// A problem with the inverses of its masses.
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
/// use drystone_problems::contacts::Operator;
///
/// let operator = Operator::new(&problem);
/// assert_eq!(operator.problem().bodies.len(), 1);
/// // 6 N s stop 2 kg at 3 m/s.
/// let velocities = operator.velocities(&[DVec3::X * 6.0]);
/// assert_eq!(operator.relative_velocity(0, &velocities), DVec3::Z);
/// // The response of u to r: 1/m along the normal, and an arm of 0.5 m on 1 kg m² along the tangents.
/// assert_eq!(operator.block(0), DMat3::from_diagonal(DVec3::new(0.5, 0.75, 0.75)));
/// assert_eq!(operator.inverse_inertia(0), DMat3::IDENTITY);
/// ```
#[derive(Clone, Debug)]
pub struct Operator<'a> {
    problem: &'a ContactProblem,
    /// Inverse inertia of each body, world axes (1/(kg m²)).
    inverse_inertia: Vec<DMat3>,
}

impl<'a> Operator<'a> {
    /// The operator of a problem.
    pub fn new(problem: &'a ContactProblem) -> Self {
        Self { problem, inverse_inertia: problem.bodies.iter().map(|b| inverse(b.inertia)).collect() }
    }

    /// The problem.
    pub fn problem(&self) -> &'a ContactProblem {
        self.problem
    }

    /// Inverse inertia of a body, world axes (1/(kg m²)).
    pub fn inverse_inertia(&self, body: usize) -> DMat3 {
        self.inverse_inertia[body]
    }

    /// The velocity of each body under the impulses of all contacts. Each impulse is in the coordinates of its contact
    /// (N s).
    ///
    /// # Panics
    /// The number of impulses differs from the number of contacts.
    pub fn velocities(&self, impulses: &[DVec3]) -> Vec<Velocity> {
        assert_eq!(impulses.len(), self.problem.contacts.len(), "one impulse a contact");
        let mut velocities: Vec<_> = self.problem.bodies.iter().map(|b| b.free).collect();
        for (contact, &r) in self.problem.contacts.iter().zip(impulses) {
            let p = contact.impulse(r);
            for (body, arm, p) in [(contact.a, contact.r_a, -p), (contact.b, contact.r_b, p)] {
                if let Some(body) = body.map(|i| i as usize) {
                    velocities[body].linear += p / self.problem.bodies[body].mass;
                    velocities[body].angular += self.inverse_inertia[body] * arm.cross(p);
                }
            }
        }
        velocities
    }

    /// The relative velocity u at a contact, offset included, in the contact's coordinates (m/s).
    pub fn relative_velocity(&self, contact: usize, velocities: &[Velocity]) -> DVec3 {
        let contact = &self.problem.contacts[contact];
        let at = |body: Option<u32>, arm: DVec3| {
            body.map_or(DVec3::ZERO, |i| velocities[i as usize].linear + velocities[i as usize].angular.cross(arm))
        };
        contact.coordinates(at(contact.b, contact.r_b) - at(contact.a, contact.r_a)) + contact.offset
    }

    /// The block W_ii of W = J M⁻¹ Jᵀ (1/kg): the response of u at a contact to the impulse of the same contact.
    pub fn block(&self, contact: usize) -> DMat3 {
        let contact = &self.problem.contacts[contact];
        let mut block = [[0.0; 3]; 3];
        for (body, arm) in [(contact.a, contact.r_a), (contact.b, contact.r_b)] {
            let Some(body) = body.map(|i| i as usize) else { continue };
            for (column, d) in block.iter_mut().zip(contact.frame) {
                for (entry, e) in column.iter_mut().zip(contact.frame) {
                    let turned = self.inverse_inertia[body] * arm.cross(d);
                    *entry += d.dot(e) / self.problem.bodies[body].mass + turned.dot(arm.cross(e));
                }
            }
        }
        DMat3::from_cols_array_2d(&block)
    }
}

/// The inverse of an inertia. It is scaled to order 1 first, so that the determinant of a small one does not underflow.
pub(super) fn inverse(inertia: DMat3) -> DMat3 {
    let scale = 3.0 / (inertia.x_axis.x + inertia.y_axis.y + inertia.z_axis.z);
    (inertia * scale).inverse() * scale
}
