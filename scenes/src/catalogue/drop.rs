//! A scene with every kind of shape.

use std::f64::consts::TAU;

use glam::{Quat, Vec3};

use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Result, Shape, World};

/// Distance between neighbors in the row (m).
const PITCH: f32 = 3.0;
/// Depth of the mesh and of the height field (m).
const DEPTH: f32 = 6.0;
/// Cells along each side of the mesh and of the height field.
const CELLS: u16 = 8;

/// Every kind of shape in a row along x, `height` above the surfaces: first a floor, then a mesh, then a height field.
pub(super) fn drop(height: f32) -> Result<Scene> {
    let mut world = World::new();
    world.insert(Body::fixed().named("floor").shape(Shape::half_space(Vec3::Y)));

    let lying = about(Vec3::X, std::f32::consts::FRAC_PI_2);
    let mut place = |body: Body, name: &str, x: f32, y: f32| world.insert(body.named(name).position(x * PITCH, y, 0.0));

    place(Body::dynamic().shape(Shape::ball(0.5)), "ball", -3.0, 0.5 + height);
    place(Body::dynamic().shape(Shape::capsule(0.5, 0.3)).rotation(lying), "capsule", -2.0, 0.3 + height);
    place(Body::dynamic().shape(Shape::cylinder(0.5, 0.4)), "cylinder", -1.0, 0.5 + height);

    // The left side of the surface is 0.2 m high, and its slope is below the friction limit.
    place(Body::fixed().shape(tilted_plate()?), "mesh", 0.5, 0.1);
    place(Body::dynamic().shape(Shape::cuboid(0.5, 0.4, 0.3)), "cuboid", 0.0, 0.6 + height);
    place(Body::dynamic().shape(Shape::cone(0.5, 0.5)), "cone", 1.0, 0.6 + height);

    // Two troughs, 0.1 m above the floor, one under each body.
    place(Body::fixed().shape(waves()?), "height field", 2.5, 0.2);
    place(Body::dynamic().shape(irregular_octahedron()?), "convex hull", 2.0, 0.8 + height);
    place(dumbbell(), "compound", 3.0, 0.5 + height);

    let container = Some((Vec3::new(-4.0 * PITCH, 0.0, -DEPTH), Vec3::new(4.0 * PITCH, height + 4.0, DEPTH)));
    Ok(Scene { container, ..Scene::new("drop", world, 300) })
}

/// A plate of triangles, two pitches long, that falls 0.1 m from left to right.
fn tilted_plate() -> Result<Shape> {
    let side = u32::from(CELLS) + 1;
    let fraction = |k: u32| k as f32 / f32::from(CELLS) - 0.5;
    let vertex = |i: u32| {
        let (x, z) = (fraction(i % side), fraction(i / side));
        Vec3::new(x * 2.0 * PITCH, -0.1 * x, z * DEPTH)
    };
    let cells = (0..side * side).filter(|i| i % side + 1 < side && i / side + 1 < side);
    let triangles = cells.flat_map(|i| [[i, i + side, i + 1], [i + 1, i + side, i + side + 1]]).collect();
    Shape::mesh((0..side * side).map(vertex).collect(), triangles)
}

/// Waves along x, two pitches long in total and 0.1 m deep, with troughs at one quarter and three quarters of the
/// length.
fn waves() -> Result<Shape> {
    let columns = 4 * CELLS;
    let row: Vec<f32> =
        (0..=columns).map(|k| libm::cos(TAU * 2.0 * f64::from(k) / f64::from(columns)) as f32).collect();
    Shape::height_field(&vec![row; usize::from(CELLS) + 1], Vec3::new(2.0 * PITCH, 0.05, DEPTH))
}

/// The hull of six points. No two edges have the same length.
fn irregular_octahedron() -> Result<Shape> {
    let points =
        [(0.6, 0.0, 0.1), (-0.5, 0.1, 0.0), (0.1, 0.5, 0.0), (0.0, -0.4, 0.1), (0.0, 0.1, 0.6), (0.1, 0.0, -0.5)];
    Shape::convex_hull(&points.map(Vec3::from))
}

/// Two cubes that a bar along x connects.
fn dumbbell() -> Body {
    let cube = Shape::cuboid(0.25, 0.25, 0.25);
    let at = |x: f32| Vec3::new(x, 0.0, 0.0);
    // The bar ends at the cubes, so its mass is not counted twice.
    Body::dynamic()
        .shape_at(cube.clone(), at(-0.6), Quat::IDENTITY)
        .shape_at(Shape::cuboid(0.35, 0.1, 0.1), at(0.0), Quat::IDENTITY)
        .shape_at(cube, at(0.6), Quat::IDENTITY)
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;

    use super::*;
    use drystone::BodyKind;

    /// Lowest point of the axis-aligned box around a body.
    fn lowest(body: &Body) -> f32 {
        let boxes = body.colliders.iter().map(|c| {
            let pose = Pose::from_parts(body.position, body.rotation) * Pose::from_parts(c.position, c.rotation);
            c.shape.parry().compute_aabb(&pose).mins.y
        });
        boxes.fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn every_shape_is_there_and_starts_above_the_ground() {
        let scene = drop(0.0).expect("the scene");
        let moving: Vec<_> = scene.world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic).collect();
        assert_eq!(moving.len(), 7);
        for body in moving {
            let ground = match body.position.x {
                x if x < -0.5 * PITCH => 0.0,
                x if x < 1.5 * PITCH => 0.1,
                _ => 0.15,
            };
            let gap = lowest(body) - ground;
            assert!((-1e-4..0.4).contains(&gap), "{}: {gap}", body.name);
        }
    }

    #[test]
    fn mesh_and_height_field_are_seen_from_above_and_lie_on_the_floor() {
        let scene = drop(2.0).expect("the scene");
        let find = |name: &str| scene.world.bodies.iter().find(|b| b.name == name).expect("a body of that name");
        assert!(lowest(find("mesh")) > 0.0 && lowest(find("height field")) > 0.0);
        let mesh = find("mesh").colliders[0].shape.parry().as_trimesh().expect("a mesh").clone();
        assert_eq!(mesh.triangles().count(), 2 * usize::from(CELLS).pow(2));
        assert!(mesh.triangles().all(|t| t.normal().is_some_and(|n| n.y > 0.9)));
    }
}
