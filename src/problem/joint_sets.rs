//! An estimate of the gaps that sweeps would leave in the joints of a connected set of bodies. It decides the substeps
//! of nets, whose joints are not solved directly.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3, Vec4};

use super::joint_loads::borne;
use crate::config::SolverConfig;
use crate::world::{Body, BodyKind, Bounds, Joint, Linear, World};

/// The largest gap at rest that sweeps leave in any joint of a set, as a share of the arms of the joint. `sides` are
/// the movable bodies of a joint; `substep` is the length of a substep (s).
pub fn gap_of_sweeps(
    joints: &[u32],
    world: &World,
    config: &SolverConfig,
    substep: f32,
    sides: impl Fn(u32) -> [Option<u32>; 2],
) -> f32 {
    let sides: Vec<_> = joints.iter().map(|&joint| sides(joint)).collect();
    let weights = borne(&sides, |body| {
        let body = &world.bodies[body as usize];
        (body.center_of_mass() * body.mass.mass).extend(body.mass.mass) * body.gravity_scale.abs()
    });
    let omega = TAU * config.joint_frequency / substep;
    let gaps = joints
        .iter()
        .zip(weights)
        .map(|(&joint, weight)| gap_of_joint(&world.joints[joint as usize], weight, world, omega));
    gaps.fold(0.0, f32::max)
}

/// The gap of a swept joint under a force of 1 N, as a share of its arms (1/N); `None` if the joint has no arms or
/// restricts no shifts. `omega` is the angular frequency of the springs that sweeps act as.
fn share_of_force(joint: &Joint, world: &World, omega: f32) -> Option<f32> {
    let bears = match &joint.linear {
        Linear::Axes(axes) => axes.iter().any(|axis| axis.bounds != Bounds::Free),
        Linear::Distance(distance) => distance.bounds != Bounds::Free,
    };
    let softness: f32 = movable(joint, world).map(|body| body.mass.mass.recip()).sum();
    Some(softness / (omega * omega * arms(joint, world))).filter(|share| bears && share.is_finite())
}

/// The total length of the arms of a joint (m).
fn arms(joint: &Joint, world: &World) -> f32 {
    let ends = bodies(joint).zip(world.anchors(joint));
    ends.map(|(i, anchor)| anchor.distance(world.bodies[i].center_of_mass())).sum()
}

fn bodies(joint: &Joint) -> impl Iterator<Item = usize> {
    let (a, b) = joint.indices();
    [Some(a), b].into_iter().flatten()
}

fn movable<'a>(joint: &Joint, world: &'a World) -> impl Iterator<Item = &'a Body> {
    bodies(joint).map(|i| &world.bodies[i]).filter(|body| body.kind == BodyKind::Dynamic)
}

/// The force that opens a swept joint by the gap that the settings promise (N); `None` if no force does. `substep` is
/// the length of a substep (s).
pub fn force_of_promised_gap(joint: &Joint, world: &World, config: &SolverConfig, substep: f32) -> Option<f32> {
    let omega = TAU * config.joint_frequency / substep;
    Some(config.max_joint_gap_share / share_of_force(joint, world, omega)?)
}

/// The gap that sweeps leave in a joint, as a share of its arms, or the angle that they leave under the moment of the
/// weight (rad), whichever number is larger. `weight` is the load of the joint: mass times position (kg m), and mass
/// (kg).
fn gap_of_joint(joint: &Joint, weight: Vec4, world: &World, omega: f32) -> f32 {
    let force = weight.w * world.gravity_of(world.bodies.worlds()[joint.indices().0] as usize).length();
    let gap = share_of_force(joint, world, omega).map(|share| force * share);
    let is_locked = joint.angular.iter().any(|axis| axis.bounds == Bounds::Locked);
    let angle = Some(weight).filter(|weight| is_locked && weight.w > 0.0).map(|weight| {
        let lever = weight.truncate() / weight.w - world.anchors(joint)[0];
        let turn: f32 = movable(joint, world).map(|body| turn_across(body, lever)).sum();
        force * lever.length() * turn / (omega * omega)
    });
    gap.unwrap_or(0.0).max(angle.filter(|angle| angle.is_finite()).unwrap_or(0.0))
}

/// The inverse inertia of a body about an axis perpendicular to a direction (1/(kg m²)), as the mean of two such axes.
fn turn_across(body: &Body, direction: Vec3) -> f32 {
    let i: Mat3 = body.world_inverse_inertia();
    let along = direction.normalize_or_zero();
    0.5 * (i.x_axis.x + i.y_axis.y + i.z_axis.z - along.dot(i * along))
}
