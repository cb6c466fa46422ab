//! The events of a step as messages, and as events for observers.

use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_math::Vec3;
use drystone::{ColliderOf, Event, Hit};

use crate::physics::Physics;

/// Two bodies began to touch.
///
/// This event and the others are messages, one for each pair of shapes, and events for observers of each of the two
/// bodies. They come after the step that caused them. Contacts and hits come only if the simulation
/// [listens](drystone::Simulation::listen) to them. Bodies that have no entity cause none.
///
/// ```
/// use bevy_app::prelude::*;
/// use bevy_drystone::prelude::*;
/// use bevy_ecs::prelude::*;
/// use bevy_time::{TimePlugin, TimeUpdateStrategy};
/// use bevy_transform::prelude::*;
///
/// /// How often the bodies touched.
/// #[derive(Resource, Default)]
/// struct Touches(usize);
///
/// let mut app = App::new();
/// app.add_plugins((TimePlugin, DrystonePlugin)).init_resource::<Touches>();
/// app.world_mut().resource_mut::<Physics>().simulation.listen(Listen { contacts: true, ..Listen::default() })?;
/// app.world_mut().spawn((RigidBody::Static, Collider::from(Shape::ball(1.0))));
/// let ball = (RigidBody::Dynamic, Collider::from(Shape::ball(0.5)), Transform::from_xyz(0.0, 1.6, 0.0));
/// app.world_mut().spawn(ball).observe(|touch: On<CollisionStart>, mut touches: ResMut<Touches>| {
///     assert_ne!(touch.entity, touch.other);
///     touches.0 += 1;
/// });
/// app.insert_resource(TimeUpdateStrategy::FixedTimesteps(20));
/// (0..2).for_each(|_| app.update());
/// assert_eq!(app.world().resource::<Touches>().0, 1);
/// # Ok::<(), bevy_drystone::drystone::Error>(())
/// ```
///
/// ```
/// use bevy_drystone::prelude::*;
/// use bevy_ecs::prelude::*;
///
/// fn score(mut enters: MessageReader<SensorEnter>, mut exits: MessageReader<SensorExit>) {
///     let inside = enters.read().count() as i32 - exits.read().count() as i32;
///     println!("{inside} more bodies in sensors");
/// }
///
/// fn hear(mut hits: MessageReader<CollisionHit>) {
///     hits.read().for_each(|hit| println!("{} meets {} at {} m/s", hit.entity, hit.other, hit.speed));
/// }
///
/// fn see(mut ends: MessageReader<CollisionEnd>, mut breaks: MessageReader<JointBreak>) {
///     ends.read().for_each(|end| println!("{} leaves {}", end.entity, end.other));
///     breaks.read().for_each(|joint| println!("{} broke at {} N", joint.entity, joint.force));
/// }
/// # bevy_app::App::new().add_systems(bevy_app::Update, (score, hear, see));
/// ```
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollisionStart {
    /// The body that the observer watches; in a message, the body with the smaller index in the world.
    pub entity: Entity,
    /// The other body.
    pub other: Entity,
    /// The index of the shape in the [`Collider`](crate::Collider) of `entity`.
    pub shape: usize,
    /// The index of the shape in the collider of `other`.
    pub other_shape: usize,
}

/// Two bodies no longer touch, or one of them is gone.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollisionEnd {
    /// The body that the observer watches; in a message, the body with the smaller index in the world.
    pub entity: Entity,
    /// The other body.
    pub other: Entity,
    /// The index of the shape in the [`Collider`](crate::Collider) of `entity`.
    pub shape: usize,
    /// The index of the shape in the collider of `other`.
    pub other_shape: usize,
}

/// Two bodies met faster than [`Listen::hits_above`](drystone::Listen::hits_above).
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq)]
pub struct CollisionHit {
    /// The body that the observer watches; in a message, the body with the smaller index in the world.
    pub entity: Entity,
    /// The other body.
    pub other: Entity,
    /// Where they met (m).
    pub point: Vec3,
    /// Unit normal from `entity` to `other`.
    pub normal: Vec3,
    /// Approach speed along the normal (m/s).
    pub speed: f32,
    /// Normal impulse of the step (N s).
    pub impulse: f32,
}

/// A body began to overlap a sensor. Its event goes to both.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorEnter {
    /// The body that the observer watches; in a message, the sensor.
    pub entity: Entity,
    /// The body with the sensor.
    pub sensor: Entity,
    /// The other body.
    pub visitor: Entity,
}

/// A body no longer overlaps a sensor, or one of the two is gone. A body that flies through a sensor within a step
/// enters and exits after that step.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorExit {
    /// The body that the observer watches; in a message, the sensor.
    pub entity: Entity,
    /// The body with the sensor.
    pub sensor: Entity,
    /// The other body.
    pub visitor: Entity,
}

/// A joint carried more than its break force, and left the world.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq)]
pub struct JointBreak {
    /// The entity of the [`Joint`](crate::Joint).
    pub entity: Entity,
    /// The force that it carried, averaged over the step (N).
    pub force: f32,
}

/// Where events go.
#[derive(SystemParam)]
pub(crate) struct Outbox<'w, 's> {
    starts: MessageWriter<'w, CollisionStart>,
    ends: MessageWriter<'w, CollisionEnd>,
    hits: MessageWriter<'w, CollisionHit>,
    enters: MessageWriter<'w, SensorEnter>,
    exits: MessageWriter<'w, SensorExit>,
    breaks: MessageWriter<'w, JointBreak>,
    there: Query<'w, 's, ()>,
    commands: Commands<'w, 's>,
}

pub(crate) fn register(app: &mut App) {
    app.add_message::<JointBreak>();
    app.add_message::<CollisionStart>().add_message::<CollisionEnd>().add_message::<CollisionHit>();
    app.add_message::<SensorEnter>().add_message::<SensorExit>();
}

/// Sends the events of the step.
pub(crate) fn tell(mut physics: ResMut<Physics>, mut out: Outbox) {
    let physics = &mut *physics;
    for event in physics.simulation.events() {
        let pair = |a: ColliderOf, b: ColliderOf| physics.entity(a.body).zip(physics.entity(b.body));
        match *event {
            Event::Began { a, b } => {
                let Some((entity, other)) = pair(a, b) else { continue };
                let start = CollisionStart { entity, other, shape: a.collider, other_shape: b.collider };
                out.starts.write(start);
                out.trigger(entity, start);
                let (shape, other_shape) = (b.collider, a.collider);
                out.trigger(other, CollisionStart { entity: other, other: entity, shape, other_shape });
            }
            Event::Ended { a, b } => {
                let Some((entity, other)) = pair(a, b) else { continue };
                let end = CollisionEnd { entity, other, shape: a.collider, other_shape: b.collider };
                out.ends.write(end);
                out.trigger(entity, end);
                let (shape, other_shape) = (b.collider, a.collider);
                out.trigger(other, CollisionEnd { entity: other, other: entity, shape, other_shape });
            }
            Event::Hit(Hit { a, b, point, normal, speed, impulse }) => {
                let Some((entity, other)) = pair(a, b) else { continue };
                let hit = CollisionHit { entity, other, point, normal, speed, impulse };
                out.hits.write(hit);
                out.trigger(entity, hit);
                out.trigger(other, CollisionHit { entity: other, other: entity, normal: -normal, ..hit });
            }
            Event::Entered { sensor, visitor } => out.enter(pair(sensor, visitor)),
            Event::Left { sensor, visitor } => out.exit(pair(sensor, visitor)),
            Event::Passed { sensor, visitor, .. } => {
                out.enter(pair(sensor, visitor));
                out.exit(pair(sensor, visitor));
            }
            Event::Broke { joint, force } => {
                let broken = physics.tables.joints.iter().find(|(_, own)| **own == joint);
                let Some(entity) = broken.map(|(entity, _)| *entity) else { continue };
                physics.tables.joints.remove(&entity);
                out.breaks.write(JointBreak { entity, force });
                out.trigger(entity, JointBreak { entity, force });
            }
            _ => {}
        }
    }
    // A step that failed reports nothing yet.
    if physics.error.as_ref().is_none_or(|error| error.entity.is_some()) {
        physics.tables.left.clear();
    }
}

impl Outbox<'_, '_> {
    /// Sends an event to the observers of an entity that is still there.
    fn trigger<'a, E: EntityEvent<Trigger<'a>: Default>>(&mut self, entity: Entity, event: E) {
        if self.there.contains(entity) {
            self.commands.trigger(event);
        }
    }

    fn enter(&mut self, pair: Option<(Entity, Entity)>) {
        let Some((sensor, visitor)) = pair else { return };
        self.enters.write(SensorEnter { entity: sensor, sensor, visitor });
        for entity in [sensor, visitor] {
            self.trigger(entity, SensorEnter { entity, sensor, visitor });
        }
    }

    fn exit(&mut self, pair: Option<(Entity, Entity)>) {
        let Some((sensor, visitor)) = pair else { return };
        self.exits.write(SensorExit { entity: sensor, sensor, visitor });
        for entity in [sensor, visitor] {
            self.trigger(entity, SensorExit { entity, sensor, visitor });
        }
    }
}
