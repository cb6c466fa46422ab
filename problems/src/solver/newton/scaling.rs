//! The cone of a contact for an interior-point method: |x_t| <= x_n, with products and scalings.
//!
//! Let T = diag(mu, 1, 1), x = T r and z = T⁻¹ û. If r and û solve a contact problem, x and z are both in this cone.
//! Without friction only the normal counts, and T is 1.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DMat3, DVec3};

/// x o y = (x·y, x_n y_t + y_n x_t): this product is zero if x and y are complementary.
pub(super) fn product(x: DVec3, y: DVec3) -> DVec3 {
    DVec3::new(x.dot(y), x.x * y.y + y.x * x.y, x.x * y.z + y.x * x.z)
}

/// The y with x o y = p.
pub(super) fn quotient(p: DVec3, x: DVec3) -> DVec3 {
    let normal = (x.x * p.x - x.y * p.y - x.z * p.z) / (x.x * x.x - x.y * x.y - x.z * x.z);
    DVec3::new(normal, (p.y - normal * x.y) / x.x, (p.z - normal * x.z) / x.x)
}

/// sqrt(x_n² - |x_t|²): 0 on the boundary.
pub(super) fn depth(x: DVec3) -> f64 {
    let length = x.y.hypot(x.z);
    ((x.x - length) * (x.x + length)).max(0.0).sqrt()
}

/// The largest a for which x + a d is in the cone, for an x inside.
pub(super) fn longest(x: DVec3, d: DVec3) -> f64 {
    let form = |x: DVec3, y: DVec3| x.x * y.x - x.y * y.y - x.z * y.z;
    let (a, b, c) = (form(d, d), form(x, d), form(x, x));
    let root = b * b - a * c;
    let mut largest = if d.x < 0.0 { -x.x / d.x } else { f64::INFINITY };
    if root >= 0.0 {
        let q = -(b + root.sqrt().copysign(b));
        largest = [q / a, c / q].into_iter().filter(|&x| x > 0.0).fold(largest, f64::min);
    }
    largest
}

/// The symmetric matrix S with S⁻¹ z = S x (Nesterov and Todd 1998), stored by eigenvectors: in a sum of matrices the
/// small eigenvalues would be lost beside the large ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scaling {
    vectors: [DVec3; 3],
    /// Eigenvalues of S.
    values: [f64; 3],
    /// Number of relevant eigenvalues: one without friction.
    count: usize,
}

impl Scaling {
    /// The scaling of an x and a z inside the cone.
    pub fn new(x: DVec3, z: DVec3, slides: bool) -> Self {
        if !slides {
            return Self { vectors: [DVec3::X, DVec3::Y, DVec3::Z], values: [(z.x / x.x).sqrt(), 0.0, 0.0], count: 1 };
        }
        let (d_x, d_z) = (depth(x), depth(z));
        let (x, z) = (x / d_x, z / d_z);
        let half = 1.0 / (2.0 * (1.0 + x.dot(z))).sqrt();
        let tangent = [(z.y - x.y) * half, (z.z - x.z) * half];
        let length = tangent[0].hypot(tangent[1]);
        let d = if length > 0.0 { [tangent[0] / length, tangent[1] / length] } else { [1.0, 0.0] };
        let (size, stretch) = ((d_z / d_x).sqrt(), length.hypot(1.0) + length);
        let along = |sign: f64| DVec3::new(1.0, sign * d[0], sign * d[1]) * FRAC_1_SQRT_2;
        Self {
            vectors: [along(1.0), along(-1.0), DVec3::new(0.0, -d[1], d[0])],
            values: [size * stretch, size / stretch, size],
            count: 3,
        }
    }

    /// f(S) x.
    pub fn apply(&self, f: impl Fn(f64) -> f64, x: DVec3) -> DVec3 {
        (0..self.count).map(|k| self.vectors[k] * (f(self.values[k]) * self.vectors[k].dot(x))).sum()
    }

    /// f(S).
    pub fn matrix(&self, f: impl Fn(f64) -> f64) -> DMat3 {
        DMat3::from_cols(self.apply(&f, DVec3::X), self.apply(&f, DVec3::Y), self.apply(&f, DVec3::Z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIRS: [(DVec3, DVec3); 3] = [
        (DVec3::new(1.0, 0.3, -0.2), DVec3::new(2.0, -1.5, 0.4)),
        (DVec3::new(1e-3, 0.99e-3, 0.0), DVec3::new(5.0, -4.9, 0.1)),
        (DVec3::X, DVec3::new(3.0, 0.0, 0.0)),
    ];

    #[test]
    fn a_scaling_makes_both_sides_one() {
        for (x, z) in PAIRS {
            let s = Scaling::new(x, z, true);
            let (one, other) = (s.apply(|e| e, x), s.apply(|e| 1.0 / e, z));
            assert!(one.distance(other) < 1e-12 * one.length(), "{one} and {other}");
            assert!((s.matrix(|e| e * e) * x).distance(z) < 1e-12 * z.length());
        }
        let flat = Scaling::new(DVec3::X * 2.0, DVec3::X * 8.0, false);
        assert_eq!(flat.apply(|e| e * e, DVec3::new(2.0, 5.0, 5.0)), DVec3::X * 8.0);
    }

    #[test]
    fn a_quotient_undoes_a_product() {
        for (x, z) in PAIRS {
            assert!(quotient(product(x, z), x).distance(z) < 1e-10 * z.length());
        }
    }

    #[test]
    fn the_longest_step_ends_on_the_mantle() {
        let x = DVec3::new(2.0, 0.5, -0.5);
        for d in [DVec3::new(-1.0, 0.2, 0.1), DVec3::new(0.3, 2.0, -1.0), DVec3::new(-1.0, -0.25, 0.25), DVec3::Y] {
            let a = longest(x, d);
            assert!(depth(x + d * a) < 1e-7 && depth(x + d * (0.999 * a)) > 0.0, "{d}: {a}");
        }
        assert_eq!(longest(x, DVec3::new(2.0, 1.0, 0.5)), f64::INFINITY);
    }
}
