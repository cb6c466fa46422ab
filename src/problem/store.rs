//! From rows back to bodies.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::StepProblem;
use crate::world::{BodyKind, World};

/// Writes poses and velocities into the world, but for bodies that are asleep. Impulses stay in their rows, where the next step
/// finds them.
pub fn store(problem: &StepProblem, asleep: &[bool], world: &mut World) {
    let bodies = world.bodies.par_iter_mut().with_min_len(256).zip(&problem.bodies);
    bodies.enumerate().for_each(|(i, (body, row))| {
        if body.kind == BodyKind::Fixed || asleep.get(i) == Some(&true) {
            return;
        }
        let center = body.center_of_mass() + Vec3::from_array(row.dp);
        body.rotation = (Quat::from_array(row.dq) * body.rotation).normalize();
        body.position = center - body.rotation * body.mass.center;
        body.linear_velocity = Vec3::from_array(row.v);
        body.angular_velocity = Vec3::from_array(row.w);
    });
}
