//! Inertia from the geometric stiffness of joints under tension. It keeps explicit steps stable. Derivation:
//! docs/derivation.md.

use glam::{DMat3, Vec3};

use super::StepProblem;
use super::effective::InverseMass;
use super::rows::TurningRow;
use crate::constants::SWING_LIMIT;

/// Stiffness inertia of a body from one joint: the body, and the inertia.
pub(super) type StiffnessInertia = (u32, DMat3);

/// h² times the rotational stiffness of a body under a joint at the arm `r` that pulls with `impulse` in a substep of
/// `h` seconds: r·F about axes perpendicular to the arm where r·F is positive, otherwise 0. F is `impulse` / h.
fn stiffness_inertia(r: Vec3, impulse: Vec3, h: f32) -> DMat3 {
    let (r, impulse) = (r.as_dvec3(), impulse.as_dvec3());
    let tension = r.dot(impulse);
    if tension.is_nan() || tension <= 0.0 {
        return DMat3::ZERO;
    }
    let along = DMat3::from_cols(r * r.x, r * r.y, r * r.z) * r.length_squared().recip();
    (DMat3::IDENTITY - along) * (tension * f64::from(h))
}

/// Adds stiffness inertia to the bodies of joints that are solved directly, and the rows that turn the inertia of bodies
/// with joints. `joints` has the joints that take part, each with the length of its substeps (s), or 0 if it is swept.
/// `added` is memory that steps reuse.
pub(super) fn add_stiffness_inertia(
    joints: impl Iterator<Item = (usize, f32)>,
    added: &mut Vec<StiffnessInertia>,
    problem: &mut StepProblem,
) {
    for (i, h) in joints {
        let (row, impulse) = (&problem.joints[i], problem.joint_impulse(&problem.joint_impulses, i));
        for (body, arm, sign) in [(row.body_a, row.r_a, -1.0), (row.body_b, row.r_b, 1.0)] {
            // An inertia that is equal about all axes stays as it is.
            let is_world = body as usize >= problem.masses.len();
            if h == 0.0 && (is_world || problem.is_isotropic(&[body])) {
                continue;
            }
            added.push((body, stiffness_inertia(Vec3::from_array(arm), impulse * sign, h)));
        }
    }
    added.sort_by_key(|(body, _)| *body);
    for own in added.chunk_by(|a, b| a.0 == b.0) {
        let Some(row) = problem.masses.get_mut(own[0].0 as usize).filter(|row| row.inv_mass > 0.0) else {
            continue;
        };
        let sum = own.iter().fold(DMat3::ZERO, |sum, part| sum + part.1);
        let inverse = InverseMass::of(row).inertia.as_dmat3();
        let product = sum * inverse;
        let swing = product.x_axis.x + product.y_axis.y + product.z_axis.z;
        let share = SWING_LIMIT.recip() - swing.max(SWING_LIMIT).recip();
        let i = inverse * (DMat3::IDENTITY + product * share).inverse();
        let [xx, xy, xz] = i.x_axis.as_vec3().to_array();
        row.inv_inertia_x = [xx, xy, xz];
        row.inv_inertia_yz = [i.y_axis.y as f32, i.y_axis.z as f32, i.z_axis.z as f32];
        let (inv_inertia_x, inv_inertia_yz) = (row.inv_inertia_x, row.inv_inertia_yz);
        problem.turning.push(TurningRow { inv_inertia_x, body: own[0].0, inv_inertia_yz, pad: 0.0 });
    }
    added.clear();
}
