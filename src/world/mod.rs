//! Bodies, shapes and materials: what a scene is made of. SI units, right-handed, Y up in the catalogue.

mod body;
mod joint;
mod shape;
mod surface;

pub use body::{Body, BodyKind, Collider, MassProperties, Material};
pub use joint::BallJoint;
pub use shape::Shape;
pub(crate) use shape::pose;
pub use surface::Triangles;

use std::ops::Range;

use glam::Vec3;

use crate::error::{Error, Result};

/// Largest coordinate and size (m): its cube is still a number in single precision.
pub const MOST_LENGTH: f32 = 1e9;
/// Fastest that a body may begin with (m/s), (rad/s).
pub const MOST_SPEED: f32 = 1e9;
/// Largest acceleration of gravity along an axis (m/s²).
pub const MOST_GRAVITY: f32 = 1e9;

/// Whether a point has coordinates that are numbers and not too large.
fn is_place(point: Vec3) -> bool {
    point.abs().cmple(Vec3::splat(MOST_LENGTH)).all()
}

/// A set of rigid bodies under one gravity.
#[derive(Clone, Debug)]
pub struct World {
    /// Acceleration of every dynamic body (m/s²).
    pub gravity: Vec3,
    /// The bodies; a body's index here is its name everywhere else.
    pub bodies: Vec<Body>,
    /// Ball joints between them.
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
    /// A body that it names is not there yet.
    pub fn join(&mut self, joint: BallJoint) -> usize {
        let bodies = self.bodies.len();
        assert!(
            joint.body_a < bodies && joint.body_b.is_none_or(|b| b < bodies),
            "a joint names a body beyond {bodies}"
        );
        self.joints.push(joint);
        self.joints.len() - 1
    }

    /// Sets another world beside this one: its bodies and joints follow those that are here, and its bodies never meet them,
    /// wherever they are. What is added later belongs to the last world.
    ///
    /// # Errors
    /// The gravity of the two is not the same.
    pub fn beside(&mut self, other: &Self) -> Result<()> {
        if self.gravity != other.gravity {
            let (here, there) = (self.gravity, other.gravity);
            return Err(Error::input(format!("worlds of gravity {here} and {there}: all must have the same")));
        }
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

    /// Refuses what no step can be made of: numbers that are not finite or out of range, shapes without extent, dynamic bodies
    /// without mass or with one out of [`MassProperties::MASSES`], moving bodies with shapes that only fixed ones can have, joints to
    /// bodies that are not there.
    ///
    /// # Errors
    /// One line that names the body and its shape, or the joint.
    pub fn check(&self) -> Result<()> {
        self.check_gravity()?;
        if let Some(k) = self.worlds().position(|range| range.start > range.end || range.end > self.bodies.len()) {
            return Err(Error::input(format!(
                "world {k}: begins or ends beyond the last of {} bodies",
                self.bodies.len()
            )));
        }
        self.check_bodies(Body::check)?;
        self.check_joints()
    }

    /// Refuses a gravity of more than [`MOST_GRAVITY`], or one that is no number.
    pub(crate) fn check_gravity(&self) -> Result<()> {
        if self.gravity.abs().cmple(Vec3::splat(MOST_GRAVITY)).all() {
            return Ok(());
        }
        let gravity = self.gravity;
        Err(Error::input(format!("gravity = {gravity}: must be at most {MOST_GRAVITY:e} m/s² along every axis")))
    }

    /// Refuses masses and materials that no step can be made of.
    pub(crate) fn check_surfaces(&self) -> Result<()> {
        self.check_bodies(Body::check_surface)
    }

    fn check_bodies(&self, check: impl Fn(&Body) -> Result<()>) -> Result<()> {
        for (i, body) in self.bodies.iter().enumerate() {
            check(body).map_err(|e| e.within(format_args!("body {i} {:?}", body.name)))?;
        }
        Ok(())
    }

    /// Refuses joints to bodies that are not there, and anchors that are no points.
    pub(crate) fn check_joints(&self) -> Result<()> {
        for (i, joint) in self.joints.iter().enumerate() {
            let bodies = self.bodies.len();
            if joint.body_a >= bodies || joint.body_b.is_some_and(|b| b >= bodies) {
                return Err(Error::input(format!("joint {i}: names a body beyond the last of {bodies}")));
            }
            if joint.body_b == Some(joint.body_a) {
                return Err(Error::input(format!("joint {i}: ties body {} to itself", joint.body_a)));
            }
            if ![joint.anchor_a, joint.anchor_b].into_iter().all(is_place) {
                return Err(Error::input(format!("joint {i}: its anchors must be at most {MOST_LENGTH:e} m in size")));
            }
        }
        Ok(())
    }

    /// Number of dynamic bodies.
    pub fn dynamic_count(&self) -> usize {
        self.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic).count()
    }

    /// The first body whose pose or velocity is not finite: trouble in the numbers, as data.
    pub fn first_non_finite(&self) -> Option<usize> {
        self.bodies.iter().position(|b| !b.is_finite())
    }

    /// Sum of the kinetic energies of the dynamic bodies (J), in f64.
    pub fn kinetic_energy(&self) -> f64 {
        self.bodies.iter().map(Body::kinetic_energy).sum()
    }

    /// Sum of the potential energies of the dynamic bodies (J), zero at the origin, in f64.
    pub fn potential_energy(&self) -> f64 {
        let dynamic = self.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic);
        dynamic.map(|b| -f64::from(b.mass.mass) * self.gravity.as_dvec3().dot(b.center_of_mass().as_dvec3())).sum()
    }

    /// Linear momentum of the dynamic bodies (kg m/s), in f64.
    pub fn linear_momentum(&self) -> glam::DVec3 {
        let dynamic = self.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic);
        dynamic.map(|b| f64::from(b.mass.mass) * b.linear_velocity.as_dvec3()).sum()
    }

    /// Angular momentum of the dynamic bodies about the origin (kg m²/s), in f64.
    pub fn angular_momentum(&self) -> glam::DVec3 {
        let dynamic = self.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic);
        dynamic.map(Body::angular_momentum).sum()
    }
}
