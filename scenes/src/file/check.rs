//! Converts a scene file to a scene. The world checks ranges, and this module checks the rest.

use std::fmt::Display;

use glam::{IVec3, Vec3};

use super::joint::joint;
use super::numbers::{checked, finite, lengths, positive, refusal, rotation, unit, zero};
use super::schema::{
    AdditionalMassFile, BodyFile, DriverFile, Geometry, LeavesFile, MassFile, MaterialFile, SceneFile, ShapeFile,
    SpawnerFile,
};
use crate::driver::{Driver, axles};
use crate::scene::Scene;
use crate::spawner::{Leaves, Spawner};
use drystone::config::check_step_length;
use drystone::stages::error::{ensure, input};
use drystone::world::Collider;
use drystone::{Body, BodyKind, Error, MassProperties, Material, Result, Shape, World};

/// The scene that a file describes. Its name is `name` if the file has none.
pub(super) fn scene(file: SceneFile, name: &str) -> Result<Scene> {
    if file.version != 1 {
        return Err(unknown_version(file.version));
    }
    let [dt] = finite("dt", [file.dt])?;
    check_step_length(dt)?;
    let mut world = World { gravity: finite("gravity", file.gravity)?.into(), ..World::new() };
    world.check()?;
    let container = file.container.map(container).transpose()?;
    let mut leaving = Vec::new();
    for (index, body_file) in file.bodies.into_iter().enumerate() {
        let of_body = |e: Error| e.within(body_label(index, body_file.name.as_deref()));
        let built = body(&body_file).map_err(of_body)?;
        let leaves = body_file.leaves.as_ref().map(leaves).transpose().map_err(of_body)?;
        let handle = world.insert(built.named(body_file.name.unwrap_or_else(|| format!("body {index}"))));
        leaving.extend(leaves.map(|leaves| (handle, leaves)));
    }
    for (index, joint_file) in file.joints.iter().enumerate() {
        let joint = joint(joint_file, &world).map_err(|e| e.within(format_args!("joints[{index}]")))?;
        world.insert_joint(joint);
    }
    let spawner = |(k, s): (usize, &SpawnerFile)| spawner(s).map_err(|e| e.within(format_args!("spawners[{k}]")));
    let spawners = file.spawners.iter().enumerate().map(spawner).collect::<Result<_>>()?;
    let driver = file.driver.map(|file| driver(&file, &world)).transpose().map_err(|e| e.within("driver"))?;
    Ok(Scene {
        dt,
        container,
        spawners,
        driver,
        leaving,
        ..Scene::new(file.name.unwrap_or_else(|| name.to_owned()), world, file.steps)
    })
}

pub(super) fn unknown_version(version: impl Display) -> Error {
    input!("version = {version}: only version 1 is supported")
}

/// The name of a body in messages: its index and, if it has one, its name.
pub(super) fn body_label(index: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("body {index}"), |name| format!("body {index} {name:?}"))
}

fn container(corners: [[f64; 3]; 2]) -> Result<(Vec3, Vec3)> {
    let low: Vec3 = lengths("container[0]", corners[0])?.into();
    let high: Vec3 = lengths("container[1]", corners[1])?.into();
    if !low.cmplt(high).all() {
        return Err(refusal("container[1]", &corners[1], "above container[0] along every axis"));
    }
    Ok((low, high))
}

fn body(file: &BodyFile) -> Result<Body> {
    let mut body = Body::new(file.kind);
    let [x, y, z] = finite("position", file.position)?;
    let velocity = |name, v| if file.kind == BodyKind::Fixed { zero(name, v) } else { finite(name, v) };
    let linear = velocity("linear_velocity", file.linear_velocity)?;
    let angular = velocity("angular_velocity", file.angular_velocity)?;
    let pushed = |x: f32| x == 0.0 || file.kind == BodyKind::Dynamic;
    let load = |name, load| checked(name, load, "zero unless the body is dynamic", pushed);
    (body.force, body.torque) = (load("force", file.force)?.into(), load("torque", file.torque)?.into());
    [body.gravity_scale] = finite("gravity_scale", [file.gravity_scale])?;
    [body.linear_damping] = finite("linear_damping", [file.linear_damping])?;
    [body.angular_damping] = finite("angular_damping", [file.angular_damping])?;
    (body.locked_rotations, body.can_sleep) = (file.locked_rotations, file.can_sleep);
    body.locked_translations = file.locked_translations;
    let speed = |name, speed: Option<f64>| -> Result<f32> {
        speed.map_or(Ok(f32::INFINITY), |speed| finite(name, [speed]).map(|[speed]| speed))
    };
    body.max_linear_speed = speed("max_linear_speed", file.max_linear_speed)?;
    body.max_angular_speed = speed("max_angular_speed", file.max_angular_speed)?;
    body.groups = file.groups;
    body.swept = file.swept;
    let own = material(&MaterialFile {
        friction: file.friction,
        restitution: file.restitution,
        friction_rule: file.friction_rule,
        restitution_rule: file.restitution_rule,
        rolling_friction: file.rolling_friction,
        spinning_friction: file.spinning_friction,
        surface_velocity: file.surface_velocity,
    })?;
    let mut body = body
        .position(x, y, z)
        .rotation(rotation("rotation", file.rotation)?)
        .velocity(linear.into(), angular.into())
        .material(own);
    for (k, shape_file) in file.shapes.iter().enumerate() {
        let colliders = colliders(shape_file, file.kind).map_err(|e| e.within(format_args!("shapes[{k}]")))?;
        body = colliders.into_iter().fold(body, Body::collider);
    }
    let body = with_mass(body, file)?;
    body.check().map(|()| body)
}

fn driver(file: &DriverFile, world: &World) -> Result<Driver> {
    let (DriverFile::Character { body } | DriverFile::Vehicle { body }) = file;
    let handle = body.find(world)?;
    let within = |e: Error| e.within(format_args!("body {body}"));
    match file {
        DriverFile::Character { .. } => {
            let walks = world.bodies[handle].kind == BodyKind::Kinematic;
            ensure(walks, || "a character must be kinematic".into()).map_err(within)?;
            Ok(Driver::character(handle))
        }
        DriverFile::Vehicle { .. } => {
            let (rear, front) = axles(world, handle);
            let message = "a vehicle needs joints whose second body it is, at two places along its x axis";
            ensure(rear < front, || message.into()).map_err(within)?;
            Ok(Driver::vehicle(handle))
        }
    }
}

fn spawner(file: &SpawnerFile) -> Result<Spawner> {
    let SpawnerFile { first, every, count, .. } = *file;
    ensure(every > 0, || "every = 0: must be at least 1 step".into())?;
    let name = file.body.name.clone().unwrap_or_default();
    let built = |file: &BodyFile| Ok((body(file)?, file.leaves.as_ref().map(leaves).transpose()?));
    let (body, leaves) = built(&file.body).map_err(|e: Error| e.within("body"))?;
    Ok(Spawner { body: body.named(name), leaves: leaves.unwrap_or_default(), first, every, count, world: 0 })
}

fn leaves(file: &LeavesFile) -> Result<Leaves> {
    let below = file.below.map(|x| finite("leaves.below", [x])).transpose()?.map(|[x]| x);
    let after = file.after.map(|x| checked("leaves.after", [x], "0 or more", |x| x >= 0.0)).transpose()?.map(|[x]| x);
    Ok(Leaves { below, after })
}

/// The body with its mass from the file.
fn with_mass(mut body: Body, file: &BodyFile) -> Result<Body> {
    let dynamic = file.kind == BodyKind::Dynamic;
    match (file.density, file.mass, &file.mass_properties) {
        (None, None, None) => {}
        (Some(density), None, None) => {
            let [density] = positive("density", [density])?;
            body = body.density(density);
        }
        (None, Some(mass), None) => {
            let [mass] = positive("mass", [mass])?;
            if dynamic && !file.shapes.is_empty() {
                body = body.total_mass(mass);
            }
        }
        (None, None, Some(mass)) => {
            let mass = mass_properties(mass).map_err(|e| e.within("mass_properties"))?;
            if dynamic {
                body = body.mass_properties(mass);
            }
        }
        _ => return Err(Error::input("density, mass and mass_properties: give only one of them")),
    }
    if let Some(additional) = &file.additional_mass {
        ensure(file.mass_properties.is_none(), || "additional_mass: mass_properties give the whole mass".into())?;
        body = body.additional_mass(additional_mass(additional).map_err(|e| e.within("additional_mass"))?);
    }
    if dynamic && file.mass_properties.is_none() && file.shapes.is_empty() {
        return Err(Error::input("a dynamic body without shapes needs mass_properties"));
    }
    Ok(body)
}

fn mass_properties(file: &MassFile) -> Result<MassProperties> {
    let [mass] = positive("mass", [file.mass])?;
    Ok(MassProperties {
        mass,
        center: lengths("center", file.center)?.into(),
        principal_inertia: positive("principal_inertia", file.principal_inertia)?.into(),
        principal_frame: rotation("principal_frame", file.principal_frame)?,
    })
}

fn additional_mass(file: &AdditionalMassFile) -> Result<MassProperties> {
    let [mass] = positive("mass", [file.mass])?;
    let moments = checked("principal_inertia", file.principal_inertia, "0 or more", |x| x >= 0.0)?;
    Ok(MassProperties {
        mass,
        center: lengths("center", file.center)?.into(),
        principal_inertia: moments.into(),
        principal_frame: rotation("principal_frame", file.principal_frame)?,
    })
}

fn material(file: &MaterialFile) -> Result<Material> {
    let number = |name, x: f64| finite(name, [x]).map(|[x]| x);
    Ok(Material {
        friction: number("friction", file.friction)?,
        restitution: number("restitution", file.restitution)?,
        friction_rule: file.friction_rule,
        restitution_rule: file.restitution_rule,
        rolling_friction: number("rolling_friction", file.rolling_friction)?,
        spinning_friction: number("spinning_friction", file.spinning_friction)?,
        surface_velocity: finite("surface_velocity", file.surface_velocity)?.into(),
    })
}

/// A shape on a body: one collider, or one for each box of voxels on a dynamic body. They are checked before the body
/// computes a mass from them.
fn colliders(file: &ShapeFile, kind: BodyKind) -> Result<Vec<Collider>> {
    let extent = |name: &str, x: f64| finite(name, [x]).map(|[x]| x);
    let round = |of: fn(f32, f32) -> Shape, half_height: f64, radius: f64| -> Result<Shape> {
        Ok(of(extent("half_height", half_height)?, extent("radius", radius)?))
    };
    let own = |shape: Shape| -> Result<Collider> {
        shape.check()?;
        Ok(Collider {
            position: lengths("position", file.position)?.into(),
            rotation: rotation("rotation", file.rotation)?,
            sensor: file.sensor,
            material: file.material.as_ref().map(material).transpose().map_err(|e| e.within("material"))?,
            ..Collider::new(shape)
        })
    };
    let shape = match &file.geometry {
        Geometry::Ball { radius } => Shape::ball(extent("radius", *radius)?),
        Geometry::Cuboid { half_extents } => {
            let [x, y, z] = finite("half_extents", *half_extents)?;
            Shape::cuboid(x, y, z)
        }
        Geometry::Capsule { half_height, radius } => round(Shape::capsule, *half_height, *radius)?,
        Geometry::Cylinder { half_height, radius } => round(Shape::cylinder, *half_height, *radius)?,
        Geometry::Cone { half_height, radius } => round(Shape::cone, *half_height, *radius)?,
        Geometry::ConvexHull { points } => Shape::convex_hull(&vertices("points", points)?)?,
        Geometry::HalfSpace { normal } => Shape::half_space(unit("normal", *normal)?.into()),
        Geometry::Mesh { vertices: corners, triangles } => {
            Shape::mesh(vertices("vertices", corners)?, triangles.clone())?
        }
        Geometry::Voxels { size, cells } => {
            let (size, cells) =
                (finite("size", *size)?.into(), cells.iter().copied().map(IVec3::from).collect::<Vec<_>>());
            if kind == BodyKind::Dynamic {
                let boxes = Body::dynamic().voxels(size, &cells)?.colliders.into_iter();
                return boxes
                    .map(|part| {
                        let whole = own(part.shape)?;
                        Ok(Collider { position: whole.position + whole.rotation * part.position, ..whole })
                    })
                    .collect();
            }
            Shape::voxels(size, &cells)?
        }
        Geometry::HeightField { heights, scale } => {
            let height = |(k, row): (usize, &Vec<f64>)| {
                row.iter().map(|&h| extent(&format!("heights[{k}]"), h)).collect::<Result<Vec<f32>>>()
            };
            let heights = heights.iter().enumerate().map(height).collect::<Result<Vec<_>>>()?;
            Shape::height_field(&heights, finite("scale", *scale)?.into())?
        }
    };
    Ok(vec![own(shape)?])
}

fn vertices(name: &str, points: &[[f64; 3]]) -> Result<Vec<Vec3>> {
    points.iter().enumerate().map(|(k, &p)| lengths(format_args!("{name}[{k}]"), p).map(Vec3::from)).collect()
}
