//! One rigid body: pose, velocity, mass, colliders, material.

use glam::{DVec3, Quat, Vec3};

use super::groups::Groups;
use super::limits::{MOST_SPEED, check_place, check_rotation, is_within};
use super::mass::MassProperties;
use super::shape::{Shape, pose};
use crate::error::{Result, ensure};

/// How a body moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, schemars::JsonSchema), serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum BodyKind {
    /// Never moves.
    Fixed,
    /// Moves with the velocity that the caller gives it; contacts do not change the velocity.
    Kinematic,
    /// Moves by forces and impulses.
    Dynamic,
}

/// Friction and restitution of a surface.
///
/// Two materials combine: friction by the geometric mean, sqrt(a b); restitution by the larger.
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

/// A shape at a place on a body.
#[derive(Clone, Debug)]
pub struct Collider {
    /// The shape.
    pub shape: Shape,
    /// Position in the body's frame (m).
    pub position: Vec3,
    /// Rotation in the body's frame.
    pub rotation: Quat,
    /// Whether it is a sensor: it meets other colliders without touching them, and has no mass. See [`Body::sensor`].
    pub sensor: bool,
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
    /// How it moves.
    pub kind: BodyKind,
    /// Origin of the body's frame in the world (m).
    pub position: Vec3,
    /// Rotation of the body's frame.
    pub rotation: Quat,
    /// Velocity of the center of mass (m/s).
    pub linear_velocity: Vec3,
    /// Angular velocity in world axes (rad/s).
    pub angular_velocity: Vec3,
    /// Force through the center of mass, besides gravity, constant until changed (N).
    pub force: Vec3,
    /// Mass, center of mass and inertia; zero unless dynamic. A simulation raises moments of inertia that are less than a 32nd of the mass
    /// times the square of the lever of the shapes ([`MassProperties::MOST_LEVERAGE`]).
    pub mass: MassProperties,
    /// Surface.
    pub material: Material,
    /// Which bodies it meets.
    pub groups: Groups,
    /// Shapes on the body; several make a compound.
    pub colliders: Vec<Collider>,
    density: f32,
}

impl Body {
    /// A body of this kind, without shapes.
    pub(crate) fn new(kind: BodyKind) -> Self {
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
            groups: Groups::ALL,
            colliders: Vec::new(),
            density: 1000.0,
        }
    }

    /// A body that never moves.
    pub fn fixed() -> Self {
        Self::new(BodyKind::Fixed)
    }

    /// A body that moves with the velocity that the caller gives it.
    pub fn kinematic() -> Self {
        Self::new(BodyKind::Kinematic)
    }

    /// A body that moves by forces and impulses; its density is 1000 kg/m³ unless set.
    pub fn dynamic() -> Self {
        Self::new(BodyKind::Dynamic)
    }

    /// Adds a shape at the body's origin.
    pub fn shape(self, shape: Shape) -> Self {
        self.shape_at(shape, Vec3::ZERO, Quat::IDENTITY)
    }

    /// Adds a shape at a place in the body's frame.
    pub fn shape_at(mut self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.colliders.push(Collider { shape, position, rotation, sensor: false });
        self.update_mass();
        self
    }

    /// Adds a sensor at the body's origin: a shape without mass that bodies pass through, and that tells which colliders overlap it
    /// ([`Event::Entered`](crate::Event::Entered), [`Event::Left`](crate::Event::Left)).
    ///
    /// A sensor sees colliders of other bodies which the [`groups`](Body::groups) of its body meet, but no sensors. One of the two bodies has
    /// to be dynamic or kinematic: a fixed sensor does not see the ground, and one on a body that moves does. Bodies that a joint keeps from
    /// colliding do not see each other. A sensor wakes nobody, and sees bodies that sleep. Meshes and height fields have no inside: they
    /// overlap what meets their surfaces.
    ///
    /// ```
    /// use drystone::{Body, Event, Reference, Shape, Simulation, SolverConfig, World};
    ///
    /// let mut world = World::new();
    /// let gate = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 0.1, 1.0)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 1.0, 0.0));
    /// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
    /// let mut told = Vec::new();
    /// for _ in 0..60 {
    ///     simulation.step(1.0 / 60.0)?;
    ///     told.extend_from_slice(simulation.events());
    /// }
    /// let [Event::Entered { sensor, visitor }, Event::Left { .. }] = told[..] else { panic!("{told:?}") };
    /// assert_eq!((sensor.body, visitor.body), (gate, ball));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn sensor(self, shape: Shape) -> Self {
        self.sensor_at(shape, Vec3::ZERO, Quat::IDENTITY)
    }

    /// Adds a sensor at a place in the body's frame.
    pub fn sensor_at(mut self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.colliders.push(Collider { shape, position, rotation, sensor: true });
        self
    }

    /// Its shapes that are no sensors.
    pub(crate) fn solids(&self) -> impl Iterator<Item = &Collider> + Clone {
        self.colliders.iter().filter(|c| !c.sensor)
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

    /// Mass, center and inertia as given, instead of those of the shapes.
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

    /// Velocity of the center of mass (m/s) and angular velocity (rad/s).
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

    /// Which bodies it meets.
    pub fn groups(mut self, groups: Groups) -> Self {
        self.groups = groups;
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
        let solids = self.solids().filter(|c| c.shape.has_volume()).map(|c| {
            let own = c.shape.0.mass_properties(1.0);
            own.transform_by(&pose(c.position, c.rotation))
        });
        self.mass = MassProperties::of_solids(&solids.collect::<Vec<_>>(), self.density);
    }

    /// Whether it is kinematic and moves.
    pub fn is_driven(&self) -> bool {
        self.kind == BodyKind::Kinematic && (self.linear_velocity != Vec3::ZERO || self.angular_velocity != Vec3::ZERO)
    }

    /// Radius around its origin that holds its shapes that are no sensors (m); 0 without.
    pub(crate) fn reach(&self) -> f32 {
        self.solids().map(|c| c.position.length() + c.shape.bounding_radius()).fold(0.0, f32::max)
    }

    /// Half of the smallest side of the thinnest of its shapes that are no sensors (m); infinite without.
    pub fn smallest_half_extent(&self) -> f32 {
        self.solids().map(|c| c.shape.smallest_half_extent()).fold(f32::INFINITY, f32::min)
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

    /// Refuses a body that cannot be simulated.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_motion()?;
        self.check_shapes()?;
        self.check_surface()
    }

    fn check_motion(&self) -> Result<()> {
        check_place("position", self.position)?;
        check_rotation("rotation", self.rotation)?;
        for (name, v) in [("linear", self.linear_velocity), ("angular", self.angular_velocity)] {
            let message = || format!("{name} velocity = {v}: must be at most {MOST_SPEED:e} in size");
            ensure(is_within(v, MOST_SPEED), message)?;
        }
        ensure(self.force.is_finite(), || format!("force = {}: must be finite", self.force))
    }

    fn check_shapes(&self) -> Result<()> {
        let check = |c: &Collider| {
            c.shape.check()?;
            check_place("position", c.position)?;
            check_rotation("rotation", c.rotation)?;
            let fits = (self.kind != BodyKind::Kinematic && !c.sensor) || !c.shape.is_half_space();
            ensure(fits, || "half-spaces are for fixed bodies, and no sensors".into())?;
            let fits = self.kind != BodyKind::Dynamic || c.sensor || c.shape.has_volume();
            ensure(fits, || "half-spaces, meshes and height fields have no mass: not for dynamic bodies".into())
        };
        let mut shapes = self.colliders.iter().enumerate();
        shapes.try_for_each(|(k, c)| check(c).map_err(|e| e.within(format_args!("shapes[{k}]"))))
    }

    /// Refuses a mass or a material that cannot be simulated.
    pub(super) fn check_surface(&self) -> Result<()> {
        let Material { friction, restitution } = self.material;
        let is_friction = friction >= 0.0 && friction.is_finite();
        ensure(is_friction, || format!("friction = {friction}: must be 0 or more"))?;
        ensure((0.0..=1.0).contains(&restitution), || format!("restitution = {restitution}: must be 0 to 1"))?;
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
