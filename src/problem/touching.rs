//! The contacts of a step that touch, and those whose surfaces met fast.

use glam::Vec3;

use super::StepProblem;
use super::contacts::ContactRows;
use super::rows::{ContactRow, ImpulseRow};
use crate::world::World;

/// Two colliders of two bodies: the index of each body, and the index of the collider among those of the body.
pub type ColliderPair = [(u32, u32); 2];

/// The fastest approach between the surfaces of one contact in a step.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    /// The colliders. The body with the lower index comes first.
    pub pair: ColliderPair,
    /// Midway between the surfaces when the step begins (m).
    pub point: Vec3,
    /// From the first body to the second.
    pub normal: Vec3,
    /// Speed along the normal when the surfaces meet (m/s).
    pub speed: f32,
    /// Sum of the normal impulses of all points over the step (N s).
    pub impulse: f32,
    /// Speed along the normal with which the surfaces still approach at this point after the step (m/s).
    pub rest: f32,
}

impl ContactRows {
    /// The contacts that touch: at some point, the surfaces press on each other during the step or overlap when it
    /// begins. Contacts at rest keep their state.
    pub fn touching<'a>(&'a self, problem: &'a StepProblem) -> impl Iterator<Item = ColliderPair> + 'a {
        self.taken().filter(|&row| touches(&problem.contacts[row], problem)).map(|row| self.pair(row, problem).0)
    }

    /// The approaches of contacts that carry a load in the step and are `wanted` by their colliders and approach speed.
    /// `world` is the world before the step.
    pub fn approaches<'a>(
        &'a self,
        world: &'a World,
        problem: &'a StepProblem,
        wanted: impl Fn(&ColliderPair, f32) -> bool + 'a,
    ) -> impl Iterator<Item = Approach> + 'a {
        let rows = self.taken().filter(|&row| self.takes_part(row));
        rows.filter_map(move |row| {
            let (pair, is_swapped) = self.pair(row, problem);
            let approach = approach(&problem.contacts[row], world, problem)?;
            let normal = if is_swapped { -approach.normal } else { approach.normal };
            wanted(&pair, approach.speed).then_some(Approach { pair, normal, ..approach })
        })
    }

    /// The colliders of a contact, with the lower body first, and whether this swaps a and b.
    fn pair(&self, row: usize, problem: &StepProblem) -> (ColliderPair, bool) {
        let contact = &problem.contacts[row];
        let [on_a, on_b] = self.colliders_of(row);
        let (a, b) = ((contact.body_a, on_a), (contact.body_b, on_b));
        if a.0 < b.0 { ([a, b], false) } else { ([b, a], true) }
    }
}

impl StepProblem {
    /// Impulse of a contact on its body b, summed over the step, in world axes (N s): normal and friction of all points
    /// and of the patch. Requires the totals of the step.
    pub fn total_impulse(&self, contact: &ContactRow) -> Vec3 {
        let (normal, (tangent_1, tangent_2)) = (Vec3::from_array(contact.normal), contact.tangents());
        let friction = |total: &ImpulseRow| tangent_1 * total.tangent_1 + tangent_2 * total.tangent_2;
        let end = (contact.first_point + contact.point_count) as usize;
        let at_points = self.totals[contact.first_point as usize..end].iter();
        let at_patch = if self.has_friction_at_patches() { friction(&self.totals[end]) } else { Vec3::ZERO };
        at_points.fold(at_patch, |sum, total| sum + (normal * total.normal + friction(total)))
    }
}

/// Whether the surfaces press on each other or overlap.
fn touches(contact: &ContactRow, problem: &StepProblem) -> bool {
    let own = contact.first_point as usize..(contact.first_point + contact.point_count) as usize;
    problem.totals[own.clone()].iter().any(|total| total.normal > 0.0)
        || problem.points[own].iter().any(|point| point.separation <= 0.0)
}

/// The fastest approach among the points with an impulse; `None` if no point has one.
fn approach(contact: &ContactRow, world: &World, problem: &StepProblem) -> Option<Approach> {
    let [a, b] = [contact.body_a, contact.body_b].map(|i| &world.bodies[i as usize]);
    let [pull_a, pull_b] =
        [contact.body_a, contact.body_b].map(|i| Vec3::from_array(problem.masses[i as usize].acceleration));
    let (normal, center) = (Vec3::from_array(contact.normal), a.center_of_mass());
    let own = contact.first_point as usize..(contact.first_point + contact.point_count) as usize;
    let totals = &problem.totals[own.clone()];
    let mut fastest: Option<Approach> = None;
    for (point, _) in problem.points[own].iter().zip(totals).filter(|(_, total)| total.normal > 0.0) {
        let (r_a, r_b) = (Vec3::from_array(point.r_a), Vec3::from_array(point.r_b));
        let u =
            (b.linear_velocity + b.angular_velocity.cross(r_b)) - (a.linear_velocity + a.angular_velocity.cross(r_a));
        let (vn, pull) = (u.dot(normal), (pull_b - pull_a).dot(normal));
        let speed = speed_at_impact(vn, pull, point.separation);
        if fastest.is_none_or(|fastest| speed > fastest.speed) {
            let pair = ColliderPair::default();
            let velocity = |body: u32, r: Vec3| {
                let row = &problem.bodies[body as usize];
                Vec3::from_array(row.v) + Vec3::from_array(row.w).cross(r)
            };
            let rest = (velocity(contact.body_a, r_a) - velocity(contact.body_b, r_b)).dot(normal);
            fastest = Some(Approach { pair, point: center + r_a, normal, speed, impulse: 0.0, rest });
        }
    }
    let impulse = totals.iter().map(|total| total.normal).sum();
    fastest.map(|fastest| Approach { impulse, ..fastest })
}

/// Speed at which surfaces meet (m/s). `vn` is their normal velocity when the step begins, `pull` their relative
/// acceleration along the normal, and `gap` the remaining distance.
fn speed_at_impact(vn: f32, pull: f32, gap: f32) -> f32 {
    let approach = vn.min(0.0);
    (approach * approach - 2.0 * (pull * gap).min(0.0)).sqrt()
}
