//! One rigid body: pose, velocity, mass, colliders, material.

use std::ops::RangeInclusive;

use glam::{DVec3, Mat3, Quat, Vec3};
use parry3d::mass_properties::MassProperties as ParryMass;

use super::shape::{Shape, pose};
use super::{MOST_LENGTH, MOST_SPEED, is_place};
use crate::error::{Error, Result};

/// Who decides how a body moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, schemars::JsonSchema), serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum BodyKind {
    /// Never moves.
    Fixed,
    /// Moves with the velocity it is given; contacts do not change it.
    Kinematic,
    /// Moves by forces and impulses.
    Dynamic,
}

/// What a surface does to whatever touches it.
///
/// Two materials combine by one rule each: friction by the geometric mean, sqrt(a b); restitution by the larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Coulomb coefficient mu, 0 or more.
    pub friction: f32,
    /// Ratio of separation to approach velocity, 0 to 1.
    pub restitution: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self { friction: 0.5, restitution: 0.0 }
    }
}

impl Material {
    /// The material of a contact between `self` and `other`.
    pub fn combine(self, other: Self) -> Self {
        Self { friction: (self.friction * other.friction).sqrt(), restitution: self.restitution.max(other.restitution) }
    }
}

/// Whether a quaternion is near unit length.
fn is_rotation(q: Quat) -> bool {
    (q.length() - 1.0).abs() <= 1e-3
}

/// A shape at a place on a body.
#[derive(Clone, Debug)]
pub struct Collider {
    /// The shape.
    pub shape: Shape,
    /// Position in the body's frame (m).
    pub position: Vec3,
    /// Rotation in the body's frame.
    pub rotation: Quat,
}

/// Mass, centre of mass and inertia of a body, in its own frame. All zero for a body that cannot be pushed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass (kg).
    pub mass: f32,
    /// Centre of mass in the body's frame (m).
    pub center: Vec3,
    /// Moments of inertia about the principal axes (kg m²).
    pub principal_inertia: Vec3,
    /// Rotation from the principal axes to the body's frame.
    pub principal_frame: Quat,
}

impl MassProperties {
    /// Infinite mass: nothing moves it.
    pub const IMMOVABLE: Self =
        Self { mass: 0.0, center: Vec3::ZERO, principal_inertia: Vec3::ZERO, principal_frame: Quat::IDENTITY };

    /// Masses that can be simulated (kg): squares of impulses and of inverse masses stay numbers in single precision.
    pub const MASSES: RangeInclusive<f32> = 1e-15..=1e15;
    /// Moments of inertia that can be simulated (kg m²).
    pub const MOMENTS: RangeInclusive<f32> = 1e-30..=1e30;
    /// Largest ratio of two moments of a body; that of a rod is a sixth of the square of its length over its radius.
    pub const MOST_RATIO: f32 = 1e12;

    /// Refuses what a dynamic body cannot have.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_frame()?;
        let Self { mass, principal_inertia, .. } = *self;
        let moments = principal_inertia.to_array();
        if !(Self::MASSES.contains(&mass)
            && moments.iter().all(|i| Self::MOMENTS.contains(i))
            && principal_inertia.max_element() <= Self::MOST_RATIO * principal_inertia.min_element())
        {
            return Err(Error::input(format!(
                "mass = {mass:e} kg, inertia = {moments:?} kg m²: must be 1e-15 to 1e15 kg, 1e-30 to 1e30 kg m² and moments within \
                 1e12 of each other"
            )));
        }
        Ok(())
    }

    /// Refuses what no body can have: a center that is no place, a frame that is no rotation.
    fn check_frame(&self) -> Result<()> {
        let Self { center, principal_frame, .. } = *self;
        if is_place(center) && is_rotation(principal_frame) {
            return Ok(());
        }
        Err(Error::input(format!(
            "center of mass = {center}, principal frame = {principal_frame}: must be a place and a rotation"
        )))
    }

    /// Parry keeps inverses: taken at density 1 and scaled here, a box of 1 m³ weighs its density to the last bit.
    fn from_parry(m: &ParryMass, density: f32) -> Self {
        Self {
            mass: m.mass() * density,
            center: m.local_com,
            principal_inertia: m.principal_inertia() * density,
            principal_frame: m.principal_inertia_local_frame,
        }
    }

    /// Inverse inertia about the centre of mass in world axes, for a body with rotation `rotation` (1/(kg m²)).
    pub fn world_inverse_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia.map(|i| if i > 0.0 { 1.0 / i } else { 0.0 }))
    }

    /// Inertia about the centre of mass in world axes (kg m²).
    pub fn world_inertia(&self, rotation: Quat) -> Mat3 {
        self.world_tensor(rotation, self.principal_inertia)
    }

    fn world_tensor(&self, rotation: Quat, principal: Vec3) -> Mat3 {
        // Turning an isotropic tensor only adds rounding.
        if principal.x == principal.y && principal.y == principal.z {
            return Mat3::from_diagonal(principal);
        }
        let axes = Mat3::from_quat(rotation * self.principal_frame);
        axes * Mat3::from_diagonal(principal) * axes.transpose()
    }

    /// Whether the moments differ, so that a free rotation changes its axis (gyroscopic term).
    pub fn is_anisotropic(&self) -> bool {
        let i = self.principal_inertia;
        i.max_element() - i.min_element() > 1e-6 * i.max_element()
    }
}

/// A rigid body. Build one with [`Body::fixed`], [`Body::kinematic`] or [`Body::dynamic`] and the methods that follow.
///
/// ```
/// use drystone::{Body, Shape};
/// let brick = Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.25)).density(2000.0).position(0.0, 1.0, 0.0);
/// assert_eq!(brick.mass.mass, 500.0);
/// ```
#[derive(Clone, Debug)]
pub struct Body {
    /// Name for people; empty if none was given.
    pub name: String,
    /// Who decides how it moves.
    pub kind: BodyKind,
    /// Origin of the body's frame in the world (m).
    pub position: Vec3,
    /// Rotation of the body's frame.
    pub rotation: Quat,
    /// Velocity of the centre of mass (m/s).
    pub linear_velocity: Vec3,
    /// Angular velocity in world axes (rad/s).
    pub angular_velocity: Vec3,
    /// Force through the centre of mass, besides gravity, constant until changed (N).
    pub force: Vec3,
    /// Mass, centre of mass and inertia; zero unless dynamic.
    pub mass: MassProperties,
    /// Surface.
    pub material: Material,
    /// Shapes on the body; several make a compound.
    pub colliders: Vec<Collider>,
    density: f32,
}

impl Body {
    fn new(kind: BodyKind) -> Self {
        Self {
            name: String::new(),
            kind,
            position: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            linear_velocity: Vec3::ZERO,
            angular_velocity: Vec3::ZERO,
            force: Vec3::ZERO,
            mass: MassProperties::IMMOVABLE,
            material: Material::default(),
            colliders: Vec::new(),
            density: 1000.0,
        }
    }

    /// A body that never moves.
    pub fn fixed() -> Self {
        Self::new(BodyKind::Fixed)
    }

    /// A body that moves with the velocity it is given.
    pub fn kinematic() -> Self {
        Self::new(BodyKind::Kinematic)
    }

    /// A body that moves by forces and impulses; density 1000 kg/m³ until told otherwise.
    pub fn dynamic() -> Self {
        Self::new(BodyKind::Dynamic)
    }

    /// Adds a shape at the body's origin.
    pub fn shape(self, shape: Shape) -> Self {
        self.shape_at(shape, Vec3::ZERO, Quat::IDENTITY)
    }

    /// Adds a shape at a place in the body's frame.
    pub fn shape_at(mut self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.colliders.push(Collider { shape, position, rotation });
        self.update_mass();
        self
    }

    /// Mass from density (kg/m³).
    pub fn density(mut self, density: f32) -> Self {
        self.density = density;
        self.update_mass();
        self
    }

    /// Total mass (kg); inertia of the shapes, scaled to it.
    pub fn total_mass(mut self, mass: f32) -> Self {
        self.density = 1.0;
        self.update_mass();
        let density = mass / self.mass.mass;
        self.density(density)
    }

    /// Mass, centre and inertia as given, whatever the shapes say.
    pub fn mass_properties(mut self, mass: MassProperties) -> Self {
        self.mass = mass;
        self
    }

    /// Origin of the body's frame (m).
    pub fn position(mut self, x: f32, y: f32, z: f32) -> Self {
        self.position = Vec3::new(x, y, z);
        self
    }

    /// Rotation of the body's frame.
    pub fn rotation(mut self, rotation: Quat) -> Self {
        self.rotation = rotation;
        self
    }

    /// Velocity of the centre of mass (m/s) and angular velocity (rad/s).
    pub fn velocity(mut self, linear: Vec3, angular: Vec3) -> Self {
        self.linear_velocity = linear;
        self.angular_velocity = angular;
        self
    }

    /// Coulomb coefficient.
    pub fn friction(mut self, friction: f32) -> Self {
        self.material.friction = friction;
        self
    }

    /// Ratio of separation to approach velocity.
    pub fn restitution(mut self, restitution: f32) -> Self {
        self.material.restitution = restitution;
        self
    }

    /// Name for people.
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    fn update_mass(&mut self) {
        if self.kind != BodyKind::Dynamic {
            return;
        }
        let parts = self.colliders.iter().filter(|c| c.shape.has_volume()).map(|c| {
            let own = c.shape.0.mass_properties(1.0);
            own.transform_by(&pose(c.position, c.rotation))
        });
        self.mass = MassProperties::from_parry(&parts.sum(), self.density);
    }

    /// Centre of mass in the world (m).
    pub fn center_of_mass(&self) -> Vec3 {
        self.position + self.rotation * self.mass.center
    }

    /// Velocity of the material point at world position `p` (m/s).
    pub fn velocity_at(&self, p: Vec3) -> Vec3 {
        self.linear_velocity + self.angular_velocity.cross(p - self.center_of_mass())
    }

    /// Gives a kinematic body the velocity that takes it to a pose within `dt` seconds.
    pub fn move_to(&mut self, position: Vec3, rotation: Quat, dt: f32) {
        let center = position + rotation * self.mass.center;
        self.linear_velocity = (center - self.center_of_mass()) / dt;
        let turn = rotation * self.rotation.inverse();
        // The shorter way round.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        self.angular_velocity = turn.normalize().to_scaled_axis() / dt;
    }

    /// Kinetic energy (J), in f64; zero for a body without mass.
    pub fn kinetic_energy(&self) -> f64 {
        let v = self.linear_velocity.as_dvec3();
        let w = self.principal_spin();
        let i = self.mass.principal_inertia.as_dvec3();
        0.5 * (f64::from(self.mass.mass) * v.length_squared() + (i * w * w).element_sum())
    }

    /// Angular momentum about the world's origin (kg m²/s), in f64.
    pub fn angular_momentum(&self) -> DVec3 {
        let orbital = self.center_of_mass().as_dvec3().cross(self.linear_velocity.as_dvec3());
        let axes = (self.rotation * self.mass.principal_frame).as_dquat();
        f64::from(self.mass.mass) * orbital + axes * (self.mass.principal_inertia.as_dvec3() * self.principal_spin())
    }

    /// Angular velocity along the principal axes.
    fn principal_spin(&self) -> DVec3 {
        (self.rotation * self.mass.principal_frame).as_dquat().inverse() * self.angular_velocity.as_dvec3()
    }

    /// Refuses what no step can be made of.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_motion()?;
        self.check_shapes()?;
        self.check_surface()
    }

    fn check_motion(&self) -> Result<()> {
        let refuse = |what: String| Err(Error::input(what));
        if !is_place(self.position) {
            return refuse(format!("position = {}: must be at most {MOST_LENGTH:e} m in size", self.position));
        }
        if !is_rotation(self.rotation) {
            return refuse(format!("rotation = {}: must have unit length", self.rotation));
        }
        for (name, v) in [("linear", self.linear_velocity), ("angular", self.angular_velocity)] {
            if !v.abs().cmple(Vec3::splat(MOST_SPEED)).all() {
                return refuse(format!("{name} velocity = {v}: must be at most {MOST_SPEED:e} in size"));
            }
        }
        if !self.force.is_finite() {
            return refuse(format!("force = {}: must be finite", self.force));
        }
        Ok(())
    }

    fn check_shapes(&self) -> Result<()> {
        for (k, Collider { shape, position, rotation }) in self.colliders.iter().enumerate() {
            let refuse = |what: String| Err(Error::input(format!("shapes[{k}]: {what}")));
            shape.check().map_err(|e| e.within(format_args!("shapes[{k}]")))?;
            if !is_place(*position) {
                return refuse(format!("position = {position}: must be at most {MOST_LENGTH:e} m in size"));
            }
            if !is_rotation(*rotation) {
                return refuse(format!("rotation = {rotation}: must have unit length"));
            }
            if self.kind == BodyKind::Kinematic && shape.is_half_space() {
                return refuse("half-spaces are for fixed bodies".into());
            }
            if self.kind == BodyKind::Dynamic && !shape.has_volume() {
                return refuse("half-spaces, meshes and height fields have no mass: not for dynamic bodies".into());
            }
        }
        Ok(())
    }

    /// Refuses a mass or a material that no step can be made of.
    pub(super) fn check_surface(&self) -> Result<()> {
        let refuse = |what: String| Err(Error::input(what));
        let Material { friction, restitution } = self.material;
        if !(friction >= 0.0 && friction.is_finite()) {
            return refuse(format!("friction = {friction}: must be 0 or more"));
        }
        if !(0.0..=1.0).contains(&restitution) {
            return refuse(format!("restitution = {restitution}: must be 0 to 1"));
        }
        if self.kind == BodyKind::Dynamic { self.mass.check() } else { self.mass.check_frame() }
    }

    /// Whether pose and velocity are finite.
    pub fn is_finite(&self) -> bool {
        self.position.is_finite()
            && self.rotation.is_finite()
            && self.linear_velocity.is_finite()
            && self.angular_velocity.is_finite()
    }
}
