//! The condition of one contact: û = u + mu |u_t| n and r are complementary in the dual of Coulomb's cone and in the
//! cone.

use glam::{DMat3, DVec2, DVec3};

use super::system::Cone;
use crate::residuals::natural_map;

/// u + mu |u_t| n (De Saxcé and Feng 1998), and a derivative by u. Without slip there are several, and this is one.
pub(super) fn augmented(mu: f64, u: DVec3) -> (DVec3, DMat3) {
    let tangent = DVec2::new(u.y, u.z);
    let slip = tangent.length();
    let d = if slip > 0.0 { tangent * (mu / slip) } else { DVec2::ZERO };
    let columns = [DVec3::X, DVec3::new(d.x, 1.0, 0.0), DVec3::new(d.y, 0.0, 1.0)];
    (u + DVec3::X * (mu * slip), DMat3::from_cols(columns[0], columns[1], columns[2]))
}

/// `e_vel` of impulses `r` and their velocities `u`.
pub(super) fn error(cones: &[Cone], r: &[DVec3], u: impl Iterator<Item = DVec3>) -> f64 {
    let (mut left, mut free) = (0.0, 0.0);
    for ((cone, &r), u) in cones.iter().zip(r).zip(u) {
        left += (natural_map(cone.mu, r, u, cone.rho) / cone.rho).length_squared();
        free += cone.q.length_squared();
    }
    if left == 0.0 { 0.0 } else { (left / free).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_is_that_of_finite_differences() {
        let (mu, h) = (0.6, 1e-6);
        for u in [DVec3::new(2.0, 0.3, -0.5), DVec3::new(-0.4, 1.2, 0.7)] {
            for (k, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                let slope = (augmented(mu, u + axis * h).0 - augmented(mu, u - axis * h).0) / (2.0 * h);
                assert!(slope.distance(augmented(mu, u).1.col(k)) < 1e-8, "{u}, column {k}: {slope}");
            }
        }
    }
}
