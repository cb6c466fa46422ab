//! The components of a body.

use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use bevy_ecs::query::QueryData;
use bevy_math::{Quat, Vec3};
use bevy_transform::components::Transform;
use drystone::{Body, BodyKind, Groups, MassProperties, Shape};

/// A rigid body, and how it moves. The body is at the entity's [`Transform`], in the world: the entity must not have a
/// parent that is elsewhere. The scale does not count.
///
/// The body enters the world with the next step, and leaves it at once when this component is removed.
///
/// ```
/// use bevy_app::{App, FixedMain};
/// use bevy_drystone::{Order, prelude::*};
/// use bevy_math::Vec3;
/// use bevy_transform::prelude::*;
///
/// let mut app = App::new();
/// app.add_plugins(DrystonePlugin);
/// // All that a body can have.
/// let bird = app.world_mut().spawn((
///     (RigidBody::Dynamic, Collider::from(Shape::capsule(0.1, 0.05)), Transform::from_xyz(0.0, 3.0, 0.0)),
///     (LinearVelocity(Vec3::X * 4.0), AngularVelocity(Vec3::Y), Mass(0.3), GravityScale(0.0)),
///     (LinearDamping(0.1), AngularDamping(2.0), MaxLinearSpeed(20.0), MaxAngularSpeed(9.0), SweptCcd),
///     LockedAxes { rotations: [true, false, true], ..LockedAxes::default() },
///     (ConstantForce(Vec3::X * 0.1), ConstantTorque(Vec3::ZERO), CollisionLayers::default()),
///     (SleepingDisabled, TransformInterpolation, Order(7)),
/// ));
/// let bird = bird.id();
/// let cloud = (RigidBody::Static, Collider::from(Shape::ball(1.0)), Sensor, ColliderDensity(1.2));
/// let cloud = app.world_mut().spawn(cloud).id();
/// (0..64).for_each(|_| app.world_mut().run_schedule(FixedMain));
/// assert!(app.world().get::<Transform>(bird).expect("it is there").translation.x > 3.5);
/// // Neither of them sleeps.
/// assert!([bird, cloud].iter().all(|body| app.world().get::<Sleeping>(*body).is_none()));
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[require(Transform, LinearVelocity, AngularVelocity)]
pub enum RigidBody {
    /// Moves by forces and impulses.
    #[default]
    Dynamic,
    /// Never moves.
    Static,
    /// Moves with the velocity that the program gives it; contacts do not change the velocity.
    Kinematic,
}

/// The shapes of a body, with their poses in the body's frame.
///
/// ```
/// use bevy_drystone::prelude::*;
/// use bevy_math::{Quat, Vec3};
///
/// let ball = Collider::from(Shape::ball(0.5));
/// let head = Shape::cuboid(0.1, 0.05, 0.05);
/// let hammer = Collider::from(Shape::cylinder(0.4, 0.02)).with(head, Vec3::Y * 0.4, Quat::IDENTITY);
/// assert_eq!((ball.0.len(), hammer.0.len()), (1, 2));
/// ```
#[derive(Component, Clone, Debug, Default)]
pub struct Collider(
    /// Shapes with pose, own material, and whether they are sensors.
    pub Vec<drystone::world::Collider>,
);

impl From<Shape> for Collider {
    fn from(shape: Shape) -> Self {
        Self(vec![drystone::world::Collider::new(shape)])
    }
}

impl Collider {
    /// Adds a shape at a pose in the body's frame (m).
    #[must_use]
    pub fn with(mut self, shape: Shape, position: Vec3, rotation: Quat) -> Self {
        self.0.push(drystone::world::Collider { position, rotation, ..drystone::world::Collider::new(shape) });
        self
    }
}

/// Velocity of the center of mass (m/s). A program may set it, and a step sets it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearVelocity(pub Vec3);

/// Angular velocity in world axes (rad/s). A program may set it, and a step sets it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct AngularVelocity(pub Vec3);

/// Total mass (kg). The inertia is that of the shapes, scaled to this mass. It takes precedence over
/// [`ColliderDensity`].
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct Mass(pub f32);

/// Density of the shapes (kg/m³); 1000 without this component.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct ColliderDensity(pub f32);

/// Friction and restitution of the shapes that have no own material; friction 0.5 and restitution 0 without this
/// component.
///
/// ```
/// use bevy_drystone::{ContactMaterial, drystone::Material};
///
/// let ice = ContactMaterial(Material { friction: 0.02, ..Material::default() });
/// assert_eq!(ice.0.restitution, 0.0);
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactMaterial(pub drystone::Material);

/// Scales gravity for a body: 1 without this component, 0 floats.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct GravityScale(pub f32);

/// Rate at which the linear velocity decays (1/s): v exp(-d t).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearDamping(pub f32);

/// Rate at which the angular velocity decays (1/s), likewise.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct AngularDamping(pub f32);

/// The world axes x, y, z about which a body does not rotate, and along which its center of mass does not move.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LockedAxes {
    /// Whether rotation about x, y, z is locked.
    pub rotations: [bool; 3],
    /// Whether translation along x, y, z is locked.
    pub translations: [bool; 3],
}

/// Largest speed of the center of mass at the start and the end of a step (m/s).
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct MaxLinearSpeed(pub f32);

/// Largest angular speed at the start and the end of a step (rad/s).
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct MaxAngularSpeed(pub f32);

/// The layers that a body belongs to, and those that it collides with: one bit for each of 32 layers. Two bodies
/// collide if each one belongs to a layer that the other collides with. Without this component all bits are set.
///
/// ```
/// use bevy_drystone::prelude::*;
///
/// let ghost = CollisionLayers { memberships: 0b10, filters: 0b01 };
/// assert_eq!(CollisionLayers::default().memberships, u32::MAX);
/// # let _ = ghost;
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollisionLayers {
    /// The layers that the body belongs to.
    pub memberships: u32,
    /// The layers that the body collides with.
    pub filters: u32,
}

impl Default for CollisionLayers {
    fn default() -> Self {
        Self { memberships: u32::MAX, filters: u32::MAX }
    }
}

impl From<CollisionLayers> for Groups {
    fn from(layers: CollisionLayers) -> Self {
        Self { membership: layers.memberships, filter: layers.filters }
    }
}

/// Makes all shapes of a body sensors: they detect other bodies, push none, and have no mass. One shape alone becomes a
/// sensor by its flag in [`Collider`].
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sensor;

/// Marks a body that sleeps. A step inserts and removes it. A program that removes it wakes the body, and those that
/// lie together with it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[component(storage = "SparseSet")]
pub struct Sleeping;

/// Keeps a body awake, and all bodies that touch it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SleepingDisabled;

/// Marks a bullet, which stops at moving bodies too, wherever a bounce sends it. All bodies stop at static ones without
/// it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SweptCcd;

/// Force through the center of mass, in world axes, in every step (N).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct ConstantForce(pub Vec3);

/// Torque in world axes, in every step (N m).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct ConstantTorque(pub Vec3);

/// Shows a body between its last two poses, so that it moves smoothly at any frame rate. From `FixedMain` to the next
/// its [`Transform`] is up to one step behind the body. Systems of the fixed schedules find the exact pose.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TransformInterpolation;

/// The place of a body or joint among those that enter the world in the same step: smaller numbers enter first, and
/// equal numbers in the order in which the components were added. It is 0 without this component.
///
/// The bits of a run depend on the order in which bodies enter. Programs that add the same bodies in different orders,
/// as the peers of a game may, give each one a number.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Order(pub u64);

/// The components that decide all of a body but its motion.
#[derive(QueryData)]
pub(crate) struct Settings {
    kind: &'static RigidBody,
    collider: Option<&'static Collider>,
    mass: Option<&'static Mass>,
    density: Option<&'static ColliderDensity>,
    material: Option<&'static ContactMaterial>,
    gravity_scale: Option<&'static GravityScale>,
    linear_damping: Option<&'static LinearDamping>,
    angular_damping: Option<&'static AngularDamping>,
    locked_axes: Option<&'static LockedAxes>,
    max_linear_speed: Option<&'static MaxLinearSpeed>,
    max_angular_speed: Option<&'static MaxAngularSpeed>,
    layers: Option<&'static CollisionLayers>,
    force: Option<&'static ConstantForce>,
    torque: Option<&'static ConstantTorque>,
    sensor: Has<Sensor>,
    no_sleep: Has<SleepingDisabled>,
    swept: Has<SweptCcd>,
    name: Option<&'static Name>,
}

/// The components of [`Settings`] that a body can do without.
pub(crate) type Optional = (
    Collider,
    Mass,
    ColliderDensity,
    ContactMaterial,
    GravityScale,
    LinearDamping,
    AngularDamping,
    LockedAxes,
    (MaxLinearSpeed, MaxAngularSpeed),
    CollisionLayers,
    ConstantForce,
    ConstantTorque,
    Sensor,
    SleepingDisabled,
    SweptCcd,
);

/// Whether one of [`Settings`] changed.
pub(crate) type AnyChanged = Or<(
    Or<(Changed<RigidBody>, Changed<Collider>, Changed<Mass>, Changed<ColliderDensity>, Changed<ContactMaterial>)>,
    Or<(Changed<GravityScale>, Changed<LinearDamping>, Changed<AngularDamping>, Changed<LockedAxes>)>,
    Or<(Changed<MaxLinearSpeed>, Changed<MaxAngularSpeed>)>,
    Or<(Changed<CollisionLayers>, Changed<ConstantForce>, Changed<ConstantTorque>, Changed<Sensor>)>,
    Or<(Changed<SleepingDisabled>, Changed<SweptCcd>)>,
)>;

impl SettingsItem<'_, '_> {
    /// A body with these settings and the motion of `body`.
    pub fn apply(&self, mut body: Body) -> Body {
        let default = Body::new(match self.kind {
            RigidBody::Dynamic => BodyKind::Dynamic,
            RigidBody::Static => BodyKind::Fixed,
            RigidBody::Kinematic => BodyKind::Kinematic,
        });
        body.kind = default.kind;
        body.name = self.name.map_or_else(String::new, |name| name.to_string());
        body.colliders = self.collider.map_or_else(Vec::new, |collider| collider.0.clone());
        body.colliders.iter_mut().for_each(|collider| collider.sensor |= self.sensor);
        body.material = self.material.map_or(default.material, |material| material.0);
        body.gravity_scale = self.gravity_scale.map_or(default.gravity_scale, |scale| scale.0);
        body.linear_damping = self.linear_damping.map_or(default.linear_damping, |rate| rate.0);
        body.angular_damping = self.angular_damping.map_or(default.angular_damping, |rate| rate.0);
        let LockedAxes { rotations, translations } = self.locked_axes.copied().unwrap_or_default();
        (body.locked_rotations, body.locked_translations) = (rotations, translations);
        body.max_linear_speed = self.max_linear_speed.map_or(default.max_linear_speed, |speed| speed.0);
        body.max_angular_speed = self.max_angular_speed.map_or(default.max_angular_speed, |speed| speed.0);
        body.groups = self.layers.map_or(default.groups, |&layers| layers.into());
        body.force = self.force.map_or(default.force, |force| force.0);
        body.torque = self.torque.map_or(default.torque, |torque| torque.0);
        (body.can_sleep, body.swept) = (!self.no_sleep, self.swept);
        // The density of drystone is that of water too. A body of another kind keeps its mass: it has none.
        body.mass = MassProperties::IMMOVABLE;
        match (self.mass, self.density) {
            (Some(mass), _) => body.total_mass(mass.0),
            (None, density) => body.density(density.map_or(1000.0, |density| density.0)),
        }
    }
}
