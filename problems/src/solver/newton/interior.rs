//! Newton's method on the central path of a contact problem. û = W r + q + mu |u_t| n stays inside the dual of
//! Coulomb's cone, r stays inside the cone, and their product goes to zero (docs/derivation.md, section 10).
//!
//! It uses the predictor and corrector of Mehrotra (1992) with the scaling of Nesterov and Todd (1998). Acary, Armand,
//! Nguyen and Shpakovych (2024) solve the convex relaxation this way. Here the slip mu |u_t| and its derivative E are
//! part of the system, so that the limit is Coulomb's law itself.

use glam::{DMat3, DVec3};

use super::cone::{augmented, error};
use super::scaling::{Scaling, depth, longest, product, quotient};
use super::system::{Cone, System};

/// Largest share of the way to the boundary that a step takes.
const FRACTION: f64 = 0.95;
/// Smallest product of the depths of r and û at a contact, relative to the mean product.
const NEIGHBORHOOD: f64 = 1e-2;
/// Number of refinements of a solution. With one less, 4 of 10 problems end at 1e-8 to 3e-8 and not below.
const REFINEMENTS: usize = 3;
/// A shorter step counts as blocked.
const MIN_LENGTH: f64 = 1e-9;
/// Smallest target of a step, as a share of the product.
const MIN_CENTERING: f64 = 1e-8;

/// An iterate.
pub(super) struct Interior {
    /// Impulses, strictly inside their cones.
    pub r: Vec<DVec3>,
    /// T⁻¹ û, strictly inside the cone |z_t| <= z_n.
    z: Vec<DVec3>,
    /// T of each contact: (mu, 1, 1), or 1 without friction.
    scale: Vec<DVec3>,
    /// u of r.
    u: Vec<DVec3>,
    /// `e_vel` of r.
    pub error: f64,
    /// Whether the second-order correction is scaled by the length of the predicted step.
    careful: bool,
}

/// The terms of a step at each contact.
struct Point {
    scaling: Scaling,
    /// E in the coordinates of z.
    slope: DMat3,
    /// The difference between T⁻¹ û and z.
    gap: DVec3,
    /// S x = S⁻¹ z.
    middle: DVec3,
}

impl Interior {
    /// The starting point: every contact has the same normal impulse and the same separation speed, so all products are
    /// equal for any masses. A careful iteration takes more steps, and succeeds on some problems where others get
    /// blocked.
    pub fn new(system: &impl System, careful: bool) -> Self {
        let cones = system.cones();
        let mean = |of: fn(&Cone) -> f64| cones.iter().map(of).sum::<f64>() / cones.len() as f64;
        let (rho, speed) = (mean(|c| c.rho), mean(|c| c.q.length_squared()).sqrt());
        let scale: Vec<_> = cones.iter().map(|c| DVec3::new(if c.mu > 0.0 { c.mu } else { 1.0 }, 1.0, 1.0)).collect();
        let r = vec![DVec3::X * (rho * speed); cones.len()];
        let z = scale.iter().map(|t| DVec3::X * (speed / t.x)).collect();
        let mut start = Self { r, z, scale, u: Vec::new(), error: f64::INFINITY, careful };
        start.measure(system);
        start
    }

    fn measure(&mut self, system: &impl System) {
        self.u = responses(system, &self.r);
        self.u.iter_mut().zip(system.cones()).for_each(|(u, cone)| *u += cone.q);
        self.error = error(system.cones(), &self.r, self.u.iter().copied());
    }

    /// x = T r of a contact.
    fn x(&self, i: usize) -> DVec3 {
        self.scale[i] * self.r[i]
    }

    /// Mean product of r and û.
    fn mean_product(&self) -> f64 {
        (0..self.r.len()).map(|i| self.x(i).dot(self.z[i])).sum::<f64>() / self.r.len() as f64
    }

    fn point(&self, i: usize, cone: &Cone) -> Point {
        let (x, z) = (self.x(i), self.z[i]);
        let scaling = Scaling::new(x, z, cone.mu > 0.0);
        let (augmented, slope) = augmented(cone.mu, self.u[i]);
        // E and then T⁻¹.
        let slope = DMat3::from_diagonal(1.0 / self.scale[i]) * slope;
        Point { scaling, slope, gap: augmented / self.scale[i] - z, middle: scaling.apply(|e| e, x) }
    }

    /// One step towards the error `tolerance`. Returns `None` if the matrix is singular or the step is blocked.
    pub fn step(&mut self, system: &mut impl System, tolerance: f64) -> Option<()> {
        let points: Vec<_> = system.cones().iter().enumerate().map(|(i, cone)| self.point(i, cone)).collect();
        let d =
            |(p, &t): (&Point, &DVec3)| DMat3::from_diagonal(1.0 / t) * p.scaling.matrix(|e| 1.0 / (e * e)) * p.slope;
        system.factor(&points.iter().zip(&self.scale).map(d).collect::<Vec<_>>())?;
        let before = self.mean_product();

        let square = |p: &Point| -product(p.middle, p.middle);
        let predicted = self.direction(system, &points, points.iter().map(square));
        let length = self.longest(&predicted).min(1.0);
        let left = (self.moved(&predicted, length).mean_product() / before).clamp(0.0, 1.0);
        // Use no smaller target than the error requires: below it only rounding errors grow.
        let centering = left.powi(3).max(MIN_CENTERING).max((0.2 * tolerance / self.error).min(1.0));

        let trust = if self.careful { length } else { 1.0 };
        let corrected = points.iter().enumerate().map(|(i, p)| {
            let (dx, dz) = (self.scale[i] * predicted.0[i], predicted.1[i]);
            let second = product(p.scaling.apply(|e| e, dx), p.scaling.apply(|e| 1.0 / e, dz));
            square(p) + DVec3::X * (centering * before) - second * trust
        });
        let direction = self.direction(system, &points, corrected);
        let mut length = (FRACTION * self.longest(&direction)).min(1.0);
        let mut next = self.moved(&direction, length);
        while !next.is_central() {
            length *= 0.8;
            // The iteration also ends here on NaN.
            if length.is_nan() || length <= MIN_LENGTH {
                return None;
            }
            next = self.moved(&direction, length);
        }
        next.measure(system);
        *self = next;
        self.error.is_finite().then_some(())
    }

    /// Whether no contact is much nearer to the boundary than the others.
    fn is_central(&self) -> bool {
        let least = NEIGHBORHOOD * self.mean_product();
        (0..self.r.len()).all(|i| depth(self.x(i)) * depth(self.z[i]) >= least)
    }

    fn moved(&self, (dr, dz): &(Vec<DVec3>, Vec<DVec3>), length: f64) -> Self {
        let moved = |x: &[DVec3], d: &[DVec3]| x.iter().zip(d).map(|(&x, &d)| x + d * length).collect();
        Self {
            r: moved(&self.r, dr),
            z: moved(&self.z, dz),
            scale: self.scale.clone(),
            u: Vec::new(),
            error: f64::INFINITY,
            careful: self.careful,
        }
    }

    fn longest(&self, (dr, dz): &(Vec<DVec3>, Vec<DVec3>)) -> f64 {
        let of = |i: usize| longest(self.x(i), self.scale[i] * dr[i]).min(longest(self.z[i], dz[i]));
        (0..self.r.len()).map(of).fold(f64::INFINITY, f64::min)
    }

    /// dr and dz with S dx + S⁻¹ dz = middle \ `products` and dz = E W dr + gap.
    fn direction(
        &self,
        system: &impl System,
        points: &[Point],
        products: impl Iterator<Item = DVec3>,
    ) -> (Vec<DVec3>, Vec<DVec3>) {
        let aims = points.iter().zip(products).map(|(p, product)| p.scaling.apply(|e| e, quotient(product, p.middle)));
        let aims: Vec<_> = aims.collect();
        // (S² T + E W) dr = aim - gap, with iterative refinement.
        let right: Vec<_> = aims.iter().zip(points).map(|(&aim, p)| aim - p.gap).collect();
        let (mut dr, mut left) = (vec![DVec3::ZERO; right.len()], right.clone());
        for pass in 0..=REFINEMENTS {
            let impulse = |i: usize, c: DVec3| points[i].scaling.apply(|e| 1.0 / (e * e), c) / self.scale[i];
            let b: Vec<_> = left.iter().enumerate().map(|(i, &c)| impulse(i, c)).collect();
            let response = system.solve(&b);
            for (i, dr) in dr.iter_mut().enumerate() {
                *dr += impulse(i, left[i] - points[i].slope * response[i]);
            }
            if pass == REFINEMENTS {
                break;
            }
            let response = responses(system, &dr);
            for (i, left) in left.iter_mut().enumerate() {
                let own = points[i].scaling.apply(|e| e * e, self.scale[i] * dr[i]);
                *left = right[i] - own - points[i].slope * response[i];
            }
        }
        let dz = |(i, p): (usize, &Point)| aims[i] - p.scaling.apply(|e| e * e, self.scale[i] * dr[i]);
        let dz = points.iter().enumerate().map(dz).collect();
        (dr, dz)
    }
}

/// W r.
fn responses(system: &impl System, r: &[DVec3]) -> Vec<DVec3> {
    let carried = system.carried(r);
    (0..r.len()).map(|i| system.response(i, r, &carried)).collect()
}
