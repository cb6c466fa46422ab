//! Observers keep the tables of entities.

use bevy_app::App;
use bevy_ecs::prelude::*;

use crate::components::{Optional, RigidBody, Sleeping};
use crate::joint::Joint;
use crate::physics::{Physics, Waiting};

/// Adds the observers that keep the tables, and takes over the bodies and joints that are there.
pub(crate) fn register(app: &mut App) {
    app.add_observer(|added: On<Add<RigidBody>>, mut physics: ResMut<Physics>| {
        physics.tables.new_bodies.push(Waiting::new(added.entity));
    });
    app.add_observer(|removed: On<Remove<RigidBody>>, mut physics: ResMut<Physics>| {
        let Physics { simulation, tables, .. } = &mut *physics;
        tables.remove_body(removed.entity, &mut simulation.world);
    });
    app.add_observer(|added: On<Add<Joint>>, mut physics: ResMut<Physics>| {
        physics.tables.new_joints.push(Waiting::new(added.entity));
    });
    app.add_observer(|removed: On<Remove<Joint>>, mut physics: ResMut<Physics>| {
        let Physics { simulation, tables, .. } = &mut *physics;
        tables.remove_joint(removed.entity, &mut simulation.world);
    });
    app.add_observer(|removed: On<Remove<Optional>>, mut physics: ResMut<Physics>| {
        physics.tables.stripped.push(removed.entity);
    });
    app.add_observer(|removed: On<Remove<Sleeping>>, mut physics: ResMut<Physics>| {
        if let Some(body) = physics.handle(removed.entity) {
            physics.simulation.wake(body);
        }
    });
    let world = app.world_mut();
    let bodies = sorted(world.query_filtered::<Entity, With<RigidBody>>().iter(world));
    let joints = sorted(world.query_filtered::<Entity, With<Joint>>().iter(world));
    let mut physics = world.resource_mut::<Physics>();
    physics.tables.new_bodies.extend(bodies);
    physics.tables.new_joints.extend(joints);
}

fn sorted(entities: impl Iterator<Item = Entity>) -> Vec<Waiting> {
    let mut entities: Vec<_> = entities.collect();
    entities.sort_unstable();
    entities.into_iter().map(Waiting::new).collect()
}
