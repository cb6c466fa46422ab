//! The world steps, and its poses and velocities go into components.

use bevy_ecs::prelude::*;
use bevy_time::{Fixed, Time};
use bevy_transform::components::Transform;

use crate::components::{AngularVelocity, LinearVelocity, Sleeping};
use crate::error::PhysicsError;
use crate::physics::{Motion, Physics};

/// Steps by the length of the fixed step.
pub(crate) fn step(mut physics: ResMut<Physics>, time: Res<Time<Fixed>>, mut errors: MessageWriter<PhysicsError>) {
    let Physics { simulation, tables, stats, .. } = &mut *physics;
    for row in tables.rows.iter_mut().flatten() {
        row.before = Motion::of(&simulation.world.bodies[row.handle.index()]);
    }
    // Not the time since the last step, which is zero if a program runs the schedule by itself.
    let error = match simulation.step(time.timestep().as_secs_f32()) {
        Ok(done) => {
            *stats = done;
            stats.first_non_finite.map(|body| {
                let text = "its pose or velocity left the finite range".to_owned();
                PhysicsError { entity: tables.entity(body), text }
            })
        }
        Err(error) => Some(PhysicsError { entity: None, text: error.to_string() }),
    };
    // Each step fails until the program does something about it.
    if let Some(error) = error.as_ref().filter(|error| physics.error.as_ref() != Some(error)) {
        physics.tell(error.entity, error.text.clone(), &mut errors);
    }
    physics.error = error;
}

/// Sets the components that differ from the world, and marks those as changed.
pub(crate) fn write(
    mut physics: ResMut<Physics>,
    mut bodies: Query<(&mut Transform, &mut LinearVelocity, &mut AngularVelocity, Has<Sleeping>)>,
    mut commands: Commands,
) {
    let Physics { simulation, tables, .. } = &mut *physics;
    for row in tables.rows.iter_mut().flatten() {
        let index = row.handle.index();
        let now = Motion::of(&simulation.world.bodies[index]);
        row.shown = now;
        let Ok((mut transform, mut linear, mut angular, sleeping)) = bodies.get_mut(row.entity) else { continue };
        if transform.translation != now.position {
            transform.translation = now.position;
        }
        if transform.rotation != now.rotation {
            transform.rotation = now.rotation;
        }
        linear.set_if_neq(LinearVelocity(now.linear));
        angular.set_if_neq(AngularVelocity(now.angular));
        match (simulation.is_asleep(row.handle), sleeping) {
            (true, false) => drop(commands.entity(row.entity).try_insert(Sleeping)),
            (false, true) => drop(commands.entity(row.entity).try_remove::<Sleeping>()),
            _ => {}
        }
    }
}
