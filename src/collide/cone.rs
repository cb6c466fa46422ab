//! Cones of normals.

use glam::Vec3;
use parry3d::query::details::NormalConstraints;
use parry3d::shape::TrianglePseudoNormals;

/// Rounding error up to which a direction counts as inside the cone.
const ROUNDING: f32 = 1e-6;
/// Cosine of the angle from which a direction counts as perpendicular to a normal.
const ACROSS: f32 = 1e-3;

/// The unit vector nearest to `d` in the cone of some directions. If all directions are perpendicular to `d`, it is one
/// of them. Returns `None` without directions. The directions have unit length and lie in one half-space.
pub(super) fn nearest(directions: &[Vec3], d: Vec3) -> Option<Vec3> {
    let mut best = *directions.iter().max_by(|f, g| f.dot(d).total_cmp(&g.dot(d)))?;
    for (i, &f) in directions.iter().enumerate() {
        for (j, &g) in directions[..i].iter().enumerate() {
            let (both, with_f, with_g) = (f.dot(g), d.dot(f), d.dot(g));
            let (of_f, of_g) = (with_f - both * with_g, with_g - both * with_f);
            if of_f > 0.0 && of_g > 0.0 {
                let between = (of_f * f + of_g * g).normalize();
                best = if between.dot(d) > best.dot(d) { between } else { best };
            }
            let is_inside = |h: &Vec3| {
                let volume = f.dot(g.cross(*h));
                let shares = [d.dot(g.cross(*h)), d.dot(h.cross(f)), d.dot(f.cross(g))];
                volume.abs() > ROUNDING && shares.into_iter().all(|share| share * volume.signum() >= -ROUNDING)
            };
            if directions[..j].iter().any(is_inside) {
                return Some(d);
            }
        }
    }
    Some(best)
}

/// The contact normals that a mesh triangle allows: its own normal, those of the adjacent triangles, and all between.
/// Parry also accepts a direction on the wrong side, if its angle to the triangle's normal is no larger than that of a
/// neighbor's normal.
pub(super) struct FacetCone {
    face: Vec3,
    directions: [Vec3; 4],
}

impl FacetCone {
    pub fn new(TrianglePseudoNormals { face, edges, .. }: &TrianglePseudoNormals) -> Self {
        let [a, b, c] = edges.map(|edge| 2.0 * face.dot(edge) * edge - face);
        Self { face: *face, directions: [*face, a, b, c] }
    }

    /// Whether a direction points out of the front of the triangle, or along its plane.
    pub fn is_in_front(&self, d: Vec3) -> bool {
        d.dot(self.face) >= -ROUNDING
    }

    /// Whether the cone can be opened to a direction: one in front, other than the normal of the triangle.
    pub fn opens(&self, d: Vec3) -> bool {
        self.is_in_front(d) && !Self::is_same(self.face, d)
    }

    /// Whether two directions are equal except for rounding.
    pub fn is_same(d: Vec3, e: Vec3) -> bool {
        d.dot(e) > 1.0 - ROUNDING
    }

    /// The direction nearest to `d` in the cone and some more directions, which are added to the list.
    pub fn nearest(&self, more: &mut Vec<Vec3>, d: Vec3) -> Vec3 {
        more.extend(self.directions);
        let normal = self.or_face(more, d);
        // Rounding alone must not turn the direction of a distance.
        if Self::is_same(normal, d) { d } else { normal }
    }

    fn or_face(&self, directions: &[Vec3], d: Vec3) -> Vec3 {
        // Among normals that are all perpendicular to the direction, rounding alone would choose.
        nearest(directions, d).filter(|normal| normal.dot(d) > ACROSS).unwrap_or(self.face)
    }
}

impl NormalConstraints for FacetCone {
    fn project_local_normal_mut(&self, d: &mut Vec3) -> bool {
        let is_in_front = d.dot(self.face) >= 0.0;
        *d = self.or_face(&self.directions, *d);
        is_in_front
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_direction_of_a_cone_is_inside_on_a_side_or_on_an_edge() {
        let axes = Vec3::AXES;
        let inside = Vec3::new(0.2, 0.5, 0.3).normalize();
        assert_eq!(nearest(&axes, inside), Some(inside));
        let beside = nearest(&axes, Vec3::new(0.6, 0.8, -3.0)).expect("a direction");
        assert!(beside.distance(Vec3::new(0.6, 0.8, 0.0)) < 1e-6, "{beside}");
        assert_eq!(nearest(&axes, Vec3::new(1.0, -0.1, -0.2)), Some(Vec3::X));
        assert_eq!(nearest(&[Vec3::Y], Vec3::NEG_X), Some(Vec3::Y));
        assert_eq!(nearest(&[], Vec3::X), None);
    }

    /// At a steep neighbor the normal points sideways. Other edges have no such normal: a direction along the triangle
    /// is turned up.
    #[test]
    fn an_edge_aside_lets_no_direction_along_the_triangle_pass() {
        let edges = [Vec3::Y, Vec3::new(0.0, 1.0, -1.0).normalize(), Vec3::Y];
        let cone = FacetCone::new(&TrianglePseudoNormals { face: Vec3::Y, edges, two_sided: false });
        for (d, expected) in [
            (Vec3::NEG_X, Vec3::Y),
            (Vec3::new(-0.6, 0.8, 0.0), Vec3::Y),
            (Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.0, 0.6, -0.8)),
            (Vec3::new(0.0, 0.6, 0.8), Vec3::Y),
        ] {
            let mut turned = d;
            assert!(cone.project_local_normal_mut(&mut turned) && turned.distance(expected) < 1e-5, "{d}: {turned}");
        }
    }
}
