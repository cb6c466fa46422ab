//! The forces at the points that one body rests on.

use glam::DVec3;

use crate::constants::{MAX_ROUNDS, NO_FORCE, NO_RESISTANCE, POINT_STIFFNESS, UNBALANCED};

/// A force and its moment about a center of mass (N, N m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Wrench {
    pub force: DVec3,
    pub moment: DVec3,
}

impl Wrench {
    /// Adds a force that acts at an arm.
    pub fn add(&mut self, force: DVec3, arm: DVec3) {
        self.force += force;
        self.moment += arm.cross(force);
    }
}

/// A point that a body rests on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    /// From the center of mass of the body (m).
    pub arm: DVec3,
    /// The normal, toward the body, and two tangents.
    pub axes: [DVec3; 3],
    /// The effective mass of the point along the normal (kg).
    pub mass: f64,
    pub friction: f64,
    /// The first point of its manifold, as an index among the points of the body.
    pub manifold: u32,
    /// Whether the surfaces touch at the point.
    pub bears: bool,
}

impl Point {
    /// A force from its parts along the axes.
    pub fn force(&self, parts: &[f64; 3]) -> DVec3 {
        self.axes[0] * parts[0] + self.axes[1] * parts[1] + self.axes[2] * parts[2]
    }
}

type Six = [f64; 6];

fn six(a: DVec3, b: DVec3) -> Six {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

fn dot(x: &Six, y: &Six) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn largest(x: &Six) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// A spring at a point, with the motions of the body along the three axes of the point.
#[derive(Clone, Copy)]
struct Spring {
    along: [Six; 3],
    bears: bool,
    /// Stiffness of its friction (kg).
    slip: f64,
}

/// The forces on one body after another, in memory that is reused.
#[derive(Default)]
pub(super) struct Balance {
    springs: Vec<Spring>,
    /// For each manifold, at its first point: the mean motion of its points along the normal, and the sum of their
    /// masses.
    means: Vec<(Six, f64)>,
    forces: Vec<[f64; 3]>,
}

impl Balance {
    /// Forces along the axes of `points` that balance `load`, without pull and with friction within its limit; `None`
    /// if there are none.
    ///
    /// The body stands on springs: one beneath each manifold, which all its points press equally, a weaker one beneath
    /// each point, and weak ones along the tangents. Their forces are those with the least energy that balance the
    /// load. A point whose spring would pull is let go. Friction beyond its limit weakens its springs.
    pub fn of(&mut self, load: &Wrench, points: &[Point]) -> Option<&[[f64; 3]]> {
        let bearing = || points.iter().filter(|point| point.bears);
        // Moments divided by this length are forces.
        let unit = bearing().map(|point| point.arm.length()).reduce(f64::max)?;
        let wanted = six(-load.force, -load.moment / unit);
        self.springs.clear();
        self.springs.extend(points.iter().map(|point| Spring {
            along: point.axes.map(|axis| six(axis, point.arm.cross(axis) / unit)),
            bears: point.bears,
            slip: if point.bears && point.friction > 0.0 { POINT_STIFFNESS * point.mass } else { 0.0 },
        }));
        let is_within = (0..MAX_ROUNDS).any(|_| {
            self.press(points, &wanted);
            self.are_within_limits(points)
        });
        (is_within && self.are_balanced(&wanted)).then_some(&self.forces)
    }

    /// Computes the forces of the springs when they balance the load.
    fn press(&mut self, points: &[Point], wanted: &Six) {
        self.means.clear();
        self.means.resize(points.len(), ([0.0; 6], 0.0));
        let mut stiffness = [[0.0; 6]; 6];
        for (spring, point) in self.springs.iter().zip(points) {
            if spring.bears {
                let (mean, mass) = &mut self.means[point.manifold as usize];
                mean.iter_mut().zip(spring.along[0]).for_each(|(sum, x)| *sum += point.mass * x);
                *mass += point.mass;
                add_square(&mut stiffness, &spring.along[0], POINT_STIFFNESS * point.mass);
                add_square(&mut stiffness, &spring.along[1], spring.slip);
                add_square(&mut stiffness, &spring.along[2], spring.slip);
            }
        }
        for (mean, mass) in self.means.iter_mut().filter(|(_, mass)| *mass > 0.0) {
            mean.iter_mut().for_each(|x| *x /= *mass);
            add_square(&mut stiffness, mean, *mass);
        }
        let motion = solved(&stiffness, wanted);
        self.forces.clear();
        self.forces.extend(self.springs.iter().zip(points).map(|(spring, point)| {
            if !spring.bears {
                return [0.0; 3];
            }
            let pressed =
                dot(&self.means[point.manifold as usize].0, &motion) + POINT_STIFFNESS * dot(&spring.along[0], &motion);
            [
                point.mass * pressed,
                spring.slip * dot(&spring.along[1], &motion),
                spring.slip * dot(&spring.along[2], &motion),
            ]
        }));
    }

    /// Whether no point pulls and all friction is within its limit. If not, the springs at fault end or weaken.
    fn are_within_limits(&mut self, points: &[Point]) -> bool {
        let most = self.forces.iter().fold(0.0_f64, |most, force| most.max(force[0]));
        let mut are_within = true;
        for (spring, force) in self.springs.iter_mut().zip(&mut self.forces) {
            if force[0] < -NO_FORCE * most {
                spring.bears = false;
                are_within = false;
            }
            force[0] = force[0].max(0.0);
        }
        if !are_within {
            return false;
        }
        for ((spring, force), point) in self.springs.iter_mut().zip(&self.forces).zip(points) {
            let (slip, limit) = (libm::hypot(force[1], force[2]), point.friction * force[0]);
            if slip > (1.0 + UNBALANCED) * limit + NO_FORCE * most {
                spring.slip *= limit / slip;
                are_within = false;
            }
        }
        are_within
    }

    /// Whether the forces balance the load.
    fn are_balanced(&self, wanted: &Six) -> bool {
        let mut rest = *wanted;
        for (along, force) in self.springs.iter().zip(&self.forces).flat_map(|(s, f)| s.along.iter().zip(f)) {
            rest.iter_mut().zip(along).for_each(|(rest, x)| *rest -= force * x);
        }
        largest(&rest) <= UNBALANCED * largest(wanted)
    }
}

fn add_square(rows: &mut [Six; 6], x: &Six, factor: f64) {
    for (i, row) in rows.iter_mut().enumerate() {
        (0..=i).for_each(|j| row[j] += factor * x[i] * x[j]);
    }
}

/// The solution of a symmetric system. `rows` holds the lower triangle. The matrix is made definite, and the solution
/// is refined once.
fn solved(rows: &[Six; 6], wanted: &Six) -> Six {
    let largest = (0..6).fold(0.0, |most: f64, i| most.max(rows[i][i]));
    let mut factor = *rows;
    (0..6).for_each(|i| factor[i][i] += NO_RESISTANCE * largest);
    // L D Lᵀ in place.
    for j in 0..6 {
        for i in j..6 {
            factor[i][j] -= (0..j).map(|k| factor[i][k] * factor[j][k] * factor[k][k]).sum::<f64>();
            if i > j {
                factor[i][j] /= factor[j][j];
            }
        }
    }
    let mut x = [0.0; 6];
    for _ in 0..2 {
        let entry = |i: usize, j: usize| if i > j { rows[i][j] } else { rows[j][i] };
        let mut rest: Six = std::array::from_fn(|i| wanted[i] - (0..6).map(|j| entry(i, j) * x[j]).sum::<f64>());
        for i in 0..6 {
            rest[i] -= (0..i).map(|k| factor[i][k] * rest[k]).sum::<f64>();
        }
        (0..6).for_each(|i| rest[i] /= factor[i][i]);
        for i in (0..6).rev() {
            rest[i] -= (i + 1..6).map(|k| factor[k][i] * rest[k]).sum::<f64>();
        }
        x.iter_mut().zip(rest).for_each(|(x, change)| *x += change);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of one manifold at `x`, `z` under a center 1 m above, on a floor with a friction of 0.5.
    fn at(x: f64, z: f64) -> Point {
        Point {
            arm: DVec3::new(x, -1.0, z),
            axes: [DVec3::Y, DVec3::X, DVec3::NEG_Z],
            mass: 2.0,
            friction: 0.5,
            manifold: 0,
            bears: true,
        }
    }

    fn square() -> [Point; 4] {
        [at(1.0, 1.0), at(1.0, -1.0), at(-1.0, 1.0), at(-1.0, -1.0)]
    }

    fn forces(force: DVec3, moment: DVec3, points: &[Point]) -> Option<Vec<[f64; 3]>> {
        Balance::default().of(&Wrench { force, moment }, points).map(<[_]>::to_vec)
    }

    fn assert_balanced(force: DVec3, moment: DVec3, points: &[Point], found: &[[f64; 3]]) {
        let mut sum = Wrench { force, moment };
        points.iter().zip(found).for_each(|(point, parts)| sum.add(point.force(parts), point.arm));
        assert!(sum.force.length() < 1e-3 && sum.moment.length() < 1e-3, "{sum:?}");
        for (parts, point) in found.iter().zip(points) {
            assert!(parts[0] >= 0.0 && parts[1].hypot(parts[2]) <= point.friction * parts[0] + 1e-6, "{found:?}");
        }
    }

    #[test]
    fn four_corners_bear_a_quarter_each() {
        let found = forces(DVec3::NEG_Y * 40.0, DVec3::ZERO, &square()).expect("it stands");
        assert!(found.iter().all(|f| (f[0] - 10.0).abs() < 1e-6 && f[1].hypot(f[2]) < 1e-6), "{found:?}");
    }

    /// With the load over one corner, the opposite corner would pull.
    #[test]
    fn a_load_beside_the_middle_presses_that_side_and_beyond_the_edge_tips() {
        for (x, z, stands) in [(0.5, 0.0, true), (0.9, 0.0, true), (0.9, 0.8, true), (1.1, 0.0, false)] {
            let (force, moment) = (DVec3::NEG_Y * 40.0, DVec3::new(x, 0.0, z).cross(DVec3::NEG_Y * 40.0));
            let found = forces(force, moment, &square());
            assert_eq!(found.is_some(), stands, "{x}, {z}");
            if let Some(found) = found {
                assert_balanced(force, moment, &square(), &found);
                let [near, far] = [[0, 1], [2, 3]].map(|side| side.iter().map(|&k: &usize| found[k][0]).sum::<f64>());
                assert!((near / far - (1.0 + x) / (1.0 - x)).abs() < 0.01 * near / far, "{found:?}");
            }
        }
    }

    /// Friction of 0.5 holds on a slope of 0.4 rad, but not on a slope of 0.5 rad (tan 0.546).
    #[test]
    fn friction_holds_up_to_its_limit() {
        let low = square().map(|point| Point { arm: point.arm * DVec3::new(1.0, 0.2, 1.0), ..point });
        for (slope, stands) in [(0.4_f64, true), (0.5, false)] {
            let force = DVec3::new(slope.sin(), -slope.cos(), 0.0) * 40.0;
            let found = forces(force, DVec3::ZERO, &low);
            assert_eq!(found.is_some(), stands, "{slope}");
            if let Some(found) = found {
                assert_balanced(force, DVec3::ZERO, &low, &found);
            }
        }
    }

    /// Two manifolds beneath a beam. Each presses its points equally where this balances.
    #[test]
    fn the_points_of_a_manifold_bear_alike_where_they_can() {
        let points = [(2.5, 0), (1.5, 0), (-0.5, 2), (-1.5, 2)].map(|(x, manifold)| Point { manifold, ..at(x, 0.0) });
        let (force, moment) = (DVec3::NEG_Y * 40.0, DVec3::X.cross(DVec3::NEG_Y * 40.0));
        let found = forces(force, moment, &points).expect("it stands");
        assert_balanced(force, moment, &points, &found);
        // With springs beneath single points alone, the forces would be about 16, 13.3, 7 and 4 N.
        assert!(
            (found[0][0] / found[1][0] - 1.0).abs() < 0.01 && (found[2][0] / found[3][0] - 1.0).abs() < 0.01,
            "{found:?}"
        );
        assert!((found[0][0] / found[2][0] - 2.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn one_point_bears_what_lies_over_it_and_surfaces_apart_bear_nothing() {
        let under = Point { arm: DVec3::NEG_Y, ..at(0.0, 0.0) };
        let found = forces(DVec3::NEG_Y * 40.0, DVec3::ZERO, &[under]).expect("it stands");
        assert!((found[0][0] - 40.0).abs() < 1e-3, "{found:?}");
        assert_eq!(forces(DVec3::NEG_Y * 40.0, DVec3::ZERO, &[at(0.5, 0.0)]), None);
        assert_eq!(forces(DVec3::NEG_Y * 40.0, DVec3::ZERO, &square().map(|p| Point { bears: false, ..p })), None);
        assert_eq!(forces(DVec3::NEG_Y * 40.0, DVec3::ZERO, &[]), None);
    }
}
