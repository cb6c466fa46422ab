//! Converts a joint of a scene file to a joint of the world.

use std::f32::consts::PI;
use std::fmt;

use glam::{Quat, Vec3};

use super::numbers::{checked, finite, lengths, positive, rotation, unit};
use super::schema::{AxisFile, BodyRef, JointFile, JointKind, MotorFile, SpringFile};
use drystone::stages::error::{ensure, input};
use drystone::stages::math as turn;
use drystone::{Axis, BodyHandle, BodyKind, Bounds, Drive, Error, Joint, Result, World};

impl fmt::Display for BodyRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}

impl BodyRef {
    /// The body in `world`.
    pub(super) fn find(&self, world: &World) -> Result<BodyHandle> {
        let count = world.bodies.len();
        match self {
            Self::Index(index) => {
                let body = world.bodies.handle(*index);
                body.ok_or_else(|| input!("body {index}: must be less than {count}, the number of bodies"))
            }
            Self::Name(name) => {
                let mut named = world.bodies.handles().filter(|&body| world.bodies[body].name == *name);
                match (named.next(), named.next()) {
                    (Some(body), None) => Ok(body),
                    (None, _) => Err(input!("body {name:?}: no body has that name")),
                    (Some(a), Some(b)) => {
                        let [a, b] = [a, b].map(BodyHandle::index);
                        Err(input!("body {name:?}: bodies {a} and {b} have that name; give an index"))
                    }
                }
            }
        }
    }
}

/// The joint that `file` describes, between bodies of `world`.
pub(super) fn joint(file: &JointFile, world: &World) -> Result<Joint> {
    let JointFile { bodies, anchor, anchors, collide, enabled, break_force, kind } = file;
    let (a, b) = match &bodies[..] {
        [a] => (a.find(world)?, None),
        [a, b] => (a.find(world)?, Some(b.find(world)?)),
        _ => return Err(input!("{} bodies: a joint connects one or two", bodies.len())),
    };
    ensure(b != Some(a), || format!("bodies {} and {}: the same body twice", bodies[0], bodies[1]))?;
    let dynamic = |body: BodyHandle| world.bodies[body].kind == BodyKind::Dynamic;
    let message = "no body of the joint can move: at least one must be dynamic";
    ensure(dynamic(a) || b.is_some_and(dynamic), || message.into())?;
    let between = |anchor_a, anchor_b| Joint { body_b: b, ..Joint::to_world(a, anchor_a, anchor_b) };
    let (anchor_a, anchor_b) = match (anchor, anchors) {
        (Some(point), None) => {
            let point = lengths("anchor", *point)?.into();
            let Joint { anchor_a, anchor_b, .. } = between(point, point).in_world(world);
            (anchor_a, anchor_b)
        }
        (None, Some([on_a, on_b])) => (lengths("anchors[0]", *on_a)?.into(), lengths("anchors[1]", *on_b)?.into()),
        _ => return Err(Error::input("anchor and anchors: give one of them")),
    };
    let break_force = match break_force {
        Some(force) => positive("break_force", [*force])?[0],
        None => f32::INFINITY,
    };
    let joint = Joint { collide: *collide, enabled: *enabled, break_force, ..between(anchor_a, anchor_b) };
    // Choose frames that agree at the present rotations of the bodies.
    let in_world = |frame: Quat| {
        let Joint { frame_a, frame_b, .. } = Joint { frame_a: frame, frame_b: frame, ..joint }.in_world(world);
        Joint { frame_a, frame_b, ..joint }
    };
    let along = |direction: &[f64; 3]| -> Result<Joint> {
        let direction = Vec3::from(unit("axis", *direction)?);
        Ok(in_world(turn::arc(Vec3::X, direction)))
    };
    const LOCKED: Axis = Axis::LOCKED;
    let joint = match kind {
        JointKind::Ball {} => joint,
        JointKind::Fixed {} => in_world(Quat::IDENTITY).fixed(),
        JointKind::Hinge { axis, limits, motor, spring } => {
            let turn = read_axis("", false, limits, motor, spring)?;
            along(axis)?.generic([LOCKED; 3], [turn, LOCKED, LOCKED])
        }
        JointKind::Slider { axis, limits, motor, spring } => {
            let shift = read_axis("", false, limits, motor, spring)?;
            along(axis)?.generic([shift, LOCKED, LOCKED], [LOCKED; 3])
        }
        JointKind::Distance { limits, motor, spring } => {
            joint.at_distance(read_axis("", false, limits, motor, spring)?)
        }
        JointKind::Cone { axis, angle } => {
            let in_range = |angle: f32| angle > 0.0 && angle < PI;
            let [angle] = checked("angle", [*angle], "more than 0 and less than pi", in_range)?;
            along(axis)?.cone(angle)
        }
        JointKind::Generic { frame, frames, linear, angular } => {
            let [linear, angular] = [("linear", linear), ("angular", angular)].map(|(name, axes)| {
                let mut read = [LOCKED; 3];
                for (i, AxisFile { locked, limits, motor, spring }) in axes.iter().enumerate() {
                    read[i] = read_axis(&format!("{name}[{i}]."), *locked, limits, motor, spring)?;
                }
                Ok(read)
            });
            let joint = match frames {
                Some([frame_a, frame_b]) => {
                    let (frame_a, frame_b) = (rotation("frames[0]", *frame_a)?, rotation("frames[1]", *frame_b)?);
                    Joint { frame_a, frame_b, ..joint }
                }
                None => in_world(rotation("frame", *frame)?),
            };
            joint.generic(linear?, angular?)
        }
    };
    joint.check_axes()?;
    Ok(joint)
}

fn read_axis(
    name: &str,
    locked: bool,
    limits: &Option<[f64; 2]>,
    motor: &Option<MotorFile>,
    spring: &Option<SpringFile>,
) -> Result<Axis> {
    let bounds = match limits {
        Some(_) if locked => return Err(input!("{name}locked and {name}limits: give one of them")),
        Some(limits) => {
            // An absent limit is infinite, and numbers in a file are finite.
            let given = limits.map(|limit| if limit.is_infinite() { 0.0 } else { limit });
            let given = finite(format!("{name}limits"), given)?;
            let [min, max] = [0, 1].map(|i| if limits[i].is_infinite() { limits[i] as f32 } else { given[i] });
            Bounds::Between { min, max }
        }
        None if locked => Bounds::Locked,
        None => Bounds::Free,
    };
    let number = |key: &str, value: f64| -> Result<f32> { Ok(finite(format!("{name}{key}"), [value])?[0]) };
    let drive = match (motor, spring) {
        (Some(_), Some(_)) => return Err(input!("{name}motor and {name}spring: give one of them")),
        (Some(MotorFile { speed, max_load }), None) => {
            Drive::Motor { speed: number("motor.speed", *speed)?, max_load: number("motor.max_load", *max_load)? }
        }
        (None, Some(SpringFile { target, frequency, damping_ratio, stiffness, damping, max_load })) => {
            let target = number("spring.target", *target)?;
            let max_load = max_load.map_or(Ok(f32::MAX), |max_load| number("spring.max_load", max_load))?;
            match (frequency, damping_ratio, stiffness, damping) {
                (Some(frequency), ratio, None, None) => Drive::Spring {
                    target,
                    frequency: number("spring.frequency", *frequency)?,
                    damping_ratio: number("spring.damping_ratio", ratio.unwrap_or(1.0))?,
                    max_load,
                },
                (None, None, Some(stiffness), damping) => Drive::SpringDamper {
                    target,
                    stiffness: number("spring.stiffness", *stiffness)?,
                    damping: number("spring.damping", damping.unwrap_or(0.0))?,
                    max_load,
                },
                _ => {
                    return Err(input!("{name}spring: give frequency, with damping_ratio, or stiffness, with damping"));
                }
            }
        }
        (None, None) => Drive::None,
    };
    Ok(Axis { bounds, drive })
}
