//! Free edges: edges of a mesh or height field with one triangle only.
//!
//! A body that goes over a free edge touches it with all normals between that of the triangle and the outward direction
//! in the plane of the triangle. But in a terrain of tiles, each tile ends at a free edge, and others go on from there.
//! Bodies must not catch on such an edge. Therefore the normals depend on the place of the contact: this module tells
//! at which points of an edge nothing goes on.

use glam::Vec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use parry3d::query::PointQuery;
use parry3d::shape::{Shape, Triangle, TrianglePseudoNormals};

use super::cone::FacetCone;
use super::solid::{EXACT, Solid};

/// Length over which a shape is followed from an edge, in flush distances. It goes on if it lies within 60 degrees of
/// the plane of the triangle: the projection of this length onto it then reaches one flush distance ahead.
const AHEAD: f32 = 4.0;

/// The shapes beside a mesh or height field.
pub(super) struct Beside<'a> {
    /// Distance up to which shapes lie flush (m).
    pub around: f32,
    /// Whether another shape lies flush with the mesh at a point, and goes on from there in a direction. Adds the
    /// normals of its triangles there. All are in the frame of the mesh.
    pub goes_on: &'a mut dyn FnMut([Vec3; 2], &mut Vec<Vec3>) -> bool,
}

/// Reusable memory.
#[derive(Default)]
pub(super) struct RimScratch {
    directions: Vec<Vec3>,
    /// Outward directions of free edges at which something goes on.
    covered: Vec<Vec3>,
}

/// A triangle of a mesh or height field.
#[derive(Clone, Copy)]
pub(super) struct Facet<'a> {
    pub composite: &'a dyn Shape,
    pub number: u32,
}

impl Facet<'_> {
    /// The normals of the triangle and of its neighbors, as if something went on in its plane from its free edges.
    /// Returns `None` for a triangle with two sides.
    pub fn cone(self) -> Option<TrianglePseudoNormals> {
        if let Some(field) = self.composite.as_heightfield() {
            let mut cone = field.triangle_normal_constraints(self.number)?;
            // Parry lists the neighbors in the order of rows, diagonal and columns.
            let [ab, bc, ca] = self.free_edges();
            let is_first = (self.number as usize) < field.nrows() * field.ncols();
            let free = if is_first { [ca, bc, ab] } else { [ca, ab, bc] };
            for (normal, is_free) in cone.edges.iter_mut().zip(free) {
                *normal = if is_free { cone.face } else { *normal };
            }
            return Some(cone);
        }
        self.composite.as_trimesh()?.triangle_normal_constraints(self.number)
    }

    /// Whether each of its edges ab, bc and ca belongs to no other triangle.
    pub fn free_edges(self) -> [bool; 3] {
        if let Some(mesh) = self.composite.as_trimesh() {
            // Parry adds the normals of all triangles at an edge.
            let sums = mesh.pseudo_normals().map(|normals| normals.edges_pseudo_normal[self.number as usize]);
            let normal = mesh.triangle(self.number).normal();
            return sums.map_or([false; 3], |sums| sums.map(|sum| Some(sum) == normal));
        }
        let Some(field) = self.composite.as_heightfield() else { return [false; 3] };
        let (rows, cells) = (field.nrows(), field.nrows() * field.ncols());
        let (is_first, cell) = ((self.number as usize) < cells, self.number as usize % cells);
        let (row, column) = (cell % rows, cell / rows);
        // The diagonal belongs to both triangles of a cell.
        if is_first { [column == 0, false, row == 0] } else { [row == rows - 1, column == field.ncols() - 1, false] }
    }

    /// Whether a corner of this triangle is a peak in a direction: triangles surround the corner, and all lie below it.
    /// The direction is then a normal of the surface there. The cone of a triangle lacks it, because the cone has only
    /// the triangles at its edges. If so, tells whether this is the first of the triangles at the corner.
    pub fn peak(self, triangle: &Triangle, corner: usize, d: Vec3) -> Option<bool> {
        let at = triangle.vertices()[corner];
        let [one, other] = [1, 2].map(|i| triangle.vertices()[(corner + i) % 3].distance(at));
        let size = one.min(other);
        let (mut is_below, mut first, mut open) = (true, self.number, Vec3::ZERO);
        each_triangle(self.composite, &Aabb::from_half_extents(at, Vec3::splat(EXACT * size)), |facet, other| {
            let corners = other.vertices();
            let Some(k) = (0..3).find(|&k| corners[k].distance(at) <= EXACT * size) else { return };
            let ends = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            is_below &= ends.iter().all(|&end| d.dot(end - at) <= 0.0);
            // Around a closed fan, each end is the first of one triangle and the second of another.
            open += ends[1] - ends[0];
            first = first.min(facet.number);
        });
        (is_below && open.length() <= EXACT * size).then_some(first == self.number)
    }
}

/// Calls `with` on the triangles of a mesh or height field whose boxes overlap a box. The mesh determines their order.
pub(super) fn each_triangle(composite: &dyn Shape, around: &Aabb, mut with: impl FnMut(Facet, &Triangle)) {
    if let Some(mesh) = composite.as_trimesh() {
        let triangles = mesh.bvh().intersect_aabb(around).filter(|&i| (i as usize) < mesh.num_triangles());
        triangles.for_each(|number| with(Facet { composite, number }, &mesh.triangle(number)));
    } else if let Some(field) = composite.as_heightfield() {
        field.map_elements_in_local_aabb(around, &mut |number, triangle| with(Facet { composite, number }, triangle));
    }
}

/// Calls `with` on the normals of the faces that hold a point of a shape at a pose, within the distance `around` (m).
pub(super) fn each_face_at((shape, pose): (&dyn Shape, Pose), p: Vec3, around: f32, with: &mut dyn FnMut(Vec3)) {
    if let Some(solid) = Solid::or_point(shape, pose) {
        if solid.is_near(p, around) {
            solid.each_normal(|face| {
                if face.dot(solid.furthest(face) - p) <= around {
                    with(face);
                }
            });
        }
        return;
    }
    let p = pose.inverse_transform_point(p);
    each_triangle(shape, &Aabb::from_half_extents(p, Vec3::splat(around)), |_, triangle| {
        let holds = triangle.distance_to_local_point(p, true) <= around;
        triangle.normal().filter(|_| holds).into_iter().for_each(|normal| with(pose.rotation * normal));
    });
}

/// Whether a shape at a pose holds a point, within the distance `around` (m), and goes on from there in a direction.
/// Adds the normals of the triangles that do.
pub(super) fn goes_on(
    (shape, pose): (&dyn Shape, Pose),
    [p, out]: [Vec3; 2],
    around: f32,
    normals: &mut Vec<Vec3>,
) -> bool {
    let [p, ahead] = [p, p + AHEAD * around * out].map(|at| pose.inverse_transform_point(at));
    let own = pose.rotation.inverse() * out;
    let goes_on = |shape: &dyn PointQuery| {
        let [from, to] = [p, ahead].map(|at| shape.project_local_point(at, true).point);
        from.distance(p) <= around && own.dot(to - p) >= around
    };
    if shape.as_trimesh().is_none() && shape.as_heightfield().is_none() {
        return goes_on(shape);
    }
    let mut is_found = false;
    each_triangle(shape, &Aabb::from_half_extents(p, Vec3::splat(around)), |_, triangle| {
        if let Some(normal) = triangle.normal().filter(|_| goes_on(triangle)) {
            normals.push(pose.rotation * normal);
            is_found = true;
        }
    });
    is_found
}

impl Beside<'_> {
    /// The direction in the cone of normals at some points of a triangle that is nearest to `d`. Returns `None` if
    /// nothing opens the cone there.
    pub fn open(
        &mut self,
        composite: &dyn Shape,
        cone: &FacetCone,
        points: impl IntoIterator<Item = Vec3>,
        d: Vec3,
        RimScratch { directions, covered }: &mut RimScratch,
    ) -> Option<Vec3> {
        let Self { around, goes_on: other_goes_on } = self;
        directions.clear();
        covered.clear();
        for p in points {
            each_triangle(composite, &Aabb::from_half_extents(p, Vec3::splat(*around)), |facet, triangle| {
                let (free, Some(face)) = (facet.free_edges(), triangle.normal()) else { return };
                let edges = triangle.edges().into_iter().zip(free).filter(|(_, is_free)| *is_free);
                for (edge, _) in edges {
                    // A shape that lies flush with the edge can be further than that from a point beside it.
                    let on_edge = edge.project_local_point(p, true).point;
                    if on_edge.distance(p) > *around {
                        continue;
                    }
                    let out = (edge.b - edge.a).cross(face).normalize_or(face);
                    let at = [on_edge, out];
                    let is_covered = goes_on((composite, Pose::IDENTITY), at, *around, directions);
                    let list =
                        if other_goes_on(at, directions) | is_covered { &mut *covered } else { &mut *directions };
                    list.push(out);
                }
            });
        }
        directions.retain(|normal| covered.iter().all(|out| out.distance(*normal) > EXACT));
        directions.retain(|normal| cone.opens(*normal));
        (!directions.is_empty()).then(|| cone.nearest(directions, d))
    }
}
