//! The surface of a shape as triangles for pictures, and the extent of a shape.

use glam::{Quat, Vec3};
use parry3d::shape::TypedShape;

use super::body::Collider;
use super::shape::{Shape, placed, pose};

/// Vertices (m) and triangles. Triangles are counter-clockwise seen from outside.
pub type Triangles = (Vec<Vec3>, Vec<[u32; 3]>);

/// Segments of a circle.
const SEGMENTS: u32 = 32;

impl Shape {
    /// The surface in the shape's own frame. A half-space gives a square of half side 1 m around its origin.
    pub fn triangles(&self) -> Triangles {
        match self.0.as_typed_shape() {
            TypedShape::Ball(s) => s.to_trimesh(SEGMENTS, SEGMENTS / 2),
            TypedShape::Cuboid(s) => s.to_trimesh(),
            TypedShape::Capsule(s) => s.to_trimesh(SEGMENTS, SEGMENTS / 4),
            TypedShape::Cylinder(s) => s.to_trimesh(SEGMENTS),
            TypedShape::Cone(s) => s.to_trimesh(SEGMENTS),
            TypedShape::ConvexPolyhedron(s) => s.to_trimesh(),
            TypedShape::TriMesh(s) => (s.vertices().to_vec(), s.indices().to_vec()),
            TypedShape::HeightField(s) => s.to_trimesh(),
            TypedShape::HalfSpace(s) => {
                let (u, v) = s.normal.any_orthonormal_pair();
                (vec![-u - v, u - v, u + v, v - u], vec![[0, 1, 2], [0, 2, 3]])
            }
            // `Shape` has no other kinds.
            _ => (Vec::new(), Vec::new()),
        }
    }

    /// Volume (m³); 0 for a shape that encloses no volume.
    pub fn volume(&self) -> f32 {
        if self.has_volume() { self.0.mass_properties(1.0).mass() } else { 0.0 }
    }

    /// Outward normal of a half-space, or `None` for another shape.
    pub fn as_half_space(&self) -> Option<Vec3> {
        self.0.as_halfspace().map(|s| s.normal)
    }

    /// Radius of a ball (m), or `None` for another shape.
    pub fn as_ball(&self) -> Option<f32> {
        self.0.as_ball().map(|s| s.radius)
    }

    /// Whether two shapes share one geometry, like clones.
    pub fn is_same(&self, other: &Self) -> bool {
        std::ptr::addr_eq(&*self.0, &*other.0)
    }
}

impl Collider {
    /// Lower and upper corner of the collider's axis-aligned bounding box in the world, on a body at this pose (m).
    pub fn bounds(&self, position: Vec3, rotation: Quat) -> (Vec3, Vec3) {
        let aabb = self.shape.0.compute_aabb(&placed(pose(position, rotation), pose(self.position, self.rotation)));
        (aabb.mins, aabb.maxs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume inside triangles that face outward (m³).
    fn volume((vertices, triangles): &Triangles) -> f32 {
        let corner = |i: u32| vertices[i as usize];
        triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
    }

    #[test]
    fn surfaces_enclose_the_volume_of_their_shape() {
        let hull: Vec<Vec3> = (0..8).map(|k| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32)).collect();
        for shape in [
            Shape::ball(0.5),
            Shape::cuboid(0.5, 0.4, 0.3),
            Shape::capsule(0.5, 0.3),
            Shape::cylinder(0.5, 0.4),
            Shape::cone(0.5, 0.5),
            Shape::convex_hull(&hull).expect("a cube"),
        ] {
            let (enclosed, true_volume) = (volume(&shape.triangles()), shape.volume());
            // Facets of a circle of 32 segments lie inside of it.
            assert!((enclosed / true_volume - 1.0).abs() < 0.03, "{shape:?}: {enclosed} of {true_volume} m³");
        }
    }

    #[test]
    fn the_square_of_a_half_space_looks_out_of_it() {
        let (vertices, triangles) = Shape::half_space(Vec3::Y).triangles();
        for t in triangles {
            let [a, b, c] = t.map(|i| vertices[i as usize]);
            assert!((b - a).cross(c - a).y > 0.0);
        }
    }
}
