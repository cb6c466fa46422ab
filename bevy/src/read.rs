//! Components go into the world.

use bevy_ecs::prelude::*;
use bevy_transform::components::Transform;
use drystone::Body;

use crate::components::{AngularVelocity, AnyChanged, LinearVelocity, Order, Settings};
use crate::error::PhysicsError;
use crate::physics::{Motion, Physics};

/// Takes over changes of everything but motion. A body that a change would spoil stays as it is.
pub(crate) fn settings(
    mut physics: ResMut<Physics>,
    changed: Query<Entity, AnyChanged>,
    settings: Query<Settings>,
    mut errors: MessageWriter<PhysicsError>,
) {
    let physics = &mut *physics;
    let stripped = std::mem::take(&mut physics.tables.stripped);
    for entity in stripped.into_iter().chain(&changed) {
        let (Some(body), Ok(settings)) = (physics.body_mut(entity), settings.get(entity)) else { continue };
        let changed = settings.apply(body.clone());
        match changed.check() {
            Ok(()) => *body = changed,
            Err(error) => physics.tell(Some(entity), error.to_string(), &mut errors),
        }
    }
}

type Moved = Or<(Changed<Transform>, Changed<LinearVelocity>, Changed<AngularVelocity>)>;

/// Takes over poses and velocities that the program changed. The plugin changes these components too: what is as it
/// left them is no change, so that bodies at rest sleep on, and changes by [`Physics::body_mut`] stay.
pub(crate) fn motion(
    mut physics: ResMut<Physics>,
    moved: Query<(Entity, &Transform, &LinearVelocity, &AngularVelocity), Moved>,
    mut errors: MessageWriter<PhysicsError>,
) {
    let physics = &mut *physics;
    for (entity, transform, linear, angular) in &moved {
        let Some(handle) = physics.handle(entity) else { continue };
        let Some(Some(row)) = physics.tables.rows.get(handle.index()) else { continue };
        let (shown, now) = (row.shown, motion_of(transform, linear, angular));
        if now == shown {
            continue;
        }
        let Some(body) = physics.simulation.world.body_mut(handle) else { continue };
        let before = Motion::of(body);
        let mut after = before;
        if now.position != shown.position {
            after.position = now.position;
        }
        if now.rotation != shown.rotation {
            after.rotation = now.rotation;
        }
        if now.linear != shown.linear {
            after.linear = now.linear;
        }
        if now.angular != shown.angular {
            after.angular = now.angular;
        }
        after.give(body);
        if let Err(error) = body.check() {
            before.give(body);
            physics.tell(Some(entity), error.to_string(), &mut errors);
        }
    }
}

/// Adds the bodies that wait, in their order.
pub(crate) fn bodies(
    mut physics: ResMut<Physics>,
    bodies: Query<(Settings, &Transform, &LinearVelocity, &AngularVelocity, Option<&Order>)>,
    mut errors: MessageWriter<PhysicsError>,
) {
    if physics.tables.new_bodies.is_empty() {
        return;
    }
    let physics = &mut *physics;
    let mut waiting = std::mem::take(&mut physics.tables.new_bodies);
    waiting.sort_by_key(|waiting| bodies.get(waiting.entity).ok().and_then(|body| body.4.copied()).unwrap_or_default());
    waiting.retain_mut(|waiting| {
        let Ok((settings, transform, linear, angular, _)) = bodies.get(waiting.entity) else { return true };
        let motion = motion_of(transform, linear, angular);
        let mut body = settings.apply(Body::fixed());
        motion.give(&mut body);
        match body.check() {
            Ok(()) => {
                let handle = physics.simulation.world.insert(body);
                physics.tables.insert(waiting.entity, handle, motion);
                false
            }
            Err(error) => {
                waiting.tell(physics, error.to_string(), &mut errors);
                true
            }
        }
    });
    physics.tables.new_bodies = waiting;
}

fn motion_of(transform: &Transform, linear: &LinearVelocity, angular: &AngularVelocity) -> Motion {
    Motion { position: transform.translation, rotation: transform.rotation, linear: linear.0, angular: angular.0 }
}
