//! Joints: they restrict the relative motion of two bodies.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use super::World;
use super::bodies::BodyHandle;
use super::joint_axis::{Axis, Bounds, Drive};
use crate::error::Result;
use crate::math::angles;
use crate::math::rotation;
use crate::saved::{Archive, Saved};

/// A joint between two bodies, or between a body and the world.
///
/// A new joint is a ball joint. One method turns it into another kind: [`hinge`](Self::hinge),
/// [`slider`](Self::slider), [`fixed`](Self::fixed), [`rope`](Self::rope), [`rod`](Self::rod),
/// [`elastic`](Self::elastic) or [`generic`](Self::generic). Limits, motors and springs belong to the axes of the
/// joint. They can be set before the kind. A second kind replaces the first, together with all settings of its axes.
///
/// Positions and speeds of a joint describe body a in the frame of body b: a motor with a positive speed moves a
/// forward along the axis. If the bodies are swapped, limits and targets change sign. The axes of a joint turn with
/// body b.
///
/// ```
/// use drystone::{Body, Joint, Shape, World};
/// use glam::Vec3;
///
/// let mut world = World::new();
/// let wall = world.insert(Body::fixed().shape(Shape::cuboid(0.1, 2.0, 2.0)));
/// let door = world.insert(Body::dynamic().position(0.6, 0.0, 0.0).shape(Shape::cuboid(0.5, 1.0, 0.02)));
/// let edges = (Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0));
/// world.insert_joint(Joint::new(door, edges.0, wall, edges.1).hinge(Vec3::Y).limited(0.0, 1.5).motor(0.3, 20.0));
/// ```
///
/// ```
/// use drystone::{Axis, Body, Joint, Linear, World, glam::{Quat, Vec3}};
///
/// # let mut world = World::new();
/// # let [a, b, other] = [(); 3].map(|()| world.insert(Body::fixed()));
/// let anchors = (Vec3::X, Vec3::NEG_X);
/// let ball = Joint::new(a, anchors.0, b, anchors.1);
/// assert!(ball.is_ball() && ball.holds_anchors() && ball.holds(a) && ball.holds(b) && !ball.holds(other));
/// let door = ball.hinge(Vec3::Y).limited(0.0, 1.5).spring(0.0, 1.0, 0.7).breaking_at(500.0).colliding();
/// assert!(door.holds_anchors() && !door.is_ball() && door.collide);
/// let piston = ball.slider(Vec3::Y).motor(0.5, 100.0);
/// let barrier = ball.hinge(Vec3::Z).spring_damper(1.5, 40.0, 5.0);
/// assert_eq!(ball.hinge(Vec3::Z).constant_load(-3.0).first_axis(), Some(&mut Axis::FREE.constant_load(-3.0)));
/// let weld = ball.fixed();
/// let [rope, rod, spring] = [ball.rope(2.0), ball.rod(2.0), ball.elastic(2.0, 1.5, 0.1)];
/// assert_eq!(rope.linear, Linear::Distance(Axis::limited(0.0, 2.0)));
/// assert_eq!(rod, ball.at_distance(Axis::limited(2.0, 2.0)));
/// assert_eq!(spring, ball.at_distance(Axis::FREE.spring(2.0, 1.5, 0.1, f32::MAX)));
/// // A screw without thread: free to translate along its axis and to rotate about it.
/// let bolt = ball.along(Vec3::Z).generic([Axis::FREE, Axis::LOCKED, Axis::LOCKED], [Axis::FREE, Axis::LOCKED, Axis::LOCKED]);
/// // Angles are zero with body a turned by a quarter.
/// let bolt = bolt.zero_at(Quat::from_rotation_z(1.5), Quat::IDENTITY);
/// assert!(bolt.clone().first_axis().is_some() && weld.clone().first_axis().is_none());
/// assert_eq!(Joint::to_world(a, anchors.0, Vec3::Y).body_b, None);
/// # let _ = (piston, barrier);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// The first body.
    pub body_a: BodyHandle,
    /// The second body, or `None` for the world.
    pub body_b: Option<BodyHandle>,
    /// The anchor in a's frame (m).
    pub anchor_a: Vec3,
    /// The anchor in b's frame, or in the world (m).
    pub anchor_b: Vec3,
    /// Rotation from the axes of the joint to the frame of a.
    pub frame_a: Quat,
    /// Rotation from the axes of the joint to the frame of b, or to the world. Angles are zero where the two frames
    /// agree.
    pub frame_b: Quat,
    /// Which positions the anchor of a can take.
    pub linear: Linear,
    /// Which angles a can take. One angle is the twist about its axis, from -pi to pi. The other two angles are the
    /// components, along their axes, of the rotation vector that turns the axis of the twist in b into that in a. The
    /// twist is about the first axis, unless another axis is bounded less than both others: about a free axis if the
    /// others have limits or locks, and about an axis with limits if the others are locked. If the first angle and one
    /// other are free, the angle with limits is that of the first axis of a above the plane of b that the free one
    /// turns it in, from -pi/2 to pi/2.
    pub angular: [Axis; 3],
    /// Whether the two bodies still collide with each other.
    pub collide: bool,
    /// Whether the joint acts; true by default. While it does not, its bodies move and collide as without it.
    pub enabled: bool,
    /// The force at which the joint breaks (N), above 0; infinite for a joint that never breaks. A joint breaks after a
    /// step in which it carried more force. That force is the length of the sum of its impulses over all substeps,
    /// divided by the length of the step. A blow of J (N s) within a step of length h counts as J/h, with any number of
    /// substeps. Torques do not count. The step then removes the joint and reports
    /// [`Event::Broke`](crate::Event::Broke).
    pub break_force: f32,
}

/// How a joint guides the anchor of a.
///
/// ```
/// use drystone::{Axis, Body, Joint, Linear, World, glam::Vec3};
///
/// let body = World::new().insert(Body::fixed());
/// let joint = Joint::to_world(body, Vec3::ZERO, Vec3::Y);
/// assert_eq!(joint.linear, Linear::Axes([Axis::LOCKED; 3]));
/// assert_eq!(joint.rope(1.0).linear, Linear::Distance(Axis::limited(0.0, 1.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Linear {
    /// Each axis by itself (m).
    Axes([Axis; 3]),
    /// The distance from the anchor of b (m).
    Distance(Axis),
}

/// Writes the three axes, or the one axis of the distance.
impl Saved for Linear {
    fn blank() -> Self {
        Self::Axes([Axis::LOCKED; 3])
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut is_distance = matches!(self, Self::Distance(_));
        is_distance.walk(archive)?;
        if A::READS {
            *self = if is_distance { Self::Distance(Axis::blank()) } else { Self::blank() };
        }
        match self {
            Self::Axes(axes) => axes.walk(archive),
            Self::Distance(axis) => axis.walk(archive),
        }
    }
}

crate::saved::fields!(Joint {
    body_a,
    body_b,
    anchor_a,
    anchor_b,
    frame_a,
    frame_b,
    linear,
    angular,
    collide,
    enabled,
    break_force,
});

/// Marks a joint axis that was given a direction of zero length.
pub(super) const NO_FRAME: Quat = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);

/// The bounds of a fixed joint that was given limits, a motor or a spring. No position satisfies them.
pub(super) const NOWHERE: Bounds = Bounds::Between { min: f32::INFINITY, max: f32::NEG_INFINITY };

impl Joint {
    /// A ball joint between two bodies, at anchors in their frames (m). Joined bodies do not collide with each other.
    pub fn new(body_a: BodyHandle, anchor_a: Vec3, body_b: BodyHandle, anchor_b: Vec3) -> Self {
        Self { body_b: Some(body_b), ..Self::to_world(body_a, anchor_a, anchor_b) }
    }

    /// A ball joint between a body, at an anchor in its frame, and a point of the world (m).
    pub fn to_world(body_a: BodyHandle, anchor_a: Vec3, point: Vec3) -> Self {
        Self {
            body_a,
            body_b: None,
            anchor_a,
            anchor_b: point,
            frame_a: Quat::IDENTITY,
            frame_b: Quat::IDENTITY,
            linear: Linear::Axes([Axis::LOCKED; 3]),
            angular: [Axis::FREE; 3],
            collide: false,
            enabled: true,
            break_force: f32::INFINITY,
        }
    }

    /// A hinge: body a can only rotate, about an axis with this direction in the frames of both bodies. The direction
    /// need not have unit length, but [`World::check`](crate::World::check) refuses a zero one.
    pub fn hinge(self, direction: Vec3) -> Self {
        self.along(direction).generic([Axis::LOCKED; 3], [Axis::FREE, Axis::LOCKED, Axis::LOCKED])
    }

    /// A slider: body a can only translate, along an axis with this direction in the frames of both bodies.
    pub fn slider(self, direction: Vec3) -> Self {
        self.along(direction).generic([Axis::FREE, Axis::LOCKED, Axis::LOCKED], [Axis::LOCKED; 3])
    }

    /// A fixed joint: body a cannot move against body b.
    pub fn fixed(self) -> Self {
        self.generic([Axis::LOCKED; 3], [Axis::LOCKED; 3])
    }

    /// A rope: the anchors are at most `length` apart (m).
    pub fn rope(self, length: f32) -> Self {
        self.at_distance(Axis::limited(0.0, length))
    }

    /// A rod: the anchors are exactly `length` apart (m).
    pub fn rod(self, length: f32) -> Self {
        self.at_distance(Axis::limited(length, length))
    }

    /// A spring between the anchors, with the rest length `length` (m): see [`Axis::spring`].
    pub fn elastic(self, length: f32, frequency: f32, damping_ratio: f32) -> Self {
        self.at_distance(Axis::FREE.spring(length, frequency, damping_ratio, f32::MAX))
    }

    /// Restricts only the distance of the anchors, and no angle.
    pub fn at_distance(self, distance: Axis) -> Self {
        self.of_kind(Linear::Distance(distance), [Axis::FREE; 3])
    }

    /// A joint with any six axes: three translations, then three rotations. With all six free, the joint only keeps its
    /// two bodies from colliding.
    pub fn generic(self, linear: [Axis; 3], angular: [Axis; 3]) -> Self {
        self.of_kind(Linear::Axes(linear), angular)
    }

    /// A second joint for the same two bodies, which keeps their first axes ([`Self::along`]) within a cone: the angle
    /// between the axes is at most `angle` (rad), more than 0 and less than pi. It is a rope between the ends of the
    /// axes, as long as the chord of the angle. A shoulder is a ball joint and its cone.
    ///
    /// ```
    /// use drystone::{Body, Joint, Shape, Simulation, World, glam::Vec3};
    ///
    /// // An arm that hangs down, and is pulled to all sides with twice its weight.
    /// let mut world = World::new();
    /// let arm = world.insert(Body::dynamic().shape(Shape::capsule(0.3, 0.1)).position(0.0, -0.5, 0.0));
    /// let shoulder = Joint::to_world(arm, Vec3::Y * 0.5, Vec3::ZERO).along(Vec3::Y);
    /// world.insert_joint(shoulder);
    /// world.insert_joint(shoulder.cone(0.4));
    /// let mut simulation = Simulation::new(world)?;
    /// for side in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::new(0.6, 0.0, 0.8)] {
    ///     for _ in 0..120 {
    ///         let arm = simulation.world.body_mut(arm).expect("it is there");
    ///         (arm.force, arm.angular_damping) = (side * 2.0 * 9.81 * arm.mass.mass, 5.0);
    ///         simulation.step(1.0 / 60.0)?;
    ///     }
    ///     let body = simulation.world.body(arm).expect("it is there");
    ///     let angle = (body.rotation * Vec3::Y).angle_between(Vec3::Y);
    ///     assert!((angle - 0.4).abs() < 2e-3, "{angle} rad");
    /// }
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn cone(&self, angle: f32) -> Self {
        // The axes are as long as the longer arm, so that the ends move as fast as the bodies.
        let arms = self.anchor_a.length().max(if self.body_b.is_some() { self.anchor_b.length() } else { 0.0 });
        let length = if arms > 0.0 { arms } else { 1.0 };
        let end = |anchor: Vec3, frame: Quat| anchor + frame * (Vec3::X * length);
        let (anchor_a, anchor_b) = (end(self.anchor_a, self.frame_a), end(self.anchor_b, self.frame_b));
        // A chord of an angle out of range is a length that no rope has.
        let chord = if angle > 0.0 && angle < PI { 2.0 * length * libm::sinf(0.5 * angle) } else { f32::NAN };
        Self { anchor_a, anchor_b, ..*self }.rope(chord)
    }

    /// Changes the kind of the joint. Settings that the ball joint already had move to the first axis, so calls can
    /// come in any order.
    fn of_kind(self, linear: Linear, angular: [Axis; 3]) -> Self {
        let [given, rest @ ..] = self.angular;
        let is_ball = self.holds_anchors() && rest == [Axis::FREE; 2];
        let mut joint = Self { linear, angular, ..self };
        if is_ball && matches!(given.bounds, Bounds::Between { .. }) {
            joint.on_first(|axis| Axis { bounds: given.bounds, ..axis });
        }
        if is_ball && given.drive != Drive::None {
            joint.on_first(|axis| Axis { drive: given.drive, ..axis });
        }
        joint
    }

    /// Sets the direction of the first axis, the same in the frames of both bodies.
    /// [`World::check`](crate::World::check) refuses a zero direction.
    pub fn along(self, direction: Vec3) -> Self {
        let frame = direction.try_normalize().map_or(NO_FRAME, |direction| rotation::arc(Vec3::X, direction));
        Self { frame_a: frame, frame_b: frame, ..self }
    }

    /// Sets the rotations of the two bodies at which all angles are zero. For a joint to the world, pass the identity
    /// for b.
    pub fn zero_at(self, rotation_a: Quat, rotation_b: Quat) -> Self {
        Self {
            frame_a: rotation::unit(rotation::product(
                rotation::product(rotation_a.inverse(), rotation_b),
                self.frame_b,
            )),
            ..self
        }
    }

    /// Reads anchors and directions as given in the world so far, and moves them into the frames of the bodies where these
    /// are now. All angles are zero there. A body that is not in `world` keeps its own; [`World::check`] refuses it.
    ///
    /// ```
    /// use drystone::{Body, Joint, Shape, Simulation, World, glam::{Quat, Vec3}};
    ///
    /// // A lid that lies open, at an angle to its chest, and the hinge at their common edge.
    /// let mut world = World::new();
    /// let chest = world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.3, 0.4)).rotation(Quat::from_rotation_y(0.7)));
    /// let turn = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-1.2);
    /// let edge = Quat::from_rotation_y(0.7) * Vec3::new(0.0, 0.3, -0.4);
    /// let at = edge + turn * Vec3::Z * 0.4;
    /// let lid = Body::dynamic().shape(Shape::cuboid(0.5, 0.02, 0.4)).position(at.x, at.y, at.z).rotation(turn);
    /// let lid = world.insert(lid);
    /// let axis = Quat::from_rotation_y(0.7) * Vec3::X;
    /// let hinge = world.insert_joint(Joint::new(lid, edge, chest, edge).hinge(axis).in_world(&world));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(1.0 / 60.0)?;
    /// let hinge = simulation.world.joint(hinge).expect("it is there");
    /// let [x, y, z, angle, ..] = simulation.world.joint_motion(hinge).position;
    /// assert!(Vec3::new(x, y, z).length() < 1e-4 && angle.abs() < 0.01, "{angle} rad");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn in_world(self, world: &World) -> Self {
        let of = |body: Option<BodyHandle>, anchor: Vec3, frame: Quat| {
            let Some(body) = body.and_then(|body| world.body(body)) else { return (anchor, frame) };
            let back = body.rotation.inverse();
            (back * (anchor - body.position), rotation::unit(rotation::product(back, frame)))
        };
        let (anchor_a, frame_a) = of(Some(self.body_a), self.anchor_a, self.frame_a);
        let (anchor_b, frame_b) = of(self.body_b, self.anchor_b, self.frame_b);
        Self { anchor_a, anchor_b, frame_a, frame_b, ..self }
    }

    /// Limits the first axis that is not locked, or the distance: see [`Bounds::Between`]. On a ball joint this axis is
    /// the rotation about the first axis. [`World::check`](crate::World::check) refuses limits, a motor or a spring on
    /// a fixed joint.
    pub fn limited(mut self, min: f32, max: f32) -> Self {
        self.on_first(|axis| Axis { bounds: Bounds::Between { min, max }, ..axis });
        self
    }

    /// Adds a motor to the first axis that is not locked, or to the distance: see [`Axis::motor`]. The motor does not
    /// push an axis beyond its limits.
    pub fn motor(mut self, speed: f32, max_load: f32) -> Self {
        self.on_first(|axis| axis.motor(speed, max_load));
        self
    }

    /// Pushes the first axis that is not locked, or the distance, with a constant load: see [`Axis::constant_load`].
    pub fn constant_load(mut self, load: f32) -> Self {
        self.on_first(|axis| axis.constant_load(load));
        self
    }

    /// Adds a spring to the first axis that is not locked, or to the distance: see [`Axis::spring`].
    pub fn spring(mut self, target: f32, frequency: f32, damping_ratio: f32) -> Self {
        self.on_first(|axis| axis.spring(target, frequency, damping_ratio, f32::MAX));
        self
    }

    /// Adds a spring and a damper to the first axis that is not locked, or to the distance: see
    /// [`Axis::spring_damper`].
    pub fn spring_damper(mut self, target: f32, stiffness: f32, damping: f32) -> Self {
        self.on_first(|axis| axis.spring_damper(target, stiffness, damping, f32::MAX));
        self
    }

    /// The first axis that is not locked, or the distance. Translations come before rotations. Returns `None` for a
    /// fixed joint.
    pub fn first_axis(&mut self) -> Option<&mut Axis> {
        let linear = match &mut self.linear {
            Linear::Axes(axes) => axes,
            Linear::Distance(distance) => std::slice::from_mut(distance),
        };
        linear.iter_mut().chain(&mut self.angular).find(|axis| axis.bounds != Bounds::Locked)
    }

    /// Changes the first axis. A fixed joint has no free axis: it gets bounds that no position satisfies, and
    /// [`Self::check_axes`] refuses them.
    fn on_first(&mut self, change: impl Fn(Axis) -> Axis) {
        match self.first_axis() {
            Some(axis) => *axis = change(*axis),
            None => self.angular[0].bounds = NOWHERE,
        }
    }

    /// The three translation axes, or the distance alone.
    pub(crate) fn linear_axes(&self) -> &[Axis] {
        match &self.linear {
            Linear::Axes(axes) => axes,
            Linear::Distance(distance) => std::slice::from_ref(distance),
        }
    }

    /// Whether the joint is off, or leaves all six axes free and only keeps its bodies from colliding.
    pub(crate) fn holds_nothing(&self) -> bool {
        !self.enabled || self.linear_axes().iter().chain(&self.angular).all(|axis| *axis == Axis::FREE)
    }

    /// Whether the joint keeps the anchors together.
    pub fn holds_anchors(&self) -> bool {
        self.linear == Linear::Axes([Axis::LOCKED; 3])
    }

    /// The axis of the twist, which passes half a turn without a jump: the axis that is bounded least, or the first of
    /// several, and the first of all if it counts turns.
    pub(crate) fn twist_axis(&self) -> usize {
        let freedom = |axis: &Axis| match axis.bounds {
            Bounds::Free => 2,
            Bounds::Between { .. } => 1,
            Bounds::Locked => 0,
        };
        let [first, others @ ..] = self.angular.each_ref().map(freedom);
        match others {
            _ if self.angular[0].counts_turns() => 0,
            [y, z] if y > first.max(z) => 1,
            [y, z] if z > first.max(y) => 2,
            _ => 0,
        }
    }

    /// Whether the axis of the twist may swing in a against that in b.
    pub(crate) fn swings(&self) -> bool {
        let twist = self.twist_axis();
        (0..3).any(|angle| angle != twist && self.angular[angle].bounds != Bounds::Locked)
    }

    /// The coordinate of an angle, by its number in [`Angles`](angles::Angles) of frames whose first axis is that of
    /// the twist. Where nothing swings, none jumps.
    pub(crate) fn coordinate(&self, angle: usize) -> usize {
        let (twist, swings) = (self.twist_axis(), self.swings());
        let needs_lock = |angle: usize| swings && self.angular[angle].bounds == Bounds::Locked;
        let are_others_free = || (0..3).all(|other| other == angle || self.angular[other].bounds == Bounds::Free);
        // A height has no angle above a quarter of a turn.
        let is_limited =
            matches!(self.angular[angle].bounds, Bounds::Between { min, max } if min < FRAC_PI_2 && max > -FRAC_PI_2);
        match (angle + 3 - twist) % 3 {
            0 if !needs_lock(angle) => angles::TWIST,
            place if is_limited && are_others_free() => angles::ELEVATION + place - 1,
            place if !needs_lock(angle) => angles::SWING + place - 1,
            // A swing without twist has no component of its quaternion along a locked axis.
            place if needs_lock(twist) => angles::HALVES + place,
            place => angles::HEIGHT + place - 1,
        }
    }

    /// Whether the joint keeps the anchors together and restricts nothing else.
    pub fn is_ball(&self) -> bool {
        self.holds_anchors() && self.angular == [Axis::FREE; 3]
    }

    /// Whether the joint holds this body.
    pub fn holds(&self, body: BodyHandle) -> bool {
        self.body_a.is(body) || self.body_b.is_some_and(|b| b.is(body))
    }

    /// The indices of its bodies.
    pub(crate) fn indices(&self) -> (usize, Option<usize>) {
        (self.body_a.index(), self.body_b.map(BodyHandle::index))
    }

    /// Makes the joint break at a force (N): see [`Self::break_force`].
    pub fn breaking_at(mut self, force: f32) -> Self {
        self.break_force = force;
        self
    }

    /// Whether any axis has a motor or a spring.
    pub(crate) fn is_driven(&self) -> bool {
        self.linear_axes().iter().chain(&self.angular).any(|axis| axis.drive != Drive::None)
    }

    /// Whether a finite force breaks the joint.
    pub(crate) fn can_break(&self) -> bool {
        self.break_force < f32::INFINITY
    }

    /// Switches the joint on or off: [`Self::enabled`].
    ///
    /// ```
    /// use drystone::{Body, Joint, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// let lamp = world.insert(Body::dynamic().shape(Shape::ball(0.1)));
    /// let hook = world.insert_joint(Joint::to_world(lamp, Vec3::ZERO, Vec3::ZERO).enabled(false));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(0.1)?;
    /// assert!(simulation.world.bodies[lamp].position.y < -0.04);
    /// let at = simulation.world.bodies[lamp].position;
    /// let joint = simulation.world.joint_mut(hook).expect("it is there");
    /// (joint.enabled, joint.anchor_b) = (true, at);
    /// simulation.step(0.1)?;
    /// assert!(simulation.world.bodies[lamp].position.distance(at) < 1e-3);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn enabled(self, enabled: bool) -> Self {
        Self { enabled, ..self }
    }

    /// Lets the two bodies collide with each other.
    pub fn colliding(mut self) -> Self {
        self.collide = true;
        self
    }
}
