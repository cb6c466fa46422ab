//! The contacts of the last step, for callers that borrow the simulation. They use only data on the host, and read
//! nothing from a device.

use glam::Vec3;

use super::events::ColliderOf;
use super::stages::{Stages, collider_of};
use crate::collide::MAX_POINTS;
use crate::world::World;

/// The contact of two colliders over one pair of convex parts, with the impulses of the whole step.
///
/// ```
/// use drystone::{Body, Contact, Listen, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let brick = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
/// let mut simulation = Simulation::new(world)?;
/// simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// (0..10).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// let contact: Contact = simulation.contacts().next().expect("the brick lies on the floor");
/// assert!(contact.touches() && contact.b.body == brick && contact.normal == Vec3::Y);
/// assert!(contact.points().len() == 4 && contact.points().iter().all(|point| point.impulse > 0.0));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The collider that the normal points away from.
    pub a: ColliderOf,
    /// The collider that the normal points to.
    pub b: ColliderOf,
    /// Unit normal from a to b, world axes.
    pub normal: Vec3,
    /// Impulse on b over the whole step: normal and friction of all points (N s). It is zero unless the simulation
    /// [listens](crate::Simulation::listen).
    pub impulse: Vec3,
    points: [ContactPoint; MAX_POINTS],
    count: usize,
}

/// One point of a [`Contact`].
///
/// ```
/// # use drystone::{Body, ContactPoint, Reference, Shape, Simulation, SolverConfig, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(2.0, 0.5, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// simulation.step(1.0 / 60.0)?;
/// let contact = simulation.contacts().next().expect("a ball on the floor");
/// let ContactPoint { position, separation, .. } = contact.points()[0];
/// assert!(position.distance(Vec3::X * 2.0) < 1e-3 && separation.abs() < 1e-6);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactPoint {
    /// Midway between the surfaces, at the present poses of the bodies (m).
    pub position: Vec3,
    /// Distance along the normal at the start of the step, negative for overlap (m).
    pub separation: f32,
    /// Normal impulse on b over the whole step (N s); zero unless the simulation listens.
    pub impulse: f32,
}

impl Contact {
    /// The contact points, 1 to 4.
    pub fn points(&self) -> &[ContactPoint] {
        &self.points[..self.count]
    }

    /// Whether the bodies touch, by the rule of [`Simulation::events`](crate::Simulation::events). Needs a simulation
    /// that listens.
    pub fn touches(&self) -> bool {
        self.points().iter().any(|point| point.impulse > 0.0 || point.separation <= 0.0)
    }
}

/// The contact in a row, or `None` if one of its bodies was removed since the step.
pub(super) fn contact(stages: &Stages, world: &World, row: usize) -> Option<Contact> {
    let Stages { detector, contacts, problem, .. } = stages;
    let (from, [on_a, on_b]) = (problem.contacts.get(row)?, contacts.colliders_of(row));
    let sides = [(from.body_a, on_a), (from.body_b, on_b)];
    if !sides.iter().all(|side| detector.knows(world, side.0 as usize)) {
        return None;
    }
    let manifold = contacts.manifold(row, detector);
    let bodies = sides.map(|side| &world.bodies[side.0 as usize]);
    let (first, count) = (from.first_point as usize, from.point_count as usize);
    let mut points = [ContactPoint::default(); MAX_POINTS];
    for (k, (point, found)) in points.iter_mut().zip(manifold.points()).enumerate() {
        let [on_a, on_b] = [(bodies[0], found.anchor_a), (bodies[1], found.anchor_b)]
            .map(|(body, anchor)| body.position + body.rotation * anchor);
        let impulse = problem.totals.get(first + k).map_or(0.0, |total| total.normal);
        *point =
            ContactPoint { position: on_a.midpoint(on_b), separation: problem.points[first + k].separation, impulse };
    }
    let [a, b] = sides.map(|side| collider_of(world, side));
    let impulse = if problem.totals.is_empty() { Vec3::ZERO } else { problem.total_impulse(from) };
    Some(Contact { a, b, normal: manifold.normal, impulse, points, count })
}
