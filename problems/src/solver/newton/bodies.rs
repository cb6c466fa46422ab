//! W = J M⁻¹ Jᵀ of rigid bodies, in terms of the bodies.
//!
//! With the inverse square roots of the masses inside the rows of J, W = J Jᵀ. With v = Jᵀ x, the system (1 + D W) x =
//! b becomes (1 + Jᵀ D J) v = Jᵀ b. It has six unknowns a body, and is regular for any number of contacts.

use std::array::from_fn;

use glam::{DMat3, DVec3};

use super::factor::Factor;
use super::system::{Cone, System};
use crate::contacts::{ContactProblem, Operator};
use crate::solver::{Order, Sequence};

/// A problem of rigid bodies.
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
/// use drystone_problems::solver::newton::{Bodies, System};
///
/// assert_eq!(Bodies::new(&problem).cones().len(), 1);
/// ```
pub struct Bodies {
    cones: Vec<Cone>,
    sequence: Vec<u32>,
    bodies: usize,
    /// The movable sides of all contacts, and the index of the first side of each contact.
    sides: Vec<Side>,
    begin: Vec<usize>,
    factor: Option<Factor<6>>,
}

/// The rows of J of one contact on one body.
struct Side {
    body: u32,
    rows: [[f64; 6]; 3],
}

impl Bodies {
    /// The system of a problem. Sweeps go contact by contact.
    pub fn new(problem: &ContactProblem) -> Self {
        let operator = Operator::new(problem);
        let free: Vec<_> = problem.bodies.iter().map(|b| b.free).collect();
        let q = |i: usize| operator.relative_velocity(i, &free);
        let cone = |i: usize| Cone::new(problem.contacts[i].friction, q(i), operator.block(i));
        // I⁻¹ = R Rᵀ
        let roots: Vec<_> = (0..problem.bodies.len()).map(|i| root(operator.inverse_inertia(i))).collect();
        let (mut sides, mut begin) = (Vec::new(), vec![0]);
        for c in &problem.contacts {
            for (body, arm, sign) in [(c.a, c.r_a, -1.0), (c.b, c.r_b, 1.0)] {
                let Some(body) = body else { continue };
                let linear = sign / problem.bodies[body as usize].mass.sqrt();
                let rows = c.frame.map(|d| {
                    let (move_, turn) = (d * linear, roots[body as usize].transpose() * (arm.cross(d) * sign));
                    [move_.x, move_.y, move_.z, turn.x, turn.y, turn.z]
                });
                sides.push(Side { body, rows });
            }
            begin.push(sides.len());
        }
        Self {
            cones: (0..problem.contacts.len()).map(cone).collect(),
            sequence: Sequence::new(Order::Contacts, problem).manifolds.concat(),
            bodies: problem.bodies.len(),
            sides,
            begin,
            factor: None,
        }
    }

    fn sides(&self, contact: usize) -> &[Side] {
        &self.sides[self.begin[contact]..self.begin[contact + 1]]
    }

    /// The factor, with its elimination order computed.
    fn ordered(&mut self) -> Factor<6> {
        let ties = |range: &[usize]| match &self.sides[range[0]..range[1]] {
            [a, b] => Some([a.body, b.body]),
            _ => None,
        };
        self.factor.take().unwrap_or_else(|| Factor::new(self.bodies, self.begin.windows(2).filter_map(ties)))
    }
}

impl System for Bodies {
    fn cones(&self) -> &[Cone] {
        &self.cones
    }

    fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    fn carried(&self, r: &[DVec3]) -> Vec<f64> {
        let mut carried = vec![0.0; 6 * self.bodies];
        r.iter().enumerate().for_each(|(i, &r)| self.push(i, r, &mut carried));
        carried
    }

    fn response(&self, contact: usize, _: &[DVec3], carried: &[f64]) -> DVec3 {
        let mut u = [0.0; 3];
        for side in self.sides(contact) {
            let v = &carried[6 * side.body as usize..][..6];
            (0..3).for_each(|k| u[k] += (0..6).map(|j| side.rows[k][j] * v[j]).sum::<f64>());
        }
        DVec3::from_array(u)
    }

    fn push(&self, contact: usize, change: DVec3, carried: &mut [f64]) {
        for Side { body, rows } in self.sides(contact) {
            let v = &mut carried[6 * *body as usize..][..6];
            (0..6).for_each(|j| v[j] += rows[0][j] * change.x + rows[1][j] * change.y + rows[2][j] * change.z);
        }
    }

    fn work(&mut self) -> (f64, f64) {
        let factor = self.ordered();
        let sides = self.sides.len() as f64;
        // D J and Jᵀ D J; J and Jᵀ.
        let work = (factor.multiplications() + sides * (54.0 + 108.0 * sides / self.cones.len() as f64), 36.0 * sides);
        self.factor = Some(factor);
        work
    }

    fn factor(&mut self, d: &[DMat3]) -> Option<()> {
        let mut factor = self.ordered();
        factor.clear();
        for (i, d) in d.iter().enumerate() {
            for column in self.sides(i) {
                let pushed: [[f64; 6]; 3] =
                    from_fn(|i| from_fn(|j| (0..3).map(|k| d.col(k)[i] * column.rows[k][j]).sum()));
                for row in self.sides(i) {
                    let block = factor.block_mut(row.body, column.body);
                    for (i, entries) in block.iter_mut().enumerate() {
                        for (j, entry) in entries.iter_mut().enumerate() {
                            *entry += (0..3).map(|k| row.rows[k][i] * pushed[k][j]).sum::<f64>();
                        }
                    }
                }
            }
        }
        let done = factor.factor();
        self.factor = Some(factor);
        done
    }

    fn solve(&self, b: &[DVec3]) -> Vec<DVec3> {
        let pushed = self.carried(b);
        let mut v: Vec<[f64; 6]> = pushed.chunks_exact(6).map(|v| from_fn(|k| v[k])).collect();
        self.factor.as_ref().expect("factored").solve(&mut v);
        let v = v.into_flattened();
        (0..b.len()).map(|i| self.response(i, &[], &v)).collect()
    }
}

/// The lower triangular factor R of a positive definite matrix R Rᵀ.
fn root(m: DMat3) -> DMat3 {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = m.to_cols_array_2d();
    let x = xx.sqrt();
    let (y_x, z_x) = (xy / x, xz / x);
    let y = (yy - y_x * y_x).sqrt();
    let z_y = (yz - y_x * z_x) / y;
    let z = (zz - z_x * z_x - z_y * z_y).sqrt();
    DMat3::from_cols(DVec3::new(x, y_x, z_x), DVec3::new(0.0, y, z_y), DVec3::new(0.0, 0.0, z))
}
