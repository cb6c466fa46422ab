//! How far sweeps would leave the joints of a connected set of bodies open: nets, which are not solved at once, take substeps by it.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3, Vec4};

use super::joint_loads::borne;
use crate::config::SolverConfig;
use crate::world::{Body, BodyKind, Bounds, Joint, Linear, World};

/// The largest gap that sweeps leave at rest in any of some joints, as a share of its arms. `sides` are the bodies of a joint that can move;
/// `substep` is the length of a substep (s).
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

/// The gap that sweeps leave in a joint, as a share of its arms, or the angle that they leave under the moment of the weight (rad). `weight` is mass
/// times place (kg m) and mass (kg) of what hangs on it; `omega` is the frequency of the springs of sweeps.
fn gap_of_joint(joint: &Joint, weight: Vec4, world: &World, omega: f32) -> f32 {
    let (a, b) = joint.indices();
    let body = |i: usize| &world.bodies[i];
    let bodies = || [Some(a), b].into_iter().flatten();
    let movable = || bodies().map(body).filter(|body| body.kind == BodyKind::Dynamic);
    let anchors = world.anchors(joint);
    let arms: f32 = bodies().zip(anchors).map(|(i, anchor)| anchor.distance(body(i).center_of_mass())).sum();
    let force = weight.w * world.gravity_of(world.bodies.worlds()[a] as usize).length();
    let bears = match &joint.linear {
        Linear::Axes(axes) => axes.iter().any(|axis| axis.bounds != Bounds::Free),
        Linear::Distance(distance) => distance.bounds != Bounds::Free,
    };
    let softness: f32 = movable().map(|body| body.mass.mass.recip()).sum();
    // A joint without arms has no length to be held against.
    let gap = Some(force * softness / (omega * omega * arms)).filter(|gap| bears && gap.is_finite());
    let is_locked = joint.angular.iter().any(|axis| axis.bounds == Bounds::Locked);
    let angle = Some(weight).filter(|weight| is_locked && weight.w > 0.0).map(|weight| {
        let lever = weight.truncate() / weight.w - anchors[0];
        let turn: f32 = movable().map(|body| turn_across(body, lever)).sum();
        force * lever.length() * turn / (omega * omega)
    });
    gap.unwrap_or(0.0).max(angle.filter(|angle| angle.is_finite()).unwrap_or(0.0))
}

/// The inverse inertia of a body about an axis across a direction: the mean of two axes (1/(kg m²)).
fn turn_across(body: &Body, direction: Vec3) -> f32 {
    let i: Mat3 = body.mass.world_inverse_inertia(body.rotation);
    let along = direction.normalize_or_zero();
    0.5 * (i.x_axis.x + i.y_axis.y + i.z_axis.z - along.dot(i * along))
}
