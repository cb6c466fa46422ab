//! Bodies, shapes, joints and materials. SI units, right-handed, Y up in the catalogue.

mod body;
mod joint;
mod lever;
mod limits;
mod mass;
mod shape;
mod surface;

pub use body::{Body, BodyKind, Collider, Material};
pub use joint::BallJoint;
pub use limits::{MOST_GRAVITY, MOST_LENGTH, MOST_SPEED};
pub use mass::MassProperties;
pub use shape::Shape;
pub(crate) use shape::pose;
pub use surface::Triangles;

use std::ops::Range;

use glam::Vec3;

use crate::error::{Result, ensure, input};
use limits::{is_place, is_within};

/// A set of rigid bodies under one gravity.
#[derive(Clone, Debug)]
pub struct World {
    /// Acceleration of every dynamic body (m/s²).
    pub gravity: Vec3,
    /// The bodies. Everything else names a body by its index here.
    pub bodies: Vec<Body>,
    /// The ball joints.
    pub joints: Vec<BallJoint>,
    /// First body of each world that was set [beside](World::beside) the first; empty for one world.
    pub begins: Vec<usize>,
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

impl World {
    /// An empty world with gravity 9.81 m/s² along -Y.
    pub fn new() -> Self {
        Self { gravity: Vec3::new(0.0, -9.81, 0.0), bodies: Vec::new(), joints: Vec::new(), begins: Vec::new() }
    }

    /// Adds a body and returns its index.
    pub fn add(&mut self, body: Body) -> usize {
        self.bodies.push(body);
        self.bodies.len() - 1
    }

    /// Adds a joint and returns its index.
    ///
    /// # Panics
    /// The joint names a body that the world does not have yet.
    pub fn join(&mut self, joint: BallJoint) -> usize {
        let bodies = self.bodies.len();
        assert!(
            joint.body_a < bodies && joint.body_b.is_none_or(|b| b < bodies),
            "a joint names a body beyond {bodies}"
        );
        self.joints.push(joint);
        self.joints.len() - 1
    }

    /// Sets another world beside this one: its bodies and joints follow those of this world, and bodies of different worlds never
    /// meet, wherever they are. A body that is added later belongs to the last world.
    ///
    /// # Errors
    /// The gravity of the two is not the same.
    pub fn beside(&mut self, other: &Self) -> Result<()> {
        let (here, there) = (self.gravity, other.gravity);
        ensure(here == there, || format!("worlds of gravity {here} and {there}: all must have the same"))?;
        let first = self.bodies.len();
        self.begins.extend(other.worlds().map(|bodies| first + bodies.start));
        self.bodies.extend_from_slice(&other.bodies);
        self.joints.extend(other.joints.iter().map(|j| BallJoint {
            body_a: first + j.body_a,
            body_b: j.body_b.map(|b| first + b),
            ..*j
        }));
        Ok(())
    }

    /// The bodies of each world.
    pub fn worlds(&self) -> impl ExactSizeIterator<Item = Range<usize>> {
        let begin = |k: usize| if k == 0 { 0 } else { self.begins[k - 1] };
        let end = move |k: usize| self.begins.get(k).copied().unwrap_or(self.bodies.len());
        (0..self.begins.len() + 1).map(move |k| begin(k)..end(k))
    }

    /// Where the two anchors of a joint are in the world (m).
    pub fn anchors(&self, joint: &BallJoint) -> [Vec3; 2] {
        let on_body = |b: usize, anchor: Vec3| self.bodies[b].position + self.bodies[b].rotation * anchor;
        let on_a = on_body(joint.body_a, joint.anchor_a);
        [on_a, joint.body_b.map_or(joint.anchor_b, |b| on_body(b, joint.anchor_b))]
    }

    /// Largest distance between the two anchors of any joint (m).
    pub fn joint_gap(&self) -> f32 {
        self.joints.iter().map(|j| self.anchors(j)).map(|[a, b]| a.distance(b)).fold(0.0, f32::max)
    }

    /// Refuses a world that cannot be simulated: numbers that are not finite or out of range, shapes without extent, dynamic bodies
    /// without mass or with a mass out of [`MassProperties::MASSES`], moving bodies with shapes that only fixed bodies can have,
    /// joints to bodies that do not exist.
    ///
    /// # Errors
    /// One line that names the body and its shape, or the joint.
    pub fn check(&self) -> Result<()> {
        self.check_gravity()?;
        if let Some(k) = self.worlds().position(|range| range.start > range.end || range.end > self.bodies.len()) {
            return Err(input!("world {k}: begins or ends beyond the last of {} bodies", self.bodies.len()));
        }
        self.check_bodies(Body::check)?;
        self.check_joints()
    }

    /// Raises the moments of inertia that no sweep can work with: [`MassProperties::MOST_LEVERAGE`].
    pub(crate) fn raise_inertias(&mut self) {
        self.bodies.iter_mut().for_each(lever::raise_inertia);
    }

    /// Refuses a gravity of more than [`MOST_GRAVITY`], or one that is no number.
    pub(crate) fn check_gravity(&self) -> Result<()> {
        let gravity = self.gravity;
        let message = || format!("gravity = {gravity}: must be at most {MOST_GRAVITY:e} m/s² along every axis");
        ensure(is_within(gravity, MOST_GRAVITY), message)
    }

    /// Refuses masses and materials that cannot be simulated.
    pub(crate) fn check_surfaces(&self) -> Result<()> {
        self.check_bodies(Body::check_surface)
    }

    fn check_bodies(&self, check: impl Fn(&Body) -> Result<()>) -> Result<()> {
        for (i, body) in self.bodies.iter().enumerate() {
            check(body).map_err(|e| e.within(format_args!("body {i} {:?}", body.name)))?;
        }
        Ok(())
    }

    /// Refuses joints to bodies that do not exist, and anchors out of range.
    pub(crate) fn check_joints(&self) -> Result<()> {
        let bodies = self.bodies.len();
        for (i, joint) in self.joints.iter().enumerate() {
            let exist = joint.body_a < bodies && joint.body_b.is_none_or(|b| b < bodies);
            ensure(exist, || format!("joint {i}: names a body beyond the last of {bodies}"))?;
            let differ = joint.body_b != Some(joint.body_a);
            ensure(differ, || format!("joint {i}: ties body {} to itself", joint.body_a))?;
            let are_places = is_place(joint.anchor_a) && is_place(joint.anchor_b);
            ensure(are_places, || format!("joint {i}: its anchors must be at most {MOST_LENGTH:e} m in size"))?;
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
    pub fn first_non_finite(&self) -> Option<usize> {
        self.bodies.iter().position(|b| !b.is_finite())
    }

    /// Sum of the kinetic energies of the dynamic bodies (J), in f64.
    pub fn kinetic_energy(&self) -> f64 {
        self.bodies.iter().map(Body::kinetic_energy).sum()
    }

    /// Sum of the potential energies of the dynamic bodies (J), zero at the origin, in f64.
    pub fn potential_energy(&self) -> f64 {
        self.dynamic()
            .map(|b| -f64::from(b.mass.mass) * self.gravity.as_dvec3().dot(b.center_of_mass().as_dvec3()))
            .sum()
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
