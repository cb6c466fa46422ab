//! From what a scene file says to a scene: every value is checked, and every refusal is one line.

use std::fmt::Display;

use glam::{Quat, Vec3};

use super::Scene;
use super::file::{BodyFile, Geometry, MassFile, SceneFile, ShapeFile};
use super::joint::joint;
use crate::config::{LONGEST_STEP, SHORTEST_STEP};
use crate::error::{Error, Result};
use crate::world::{Body, BodyKind, MOST_GRAVITY, MOST_LENGTH, MOST_SPEED, MassProperties, Shape, World};

/// How far a quaternion or a normal may be from length 1; nearer ones are normalized.
const UNIT_TOLERANCE: f64 = 1e-3;

/// The scene that a file describes, named `name` if the file gives it none.
pub(super) fn scene(file: SceneFile, name: &str) -> Result<Scene> {
    if file.version != 1 {
        return Err(unknown_version(file.version));
    }
    let dt = one("dt", file.dt, "1e-9 to 1", |x| (SHORTEST_STEP..=LONGEST_STEP).contains(&x))?;
    let mut world = World { gravity: gravity(file.gravity)?.into(), ..World::new() };
    let container = file.container.map(container).transpose()?;
    for (index, body_file) in file.bodies.into_iter().enumerate() {
        let built = body(&body_file).map_err(|e| e.within(body_label(index, body_file.name.as_deref())))?;
        world.add(built.named(body_file.name.unwrap_or_else(|| format!("body {index}"))));
    }
    for (index, joint_file) in file.joints.iter().enumerate() {
        let joint = joint(joint_file, &world).map_err(|e| e.within(format_args!("joints[{index}]")))?;
        world.join(joint);
    }
    Ok(Scene { dt, container, ..Scene::new(file.name.unwrap_or_else(|| name.to_owned()), world, file.steps) })
}

pub(super) fn unknown_version(version: impl Display) -> Error {
    Error::input(format!("version = {version}: only version 1 is known"))
}

/// What a message calls a body: its index and, if it has one, its name.
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
    let mut body = match file.kind {
        BodyKind::Fixed => Body::fixed(),
        BodyKind::Kinematic => Body::kinematic(),
        BodyKind::Dynamic => Body::dynamic(),
    };
    let [x, y, z] = lengths("position", file.position)?;
    let velocity = |name, v| if file.kind == BodyKind::Fixed { zero(name, v) } else { speed(name, v) };
    let linear = velocity("linear_velocity", file.linear_velocity)?;
    let angular = velocity("angular_velocity", file.angular_velocity)?;
    let pushed = |x: f32| x == 0.0 || file.kind == BodyKind::Dynamic;
    let force = checked("force", file.force, "zero unless the body is dynamic", pushed)?;
    body.force = force.into();
    let mut body = body
        .position(x, y, z)
        .rotation(rotation("rotation", file.rotation)?)
        .velocity(linear.into(), angular.into())
        .friction(one("friction", file.friction, "0 or more", |x| x >= 0.0)?)
        .restitution(one("restitution", file.restitution, "0 to 1", |x| (0.0..=1.0).contains(&x))?);
    for (k, part) in file.shapes.iter().enumerate() {
        let place = format!("shapes[{k}]");
        let (shape, at, turned) = shape(part).map_err(|e| e.within(&place))?;
        if file.kind != BodyKind::Fixed && !shape.has_volume() {
            let message = "half-space, mesh and height field have no mass: only a fixed body can carry them";
            return Err(Error::input(message).within(place));
        }
        body = body.shape_at(shape, at, turned);
    }
    with_mass(body, file)
}

/// The body with the mass that the file gives it.
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
    if dynamic && file.mass_properties.is_none() && file.shapes.is_empty() {
        return Err(Error::input("a dynamic body without shapes needs mass_properties"));
    }
    if dynamic {
        body.mass.check()?;
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

fn shape(file: &ShapeFile) -> Result<(Shape, Vec3, Quat)> {
    let shape = match &file.geometry {
        Geometry::Ball { radius } => Shape::ball(size("radius", *radius)?),
        Geometry::Cuboid { half_extents } => {
            let [x, y, z] = sizes("half_extents", *half_extents)?;
            Shape::cuboid(x, y, z)
        }
        Geometry::Capsule { half_height, radius } => {
            Shape::capsule(size("half_height", *half_height)?, size("radius", *radius)?)
        }
        Geometry::Cylinder { half_height, radius } => {
            Shape::cylinder(size("half_height", *half_height)?, size("radius", *radius)?)
        }
        Geometry::Cone { half_height, radius } => {
            Shape::cone(size("half_height", *half_height)?, size("radius", *radius)?)
        }
        Geometry::ConvexHull { points } => Shape::convex_hull(&vertices("points", points)?)?,
        Geometry::HalfSpace { normal } => Shape::half_space(unit("normal", *normal)?.into()),
        Geometry::Mesh { vertices: corners, triangles } => {
            Shape::mesh(vertices("vertices", corners)?, triangles.clone())?
        }
        Geometry::HeightField { heights, scale } => height_field(heights, *scale)?,
    };
    Ok((shape, lengths("position", file.position)?.into(), rotation("rotation", file.rotation)?))
}

fn height_field(heights: &[Vec<f64>], scale: [f64; 3]) -> Result<Shape> {
    let scale = sizes("scale", scale)?;
    let height = |row: usize, column: usize, h: f64| {
        let fits = |h: f32| (h * scale[1]).abs() <= MOST_LENGTH;
        one(format_args!("heights[{row}][{column}]"), h, "at most 1e9 m in size, scaled", fits)
    };
    let rows = heights.iter().enumerate();
    let rows = rows.map(|(r, row)| row.iter().enumerate().map(|(c, &h)| height(r, c, h)).collect());
    Shape::height_field(&rows.collect::<Result<Vec<Vec<f32>>>>()?, scale.into())
}

fn vertices(name: &str, points: &[[f64; 3]]) -> Result<Vec<Vec3>> {
    points.iter().enumerate().map(|(k, &p)| lengths(format_args!("{name}[{k}]"), p).map(Vec3::from)).collect()
}

/// The values in single precision if each of them `fits`; else a line that says what they `must` be.
fn checked<const N: usize>(
    name: impl Display,
    values: [f64; N],
    must: &str,
    fits: impl Fn(f32) -> bool,
) -> Result<[f32; N]> {
    let rounded = values.map(|x| x as f32);
    if !rounded.iter().all(|x| x.is_finite()) {
        return Err(refusal(name, &values, "finite in single precision"));
    }
    if rounded.iter().all(|&x| fits(x)) { Ok(rounded) } else { Err(refusal(name, &values, must)) }
}

fn one(name: impl Display, value: f64, must: &str, fits: impl Fn(f32) -> bool) -> Result<f32> {
    checked(name, [value], must, fits).map(|[x]| x)
}

fn gravity(values: [f64; 3]) -> Result<[f32; 3]> {
    checked("gravity", values, "at most 1e9 m/s² in size", |x| x.abs() <= MOST_GRAVITY)
}

fn speed<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "at most 1e9 in size", |x| x.abs() <= MOST_SPEED)
}

fn zero<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "zero for a fixed body", |x| x == 0.0)
}

fn positive<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "positive", |x| x > 0.0)
}

/// Coordinates.
pub(super) fn lengths<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "at most 1e9 m in size", |x| x.abs() <= MOST_LENGTH)
}

/// Extents.
fn sizes<const N: usize>(name: impl Display, values: [f64; N]) -> Result<[f32; N]> {
    checked(name, values, "positive and at most 1e9 m", |x| x > 0.0 && x <= MOST_LENGTH)
}

fn size(name: &str, value: f64) -> Result<f32> {
    sizes(name, [value]).map(|[x]| x)
}

fn rotation(name: &str, values: [f64; 4]) -> Result<Quat> {
    unit(name, values).map(Quat::from_array)
}

/// A direction or a quaternion, normalized.
fn unit<const N: usize>(name: &str, values: [f64; N]) -> Result<[f32; N]> {
    let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(values.map(|x| (x / length) as f32))
    } else {
        Err(refusal(name, &values, &format!("of length 1, but has length {}", shown(&[length]))))
    }
}

/// One line: what a value is called, what it is, and what it must be.
fn refusal(name: impl Display, values: &[f64], must: &str) -> Error {
    Error::input(format!("{name} = {}: must be {must}", shown(values)))
}

/// Numbers as in the file: `-1`, `1e39`, `[0.5, 0, 0]`.
fn shown(values: &[f64]) -> String {
    let texts = values.iter().map(|x| {
        let text = format!("{x:?}");
        text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
    });
    let list = texts.collect::<Vec<_>>().join(", ");
    if values.len() == 1 { list } else { format!("[{list}]") }
}
