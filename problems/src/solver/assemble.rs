//! Converts a contact problem to the rows that the kernels sweep, in f64 and rounded to f32.

use glam::{DMat3, DVec3};

use super::{Order, Sequence};
use crate::contacts::{ContactProblem, Operator, PointContact, Velocity};
use drystone::Result;
use drystone::stages::error::input;
use drystone::stages::kernels::{Body, Contact, Impulse, KernelRows, Mass, Point, StepParams, Sym3};
use drystone::stages::math::{Vec3, vec3};
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{BodyRow, ContactRow, ImpulseRow, Params, Softness, Substep, tangent_mass};

/// A contact problem as a step without duration.
pub(super) struct Assembled {
    /// The rounded rows, with all indices.
    pub problem: StepProblem,
    /// The same rows in full precision.
    pub rows: KernelRows<f64>,
    /// The point, and so the impulse, of each contact.
    pub points: Vec<u32>,
    /// 1, or -1 for a contact whose second tangent is the opposite of the one that the kernels form.
    pub hands: Vec<f64>,
}

/// A substep of one second without motion. Offsets then act as separations that the substep closes exactly.
const HARD: Softness = Softness { bias_rate: 1.0, mass_scale: 1.0, impulse_scale: 0.0, push_limit: f32::MAX };

impl Assembled {
    /// Lays out a problem in an order.
    ///
    /// # Errors
    /// The second tangent of a contact is not the normal times the first, up to sign.
    pub fn new(contacts: &ContactProblem, order: Order) -> Result<Self> {
        let operator = Operator::new(contacts);
        let sequence = Sequence::new(order, contacts);
        let hands = contacts.contacts.iter().enumerate().map(|(i, c)| hand(i, c)).collect::<Result<Vec<_>>>()?;
        let (mut problem, mut rows) = (StepProblem::default(), KernelRows::default());
        let substep = Substep { length: 1.0, inverse_length: 1.0, movable: HARD, fixed: HARD, ..Substep::default() };
        problem.params = Params {
            relaxation: 1.0,
            body_count: contacts.bodies.len() as u32 + 1,
            point_count: contacts.contacts.len() as u32,
            ..Params::default()
        };
        rows.params = vec![StepParams::load(&problem.params, &substep)];

        // The bodies, and one more for everything fixed, which no impulse moves.
        rows.bodies = contacts.bodies.iter().map(|b| body(b.free)).chain([body(Velocity::default())]).collect();
        rows.masses = (0..contacts.bodies.len()).map(|i| mass(&operator, i)).chain([Mass::default()]).collect();
        let row_of = |body: Option<u32>| body.unwrap_or(contacts.bodies.len() as u32);

        // Manifolds one after another, in the order of the sweep.
        let mut points = vec![0; contacts.contacts.len()];
        for manifold in &sequence.manifolds {
            let first = &contacts.contacts[manifold[0] as usize];
            let contact = Contact {
                normal: wide(first.frame[0]),
                tangent: wide(first.frame[1]),
                friction: first.friction,
                ..Contact::default()
            };
            problem.contacts.push(ContactRow {
                body_a: row_of(first.a),
                body_b: row_of(first.b),
                first_point: rows.points.len() as u32,
                point_count: manifold.len() as u32,
                ..contact.store()
            });
            rows.contacts.push(contact);
            for &i in manifold {
                points[i as usize] = rows.points.len() as u32;
                rows.points.push(point(&operator, i as usize, hands[i as usize]));
            }
        }
        rows.impulses = vec![Impulse::default(); points.len()];

        problem.bodies = rows.bodies.iter().map(Body::store).collect();
        problem.masses = rows.masses.iter().map(Mass::store).collect();
        problem.points = rows.points.iter().map(Point::store).collect();
        problem.impulses = vec![ImpulseRow::default(); points.len()];
        problem.order = (0..problem.contacts.len() as u32).collect();
        problem.colors = sequence.offsets;
        problem.in_one_block(problem.colors.len() as u32 - 1, substep);
        Ok(Self { problem, rows, points, hands })
    }
}

/// The sign of a frame: right-handed frames are those of the kernels.
fn hand(index: usize, contact: &PointContact) -> Result<f64> {
    let [n, t_1, t_2] = contact.frame;
    let formed = n.cross(t_1);
    if formed.distance(t_2) <= 1e-6 {
        Ok(1.0)
    } else if formed.distance(-t_2) <= 1e-6 {
        Ok(-1.0)
    } else {
        let t_2 = t_2.to_array();
        Err(input!("contact {index}: second tangent {t_2:?}: must be plus or minus normal × first tangent"))
    }
}

fn point(operator: &Operator, index: usize, hand: f64) -> Point<f64> {
    let contact = &operator.problem().contacts[index];
    let w = operator.block(index);
    Point {
        r_a: wide(contact.r_a),
        r_b: wide(contact.r_b),
        separation: contact.offset.x,
        normal_mass: 1.0 / w.x_axis.x,
        tangent_mass: tangent_mass(w.y_axis.y, w.z_axis.z, w.y_axis.z),
        pull: 0.0,
        slip_1: contact.offset.y,
        slip_2: contact.offset.z * hand,
    }
}

fn mass(operator: &Operator, body: usize) -> Mass<f64> {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = operator.inverse_inertia(body);
    Mass {
        locks: 0.0,
        inv_inertia: Sym3 { x: wide(x), yz: vec3(y.y, y.z, z.z) },
        inv_mass: 1.0 / operator.problem().bodies[body].mass,
        acceleration: Vec3::default(),
    }
}

pub(super) fn body(velocity: Velocity) -> Body<f64> {
    Body { v: wide(velocity.linear), w: wide(velocity.angular), ..Body::load(&BodyRow::AT_REST) }
}

fn wide(x: DVec3) -> Vec3<f64> {
    vec3(x.x, x.y, x.z)
}
