//! Lines that show what physics computes.

use std::collections::BTreeSet;

use bevy_math::{Isometry3d, Vec3};

use crate::physics::Physics;

/// The meaning of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DebugLine {
    /// An edge of a shape.
    Shape,
    /// An edge of a sensor.
    Sensor,
    /// An edge of a shape whose body sleeps.
    Sleeping,
    /// The normal of a contact, 0.1 m long, at a point that presses or overlaps.
    Contact,
    /// From the anchor of a joint on its first body to the anchor on the second.
    Joint,
}

/// The lines of all shapes, contacts and joints, with both ends in the world (m). It copies the surface of every shape:
/// for debugging.
///
/// ```
/// use bevy_drystone::{DebugLine, Physics, debug_lines};
/// use bevy_drystone::drystone::{Body, Shape, Simulation, World};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.5, 0.5)));
/// let physics = Physics::new(Simulation::new(world)?);
/// let lines = debug_lines(&physics);
/// // The edges of 12 triangles.
/// assert_eq!(lines.len(), 18);
/// assert!(lines.iter().all(|(kind, [from, to])| *kind == DebugLine::Shape && from != to));
/// # Ok::<(), bevy_drystone::drystone::Error>(())
/// ```
pub fn debug_lines(physics: &Physics) -> Vec<(DebugLine, [Vec3; 2])> {
    let (simulation, world) = (&physics.simulation, &physics.simulation.world);
    let mut lines = Vec::new();
    for handle in world.bodies.handles() {
        let body = &world.bodies[handle.index()];
        for collider in &body.colliders {
            let kind = match (collider.sensor, simulation.is_asleep(handle)) {
                (true, _) => DebugLine::Sensor,
                (_, true) => DebugLine::Sleeping,
                _ => DebugLine::Shape,
            };
            let own = Isometry3d::new(collider.position, collider.rotation);
            let place = Isometry3d::new(body.position, body.rotation) * own;
            let (vertices, triangles) = collider.shape.triangles();
            let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
            let edges: BTreeSet<_> = edges.map(|[a, b]| [a.min(b), a.max(b)]).collect();
            let ends = |edge: [u32; 2]| edge.map(|end| place * vertices[end as usize]);
            lines.extend(edges.into_iter().map(|edge| (kind, ends(edge))));
        }
    }
    for contact in simulation.contacts() {
        let pressing = contact.points().iter().filter(|point| point.separation <= 0.0);
        lines.extend(
            pressing.map(|point| (DebugLine::Contact, [point.position, point.position + 0.1 * contact.normal])),
        );
    }
    lines.extend(world.joints.iter().map(|joint| (DebugLine::Joint, world.anchors(joint))));
    lines
}
