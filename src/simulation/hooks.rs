//! The caller's code that refuses pairs and changes contacts within a step.

use glam::Vec3;

use super::events::ColliderOf;
use super::stages::{Stages, collider_of};
use crate::collide::{MAX_POINTS, Manifold, Pair};
use crate::config::SolverConfig;
use crate::error::Result;
use crate::panics::blaming;
use crate::problem::check_material;
use crate::world::{Body, Material, World};

/// Decides within a step which colliders touch, and how. See [`Simulation::set_hooks`](crate::Simulation::set_hooks).
///
/// Calls come one after another, in an order that depends neither on threads nor on lanes. Runs keep their bits if the
/// answers depend only on the arguments and on state of the hooks that only these calls change. Such state is not part
/// of a snapshot or of saved bytes: save and restore it together with the simulation. A step can call the hooks more
/// than once for a pair, for example when a body wakes, and
/// [`Simulation::next_problem`](crate::Simulation::next_problem) calls them too.
///
/// A panic of a hook is an error of the step ([`Error::Panicked`](crate::Error::Panicked)), which leaves the world as
/// it was.
///
/// ```
/// use drystone::{Body, BodyHandle, ColliderOf, ContactHooks, PendingContact, Shape, Simulation, World};
/// use drystone::glam::Vec3;
///
/// /// Bodies with a common name pass through each other, and the floor is icy where x is above 0.
/// struct Rules;
///
/// impl ContactHooks for Rules {
///     fn may_touch(&mut self, world: &World, a: ColliderOf, b: ColliderOf) -> bool {
///         let [a, b] = [a, b].map(|side| world.body(side.body).expect("it is there"));
///         a.name.is_empty() || a.name != b.name
///     }
///
///     fn modify(&mut self, _: &World, contact: &mut PendingContact) {
///         if contact.points()[0].position.x > 0.0 {
///             contact.friction = 0.0;
///         }
///     }
/// }
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let slider = || Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).velocity(Vec3::X, Vec3::ZERO);
/// let [rough, icy] = [-10.0, 10.0].map(|x| world.insert(slider().position(x, 0.5, 0.0)));
/// let ghost = world.insert(slider().named("ghost").position(20.0, 0.5, 0.0));
/// world.insert(slider().named("ghost").position(20.5, 0.5, 0.0));
/// let mut simulation = Simulation::new(world)?;
/// simulation.set_hooks(Some(Box::new(Rules)));
/// (0..30).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// let speed = |body: BodyHandle| simulation.world.bodies[body].linear_velocity.x;
/// assert!(speed(rough).abs() < 1e-3 && (speed(icy) - 1.0).abs() < 1e-3 && (speed(ghost) - 1.0).abs() < 1e-3);
/// # Ok::<(), drystone::Error>(())
/// ```
pub trait ContactHooks: Send + Sync {
    /// Whether two colliders may touch in this step. `a` belongs to the body with the smaller index. Before a step
    /// computes contacts, it asks for every pair whose boxes overlap and that has an awake or moving body. A refused
    /// pair costs nothing more, and its bodies pass through each other at any speed. Groups and joints are checked
    /// first, and sensors are never asked. By default all pairs may touch.
    fn may_touch(&mut self, world: &World, a: ColliderOf, b: ColliderOf) -> bool {
        let _ = (world, a, b);
        true
    }

    /// Changes a contact before the step solves it: its friction, rolling and spinning friction, restitution and surface
    /// velocity, and which of its points act. Each step calls it for every contact of an awake body, even if the surfaces
    /// are only near, with the values from the materials. A contact with dropped points is computed anew in every step,
    /// and does not come to rest as well as a reused contact.
    fn modify(&mut self, world: &World, contact: &mut PendingContact) {
        let _ = (world, contact);
    }
}

/// A contact that a step has found but not yet solved, over one pair of convex parts: see [`ContactHooks::modify`].
///
/// ```
/// use drystone::{Body, BodyHandle, ContactHooks, PendingContact, PendingPoint, Shape, Simulation, World};
/// use drystone::glam::Vec3;
///
/// /// A platform holds what comes down on it.
/// struct OneWay(BodyHandle);
///
/// impl ContactHooks for OneWay {
///     fn modify(&mut self, world: &World, contact: &mut PendingContact) {
///         let [a, b] = [contact.a.body, contact.b.body];
///         let other = if a == self.0 { b } else { a };
///         if [a, b].contains(&self.0) && world.bodies[other].linear_velocity.y > 0.0 {
///             contact.points_mut().iter_mut().for_each(|point: &mut PendingPoint| point.is_dropped = true);
///         }
///     }
/// }
///
/// let mut world = World { gravity: Vec3::ZERO, ..World::new() };
/// let platform = world.insert(Body::fixed().shape(Shape::cuboid(2.0, 0.1, 2.0)));
/// let ball = |y: f32| Body::dynamic().shape(Shape::ball(0.2)).position(0.0, y, y);
/// let [rises, falls] = [(-1.0, 2.0), (1.0, -2.0)].map(|(y, v)| world.insert(ball(y).velocity(Vec3::Y * v, Vec3::ZERO)));
/// let mut simulation = Simulation::new(world)?;
/// simulation.set_hooks(Some(Box::new(OneWay(platform))));
/// (0..60).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// assert!((simulation.world.bodies[rises].position.y - 1.0).abs() < 1e-3);
/// assert!((simulation.world.bodies[falls].position.y - 0.3).abs() < 1e-3);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PendingContact {
    /// The collider that the normal points away from.
    pub a: ColliderOf,
    /// The collider that the normal points to.
    pub b: ColliderOf,
    /// Unit normal from a to b, world axes. A change has no effect.
    pub normal: Vec3,
    /// Coulomb coefficient, 0 or more. The step fails if it is out of range.
    pub friction: f32,
    /// Ratio of separation to approach velocity, 0 to 1. The step fails if it is out of range.
    pub restitution: f32,
    /// Lever of rolling friction (m), 0 or more: see [`Material::rolling_friction`].
    pub rolling_friction: f32,
    /// Lever of spinning friction (m), 0 or more.
    pub spinning_friction: f32,
    /// Velocity of b's surface relative to a's, beyond that of the bodies, world axes (m/s): see
    /// [`Material::surface_velocity`].
    pub surface_velocity: Vec3,
    points: [PendingPoint; MAX_POINTS],
    count: usize,
}

/// One point of a [`PendingContact`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PendingPoint {
    /// Midway between the surfaces (m). A change has no effect.
    pub position: Vec3,
    /// Distance along the normal, negative for overlap (m). A change has no effect.
    pub separation: f32,
    /// Whether the step ignores this point. A contact does not touch if all its points are dropped.
    pub is_dropped: bool,
}

impl PendingContact {
    fn of(world: &World, pair: &Pair, manifold: &Manifold, material: Material) -> Self {
        let bodies = [pair.body_a, pair.body_b];
        let mut points = [PendingPoint::default(); MAX_POINTS];
        for (point, found) in points.iter_mut().zip(manifold.points()) {
            let at = |side: usize, anchor: Vec3| {
                let body = &world.bodies[bodies[side] as usize];
                body.position + body.rotation * anchor
            };
            let (on_a, on_b) = (at(0, found.anchor_a), at(1, found.anchor_b));
            point.position = on_a.midpoint(on_b);
            point.separation = (on_b - on_a).dot(manifold.normal);
        }
        let [a, b] = [0, 1].map(|side| collider_of(world, (bodies[side], pair.colliders[side])));
        let Material { friction, restitution, rolling_friction, spinning_friction, surface_velocity, .. } = material;
        Self {
            a,
            b,
            normal: manifold.normal,
            friction,
            restitution,
            rolling_friction,
            spinning_friction,
            surface_velocity,
            points,
            count: manifold.points().len(),
        }
    }

    /// The contact points, 1 to 4.
    pub fn points(&self) -> &[PendingPoint] {
        &self.points[..self.count]
    }

    /// The contact points, for changes.
    pub fn points_mut(&mut self) -> &mut [PendingPoint] {
        &mut self.points[..self.count]
    }
}

/// The changes that hooks made in a step.
#[derive(Clone, Copy, Default)]
pub(super) struct Modified {
    /// Whether points were dropped.
    pub points: bool,
    /// Whether the material of a contact differs from that of the step before.
    pub materials: bool,
}

impl Stages {
    /// Lets hooks change the contacts that take part in the step. Without hooks, contacts get their own materials back.
    ///
    /// # Errors
    /// A material is out of range.
    pub(super) fn modify_contacts(
        &mut self,
        world: &World,
        config: &SolverConfig,
        hooks: Option<&mut (dyn ContactHooks + 'static)>,
    ) -> Result<Modified> {
        let Self { detector, contacts, .. } = self;
        let mut modified = Modified::default();
        let Some(hooks) = hooks else {
            modified.materials = contacts.forget_hooked();
            return Ok(modified);
        };
        contacts.begin_hooked();
        for place in detector.taking_part() {
            let pair = detector.pair(place[0], place[1]);
            let mut kept = Vec::new();
            let mut is_reused = true;
            for manifold in &pair.manifolds {
                let bodies = [pair.body_a, pair.body_b];
                let material = Body::contact_material(bodies.map(|i| &world.bodies[i as usize]), pair.colliders);
                let mut contact = PendingContact::of(world, pair, manifold, material);
                blaming(bodies, || hooks.modify(world, &mut contact));
                let PendingContact {
                    friction, restitution, rolling_friction, spinning_friction, surface_velocity, ..
                } = contact;
                let hooked = Material {
                    friction,
                    restitution,
                    rolling_friction,
                    spinning_friction,
                    surface_velocity,
                    ..material
                };
                hooked.check().and_then(|()| check_material(config, &hooked)).map_err(|error| {
                    let [a, b] = bodies.map(|i| world.name_of(i as usize));
                    error.within(format_args!("the hooks, of the contact of {a} and {b}"))
                })?;
                modified.materials |= contacts.set_hooked(manifold.slot, Some(hooked).filter(|now| *now != material));
                is_reused &= contacts.is_reused(manifold.slot);
                kept.push(contact.points.map(|point| !point.is_dropped));
            }
            if kept.iter().zip(&pair.manifolds).any(|(kept, own)| kept[..own.points().len()].contains(&false)) {
                detector.drop_points(place, &kept, is_reused);
                modified.points = true;
            }
        }
        if modified.points {
            contacts.follow(world, detector);
        }
        Ok(modified)
    }
}
