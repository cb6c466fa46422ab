//! Positions and speeds along the axes of a joint.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec3};

use super::World;
use super::joint::{Joint, Linear, NO_FRAME, NOWHERE};
use super::joint_axis::{Axis, Bounds, Drive};
use super::limits::{MAX_LENGTH, MAX_SPEED, check_rotation};
use crate::error::{Result, ensure};
use crate::math::angles::{self, Angles};
use crate::math::rotation::{product, unit};
use crate::math::{Quat as Rotation, vec3};

/// Position and speed of body a against body b along each axis of a joint: three translations, then three rotations.
///
/// ```
/// use drystone::{Body, Joint, JointMotion, Shape, World, glam::{Quat, Vec3}};
///
/// let mut world = World::new();
/// let door = Body::dynamic().shape(Shape::cuboid(0.5, 1.0, 0.02)).rotation(Quat::from_rotation_y(0.3));
/// let door = world.insert(door.velocity(Vec3::ZERO, Vec3::Y * 2.0));
/// let hinge = Joint::to_world(door, Vec3::ZERO, Vec3::ZERO).hinge(Vec3::Y);
/// let JointMotion { position, speed, .. } = world.joint_motion(&hinge);
/// // The angle about the first axis, and its change.
/// assert!((position[3] - 0.3).abs() < 1e-6 && (speed[3] - 2.0).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// Positions (m), then angles (rad), as [`Joint::angular`] defines them. A twist is from -pi to pi: a world does not
    /// know how often a joint has turned. If the joint lets the axis of the twist swing, a locked angle is twice a
    /// component of the quaternion or the height of that axis above a plane: zero in the same places, and without a jump
    /// at half a turn. The first position is the distance of the anchors if the joint restricts the distance.
    pub position: [f32; 6],
    /// Rates of the positions and angles (m/s, rad/s).
    pub speed: [f32; 6],
    /// World direction of each axis. The joint pushes body a along it, or turns body a about it.
    pub(crate) direction: [Vec3; 6],
    /// World rotation of the frame on a, with the axis of the twist first, and with the sign for which its rotation in
    /// the frame on b has w >= 0.
    pub(crate) frame_a: Quat,
    /// World rotation of the frame on b, with the axis of the twist first.
    pub(crate) frame_b: Quat,
    /// The angles as they are between frames (rad), without turns that were counted.
    pub(crate) start: [f32; 3],
    /// Spin of a against b (rad/s).
    pub(crate) spin: Vec3,
    /// The gap between the anchors (m).
    anchor_gap: f32,
}

/// The largest limit of an angle that counts turns (turns). There, an angle is rounded to 0.0005 rad.
const MAX_TURNS: f32 = 1000.0;

/// The rotations that turn the first axis into each of the three, the second into the one after it.
const TWIST_FRAMES: [Quat; 3] =
    [Quat::IDENTITY, Quat::from_xyzw(0.5, 0.5, 0.5, 0.5), Quat::from_xyzw(-0.5, -0.5, -0.5, 0.5)];

/// A shorter distance than this has no direction (m).
pub(crate) const MIN_DISTANCE: f32 = 1e-6;

impl World {
    /// Positions and speeds along the axes of a joint. All are NaN if a body of the joint is gone.
    ///
    /// ```
    /// # use drystone::{Body, Joint, Shape, World, glam::Vec3};
    /// let mut world = World::new();
    /// let lift = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 2.0, 0.0));
    /// let slider = Joint::to_world(lift, Vec3::ZERO, Vec3::ZERO).slider(Vec3::Y);
    /// assert!((world.joint_motion(&slider).position[0] - 2.0).abs() < 1e-6);
    /// ```
    pub fn joint_motion(&self, joint: &Joint) -> JointMotion {
        let [anchor_a, anchor_b] = self.anchors(joint);
        let b = joint.body_b.map(|b| self.body(b));
        let (Some(a), Some(b)) = (self.body(joint.body_a), b.map_or(Some(None), |b| b.map(Some))) else {
            let (none, nowhere) = ([f32::NAN; 6], [Vec3::NAN; 6]);
            return JointMotion {
                position: none,
                speed: none,
                direction: nowhere,
                frame_a: Quat::NAN,
                frame_b: Quat::NAN,
                start: [f32::NAN; 3],
                spin: Vec3::NAN,
                anchor_gap: f32::NAN,
            };
        };
        let offset = anchor_a - anchor_b;
        let frame_b = product(b.map_or(Quat::IDENTITY, |b| b.rotation), joint.frame_b);
        let axes_b = [Vec3::X, Vec3::Y, Vec3::Z].map(|e| frame_b * e);
        // The first axis of these frames is that of the twist.
        let turn = TWIST_FRAMES[joint.twist_axis()];
        let [frame_a, frame_b] = [product(a.rotation, joint.frame_a), frame_b].map(|frame| product(frame, turn));
        let relative = unit(product(frame_b.inverse(), frame_a));
        let sign = if relative.w < 0.0 { -1.0 } else { 1.0 };
        let (frame_a, relative) = (frame_a * sign, relative * sign);
        let Angles { values, directions } = Angles::of(Rotation::load(relative.to_array()));
        let angles = [0, 1, 2].map(|angle| match joint.coordinate(angle) {
            elevation @ angles::ELEVATION.. => {
                let place = elevation - angles::ELEVATION;
                let axis = [vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0)][place];
                angles::elevation(values[angles::HEIGHT + place], directions[angles::HEIGHT + place], axis)
            }
            number => (values[number], directions[number]),
        });

        let mut direction = [Vec3::ZERO; 6];
        direction[..3].copy_from_slice(&axes_b);
        direction[3..].copy_from_slice(&axes_b);
        if joint.swings() {
            direction[3..].copy_from_slice(&angles.map(|(_, direction)| frame_b * Vec3::from_array(direction.store())));
        }
        let mut position = [0.0; 6];
        for (position, axis) in position.iter_mut().zip(axes_b) {
            *position = axis.dot(offset);
        }
        if let Linear::Distance(_) = joint.linear {
            let distance = offset.length();
            let along = if distance > MIN_DISTANCE { offset / distance } else { axes_b[0] };
            (direction[0], position[0]) = (along, distance);
            (direction[1], direction[2], position[1], position[2]) = (Vec3::ZERO, Vec3::ZERO, 0.0, 0.0);
        }
        let start = angles.map(|(value, _)| value);
        position[3..].copy_from_slice(&start);
        let velocity = a.linear_velocity + a.angular_velocity.cross(anchor_a - a.center_of_mass())
            - b.map_or(Vec3::ZERO, |b| b.linear_velocity + b.angular_velocity.cross(anchor_a - b.center_of_mass()));
        let spin = a.angular_velocity - b.map_or(Vec3::ZERO, |b| b.angular_velocity);
        let speed = std::array::from_fn(|i| direction[i].dot(if i < 3 { velocity } else { spin }));
        let anchor_gap = anchor_a.distance(anchor_b);
        JointMotion { position, speed, direction, frame_a, frame_b, start, spin, anchor_gap }
    }
}

impl JointMotion {
    /// Distance of the anchors from the positions that the joint allows (m).
    pub(super) fn gap(&self, joint: &Joint) -> f32 {
        if joint.holds_anchors() {
            return self.anchor_gap;
        }
        let outside = |(axis, position): (&Axis, &f32)| match axis.bounds {
            Bounds::Free => 0.0,
            Bounds::Locked => *position,
            Bounds::Between { min, max } => position - position.max(min).min(max),
        };
        joint.linear_axes().iter().zip(&self.position).map(outside).map(|x| x * x).sum::<f32>().sqrt()
    }
}

impl Joint {
    /// Refuses frames that are not rotations, and limits and drives that are out of range.
    ///
    /// ```
    /// use drystone::{Body, Joint, World, glam::Vec3};
    ///
    /// let body = World::new().insert(Body::dynamic());
    /// let hinge = |axis| Joint::to_world(body, Vec3::ZERO, Vec3::ZERO).hinge(axis).check_axes();
    /// assert!(hinge(Vec3::Y).is_ok() && hinge(Vec3::ZERO).is_err());
    /// ```
    ///
    /// # Errors
    /// One line names the axis, the number and its range.
    pub fn check_axes(&self) -> Result<()> {
        let message =
            || "its axis has no direction: hinge, slider and along take a vector with a finite length above 0".into();
        ensure(self.frame_b != NO_FRAME, message)?;
        check_rotation("frame_a", self.frame_a)?;
        check_rotation("frame_b", self.frame_b)?;
        let message = || {
            "all of its axes are locked: limits, motors and springs need a free axis, as a hinge, slider, rope or generic joint has".into()
        };
        ensure(self.angular[0].bounds != NOWHERE, message)?;
        match &self.linear {
            Linear::Axes(axes) => axes.iter().try_for_each(|axis| axis.check("linear", -MAX_LENGTH, MAX_LENGTH))?,
            Linear::Distance(distance) => {
                let message = || "distance: locked at zero: use a ball joint".into();
                ensure(distance.bounds != Bounds::Locked, message)?;
                distance.check("distance", 0.0, MAX_LENGTH)?;
            }
        }
        let [first, others @ ..] = &self.angular;
        let most = if first.counts_turns() { MAX_TURNS * TAU } else { PI };
        first.check("angular", -most, most)?;
        others.iter().try_for_each(|axis| axis.check("angular", -PI, PI))
    }
}

impl Axis {
    fn check(&self, name: &str, least: f32, most: f32) -> Result<()> {
        if let Bounds::Between { min, max } = self.bounds {
            let [is_angle, ascend] = [most == PI, min <= max];
            let message = || {
                format!(
                    "{name}: limits {min} and {max}: must be within -pi and pi: only the first angle of a joint counts turns"
                )
            };
            ensure(!(is_angle && ascend) || least <= min && max <= most, message)?;
            let is_bound = |bound: f32, none: f32| (least..=most).contains(&bound) || !is_angle && bound == none;
            let is_range = ascend && is_bound(min, f32::NEG_INFINITY) && is_bound(max, f32::INFINITY);
            ensure(is_range, || format!("{name}: limits {min} and {max}: must ascend, within {least} and {most}"))?;
        }
        let message = || format!("{name}: a motor or a spring cannot move a locked axis: free or limit the axis");
        ensure(self.bounds != Bounds::Locked || self.drive == Drive::None, message)?;
        let check_target = |target: f32| {
            let message = || format!("{name}: target = {target}: must be within {least} and {most}");
            ensure((least..=most).contains(&target), message)
        };
        let max_load = match self.drive {
            Drive::None => return Ok(()),
            Drive::Motor { speed, max_load } => {
                let message = || format!("{name}: speed = {speed}: must be at most {MAX_SPEED:e} in size");
                ensure(speed.abs() <= MAX_SPEED, message)?;
                max_load
            }
            Drive::Spring { target, frequency, damping_ratio, max_load } => {
                check_target(target)?;
                let message = || format!("{name}: frequency = {frequency}: must be above 0 and at most 1e6 Hz");
                ensure(frequency > 0.0 && frequency <= 1e6, message)?;
                let message = || format!("{name}: damping_ratio = {damping_ratio}: must be 0 to 1e6");
                ensure((0.0..=1e6).contains(&damping_ratio), message)?;
                max_load
            }
            Drive::SpringDamper { target, stiffness, damping, max_load } => {
                check_target(target)?;
                let message = || format!("{name}: stiffness = {stiffness}: must be above 0 and at most 1e30");
                ensure(stiffness > 0.0 && stiffness <= 1e30, message)?;
                let message = || format!("{name}: damping = {damping}: must be 0 to 1e30");
                ensure((0.0..=1e30).contains(&damping), message)?;
                max_load
            }
        };
        ensure(max_load >= 0.0, || format!("{name}: max_load = {max_load}: must be at least 0"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check compares angles with speeds across two small rotations.
    #[test]
    fn speeds_are_the_changes_of_angles_at_any_angle() {
        let mut world = World::new();
        let body = world.insert(crate::Body::dynamic().shape(crate::Shape::ball(0.5)));
        let joint = Joint::to_world(body, Vec3::ZERO, Vec3::ZERO);
        for swing in [Vec3::ZERO, Vec3::new(0.0, 0.4, -0.3), Vec3::new(0.0, -1.2, 0.8), Vec3::new(0.0, 0.7, 2.4)] {
            let rotation = Quat::from_scaled_axis(swing) * Quat::from_rotation_x(0.6);
            for spin in [Vec3::X, Vec3::Y, Vec3::Z] {
                let mut at = |turn: f32| {
                    let a = &mut world.bodies[body];
                    (a.rotation, a.angular_velocity) = (Quat::from_scaled_axis(spin * turn) * rotation, spin);
                    let motion = world.joint_motion(&joint);
                    (Vec3::from_slice(&motion.position[3..]), Vec3::from_slice(&motion.speed[3..]))
                };
                let ((before, _), (_, speed), (after, _)) = (at(-1e-2), at(0.0), at(1e-2));
                let change = (after - before) / 2e-2;
                assert!(change.distance(speed) < 2e-3 * (1.0 + speed.length()), "{swing} {spin}: {speed}, {change}");
            }
        }
    }
}
