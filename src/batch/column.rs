//! Columns of numbers: a row for each body, joint or drive of a world.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::Member;
use crate::error::{Result, ensure, input};
use crate::names::named;
use crate::world::{Axis, Body, Drive, Joint, JointHandle, Linear, MassProperties, World};

/// A kind of numbers of a world, with a row for each body, joint, drive or world. See [`Member::read`].
///
/// ```
/// use drystone::batch::{Batch, Column};
/// use drystone_scenes::Scene;
/// use drystone::SolverConfig;
///
/// let scene = Scene::find("tower", &["n=2".into()])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 1)?;
/// let world = batch.world_mut(0);
/// let mut position = [0.0; 9];
/// world.read(Column::Position, &mut position);
/// assert_eq!(position[3..], [0.0, 0.5, 0.0, 0.0, 1.5, 0.0]);
/// // Forces last until they change.
/// world.write(Column::Force, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0])?;
/// assert_eq!(world.simulation().world.bodies[2].force.x, 50.0);
/// assert!(world.write(Column::JointSpeed, &[]).is_err(), "a derived column cannot be written");
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Column {
    /// Position of each body (m).
    Position,
    /// Rotation of each body, x y z w.
    Rotation,
    /// Velocity of each center of mass (m/s).
    LinearVelocity,
    /// Angular velocity of each body (rad/s).
    AngularVelocity,
    /// Lasting force on each body (N).
    Force,
    /// Lasting torque on each body (N m).
    Torque,
    /// Friction coefficient of each body.
    Friction,
    /// Restitution coefficient of each body.
    Restitution,
    /// Factor on the mass and moments of inertia of each body, relative to the start of the world; 1 for a body without
    /// mass, which stays without mass.
    MassScale,
    /// Gravity of the world (m/s²).
    Gravity,
    /// Speed of each motor and target of each spring, in the order of [`drives`].
    Control,
    /// Three positions (m) and three angles (rad) of each joint.
    JointPosition,
    /// Rates of the joint positions (m/s, rad/s).
    JointSpeed,
    /// Force of each joint on its body b: [`Simulation::joint_force`](crate::Simulation::joint_force) (N).
    JointForce,
    /// Torque of each joint on its body b: [`Simulation::joint_torque`](crate::Simulation::joint_torque) (N m).
    JointTorque,
    /// Impulse of each joint on its body b in the last substep (N s).
    JointImpulse,
    /// Angular impulse of each joint on its body b in the last substep (N m s).
    JointTorqueImpulse,
}

named!(Column {
    Position = "position",
    Rotation = "rotation",
    LinearVelocity = "linear_velocity",
    AngularVelocity = "angular_velocity",
    Force = "force",
    Torque = "torque",
    Friction = "friction",
    Restitution = "restitution",
    MassScale = "mass_scale",
    Gravity = "gravity",
    Control = "ctrl",
    JointPosition = "joint_position",
    JointSpeed = "joint_speed",
    JointForce = "joint_force",
    JointTorque = "joint_torque",
    JointImpulse = "joint_impulse",
    JointTorqueImpulse = "joint_torque_impulse",
});

impl Column {
    /// Number of values in a row.
    pub const fn width(self) -> usize {
        match self {
            Self::Control | Self::Friction | Self::Restitution | Self::MassScale => 1,
            Self::Rotation => 4,
            Self::JointPosition | Self::JointSpeed => 6,
            _ => 3,
        }
    }

    /// Number of rows for a world.
    pub fn rows(self, world: &World) -> usize {
        match self {
            Self::Gravity => 1,
            Self::Control => drives(world).count(),
            Self::JointPosition
            | Self::JointSpeed
            | Self::JointForce
            | Self::JointTorque
            | Self::JointImpulse
            | Self::JointTorqueImpulse => world.joints.len(),
            _ => world.bodies.len(),
        }
    }
}

/// A drive of a joint: the joint, and the index of its axis. Translations (or the distance) come before rotations.
///
/// ```
/// use drystone::batch::{Column, DriveOf, drives};
///
/// let scene = drystone_scenes::Scene::find("drawbridge", &[])?;
/// let all: Vec<DriveOf> = drives(&scene.world).collect();
/// assert_eq!((all[0].name.as_str(), all[1].name.as_str()), ("joint 1: deck - tower", "joint 2: deck - tower"));
/// assert_eq!((Column::Control.rows(&scene.world), Column::Control.width()), (2, 1));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DriveOf {
    /// The joint.
    pub joint: JointHandle,
    /// Index of the axis.
    pub axis: usize,
    /// The joint, its bodies by name, and the axis if the joint has several drives.
    pub name: String,
}

/// The driven axes of a world, in the order of its joints.
pub fn drives(world: &World) -> impl Iterator<Item = DriveOf> + '_ {
    world.joints.iter().zip(world.joints.handles()).enumerate().flat_map(move |(index, (joint, &handle))| {
        let own: Vec<usize> = driven(joint).collect();
        let is_one = own.len() == 1;
        own.into_iter().map(move |axis| {
            let bodies = name_of(world, joint);
            let name =
                format!("joint {index}: {bodies}") + &if is_one { String::new() } else { format!(", axis {axis}") };
            DriveOf { joint: handle, axis, name }
        })
    })
}

fn driven(joint: &Joint) -> impl Iterator<Item = usize> + '_ {
    let axes = joint.linear_axes().iter().chain(&joint.angular).enumerate();
    axes.filter(|(_, axis)| axis.drive != Drive::None).map(|(k, _)| k)
}

fn name_of(world: &World, joint: &Joint) -> String {
    let name = |body: usize| match world.bodies.get(body) {
        Some(body) if !body.name.is_empty() => body.name.clone(),
        _ => format!("body {body}"),
    };
    let (a, b) = joint.indices();
    format!("{} - {}", name(a), b.map_or_else(|| "world".into(), name))
}

fn axes_mut(joint: &mut Joint) -> impl Iterator<Item = &mut Axis> {
    let linear = match &mut joint.linear {
        Linear::Axes(axes) => axes.as_mut_slice(),
        Linear::Distance(distance) => std::slice::from_mut(distance),
    };
    linear.iter_mut().chain(&mut joint.angular)
}

/// The number of a drive that a controller sets.
fn aim(drive: &mut Drive) -> Option<&mut f32> {
    match drive {
        Drive::None => None,
        Drive::Motor { speed, .. } => Some(speed),
        Drive::Spring { target, .. } | Drive::SpringDamper { target, .. } => Some(target),
    }
}

impl Member {
    /// Writes a column into `out`, row by row. The rest of `out`, and rows of vacant bodies, become NaN.
    pub fn read(&self, column: Column, out: &mut [f32]) {
        out.fill(f32::NAN);
        let world = &self.simulation().world;
        let rows = out.chunks_exact_mut(column.width());
        let joints = |of: &dyn Fn(JointHandle) -> Option<Vec3>| -> Vec<Option<[f32; 3]>> {
            world.joints.handles().iter().map(|&joint| of(joint).map(|v| v.to_array())).collect()
        };
        let bodies = || world.bodies.iter().enumerate().map(|(i, body)| (!world.bodies.is_vacant(i)).then_some(body));
        match column {
            Column::Position => put(rows, bodies().map(|b| b.map(|b| b.position.to_array()))),
            Column::Rotation => put(rows, bodies().map(|b| b.map(|b| b.rotation.to_array()))),
            Column::LinearVelocity => put(rows, bodies().map(|b| b.map(|b| b.linear_velocity.to_array()))),
            Column::AngularVelocity => put(rows, bodies().map(|b| b.map(|b| b.angular_velocity.to_array()))),
            Column::Force => put(rows, bodies().map(|b| b.map(|b| b.force.to_array()))),
            Column::Torque => put(rows, bodies().map(|b| b.map(|b| b.torque.to_array()))),
            Column::Friction => put(rows, bodies().map(|b| b.map(|b| [b.material.friction]))),
            Column::Restitution => put(rows, bodies().map(|b| b.map(|b| [b.material.restitution]))),
            Column::MassScale => {
                let first = self.start().world();
                put(rows, bodies().enumerate().map(|(i, body)| body.map(|body| [scale_of(body, first.bodies.get(i))])));
            }
            Column::Gravity => put(rows, [Some(world.gravity_of(0).to_array())]),
            Column::Control => put(rows, world.joints.iter().flat_map(aims).map(|aim| Some([aim]))),
            Column::JointPosition => put(rows, world.joints.iter().map(|j| Some(world.joint_motion(j).position))),
            Column::JointSpeed => put(rows, world.joints.iter().map(|j| Some(world.joint_motion(j).speed))),
            Column::JointForce => put(rows, joints(&|joint| self.simulation().joint_force(joint))),
            Column::JointTorque => put(rows, joints(&|joint| self.simulation().joint_torque(joint))),
            Column::JointImpulse => put(rows, joints(&|joint| self.simulation().joint_impulse(joint))),
            Column::JointTorqueImpulse => put(rows, joints(&|joint| self.simulation().joint_angular_impulse(joint))),
        }
    }

    /// Sets a column: poses, velocities, forces, torques, materials, masses, gravity or drives. Rows of vacant bodies
    /// are skipped. Joints, and contacts that still touch, keep their impulses.
    ///
    /// # Errors
    /// The column is derived from others and cannot be written, or there are fewer numbers than it needs. The next step
    /// checks the values.
    pub fn write(&mut self, column: Column, values: &[f32]) -> Result<()> {
        if column == Column::MassScale {
            return self.scale_masses(values);
        }
        write(&mut self.simulation_mut().world, column, values)
    }

    fn scale_masses(&mut self, scales: &[f32]) -> Result<()> {
        let start = Arc::clone(self.start());
        let bodies = &mut self.simulation_mut().world.bodies;
        ensure(scales.len() >= bodies.len(), || {
            format!("mass_scale has {} numbers: must be {}", scales.len(), bodies.len())
        })?;
        for (i, &scale) in scales.iter().enumerate().take(bodies.len()) {
            let first = start.world().bodies.get(i).filter(|first| first.mass.mass > 0.0);
            let Some(first) = first.filter(|_| !bodies.is_vacant(i)) else { continue };
            // An unchanged mass keeps its bits.
            if scale == scale_of(&bodies[i], Some(first)) {
                continue;
            }
            let mass = first.mass.mass * scale;
            ensure(MassProperties::MASSES.contains(&mass), || {
                format!("mass_scale = {scale} of a body of {} kg: must give 1e-15 to 1e15 kg", first.mass.mass)
            })?;
            bodies[i].mass.mass = mass;
            bodies[i].mass.principal_inertia = first.mass.principal_inertia * scale;
        }
        Ok(())
    }
}

/// The mass of a body divided by its mass at the start; 1 for a body without mass.
fn scale_of(body: &Body, first: Option<&Body>) -> f32 {
    first.filter(|first| first.mass.mass > 0.0).map_or(1.0, |first| body.mass.mass / first.mass.mass)
}

/// [`Member::write`] for a world.
///
/// # Errors
/// Those of [`Member::write`].
pub fn write(world: &mut World, column: Column, values: &[f32]) -> Result<()> {
    let needed = column.rows(world) * column.width();
    ensure(values.len() >= needed, || format!("{column} has {} numbers: must be {needed}", values.len()))?;
    let vector = |row: &[f32]| Vec3::new(row[0], row[1], row[2]);
    let rows = values.chunks_exact(column.width());
    if let Column::Gravity = column {
        world.gravity = vector(values);
        world.own_gravity.clear();
        return Ok(());
    }
    if let Column::Control = column {
        let aims = world.joints.iter_mut().flat_map(axes_mut).filter_map(|axis| aim(&mut axis.drive));
        aims.zip(values).for_each(|(aim, value)| *aim = *value);
        return Ok(());
    }
    let is_there: Vec<bool> = (0..world.bodies.len()).map(|i| !world.bodies.is_vacant(i)).collect();
    let bodies = world.bodies.iter_mut().zip(rows).zip(is_there).filter(|all| all.1).map(|all| all.0);
    match column {
        Column::Position => bodies.for_each(|(body, row)| body.position = vector(row)),
        Column::Rotation => bodies.for_each(|(body, row)| body.rotation = Quat::from_slice(row)),
        Column::LinearVelocity => bodies.for_each(|(body, row)| body.linear_velocity = vector(row)),
        Column::AngularVelocity => bodies.for_each(|(body, row)| body.angular_velocity = vector(row)),
        Column::Force => bodies.for_each(|(body, row)| body.force = vector(row)),
        Column::Torque => bodies.for_each(|(body, row)| body.torque = vector(row)),
        Column::Friction => bodies.for_each(|(body, row)| body.material.friction = row[0]),
        Column::Restitution => bodies.for_each(|(body, row)| body.material.restitution = row[0]),
        _ => return Err(input!("{column} follows from the state: it cannot be written")),
    }
    Ok(())
}

fn aims(joint: &Joint) -> impl Iterator<Item = f32> + '_ {
    let axes = joint.linear_axes().iter().chain(&joint.angular);
    axes.filter_map(|axis| aim(&mut axis.drive.clone()).map(|aim| *aim))
}

fn put<'a, const N: usize>(
    rows: impl Iterator<Item = &'a mut [f32]>,
    values: impl IntoIterator<Item = Option<[f32; N]>>,
) {
    for (row, value) in rows.zip(values) {
        if let Some(value) = value {
            row.copy_from_slice(&value);
        }
    }
}
