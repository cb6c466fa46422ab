//! Joints: what a pair of bodies may still do against each other.

use glam::{Quat, Vec3};

use super::bodies::BodyHandle;
use super::joint_axis::{Axis, Bounds, Drive};
use crate::error::Result;
use crate::math::rotation;
use crate::saved::{Archive, Saved};

/// Ties a body to another, or to the world.
///
/// A joint is a ball joint at first, and a method makes another kind of it: [`hinge`](Self::hinge), [`slider`](Self::slider),
/// [`fixed`](Self::fixed), [`rope`](Self::rope), [`rod`](Self::rod), [`elastic`](Self::elastic) or [`generic`](Self::generic). Limits, motors and
/// springs then belong to the axes, and may be given before the kind. A second kind replaces the first with all that belongs to its axes.
///
/// Positions and speeds of a joint are those of body a in the frame of body b: a motor with a positive speed moves a forward along the axis.
/// With the bodies swapped, limits and targets change their signs. The axes of a joint turn with body b.
///
/// ```
/// use drystone::{Body, Joint, Shape, World};
/// use glam::Vec3;
///
/// let mut world = World::new();
/// let wall = world.add(Body::fixed().shape(Shape::cuboid(0.1, 2.0, 2.0)));
/// let door = world.add(Body::dynamic().position(0.6, 0.0, 0.0).shape(Shape::cuboid(0.5, 1.0, 0.02)));
/// let edges = (Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0));
/// world.join(Joint::new(door, edges.0, wall, edges.1).hinge(Vec3::Y).limited(0.0, 1.5).motor(0.3, 20.0));
/// ```
///
/// ```
/// use drystone::{Axis, Joint, Linear, glam::{Quat, Vec3}};
///
/// let anchors = (Vec3::X, Vec3::NEG_X);
/// let ball = Joint::new(0, anchors.0, 1, anchors.1);
/// assert!(ball.is_ball() && ball.holds_anchors() && ball.holds(0) && ball.holds(1) && !ball.holds(2));
/// let door = ball.hinge(Vec3::Y).limited(0.0, 1.5).spring(0.0, 1.0, 0.7).breaking_at(500.0).colliding();
/// assert!(door.holds_anchors() && !door.is_ball() && door.collide);
/// let piston = ball.slider(Vec3::Y).motor(0.5, 100.0);
/// let weld = ball.fixed();
/// let [rope, rod, spring] = [ball.rope(2.0), ball.rod(2.0), ball.elastic(2.0, 1.5, 0.1)];
/// assert_eq!(rope.linear, Linear::Distance(Axis::limited(0.0, 2.0)));
/// assert_eq!(rod, ball.at_distance(Axis::limited(2.0, 2.0)));
/// assert_eq!(spring, ball.at_distance(Axis::FREE.spring(2.0, 1.5, 0.1, f32::MAX)));
/// // A screw without thread: free to shift along its axis and to turn about it.
/// let bolt = ball.along(Vec3::Z).generic([Axis::FREE, Axis::LOCKED, Axis::LOCKED], [Axis::FREE, Axis::LOCKED, Axis::LOCKED]);
/// // Angles are zero with body 0 turned by a quarter.
/// let bolt = bolt.zero_at(Quat::from_rotation_z(1.5), Quat::IDENTITY);
/// assert!(bolt.clone().first_axis().is_some() && weld.clone().first_axis().is_none());
/// assert_eq!(Joint::to_world(0, anchors.0, Vec3::Y).body_b, None);
/// # let _ = piston;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// One body.
    pub body_a: BodyHandle,
    /// The other; none for the world.
    pub body_b: Option<BodyHandle>,
    /// The point in a's frame (m).
    pub anchor_a: Vec3,
    /// The point in b's frame, or in the world (m).
    pub anchor_b: Vec3,
    /// Rotation from the axes of the joint to the frame of a.
    pub frame_a: Quat,
    /// Rotation from the axes of the joint to the frame of b, or to the world. Angles are zero where the two frames agree.
    pub frame_b: Quat,
    /// Where the anchor of a may be.
    pub linear: Linear,
    /// How a may turn. The first angle is the twist about the first axis, from -pi to pi. The other two are the components, along the
    /// second and third axis, of the rotation vector that takes the first axis of b to that of a.
    pub angular: [Axis; 3],
    /// Whether the two bodies still collide with each other.
    pub collide: bool,
    /// The force at which the joint breaks (N), above 0; infinite for one that holds. A joint breaks after a step in which it bore more: the
    /// length of the sum of its impulses over all substeps, over the length of the step. A blow of J (N s) within a step of the length h counts
    /// as J/h, for any number of substeps. Torques do not count. The joint is then gone, and [`Event::Broke`](crate::Event::Broke) tells of it.
    pub break_force: f32,
}

/// How a joint guides the anchor of a.
///
/// ```
/// use drystone::{Axis, Joint, Linear, glam::Vec3};
///
/// let joint = Joint::to_world(0, Vec3::ZERO, Vec3::Y);
/// assert_eq!(joint.linear, Linear::Axes([Axis::LOCKED; 3]));
/// assert_eq!(joint.rope(1.0).linear, Linear::Distance(Axis::limited(0.0, 1.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Linear {
    /// Along each of the axes (m).
    Axes([Axis; 3]),
    /// By its distance from the anchor of b (m).
    Distance(Axis),
}

/// The axes, or one for the distance.
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
    break_force,
});

/// The frames of a joint whose axis was given no direction.
pub(super) const NO_FRAME: Quat = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);

/// The bounds of a fixed joint that was given limits, a motor or a spring.
pub(super) const NOWHERE: Bounds = Bounds::Between { min: f32::INFINITY, max: f32::NEG_INFINITY };

impl Joint {
    /// Ties two bodies together by a ball joint. They then do not collide. An index names the first body that was put there: give a handle
    /// where bodies are removed.
    pub fn new(body_a: impl Into<BodyHandle>, anchor_a: Vec3, body_b: impl Into<BodyHandle>, anchor_b: Vec3) -> Self {
        Self { body_b: Some(body_b.into()), ..Self::to_world(body_a, anchor_a, anchor_b) }
    }

    /// Ties a body to a point of the world by a ball joint.
    pub fn to_world(body_a: impl Into<BodyHandle>, anchor_a: Vec3, point: Vec3) -> Self {
        Self {
            body_a: body_a.into(),
            body_b: None,
            anchor_a,
            anchor_b: point,
            frame_a: Quat::IDENTITY,
            frame_b: Quat::IDENTITY,
            linear: Linear::Axes([Axis::LOCKED; 3]),
            angular: [Axis::FREE; 3],
            collide: false,
            break_force: f32::INFINITY,
        }
    }

    /// Body a may only turn, about an axis that has this direction in the frames of both bodies. The direction need not have unit length, but
    /// [`World::check`](crate::World::check) refuses one without length.
    pub fn hinge(self, direction: Vec3) -> Self {
        self.along(direction).generic([Axis::LOCKED; 3], [Axis::FREE, Axis::LOCKED, Axis::LOCKED])
    }

    /// Body a may only shift, along an axis that has this direction in the frames of both bodies.
    pub fn slider(self, direction: Vec3) -> Self {
        self.along(direction).generic([Axis::FREE, Axis::LOCKED, Axis::LOCKED], [Axis::LOCKED; 3])
    }

    /// Body a may not move.
    pub fn fixed(self) -> Self {
        self.generic([Axis::LOCKED; 3], [Axis::LOCKED; 3])
    }

    /// The anchors are at most `length` apart (m).
    pub fn rope(self, length: f32) -> Self {
        self.at_distance(Axis::limited(0.0, length))
    }

    /// The anchors are `length` apart (m).
    pub fn rod(self, length: f32) -> Self {
        self.at_distance(Axis::limited(length, length))
    }

    /// A spring between the anchors: see [`Axis::spring`].
    pub fn elastic(self, length: f32, frequency: f32, damping_ratio: f32) -> Self {
        self.at_distance(Axis::FREE.spring(length, frequency, damping_ratio, f32::MAX))
    }

    /// Guides the distance of the anchors, and no angle.
    pub fn at_distance(self, distance: Axis) -> Self {
        self.of_kind(Linear::Distance(distance), [Axis::FREE; 3])
    }

    /// Any axes: three to shift along, three to turn about. With all six of them free the joint holds nothing, and only keeps its two bodies
    /// from colliding.
    pub fn generic(self, linear: [Axis; 3], angular: [Axis; 3]) -> Self {
        self.of_kind(Linear::Axes(linear), angular)
    }

    /// Makes another kind of it. What the ball joint was given before goes on to the first axis, so that calls may come in any order.
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

    /// Sets the direction of the first axis, the same in the frames of both bodies. [`World::check`](crate::World::check) refuses a direction
    /// without length.
    pub fn along(self, direction: Vec3) -> Self {
        let frame = direction.try_normalize().map_or(NO_FRAME, |direction| rotation::arc(Vec3::X, direction));
        Self { frame_a: frame, frame_b: frame, ..self }
    }

    /// Sets the rotations of the two bodies at which all angles are zero. For the world, give the identity as that of b.
    pub fn zero_at(self, rotation_a: Quat, rotation_b: Quat) -> Self {
        Self {
            frame_a: rotation::unit(rotation::product(
                rotation::product(rotation_a.inverse(), rotation_b),
                self.frame_b,
            )),
            ..self
        }
    }

    /// Limits the first axis that is not locked, or the distance: see [`Bounds::Between`]. Of a ball joint that is the angle about its first
    /// axis. [`World::check`](crate::World::check) refuses limits, a motor or a spring on a fixed joint.
    pub fn limited(mut self, min: f32, max: f32) -> Self {
        self.on_first(|axis| Axis { bounds: Bounds::Between { min, max }, ..axis });
        self
    }

    /// Gives a motor to the first axis that is not locked, or to the distance: see [`Axis::motor`]. The motor pushes no axis beyond its limits.
    pub fn motor(mut self, speed: f32, max_load: f32) -> Self {
        self.on_first(|axis| axis.motor(speed, max_load));
        self
    }

    /// Gives a spring to the first axis that is not locked, or to the distance: see [`Axis::spring`].
    pub fn spring(mut self, target: f32, frequency: f32, damping_ratio: f32) -> Self {
        self.on_first(|axis| axis.spring(target, frequency, damping_ratio, f32::MAX));
        self
    }

    /// The first axis that is not locked, those to shift along before those to turn about; or the distance. None of a fixed joint.
    pub fn first_axis(&mut self) -> Option<&mut Axis> {
        let linear = match &mut self.linear {
            Linear::Axes(axes) => axes,
            Linear::Distance(distance) => std::slice::from_mut(distance),
        };
        linear.iter_mut().chain(&mut self.angular).find(|axis| axis.bounds != Bounds::Locked)
    }

    /// Changes the first axis. A fixed joint has none, and gets bounds that nothing can keep, for [`Self::check_axes`] to refuse.
    fn on_first(&mut self, change: impl Fn(Axis) -> Axis) {
        match self.first_axis() {
            Some(axis) => *axis = change(*axis),
            None => self.angular[0].bounds = NOWHERE,
        }
    }

    /// The axes to shift along, or the distance alone.
    pub(crate) fn linear_axes(&self) -> &[Axis] {
        match &self.linear {
            Linear::Axes(axes) => axes,
            Linear::Distance(distance) => std::slice::from_ref(distance),
        }
    }

    /// Whether it leaves every movement to its bodies, and only keeps them from colliding.
    pub(crate) fn holds_nothing(&self) -> bool {
        self.linear_axes().iter().chain(&self.angular).all(|axis| *axis == Axis::FREE)
    }

    /// Whether the anchors coincide.
    pub fn holds_anchors(&self) -> bool {
        self.linear == Linear::Axes([Axis::LOCKED; 3])
    }

    /// Whether it holds the anchors and nothing else.
    pub fn is_ball(&self) -> bool {
        self.holds_anchors() && self.angular == [Axis::FREE; 3]
    }

    /// Whether this is one of its bodies.
    pub fn holds(&self, body: impl Into<BodyHandle>) -> bool {
        let body = body.into();
        self.body_a.is(body) || self.body_b.is_some_and(|b| b.is(body))
    }

    /// The indices of its bodies.
    pub(crate) fn indices(&self) -> (usize, Option<usize>) {
        (self.body_a.index(), self.body_b.map(BodyHandle::index))
    }

    /// Lets the joint break at a force (N): see [`Self::break_force`].
    pub fn breaking_at(mut self, force: f32) -> Self {
        self.break_force = force;
        self
    }

    /// Whether a motor or a spring drives one of its axes.
    pub(crate) fn is_driven(&self) -> bool {
        self.linear_axes().iter().chain(&self.angular).any(|axis| axis.drive != Drive::None)
    }

    /// Whether there is a force that breaks the joint.
    pub(crate) fn can_break(&self) -> bool {
        self.break_force < f32::INFINITY
    }

    /// Lets the two bodies collide all the same.
    pub fn colliding(mut self) -> Self {
        self.collide = true;
        self
    }
}
