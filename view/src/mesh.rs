//! Meshes of a world: one for all colliders with the same geometry, and an instance for each collider.

use std::ops::Range;

use glam::{Quat, Vec3};

use crate::bounds::Bounds;
use crate::poses::Poses;
use drystone::world::{Collider, Triangles};
use drystone::{BodyKind, Shape, World};

/// A corner of a triangle, in the layout of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
}

/// A collider in a picture, in the layout of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Instance {
    position: [f32; 3],
    color: [u8; 4],
    rotation: [f32; 4],
    scale: [f32; 3],
    pattern: u32,
}

// The patterns of shaders/mesh.wgsl.
const PLAIN: u32 = 0;
const CHECKERED: u32 = 1;
const OCTANTS: u32 = 2;
const SENSOR: u32 = 3;

/// Sensors are transparent, so that bodies in them stay visible.
const SENSOR_COLOR: [u8; 4] = [40, 110, 220, 255];

/// Cosine of the largest angle between faces of a smooth surface, 35 degrees.
const SMOOTH: f32 = 0.82;

/// The appearance of half-spaces: squares around `middle` with half side `reach` (m).
pub struct Ground {
    pub middle: Vec3,
    pub reach: f32,
    /// The color of fixed half-spaces.
    pub color: [u8; 4],
    /// The color of other fixed bodies.
    pub fixed: [u8; 4],
}

struct Part {
    body: usize,
    position: Vec3,
    rotation: Quat,
    scale: Vec3,
    pattern: u32,
    /// Outward normal of a half-space.
    plane: Option<Vec3>,
    /// Whether the body is fixed.
    is_fixed: bool,
    /// A collider of a body that is not dynamic. It can hide dynamic bodies.
    screen: Option<Collider>,
}

struct Group {
    vertices: Range<u32>,
    parts: Vec<Part>,
}

pub struct Meshes {
    pub vertices: Vec<Vertex>,
    groups: Vec<Group>,
}

impl Meshes {
    /// Meshes for the bodies of `world`. Their shapes must not change.
    pub fn new(world: &World) -> Self {
        let mut meshes = Self { vertices: Vec::new(), groups: Vec::new() };
        let mut known: Vec<Shape> = Vec::new();
        let (unit_cube, unit_ball) = (Shape::cuboid(1.0, 1.0, 1.0), Shape::ball(1.0));
        for (i, body) in world.bodies.iter().enumerate() {
            for collider in &body.colliders {
                // All boxes share a mesh, and all balls.
                let (shape, scale) = match (collider.shape.as_cuboid(), collider.shape.as_ball()) {
                    (Some(half_extents), _) => (&unit_cube, half_extents),
                    (_, Some(radius)) => (&unit_ball, Vec3::splat(radius)),
                    _ => (&collider.shape, Vec3::ONE),
                };
                let plane = shape.as_half_space();
                let pattern = match (plane, collider.shape.as_ball()) {
                    _ if collider.sensor => SENSOR,
                    (Some(_), _) => CHECKERED,
                    (_, Some(_)) => OCTANTS,
                    _ => PLAIN,
                };
                let screen = (body.kind != BodyKind::Dynamic && plane.is_none()).then(|| collider.clone());
                let (position, rotation) = (collider.position, collider.rotation);
                let is_fixed = body.kind == BodyKind::Fixed;
                let part = Part { body: i, position, rotation, scale, pattern, plane, is_fixed, screen };
                // Consecutive bodies often have the same shape, so the search begins at the end.
                match known.iter().rposition(|k| k.is_same(shape)) {
                    Some(group) => meshes.groups[group].parts.push(part),
                    None => {
                        known.push(shape.clone());
                        let first = meshes.vertices.len() as u32;
                        meshes.vertices.extend(corners(&shape.triangles()));
                        let vertices = first..meshes.vertices.len() as u32;
                        meshes.groups.push(Group { vertices, parts: vec![part] });
                    }
                }
            }
        }
        meshes
    }

    pub fn draws(&self) -> impl Iterator<Item = (Range<u32>, Range<u32>)> {
        let mut first = 0;
        self.groups.iter().map(move |g| {
            let instances = first..first + g.parts.len() as u32;
            first = instances.end;
            (g.vertices.clone(), instances)
        })
    }

    /// An instance for each collider, in the order of [`Meshes::draws`]. A collider of a body that is not dynamic is
    /// left out if its bounds are `hidden`.
    pub fn instances(
        &self,
        poses: &Poses,
        colors: &[[u8; 4]],
        ground: &Ground,
        hidden: impl Fn(&Bounds) -> bool,
    ) -> Vec<Instance> {
        let instance = |part: &Part| {
            let (position, rotation) = poses[part.body];
            let turn = rotation * part.rotation;
            let mut center = position + rotation * part.position;
            let mut scale = part.scale;
            if let Some(normal) = part.plane {
                let normal = turn * normal;
                center = ground.middle - normal * normal.dot(ground.middle - center);
                scale = Vec3::splat(ground.reach);
            }
            if let Some(collider) = &part.screen {
                let (low, high) = collider.bounds(position, rotation);
                scale = if hidden(&Bounds { low, high }) { Vec3::ZERO } else { scale };
            }
            Instance {
                position: center.to_array(),
                color: match part.pattern {
                    SENSOR => SENSOR_COLOR,
                    _ if part.is_fixed && part.plane.is_some() => ground.color,
                    _ if part.is_fixed => ground.fixed,
                    _ => colors[part.body],
                },
                rotation: turn.to_array(),
                scale: scale.to_array(),
                pattern: part.pattern,
            }
        };
        self.groups.iter().flat_map(|g| &g.parts).map(instance).collect()
    }
}

/// Corners of the triangles with normals: smooth over round surfaces, and flat at edges.
fn corners((vertices, triangles): &Triangles) -> Vec<Vertex> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| vertices[i as usize]);
        (b - a).cross(c - a)
    };
    let mut around = vec![Vec::new(); vertices.len()];
    for (k, t) in triangles.iter().enumerate() {
        t.iter().for_each(|&i| around[i as usize].push(k));
    }
    let normals: Vec<Vec3> = triangles.iter().map(normal).collect();
    let corner = |k: usize, i: u32| {
        let own = normals[k].normalize_or_zero();
        let near = around[i as usize].iter().map(|&n| normals[n]).filter(|n| n.normalize_or_zero().dot(own) > SMOOTH);
        let smooth = near.sum::<Vec3>().try_normalize().unwrap_or(Vec3::Y);
        Vertex { position: vertices[i as usize].to_array(), normal: smooth.to_array() }
    };
    triangles.iter().enumerate().flat_map(|(k, t)| t.map(|i| corner(k, i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone_scenes::Scene;

    #[test]
    fn equal_geometry_is_one_draw_and_every_collider_is_an_instance() {
        let scene = Scene::find("pile", &["n=64".into()]).expect("a scene");
        let meshes = Meshes::new(&scene.world);
        let draws: Vec<_> = meshes.draws().collect();
        // Floor, four walls and all boxes share one mesh of twelve triangles.
        assert_eq!(draws, [(0..36, 0..69)]);
    }

    #[test]
    fn every_scene_of_the_catalogue_has_meshes_with_unit_normals() {
        for entry in drystone_scenes::CATALOGUE {
            let world = entry.build(&[]).expect(entry.name).world;
            let meshes = Meshes::new(&world);
            let colliders: usize = world.bodies.iter().map(|b| b.colliders.len()).sum();
            assert_eq!(meshes.draws().last().map(|d| d.1.end as usize), Some(colliders), "{}", entry.name);
            let unit = |v: &Vertex| (Vec3::from_array(v.normal).length() - 1.0).abs() < 1e-4;
            assert!(meshes.vertices.iter().all(unit), "{}", entry.name);
        }
    }

    #[test]
    fn a_box_has_flat_sides_and_a_ball_is_round() {
        let off = |shape: &Shape| {
            let corners = corners(&shape.triangles());
            let worst = corners.iter().map(|v| Vec3::from_array(v.normal).angle_between(Vec3::from_array(v.position)));
            worst.fold(0.0, f32::max)
        };
        // With flat facets, the corners would differ by 0.1.
        let ball = off(&Shape::ball(1.0));
        assert!(ball < 0.05, "{ball}");
        assert!((off(&Shape::cuboid(1.0, 1.0, 1.0)) - (1.0_f32 / 3.0).sqrt().acos()).abs() < 1e-3);
    }
}
