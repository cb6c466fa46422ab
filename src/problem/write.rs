//! The content of the rows of contacts: written from a manifold when it is computed, and kept from step to step while it is reused.
//!
//! Normal, tangents, arms and effective masses of a reused manifold stay, and so do its impulses; only the separations
//! follow the bodies. The bodies of a reused manifold turned by 0.03 rad at most, and unequal moments of inertia turned with
//! them: what that changes in the masses is left out, as it is in the arms.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::carry::{Carry, preloaded};
use super::effective::{EffectiveMass, InverseMass};
use super::points_a_slot;
use super::rescale::{change_compliance, change_share};
use super::rows::{BodyRow, ContactRow, ImpulseRow, MassRow, PointRow};
use super::slots::{Slot, Write};
use crate::collide::{Detector, MAX_POINTS, Manifold, ManifoldPoint, Motion, Pair};
use crate::config::{FrictionRule, SolverConfig};
use crate::effort::Effort;
use crate::math::{self, reciprocal};
use crate::world::World;

/// The sources of the rows of contacts.
pub(super) struct Writer<'a> {
    pub world: &'a World,
    pub detector: &'a Detector,
    pub config: &'a SolverConfig,
    pub effort: &'a Effort,
    /// Length of a substep of class 0 (s).
    pub substep: f32,
    pub bodies: &'a [BodyRow],
    pub masses: &'a [MassRow],
    /// The coefficients of the preloads, and whether a device computes preloads and impulses.
    pub carry: &'a Carry,
    /// Whether a patch follows the points of every contact.
    pub patches: bool,
}

/// The rows of one slot.
struct SlotRows<'a> {
    contact: &'a mut ContactRow,
    points: &'a mut [PointRow],
    impulses: &'a mut [ImpulseRow],
    /// Separation of each point when its manifold was computed (m).
    computed: &'a mut [f32],
    sag: &'a mut f32,
}

/// Slots that one task writes.
const SLOTS_A_TASK: usize = 256;

impl Writer<'_> {
    /// Writes the rows of all slots, on all threads.
    pub fn write(
        &self,
        slots: &[Slot],
        contacts: &mut [ContactRow],
        points: &mut [PointRow],
        impulses: &mut [ImpulseRow],
        computed: &mut [f32],
        sags: &mut [f32],
    ) {
        let stride = points_a_slot(self.patches);
        let points = points.par_chunks_mut(SLOTS_A_TASK * stride).zip(impulses.par_chunks_mut(SLOTS_A_TASK * stride));
        let computed = computed.par_chunks_mut(SLOTS_A_TASK * MAX_POINTS).zip(sags.par_chunks_mut(SLOTS_A_TASK));
        let rows = contacts.par_chunks_mut(SLOTS_A_TASK).zip(points).zip(computed);
        slots.par_chunks(SLOTS_A_TASK).zip(rows).enumerate().for_each(
            |(chunk, (slots, ((contacts, (points, impulses)), (computed, sags))))| {
                // Far away in memory: these reads come first, so that none waits for another.
                let mut motions = [Motion::default(); SLOTS_A_TASK];
                for (motion, slot) in motions.iter_mut().zip(slots).filter(|(_, slot)| slot.takes_part) {
                    *motion = *self.detector.motion(slot.world, slot.pair);
                }
                let points = points.chunks_mut(stride).zip(impulses.chunks_mut(stride));
                let rows = contacts.iter_mut().zip(points).zip(computed.chunks_mut(MAX_POINTS).zip(sags));
                for (i, ((slot, motion), ((contact, (points, impulses)), (computed, sag)))) in
                    slots.iter().zip(&motions).zip(rows).enumerate()
                {
                    contact.first_point = ((chunk * SLOTS_A_TASK + i) * stride) as u32;
                    self.write_slot(slot, motion, SlotRows { contact, points, impulses, computed, sag });
                }
            },
        );
    }

    fn write_slot(&self, slot: &Slot, motion: &Motion, rows: SlotRows) {
        let SlotRows { contact, points, impulses, computed, sag } = rows;
        if slot.write != Write::Separations {
            let pair = self.detector.pair(slot.world, slot.pair);
            let manifold = &pair.manifolds[slot.manifold as usize];
            let before = *contact;
            self.write_header(contact, slot.write, pair, manifold);
            self.write_points(contact, manifold, motion, points, computed);
            if !self.carry.on_device {
                self.bring_impulses(slot.write, &before, contact, manifold, impulses);
            }
        } else if slot.takes_part {
            self.refresh_points(contact, motion, points, computed);
        }
        if slot.takes_part {
            let share = self.share(contact);
            let is_new = contact.substep_share == 0.0;
            if share != contact.substep_share {
                change_share(contact, share, points, impulses);
            }
            let [body_a, body_b] = [contact.body_a, contact.body_b].map(|body| body as usize);
            let [was, is] = [Effort::was_in_heap, Effort::is_in_heap]
                .map(|in_heap| in_heap(self.effort, body_a) || in_heap(self.effort, body_b));
            if was != is && !is_new {
                let both = self.masses[body_a].inv_mass > 0.0 && self.masses[body_b].inv_mass > 0.0;
                let [was, is] = [was, is].map(|in_heap| self.carry.preload.compliance(both, in_heap));
                change_compliance(contact, is * reciprocal(was), points);
            }
        }
        // Where the rows are on a device, the kernel begin_contacts does this.
        if slot.takes_part && !self.carry.on_device {
            let (preload, load) = self.loaded(contact, points, impulses);
            (contact.preload, *sag) = (preload, load);
            let warm_start = self.carry.preload.warm_start != 0;
            let begun =
                |i: &ImpulseRow| if warm_start { ImpulseRow { peak: 0.0, ..*i } } else { ImpulseRow::default() };
            impulses.iter_mut().for_each(|i| *i = begun(i));
        }
    }

    fn write_header(&self, row: &mut ContactRow, write: Write, pair: &Pair, manifold: &Manifold) {
        let [a, b] = [pair.body_a, pair.body_b].map(|i| &self.world.bodies[i as usize]);
        let material = a.material.combine(b.material);
        *row = ContactRow {
            friction: if self.config.friction_rule() == FrictionRule::None { 0.0 } else { material.friction },
            restitution: material.restitution,
            body_a: pair.body_a,
            body_b: pair.body_b,
            first_point: row.first_point,
            point_count: manifold.points().len() as u32,
            radius_a: manifold.radius_a,
            radius_b: manifold.radius_b,
            preload: if write == Write::New { 0.0 } else { row.preload },
            substep_share: if write == Write::New { 0.0 } else { row.substep_share },
            ..ContactRow::framed(manifold.normal)
        };
    }

    fn write_points(
        &self,
        row: &ContactRow,
        manifold: &Manifold,
        motion: &Motion,
        points: &mut [PointRow],
        computed: &mut [f32],
    ) {
        let inverse = [row.body_a, row.body_b].map(|i| InverseMass::of(&self.masses[i as usize]));
        let effective = EffectiveMass { inverse: &inverse, row };
        for ((p, point), computed) in manifold.points().iter().zip(&mut *points).zip(&mut *computed) {
            let tangent_mass = match self.config.friction_rule() {
                FrictionRule::Box | FrictionRule::Disc => effective.tangent(p.r_a, p.r_b),
                FrictionRule::None | FrictionRule::Slip => 0.0,
            };
            // Normal impulse and friction in turn swing about their solution where friction lifts more than the impulse does. Shorter
            // steps end that.
            let jamming = effective.jamming(p.r_a, p.r_b);
            let normal_step = if jamming > 1.0 { 1.0 / (1.0 + jamming) } else { 1.0 };
            *computed = p.separation;
            *point = PointRow {
                r_a: p.r_a.to_array(),
                r_b: p.r_b.to_array(),
                normal_mass: effective.normal(p.r_a, p.r_b) * normal_step,
                tangent_mass,
                ..PointRow::default()
            };
        }
        self.refresh_points(row, motion, points, computed);
        if self.patches {
            let (points, patch) = points.split_at_mut(manifold.points().len());
            patch[0] = patch_of(&effective, points);
        }
    }

    /// Brings the impulses of a slot to the points that its manifold has now, and to its tangents. Double of the function of the same
    /// name in `shaders/resident/write_contacts.wgsl`.
    fn bring_impulses(
        &self,
        write: Write,
        before: &ContactRow,
        now: &ContactRow,
        manifold: &Manifold,
        impulses: &mut [ImpulseRow],
    ) {
        let mut old = [ImpulseRow::default(); MAX_POINTS + 1];
        if write != Write::New {
            old[..impulses.len()].copy_from_slice(impulses);
        }
        impulses.fill(ImpulseRow::default());
        for ((k, point), impulse) in manifold.points().iter().enumerate().zip(&mut *impulses) {
            if let Some(from) = point_before(write, k, point) {
                *impulse = retangented(before, now, &old[from as usize]);
            }
        }
        if self.patches {
            impulses[manifold.points().len()] = retangented(before, now, &old[before.point_count as usize]);
        }
    }

    /// Brings the separations of a manifold to where the bodies are, from those that were computed.
    fn refresh_points(&self, row: &ContactRow, motion: &Motion, points: &mut [PointRow], computed: &[f32]) {
        let movement = motion.along(row.normal, [row.radius_a, row.radius_b]);
        for (point, computed) in points[..row.point_count as usize].iter_mut().zip(computed) {
            point.separation = computed + movement.between(math::Vec3::load(point.r_a), math::Vec3::load(point.r_b));
            self.approach(row, point);
        }
    }

    /// The length of a contact's substeps over that of class 0.
    fn share(&self, row: &ContactRow) -> f32 {
        let is_movable = |body: u32| self.masses[body as usize].inv_mass > 0.0;
        self.effort.share(if is_movable(row.body_a) { row.body_a } else { row.body_b } as usize)
    }

    /// The preload of a contact, and how deep its bodies sag, by the impulses that it bore in the step before.
    fn loaded(&self, row: &ContactRow, points: &[PointRow], impulses: &[ImpulseRow]) -> (f32, f32) {
        let [a, b] = [row.body_a, row.body_b].map(|body| self.masses[body as usize].inv_mass);
        let (mut pressed, mut mass) = (0.0, 0.0);
        for (point, impulse) in points[..row.point_count as usize].iter().zip(impulses) {
            pressed += impulse.normal;
            mass += point.normal_mass;
        }
        let in_heap = [row.body_a, row.body_b].into_iter().any(|body| self.masses[body as usize].heap > 0.0);
        let yielding = self.carry.preload.yielding(row.substep_share, a > 0.0 && b > 0.0, in_heap, pressed);
        (preloaded(&self.carry.preload, in_heap, row.preload, yielding * reciprocal(mass)), yielding * (a + b))
    }

    /// The velocities of a row when the step begins: the velocity of the approach where it may bounce, and the direction
    /// of the slip where friction has one only.
    fn approach(&self, row: &ContactRow, point: &mut PointRow) {
        if !self.carry.approach {
            return;
        }
        let (r_a, r_b) = (Vec3::from_array(point.r_a), Vec3::from_array(point.r_b));
        let [a, b] = [row.body_a, row.body_b].map(|i| &self.bodies[i as usize]);
        let masses = [row.body_a, row.body_b].map(|i| &self.masses[i as usize]);
        let velocity = |body: &BodyRow, r: Vec3| Vec3::from_array(body.v) + Vec3::from_array(body.w).cross(r);
        let u = velocity(b, r_b) - velocity(a, r_a);
        let normal = Vec3::from_array(row.normal);
        let [pull_a, pull_b] = masses.map(|m| Vec3::from_array(m.acceleration));
        let pull = (pull_b - pull_a).dot(normal);
        point.approach_velocity =
            velocity_at_impact(u.dot(normal), pull, point.separation, self.substep * self.share(row), row.restitution);
        if self.config.friction_rule() == FrictionRule::Slip && !self.patches {
            let (tangent_1, tangent_2) = row.tangents();
            // A point that does not slip yet takes the first tangent.
            let slip = Vec2::new(u.dot(tangent_1), u.dot(tangent_2)).try_normalize().unwrap_or(Vec2::X);
            [point.slip_1, point.slip_2] = slip.to_array();
            let effective = EffectiveMass { inverse: &masses.map(InverseMass::of), row };
            point.tangent_mass = effective.along(r_a, r_b, tangent_1 * slip.x + tangent_2 * slip.y);
        }
    }
}

/// Which of the points that a slot had is this one, the point `k` of its manifold.
pub(super) fn point_before(write: Write, k: usize, point: &ManifoldPoint) -> Option<u8> {
    match write {
        Write::Separations | Write::Rows => Some(k as u8),
        Write::Computed => point.before,
        Write::New => None,
    }
}

/// An impulse along the tangents that a manifold has now. Friction that a rule no longer allows is not brought along.
fn retangented(before: &ContactRow, now: &ContactRow, impulse: &ImpulseRow) -> ImpulseRow {
    let (tangent_1, tangent_2) = before.tangents();
    let friction = tangent_1 * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
    let friction = if now.friction > 0.0 { friction } else { Vec3::ZERO };
    let (tangent_1, tangent_2) = now.tangents();
    let [tangent_1, tangent_2] = [tangent_1, tangent_2].map(|tangent| friction.dot(tangent));
    ImpulseRow { normal: impulse.normal, tangent_1, tangent_2, peak: 0.0 }
}

/// Normal velocity whose opposite, times the restitution `e`, gives back the energy of the approach.
///
/// `vn` is the normal velocity when the step begins, `pull` the relative acceleration along the normal, `gap` the distance
/// still to go and `h` the substep. Two corrections: what the surfaces gain on the way, and that the velocities of the
/// integrator stand half a substep ahead of the parabola that its positions lie on, before the bounce and after it.
/// Without them a perfectly elastic ball that fell 5 m lost 2.3 % of its energy in 20 s at steps of 1 ms.
fn velocity_at_impact(vn: f32, pull: f32, gap: f32, h: f32, e: f32) -> f32 {
    if vn >= 0.0 || e == 0.0 {
        return vn;
    }
    let ahead = 0.5 * pull * h;
    let approach = (vn + ahead).min(0.0);
    let meeting = (approach * approach - 2.0 * (pull * gap).min(0.0)).sqrt();
    -(meeting - ahead / e)
}

/// The row that stands for the friction of all `points`, which learn how far from it they are.
fn patch_of(effective: &EffectiveMass, points: &mut [PointRow]) -> PointRow {
    let middle = |arm: fn(&PointRow) -> [f32; 3]| {
        points.iter().map(|p| Vec3::from_array(arm(p))).sum::<Vec3>() / points.len() as f32
    };
    let (r_a, r_b) = (middle(|p| p.r_a), middle(|p| p.r_b));
    for p in points {
        p.slip_1 = Vec3::from_array(p.r_a).distance(r_a);
    }
    PointRow {
        r_a: r_a.to_array(),
        r_b: r_b.to_array(),
        normal_mass: effective.twist(),
        tangent_mass: effective.tangent(r_a, r_b),
        ..PointRow::default()
    }
}
