//! How what lasts between steps follows what the caller changes between them: the length of a step, settings, joints.

use std::collections::{HashMap, VecDeque};

use super::StepProblem;
use super::prepare::{Prepared, contact_softness};
use crate::config::SolverConfig;
use crate::graph::{Edge, IMMOVABLE};
use crate::world::{BallJoint, BodyKind, World};

/// What the impulses and preloads of a step are proportional to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepScale {
    /// Length of a substep (s). A contact that bears a force passes on the force times this in a substep.
    substep: f32,
    /// Overlap at rest per impulse, times the effective mass, of contacts between bodies that can move (s).
    movable_compliance: f32,
    /// The same of contacts with bodies that cannot (s).
    fixed_compliance: f32,
}

impl StepScale {
    pub fn new(config: &SolverConfig, dt: f32) -> Self {
        let substep = dt / config.substeps as f32;
        let compliance = |ratio| contact_softness(config, substep, ratio).compliance();
        Self {
            substep,
            movable_compliance: compliance(1.0),
            fixed_compliance: compliance(config.fixed_contact_frequency_ratio),
        }
    }
}

/// The quotient, or 1 where nothing is to be divided by.
fn ratio(now: f32, before: f32) -> f32 {
    if before > 0.0 { now / before } else { 1.0 }
}

impl Prepared {
    /// Whether impulses and preloads of the last step belong to substeps of another length or to contacts of another stiffness.
    pub fn is_step_new(&self, config: &SolverConfig, dt: f32) -> bool {
        self.scale.is_some_and(|scale| scale != StepScale::new(config, dt))
    }

    /// Rescales impulses and preloads, so that all contacts and joints bear the same forces in a step of `dt` seconds as in the step
    /// before. A pile that came to rest with 32 substeps rattled at 0.8 m/s without this when it went on with 8.
    pub fn change_step(&mut self, world: &World, config: &SolverConfig, dt: f32, problem: &mut StepProblem) {
        let now = StepScale::new(config, dt);
        let Some(before) = self.scale.replace(now) else { return };
        let forces = ratio(now.substep, before.substep);
        let movable = forces * ratio(now.movable_compliance, before.movable_compliance);
        let fixed = forces * ratio(now.fixed_compliance, before.fixed_compliance);
        let is_dynamic = |body: u32| world.bodies[body as usize].kind == BodyKind::Dynamic;
        for contact in &mut problem.contacts {
            contact.preload *= if is_dynamic(contact.body_a) && is_dynamic(contact.body_b) { movable } else { fixed };
        }
        for impulse in &mut problem.impulses {
            impulse.normal *= forces;
            impulse.tangent_1 *= forces;
            impulse.tangent_2 *= forces;
        }
        for impulse in &mut problem.joint_impulses {
            impulse.linear = impulse.linear.map(|x| x * forces);
        }
    }

    /// Lets the next step write all rows again.
    pub fn write_again(&mut self) {
        self.slots.write_again();
    }

    /// The joints that the rows are of.
    pub fn joints(&self) -> &[BallJoint] {
        &self.joints
    }

    /// Lets all joints choose their colors anew.
    pub fn forget_joint_colors(&mut self) {
        self.joint_edges.iter_mut().for_each(|edge| edge.color = None);
        self.are_joints_colored = false;
    }

    /// Takes over the joints of the world; returns those that began, ended or changed.
    ///
    /// A joint keeps impulse and color wherever it stands in the list: it is the one with the same bodies and anchors, else one
    /// with the same bodies, whose anchors moved.
    pub fn follow_joints(&mut self, world: &World, problem: &mut StepProblem) -> Vec<BallJoint> {
        let (before, now) = (std::mem::take(&mut self.joints), &world.joints);
        let from = matched(&before, now);
        let movable = |b: usize| if world.bodies[b].kind == BodyKind::Dynamic { b as u32 } else { IMMOVABLE };
        let edge = |(joint, from): (&BallJoint, &Option<usize>)| Edge {
            a: movable(joint.body_a),
            b: joint.body_b.map_or(IMMOVABLE, movable),
            color: from.and_then(|i| self.joint_edges[i].color),
            rank: 0,
        };
        let edges: Vec<Edge> = now.iter().zip(&from).map(edge).collect();
        self.are_joints_colored &= edges == self.joint_edges;
        self.joint_edges = edges;
        let impulse =
            |from: &Option<usize>| from.and_then(|i| problem.joint_impulses.get(i).copied()).unwrap_or_default();
        problem.joint_impulses = from.iter().map(impulse).collect();
        let mut ended = vec![true; before.len()];
        from.iter().flatten().for_each(|&i| ended[i] = false);
        let changed = now.iter().zip(&from).filter(|(joint, from)| from.is_none_or(|i| before[i] != **joint));
        let ended = before.iter().zip(&ended).filter(|(_, ended)| **ended);
        let all = changed.map(|(joint, _)| *joint).chain(ended.map(|(joint, _)| *joint)).collect();
        self.joints.clone_from(now);
        all
    }
}

/// Which of the joints before each joint is now.
fn matched(before: &[BallJoint], now: &[BallJoint]) -> Vec<Option<usize>> {
    let in_place = |i: usize| before.get(i).zip(now.get(i)).is_some_and(|(before, now)| before == now);
    let mut from: Vec<Option<usize>> = (0..now.len()).map(|i| in_place(i).then_some(i)).collect();
    let mut free: Vec<usize> = (0..before.len()).filter(|&i| !in_place(i)).collect();
    for with_anchors in [true, false] {
        let key = |joint: &BallJoint| {
            let anchors = [joint.anchor_a, joint.anchor_b].map(|p| p.to_array().map(f32::to_bits));
            (joint.body_a, joint.body_b, with_anchors.then_some(anchors))
        };
        let mut open: HashMap<_, VecDeque<usize>> = HashMap::new();
        free.iter().for_each(|&i| open.entry(key(&before[i])).or_default().push_back(i));
        for (joint, from) in now.iter().zip(&mut from).filter(|(_, from)| from.is_none()) {
            *from = open.get_mut(&key(joint)).and_then(VecDeque::pop_front);
        }
        free = open.into_values().flatten().collect();
        free.sort_unstable();
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn joint(body: usize, anchor: f32) -> BallJoint {
        BallJoint::to_world(body, Vec3::X * anchor, Vec3::ZERO)
    }

    #[test]
    fn a_joint_is_known_by_its_bodies_and_anchors_wherever_it_stands() {
        let before = [joint(0, 0.0), joint(1, 0.0), joint(1, 1.0), joint(2, 0.0)];
        let [a, b, c, d] = before;
        assert_eq!(matched(&before, &before), [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(matched(&before, &[b, c, d]), [Some(1), Some(2), Some(3)]);
        assert_eq!(matched(&before, &[d, c, b, a]), [Some(3), Some(2), Some(1), Some(0)]);
        // One of two between the same bodies moved its anchor.
        assert_eq!(matched(&before, &[a, joint(1, 2.0), c, d]), [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(matched(&before, &[joint(1, 2.0), b, c]), [None, Some(1), Some(2)]);
        // Equal ones are taken in order, each once.
        assert_eq!(matched(&[a, a], &[d, a, a, a]), [None, Some(1), Some(0), None]);
        assert_eq!(matched(&[], &[a]), [None]);
        // Of many whose anchors all moved, each is the one in its place.
        let many = |from: f32| (0..40).map(|i| joint(1, from + i as f32)).collect::<Vec<_>>();
        assert_eq!(matched(&many(0.0), &many(100.0)), (0..40).map(Some).collect::<Vec<_>>());
    }
}
