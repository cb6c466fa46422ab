//! What of a world is drawn: one mesh for all colliders of one geometry, and one instance for each collider.

use std::ops::Range;

use glam::{Quat, Vec3};

use super::camera::Bounds;
use drystone::world::{Collider, Triangles};
use drystone::{BodyKind, Shape, World};

/// A corner of a triangle, as the shader takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
}

/// One collider in one picture, as the shader takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Instance {
    position: [f32; 3],
    color: [u8; 4],
    rotation: [f32; 4],
    scale: [f32; 3],
    pattern: u32,
}

/// Position (m) and rotation of each body of a world.
pub type Poses = [(Vec3, Quat)];

/// Poses of the bodies as they are.
pub fn poses(world: &World) -> Vec<(Vec3, Quat)> {
    world.bodies.iter().map(|b| (b.position, b.rotation)).collect()
}

// As in shaders/view/mesh.wgsl.
const PLAIN: u32 = 0;
const CHECKERED: u32 = 1;
const OCTANTS: u32 = 2;

/// Faces that meet at less than this are one smooth surface: cosine of 35 degrees.
const SMOOTH: f32 = 0.82;

/// A collider, and how its mesh becomes it.
struct Part {
    body: usize,
    position: Vec3,
    rotation: Quat,
    scale: Vec3,
    pattern: u32,
    /// Outward normal, if it is a half-space.
    plane: Option<Vec3>,
    /// What dynamic bodies can be hidden by: a collider of a body that is not dynamic.
    screen: Option<Collider>,
}

/// Colliders that share a mesh.
struct Group {
    vertices: Range<u32>,
    parts: Vec<Part>,
}

/// The meshes of a world.
pub struct Meshes {
    /// Corners of all triangles.
    pub vertices: Vec<Vertex>,
    groups: Vec<Group>,
}

impl Meshes {
    /// Meshes for the bodies of `world`, whose shapes stay as they are.
    pub fn new(world: &World) -> Self {
        let mut meshes = Self { vertices: Vec::new(), groups: Vec::new() };
        let mut known: Vec<Shape> = Vec::new();
        let (unit_cube, unit_ball) = (Shape::cuboid(1.0, 1.0, 1.0), Shape::ball(1.0));
        for (i, body) in world.bodies.iter().enumerate() {
            for collider in &body.colliders {
                // All boxes are one mesh, and all balls.
                let (shape, scale) = match (collider.shape.as_cuboid(), collider.shape.as_ball()) {
                    (Some(half_extents), _) => (&unit_cube, half_extents),
                    (_, Some(radius)) => (&unit_ball, Vec3::splat(radius)),
                    _ => (&collider.shape, Vec3::ONE),
                };
                let plane = shape.as_half_space();
                let pattern = match (plane, collider.shape.as_ball()) {
                    (Some(_), _) => CHECKERED,
                    (_, Some(_)) => OCTANTS,
                    _ => PLAIN,
                };
                let screen = (body.kind != BodyKind::Dynamic && plane.is_none()).then(|| collider.clone());
                let (position, rotation) = (collider.position, collider.rotation);
                let part = Part { body: i, position, rotation, scale, pattern, plane, screen };
                // The last one first: bodies of one shape come one after another.
                match known.iter().rposition(|k| k.is_same(shape)) {
                    Some(group) => meshes.groups[group].parts.push(part),
                    None => {
                        known.push(shape.clone());
                        meshes.add(shape, part);
                    }
                }
            }
        }
        meshes
    }

    fn add(&mut self, shape: &Shape, part: Part) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners(&shape.triangles()));
        self.groups.push(Group { vertices: first..self.vertices.len() as u32, parts: vec![part] });
    }

    /// Vertices and instances of each draw.
    pub fn draws(&self) -> impl Iterator<Item = (Range<u32>, Range<u32>)> {
        let mut first = 0;
        self.groups.iter().map(move |g| {
            let instances = first..first + g.parts.len() as u32;
            first = instances.end;
            (g.vertices.clone(), instances)
        })
    }

    /// One row for each collider, in the order of [`Meshes::draws`]. Half-spaces are drawn as squares of half side `reach`
    /// around `middle`. Colliders of bodies that are not dynamic are left out where their bounds are `hidden`.
    pub fn instances(
        &self,
        poses: &Poses,
        colors: &[[u8; 4]],
        (middle, reach): (Vec3, f32),
        hidden: impl Fn(&Bounds) -> bool,
    ) -> Vec<Instance> {
        let instance = |part: &Part| {
            let (position, rotation) = poses[part.body];
            let turn = rotation * part.rotation;
            let mut center = position + rotation * part.position;
            let mut scale = part.scale;
            if let Some(normal) = part.plane {
                let normal = turn * normal;
                center = middle - normal * normal.dot(middle - center);
                scale = Vec3::splat(reach);
            }
            if let Some(collider) = &part.screen {
                let (low, high) = collider.bounds(position, rotation);
                scale = if hidden(&Bounds { low, high }) { Vec3::ZERO } else { scale };
            }
            Instance {
                position: center.to_array(),
                color: colors[part.body],
                rotation: turn.to_array(),
                scale: scale.to_array(),
                pattern: part.pattern,
            }
        };
        self.groups.iter().flat_map(|g| &g.parts).map(instance).collect()
    }
}

/// Corners of the triangles with normals: flat where faces meet at an edge, smooth where the surface is round.
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
    use drystone::Scene;

    #[test]
    fn equal_geometry_is_one_draw_and_every_collider_is_an_instance() {
        let scene = Scene::find("pile", &["n=64".into()]).expect("a scene");
        let meshes = Meshes::new(&scene.world);
        let draws: Vec<_> = meshes.draws().collect();
        // Floor, four walls and all boxes are one mesh of twelve triangles.
        assert_eq!(draws, [(0..36, 0..69)]);
    }

    #[test]
    fn every_scene_of_the_catalogue_has_meshes_with_unit_normals() {
        for entry in drystone::scenes::CATALOGUE {
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
        // The corners of a flat facet would be off by 0.1.
        let ball = off(&Shape::ball(1.0));
        assert!(ball < 0.05, "{ball}");
        assert!((off(&Shape::cuboid(1.0, 1.0, 1.0)) - (1.0_f32 / 3.0).sqrt().acos()).abs() < 1e-3);
    }
}
