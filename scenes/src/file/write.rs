//! Converts a world, at rest or in motion, to a scene file.

use parry3d::shape::TypedShape;

use super::schema::{
    AxisFile, BodyFile, BodyRef, DriverFile, Geometry, JointFile, JointKind, LeavesFile, MassFile, MaterialFile,
    MotorFile, SceneFile, ShapeFile, SpawnerFile, SpringFile,
};
use crate::driver::Driver;
use crate::scene::Scene;
use crate::spawner::{Leaves, Spawner};
use drystone::stages::error::{ensure, input};
use drystone::world::Collider;
use drystone::{Axis, Body, BodyKind, Bounds, Drive, Error, Joint, Linear, Material, Result};

/// The file of a scene, with every number to the last bit. The index of a body in the file counts only bodies that are
/// present.
pub(super) fn file(scene: &Scene) -> Result<SceneFile> {
    let world = &scene.world;
    let worlds = world.world_count();
    ensure(worlds == 1, || format!("a scene file has room for one world, but this scene has {worlds}"))?;
    if let Some(body) = world.first_non_finite() {
        return Err(input!(
            "body {} {:?}: its numbers are not finite: a scene file cannot represent them",
            body.index(),
            world.bodies[body].name
        ));
    }
    world.check_joints()?;
    let mut index_of = vec![usize::MAX; world.bodies.len()];
    let mut bodies = Vec::new();
    for handle in world.bodies.handles() {
        let i = handle.index();
        index_of[i] = bodies.len();
        let of_body = |e: Error| e.within(format_args!("body {i} {:?}", world.bodies[i].name));
        let leaves = scene.leaving.iter().find(|(body, _)| *body == handle).map(|(_, leaves)| *leaves);
        bodies.push(body(&world.bodies[i], leaves).map_err(of_body)?);
    }
    let of_spawner = |(k, s): (usize, &Spawner)| spawner(s).map_err(|e| e.within(format_args!("spawners[{k}]")));
    let of_driver = |driver: Driver| {
        let body = BodyRef::Index(index_of[driver.body().index()]);
        if driver.can_jump() { DriverFile::Character { body } } else { DriverFile::Vehicle { body } }
    };
    let of_joint = |(k, j): (usize, &Joint)| joint(j, &index_of).map_err(|e| e.within(format_args!("joints[{k}]")));
    Ok(SceneFile {
        version: 1,
        name: Some(scene.name.clone()),
        gravity: numbers(world.gravity_of(0).to_array()),
        dt: number(scene.dt),
        steps: scene.steps,
        container: scene.container.map(|(low, high)| [low, high].map(|corner| numbers(corner.to_array()))),
        bodies,
        joints: world.joints.iter().enumerate().map(of_joint).collect::<Result<_>>()?,
        spawners: scene.spawners.iter().enumerate().map(of_spawner).collect::<Result<_>>()?,
        driver: scene.driver.filter(|driver| world.body(driver.body()).is_some()).map(of_driver),
    })
}

/// The shortest decimal number that gives the same value in single precision.
fn number(x: f32) -> f64 {
    let short = x.to_string().parse().unwrap_or(f64::from(x));
    if short as f32 == x { short } else { f64::from(x) }
}

fn numbers<const N: usize>(x: [f32; N]) -> [f64; N] {
    x.map(number)
}

fn spawner(s: &Spawner) -> Result<SpawnerFile> {
    let Spawner { first, every, count, .. } = *s;
    Ok(SpawnerFile { body: body(&s.body, Some(s.leaves))?, first, every: every.max(1), count })
}

fn body(b: &Body, leaves: Option<Leaves>) -> Result<BodyFile> {
    let mass = |b: &Body| MassFile {
        mass: number(b.mass.mass),
        center: numbers(b.mass.center.to_array()),
        principal_inertia: numbers(b.mass.principal_inertia.to_array()),
        principal_frame: numbers(b.mass.principal_frame.to_array()),
    };
    let leaves = leaves.filter(|leaves| *leaves != Leaves::default());
    let own = material(&b.material);
    Ok(BodyFile {
        name: Some(b.name.clone()),
        kind: b.kind,
        position: numbers(b.position.to_array()),
        rotation: numbers(b.rotation.to_array()),
        linear_velocity: numbers(b.linear_velocity.to_array()),
        angular_velocity: numbers(b.angular_velocity.to_array()),
        force: numbers(b.force.to_array()),
        torque: numbers(b.torque.to_array()),
        gravity_scale: number(b.gravity_scale),
        linear_damping: number(b.linear_damping),
        angular_damping: number(b.angular_damping),
        locked_rotations: b.locked_rotations,
        locked_translations: b.locked_translations,
        max_linear_speed: Some(b.max_linear_speed).filter(|speed| speed.is_finite()).map(number),
        max_angular_speed: Some(b.max_angular_speed).filter(|speed| speed.is_finite()).map(number),
        can_sleep: b.can_sleep,
        density: None,
        mass: None,
        mass_properties: (b.kind == BodyKind::Dynamic).then(|| mass(b)),
        additional_mass: None,
        friction: own.friction,
        restitution: own.restitution,
        friction_rule: own.friction_rule,
        restitution_rule: own.restitution_rule,
        rolling_friction: own.rolling_friction,
        spinning_friction: own.spinning_friction,
        surface_velocity: own.surface_velocity,
        groups: b.groups,
        swept: b.swept,
        leaves: leaves.map(|Leaves { below, after }| LeavesFile { below: below.map(number), after: after.map(number) }),
        shapes: b.colliders.iter().map(shape).collect::<Result<_>>()?,
    })
}

fn shape(c: &Collider) -> Result<ShapeFile> {
    let points = |all: &[glam::Vec3]| all.iter().map(|p| numbers(p.to_array())).collect();
    let geometry = match c.shape.parry().as_typed_shape() {
        TypedShape::Ball(ball) => Geometry::Ball { radius: number(ball.radius) },
        TypedShape::Cuboid(cuboid) => Geometry::Cuboid { half_extents: numbers(cuboid.half_extents.to_array()) },
        TypedShape::Capsule(c) => Geometry::Capsule { half_height: number(c.segment.b.y), radius: number(c.radius) },
        TypedShape::Cylinder(c) => Geometry::Cylinder { half_height: number(c.half_height), radius: number(c.radius) },
        TypedShape::Cone(c) => Geometry::Cone { half_height: number(c.half_height), radius: number(c.radius) },
        TypedShape::ConvexPolyhedron(hull) => Geometry::ConvexHull { points: points(hull.points()) },
        TypedShape::HalfSpace(plane) => Geometry::HalfSpace { normal: numbers(plane.normal.to_array()) },
        TypedShape::TriMesh(mesh) => {
            Geometry::Mesh { vertices: points(mesh.vertices()), triangles: mesh.indices().to_vec() }
        }
        TypedShape::HeightField(field) => {
            let heights = field.heights();
            let row = |i: usize| (0..heights.ncols()).map(|j| number(heights[(i, j)])).collect();
            Geometry::HeightField {
                heights: (0..heights.nrows()).map(row).collect(),
                scale: numbers(field.scale().to_array()),
            }
        }
        _ => return Err(input!("a shape of type {:?}: a scene file cannot represent it", c.shape)),
    };
    let (position, rotation) = (numbers(c.position.to_array()), numbers(c.rotation.to_array()));
    Ok(ShapeFile { position, rotation, sensor: c.sensor, material: c.material.as_ref().map(material), geometry })
}

fn material(of: &Material) -> MaterialFile {
    MaterialFile {
        friction: number(of.friction),
        restitution: number(of.restitution),
        friction_rule: of.friction_rule,
        restitution_rule: of.restitution_rule,
        rolling_friction: number(of.rolling_friction),
        spinning_friction: number(of.spinning_friction),
        surface_velocity: numbers(of.surface_velocity.to_array()),
    }
}

fn joint(joint: &Joint, index_of: &[usize]) -> Result<JointFile> {
    let kind = match joint.linear {
        _ if joint.is_ball() => JointKind::Ball {},
        Linear::Distance(distance) if joint.angular == [Axis::FREE; 3] => {
            let AxisFile { locked: _, limits, motor, spring } = axis(&distance);
            JointKind::Distance { limits, motor, spring }
        }
        Linear::Distance(_) => {
            return Err(input!("it restricts both its distance and its angles: a scene file cannot represent both"));
        }
        Linear::Axes(linear) => JointKind::Generic {
            frame: [0.0, 0.0, 0.0, 1.0],
            frames: Some([joint.frame_a, joint.frame_b].map(|frame| numbers(frame.to_array()))),
            linear: Box::new(linear.each_ref().map(axis)),
            angular: Box::new(joint.angular.each_ref().map(axis)),
        },
    };
    Ok(JointFile {
        bodies: [Some(joint.body_a), joint.body_b]
            .into_iter()
            .flatten()
            .map(|b| BodyRef::Index(index_of[b.index()]))
            .collect(),
        anchor: None,
        anchors: Some([joint.anchor_a, joint.anchor_b].map(|anchor| numbers(anchor.to_array()))),
        collide: joint.collide,
        enabled: joint.enabled,
        break_force: (joint.break_force < f32::INFINITY).then(|| number(joint.break_force)),
        kind,
    })
}

fn axis(axis: &Axis) -> AxisFile {
    let mut file = AxisFile { locked: axis.bounds == Bounds::Locked, ..AxisFile::default() };
    if let Bounds::Between { min, max } = axis.bounds {
        file.limits = Some([number(min), number(max)]);
    }
    match axis.drive {
        Drive::None => {}
        Drive::Motor { speed, max_load } => {
            file.motor = Some(MotorFile { speed: number(speed), max_load: number(max_load) });
        }
        Drive::Spring { target, frequency, damping_ratio, max_load } => {
            file.spring = Some(SpringFile {
                target: number(target),
                frequency: Some(number(frequency)),
                damping_ratio: Some(number(damping_ratio)),
                stiffness: None,
                damping: None,
                max_load: (max_load < f32::MAX).then(|| number(max_load)),
            });
        }
        Drive::SpringDamper { target, stiffness, damping, max_load } => {
            file.spring = Some(SpringFile {
                target: number(target),
                frequency: None,
                damping_ratio: None,
                stiffness: Some(number(stiffness)),
                damping: Some(number(damping)),
                max_load: (max_load < f32::MAX).then(|| number(max_load)),
            });
        }
    }
    file
}
