//! The scalar backend, handles of bodies, and the state of bodies as bits. Each set of tests uses a part of it.
#![allow(dead_code)]

use drystone::glam::Vec3;
use drystone::world::Bodies;
use drystone::{Backend, Body, BodyHandle, Reference, Simulation, World};

/// Opens the scalar backend.
pub fn reference() -> Box<dyn Backend> {
    Box::new(Reference::<f32>::new())
}

/// The handle of the first body at an index, in any world, also in one that has no such body.
pub fn handle(index: usize) -> BodyHandle {
    let bodies: Bodies = (0..=index).map(|_| Body::fixed()).collect();
    bodies.handle(index).expect("a body")
}

/// Every bit of the pose and the velocity of a body.
pub fn bits_of(body: &Body) -> [u32; 13] {
    let ([px, py, pz], [vx, vy, vz]) = (body.position.to_array(), body.linear_velocity.to_array());
    let ([wx, wy, wz], [qx, qy, qz, qw]) = (body.angular_velocity.to_array(), body.rotation.to_array());
    [px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz].map(f32::to_bits)
}

/// The same of some bodies of a world.
pub fn bits(world: &World, bodies: impl IntoIterator<Item = usize>) -> Vec<[u32; 13]> {
    bodies.into_iter().map(|i| bits_of(&world.bodies[i])).collect()
}

/// The same of all bodies of a world.
pub fn all_bits(world: &World) -> Vec<[u32; 13]> {
    bits(world, 0..world.bodies.len())
}

/// The impulses of all joints in the last substep (N s); zero of those that took part in none.
pub fn joint_impulses(simulation: &Simulation) -> Vec<Vec3> {
    let joints = simulation.world.joints.handles().iter();
    joints.map(|&joint| simulation.joint_impulse(joint).unwrap_or_default()).collect()
}

/// The same of their angular impulses (N m s).
pub fn joint_angular_impulses(simulation: &Simulation) -> Vec<Vec3> {
    let joints = simulation.world.joints.handles().iter();
    joints.map(|&joint| simulation.joint_angular_impulse(joint).unwrap_or_default()).collect()
}
