//! Bodies, shapes, joints and materials. Units are SI, the axes are right-handed, and Y is up in the catalogue.

mod bodies;
mod body;
mod change;
mod groups;
mod joint;
mod joint_axis;
mod joint_motion;
mod joints;
mod lever;
mod limits;
mod list;
mod mass;
pub(crate) mod shape;
mod shape_parts;
mod surface;
mod tag;
mod voxels;

pub use bodies::{Bodies, BodyHandle};
pub(crate) use body::Surface;
pub use body::{Body, BodyKind, Collider, CombineRule, Material};
pub(crate) use change::WorldChange;
pub use groups::Groups;
pub use joint::{Joint, Linear};
pub use joint_axis::{Axis, Bounds, Drive};
pub use joint_motion::JointMotion;
pub(crate) use joint_motion::MIN_DISTANCE;
pub use joints::{JointHandle, Joints};
pub use limits::{MAX_GRAVITY, MAX_LENGTH, MAX_SPEED};
pub use mass::MassProperties;
pub use shape::Shape;
pub(crate) use shape::{placed, pose, seen_from};
pub use surface::Triangles;

use glam::Vec3;

use crate::error::{Result, ensure};
use limits::{is_place, is_within};
use tag::WorldTag;

/// A set of rigid bodies.
///
/// Bodies and joints can be added and removed at any time, also while a [`Simulation`](crate::Simulation) owns the
/// world:
///
/// ```
/// use drystone::{Body, Shape, World};
///
/// let mut world = World::new();
/// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)));
/// world.body_mut(brick).expect("just put in").material.friction = 0.8;
/// world.remove(brick);
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)));
/// assert!(world.body(brick).is_none() && world.body(ball).is_some());
/// ```
///
/// ```
/// use drystone::{Body, Joint, Shape, World, glam::Vec3};
///
/// let mut world = World::new();
/// let [a, b] = [0.0, 2.0].map(|x| world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(1.0).position(x, 1.0, 0.0)));
/// world.bodies[a].linear_velocity = Vec3::X;
/// // Joints have handles too. Their index changes when an earlier joint is removed.
/// let rod = world.insert_joint(Joint::new(a, Vec3::ZERO, b, Vec3::ZERO).rod(1.9));
/// world.joint_mut(rod).expect("just put in").break_force = 100.0;
/// assert_eq!(world.anchors(world.joint(rod).expect("still there")), [Vec3::Y, Vec3::new(2.0, 1.0, 0.0)]);
/// assert!((world.joint_gap() - 0.1).abs() < 1e-6);
/// let rope = world.insert_joint(Joint::to_world(b, Vec3::ZERO, Vec3::Y).rope(5.0));
/// assert_eq!(world.joints.index(rope), Some(1));
/// world.remove_joint(rod);
/// world.check()?;
///
/// assert_eq!((world.dynamic_count(), world.dynamic().count(), world.first_non_finite()), (2, 2, None));
/// assert_eq!((world.kinetic_energy(), world.linear_momentum().x), (0.5, 1.0));
/// assert!((world.potential_energy() - 2.0 * 9.81).abs() < 1e-5);
/// assert_eq!((world.angular_momentum().z, world.gravity_on(a).y), (-1.0, -9.81));
///
/// // A second world beside the first. Its bodies never meet those of the first.
/// world.beside(&World::new());
/// let other = world.insert_in(1, Body::fixed())?;
/// assert_eq!((world.world_count(), world.worlds()[1].clone()), (2, vec![other]));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Debug)]
pub struct World {
    /// Acceleration of gravity (m/s²), in every world without its own gravity. [`Body::gravity_scale`] scales it for
    /// each body.
    pub gravity: Vec3,
    /// Gravity of individual worlds that stand [beside](World::beside) each other (m/s²). A world with `None`, or
    /// beyond the end of the list, has `gravity`.
    pub own_gravity: Vec<Option<Vec3>>,
    /// The bodies, by handle or by index. A body keeps its index until it is removed.
    pub bodies: Bodies,
    /// The joints.
    pub joints: Joints,
}

crate::saved::state!(World { gravity, own_gravity, bodies, joints });

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

impl World {
    /// An empty world with gravity 9.81 m/s² along -Y.
    pub fn new() -> Self {
        let (gravity, tag) = (Vec3::new(0.0, -9.81, 0.0), WorldTag::next());
        Self { gravity, own_gravity: Vec::new(), bodies: Bodies::of_world(tag), joints: Joints::of_world(tag) }
    }

    /// Gravity in one of the worlds that stand beside each other (m/s²).
    pub fn gravity_of(&self, world: usize) -> Vec3 {
        self.own_gravity.get(world).copied().flatten().unwrap_or(self.gravity)
    }

    /// Acceleration of a body by gravity (m/s²): the gravity of its world times [`Body::gravity_scale`], or zero if the
    /// body is not dynamic.
    pub fn gravity_on(&self, body: BodyHandle) -> Vec3 {
        self.bodies.index_of(body).map_or(Vec3::ZERO, |index| self.gravity_at(index))
    }

    /// [`World::gravity_on`] the body at an index.
    pub(crate) fn gravity_at(&self, index: usize) -> Vec3 {
        match self.bodies[index] {
            Body { kind: BodyKind::Dynamic, gravity_scale, .. } => {
                self.gravity_of(self.bodies.worlds()[index] as usize) * gravity_scale
            }
            _ => Vec3::ZERO,
        }
    }

    /// Adds a body to the last world and returns its handle.
    pub fn insert(&mut self, body: Body) -> BodyHandle {
        self.bodies.insert(self.world_count() - 1, body)
    }

    /// Adds a body to one of the worlds that stand [beside](World::beside) each other.
    ///
    /// # Errors
    /// There is no world of this number.
    pub fn insert_in(&mut self, world: usize, body: Body) -> Result<BodyHandle> {
        let worlds = self.world_count();
        ensure(world < worlds, || format!("world {world}: the worlds beside each other are 0 to {}", worlds - 1))?;
        Ok(self.bodies.insert(world, body))
    }

    /// Removes a body together with all joints that hold it. Returns `None` if the body is already gone.
    pub fn remove(&mut self, body: BodyHandle) -> Option<Body> {
        let removed = self.bodies.remove(body)?;
        if self.joints.iter().any(|joint| joint.holds(body)) {
            self.joints.retain(|joint| !joint.holds(body));
        }
        Some(removed)
    }

    /// A body, or `None` if it is gone.
    pub fn body(&self, body: BodyHandle) -> Option<&Body> {
        self.bodies.index_of(body).map(|index| &self.bodies[index])
    }

    /// A mutable body, or `None` if it is gone.
    pub fn body_mut(&mut self, body: BodyHandle) -> Option<&mut Body> {
        self.bodies.index_of(body).map(|index| &mut self.bodies[index])
    }

    /// Adds a joint and returns its handle. [`World::check`] and the next step refuse an invalid joint, for example to
    /// a body that is gone.
    ///
    /// ```
    /// use drystone::{Body, Joint, Shape, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// let [a, b] = [0.0, 2.0].map(|x| world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(x, 0.0, 0.0)));
    /// world.remove(a);
    /// let rope = world.insert_joint(Joint::new(b, Vec3::ZERO, a, Vec3::ZERO).rope(3.0));
    /// assert_eq!(world.check().expect_err("a is gone").to_string(), "joint 0: names body 0, which was removed");
    /// world.remove_joint(rope);
    /// assert!(world.check().is_ok());
    /// ```
    pub fn insert_joint(&mut self, joint: Joint) -> JointHandle {
        self.joints.insert(joint)
    }

    /// Removes a joint. Returns `None` if it is already gone.
    pub fn remove_joint(&mut self, joint: JointHandle) -> Option<Joint> {
        self.joints.remove(joint)
    }

    /// A joint, or `None` if it is gone.
    pub fn joint(&self, joint: JointHandle) -> Option<&Joint> {
        self.joints.index(joint).map(|index| &self.joints[index])
    }

    /// A mutable joint, or `None` if it is gone.
    pub fn joint_mut(&mut self, joint: JointHandle) -> Option<&mut Joint> {
        self.joints.index(joint).map(|index| &mut self.joints[index])
    }

    /// Appends another world. Its bodies and joints follow those of this world. Bodies of different worlds never meet,
    /// wherever they are. The other world keeps its own gravity if the two differ.
    ///
    /// ```
    /// use drystone::{World, glam::Vec3};
    /// let mut world = World::new();
    /// world.beside(&World { gravity: Vec3::Y * -1.62, ..World::new() });
    /// assert_eq!([0, 1].map(|k| world.gravity_of(k).y), [-9.81, -1.62]);
    /// ```
    pub fn beside(&mut self, other: &Self) {
        let (first, worlds) = (self.bodies.len(), self.world_count());
        for world in 0..other.world_count() {
            let gravity = other.gravity_of(world);
            if gravity != self.gravity {
                self.own_gravity.resize(worlds + world, None);
                self.own_gravity.push(Some(gravity));
            }
        }
        self.bodies.append(&other.bodies);
        for joint in &other.joints {
            let place = |body: BodyHandle| self.bodies.appended(body, first, &other.bodies);
            let (body_a, body_b) = (place(joint.body_a), joint.body_b.map(place));
            self.joints.insert(Joint { body_a, body_b, ..*joint });
        }
    }

    /// The number of worlds beside each other, at least one.
    pub fn world_count(&self) -> usize {
        self.bodies.world_count()
    }

    /// The bodies of each world, ascending by index.
    pub fn worlds(&self) -> Vec<Vec<BodyHandle>> {
        let mut worlds = vec![Vec::new(); self.world_count()];
        let numbers = self.bodies.worlds();
        self.bodies.handles().for_each(|body| worlds[numbers[body.index()] as usize].push(body));
        worlds
    }

    /// Positions of the two anchors of a joint in the world (m). An anchor on a removed body is NaN.
    pub fn anchors(&self, joint: &Joint) -> [Vec3; 2] {
        let on_body =
            |b: BodyHandle, anchor: Vec3| self.body(b).map_or(Vec3::NAN, |b| b.position + b.rotation * anchor);
        let on_a = on_body(joint.body_a, joint.anchor_a);
        [on_a, joint.body_b.map_or(joint.anchor_b, |b| on_body(b, joint.anchor_b))]
    }

    /// Largest error of any joint (m): the distance of its anchors along locked axes, and beyond its limits.
    pub fn joint_gap(&self) -> f32 {
        self.enabled_joints().map(|joint| self.joint_motion(joint).gap(joint)).fold(0.0, f32::max)
    }

    /// The joints that act.
    pub(crate) fn enabled_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|joint| joint.enabled)
    }

    /// Refuses a world that cannot be simulated:
    ///
    /// - numbers that are not finite or are out of range;
    /// - shapes without extent;
    /// - dynamic bodies without mass, or with a mass out of [`MassProperties::MASSES`];
    /// - moving bodies with shapes that only fixed bodies can have;
    /// - joints to bodies that do not exist;
    /// - joints between a fixed body and the world or another fixed body;
    /// - joints whose axis has no direction;
    /// - limits, motors and springs on joints with every axis locked.
    ///
    /// A body can become fixed later, with all its joints.
    ///
    /// # Errors
    /// One line names the body and its shape, or the joint.
    pub fn check(&self) -> Result<()> {
        self.check_gravity()?;
        (0..self.bodies.len()).try_for_each(|i| self.check_body(i))?;
        self.check_joints()?;
        self.joints.iter().enumerate().try_for_each(|(i, joint)| {
            let (a, b) = joint.indices();
            let is_fixed = |body: usize| self.bodies[body].kind == BodyKind::Fixed;
            let ties_something = !is_fixed(a) || b.is_some_and(|b| !is_fixed(b));
            let other = || b.map_or_else(|| "the world".into(), |b| self.name_of(b));
            ensure(ties_something, || {
                format!("joint {i}: connects {} and {}, which are both fixed", self.name_of(a), other())
            })
        })
    }

    /// Raises moments of inertia that are too small for the sweeps: see [`MassProperties::MAX_LEVERAGE`].
    pub(crate) fn raise_inertias(&mut self) {
        self.bodies.iter_mut().for_each(lever::raise_inertia);
    }

    /// Refuses a gravity above [`MAX_GRAVITY`], or NaN.
    pub(crate) fn check_gravity(&self) -> Result<()> {
        std::iter::once(self.gravity).chain(self.own_gravity.iter().flatten().copied()).try_for_each(|gravity| {
            let message = || format!("gravity = {gravity}: must be at most {MAX_GRAVITY:e} m/s² along every axis");
            ensure(is_within(gravity, MAX_GRAVITY), message)
        })
    }

    /// Refuses masses and materials that cannot be simulated.
    pub(crate) fn check_surfaces(&self) -> Result<()> {
        self.bodies.iter().enumerate().try_for_each(|(i, body)| check_one(i, body, Body::check_surface))
    }

    /// Refuses an invalid body, by its index.
    pub(crate) fn check_body(&self, i: usize) -> Result<()> {
        let check = |body: &Body| self.bodies.check_place(i).and_then(|()| Body::check(body));
        self.bodies.get(i).map_or(Ok(()), |body| check_one(i, body, check))
    }

    /// The name of a body in messages, or its index if there is no such body.
    pub(crate) fn name_of(&self, i: usize) -> String {
        self.bodies.get(i).map_or_else(|| format!("body {i}"), |body| name_of(i, body))
    }

    /// Refuses joints to bodies that do not exist, and anchors, axes and limits that are out of range.
    ///
    /// ```
    /// use drystone::{Body, Joint, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// let body = world.insert(Body::dynamic());
    /// world.insert_joint(Joint::to_world(body, Vec3::ZERO, Vec3::ZERO));
    /// assert!(world.check_joints().is_ok());
    /// world.joints[0].anchor_a.x = f32::NAN;
    /// assert!(world.check_joints().is_err());
    /// ```
    ///
    /// # Errors
    /// One line names the joint.
    pub fn check_joints(&self) -> Result<()> {
        for (i, joint) in self.joints.iter().enumerate() {
            let bodies = [Some(joint.body_a), joint.body_b];
            let exist = bodies.into_iter().flatten().try_for_each(|body| self.bodies.check_handle(body));
            exist.map_err(|e| e.within(format_args!("joint {i}")))?;
            let differ = joint.body_b != Some(joint.body_a);
            ensure(differ, || format!("joint {i}: connects body {} to itself", joint.body_a.index()))?;
            let breaks = joint.break_force;
            ensure(breaks > 0.0, || format!("joint {i}: break_force = {breaks}: must be above 0 N"))?;
            let are_places = is_place(joint.anchor_a) && is_place(joint.anchor_b);
            ensure(are_places, || format!("joint {i}: its anchors must be at most {MAX_LENGTH:e} m in size"))?;
            joint.check_axes().map_err(|e| e.within(format_args!("joint {i}")))?;
        }
        Ok(())
    }

    /// The dynamic bodies.
    pub fn dynamic(&self) -> impl Iterator<Item = &Body> {
        self.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic)
    }

    /// Number of dynamic bodies.
    pub fn dynamic_count(&self) -> usize {
        self.dynamic().count()
    }

    /// The first body whose pose or velocity is not finite.
    pub fn first_non_finite(&self) -> Option<BodyHandle> {
        self.bodies.handles().find(|&handle| !self.bodies[handle].is_finite())
    }

    /// Sum of the kinetic energies of the dynamic bodies (J), in f64.
    pub fn kinetic_energy(&self) -> f64 {
        self.dynamic().map(Body::kinetic_energy).sum()
    }

    /// Sum of the potential energies of the dynamic bodies (J), zero at the origin, in f64.
    pub fn potential_energy(&self) -> f64 {
        let of = |(i, b): (usize, &Body)| {
            -f64::from(b.mass.mass) * self.gravity_at(i).as_dvec3().dot(b.center_of_mass().as_dvec3())
        };
        self.bodies.iter().enumerate().filter(|(_, b)| b.kind == BodyKind::Dynamic).map(of).sum()
    }

    /// Linear momentum of the dynamic bodies (kg m/s), in f64.
    pub fn linear_momentum(&self) -> glam::DVec3 {
        self.dynamic().map(|b| f64::from(b.mass.mass) * b.linear_velocity.as_dvec3()).sum()
    }

    /// Angular momentum of the dynamic bodies about the origin (kg m²/s), in f64.
    pub fn angular_momentum(&self) -> glam::DVec3 {
        self.dynamic().map(Body::angular_momentum).sum()
    }
}

/// Refuses a body if `check` does, in a message that names the body.
fn check_one(i: usize, body: &Body, check: impl Fn(&Body) -> Result<()>) -> Result<()> {
    check(body).map_err(|e| e.within(name_of(i, body)))
}

/// The name of a body in messages.
fn name_of(i: usize, body: &Body) -> String {
    format!("body {i} {:?}", body.name)
}
