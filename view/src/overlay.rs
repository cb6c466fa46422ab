//! Lines over the picture: contacts, joints and boxes.

use glam::Vec3;

use crate::bounds::Bounds;
use crate::colors::{Rgba, batch_color};
use crate::poses::{Poses, anchors};
use drystone::{BodyKind, Joint, Linear, Simulation, SolvedManifold, World};

/// An end of a line, in the layout of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LineEnd {
    position: [f32; 3],
    color: Rgba,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overlay {
    /// A cross and the normal at every contact point, in the color of the batch.
    pub contacts: bool,
    /// Lines from the center of each body to its joints, and between the anchors.
    pub joints: bool,
    pub boxes: bool,
}

const JOINT: Rgba = [30, 90, 200, 255];
const GAP: Rgba = [220, 30, 30, 255];
const BOX: Rgba = [90, 90, 90, 255];

/// Lines between the anchors of joints that restrict a distance, and from bodies to anchors in the world outside them,
/// as pairs of ends.
pub fn ropes(world: &World, poses: &Poses) -> Vec<LineEnd> {
    let line = |ends: [Vec3; 2]| Some(ends.map(|p| LineEnd { position: p.to_array(), color: BOX }));
    let rope = |j: &Joint| {
        let ends = anchors(j, poses);
        if let Linear::Distance(_) = j.linear {
            return line(ends);
        }
        let ((position, rotation), [_, on_b]) = (poses[j.body_a.index()], ends);
        let body = &world.bodies[j.body_a.index()];
        let is_inside = |(low, high): (Vec3, Vec3)| low.cmple(on_b).all() && on_b.cmple(high).all();
        if j.body_b.is_some() || body.colliders.iter().any(|c| is_inside(c.bounds(position, rotation))) {
            return None;
        }
        line([position + rotation * body.mass.center, on_b])
    };
    world.joints.iter().filter_map(rope).flatten().collect()
}

/// Lines as pairs of ends; crosses and normals have the length `size` (m).
pub fn lines(simulation: &mut Simulation, overlay: Overlay, size: f32) -> Vec<LineEnd> {
    let manifolds: Vec<SolvedManifold> = if overlay.contacts { simulation.manifolds().collect() } else { Vec::new() };
    let world = &simulation.world;
    let mut ends = Vec::new();
    let mut line = |from: Vec3, to: Vec3, color: Rgba| {
        ends.extend([from, to].map(|p| LineEnd { position: p.to_array(), color }));
    };
    for manifold in &manifolds {
        let center = world.bodies[manifold.a.body].center_of_mass();
        let color = manifold.color.map_or(GAP, |c| batch_color(c.into()));
        for point in manifold.points() {
            let at = center + point.r_a;
            line(at, at + size * manifold.normal, color);
            let (u, v) = manifold.normal.any_orthonormal_pair();
            line(at - 0.25 * size * u, at + 0.25 * size * u, color);
            line(at - 0.25 * size * v, at + 0.25 * size * v, color);
        }
    }
    if overlay.joints {
        for joint in &world.joints {
            let [on_a, on_b] = world.anchors(joint);
            line(world.bodies[joint.body_a.index()].center_of_mass(), on_a, JOINT);
            if let Some(b) = joint.body_b {
                line(world.bodies[b.index()].center_of_mass(), on_b, JOINT);
            }
            line(on_a, on_b, GAP);
        }
    }
    if overlay.boxes {
        for body in world.bodies.iter().filter(|b| b.kind != BodyKind::Fixed) {
            for collider in &body.colliders {
                let (low, high) = collider.bounds(body.position, body.rotation);
                let corners = Bounds { low, high }.corners();
                // Corners whose numbers differ in one bit share an edge.
                let edges = (0..8).flat_map(|k| [1, 2, 4].map(|bit| (k, k | bit))).filter(|(k, n)| k != n);
                edges.for_each(|(k, n)| line(corners[k], corners[n], BOX));
            }
        }
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::{Reference, SolverConfig};
    use drystone_scenes::Scene;

    #[test]
    fn every_contact_joint_and_box_has_its_lines() {
        let scene = Scene::find("bridge", &[]).expect("a scene");
        let reference = Box::new(Reference::<f32>::new());
        let mut simulation = Simulation::with(scene.world, SolverConfig::default(), reference).expect("a simulation");
        simulation.step(scene.dt).expect("a step");
        let points: usize = simulation.manifolds().map(|m| m.points().len()).sum();
        assert!(points > 0);
        let world = simulation.world.clone();
        let mut count = |overlay: Overlay| lines(&mut simulation, overlay, 0.1).len() / 2;
        assert_eq!(count(Overlay { contacts: true, ..Overlay::default() }), 3 * points);
        let joints = &world.joints;
        let ends: usize = joints.iter().map(|j| 2 + usize::from(j.body_b.is_some())).sum();
        assert_eq!(count(Overlay { joints: true, ..Overlay::default() }), ends);
        let moving = world.bodies.iter().filter(|b| b.kind != BodyKind::Fixed);
        assert_eq!(
            count(Overlay { boxes: true, ..Overlay::default() }),
            12 * moving.map(|b| b.colliders.len()).sum::<usize>()
        );
        assert_eq!(count(Overlay::default()), 0);
    }
}
