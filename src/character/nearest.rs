//! The convex problem of a character: the vector nearest to a wanted one within half-spaces.
//!
//! Half-spaces are added one after another. As long as the nearest vector so far is within the next one, it stays.
//! Otherwise the new nearest vector lies on the new plane, which leaves the same problem in the plane, and then on a
//! line (R. Seidel, "Small-dimensional linear programming and convex hulls made easy", 1991). The result is exact.

use glam::DVec3;

/// The half-space of all x with `normal` · x >= `least`. The normal has unit length.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub normal: DVec3,
    pub least: f64,
}

/// Relative error of a distance from a plane.
const ROUNDING: f64 = 1e-12;
/// Sine of the angle between planes up to which they are parallel.
const PARALLEL: f64 = 1e-6;

impl HalfSpace {
    /// Distance of a vector from the half-space, positive outside of it.
    fn beyond(&self, x: DVec3) -> f64 {
        self.least - self.normal.dot(x)
    }

    fn holds(&self, x: DVec3) -> bool {
        self.beyond(x) <= ROUNDING * (self.least.abs() + x.length())
    }
}

/// The vector within all half-spaces that is nearest to `wanted`, or `None` if they have no vector in common.
pub(super) fn nearest(wanted: DVec3, spaces: &[HalfSpace]) -> Option<DVec3> {
    spaces.iter().enumerate().try_fold(wanted, |x, (i, space)| {
        if space.holds(x) { Some(x) } else { nearest_on_plane(wanted, space, &spaces[..i]) }
    })
}

/// The same on the plane of one more half-space.
fn nearest_on_plane(wanted: DVec3, plane: &HalfSpace, spaces: &[HalfSpace]) -> Option<DVec3> {
    let on_plane = wanted + plane.beyond(wanted) * plane.normal;
    spaces.iter().enumerate().try_fold(on_plane, |x, (i, space)| {
        if space.holds(x) { Some(x) } else { nearest_on_line(on_plane, [plane, space], &spaces[..i]) }
    })
}

/// The same on the line where two planes meet. `on_plane` lies on the first of them.
fn nearest_on_line(on_plane: DVec3, [plane, other]: [&HalfSpace; 2], spaces: &[HalfSpace]) -> Option<DVec3> {
    let along = plane.normal.cross(other.normal);
    let sine = along.length();
    if sine < PARALLEL {
        // Of two parallel planes with equal normals, the later one lies further in. With opposite normals, a vector
        // outside of the earlier half-space is in neither.
        return (plane.normal.dot(other.normal) > 0.0).then_some(on_plane);
    }
    let along = along / sine;
    // Within the first plane, the second one is `sine` times as steep.
    let across = along.cross(plane.normal);
    let start = on_plane + other.beyond(on_plane) / other.normal.dot(across) * across;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for space in spaces {
        let (slope, beyond) = (space.normal.dot(along), space.beyond(start));
        if slope.abs() < PARALLEL {
            if !space.holds(start) && beyond > PARALLEL * (start.length() + space.least.abs()) {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(beyond / slope);
        } else {
            high = high.min(beyond / slope);
        }
    }
    (low <= high + ROUNDING * (low.abs() + high.abs())).then(|| start + 0.0_f64.max(low).min(high) * along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Projected sequential impulses on the same problem.
    fn swept(wanted: DVec3, spaces: &[HalfSpace]) -> DVec3 {
        let (mut x, mut pushes) = (wanted, vec![0.0; spaces.len()]);
        for _ in 0..20_000 {
            for (space, push) in spaces.iter().zip(&mut pushes) {
                let more = space.beyond(x).max(-*push);
                *push += more;
                x += more * space.normal;
            }
        }
        x
    }

    #[test]
    fn the_nearest_vector_is_that_of_sequential_impulses() {
        let mut random = SplitMix64::new(5);
        let mut vector = || DVec3::new(random.symmetric(), random.symmetric(), random.symmetric());
        let (mut held, mut corners) = (0, 0);
        for case in 0..400 {
            let spaces: Vec<HalfSpace> = (0..1 + case % 9)
                .map(|_| HalfSpace { normal: vector().normalize(), least: -0.3 * vector().x.abs() })
                .collect();
            let wanted = 2.0 * vector();
            let found = nearest(wanted, &spaces).expect("zero is within all of them");
            let worst = spaces.iter().map(|space| space.beyond(found)).fold(f64::NEG_INFINITY, f64::max);
            assert!(worst < 1e-9, "case {case}: {worst} m outside");
            let expected = swept(wanted, &spaces);
            assert!(found.distance(expected) < 1e-4, "case {case}: {found}, but {expected}");
            let on = spaces.iter().filter(|space| space.beyond(found).abs() < 1e-9).count();
            held += usize::from(on > 0);
            corners += usize::from(on >= 3);
        }
        assert!(held > 200 && corners > 50, "{held} held, {corners} in corners");
    }

    #[test]
    fn opposite_half_spaces_have_no_vector_in_common() {
        let space = |normal: DVec3, least: f64| HalfSpace { normal, least };
        assert_eq!(nearest(DVec3::ZERO, &[space(DVec3::X, 0.1), space(-DVec3::X, 0.1)]), None);
        let tilted = DVec3::new(1.0, 1.0, 0.0).normalize();
        let wedge = [space(DVec3::X, 0.0), space(-DVec3::X, 0.0), space(tilted, 1.0)];
        let top = nearest(DVec3::ZERO, &wedge).expect("a vector");
        assert!(top.distance(DVec3::Y * 2.0_f64.sqrt()) < 1e-9, "{top}");
    }
}
