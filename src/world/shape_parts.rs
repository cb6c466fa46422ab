//! Saves shapes by the parameters that they were built from.

use std::sync::{Arc, LazyLock};

use glam::Vec3;
use parry3d::shape::TypedShape;

use super::Shape;
use crate::error::{Result, input};
use crate::saved::{Archive, Saved};

/// The parameters of each kind of shape.
#[derive(Default)]
struct Parts {
    kind: u8,
    sizes: [f32; 3],
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    rows: Vec<Vec<f32>>,
}

crate::saved::fields!(Parts { kind, sizes, points, triangles, rows });

/// A shape that was shared before saving is shared again after loading.
impl Saved for Shape {
    fn blank() -> Self {
        static BLANK: LazyLock<Shape> = LazyLock::new(|| Shape::ball(1.0));
        BLANK.clone()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let address = Arc::as_ptr(&self.0.0).addr();
        archive.shared(self, address, content)
    }
}

/// Writes the parameters of a shape, or builds the shape from them.
fn content<A: Archive>(shape: &mut Shape, archive: &mut A) -> Result<()> {
    let mut parts = if A::READS { Parts::default() } else { parts(shape)? };
    parts.walk(archive)?;
    if A::READS {
        *shape = made_of(parts)?;
    }
    Ok(())
}

fn parts(shape: &Shape) -> Result<Parts> {
    let of = |kind: u8, sizes: [f32; 3]| Parts { kind, sizes, ..Parts::default() };
    Ok(match shape.0.as_typed_shape() {
        TypedShape::Ball(ball) => of(0, [ball.radius, 0.0, 0.0]),
        TypedShape::Cuboid(cuboid) => of(1, cuboid.half_extents.to_array()),
        TypedShape::Capsule(capsule) => of(2, [capsule.segment.b.y, capsule.radius, 0.0]),
        TypedShape::Cylinder(cylinder) => of(3, [cylinder.half_height, cylinder.radius, 0.0]),
        TypedShape::Cone(cone) => of(4, [cone.half_height, cone.radius, 0.0]),
        TypedShape::HalfSpace(plane) => of(5, plane.normal.to_array()),
        TypedShape::ConvexPolyhedron(_) => {
            let points = shape.hull_points().unwrap_or_default().to_vec();
            Parts { points, ..of(6, [0.0; 3]) }
        }
        TypedShape::TriMesh(mesh) => {
            Parts { points: mesh.vertices().to_vec(), triangles: mesh.indices().to_vec(), ..of(7, [0.0; 3]) }
        }
        TypedShape::HeightField(field) => {
            let heights = field.heights();
            let row = |i: usize| (0..heights.ncols()).map(|j| heights[(i, j)]).collect();
            Parts { rows: (0..heights.nrows()).map(row).collect(), ..of(8, field.scale().to_array()) }
        }
        _ => return Err(input!("{shape:?} cannot be saved")),
    })
}

fn made_of(Parts { kind, sizes, points, triangles, rows }: Parts) -> Result<Shape> {
    let [x, y, z] = sizes;
    Ok(match kind {
        0 => Shape::ball(x),
        1 => Shape::cuboid(x, y, z),
        2 => Shape::capsule(x, y),
        3 => Shape::cylinder(x, y),
        4 => Shape::cone(x, y),
        5 => Shape::half_space(sizes.into()),
        6 => Shape::convex_hull(&points)?,
        7 => Shape::mesh(points, triangles)?,
        8 => Shape::height_field(&rows, sizes.into())?,
        _ => return Err(input!("unknown kind of shape: {kind}")),
    })
}
