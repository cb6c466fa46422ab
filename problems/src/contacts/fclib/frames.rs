//! Computes arms in world axes from the rows of a Jacobian in a body's own axes.
//!
//! A contact at the arm r with the directions D (rows d_i) has the linear rows D and the angular rows Rᵀ(r x d_i). R is
//! the rotation of the body, which the file does not contain. With the angular rows B, K = D⁻¹ B is -[r]x R: Kᵀ takes r
//! to zero, and |r|² = |K|²/2. For each sign of r there is one rotation, which Kᵀx = Rᵀ(r x x) determines on the plane
//! across r. The right sign is the one for which all contacts of a body have the same rotation.

use glam::{DMat3, DQuat, DVec3};

/// Tolerance between the rows and those of arms, relative to the largest. Files that were written in f64 reach 1e-13.
const TOLERANCE: f64 = 1e-6;

/// A contact seen from one of its bodies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lever {
    /// K.
    pub map: DMat3,
    /// The normal, away from the body.
    pub outward: DVec3,
}

/// The rotation of a body from its own axes to the world's, from all of its contacts. Returns `None` if the contacts do
/// not agree.
///
/// If all contacts lie on one line through the center, either sign fits. Arms are then assumed to point out of the
/// body.
pub(super) fn rotation(levers: &[Lever]) -> Option<DMat3> {
    let longest = levers.iter().max_by(|a, b| size(a.map).total_cmp(&size(b.map)));
    let Some(longest) = longest.filter(|l| size(l.map) > 0.0) else { return Some(DMat3::IDENTITY) };
    let [first, second] = candidates(longest.map);
    let scale = size(longest.map);
    let misfit = |r: DMat3| {
        let worst = |worst: f64, l: &Lever| worst.max(size(l.map * r.transpose() + r * l.map.transpose()));
        levers.iter().fold(0.0, worst) / scale
    };
    let outside = |r: DMat3| levers.iter().map(|l| arm(l.map, r).dot(l.outward)).sum::<f64>();
    let fits = |r: DMat3| misfit(r) < TOLERANCE;
    match (fits(first), fits(second)) {
        (true, true) => Some(if outside(first) >= outside(second) { first } else { second }),
        (true, false) => Some(first),
        (false, true) => Some(second),
        (false, false) => None,
    }
}

/// The arm of a contact in world axes (m), with the rotation of its body: K Rᵀ = -[r]x.
pub(super) fn arm(map: DMat3, rotation: DMat3) -> DVec3 {
    let cross = map * rotation.transpose();
    let half = |a: f64, b: f64| 0.5 * (a - b);
    DVec3::new(
        half(cross.z_axis.y, cross.y_axis.z),
        half(cross.x_axis.z, cross.z_axis.x),
        half(cross.y_axis.x, cross.x_axis.y),
    )
}

/// The two rotations that one contact allows, by the sign of its arm.
fn candidates(map: DMat3) -> [DMat3; 2] {
    // Any two columns are perpendicular to r. Use the two with the largest cross product.
    let columns = [map.x_axis, map.y_axis, map.z_axis];
    let across = [(0, 1), (1, 2), (2, 0)].map(|(i, j): (usize, usize)| columns[i].cross(columns[j]));
    let along = across.into_iter().max_by(|a, b| a.length().total_cmp(&b.length())).expect("three of them");
    let length = size(map) / 2.0_f64.sqrt();
    [along, -along].map(|along| {
        let r = along.normalize();
        let e_1 = r.any_orthonormal_vector();
        let e_2 = r.cross(e_1);
        // Rᵀ of the three axes.
        let (own_1, own_2) = (map.transpose() * e_2 / -length, map.transpose() * e_1 / length);
        let transposed = DMat3::from_cols(own_1, own_2, own_1.cross(own_2)) * DMat3::from_cols(e_1, e_2, r).transpose();
        DMat3::from_quat(DQuat::from_mat3(&transposed.transpose()).normalize())
    })
}

fn size(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact at arm `r` of a body with rotation `turn`.
    fn lever(r: DVec3, turn: DMat3, outward: DVec3) -> Lever {
        let cross = DMat3::from_cols(DVec3::X.cross(r), DVec3::Y.cross(r), DVec3::Z.cross(r));
        // [r]x x = r x x, column by column.
        Lever { map: cross * turn, outward }
    }

    fn far(a: DMat3, b: DMat3) -> f64 {
        size(a - b)
    }

    const ARMS: [DVec3; 3] = [DVec3::new(0.3, -0.5, 0.2), DVec3::new(-0.1, -0.5, 0.7), DVec3::new(1e-3, -0.4, -0.9)];

    #[test]
    fn the_rotation_of_a_body_is_found_from_its_contacts_and_so_are_their_arms() {
        for angle in [0.0, 0.1, 1.5, 3.1, std::f64::consts::PI, 5.0] {
            let turn = DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), angle);
            let levers = ARMS.map(|r| lever(r, turn, DVec3::NEG_Y));
            let found = rotation(&levers).expect("one rotation");
            assert!(far(found, turn) < 1e-13, "{found} for {turn}");
            for (lever, r) in levers.iter().zip(ARMS) {
                assert!(arm(lever.map, found).distance(r) < 1e-13);
            }
        }
    }

    #[test]
    fn an_arm_that_fits_either_way_points_out_of_the_body() {
        let turn = DMat3::from_axis_angle(DVec3::Z, 0.4);
        for outward in [DVec3::NEG_Y, DVec3::Y] {
            let lever = lever(ARMS[0], turn, outward);
            let found = rotation(&[lever]).expect("a rotation");
            let r = arm(lever.map, found);
            assert!(r.dot(outward) > 0.0 && (r.length() - ARMS[0].length()).abs() < 1e-14);
            // Either way the rows are the same: only the product matters.
            let turned = super::tests::lever(r, found, outward);
            assert!(far(turned.map, lever.map) < 1e-14);
        }
    }

    #[test]
    fn rows_that_no_arm_has_are_refused() {
        let turn = DMat3::from_axis_angle(DVec3::Z, 0.4);
        let mut levers = ARMS.map(|r| lever(r, turn, DVec3::NEG_Y));
        levers[1].map.x_axis.y += 1e-4;
        assert_eq!(rotation(&levers), None);
        let other = DMat3::from_axis_angle(DVec3::Z, 0.5);
        assert_eq!(rotation(&[levers[0], lever(ARMS[2], other, DVec3::NEG_Y)]), None);
        assert_eq!(rotation(&[Lever { map: DMat3::ZERO, outward: DVec3::Y }]), Some(DMat3::IDENTITY));
    }
}
