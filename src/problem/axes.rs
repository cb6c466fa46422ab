//! The rows of the axes of joints, from the joint and its position when the step begins.
//!
//! In a substep h, a spring of frequency w/2 pi and damping ratio z, on an effective mass m, turns the state (x, v) in
//! phase space. The determinant of the exact map is exp(-2 z w h). With a = z w h the law
//!
//! ```text
//! v' = s (v + h f/m) - r x,   x' = x + h v',   s = 1 / (1 + 2 a + 2 a²),   r = s w² h
//! ```
//!
//! has this determinant to the third order in a. Under a constant force f the spring comes to rest at x = f/(m w²), for
//! any masses behind it. Its period is too long by the share a/2. A spring without damper keeps its energy. A spring
//! that does not swing, z > 1, takes the s with which the slower of its two motions has its exact decay. A row holds
//! the share 1 - s of the speed that the spring takes away, the share s of the impulse that it gives back, and m r
//! (docs/derivation.md).

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Quat, Vec3};

use super::damping::loss_in;
use super::effective::InverseMass;
use super::rows::{AxisRow, JointRow, MassRow, NO_LIMIT};
use super::softness::softness;
use super::{NodeRow, StepProblem};
use crate::constants::STIFFEST;
use crate::world::{Axis, BodyKind, Bounds, Drive, Joint, JointMotion, Linear, MIN_DISTANCE, World};

/// The axes of a joint that may have rows, by their numbers: 0 to 2 for shifts, 3 to 5 for turns.
fn axes_of(joint: &Joint) -> impl Iterator<Item = (usize, &Axis)> {
    let linear = if joint.holds_anchors() { &[] } else { joint.linear_axes() };
    linear.iter().enumerate().chain((3..).zip(&joint.angular))
}

/// The axis of a joint with a number from [`axes_of`].
fn axis_of(joint: &Joint, number: usize) -> &Axis {
    axes_of(joint).find(|(i, _)| *i == number).expect("an axis with a row").1
}

/// The rows of a joint: the number of an axis, and whether the row is that of its drive. Drives come first, so that
/// bounds win over them. Locked axes have no drives.
pub(super) fn kinds(joint: &Joint) -> impl Iterator<Item = (usize, bool)> {
    let drives = axes_of(joint).filter(|(_, axis)| axis.has_drive());
    let bounds = axes_of(joint).filter(|(_, axis)| axis.bounds != Bounds::Free);
    drives.map(|(i, _)| (i, true)).chain(bounds.map(|(i, _)| (i, false)))
}

/// Number of rows of drives of a joint. They come before the other rows.
pub fn drive_count(joint: &Joint) -> usize {
    kinds(joint).filter(|(_, is_drive)| *is_drive).count()
}

/// The largest total force of the drives of a joint in its present position (N). A motor counts with its largest load,
/// and a spring with the load of its deflection. The torque of a drive counts as a force at the smallest half extent of
/// body a.
pub(super) fn driving_force(joint: &Joint, world: &World) -> f32 {
    let mut driven = axes_of(joint).filter(|(_, axis)| axis.has_drive()).peekable();
    if driven.peek().is_none() {
        return 0.0;
    }
    let a = joint.body_a.index();
    let position = world.joint_motion(joint).position;
    let load = |(i, axis): (usize, &Axis)| {
        let load = match axis.drive {
            Drive::None => 0.0,
            Drive::Motor { max_load, .. } => max_load,
            Drive::Spring { target, max_load, .. } | Drive::SpringDamper { target, max_load, .. } => {
                let [stiffness, _] = spring_constants(joint, i, world);
                max_load.min(stiffness * (position[i] - target).abs())
            }
        };
        if i >= 3 { load / world.bodies[a].smallest_half_extent() } else { load }
    };
    driven.map(load).sum()
}

/// The rows of the nodes of a joint that is solved directly ([`NodeRow::rows`]). Locks and limits of turns come before
/// those of shifts, because they give a lever its stiffness.
pub(super) fn nodes(joint: &Joint) -> impl Iterator<Item = u32> {
    let is_limit = |axis: &Axis| (axis.bounds != Bounds::Free).then_some(!axis.is_locked());
    let bounds = |are_angles: bool| {
        let rows = (0..).zip(kinds(joint)).filter(move |(_, (i, is_drive))| !is_drive && (*i >= 3) == are_angles);
        let own: Vec<(u32, bool)> =
            rows.filter_map(|(row, (i, _))| Some((row, is_limit(axis_of(joint, i))?))).collect();
        NodeRow::rows_of(&own)
    };
    let shifts = if joint.holds_anchors() { NodeRow::ANCHORS } else { bounds(false) };
    [bounds(true), shifts].into_iter().filter(|rows| *rows > 0)
}

/// The same angle plus whole turns, as near as possible to another angle (rad). Both are within -pi and pi.
fn nearest(angle: f32, to: f32) -> f32 {
    match angle - to {
        apart if apart > PI => angle - TAU,
        apart if apart < -PI => angle + TAU,
        _ => angle,
    }
}

/// Writes the rows of a joint for substeps of `substep` seconds. An axis with a drive that is beyond a limit goes back
/// by the share `limit_rate` of the excess per second (1/s). With `has_frames`, angles are those between frames that turn.
pub(super) fn write(
    joint: &Joint,
    motion: &JointMotion,
    has_frames: bool,
    substep: f32,
    limit_rate: f32,
    rows: &mut Vec<AxisRow>,
) {
    let is_distance = matches!(joint.linear, Linear::Distance(_));
    for (i, is_drive) in kinds(joint) {
        let axis = axis_of(joint, i);
        // An angle continues beyond pi. The same angle less a turn would be another position.
        let middle = match (is_drive, axis.drive, axis.bounds) {
            (true, Drive::Spring { target, .. } | Drive::SpringDamper { target, .. }, _) => target,
            (false, _, Bounds::Between { min, max }) => 0.5 * (min + max),
            _ => 0.0,
        };
        let is_counted = i < 3 || i == 3 && axis.counts_turns();
        let position = if is_counted { motion.position[i] } else { nearest(motion.position[i], middle) };
        let row = AxisRow {
            direction: motion.direction[i].to_array(),
            coordinate: match i {
                0..3 => AxisRow::SHIFT,
                _ if has_frames => AxisRow::angle(joint.coordinate(i - 3)),
                _ => AxisRow::TURN,
            },
            start: match i {
                0 if is_distance && position > MIN_DISTANCE => position,
                3.. if has_frames => motion.start[i - 3],
                _ => 0.0,
            },
            left: NO_LIMIT,
            max_impulse: f32::MAX,
            ..AxisRow::default()
        };
        rows.push(if is_drive {
            driven(row, axis.drive, position, substep)
        } else {
            // A soft limit would yield to the load of a drive. A rigid limit takes this load back within the same
            // sweep.
            let row = if axis.has_drive() { AxisRow { rate: limit_rate, mass_scale: 1.0, ..row } } else { row };
            bounded(row, axis.bounds, position)
        });
    }
}

fn bounded(row: AxisRow, bounds: Bounds, position: f32) -> AxisRow {
    match bounds {
        Bounds::Between { min, max } if min < max => {
            AxisRow { gap: (position - min).min(-NO_LIMIT), left: (max - position).min(-NO_LIMIT), ..row }
        }
        Bounds::Between { min, .. } => AxisRow { gap: position - min, ..row },
        Bounds::Locked | Bounds::Free => AxisRow { gap: position, ..row },
    }
}

fn driven(row: AxisRow, drive: Drive, position: f32, h: f32) -> AxisRow {
    match drive {
        Drive::Motor { speed, max_load } => {
            AxisRow { speed, mass_scale: 1.0, max_impulse: largest(max_load, h), ..row }
        }
        // [`tune`] completes the row once all masses are known.
        Drive::Spring { target, max_load, .. } | Drive::SpringDamper { target, max_load, .. } => {
            AxisRow { gap: position - target, impulse_scale: 1.0, max_impulse: largest(max_load, h), ..row }
        }
        Drive::None => row,
    }
}

/// Stiffness and damping of the spring on the axis `i` of a joint; 0 without a spring (N/m, N s/m; about an axis N m/rad, N m s/rad).
///
/// For a spring of a frequency they belong to the mass that two free bodies have at their anchors, by the mean of its
/// inverse over all directions, or to their reduced inertia about the axis of the joint in each. These are the same in
/// every pose: a stiffness that followed the moved mass would make energy.
fn spring_constants(joint: &Joint, i: usize, world: &World) -> [f32; 2] {
    let (frequency, damping_ratio) = match axis_of(joint, i).drive {
        Drive::SpringDamper { stiffness, damping, .. } => return [stiffness, damping],
        Drive::Spring { frequency, damping_ratio, .. } => (frequency, damping_ratio),
        Drive::None | Drive::Motor { .. } => return [0.0; 2],
    };
    let inverse_mass = |body: usize, anchor: Vec3, frame: Quat| {
        let body = &world.bodies[body];
        if body.kind != BodyKind::Dynamic {
            return 0.0;
        }
        let turning =
            if body.has_fixed_rotation() { Mat3::ZERO } else { body.mass.world_inverse_inertia(Quat::IDENTITY) };
        let about = |axis: Vec3| axis.dot(turning * axis);
        if i >= 3 {
            return about(frame * Vec3::AXES[i - 3]);
        }
        let arm = anchor - body.mass.center;
        body.mass.mass.recip() + Vec3::AXES.iter().map(|axis| about(arm.cross(*axis))).sum::<f32>() / 3.0
    };
    let (a, b) = joint.indices();
    let sum = inverse_mass(a, joint.anchor_a, joint.frame_a)
        + b.map_or(0.0, |b| inverse_mass(b, joint.anchor_b, joint.frame_b));
    let mass = if sum > 0.0 { sum.recip() } else { 0.0 };
    let omega = TAU * frequency;
    [mass * omega * omega, 2.0 * damping_ratio * mass * omega]
}

/// The stiffness of the drive in a row of a joint (N/m, N m/rad).
pub fn stiffness(joint: &Joint, row: usize, world: &World) -> f32 {
    kinds(joint).nth(row).map_or(0.0, |(i, _)| spring_constants(joint, i, world)[0])
}

/// Whether a joint has springs.
pub(super) fn has_springs(joint: &Joint) -> bool {
    axes_of(joint).any(|(_, axis)| matches!(axis.drive, Drive::Spring { .. } | Drive::SpringDamper { .. }))
}

/// Completes the rows of springs, for substeps of `substep` seconds. With the present effective mass m, a spring of the
/// stiffness k and the damping c has the frequency √(k/m)/2π and the damping ratio c/2√(k m).
pub(super) fn tune(joint: &Joint, number: usize, substep: f32, world: &World, problem: &mut StepProblem) {
    let row = problem.joints[number];
    let first = row.first_axis as usize;
    for (k, (i, _)) in (first..).zip(kinds(joint).filter(|(_, is_drive)| *is_drive)) {
        let [stiffness, damping] = spring_constants(joint, i, world);
        let inverse_mass = inverse_mass_along(&row, &problem.axes[k], &problem.masses);
        let omega = (stiffness * inverse_mass).sqrt();
        if omega > 0.0 {
            let [rate, impulse_scale] = spring(omega / TAU, 0.5 * damping * inverse_mass / omega, substep);
            let row = &mut problem.axes[k];
            (row.rate, row.mass_scale, row.impulse_scale) = (rate / inverse_mass, 1.0 - impulse_scale, impulse_scale);
        }
    }
}

/// The speed that a unit impulse along an axis gives when the step begins (1/kg; about an axis 1/(kg m²)).
fn inverse_mass_along(joint: &JointRow, axis: &AxisRow, masses: &[MassRow]) -> f32 {
    let direction = Vec3::from_array(axis.direction);
    let is_linear = axis.coordinate > 0.0;
    let of = |body: u32, arm: [f32; 3]| {
        let inverse = InverseMass::of(&masses[body as usize]);
        let about = if is_linear { Vec3::from_array(arm).cross(direction) } else { direction };
        (if is_linear { inverse.along(direction) } else { 0.0 }) + about.dot(inverse.inertia * about)
    };
    of(joint.body_a, joint.r_a) + of(joint.body_b, joint.r_b)
}

fn largest(max_load: f32, h: f32) -> f32 {
    (max_load * h).min(f32::MAX)
}

/// The speed that a spring gives in a substep, over its gap, and the share of its impulse that it gives back.
fn spring(frequency: f32, damping_ratio: f32, h: f32) -> [f32; 2] {
    let omega = TAU * frequency;
    if omega * h > STIFFEST {
        let soft = softness(frequency, damping_ratio, h, 0.0);
        return [soft.bias_rate * soft.mass_scale, soft.impulse_scale];
    }
    let a = damping_ratio * omega * h;
    let keep = if damping_ratio > 1.0 {
        // The slower motion decays by exp(-w h/(z + √(z² - 1))) in a substep: a root of x² - (1 - h r + s) x + s.
        let (turn, slowness) = (omega * h, damping_ratio + (damping_ratio * damping_ratio - 1.0).sqrt());
        let loss = loss_in(f64::from(turn / slowness)) as f32;
        let left = 1.0 - loss;
        left * loss / (loss + left * turn * turn)
    } else {
        1.0 / (1.0 + 2.0 * a + 2.0 * a * a)
    };
    [keep * omega * omega * h, keep]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The eigenvalues of the law of a spring are those of the exact motion, but for a period that is a/2 too long. Under a
    /// constant acceleration g it rests at g/w².
    #[test]
    fn a_spring_has_its_period_and_its_decay() {
        let h = 1.0 / 480.0;
        for (frequency, damping_ratio) in [(1.0, 0.0), (1.0, 0.1), (5.0, 0.5), (20.0, 0.2)] {
            let [rate, keep] = spring(frequency, damping_ratio, h).map(f64::from);
            let h = f64::from(h);
            let omega = std::f64::consts::TAU * f64::from(frequency);
            let a = f64::from(damping_ratio) * omega * h;
            let turn = omega * h * (1.0 - f64::from(damping_ratio).powi(2)).sqrt();
            let middle = (1.0 - h * rate + keep) / 2.0;
            let (found_turn, found_decay) = ((middle / keep.sqrt()).acos(), -0.5 * keep.ln());
            assert!(
                (found_turn / turn + 0.5 * a - 1.0).abs() < 0.01,
                "{frequency} {damping_ratio}: {found_turn} {turn}"
            );
            assert!((keep * h * omega * omega / rate - 1.0).abs() < 1e-6, "{frequency} {damping_ratio}: {keep} {rate}");
            assert!((found_decay - a).abs() <= 0.01 * a + 1e-9, "{frequency} {damping_ratio}: {found_decay} {a}");
        }
    }

    /// The slower of the two motions of a spring that does not swing has its exact decay, and the law its load.
    #[test]
    fn a_spring_beyond_critical_damping_creeps_at_its_rate() {
        let h = 1.0 / 480.0;
        for (frequency, damping_ratio) in [(1.0, 1.01), (5.0, 1.5), (20.0, 2.0), (20.0, 10.0)] {
            let [rate, keep] = spring(frequency, damping_ratio, h).map(f64::from);
            let [h, omega, ratio] =
                [f64::from(h), std::f64::consts::TAU * f64::from(frequency), f64::from(damping_ratio)];
            let sum = 1.0 - h * rate + keep;
            let slower = 0.5 * (sum + (sum * sum - 4.0 * keep).sqrt());
            let exact = omega * h * (ratio - (ratio * ratio - 1.0).sqrt());
            assert!((-slower.ln() / exact - 1.0).abs() < 1e-3, "{frequency} {damping_ratio}: {slower}, {exact}");
            assert!((keep * h * omega * omega / rate - 1.0).abs() < 1e-6, "{frequency} {damping_ratio}: {keep} {rate}");
        }
    }
}
