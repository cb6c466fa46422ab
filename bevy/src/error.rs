//! Errors of physics.

use std::fmt;

use bevy_ecs::prelude::*;

/// An error of a body, a joint or a step, for example because a component is NaN. A refused change leaves the body as
/// it was. A new body or joint enters the world when it is in order. The text is also logged.
///
/// ```
/// use bevy_app::{App, FixedMain};
/// use bevy_drystone::prelude::*;
/// use bevy_ecs::message::Messages;
/// use bevy_math::Vec3;
///
/// let mut app = App::new();
/// app.add_plugins(DrystonePlugin);
/// let ball = (RigidBody::Dynamic, Collider::from(Shape::ball(0.5)), LinearVelocity(Vec3::NAN));
/// let ball = app.world_mut().spawn(ball).id();
/// app.world_mut().run_schedule(FixedMain);
/// let mut errors = app.world_mut().resource_mut::<Messages<PhysicsError>>();
/// let error: PhysicsError = errors.drain().next().expect("it is NaN");
/// assert_eq!(error.entity, Some(ball));
/// assert!(error.text.starts_with("linear velocity = [NaN, NaN, NaN]"), "{error}");
/// ```
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct PhysicsError {
    /// The entity whose component is wrong, or `None` if the step failed as a whole.
    pub entity: Option<Entity>,
    /// The field and its range.
    pub text: String,
}

impl fmt::Display for PhysicsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.entity {
            Some(entity) => write!(f, "entity {entity}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}

impl std::error::Error for PhysicsError {}
