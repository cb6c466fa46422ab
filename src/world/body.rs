//! One rigid body: pose, velocity, mass, colliders, material.

use glam::{DVec3, IVec3, Mat3, Quat, Vec3};

use super::groups::Groups;
use super::limits::{MAX_DAMPING, MAX_GRAVITY, MAX_SPEED, check_place, check_rotation, is_within};
use super::mass::MassProperties;
use super::shape::Shape;
use super::voxels::Voxels;
use crate::error::{Result, ensure, input};
use crate::math::rotation;
use crate::saved::{Archive, Saved};

/// How a body moves.
///
/// ```
/// use drystone::{Body, BodyKind};
///
/// let mut gate = Body::kinematic();
/// assert_eq!(gate.kind, BodyKind::Kinematic);
/// gate.kind = BodyKind::Fixed;
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize), serde(rename_all = "lowercase"))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum BodyKind {
    /// Never moves.
    Fixed,
    /// Moves with the velocity that the caller gives it; contacts do not change the velocity.
    Kinematic,
    /// Moves by forces and impulses.
    Dynamic,
}

crate::saved::kinds!(BodyKind { Fixed, Kinematic, Dynamic });

/// How a contact combines a coefficient of its two materials. If both materials have a rule, the later one in this list
/// counts.
///
/// ```
/// use drystone::{CombineRule, Material};
///
/// let of = |friction, friction_rule| Material { friction, friction_rule, ..Material::default() };
/// let (ice, wood) = (of(0.1, Some(CombineRule::Minimum)), of(0.4, Some(CombineRule::Average)));
/// assert_eq!((ice.combine(wood).friction, wood.combine(of(0.8, None)).friction), (0.1, 0.6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum CombineRule {
    /// (a + b)/2.
    Average,
    /// sqrt(a b).
    GeometricMean,
    /// The smaller value.
    Minimum,
    /// a b.
    Multiply,
    /// The larger value.
    Maximum,
}

crate::saved::kinds!(CombineRule { Average, GeometricMean, Minimum, Multiply, Maximum });

impl CombineRule {
    fn of(self, a: f32, b: f32) -> f32 {
        match self {
            Self::Average => 0.5 * (a + b),
            Self::GeometricMean => (a * b).sqrt(),
            Self::Minimum => a.min(b),
            Self::Multiply => a * b,
            Self::Maximum => a.max(b),
        }
    }
}

/// Friction and restitution of a surface, of a body or of one of its shapes ([`Collider::material`]).
///
/// ```
/// use drystone::Material;
///
/// let of = |friction, restitution| Material { friction, restitution, ..Material::default() };
/// let (ice, rubber) = (of(0.01, 0.0), of(1.0, 0.8));
/// assert_eq!(ice.combine(rubber), of(0.1, 0.8));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Coulomb coefficient mu, 0 or more.
    pub friction: f32,
    /// Ratio of separation to approach velocity, 0 to 1.
    pub restitution: f32,
    /// How contacts combine friction: by the geometric mean if neither material has a rule. `None` by default.
    pub friction_rule: Option<CombineRule>,
    /// How contacts combine restitution: by the larger value if neither material has a rule. `None` by default.
    pub restitution_rule: Option<CombineRule>,
    /// Lever of rolling friction (m), 0 or more: a contact with the normal force N resists rolling by a torque of up to
    /// N times the lever. A ball of radius r that rolls on a level floor slows down by 5/7 g times the lever over r.
    /// The larger value of two materials counts. 0 by default.
    pub rolling_friction: f32,
    /// Lever of spinning friction (m), 0 or more: the same for spin about the normal of the contact.
    pub spinning_friction: f32,
    /// Velocity of the surface relative to the body, as of a belt, in the axes of the body (m/s). Friction takes along
    /// bodies that touch the surface; the body itself does not move by it. Zero by default. Only the components along
    /// the surface act.
    pub surface_velocity: Vec3,
}

crate::saved::fields!(Material {
    friction,
    restitution,
    friction_rule,
    restitution_rule,
    rolling_friction,
    spinning_friction,
    surface_velocity,
});

impl Default for Material {
    fn default() -> Self {
        Self {
            friction: 0.5,
            restitution: 0.0,
            friction_rule: None,
            restitution_rule: None,
            rolling_friction: 0.0,
            spinning_friction: 0.0,
            surface_velocity: Vec3::ZERO,
        }
    }
}

impl Material {
    /// Refuses a coefficient that is out of range.
    pub(crate) fn check(&self) -> Result<()> {
        let Self { friction, restitution, .. } = *self;
        let is_friction = friction >= 0.0 && friction.is_finite();
        ensure(is_friction, || format!("friction = {friction}: must be 0 or more"))?;
        ensure((0.0..=1.0).contains(&restitution), || format!("restitution = {restitution}: must be 0 to 1"))?;
        for (name, lever) in
            [("rolling_friction", self.rolling_friction), ("spinning_friction", self.spinning_friction)]
        {
            ensure(lever >= 0.0 && lever.is_finite(), || format!("{name} = {lever} m: must be 0 or more"))?;
        }
        ensure(is_within(self.surface_velocity, MAX_SPEED), || {
            format!("surface_velocity = {} m/s: must be at most {MAX_SPEED:e}", self.surface_velocity)
        })
    }

    /// Whether the surface resists rolling or spinning.
    pub(crate) fn rolls(&self) -> bool {
        self.rolling_friction > 0.0 || self.spinning_friction > 0.0
    }

    /// Whether the surface moves by itself.
    pub(crate) fn is_driven(&self) -> bool {
        self.surface_velocity != Vec3::ZERO
    }

    /// The material of a contact between `self` and `other`. It has no rules, and no surface velocity: that depends on
    /// the rotations of the bodies.
    pub fn combine(self, other: Self) -> Self {
        let friction = self.friction_rule.max(other.friction_rule).unwrap_or(CombineRule::GeometricMean);
        let restitution = self.restitution_rule.max(other.restitution_rule).unwrap_or(CombineRule::Maximum);
        Self {
            friction: friction.of(self.friction, other.friction),
            restitution: restitution.of(self.restitution, other.restitution),
            rolling_friction: self.rolling_friction.max(other.rolling_friction),
            spinning_friction: self.spinning_friction.max(other.spinning_friction),
            ..Self::default()
        }
    }
}

/// A shape with a pose on a body.
///
/// ```
/// use drystone::{Body, Shape, glam::{Quat, Vec3}, world::Collider};
///
/// let hammer = Body::dynamic()
///     .shape_at(Shape::cuboid(0.1, 0.05, 0.05), Vec3::Y * 0.4, Quat::IDENTITY)
///     .shape(Shape::cylinder(0.4, 0.02));
/// let head: &Collider = &hammer.colliders[0];
/// assert!(!head.sensor);
/// let (low, high) = head.bounds(Vec3::X, Quat::IDENTITY);
/// assert!(low.distance(Vec3::new(0.9, 0.35, -0.05)) < 1e-6 && high.distance(Vec3::new(1.1, 0.45, 0.05)) < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct Collider {
    /// The shape.
    pub shape: Shape,
    /// Position in the body's frame (m).
    pub position: Vec3,
    /// Rotation in the body's frame.
    pub rotation: Quat,
    /// Whether the shape is a sensor. A sensor detects other colliders, pushes none of them, and has no mass. See
    /// [`Body::sensor`].
    pub sensor: bool,
    /// Friction and restitution of this shape, in place of those of the body; `None` by default. Contacts of the body
    /// end when it changes, as when a shape changes.
    pub material: Option<Material>,
}

crate::saved::fields!(Collider { shape, position, rotation, sensor, material });

impl Collider {
    /// A shape at the origin of a body, with the material of the body.
    ///
    /// ```
    /// use drystone::{Body, Material, Shape, glam::Vec3, world::Collider};
    ///
    /// // A sled whose runners slide well, and whose seat does not.
    /// let ice = Some(Material { friction: 0.05, ..Material::default() });
    /// let runner = |z: f32| {
    ///     let shape = Shape::cuboid(0.5, 0.02, 0.02);
    ///     Collider { position: Vec3::new(0.0, -0.1, z), material: ice, ..Collider::new(shape) }
    /// };
    /// let sled = Body::dynamic().shape(Shape::cuboid(0.4, 0.05, 0.2)).collider(runner(-0.2)).collider(runner(0.2));
    /// assert_eq!((sled.material.friction, sled.colliders[1].material), (0.5, ice));
    /// ```
    pub fn new(shape: Shape) -> Self {
        Self { shape, position: Vec3::ZERO, rotation: Quat::IDENTITY, sensor: false, material: None }
    }

    /// Refuses a shape, a pose or a material that no body can have.
    pub(crate) fn check(&self) -> Result<()> {
        self.material.as_ref().map_or(Ok(()), Material::check)?;
        self.shape.check()?;
        check_place("position", self.position)?;
        check_rotation("rotation", self.rotation)
    }
}

/// A rigid body. Build one with [`Body::fixed`], [`Body::kinematic`] or [`Body::dynamic`] and the builder methods
/// below.
///
/// ```
/// use drystone::{Body, Shape};
/// let brick = Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.25)).density(2000.0).position(0.0, 1.0, 0.0);
/// assert_eq!(brick.mass.mass, 500.0);
/// ```
///
/// ```
/// use drystone::{Body, BodyKind, Groups, Shape, glam::{Quat, Vec3}};
///
/// let mut ball = Body::dynamic()
///     .named("ball")
///     .shape(Shape::ball(0.5))
///     .total_mass(2.0)
///     .friction(0.3)
///     .restitution(0.5)
///     .gravity_scale(0.5)
///     .groups(Groups { membership: 0b1, filter: !0 })
///     .rotation(Quat::from_rotation_y(0.3))
///     .velocity(Vec3::X * 3.0, Vec3::Z);
/// assert_eq!(ball.center_of_mass(), ball.position);
/// assert_eq!(ball.velocity_at(Vec3::Y), Vec3::X * 2.0);
/// assert_eq!(ball.smallest_half_extent(), 0.5);
/// // 2 kg at 3 m/s, and 0.2 kg m² at 1 rad/s.
/// assert!((ball.kinetic_energy() - 9.1).abs() < 1e-5 && (ball.angular_momentum().z - 0.2).abs() < 1e-6);
/// assert!(ball.is_finite() && !ball.is_driven());
/// ball.apply_force_at(Vec3::X, Vec3::Y);
/// ball.apply_torque(Vec3::Z * 4.0);
/// assert_eq!((ball.whole_force(), ball.whole_torque()), (Vec3::X, Vec3::Z * 3.0));
/// ball.apply_angular_impulse(Vec3::Z * -0.2);
/// assert!(ball.angular_velocity.length() < 1e-5);
///
/// // A kinematic body moves as the caller sets it, and a sensor next to it detects other bodies.
/// let mut lift = Body::kinematic().shape(Shape::cuboid(1.0, 0.1, 1.0));
/// lift = lift.sensor_at(Shape::cuboid(1.0, 0.5, 1.0), Vec3::Y * 0.6, Quat::IDENTITY);
/// lift.move_to(Vec3::Y * 0.5, Quat::IDENTITY, 0.25);
/// assert_eq!((lift.linear_velocity, lift.kind), (Vec3::Y * 2.0, BodyKind::Kinematic));
/// assert!(lift.is_driven());
/// ```
#[derive(Debug)]
pub struct Body {
    /// Name for messages and reports; empty by default.
    pub name: String,
    /// How the body moves.
    pub kind: BodyKind,
    /// Origin of the body's frame in the world (m).
    pub position: Vec3,
    /// Rotation of the body's frame.
    pub rotation: Quat,
    /// Velocity of the center of mass (m/s).
    pub linear_velocity: Vec3,
    /// Angular velocity in world axes (rad/s).
    pub angular_velocity: Vec3,
    /// Force through the center of mass, in addition to gravity (N). It acts until it is changed.
    pub force: Vec3,
    /// Torque in world axes (N m). It acts until it is changed.
    pub torque: Vec3,
    /// Scales the gravity of the world for this body: 1 by default, 0 floats, -1 rises as fast as other bodies fall.
    /// Only dynamic bodies feel gravity.
    pub gravity_scale: f32,
    /// Rate at which the linear velocity decays (1/s), 0 or more. Without forces the velocity is v exp(-d t) after the
    /// time t, for any number of substeps, and a falling body reaches the speed g/d. Only for dynamic bodies; 0 by
    /// default.
    pub linear_damping: f32,
    /// Rate at which the angular velocity decays (1/s), 0 or more, likewise.
    pub angular_damping: f32,
    /// The world axes x, y, z about which the body does not rotate. The next step removes any angular velocity about
    /// them. About the other axes the body rotates as on bearings, by its inertia about those axes, and without
    /// gyroscopic torque. Only for dynamic bodies; no axis is locked by default.
    pub locked_rotations: [bool; 3],
    /// The world axes x, y, z along which the center of mass does not move. The next step removes any velocity along
    /// them. Forces along them do nothing, and contacts bear on the body along them as on a fixed one. A joint takes
    /// some steps to bear what is heavier than the body. Only for dynamic bodies; no axis is locked by default.
    pub locked_translations: [bool; 3],
    /// Largest speed of the center of mass (m/s), 0 or more; infinite by default. Each step begins and ends with at most
    /// this speed. Only for dynamic bodies.
    pub max_linear_speed: f32,
    /// Largest angular speed (rad/s), 0 or more, likewise.
    pub max_angular_speed: f32,
    /// Whether the body may fall asleep; true by default. A body that may not sleep keeps all bodies awake that touch
    /// it or are joined to it. Only for dynamic bodies.
    pub can_sleep: bool,
    /// Mass, center of mass and inertia; zero unless the body is dynamic. A later change of [`Self::colliders`] or
    /// [`Self::kind`] does not change them: call [`Self::update_mass`]. A simulation raises a moment of inertia that is
    /// less than 1/32 of the mass times the squared lever of the shapes ([`MassProperties::MAX_LEVERAGE`]).
    pub mass: MassProperties,
    /// Friction and restitution of the shapes that have no own [`Collider::material`].
    pub material: Material,
    /// Which bodies this body collides with.
    pub groups: Groups,
    /// Whether the body is a bullet: see [`Body::swept`](Body::swept()).
    pub swept: bool,
    /// Shapes on the body; several make a compound. The mass does not follow a change of them: call
    /// [`Self::update_mass`].
    pub colliders: Vec<Collider>,
    weight: Weight,
    /// Mass added to the mass of the shapes.
    additional: MassProperties,
    /// Force and torque for the next step only.
    pub(super) applied_force: Vec3,
    pub(super) applied_torque: Vec3,
}

crate::saved::cloned!(Body {
    name,
    kind,
    position,
    rotation,
    linear_velocity,
    angular_velocity,
    force,
    torque,
    gravity_scale,
    linear_damping,
    angular_damping,
    locked_rotations,
    locked_translations,
    max_linear_speed,
    max_angular_speed,
    can_sleep,
    mass,
    material,
    groups,
    swept,
    colliders,
    weight,
    additional,
    applied_force,
    applied_torque,
});

/// The properties of a body for which the rows of its contacts were written, in addition to its shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface {
    pub mass: MassProperties,
    pub locked_rotations: [bool; 3],
    pub locked_translations: [bool; 3],
    pub material: Material,
}

crate::saved::fields!(Surface { mass, locked_rotations, locked_translations, material });

/// Where the mass of a body comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Weight {
    /// From the shapes, at this density (kg/m³).
    Density(f32),
    /// From the shapes, scaled to this total mass (kg).
    Total(f32),
    /// From the caller, for any shapes.
    Given,
}

/// A vector without its components along locked axes.
fn without([x, y, z]: [bool; 3], vector: Vec3) -> Vec3 {
    Vec3::select(glam::BVec3::new(x, y, z), Vec3::ZERO, vector)
}

impl Saved for Weight {
    fn blank() -> Self {
        Self::Given
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let (mut kind, mut number) = match *self {
            Self::Density(density) => (0_u8, density),
            Self::Total(mass) => (1, mass),
            Self::Given => (2, 0.0),
        };
        kind.walk(archive)?;
        number.walk(archive)?;
        *self = match kind {
            0 => Self::Density(number),
            1 => Self::Total(number),
            2 => Self::Given,
            other => return Err(input!("the mass of a body of kind {other}")),
        };
        Ok(())
    }
}

impl Saved for Body {
    fn blank() -> Self {
        Self::new(BodyKind::Fixed)
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        archive.repeated(|archive| self.walk_rest(archive))?;
        self.position.walk(archive)?;
        self.rotation.walk(archive)?;
        self.linear_velocity.walk(archive)?;
        self.angular_velocity.walk(archive)
    }
}

impl Body {
    /// Writes or reads every field except pose and velocity. Most bodies share these values.
    pub(super) fn walk_rest<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        crate::saved::walk!(self, archive, {
            name, kind, force, torque, applied_force, applied_torque, gravity_scale, linear_damping, angular_damping,
            locked_rotations, locked_translations, max_linear_speed, max_angular_speed, can_sleep, mass, material,
            groups, swept, colliders, weight, additional
        } scratch { position, rotation, linear_velocity, angular_velocity })
    }

    /// A body of this kind, without shapes.
    ///
    /// ```
    /// use drystone::{Body, BodyKind, Shape};
    ///
    /// let body = Body::new(BodyKind::Dynamic).shape(Shape::ball(0.5));
    /// assert_eq!(body.kind, Body::dynamic().kind);
    /// ```
    pub fn new(kind: BodyKind) -> Self {
        Self {
            name: String::new(),
            kind,
            position: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            linear_velocity: Vec3::ZERO,
            angular_velocity: Vec3::ZERO,
            force: Vec3::ZERO,
            torque: Vec3::ZERO,
            gravity_scale: 1.0,
            linear_damping: 0.0,
            angular_damping: 0.0,
            locked_rotations: [false; 3],
            locked_translations: [false; 3],
            max_linear_speed: f32::INFINITY,
            max_angular_speed: f32::INFINITY,
            can_sleep: true,
            mass: MassProperties::IMMOVABLE,
            material: Material::default(),
            groups: Groups::ALL,
            swept: false,
            colliders: Vec::new(),
            weight: Weight::Density(1000.0),
            additional: MassProperties::IMMOVABLE,
            applied_force: Vec3::ZERO,
            applied_torque: Vec3::ZERO,
        }
    }

    /// A body that never moves.
    pub fn fixed() -> Self {
        Self::new(BodyKind::Fixed)
    }

    /// A body that moves with the velocity that the caller sets.
    pub fn kinematic() -> Self {
        Self::new(BodyKind::Kinematic)
    }

    /// A body that moves by forces and impulses. Its density is 1000 kg/m³ by default.
    pub fn dynamic() -> Self {
        Self::new(BodyKind::Dynamic)
    }

    /// Adds a shape at the body's origin, and its mass. The builder methods can be called in any order. Of
    /// [`Self::density`], [`Self::total_mass`] and [`Self::mass_properties`], the last call wins.
    ///
    /// ```
    /// use drystone::{Body, Shape};
    ///
    /// let ball = || Shape::ball(0.5);
    /// assert_eq!(Body::dynamic().total_mass(2.0).shape(ball()).mass, Body::dynamic().shape(ball()).total_mass(2.0).mass);
    /// ```
    pub fn shape(self, shape: Shape) -> Self {
        self.shape_at(shape, Vec3::ZERO, Quat::IDENTITY)
    }

    /// Adds a shape at a pose in the body's frame.
    pub fn shape_at(self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.collider(Collider { position, rotation, ..Collider::new(shape) })
    }

    /// Adds blocks in a grid as few boxes, for any body. The sides of a cell are `size` (m), and the cell with the numbers
    /// `c` begins at `c * size` in the body's frame. A cell that is named twice counts once. Fixed terrain of many blocks
    /// is cheaper as one mesh ([`Shape::voxels`]).
    ///
    /// ```
    /// use drystone::{Body, glam::{IVec3, Vec3}};
    ///
    /// // An L of five blocks of 10 cm, as two boxes of 5 kg in all.
    /// let cells = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 2, 0]].map(IVec3::from_array);
    /// let body = Body::dynamic().voxels(Vec3::splat(0.1), &cells)?;
    /// assert!(body.colliders.len() == 2 && (body.mass.mass - 5.0).abs() < 1e-5);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is no cell, or a side is not above 0 or out of range.
    pub fn voxels(mut self, size: Vec3, cells: &[IVec3]) -> Result<Self> {
        let boxes = Voxels::new(size, cells)?.boxes();
        let collider = |(half, position): (Vec3, Vec3)| Collider {
            position,
            ..Collider::new(Shape::cuboid(half.x, half.y, half.z))
        };
        self.colliders.extend(boxes.into_iter().map(collider));
        self.update_mass();
        Ok(self)
    }

    /// Adds a shape with its pose and material, and its mass unless it is a sensor.
    pub fn collider(mut self, collider: Collider) -> Self {
        let has_mass = !collider.sensor;
        self.colliders.push(collider);
        if has_mass {
            self.update_mass();
        }
        self
    }

    /// Adds a sensor at the body's origin. A sensor is a shape without mass, and bodies pass through it. It reports the
    /// colliders that overlap it ([`Event::Entered`](crate::Event::Entered), [`Event::Left`](crate::Event::Left)) and
    /// the colliders that flew through it within one step ([`Event::Passed`](crate::Event::Passed)).
    ///
    /// A sensor detects the colliders of other bodies if the [`groups`](Body::groups) of the two bodies match. It does
    /// not detect other sensors. At least one of the two bodies has to be dynamic or kinematic: a fixed sensor does not
    /// detect the ground, but a sensor on a moving body does. A sensor does not detect a body if a joint keeps the two
    /// bodies from colliding. A sensor wakes no body, and it detects sleeping bodies. Meshes and height fields have no
    /// inside: they overlap only shapes that cross their surface.
    ///
    /// ```
    /// use drystone::{Body, Event, Shape, Simulation, World};
    ///
    /// let mut world = World::new();
    /// let gate = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 0.1, 1.0)));
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 1.0, 0.0));
    /// let mut simulation = Simulation::new(world)?;
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

    /// Adds a sensor at a pose in the body's frame.
    pub fn sensor_at(self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.collider(Collider { position, rotation, sensor: true, ..Collider::new(shape) })
    }

    /// The colliders that are not sensors.
    pub(crate) fn solids(&self) -> impl Iterator<Item = &Collider> + Clone {
        self.colliders.iter().filter(|c| !c.sensor)
    }

    /// Sets the density (kg/m³), above 0. The mass follows from the shapes.
    pub fn density(self, density: f32) -> Self {
        self.weighing(Weight::Density(density))
    }

    /// Sets the total mass (kg), within [`MassProperties::MASSES`]. The inertia is that of the shapes, scaled to this
    /// mass.
    pub fn total_mass(self, mass: f32) -> Self {
        self.weighing(Weight::Total(mass))
    }

    /// Adds a mass to the mass of the shapes. Its center and inertia are in the body's frame; [`MassProperties::point`]
    /// is a point mass. A second call replaces the first. The call has no effect if [`Self::mass_properties`] sets the
    /// mass of the whole body.
    ///
    /// ```
    /// use drystone::{Body, MassProperties, Shape, glam::Vec3};
    ///
    /// // A cube of 6 kg and 1 kg m², with as much again 2 m above its center.
    /// let cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0);
    /// let tall = cube.additional_mass(MassProperties::point(6.0, Vec3::Y * 2.0)).mass;
    /// assert_eq!((tall.mass, tall.center), (12.0, Vec3::Y));
    /// assert!((tall.principal_inertia - Vec3::new(13.0, 1.0, 13.0)).length() < 1e-5);
    /// ```
    pub fn additional_mass(mut self, mass: MassProperties) -> Self {
        self.additional = mass;
        self.update_mass();
        self
    }

    fn weighing(mut self, weight: Weight) -> Self {
        self.weight = weight;
        self.update_mass();
        self
    }

    /// Sets mass, center of mass and inertia, in place of the values from the shapes.
    ///
    /// ```
    /// use drystone::{Body, MassProperties, Shape, glam::Vec3};
    ///
    /// let cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
    /// let low = MassProperties { center: Vec3::Y * -0.4, ..cube.mass };
    /// let tumbler = cube.mass_properties(low);
    /// assert_eq!(tumbler.center_of_mass(), Vec3::Y * -0.4);
    /// ```
    pub fn mass_properties(mut self, mass: MassProperties) -> Self {
        self.mass = mass;
        self.weighing(Weight::Given)
    }

    /// Sets the position of the body's origin (m).
    pub fn position(mut self, x: f32, y: f32, z: f32) -> Self {
        self.position = Vec3::new(x, y, z);
        self
    }

    /// Sets the rotation of the body's frame.
    pub fn rotation(mut self, rotation: Quat) -> Self {
        self.rotation = rotation;
        self
    }

    /// Sets the velocity of the center of mass (m/s) and the angular velocity (rad/s).
    pub fn velocity(mut self, linear: Vec3, angular: Vec3) -> Self {
        self.linear_velocity = linear;
        self.angular_velocity = angular;
        self
    }

    /// Sets the factor on the world's gravity for this body.
    pub fn gravity_scale(mut self, scale: f32) -> Self {
        self.gravity_scale = scale;
        self
    }

    /// Sets the rate at which the linear velocity decays (1/s), 0 or more: [the
    /// field](Body#structfield.linear_damping).
    ///
    /// ```
    /// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    /// let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    /// let ball = Body::dynamic().shape(Shape::ball(0.5)).velocity(Vec3::X, Vec3::Y).linear_damping(2.0).angular_damping(1.0);
    /// let ball = world.insert(ball);
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(0.5)?;
    /// let ball = simulation.world.body(ball).expect("still there");
    /// assert!((ball.linear_velocity.x - (-1.0_f32).exp()).abs() < 1e-6);
    /// assert!((ball.angular_velocity.y - (-0.5_f32).exp()).abs() < 1e-6);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn linear_damping(mut self, rate: f32) -> Self {
        self.linear_damping = rate;
        self
    }

    /// Sets the rate at which the angular velocity decays (1/s), 0 or more.
    pub fn angular_damping(mut self, rate: f32) -> Self {
        self.angular_damping = rate;
        self
    }

    /// Locks rotation about some world axes: x, y, z. See [the field](Body#structfield.locked_rotations).
    ///
    /// ```
    /// use drystone::{Body, Shape, glam::{Mat3, Vec3}};
    /// let walker = Body::dynamic().shape(Shape::capsule(0.5, 0.3)).locked_rotations([true; 3]).can_sleep(false);
    /// assert!(!walker.can_sleep);
    /// assert_eq!(walker.world_inverse_inertia(), Mat3::ZERO);
    /// // A body in the plane of x and y rotates about z.
    /// let mut flat = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0).locked_rotations([true, true, false]);
    /// flat.apply_angular_impulse(Vec3::ONE);
    /// assert_eq!(flat.angular_velocity, Vec3::Z);
    /// ```
    pub fn locked_rotations(mut self, axes: [bool; 3]) -> Self {
        self.locked_rotations = axes;
        self
    }

    /// Locks translation along some world axes: x, y, z. See [the field](Body#structfield.locked_translations).
    ///
    /// ```
    /// use drystone::{Body, Shape, Simulation, World};
    ///
    /// // A body of a plane world moves along x and y, and rotates about z.
    /// let flat = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
    /// let flat = flat.locked_translations([false, false, true]).locked_rotations([true, true, false]);
    /// let mut world = World::new();
    /// let flat = world.insert(flat.velocity([1.0, 2.0, 3.0].into(), [1.0, 1.0, 1.0].into()));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(1.0 / 60.0)?;
    /// let body = simulation.world.body(flat).expect("it is there");
    /// assert_eq!((body.position.z, body.linear_velocity.z, body.linear_velocity.x), (0.0, 0.0, 1.0));
    /// assert!(body.has_locked_axis());
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn locked_translations(mut self, axes: [bool; 3]) -> Self {
        self.locked_translations = axes;
        self
    }

    /// Sets the largest speed of the center of mass (m/s) and the largest angular speed (rad/s): see [the
    /// field](Body#structfield.max_linear_speed).
    ///
    /// ```
    /// use drystone::{Body, Shape, Simulation, World, glam::Vec3};
    ///
    /// let mut world = World::new();
    /// let fast = Body::dynamic().shape(Shape::ball(0.5)).velocity(Vec3::X * 100.0, Vec3::Y * 100.0);
    /// let fast = world.insert(fast.max_speeds(20.0, 5.0));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.step(1.0 / 60.0)?;
    /// let body = simulation.world.body(fast).expect("it is there");
    /// assert!(body.linear_velocity.length() <= 20.0 && body.angular_velocity == Vec3::Y * 5.0);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn max_speeds(mut self, linear: f32, angular: f32) -> Self {
        (self.max_linear_speed, self.max_angular_speed) = (linear, angular);
        self
    }

    /// Sets whether the body may fall asleep: [the field](Body#structfield.can_sleep).
    pub fn can_sleep(mut self, can: bool) -> Self {
        self.can_sleep = can;
        self
    }

    /// Sets the [`Material`] of the shapes without their own.
    pub fn material(mut self, material: Material) -> Self {
        self.material = material;
        self
    }

    /// Sets the Coulomb friction coefficient, 0 or more.
    pub fn friction(mut self, friction: f32) -> Self {
        self.material.friction = friction;
        self
    }

    /// Sets the ratio of separation to approach velocity, 0 to 1.
    pub fn restitution(mut self, restitution: f32) -> Self {
        self.material.restitution = restitution;
        self
    }

    /// Sets which bodies this body collides with.
    pub fn groups(mut self, groups: Groups) -> Self {
        self.groups = groups;
        self
    }

    /// Marks the body as a bullet. Even without the mark, no body passes through fixed geometry, and contacts between
    /// two moving bodies act along the paths that both would take through the step without contact. But a bounce or a
    /// push can put a body on another path within the step, and two such bodies can pass through each other. A bullet
    /// stops where its actual path crosses a moving body.
    ///
    /// ```
    /// use drystone::{Body, Shape};
    ///
    /// let bullet = Body::dynamic().shape(Shape::ball(0.004)).swept();
    /// assert!(bullet.swept && !Body::dynamic().swept);
    /// ```
    pub fn swept(mut self) -> Self {
        self.swept = true;
        self
    }

    /// Sets the name for messages and reports.
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Recomputes mass, center of mass and inertia from the present shapes, at the density or total mass that was set,
    /// and from the [additional mass](Self::additional_mass).
    /// Call it after a change of [`colliders`](Self::colliders) or [`kind`](Self::kind). It has no effect if
    /// [`Self::mass_properties`] set the mass, or if the body is not dynamic.
    ///
    /// ```
    /// use drystone::{Body, Shape};
    ///
    /// let mut crate_ = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
    /// crate_.colliders[0].shape = Shape::cuboid(0.5, 1.0, 0.5);
    /// crate_.update_mass();
    /// assert_eq!(crate_.mass.mass, 2000.0);
    /// ```
    pub fn update_mass(&mut self) {
        if self.kind != BodyKind::Dynamic {
            return;
        }
        let solids: Vec<&Collider> = self.solids().filter(|c| c.shape.has_volume()).collect();
        let at = |density: f32| MassProperties::of_solids(&solids, density);
        let own = match self.weight {
            Weight::Density(density) => at(density),
            Weight::Total(mass) if !solids.is_empty() => at(mass / at(1.0).mass),
            Weight::Total(_) => MassProperties::IMMOVABLE,
            Weight::Given => return,
        };
        self.mass = own.plus(&self.additional);
    }

    /// Refuses a mass that no dynamic body can have. The message names the source of the mass.
    fn check_mass(&self) -> Result<()> {
        self.mass.check().map_err(|error| match self.weight {
            Weight::Given => error,
            _ if self.mass.mass == 0.0 && self.solids().next().is_none() => {
                input!("mass = 0 kg: a dynamic body needs a shape other than a sensor, or mass_properties")
            }
            Weight::Density(density) if !(density > 0.0 && density.is_finite()) => {
                input!("density = {density} kg/m³: must be a number above 0")
            }
            Weight::Total(mass) if !MassProperties::MASSES.contains(&mass) => {
                input!("mass = {mass:e} kg: must be 1e-15 to 1e15 kg")
            }
            _ if self.mass.mass == 0.0 => input!("{error}; call Body::update_mass to compute the mass from the shapes"),
            _ => error,
        })
    }

    /// Whether another body is equal except for pose, velocity, forces and torques.
    pub(super) fn is_same_but_for_motion(&self, other: &Self) -> bool {
        let Self {
            name,
            kind,
            position: _,
            rotation: _,
            linear_velocity: _,
            angular_velocity: _,
            force: _,
            torque: _,
            gravity_scale,
            linear_damping,
            angular_damping,
            locked_rotations,
            locked_translations,
            max_linear_speed,
            max_angular_speed,
            can_sleep,
            mass,
            material,
            groups,
            swept,
            colliders: _,
            weight,
            additional,
            applied_force: _,
            applied_torque: _,
        } = self;
        (name, kind, mass, gravity_scale) == (&other.name, &other.kind, &other.mass, &other.gravity_scale)
            && (linear_damping, angular_damping) == (&other.linear_damping, &other.angular_damping)
            && (locked_rotations, can_sleep) == (&other.locked_rotations, &other.can_sleep)
            && *locked_translations == other.locked_translations
            && (max_linear_speed, max_angular_speed) == (&other.max_linear_speed, &other.max_angular_speed)
            && (material, groups, swept, weight) == (&other.material, &other.groups, &other.swept, &other.weight)
            && *additional == other.additional
            && self.has_same_colliders(other)
    }

    /// Whether another body shares the same shapes at the same poses. Equal copies of a shape do not count.
    pub(super) fn has_same_colliders(&self, other: &Self) -> bool {
        let same = |(a, b): (&Collider, &Collider)| {
            let Collider { shape, position, rotation, sensor, material } = a;
            shape.is(&b.shape)
                && (position, rotation, sensor, material) == (&b.position, &b.rotation, &b.sensor, &b.material)
        };
        self.colliders.len() == other.colliders.len() && self.colliders.iter().zip(&other.colliders).all(same)
    }

    /// Whether damping slows the body.
    pub(crate) fn is_damped(&self) -> bool {
        self.kind == BodyKind::Dynamic && (self.linear_damping > 0.0 || self.angular_damping > 0.0)
    }

    /// Whether the body is dynamic and rotation about a world axis is locked.
    pub(crate) fn has_locked_rotation(&self) -> bool {
        self.kind == BodyKind::Dynamic && self.locked_rotations != [false; 3]
    }

    /// Whether rotation about every axis is locked.
    pub(crate) fn has_fixed_rotation(&self) -> bool {
        self.kind == BodyKind::Dynamic && self.locked_rotations == [true; 3]
    }

    /// The part of an angular velocity about the axes that are not locked, up to the largest angular speed.
    pub(crate) fn allowed_spin(&self, spin: Vec3) -> Vec3 {
        let spin = if self.has_locked_rotation() { without(self.locked_rotations, spin) } else { spin };
        self.at_most(self.max_angular_speed, spin)
    }

    /// The part of a velocity along the axes that are not locked, up to the largest speed.
    pub(crate) fn allowed_velocity(&self, velocity: Vec3) -> Vec3 {
        self.at_most(self.max_linear_speed, self.unlocked(velocity))
    }

    /// The part of a vector along the axes that are not locked.
    pub(crate) fn unlocked(&self, vector: Vec3) -> Vec3 {
        if self.has_locked_translation() { without(self.locked_translations, vector) } else { vector }
    }

    fn at_most(&self, speed: f32, velocity: Vec3) -> Vec3 {
        let is_capped = speed < f32::INFINITY && self.kind == BodyKind::Dynamic;
        if is_capped { velocity.clamp_length_max(speed) } else { velocity }
    }

    /// Whether the body is dynamic and translation along a world axis is locked.
    pub(crate) fn has_locked_translation(&self) -> bool {
        self.locked_translations != [false; 3] && self.kind == BodyKind::Dynamic
    }

    /// Whether the body is dynamic and any of its axes is locked.
    pub fn has_locked_axis(&self) -> bool {
        self.has_locked_rotation() || self.has_locked_translation()
    }

    /// The locked translations as the number of a row.
    pub(crate) fn locks(&self) -> f32 {
        let [x, y, z] = self.locked_translations.map(u8::from);
        f32::from(x + 2 * y + 4 * z)
    }

    /// The material of the contact of two bodies, at colliders of these indices. Its surface velocity is that of b's
    /// surface relative to a's, beyond the motion of the bodies, in world axes.
    pub(crate) fn contact_material([a, b]: [&Self; 2], colliders: [u32; 2]) -> Material {
        let [of_a, of_b] = [a.material_of(colliders[0] as usize), b.material_of(colliders[1] as usize)];
        let both = of_a.combine(of_b);
        if !of_a.is_driven() && !of_b.is_driven() {
            return both;
        }
        Material { surface_velocity: b.rotation * of_b.surface_velocity - a.rotation * of_a.surface_velocity, ..both }
    }

    /// The material of one of its colliders.
    pub(crate) fn material_of(&self, collider: usize) -> Material {
        self.colliders.get(collider).and_then(|c| c.material).unwrap_or(self.material)
    }

    /// The materials of the body and of its colliders.
    pub(crate) fn materials(&self) -> impl Iterator<Item = Material> + Clone + '_ {
        std::iter::once(self.material).chain(self.colliders.iter().filter_map(|c| c.material))
    }

    /// The properties for which its rows are written, in addition to its shapes.
    pub(crate) fn surface(&self) -> Surface {
        let &Self { mass, locked_rotations, locked_translations, material, .. } = self;
        Surface { mass, locked_rotations, locked_translations, material }
    }

    /// Inverse inertia in world axes (1/(kg m²)): the inverse of the inertia about the axes that are not locked, and
    /// zero about the locked ones. Zero unless the body is dynamic.
    pub fn world_inverse_inertia(&self) -> Mat3 {
        if !self.has_locked_rotation() {
            return self.mass.world_inverse_inertia(self.rotation);
        }
        let size = f64::from(self.mass.principal_inertia.max_element());
        if self.has_fixed_rotation() || size <= 0.0 {
            return Mat3::ZERO;
        }
        // Scale by the size, so that no product overflows. Separate locked axes from the others.
        let mut inertia = self.mass.world_inertia(self.rotation).as_dmat3() * size.recip();
        let locked = (0..3).filter(|&k| self.locked_rotations[k]);
        for k in locked.clone() {
            *inertia.col_mut(k) = DVec3::ZERO;
            (0..3).for_each(|other| inertia.col_mut(other)[k] = 0.0);
            inertia.col_mut(k)[k] = 1.0;
        }
        let mut inverse = inertia.inverse() * size.recip();
        for k in locked {
            *inverse.col_mut(k) = DVec3::ZERO;
            (0..3).for_each(|other| inverse.col_mut(other)[k] = 0.0);
        }
        inverse.as_mat3()
    }

    /// Whether the body is kinematic and moves.
    pub fn is_driven(&self) -> bool {
        self.kind == BodyKind::Kinematic && (self.linear_velocity != Vec3::ZERO || self.angular_velocity != Vec3::ZERO)
    }

    /// Radius of a sphere around the body's origin that holds all shapes except sensors (m); 0 without shapes.
    pub(crate) fn reach(&self) -> f32 {
        self.solids().map(|c| c.position.length() + c.shape.bounding_radius()).fold(0.0, f32::max)
    }

    /// Half of the smallest side of the thinnest shape that is not a sensor (m); infinite without shapes.
    pub fn smallest_half_extent(&self) -> f32 {
        self.solids().map(|c| c.shape.smallest_half_extent()).fold(f32::INFINITY, f32::min)
    }

    /// Center of mass in the world (m).
    pub fn center_of_mass(&self) -> Vec3 {
        self.position + self.rotation * self.mass.center
    }

    /// Velocity of the material point at world position `p` (m/s).
    pub fn velocity_at(&self, p: Vec3) -> Vec3 {
        self.linear_velocity + self.angular_velocity.cross(p - self.center_of_mass())
    }

    /// Changes the velocity at once, like a hit through the center of mass (N s). It has no effect unless the body is
    /// dynamic. This method and the five below wake a sleeping body and every body that it touches.
    ///
    /// ```
    /// use drystone::{Body, Shape, glam::Vec3};
    /// let mut cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0);
    /// cube.apply_impulse(Vec3::X * 12.0);
    /// assert_eq!(cube.linear_velocity, Vec3::X * 2.0);
    /// // A hit on the side turns the cube as well: (0, 0, -0.5 * 12) N m s on 1 kg m².
    /// cube.apply_impulse_at(Vec3::X * 12.0, Vec3::Y * 0.5);
    /// assert_eq!((cube.linear_velocity, cube.angular_velocity), (Vec3::X * 4.0, Vec3::Z * -6.0));
    /// ```
    pub fn apply_impulse(&mut self, impulse: Vec3) {
        if self.kind == BodyKind::Dynamic {
            self.linear_velocity += impulse / self.mass.mass;
        }
    }

    /// Changes linear and angular velocity at once, like a hit (N s) at a point of the world (m).
    pub fn apply_impulse_at(&mut self, impulse: Vec3, point: Vec3) {
        self.apply_impulse(impulse);
        self.apply_angular_impulse((point - self.center_of_mass()).cross(impulse));
    }

    /// Changes the angular velocity at once, by an angular impulse in world axes (N m s).
    pub fn apply_angular_impulse(&mut self, impulse: Vec3) {
        if self.kind == BodyKind::Dynamic {
            self.angular_velocity += self.world_inverse_inertia() * impulse;
        }
    }

    /// Adds a force through the center of mass for the next step (N), in addition to [`Body::force`] and earlier calls.
    /// The next successful step uses it up; a step that fails keeps it.
    ///
    /// ```
    /// use drystone::{Body, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
    /// let mut world = World { gravity: Vec3::ZERO, ..World::new() };
    /// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(2.0));
    /// let mut simulation = Simulation::new(world)?;
    /// simulation.world.body_mut(ball).expect("just put in").apply_force(Vec3::X * 8.0);
    /// simulation.step(0.25)?;
    /// simulation.step(0.25)?;
    /// assert_eq!(simulation.world.body(ball).expect("still there").linear_velocity, Vec3::X);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    pub fn apply_force(&mut self, force: Vec3) {
        if self.kind == BodyKind::Dynamic {
            self.applied_force += force;
        }
    }

    /// Adds a force (N) at a point of the world (m) for the next step: [`Body::apply_force`] plus the torque about the
    /// present center of mass.
    pub fn apply_force_at(&mut self, force: Vec3, point: Vec3) {
        self.apply_force(force);
        self.apply_torque((point - self.center_of_mass()).cross(force));
    }

    /// Adds a torque in world axes for the next step (N m), in addition to [`Body::torque`] and earlier calls.
    pub fn apply_torque(&mut self, torque: Vec3) {
        if self.kind == BodyKind::Dynamic {
            self.applied_torque += torque;
        }
    }

    /// Total force that acts in the next step, without gravity (N).
    pub fn whole_force(&self) -> Vec3 {
        self.force + self.applied_force
    }

    /// Total torque that acts in the next step, in world axes (N m).
    pub fn whole_torque(&self) -> Vec3 {
        self.torque + self.applied_torque
    }

    /// Clears the forces and torques that act for one step only.
    pub(crate) fn forget_applied_forces(&mut self) {
        (self.applied_force, self.applied_torque) = (Vec3::ZERO, Vec3::ZERO);
    }

    /// Gives a kinematic body the velocity that takes it to a pose within `dt` seconds, above 0. The next step refuses
    /// a velocity that is out of range.
    pub fn move_to(&mut self, position: Vec3, rotation: Quat, dt: f32) {
        let center = position + rotation * self.mass.center;
        self.linear_velocity = (center - self.center_of_mass()) / dt;
        let turn = rotation::product(rotation, self.rotation.inverse());
        // Take the shorter way around.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        self.angular_velocity = rotation::vector_of(rotation::unit(turn)) / dt;
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
        let axes = rotation::product(self.rotation, self.mass.principal_frame).as_dquat();
        f64::from(self.mass.mass) * orbital + axes * (self.mass.principal_inertia.as_dvec3() * self.principal_spin())
    }

    /// Angular velocity along the principal axes.
    fn principal_spin(&self) -> DVec3 {
        rotation::product(self.rotation, self.mass.principal_frame).as_dquat().inverse()
            * self.angular_velocity.as_dvec3()
    }

    /// Refuses a body that cannot be simulated, as [`World::check`](crate::World::check) does.
    ///
    /// ```
    /// use drystone::{Body, Shape};
    ///
    /// assert!(Body::dynamic().shape(Shape::ball(0.5)).check().is_ok());
    /// let error = Body::dynamic().shape(Shape::ball(0.5)).friction(-1.0).check().expect_err("a slip");
    /// assert_eq!(error.to_string(), "friction = -1: must be 0 or more");
    /// ```
    ///
    /// # Errors
    /// One line names the number, or the shape, and its range.
    pub fn check(&self) -> Result<()> {
        self.check_motion()?;
        self.check_shapes()?;
        self.check_surface()
    }

    /// Refuses a pose, velocity, force, torque, damping or gravity scale that is out of range.
    pub(crate) fn check_motion(&self) -> Result<()> {
        check_place("position", self.position)?;
        check_rotation("rotation", self.rotation)?;
        for (name, v) in [("linear", self.linear_velocity), ("angular", self.angular_velocity)] {
            let message = || format!("{name} velocity = {v}: must be at most {MAX_SPEED:e} in size");
            ensure(is_within(v, MAX_SPEED), message)?;
        }
        let loads = [self.whole_force(), self.whole_torque()];
        let accelerations = if loads != [Vec3::ZERO; 2] && self.kind == BodyKind::Dynamic && self.mass.mass > 0.0 {
            [loads[0] / self.mass.mass, self.world_inverse_inertia() * loads[1]]
        } else {
            // The product is zero if the load is finite.
            loads.map(|load| 0.0 * load)
        };
        for ((name, load), acceleration) in ["force", "torque"].into_iter().zip(loads).zip(accelerations) {
            let message =
                || format!("{name} = {load}: must accelerate the body by at most {MAX_GRAVITY:e} along every axis");
            ensure(is_within(acceleration, MAX_GRAVITY), message)?;
        }
        let check_damping = |name: &str, rate: f32| {
            ensure((0.0..=MAX_DAMPING).contains(&rate), || format!("{name} = {rate}: must be 0 to {MAX_DAMPING:e} 1/s"))
        };
        check_damping("linear_damping", self.linear_damping)?;
        check_damping("angular_damping", self.angular_damping)?;
        let check_cap =
            |name: &str, speed: f32| ensure(speed >= 0.0, || format!("{name} = {speed}: must be 0 or more"));
        check_cap("max_linear_speed", self.max_linear_speed)?;
        check_cap("max_angular_speed", self.max_angular_speed)?;
        let scale = self.gravity_scale;
        ensure(scale.abs() <= MAX_GRAVITY, || {
            format!("gravity_scale = {scale}: must be at most {MAX_GRAVITY:e} in size")
        })
    }

    fn check_shapes(&self) -> Result<()> {
        let check = |c: &Collider| {
            c.check()?;
            let fits = (self.kind != BodyKind::Kinematic && !c.sensor) || !c.shape.is_half_space();
            ensure(fits, || "half-spaces are for fixed bodies only, and cannot be sensors".into())?;
            let fits = self.kind != BodyKind::Dynamic || c.sensor || c.shape.has_volume();
            ensure(fits, || "a dynamic body cannot have half-spaces, meshes or height fields: they have no mass".into())
        };
        let mut shapes = self.colliders.iter().enumerate();
        shapes.try_for_each(|(k, c)| check(c).map_err(|e| e.within(format_args!("shapes[{k}]"))))
    }

    /// Refuses a mass or a material that cannot be simulated.
    pub(super) fn check_surface(&self) -> Result<()> {
        self.material.check()?;
        self.additional.check_additional().map_err(|e| e.within("additional_mass"))?;
        if self.kind == BodyKind::Dynamic { self.check_mass() } else { self.mass.check_frame() }
    }

    /// Whether pose and velocity are finite.
    pub fn is_finite(&self) -> bool {
        self.position.is_finite()
            && self.rotation.is_finite()
            && self.linear_velocity.is_finite()
            && self.angular_velocity.is_finite()
    }
}
