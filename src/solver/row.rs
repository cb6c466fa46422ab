//! One contact while it is swept.

use super::rounded;
use crate::config::FrictionRule;
use crate::contacts::Operator;
use crate::kernels::Pair;
use crate::kernels::friction::allowed_friction;
use crate::kernels::pair::{apply_impulse, relative_velocity};
use crate::math::{Scalar, Vec3, dot3, larger, vec3};

/// One contact with what does not change while it is swept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<S> {
    /// Which contact of the problem it is.
    pub contact: usize,
    /// Place of body a among the masses.
    pub body_a: usize,
    /// Place of body b.
    pub body_b: usize,
    frame: [Vec3<S>; 3],
    r_a: Vec3<S>,
    r_b: Vec3<S>,
    offset: Vec3<S>,
    friction: S,
    /// One over the normal entry of the block W_ii [kg].
    normal_mass: S,
    /// One over the largest eigenvalue of its tangential part [kg].
    tangent_mass: S,
    /// The entries of the tangents and the normal [1/kg]: what a normal impulse does to the slip.
    coupling: [S; 2],
}

impl<S: Scalar> Row<S> {
    /// Contact `index` of a problem.
    pub fn new(operator: &Operator, index: usize) -> Self {
        let problem = operator.problem();
        let contact = &problem.contacts[index];
        let place = |body: Option<u32>| body.map_or(problem.bodies.len(), |i| i as usize);
        let block = operator.block(index);
        let (w_11, w_22, w_12) = (block.y_axis.y, block.z_axis.z, block.y_axis.z);
        let largest = 0.5 * (w_11 + w_22 + ((w_11 - w_22).powi(2) + 4.0 * w_12 * w_12).sqrt());
        Self {
            contact: index,
            body_a: place(contact.a),
            body_b: place(contact.b),
            frame: contact.frame.map(rounded),
            r_a: rounded(contact.r_a),
            r_b: rounded(contact.r_b),
            offset: rounded(contact.offset),
            friction: S::constant(contact.friction),
            normal_mass: S::constant(1.0 / block.x_axis.x),
            tangent_mass: S::constant(1.0 / largest),
            coupling: [S::constant(block.x_axis.y), S::constant(block.x_axis.z)],
        }
    }
}

/// Corrects the impulse of one contact: the normal, then friction under the new normal, then both are applied at once.
#[inline(always)]
pub(super) fn sweep_contact<S: Scalar>(pair: &mut Pair<S>, row: &Row<S>, impulse: &mut Vec3<S>) {
    let [n, t_1, t_2] = row.frame;
    let u = relative_velocity(pair, row.r_a, row.r_b);
    let u = vec3(dot3(n, u), dot3(t_1, u), dot3(t_2, u)) + row.offset;
    let normal = larger(impulse.x - u.x * row.normal_mass, S::constant(0.0));
    let change = normal - impulse.x;
    let u_1 = u.y + row.coupling[0] * change;
    let u_2 = u.z + row.coupling[1] * change;
    let wanted = [impulse.y - u_1 * row.tangent_mass, impulse.z - u_2 * row.tangent_mass];
    let [r_1, r_2] = allowed_friction(FrictionRule::Disc, wanted, row.friction * normal);
    let p = n * change + t_1 * (r_1 - impulse.y) + t_2 * (r_2 - impulse.z);
    *impulse = vec3(normal, r_1, r_2);
    apply_impulse(pair, row.r_a, row.r_b, p);
}
