//! Going back in time.

use bevy_ecs::entity::{EntityHashSet, EntityMapper, MapEntities};
use bevy_ecs::prelude::*;

use crate::components::RigidBody;
use crate::joint::Joint;
use crate::physics::{Physics, Tables, Waiting};
use crate::step;

/// The state of physics between two steps: the simulation, and which entity each body and joint belongs to. One value
/// holds all of it: contacts with their impulses, sleep, settings and events too.
///
/// A game that spawns its entities again when it goes back gives the state their new names by [`MapEntities`].
#[derive(Clone)]
pub struct PhysicsSnapshot {
    state: drystone::Snapshot,
    tables: Tables,
}

impl PhysicsSnapshot {
    /// [`Simulation::hash`](drystone::Simulation::hash) of the state: equal for equal poses and velocities.
    pub fn hash(&self) -> u64 {
        self.state.hash()
    }
}

impl MapEntities for PhysicsSnapshot {
    fn map_entities<E: EntityMapper>(&mut self, mapper: &mut E) {
        let Tables { rows, bodies, joints, new_bodies, new_joints, stripped, left } = &mut self.tables;
        rows.iter_mut().flatten().for_each(|row| row.entity.map_entities(mapper));
        *bodies = bodies.iter().map(|(&entity, &body)| (mapper.get_mapped(entity), body)).collect();
        *joints = joints.iter().map(|(&entity, &joint)| (mapper.get_mapped(entity), joint)).collect();
        new_bodies.iter_mut().chain(new_joints).for_each(|waiting| waiting.entity.map_entities(mapper));
        stripped.iter_mut().for_each(|entity| entity.map_entities(mapper));
        left.iter_mut().for_each(|(_, entity)| entity.map_entities(mapper));
    }
}

impl Physics {
    /// The state between two steps.
    ///
    /// ```
    /// use bevy_app::{App, FixedMain};
    /// use bevy_drystone::{PhysicsSnapshot, prelude::*};
    /// use bevy_ecs::prelude::*;
    ///
    /// let mut app = App::new();
    /// app.add_plugins(DrystonePlugin);
    /// app.world_mut().spawn((RigidBody::Dynamic, Collider::from(Shape::ball(0.5))));
    /// // A step by hand.
    /// let step = |world: &mut World| world.run_schedule(FixedMain);
    /// step(app.world_mut());
    /// let before = app.world().resource::<Physics>().snapshot();
    /// step(app.world_mut());
    /// let after = app.world().resource::<Physics>().snapshot();
    /// assert_ne!(after.hash(), before.hash());
    /// Physics::restore(app.world_mut(), &before);
    /// step(app.world_mut());
    /// let mut again: PhysicsSnapshot = before.clone();
    /// app.world().resource::<Physics>().snapshot_into(&mut again);
    /// assert_eq!(again.hash(), after.hash());
    /// ```
    pub fn snapshot(&self) -> PhysicsSnapshot {
        PhysicsSnapshot { state: self.simulation.snapshot(), tables: self.tables.clone() }
    }

    /// The same, but reuses the memory of another snapshot.
    pub fn snapshot_into(&self, snapshot: &mut PhysicsSnapshot) {
        self.simulation.snapshot_into(&mut snapshot.state);
        snapshot.tables.clone_from(&self.tables);
    }

    /// Goes back to a state, and sets `Transform`, velocities and `Sleeping` of all bodies. Other components are up to
    /// the program: those that it changes back go into the world with the next step, and change nothing if the state
    /// has them already.
    ///
    /// Bodies and joints of the state whose entity, [`RigidBody`] or [`Joint`] is gone leave the world. Those that came
    /// later enter it with the next step, in the order of their first entry. It does nothing without [`Physics`].
    pub fn restore(world: &mut World, snapshot: &PhysicsSnapshot) {
        world.try_resource_scope(|world, mut physics: Mut<Physics>| {
            let Physics { simulation, tables, error, .. } = &mut *physics;
            let later = tables.entities(&simulation.world);
            simulation.restore(&snapshot.state);
            tables.clone_from(&snapshot.tables);
            *error = None;
            let has_body = |entity: &Entity| world.get::<RigidBody>(*entity).is_some();
            let has_joint = |entity: &Entity| world.get::<Joint>(*entity).is_some();
            let [bodies, joints] = tables.entities(&simulation.world);
            for joint in joints.into_iter().filter(|joint| !has_joint(joint)) {
                tables.remove_joint(joint, &mut simulation.world);
            }
            for body in bodies.into_iter().filter(|body| !has_body(body)) {
                tables.remove_body(body, &mut simulation.world);
            }
            let [there, joined] = tables.entities(&simulation.world).map(EntityHashSet::from_iter);
            let [bodies, joints] = later;
            let came = |entity: &Entity| has_body(entity) && !there.contains(entity);
            tables.new_bodies.extend(bodies.into_iter().filter(came).map(Waiting::new));
            let came = |entity: &Entity| has_joint(entity) && !joined.contains(entity);
            tables.new_joints.extend(joints.into_iter().filter(came).map(Waiting::new));
        });
        // It needs the resource, and can do nothing without it.
        drop(world.run_system_cached(step::write));
    }
}
