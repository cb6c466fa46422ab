//! From rows back to bodies and manifolds.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::layout::ContactRow;
use super::prepare::{CHUNK, Prepared};
use super::{ImpulseRow, StepProblem};
use crate::collide::{Manifold, Pair};
use crate::world::{BodyKind, World};

/// Most that a manifold is preloaded, relative to the overlap at rest of what it bears.
const LARGEST_PRELOAD: f32 = 2.0;

impl Prepared {
    /// Writes poses and velocities into the world, and impulses into the manifolds that the rows came from.
    pub fn store(&mut self, problem: &StepProblem, world: &mut World, pairs: &mut [Pair]) {
        world.bodies.par_iter_mut().with_min_len(256).zip(&problem.bodies).for_each(|(body, row)| {
            if body.kind == BodyKind::Fixed {
                return;
            }
            let center = body.center_of_mass() + Vec3::from_array(row.dp);
            body.rotation = (Quat::from_array(row.dq) * body.rotation).normalize();
            body.position = center - body.rotation * body.mass.center;
            body.linear_velocity = Vec3::from_array(row.v);
            body.angular_velocity = Vec3::from_array(row.w);
        });
        for (&i, row) in self.joint_coloring.order.iter().zip(&problem.joint_impulses) {
            self.joint_impulses[i as usize] = Vec3::from_array(row.linear);
        }
        let begin = |pair: usize| self.contacts.partition_point(|contact| (contact.0 as usize) < pair);
        pairs.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, pairs)| {
            let first_pair = chunk * CHUNK;
            let own = begin(first_pair)..begin(first_pair + pairs.len());
            for (&(i, k), &row) in self.contacts[own.clone()].iter().zip(&self.row_of[own]) {
                let contact = &problem.contacts[row as usize];
                let (tangent_1, tangent_2) = contact.tangents();
                let friction = |impulse: &ImpulseRow| tangent_1 * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
                let manifold = &mut pairs[i as usize - first_pair].manifolds[k as usize];
                let (first, end) = (contact.first_point as usize, (contact.first_point + contact.point_count) as usize);
                for (point, impulse) in manifold.points_mut().iter_mut().zip(&problem.impulses[first..end]) {
                    point.normal_impulse = impulse.normal;
                    point.friction_impulse = friction(impulse);
                }
                manifold.preload = preload(manifold, contact, problem, self.preload_share);
                // With friction per manifold the row after the points is the patch's.
                if self.patches {
                    manifold.twist_impulse = problem.impulses[end].normal;
                    manifold.friction_impulse = friction(&problem.impulses[end]);
                }
            }
        });
    }
}

/// How much a manifold is preloaded after a step, by the impulses that it bore.
///
/// At rest its springs are compressed by what it bears: the overlap of a soft contact. That much, as a mean over the points, its
/// surfaces are taken to be thicker, little by little, so that the overlap vanishes while the springs stay as soft as they are for
/// everything that is fast: the method of multipliers, with a multiplier for each manifold. One for each point rocks towers.
fn preload(manifold: &Manifold, contact: &ContactRow, problem: &StepProblem, share: f32) -> f32 {
    let moves = |body: u32| problem.masses[body as usize].inv_mass > 0.0;
    let both = moves(contact.body_a) && moves(contact.body_b);
    let compliance = if both { problem.params.movable } else { problem.params.fixed }.compliance();
    let masses = manifold.masses.unwrap_or_default();
    let points = manifold.points();
    let sag: f32 = points.iter().zip(masses).map(|(p, m)| p.normal_impulse * compliance / m.normal).sum();
    let sag = sag / points.len().max(1) as f32;
    // What is borne no more is not held up either.
    (manifold.preload + share * (sag - manifold.preload)).min(LARGEST_PRELOAD * sag)
}
