//! A hash of the content of a scene.

use std::fmt::{self, Debug, Write};
use std::hash::Hasher;

use drystone::{BodyHandle, Joint, Material};
use drystone_scenes::Scene;
use fnv::FnvHasher;

/// Feeds text to a hasher.
struct Sink(FnvHasher);

impl Write for Sink {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

/// The part of a joint that the hash reads. For a ball joint it is the format from before other kinds existed, so that
/// old hashes stay valid.
struct Content<'a>(&'a Joint);

impl Debug for Content<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(joint) = *self;
        let mut content = f.debug_struct("Joint");
        content.field("body_a", &joint.body_a.index()).field("body_b", &joint.body_b.map(BodyHandle::index));
        content.field("anchor_a", &joint.anchor_a).field("anchor_b", &joint.anchor_b);
        if !joint.is_ball() {
            content.field("frame_a", &joint.frame_a).field("frame_b", &joint.frame_b);
            content.field("linear", &joint.linear).field("angular", &joint.angular);
        }
        content.field("collide", &joint.collide);
        if !joint.enabled {
            content.field("enabled", &joint.enabled);
        }
        if !joint.is_ball() {
            content.field("break_force", &joint.break_force);
        }
        content.finish()
    }
}

/// 64-bit FNV-1a hash of the bodies, joints, worlds, gravity and step length of a scene, as 16 hexadecimal digits.
/// Names do not count.
pub fn content_hash(scene: &Scene) -> String {
    let mut sink = Sink(FnvHasher::default());
    // Writing to a hasher does not fail. Numbers are written with enough digits to distinguish them.
    let _ = write!(sink, "{:?} {:?}", scene.dt, scene.world.gravity);
    if !scene.world.own_gravity.is_empty() {
        let worlds = 0..scene.world.world_count();
        let _ = write!(sink, "{:?}", worlds.map(|world| scene.world.gravity_of(world)).collect::<Vec<_>>());
    }
    for b in &scene.world.bodies {
        let pose = (b.kind, b.position, b.rotation, b.linear_velocity, b.angular_velocity);
        let Material { friction, restitution, friction_rule, restitution_rule, .. } = b.material;
        let material = format!("Material {{ friction: {friction:?}, restitution: {restitution:?} }}");
        let _ = write!(sink, "{pose:?} {:?} {:?} {material}", b.force, b.mass);
        if (friction_rule, restitution_rule) != (None, None) {
            let _ = write!(sink, "rules {friction_rule:?} {restitution_rule:?}");
        }
        let Material { rolling_friction, spinning_friction, surface_velocity, .. } = b.material;
        if (rolling_friction, spinning_friction) != (0.0, 0.0) {
            let _ = write!(sink, "rolling {rolling_friction:?} {spinning_friction:?}");
        }
        if surface_velocity != drystone::glam::Vec3::ZERO {
            let _ = write!(sink, "surface {surface_velocity:?}");
        }
        // Most scenes have neither torque nor a gravity scale, and keep the hashes that reports contain.
        if (b.torque, b.gravity_scale) != (drystone::glam::Vec3::ZERO, 1.0) {
            let _ = write!(sink, "{:?} {:?}", b.torque, b.gravity_scale);
        }
        if (b.linear_damping, b.angular_damping) != (0.0, 0.0) {
            let _ = write!(sink, "damping {:?} {:?}", b.linear_damping, b.angular_damping);
        }
        if b.locked_rotations != [false; 3] {
            let _ = write!(sink, "locked {:?}", b.locked_rotations);
        }
        if b.locked_translations != [false; 3] {
            let _ = write!(sink, "held {:?}", b.locked_translations);
        }
        if (b.max_linear_speed, b.max_angular_speed) != (f32::INFINITY, f32::INFINITY) {
            let _ = write!(sink, "speeds {:?} {:?}", b.max_linear_speed, b.max_angular_speed);
        }
        if !b.can_sleep {
            let _ = write!(sink, "awake");
        }
        for c in &b.colliders {
            let _ = write!(sink, "{:?} {:?} {:?}", c.shape.parry().as_typed_shape(), c.position, c.rotation);
            if c.sensor {
                let _ = write!(sink, " sensor");
            }
            if let Some(material) = c.material {
                let _ = write!(sink, " {material:?}");
            }
        }
    }
    let joints: Vec<_> = scene.world.joints.iter().map(Content).collect();
    let _ = write!(sink, "{joints:?}");
    if scene.world.world_count() > 1 {
        let _ = write!(sink, "{:?}", scene.world.bodies.worlds());
    }
    format!("{:016x}", sink.0.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_sees_what_a_step_sees() {
        let scene = Scene::find("drop", &[]).unwrap();
        assert_eq!(content_hash(&scene), content_hash(&Scene::find("drop", &[]).unwrap()));
        let changes: [fn(&mut Scene); 20] = [
            |s| s.dt *= 0.5,
            |s| s.world.bodies[3].position.x += 1e-6,
            |s| s.world.bodies[3].force.y = 1e-3,
            |s| s.world.bodies[3].torque.y = 1e-3,
            |s| s.world.bodies[3].gravity_scale = 0.5,
            |s| s.world.bodies[3].angular_damping = 0.5,
            |s| s.world.bodies[3].locked_rotations[1] = true,
            |s| s.world.bodies[3].locked_translations[1] = true,
            |s| s.world.bodies[3].max_linear_speed = 9.0,
            |s| s.world.bodies[3].max_angular_speed = 9.0,
            |s| s.world.bodies[3].can_sleep = false,
            |s| s.world.own_gravity = vec![Some(drystone::glam::Vec3::X)],
            |s| s.world.bodies[3].material.friction = 0.51,
            |s| s.world.bodies[3].material.friction_rule = Some(drystone::CombineRule::Average),
            |s| s.world.bodies[3].material.rolling_friction = 1e-3,
            |s| s.world.bodies[3].material.spinning_friction = 1e-3,
            |s| s.world.bodies[3].material.surface_velocity.z = 1e-3,
            |s| s.world.bodies[3].colliders[0].material = Some(Material::default()),
            |s| s.world.bodies[3].colliders[0].shape = drystone::Shape::ball(0.25),
            |s| s.world.beside(&drystone::World::new()),
        ];
        for change in changes {
            let mut changed = scene.clone();
            change(&mut changed);
            assert_ne!(content_hash(&scene), content_hash(&changed));
        }
        let mut renamed = scene.clone();
        renamed.world.bodies[3].name = "other".into();
        assert_eq!(content_hash(&scene), content_hash(&renamed));
    }
}
