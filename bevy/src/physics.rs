//! The simulation, and which entity each body and joint belongs to.

use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;
use bevy_math::{Quat, Vec3};
use drystone::{Body, BodyHandle, JointHandle, Simulation, StepStats, World as Bodies};

use crate::error::PhysicsError;

/// The simulation, and its bodies and joints by their entities.
///
/// ```
/// use bevy_app::prelude::*;
/// use bevy_drystone::prelude::*;
/// use bevy_drystone::drystone::{Cpu, Simulation, SolverConfig, World};
/// use bevy_math::Vec3;
///
/// // On the moon, with 4 substeps and with messages of contacts.
/// let world = World { gravity: Vec3::Y * -1.62, ..World::new() };
/// let config = SolverConfig::default().with(|config| config.substeps = 4);
/// let mut simulation = Simulation::with(world, config, Box::new(Cpu::new()))?;
/// simulation.listen(Listen { contacts: true, ..Listen::default() })?;
/// let mut app = App::new();
/// app.insert_resource(Physics::new(simulation)).add_plugins(DrystonePlugin);
/// # Ok::<(), bevy_drystone::drystone::Error>(())
/// ```
///
/// ```
/// use bevy_app::{App, FixedMain};
/// use bevy_drystone::prelude::*;
/// use bevy_math::Vec3;
///
/// let mut app = App::new();
/// app.add_plugins(DrystonePlugin);
/// let lamp = app.world_mut().spawn((RigidBody::Dynamic, Collider::from(Shape::ball(0.1)), Mass(2.0))).id();
/// let rope = app.world_mut().spawn(Joint::to_world(lamp, Vec3::ZERO, Vec3::Y).with(|joint| joint.rope(1.0))).id();
/// (0..64).for_each(|_| app.world_mut().run_schedule(FixedMain));
/// let physics = app.world().resource::<Physics>();
/// // The lamp hangs still.
/// assert!(physics.error().is_none() && physics.stats().asleep == 1);
/// // From entities to bodies and joints, and back.
/// let (body, joint) = (physics.handle(lamp).expect("a body"), physics.joint_handle(rope).expect("a joint"));
/// assert_eq!(physics.entity(body), Some(lamp));
/// assert_eq!(physics.body(lamp).expect("a body").mass.mass, 2.0);
/// let force = physics.simulation.joint_force(joint).expect("it took part in the step");
/// assert!((force.y.abs() - 2.0 * 9.81).abs() < 0.1, "{force} N");
/// ```
#[derive(Resource)]
pub struct Physics {
    /// The simulation. A program may call all of it between steps, for gravity, settings, hooks, contacts, measures and
    /// the hash, and may add bodies without an entity. To step and restore is up to the plugin.
    pub simulation: Simulation,
    pub(crate) tables: Tables,
    pub(crate) stats: StepStats,
    pub(crate) error: Option<PhysicsError>,
}

/// Which entity each body and joint belongs to, and what waits for the next step.
#[derive(Clone, Default)]
pub(crate) struct Tables {
    /// The entity of each body, by its index in the world.
    pub rows: Vec<Option<Row>>,
    pub bodies: EntityHashMap<BodyHandle>,
    pub joints: EntityHashMap<JointHandle>,
    /// Entities whose body or joint is not in the world yet, in the order in which they came.
    pub new_bodies: Vec<Waiting>,
    pub new_joints: Vec<Waiting>,
    /// Entities that lost a component of their settings.
    pub stripped: Vec<Entity>,
    /// Bodies that left since the last step, for the events of the next one.
    pub left: Vec<(BodyHandle, Entity)>,
}

/// A body that has an entity.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    pub entity: Entity,
    pub handle: BodyHandle,
    /// The components as the plugin left them: what differs is a change by the program.
    pub shown: Motion,
    /// The motion before the last step.
    pub before: Motion,
}

/// Pose and velocity of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motion {
    pub position: Vec3,
    pub rotation: Quat,
    pub linear: Vec3,
    pub angular: Vec3,
}

impl Motion {
    pub fn of(body: &Body) -> Self {
        let Body { position, rotation, linear_velocity: linear, angular_velocity: angular, .. } = *body;
        Self { position, rotation, linear, angular }
    }

    pub fn give(self, body: &mut Body) {
        (body.position, body.rotation) = (self.position, self.rotation);
        (body.linear_velocity, body.angular_velocity) = (self.linear, self.angular);
    }
}

/// An entity whose body or joint is not in the world yet.
#[derive(Clone)]
pub(crate) struct Waiting {
    pub entity: Entity,
    /// Why it could not enter in the last step.
    told: String,
}

impl Waiting {
    pub fn new(entity: Entity) -> Self {
        Self { entity, told: String::new() }
    }

    /// Tells why it cannot enter the world, once.
    pub fn tell(&mut self, physics: &mut Physics, text: String, errors: &mut MessageWriter<PhysicsError>) {
        if self.told != text {
            self.told.clone_from(&text);
            physics.tell(Some(self.entity), text, errors);
        }
    }
}

impl Tables {
    /// The entity of a body, also of one that left since the last step.
    pub fn entity(&self, body: BodyHandle) -> Option<Entity> {
        let row = self.rows.get(body.index()).and_then(Option::as_ref).filter(|row| row.handle == body);
        let left = || self.left.iter().find(|(handle, _)| *handle == body).map(|(_, entity)| *entity);
        row.map(|row| row.entity).or_else(left)
    }

    /// The entities whose body is in the world or waits for it, and those of joints, each in the order of their entry.
    pub fn entities(&self, world: &Bodies) -> [Vec<Entity>; 2] {
        let waiting = |all: &[Waiting]| all.iter().map(|waiting| waiting.entity).collect::<Vec<_>>();
        let mut joints: Vec<_> =
            self.joints.iter().map(|(entity, joint)| (world.joints.index(*joint), *entity)).collect();
        joints.sort_unstable();
        let bodies = self.rows.iter().flatten().map(|row| row.entity).chain(waiting(&self.new_bodies));
        let joints = joints.into_iter().map(|(_, entity)| entity).chain(waiting(&self.new_joints));
        [bodies.collect(), joints.collect()]
    }

    /// Takes note of a body that entered the world.
    pub fn insert(&mut self, entity: Entity, handle: BodyHandle, motion: Motion) {
        let index = handle.index();
        self.rows.resize(self.rows.len().max(index + 1), None);
        self.rows[index] = Some(Row { entity, handle, shown: motion, before: motion });
        self.bodies.insert(entity, handle);
    }

    /// Removes the body of an entity. Its joints leave with it, and wait for another one.
    pub fn remove_body(&mut self, entity: Entity, world: &mut Bodies) {
        self.new_bodies.retain(|waiting| waiting.entity != entity);
        let Some(handle) = self.bodies.remove(&entity) else { return };
        let holds = |joint: JointHandle| world.joint(joint).is_some_and(|joint| joint.holds(handle));
        let held = self.joints.iter().filter(|(_, joint)| holds(**joint));
        let mut held: Vec<_> = held.map(|(entity, joint)| (world.joints.index(*joint), *entity)).collect();
        held.sort_unstable();
        for (_, joint) in held {
            self.joints.remove(&joint);
            self.new_joints.push(Waiting::new(joint));
        }
        world.remove(handle);
        self.rows[handle.index()] = None;
        self.left.push((handle, entity));
    }

    /// Removes the joint of an entity.
    pub fn remove_joint(&mut self, entity: Entity, world: &mut Bodies) {
        self.new_joints.retain(|waiting| waiting.entity != entity);
        if let Some(joint) = self.joints.remove(&entity) {
            world.remove_joint(joint);
        }
    }
}

impl Default for Physics {
    fn default() -> Self {
        Self::new(Simulation::new(Bodies::new()).expect("nothing is wrong with an empty world"))
    }
}

impl Physics {
    /// Physics with the settings, the backend, the gravity and the events of a simulation.
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation, tables: Tables::default(), stats: StepStats::default(), error: None }
    }

    /// The body of an entity, or `None` before it entered the world.
    pub fn handle(&self, entity: Entity) -> Option<BodyHandle> {
        self.tables.bodies.get(&entity).copied()
    }

    /// The joint of an entity, or `None` before it entered the world or after it broke.
    pub fn joint_handle(&self, entity: Entity) -> Option<JointHandle> {
        self.tables.joints.get(&entity).copied()
    }

    /// The entity of a body, for contacts of the simulation, also if the body left since the last step. `None` for a
    /// body without an entity.
    pub fn entity(&self, body: BodyHandle) -> Option<Entity> {
        self.tables.entity(body)
    }

    /// The body of an entity, to apply forces and impulses or to move a kinematic body. `None` before it entered the
    /// world. The next step takes the fields that a component sets from the component if that was changed.
    ///
    /// ```
    /// use bevy_drystone::prelude::*;
    /// use bevy_ecs::prelude::*;
    /// use bevy_math::Vec3;
    ///
    /// #[derive(Component)]
    /// struct Rocket;
    ///
    /// fn thrust(mut physics: ResMut<Physics>, rockets: Query<Entity, With<Rocket>>) {
    ///     for rocket in &rockets {
    ///         if let Some(body) = physics.body_mut(rocket) {
    ///             body.apply_force(body.rotation * Vec3::Y * 500.0);
    ///         }
    ///     }
    /// }
    /// # bevy_app::App::new().add_systems(bevy_app::FixedUpdate, thrust);
    /// ```
    pub fn body_mut(&mut self, entity: Entity) -> Option<&mut Body> {
        let handle = self.handle(entity)?;
        self.simulation.world.body_mut(handle)
    }

    /// The body of an entity, or `None` before it entered the world.
    pub fn body(&self, entity: Entity) -> Option<&Body> {
        self.simulation.world.body(self.handle(entity)?)
    }

    /// The report of the last step: times, sweeps, sleeping bodies.
    pub fn stats(&self) -> &StepStats {
        &self.stats
    }

    /// Why the last step failed. The world is then as before the step, and the next step tries again.
    pub fn error(&self) -> Option<&PhysicsError> {
        self.error.as_ref()
    }

    /// Logs and sends an error.
    pub(crate) fn tell(&self, entity: Option<Entity>, text: String, errors: &mut MessageWriter<PhysicsError>) {
        let error = PhysicsError { entity, text };
        log::error!("{error}");
        errors.write(error);
    }
}
