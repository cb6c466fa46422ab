//! From rows back to bodies and manifolds.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::prepare::Prepared;
use super::{ImpulseRow, StepProblem};
use crate::collide::Pair;
use crate::world::{BodyKind, World};

impl Prepared {
    /// Writes poses and velocities into the world, but for those who are asleep. The impulses of contacts stay in the rows,
    /// where the next step finds them.
    pub fn store(&mut self, problem: &StepProblem, asleep: &[bool], world: &mut World) {
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
        for (&i, row) in self.joint_rows.iter().zip(&problem.joint_impulses) {
            self.joint_impulses[i as usize] = Vec3::from_array(row.linear);
        }
    }

    /// Brings colors, separations and impulses of the rows of `problem` to the manifolds of a pair, unless they were computed
    /// since.
    pub fn give_back(&self, problem: &StepProblem, pair: &mut Pair) {
        if pair.computed_in > self.seen || pair.rests {
            return;
        }
        for (k, manifold) in pair.manifolds.iter_mut().enumerate() {
            let at = pair.contact as usize + k;
            let row = self.row_of[at];
            let contact = &problem.contacts[row as usize];
            manifold.row_before = Some(row);
            let (tangent_1, tangent_2) = contact.tangents();
            let friction = |impulse: &ImpulseRow| tangent_1 * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
            manifold.color = self.edges[at].color;
            manifold.preload = contact.preload;
            let (first, end) = (contact.first_point as usize, (contact.first_point + contact.point_count) as usize);
            let rows = problem.points[first..end].iter().zip(&problem.impulses[first..end]);
            for ((point, (row, impulse)), at) in manifold.points_mut().iter_mut().zip(rows).zip(contact.first_point..) {
                point.row_before = Some(at);
                point.separation = row.separation + contact.preload;
                point.normal_impulse = impulse.normal;
                point.friction_impulse = friction(impulse);
            }
            // With friction per manifold the row after the points is the patch's.
            if self.patches {
                manifold.twist_impulse = problem.impulses[end].normal;
                manifold.friction_impulse = friction(&problem.impulses[end]);
            }
        }
    }
}
