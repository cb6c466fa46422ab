//! Joints between two entities.

use bevy_ecs::entity::{EntityMapper, MapEntities};
use bevy_ecs::prelude::*;
use bevy_math::Vec3;
use drystone::{Body, BodyHandle, World as Bodies};

use crate::components::Order;
use crate::error::PhysicsError;
use crate::physics::{Physics, Waiting};

/// A joint between two bodies, or between a body and the world. It is a component of an entity of its own, or of one
/// of the two.
///
/// It enters the world with the next step in which both entities have a body, and leaves with this component or with
/// one of its bodies. It enters again if the body comes back. If it breaks ([`JointBreak`](crate::JointBreak)), the
/// component stays, and enters the world again when it is changed.
///
/// ```
/// use bevy_drystone::prelude::*;
/// use bevy_ecs::prelude::*;
/// use bevy_math::Vec3;
///
/// let mut world = World::new();
/// let [wall, door] = [RigidBody::Static, RigidBody::Dynamic].map(|body| world.spawn(body).id());
/// let hinge = Joint::new(door, Vec3::X * -0.5, wall, Vec3::X * 0.1);
/// let hinge = hinge.with(|joint| joint.hinge(Vec3::Y).limited(0.0, 1.5));
/// let hinge = world.spawn(hinge).id();
/// let lamp = world.spawn(RigidBody::Dynamic).id();
/// let rope = world.spawn(Joint::to_world(lamp, Vec3::ZERO, Vec3::Y * 3.0).with(|joint| joint.rope(1.0))).id();
/// # let _ = (hinge, rope);
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[component(map_entities)]
pub struct Joint {
    /// The entity of the first body.
    pub body_a: Entity,
    /// The entity of the second body, or `None` for the world.
    pub body_b: Option<Entity>,
    /// Anchors, axes, limits, motors, springs. The two handles in it do not count.
    pub settings: drystone::Joint,
}

impl Joint {
    /// A ball joint between two bodies, at anchors in their frames (m).
    pub fn new(body_a: Entity, anchor_a: Vec3, body_b: Entity, anchor_b: Vec3) -> Self {
        let [a, b] = [BodyHandle::default(); 2];
        Self { body_a, body_b: Some(body_b), settings: drystone::Joint::new(a, anchor_a, b, anchor_b) }
    }

    /// A ball joint between a body, at an anchor in its frame, and a point of the world (m).
    pub fn to_world(body_a: Entity, anchor_a: Vec3, point: Vec3) -> Self {
        Self { body_a, body_b: None, settings: drystone::Joint::to_world(BodyHandle::default(), anchor_a, point) }
    }

    /// The same with other settings: a kind, limits, a motor.
    #[must_use]
    pub fn with(self, change: impl FnOnce(drystone::Joint) -> drystone::Joint) -> Self {
        Self { settings: change(self.settings), ..self }
    }

    /// The joint of the world.
    ///
    /// # Errors
    /// An entity has no body, both are one, or a number is out of range.
    fn resolve(&self, physics: &Physics) -> Result<drystone::Joint, String> {
        let of = |entity: Entity| {
            physics.handle(entity).ok_or_else(|| format!("connects entity {entity}, which has no body in the world"))
        };
        let (body_a, body_b) = (of(self.body_a)?, self.body_b.map(of).transpose()?);
        // Two bodies whose only joint this is.
        let mut alone = Bodies::new();
        let [a, b] = [(); 2].map(|()| alone.insert(Body::fixed()));
        let other = |entity| if entity == self.body_a { a } else { b };
        alone.insert_joint(drystone::Joint { body_a: a, body_b: self.body_b.map(other), ..self.settings });
        alone.check_joints().map_err(|error| error.to_string().replacen("joint 0: ", "", 1))?;
        Ok(drystone::Joint { body_a, body_b, ..self.settings })
    }
}

impl MapEntities for Joint {
    fn map_entities<E: EntityMapper>(&mut self, mapper: &mut E) {
        self.body_a.map_entities(mapper);
        self.body_b.iter_mut().for_each(|b| b.map_entities(mapper));
    }
}

/// Takes over joints that were added or changed.
pub(crate) fn read(
    mut physics: ResMut<Physics>,
    changed: Query<Entity, Changed<Joint>>,
    joints: Query<(&Joint, Option<&Order>)>,
    mut errors: MessageWriter<PhysicsError>,
) {
    let physics = &mut *physics;
    let mut again = Vec::new();
    for entity in &changed {
        let Some(&handle) = physics.tables.joints.get(&entity) else {
            again.push(entity);
            continue;
        };
        let Ok((joint, _)) = joints.get(entity) else { continue };
        match joint.resolve(physics) {
            Ok(joint) => physics.simulation.world.joint_mut(handle).into_iter().for_each(|own| *own = joint),
            Err(text) => physics.tell(Some(entity), text, &mut errors),
        }
    }
    // Joints that broke and were changed; the order of a query depends on archetypes.
    again.sort_unstable();
    let is_new = |entity: &Entity| physics.tables.new_joints.iter().all(|waiting| waiting.entity != *entity);
    again.retain(is_new);
    physics.tables.new_joints.extend(again.into_iter().map(Waiting::new));

    let mut waiting = std::mem::take(&mut physics.tables.new_joints);
    let order = |entity: Entity| joints.get(entity).ok().and_then(|(_, order)| order.copied()).unwrap_or_default();
    waiting.sort_by_key(|waiting| order(waiting.entity));
    waiting.retain_mut(|waiting| {
        let Ok((joint, _)) = joints.get(waiting.entity) else { return true };
        match joint.resolve(physics) {
            Ok(joint) => {
                let handle = physics.simulation.world.insert_joint(joint);
                physics.tables.joints.insert(waiting.entity, handle);
                false
            }
            Err(text) => {
                waiting.tell(physics, text, &mut errors);
                true
            }
        }
    });
    physics.tables.new_joints = waiting;
}
