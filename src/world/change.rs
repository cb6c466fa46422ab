//! The difference between two states of a world, as a value. It records the changes that a caller made between two
//! steps.

use glam::{Quat, Vec3};

use super::{Body, Collider, Joints, World};

/// The changes that turn one world into another.
#[derive(Default)]
pub(crate) struct WorldChange {
    gravity: Option<(Vec3, Vec<Option<Vec3>>)>,
    /// The number of indices and the vacant ones, if a body was added or removed.
    places: Option<(u32, Vec<Vec<u32>>)>,
    /// Bodies that were added or removed, or that differ in more than their motion.
    bodies: Vec<BodyChange>,
    /// Bodies that differ only in their motion, by index.
    motions: Vec<(u32, Motion)>,
    joints: Option<Joints>,
}

crate::saved::fields!(WorldChange { gravity, places, bodies, motions, joints });

/// A replaced, added or removed body.
struct BodyChange {
    index: u32,
    generation: u32,
    world: u32,
    /// The body without its colliders.
    body: Body,
    /// The colliders, or `None` if they are the same as before.
    colliders: Option<Vec<Collider>>,
}

crate::saved::fields!(BodyChange { index, generation, world, body, colliders });

/// The fields that callers change most often.
#[derive(Clone, Copy)]
struct Motion {
    position: Vec3,
    rotation: Quat,
    linear_velocity: Vec3,
    angular_velocity: Vec3,
    /// The lasting force and torque, then the force and torque for the next step only.
    loads: [Vec3; 4],
}

crate::saved::fields!(Motion { position, rotation, linear_velocity, angular_velocity, loads });

impl Motion {
    fn of(body: &Body) -> Self {
        Self {
            position: body.position,
            rotation: body.rotation,
            linear_velocity: body.linear_velocity,
            angular_velocity: body.angular_velocity,
            loads: [body.force, body.torque, body.applied_force, body.applied_torque],
        }
    }

    fn bits(self) -> [u32; 25] {
        let Self { position, rotation, linear_velocity, angular_velocity, loads: [a, b, c, d] } = self;
        let mut bits = [0; 25];
        let vectors = [position, linear_velocity, angular_velocity, a, b, c, d];
        let numbers = rotation.to_array().into_iter().chain(vectors.into_iter().flat_map(|v| v.to_array()));
        bits.iter_mut().zip(numbers).for_each(|(bits, number)| *bits = number.to_bits());
        bits
    }

    fn give(&self, body: &mut Body) {
        (body.position, body.rotation) = (self.position, self.rotation);
        (body.linear_velocity, body.angular_velocity) = (self.linear_velocity, self.angular_velocity);
        [body.force, body.torque, body.applied_force, body.applied_torque] = self.loads;
    }
}

impl WorldChange {
    /// The changes from one world to another.
    pub fn between(before: &World, now: &World) -> Self {
        let mut change = Self::default();
        let World { gravity, own_gravity, bodies, joints } = now;
        let same_gravity = (gravity, own_gravity) == (&before.gravity, &before.own_gravity);
        change.gravity = (!same_gravity).then(|| (*gravity, own_gravity.clone()));
        let generations = bodies.generations();
        for (i, body) in bodies.iter().enumerate() {
            let known = before.bodies.get(i).filter(|_| before.bodies.worlds()[i] == bodies.worlds()[i]);
            let known = known.filter(|_| before.bodies.generations()[i] == generations[i]);
            if !known.is_some_and(|known| known.is_same_but_for_motion(body)) {
                let colliders =
                    (!known.is_some_and(|known| known.has_same_colliders(body))).then(|| body.colliders.clone());
                let mut body = body.clone();
                body.colliders.clear();
                let (index, generation, world) = (i as u32, generations[i], bodies.worlds()[i]);
                change.bodies.push(BodyChange { index, generation, world, body, colliders });
            } else if known.is_some_and(|known| Motion::of(known).bits() != Motion::of(body).bits()) {
                change.motions.push((i as u32, Motion::of(body)));
            }
        }
        let same_places = bodies.len() == before.bodies.len() && bodies.vacant == before.bodies.vacant;
        change.places = (!same_places).then(|| (bodies.len() as u32, bodies.vacant.clone()));
        let same_joints = joints.handles() == before.joints.handles() && **joints == *before.joints;
        change.joints = (!same_joints).then(|| joints.clone());
        change
    }

    /// Applies the changes. It skips indices beyond the last body: a change applies to the world that it was computed
    /// from.
    pub fn make(&self, world: &mut World) {
        if let Some((gravity, own_gravity)) = &self.gravity {
            world.gravity = *gravity;
            world.own_gravity.clone_from(own_gravity);
        }
        if let Some((count, vacant)) = &self.places {
            world.bodies.resize(*count as usize);
            world.bodies.vacant.clone_from(vacant);
        }
        for BodyChange { index, generation, world: part, body, colliders } in &self.bodies {
            let Some(there) = world.bodies.get_mut(*index as usize) else { continue };
            let standing = std::mem::take(&mut there.colliders);
            there.clone_from(body);
            there.colliders = colliders.clone().unwrap_or(standing);
            world.bodies.set_place(*index as usize, *generation, *part);
        }
        for (index, motion) in &self.motions {
            if let Some(body) = world.bodies.get_mut(*index as usize) {
                motion.give(body);
            }
        }
        if let Some(joints) = &self.joints {
            world.joints.clone_from(joints);
        }
    }
}
