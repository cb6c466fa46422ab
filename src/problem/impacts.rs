//! Impacts: the contacts whose points are swept together, because surfaces of their island meet at speed.

use glam::Vec3;

use super::StepProblem;
use super::rows::{BodyRow, ContactRow, MassRow};
use super::slots::Slot;
use crate::graph::Islands;
use crate::world::{Body, BodyKind, Joint, World};

/// The contacts that are struck in a step.
#[derive(Debug, Default)]
pub struct Impacts {
    /// Whether the points of each slot's contact are struck together; empty if none are.
    struck: Vec<bool>,
    /// Whether a joint holds each dynamic body; empty without joints, and while no body is fast and no contact
    /// may jam.
    jointed: Vec<bool>,
    /// Whether any part of each body may be faster than half the threshold of restitution in the step.
    fast: Vec<bool>,
    /// The islands of dynamic bodies that touch.
    islands: Islands,
    /// Whether an impact meets the island with each root.
    hit: Vec<bool>,
}

impl Impacts {
    /// Whether the points of any contact are struck together.
    pub fn any(&self) -> bool {
        !self.struck.is_empty()
    }

    /// Whether the points of the contact in a row are struck together.
    pub fn is_struck(&self, row: u32) -> bool {
        self.any() && self.struck[row as usize]
    }

    /// Whether a joint holds a dynamic body of a contact. A joint passes impulses on, so the masses of the two bodies do
    /// not tell the effect of an impulse. Such a contact is swept once, and its points are not struck together.
    pub fn is_jointed(&self, contact: &ContactRow) -> bool {
        holds(&self.jointed, contact)
    }

    /// Marks as struck the contacts of several points in islands where surfaces meet, on average, faster than `threshold`
    /// (m/s). Joints are noted if any body is fast or any contact `may_jam`. Returns whether surfaces may meet faster than
    /// that within the next `dt` seconds.
    pub(super) fn note(
        &mut self,
        slots: &[Slot],
        world: &World,
        [threshold, dt]: [f32; 2],
        may_jam: bool,
        problem: &StepProblem,
    ) -> bool {
        let is_fast = |((row, mass), body): ((&BodyRow, &MassRow), &Body)| {
            let [v, w] = [row.v, row.w].map(Vec3::from);
            // No point of a solid is much farther out than three radii of gyration. A driven body may have no mass.
            let reach = || 9.0 * body.mass.principal_inertia.max_element() / body.mass.mass.max(f32::MIN_POSITIVE);
            let speed = v.length() + dt * Vec3::from(mass.acceleration).length();
            let is_above = |square: f32| 8.0 * square > threshold * threshold;
            is_above(speed * speed)
                || w != Vec3::ZERO && is_above(speed * speed + reach() * w.length_squared())
                || body.kind == BodyKind::Kinematic && body.is_driven()
        };
        self.struck.clear();
        self.fast.clear();
        self.fast.extend(problem.bodies.iter().zip(&problem.masses).zip(&world.bodies).map(is_fast));
        let any_fast = self.fast.contains(&true);
        self.jointed.clear();
        if any_fast || may_jam {
            self.note_joints(world);
        }
        if !any_fast {
            return false;
        }
        let meets = |(slot, contact): (&Slot, &ContactRow)| {
            let is_fast = || [contact.body_a, contact.body_b].iter().any(|&body| self.fast[body as usize]);
            slot.takes_part && is_fast() && approach(problem, contact) > threshold
        };
        self.struck.extend(slots.iter().zip(&problem.contacts).map(meets));
        if self.struck.contains(&true) {
            self.pass_on(slots, world, &problem.contacts);
        }
        if !self.struck.contains(&true) {
            self.struck.clear();
        }
        true
    }

    fn note_joints(&mut self, world: &World) {
        for (a, b) in world.joints.iter().filter(|joint| !joint.holds_nothing()).map(Joint::indices) {
            self.jointed.resize(world.bodies.len(), false);
            for body in [Some(a), b].into_iter().flatten() {
                self.jointed[body] = world.bodies[body].kind == BodyKind::Dynamic;
            }
        }
    }

    /// Goes from the contacts that meet at speed to all contacts of their islands, which pass the impact on. In a column
    /// that falls flat only the lowest contact meets at speed. Swept point by point, the others would topple it.
    fn pass_on(&mut self, slots: &[Slot], world: &World, contacts: &[ContactRow]) {
        let Self { struck, jointed, fast, islands, hit } = self;
        let movable = |contact: &ContactRow| {
            let bodies = [contact.body_a, contact.body_b];
            bodies.map(|body| (world.bodies[body as usize].kind == BodyKind::Dynamic).then_some(body))
        };
        islands.reset(fast.len());
        for (_, contact) in slots.iter().zip(contacts).filter(|(slot, _)| slot.takes_part) {
            if let [Some(a), Some(b)] = movable(contact) {
                islands.join(a, b);
            }
        }
        let roots = islands.roots();
        hit.clear();
        hit.resize(fast.len(), false);
        for (contact, _) in contacts.iter().zip(struck.iter()).filter(|&(_, &is_struck)| is_struck) {
            movable(contact).into_iter().flatten().for_each(|body| hit[roots[body as usize] as usize] = true);
        }
        for ((slot, contact), is_struck) in slots.iter().zip(contacts).zip(struck) {
            let is_hit = || movable(contact).into_iter().flatten().any(|body| hit[roots[body as usize] as usize]);
            *is_struck = slot.takes_part && contact.point_count > 1 && is_hit() && !holds(jointed, contact);
        }
    }
}

/// Whether a joint holds a body of a contact.
fn holds(jointed: &[bool], contact: &ContactRow) -> bool {
    [contact.body_a, contact.body_b].iter().any(|&body| jointed.get(body as usize).is_some_and(|&is_held| is_held))
}

/// The mean speed at which the surfaces of a contact meet (m/s).
fn approach(problem: &StepProblem, contact: &ContactRow) -> f32 {
    let first = contact.first_point as usize;
    let points = &problem.points[first..first + contact.point_count as usize];
    let arms = points.iter().fold([Vec3::ZERO; 2], |[a, b], p| [a + Vec3::from(p.r_a), b + Vec3::from(p.r_b)]);
    let count = points.len() as f32;
    let [a, b] = [(contact.body_a, arms[0]), (contact.body_b, arms[1])].map(|(body, arms)| {
        let BodyRow { v, w, .. } = problem.bodies[body as usize];
        count * Vec3::from(v) + Vec3::from(w).cross(arms)
    });
    (a - b).dot(contact.normal.into()) / count
}
