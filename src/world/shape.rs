//! The shapes of bodies, built on parry.

use std::fmt;
use std::sync::Arc;

use glam::{IVec3, Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::{Cylinder, HeightFieldFlags, SharedShape, TriMeshFlags, TypedShape};

use super::limits::{MAX_LENGTH, is_place};
use super::voxels::Voxels;
use crate::error::{Error, Result, ensure, input};
use crate::math::rotation;

/// A geometric shape in its own frame. Clones are cheap: they share the geometry.
///
/// Any body can have a ball, cuboid, capsule, cylinder, cone or convex hull. A triangle mesh or height field has no
/// mass, so a dynamic body cannot have one. Only a fixed body can have a half-space.
///
/// ```
/// use drystone::{Shape, glam::Vec3};
///
/// let ball = Shape::ball(0.5);
/// assert!(ball.is_ball() && ball.as_ball() == Some(0.5) && ball.is_same(&ball.clone()));
/// let brick = Shape::cuboid(0.5, 0.25, 0.25);
/// assert_eq!((brick.as_cuboid(), brick.volume()), (Some(Vec3::new(0.5, 0.25, 0.25)), 0.25));
/// assert_eq!((brick.smallest_half_extent(), brick.triangles().1.len()), (0.25, 12));
/// let [capsule, cylinder, cone] = [Shape::capsule(0.5, 0.1), Shape::cylinder(0.5, 0.1), Shape::cone(0.5, 0.1)];
/// assert!(capsule.volume() > cylinder.volume() && cylinder.volume() > cone.volume());
/// assert!((capsule.bounding_radius() - 0.6).abs() < 1e-6 && cone.parry().as_cone().is_some());
/// let wedge = Shape::convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z])?;
/// assert!(wedge.has_volume() && Shape::convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::Y]).is_err());
///
/// // Ground for bodies that move.
/// let plane = Shape::half_space(Vec3::Y);
/// assert!(plane.is_half_space() && plane.as_half_space() == Some(Vec3::Y));
/// let ramp = Shape::mesh(vec![Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.2, 0.0)], vec![[0, 1, 2]])?;
/// let hills = Shape::height_field(&[vec![0.0, 0.3], vec![0.1, 0.0]], Vec3::new(10.0, 1.0, 10.0))?;
/// assert!(!ramp.has_volume() && !hills.has_volume());
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone)]
pub struct Shape(pub(crate) SharedShape, Option<Arc<[Vec3]>>);

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.0.shape_type())
    }
}

impl Shape {
    /// A ball of `radius` (m).
    pub fn ball(radius: f32) -> Self {
        Self(SharedShape::ball(radius), None)
    }

    /// A box with half extents (m) along its own axes.
    pub fn cuboid(half_x: f32, half_y: f32, half_z: f32) -> Self {
        Self(SharedShape::cuboid(half_x, half_y, half_z), None)
    }

    /// A capsule along Y: a segment from -`half_height` to `half_height`, swept by `radius` (m).
    pub fn capsule(half_height: f32, radius: f32) -> Self {
        Self(SharedShape::capsule_y(half_height, radius), None)
    }

    /// A cylinder along Y (m).
    pub fn cylinder(half_height: f32, radius: f32) -> Self {
        // parry's own function panics at a size below 0.
        Self(SharedShape::new(Cylinder { half_height, radius }), None)
    }

    /// A cone along Y, tip up (m).
    pub fn cone(half_height: f32, radius: f32) -> Self {
        Self(SharedShape::cone(half_height, radius), None)
    }

    /// The convex hull of `points` (m).
    ///
    /// # Errors
    /// Fewer than four points, or points that span no volume.
    pub fn convex_hull(points: &[Vec3]) -> Result<Self> {
        // Check here: the hull code panics on a flat point cloud.
        let hull = spans_volume(points).then(|| SharedShape::convex_hull(points)).flatten();
        hull.map(|hull| Self(hull, Some(points.into())))
            .ok_or_else(|| input!("convex hull of {} points: the points must span a volume", points.len()))
    }

    /// All points p with p · `normal` <= 0; the normal points out of the solid and has unit length.
    pub fn half_space(normal: Vec3) -> Self {
        Self(SharedShape::halfspace(normal), None)
    }

    /// A triangle mesh: vertices (m) and triangles. Triangles are counter-clockwise seen from outside.
    ///
    /// # Errors
    /// There is no triangle, an index names no vertex, or a vertex is out of range or NaN.
    pub fn mesh(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        if let Some(t) = triangles.iter().find(|t| t.iter().any(|&i| i as usize >= vertices.len())) {
            let count = vertices.len();
            return Err(input!("mesh triangle {t:?} names a vertex beyond the last of {count}"));
        }
        if let Some((k, v)) = vertices.iter().enumerate().find(|(_, v)| !is_place(**v)) {
            return Err(input!("mesh vertex {k}, {v}: must be at most {MAX_LENGTH:e} m in size"));
        }
        let mesh = SharedShape::trimesh_with_flags(vertices, triangles, TriMeshFlags::FIX_INTERNAL_EDGES);
        mesh.map(|mesh| Self(mesh, None)).map_err(|e| input!("mesh: {e}"))
    }

    /// The surface of blocks in a grid, as a mesh, for terrain of blocks. The sides of a cell are `size` (m), and the
    /// cell with the numbers `c` begins at `c * size`. A cell that is named twice counts once. For a body that moves, see
    /// [`Body::voxels`](crate::Body::voxels).
    ///
    /// ```
    /// use drystone::{Shape, glam::{IVec3, Vec3}};
    ///
    /// // Two steps of a stair: two triangles for each of the 14 faces outside, and none between blocks.
    /// let stair = Shape::voxels(Vec3::new(1.0, 0.5, 1.0), &[IVec3::ZERO, IVec3::X, IVec3::new(1, 1, 0)])?;
    /// let (vertices, triangles) = stair.triangles();
    /// assert_eq!((vertices.len(), triangles.len()), (16, 28));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is no cell, a side is not above 0, or a corner is out of range.
    pub fn voxels(size: Vec3, cells: &[IVec3]) -> Result<Self> {
        let (vertices, triangles) = Voxels::new(size, cells)?.surface();
        Self::mesh(vertices, triangles)
    }

    /// A height field over the XZ plane: `heights[row][column]`, with rows along Z and columns along X, scaled by
    /// `scale` (m). Like a mesh, it has one side, the upper one. Bodies do not catch on the edges between its
    /// triangles.
    ///
    /// # Errors
    /// There are fewer than two rows or columns, rows have unequal lengths, or a height or the scale is out of range or
    /// NaN.
    pub fn height_field(heights: &[Vec<f32>], scale: Vec3) -> Result<Self> {
        let rows = heights.len();
        let columns = heights.first().map_or(0, Vec::len);
        if rows < 2 || columns < 2 || heights.iter().any(|r| r.len() != columns) {
            return Err(Error::input("a height field needs at least 2 rows of equal length with at least 2 heights"));
        }
        let is_height = |h: &f32| (h * scale.y).abs() <= MAX_LENGTH;
        let fits = is_place(scale) && scale.min_element() > 0.0 && heights.iter().flatten().all(is_height);
        ensure(fits, || {
            format!("a height field, scaled by {scale}: must be more than 0 and at most {MAX_LENGTH:e} m in size")
        })?;
        // parry stores columns one after another.
        let data = (0..columns).flat_map(|c| heights.iter().map(move |row| row[c])).collect();
        let data = parry3d::utils::Array2::new(rows, columns, data);
        Ok(Self(SharedShape::heightfield_with_flags(data, scale, HeightFieldFlags::FIX_INTERNAL_EDGES), None))
    }

    /// Refuses a shape without extent, or with a number that is not finite or larger than [`MAX_LENGTH`].
    ///
    /// ```
    /// use drystone::Shape;
    ///
    /// assert!(Shape::ball(0.5).check().is_ok() && Shape::ball(0.0).check().is_err());
    /// ```
    ///
    /// # Errors
    /// One line names the shape, the number and its range.
    pub fn check(&self) -> Result<()> {
        let sizes = |kind: &str, sizes: &[(&str, f32)]| {
            sizes.iter().try_for_each(|(name, size)| {
                let message = || format!("{kind} of {name} {size}: must be more than 0 and at most {MAX_LENGTH:e} m");
                ensure(*size > 0.0 && *size <= MAX_LENGTH, message)
            })
        };
        match self.0.as_typed_shape() {
            TypedShape::Ball(ball) => sizes("ball", &[("radius", ball.radius)]),
            TypedShape::Cuboid(cuboid) => {
                let [x, y, z] = cuboid.half_extents.to_array();
                sizes("cuboid", &[("half extent", x), ("half extent", y), ("half extent", z)])
            }
            TypedShape::Capsule(c) => sizes("capsule", &[("half height", c.half_height()), ("radius", c.radius)]),
            TypedShape::Cylinder(c) => sizes("cylinder", &[("half height", c.half_height), ("radius", c.radius)]),
            TypedShape::Cone(c) => sizes("cone", &[("half height", c.half_height), ("radius", c.radius)]),
            TypedShape::HalfSpace(plane) => {
                let (normal, length) = (plane.normal, plane.normal.length());
                let message = || format!("half-space: normal {normal} must have length 1, but has length {length}");
                ensure((length - 1.0).abs() <= 1e-3, message)
            }
            _ => {
                let extents = self.0.compute_local_aabb();
                let message = || format!("{self:?}: its points must be at most {MAX_LENGTH:e} m in size");
                ensure(is_place(extents.mins) && is_place(extents.maxs), message)
            }
        }
    }

    /// Whether both share one geometry. Equal copies do not count.
    pub(crate) fn is(&self, other: &Self) -> bool {
        std::sync::Arc::ptr_eq(&self.0.0, &other.0.0)
    }

    /// Whether the shape has a finite volume. Then the mass of a body can follow from its density.
    pub fn has_volume(&self) -> bool {
        !self.is_half_space() && self.0.as_trimesh().is_none() && self.0.as_heightfield().is_none()
    }

    /// Whether this is a ball.
    pub fn is_ball(&self) -> bool {
        self.0.as_ball().is_some()
    }

    /// Whether this is a half-space.
    pub fn is_half_space(&self) -> bool {
        self.0.as_halfspace().is_some()
    }

    /// Half extents of a cuboid (m), or `None` for another shape.
    pub fn as_cuboid(&self) -> Option<Vec3> {
        self.0.as_cuboid().map(|c| c.half_extents)
    }

    /// Radius of the smallest sphere around the shape's own origin that contains the shape (m); infinite for a
    /// half-space.
    pub fn bounding_radius(&self) -> f32 {
        let sphere = self.0.compute_local_bounding_sphere();
        sphere.center().length() + sphere.radius()
    }

    /// The points that were given for a convex hull, or `None` for another shape. The hull of the corners alone can
    /// have them in another order.
    pub(crate) fn hull_points(&self) -> Option<&[Vec3]> {
        self.1.as_deref()
    }

    /// Parry's shape, for use with another engine.
    pub fn parry(&self) -> &SharedShape {
        &self.0
    }

    /// Half of the smallest side of the shape's own bounding box (m); infinite for a half-space.
    pub fn smallest_half_extent(&self) -> f32 {
        if self.is_half_space() {
            return f32::INFINITY;
        }
        let extents = self.0.compute_local_aabb().half_extents();
        // A flat mesh or height field has no thickness. Its longer sides give its size.
        if self.has_volume() { extents.min_element() } else { extents.max_element() }
    }
}

/// A pose from its two parts.
pub fn pose(position: Vec3, rotation: Quat) -> Pose {
    Pose::from_parts(position, rotation)
}

/// Converts the pose `local` out of the frame with the pose `frame`.
pub fn placed(frame: Pose, local: Pose) -> Pose {
    pose(frame.translation + frame.rotation * local.translation, rotation::product(frame.rotation, local.rotation))
}

/// The pose `of` in the frame of `other`.
pub(crate) fn seen_from(other: Pose, of: Pose) -> Pose {
    let back = other.rotation.inverse();
    pose(back * (of.translation - other.translation), rotation::product(back, of.rotation))
}

/// Whether the points are finite and not all in one plane, relative to their extent.
fn spans_volume(points: &[Vec3]) -> bool {
    let Some(&origin) = points.first() else { return false };
    let farthest = |measure: &dyn Fn(Vec3) -> f32| {
        points
            .iter()
            .map(|&p| (measure(p - origin), p - origin))
            .fold((0.0_f32, Vec3::ZERO), |best, x| if x.0 > best.0 { x } else { best })
    };
    let (length, edge) = farthest(&|p| p.length());
    let axis = edge.normalize_or_zero();
    let (width, side) = farthest(&|p| p.cross(axis).length());
    let normal = axis.cross(side).normalize_or_zero();
    let (height, _) = farthest(&|p| p.dot(normal).abs());
    points.iter().all(|p| p.is_finite()) && length > 0.0 && width > 1e-5 * length && height > 1e-5 * length
}
