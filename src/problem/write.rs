//! Writes the rows of contacts: anew from a computed manifold, or from the rows of the step before while the manifold
//! is reused.
//!
//! A reused manifold keeps its normal, tangents, arms, effective masses and impulses. Only the separations follow the
//! bodies. The bodies of a reused manifold have turned by 0.03 rad at most. The change of effective masses and arms by
//! this turn is neglected.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::carry::Carry;
use super::contacts::Layout;
use super::effective::{EffectiveMass, InverseMass};
use super::points_a_slot;
use super::prepare::{ComputedRow, PoseRow, Preparation, Prepare, PrepareSlots};
use super::rescale::change_share;
use super::rows::{BodyRow, ContactRow, ImpulseRow, MassRow, PointRow};
use super::slots::{Slot, Write};
use crate::collide::{Detector, MAX_POINTS, Manifold, ManifoldPoint, Pair};
use crate::config::{FrictionRule, SolverConfig};
use crate::effort::Effort;
use crate::lanes::{InstructionSet, Shared, WIDTH};
use crate::math::effective_mass::{PointKinds, inverse_or_zero, square_root};
use crate::math::{self, dot3, reciprocal};
use crate::world::{Body, Material, World};

/// The sources of the rows of contacts.
pub(super) struct Writer<'a> {
    pub world: &'a World,
    pub detector: &'a Detector,
    pub config: &'a SolverConfig,
    pub effort: &'a Effort,
    /// Whether a class differs from that of the rows of the step before.
    pub effort_changes: bool,
    pub bodies: &'a [BodyRow],
    pub masses: &'a [MassRow],
    pub poses: &'a [PoseRow],
    /// The coefficients of the preloads.
    pub carry: &'a Carry,
    /// Whether rows that are written again move impulses to the present points. If not, impulses stay in place.
    pub brings_impulses: bool,
    /// The rows and slips that contacts have.
    pub layout: Layout,
    /// The materials that hooks gave to contacts, by slot; empty if they gave none.
    pub hooked: &'a [Option<Material>],
    /// Whether any surface has enough friction that contacts may jam.
    pub may_jam: bool,
    /// Whether any body has locked translations.
    pub locked: bool,
}

/// The rows of neighboring slots.
pub(super) struct SlotRows<'a> {
    pub contacts: &'a mut [ContactRow],
    pub points: &'a mut [PointRow],
    pub impulses: &'a mut [ImpulseRow],
    pub computed: &'a mut [ComputedRow],
    pub sags: &'a mut [f32],
    pub jams: &'a mut [bool],
}

pub(super) const SLOTS_A_TASK: usize = 256;

/// Some of the slots of a task, in ascending order.
pub(super) struct SelectedSlots {
    slots: [u32; SLOTS_A_TASK],
    count: usize,
}

impl SelectedSlots {
    pub fn of(slots: &[Slot], mut is_wanted: impl FnMut(&Slot) -> bool) -> Self {
        let mut chosen = Self { slots: [0; SLOTS_A_TASK], count: 0 };
        for (i, slot) in (0..).zip(slots) {
            chosen.slots[chosen.count] = i;
            chosen.count += usize::from(is_wanted(slot));
        }
        chosen
    }

    fn all(&self) -> &[u32] {
        &self.slots[..self.count]
    }
}

impl Writer<'_> {
    /// Writes the rows of all slots, on all threads.
    pub fn write(&self, slots: &[Slot], rows: SlotRows) {
        let stride = points_a_slot(self.layout.patches);
        let points = rows.points.par_chunks_mut(SLOTS_A_TASK * stride);
        let points = points.zip(rows.impulses.par_chunks_mut(SLOTS_A_TASK * stride));
        let slots_rows = rows.computed.par_chunks_mut(SLOTS_A_TASK).zip(rows.sags.par_chunks_mut(SLOTS_A_TASK));
        let slots_rows = slots_rows.zip(rows.jams.par_chunks_mut(SLOTS_A_TASK));
        let rows = rows.contacts.par_chunks_mut(SLOTS_A_TASK).zip(points).zip(slots_rows);
        slots.par_chunks(SLOTS_A_TASK).zip(rows).enumerate().for_each(|(task, (slots, rows))| {
            let ((contacts, (points, impulses)), ((computed, sags), jams)) = rows;
            let rows = SlotRows { contacts, points, impulses, computed, sags, jams };
            self.write_some(task * SLOTS_A_TASK, slots, rows);
        });
    }

    /// Writes the rows of consecutive slots, the first of which has the number `first`.
    fn write_some(&self, first: usize, slots: &[Slot], mut rows: SlotRows) {
        let stride = points_a_slot(self.layout.patches);
        let written = SelectedSlots::of(slots, |slot| slot.write != Write::Separations);
        let begun = SelectedSlots::of(slots, |slot| slot.takes_part);
        self.write_rows(first, slots, &written, &mut rows);
        let changes_share =
            |contact: &ContactRow| contact.substep_share != 0.0 && self.share(contact) != contact.substep_share;
        let follows = self.effort_changes
            || written.all().iter().any(|&i| slots[i as usize].takes_part && changes_share(&rows.contacts[i as usize]));
        if !follows {
            for &i in written.all().iter().filter(|&&i| slots[i as usize].takes_part) {
                rows.contacts[i as usize].substep_share = self.share(&rows.contacts[i as usize]);
            }
            self.prepare(&mut rows, begun.all(), Preparation::Begin { separations: true, loads: true });
        } else {
            self.prepare(&mut rows, begun.all(), Preparation::Begin { separations: true, loads: false });
            for &i in begun.all() {
                let own = i as usize * stride..(i as usize + 1) * stride;
                let (points, impulses) = (&rows.points[own.clone()], &mut rows.impulses[own]);
                self.follow_effort(&mut rows.contacts[i as usize], points, impulses);
            }
            self.prepare(&mut rows, begun.all(), Preparation::Begin { separations: false, loads: true });
        }
        if self.carry.pull_or_slip {
            for &i in begun.all() {
                let contact = &rows.contacts[i as usize];
                let own = &mut rows.points[i as usize * stride..][..contact.point_count as usize];
                own.iter_mut().for_each(|point| self.write_pull_and_slip(contact, point));
            }
        }
    }

    /// Writes the values of chosen slots that follow from their manifolds, materials and masses.
    pub fn write_rows(&self, first: usize, slots: &[Slot], written: &SelectedSlots, rows: &mut SlotRows) {
        let stride = points_a_slot(self.layout.patches);
        for &i in written.all() {
            let (slot, i) = (&slots[i as usize], i as usize);
            rows.contacts[i].first_point = ((first + i) * stride) as u32;
            self.write_slot(slot, (first + i, i), rows);
        }
        let kinds = PointKinds { tangents: self.carry.tangents, jams: self.may_jam, locked: self.locked };
        let preparation = Preparation::Masses(kinds);
        self.prepare(rows, written.all(), preparation);
        if self.layout != Layout::default() {
            for &i in written.all() {
                let (slot, number) = (&slots[i as usize], first + i as usize);
                let own = &mut rows.points[i as usize * stride..][..stride];
                self.write_surface(slot, number, &rows.contacts[i as usize], own);
            }
        }
    }

    /// Writes the patch of a contact, and the velocity of its surfaces.
    fn write_surface(&self, slot: &Slot, number: usize, contact: &ContactRow, own: &mut [PointRow]) {
        let Layout { patches, rolls, driven } = self.layout;
        let material = self.material(number, self.detector.pair(slot.world, slot.pair));
        let (points, patch) = own.split_at_mut(contact.point_count as usize);
        if patches {
            let inverse = [contact.body_a, contact.body_b].map(|i| InverseMass::of(&self.masses[i as usize]));
            let effective = EffectiveMass { inverse: &inverse, row: contact };
            patch[0] = if rolls { rolling_of(&effective, &material) } else { patch_of(&effective, points) };
        }
        if driven {
            let (tangent_1, tangent_2) = contact.tangents();
            for point in if self.layout.is_at_patch() { &mut patch[..1] } else { points } {
                point.slip_1 = material.surface_velocity.dot(tangent_1);
                point.slip_2 = material.surface_velocity.dot(tangent_2);
            }
        }
    }

    /// The material of the contact in a row.
    fn material(&self, number: usize, pair: &Pair) -> Material {
        let bodies = [pair.body_a, pair.body_b].map(|i| &self.world.bodies[i as usize]);
        let hooked = self.hooked.get(number).copied().flatten();
        hooked.unwrap_or_else(|| Body::contact_material(bodies, pair.colliders))
    }

    fn prepare(&self, rows: &mut SlotRows, slots: &[u32], preparation: Preparation) {
        let rows = Prepare {
            stride: points_a_slot(self.layout.patches),
            masses: self.masses,
            poses: self.poses,
            preload: &self.carry.preload,
            contacts: Shared::new(rows.contacts),
            points: Shared::new(rows.points),
            impulses: Shared::new(rows.impulses),
            computed: rows.computed,
            sags: Shared::new(rows.sags),
            jams: Shared::new(rows.jams),
        };
        let work = PrepareSlots { rows: &rows, slots, preparation };
        InstructionSet::default().run(&work, 0..slots.len().div_ceil(WIDTH));
    }

    /// Writes the values of a slot that do not follow from other rows.
    fn write_slot(&self, slot: &Slot, (number, i): (usize, usize), rows: &mut SlotRows) {
        let stride = points_a_slot(self.layout.patches);
        let contact = &mut rows.contacts[i];
        let pair = self.detector.pair(slot.world, slot.pair);
        let manifold = &pair.manifolds[slot.manifold as usize];
        let before = *contact;
        self.write_header(contact, (number, slot), pair, manifold);
        rows.computed[i] = self
            .detector
            .computed_at(slot.world, slot.pair)
            .map_or_else(Default::default, |placed| ComputedRow::of(placed, manifold));
        for (point, p) in rows.points[i * stride..].iter_mut().zip(manifold.points()) {
            let (r_a, r_b) = (p.r_a.to_array(), p.r_b.to_array());
            *point = PointRow { r_a, r_b, separation: p.separation, ..PointRow::default() };
        }
        if self.brings_impulses {
            let impulses = &mut rows.impulses[i * stride..(i + 1) * stride];
            self.bring_impulses(slot.write, &before, contact, manifold, impulses);
        }
    }

    /// Adjusts a contact to the substeps of its island.
    fn follow_effort(&self, contact: &mut ContactRow, points: &[PointRow], impulses: &mut [ImpulseRow]) {
        let share = self.share(contact);
        if share != contact.substep_share {
            let count = contact.point_count as usize;
            let pressed = impulses[..count].iter().map(|impulse| impulse.normal).sum();
            let mass = points[..count].iter().map(|point| point.normal_mass).sum();
            let both = [contact.body_a, contact.body_b].iter().all(|&body| self.masses[body as usize].inv_mass > 0.0);
            let yields = self.carry.preload.yielding::<f32>(contact.substep_share, both, pressed);
            change_share(contact, share, yields * reciprocal::<f32>(mass), points, impulses);
        }
    }

    fn write_header(&self, row: &mut ContactRow, (number, slot): (usize, &Slot), pair: &Pair, manifold: &Manifold) {
        let material = self.material(number, pair);
        *row = ContactRow {
            friction: if self.config.friction_rule() == FrictionRule::None { 0.0 } else { material.friction },
            restitution: material.restitution,
            body_a: pair.body_a,
            body_b: pair.body_b,
            first_point: row.first_point,
            point_count: manifold.points().len() as u32,
            radius_a: manifold.radius_a,
            radius_b: manifold.radius_b,
            preload: if slot.write == Write::New { 0.0 } else { row.preload },
            substep_share: if slot.write == Write::New { 0.0 } else { row.substep_share },
            ..ContactRow::framed(manifold.normal)
        };
    }

    /// Moves the impulses of a slot to the present points and tangents of its manifold. Twin of the function of the
    /// same name in `shaders/resident/write_contacts.wgsl`.
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
        if self.layout.patches {
            impulses[manifold.points().len()] = retangented(before, now, &old[before.point_count as usize]);
        }
    }

    /// The length of a contact's substeps over that of class 0.
    fn share(&self, row: &ContactRow) -> f32 {
        let is_movable = |body: u32| self.masses[body as usize].inv_mass > 0.0;
        self.effort.share(if is_movable(row.body_a) { row.body_a } else { row.body_b } as usize)
    }

    /// Writes the numbers of a point that the motion of its bodies decides when the step begins: their relative
    /// acceleration, and the slip direction if friction has only one direction.
    fn write_pull_and_slip(&self, row: &ContactRow, point: &mut PointRow) {
        let masses = [row.body_a, row.body_b].map(|i| &self.masses[i as usize]);
        let [pull_a, pull_b] = masses.map(|m| Vec3::from_array(m.acceleration));
        point.pull = if row.restitution > 0.0 { (pull_b - pull_a).dot(row.normal.into()) } else { 0.0 };
        if self.config.friction_rule() == FrictionRule::Slip && !self.layout.patches {
            let (r_a, r_b) = (Vec3::from_array(point.r_a), Vec3::from_array(point.r_b));
            let [a, b] = [row.body_a, row.body_b].map(|i| &self.bodies[i as usize]);
            let velocity = |body: &BodyRow, r: Vec3| Vec3::from_array(body.v) + Vec3::from_array(body.w).cross(r);
            let u = velocity(b, r_b) - velocity(a, r_a);
            let (tangent_1, tangent_2) = row.tangents();
            // A point that does not slip yet takes the first tangent.
            let slip = Vec2::new(u.dot(tangent_1), u.dot(tangent_2)).try_normalize().unwrap_or(Vec2::X);
            [point.slip_1, point.slip_2] = slip.to_array();
            let effective = EffectiveMass { inverse: &masses.map(InverseMass::of), row };
            point.tangent_mass = effective.along(r_a, r_b, tangent_1 * slip.x + tangent_2 * slip.y);
        }
    }
}

/// The index that the point `k` of a manifold had among the former points of its slot; `None` for a new point.
pub(super) fn point_before(write: Write, k: usize, point: &ManifoldPoint) -> Option<u8> {
    match write {
        Write::Separations | Write::Rows => Some(k as u8),
        Write::Computed => point.before,
        Write::New => None,
    }
}

/// An impulse along the present tangents of a manifold. Friction that a rule no longer allows is dropped.
fn retangented(before: &ContactRow, now: &ContactRow, impulse: &ImpulseRow) -> ImpulseRow {
    let (tangent_1, tangent_2) = before.tangents();
    let friction = tangent_1 * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
    let friction = if now.friction > 0.0 { friction } else { Vec3::ZERO };
    let (tangent_1, tangent_2) = now.tangents();
    let [tangent_1, tangent_2] = [tangent_1, tangent_2].map(|tangent| friction.dot(tangent));
    ImpulseRow { normal: impulse.normal, tangent_1, tangent_2, bounce: 0.0 }
}

/// The row that resists the relative spin of two bodies.
fn rolling_of(effective: &EffectiveMass, material: &Material) -> PointRow {
    PointRow {
        normal_mass: effective.twist(),
        tangent_mass: effective.rolling(),
        slip_1: material.spinning_friction,
        slip_2: material.rolling_friction,
        ..PointRow::default()
    }
}

/// The row for the joint friction of all `points`. It also writes their distances from the patch.
fn patch_of(effective: &EffectiveMass, points: &mut [PointRow]) -> PointRow {
    let share = inverse_or_zero(points.len() as f32);
    let middle = |arm: fn(&PointRow) -> [f32; 3]| {
        let mut sum = math::Vec3::default();
        points.iter().for_each(|p| sum += math::Vec3::<f32>::load(arm(p)));
        sum * share
    };
    let (r_a, r_b) = (middle(|p| p.r_a), middle(|p| p.r_b));
    for p in points {
        let lever = math::Vec3::load(p.r_a) - r_a;
        p.slip_1 = square_root(dot3(lever, lever));
    }
    let (r_a, r_b) = (r_a.store(), r_b.store());
    PointRow {
        r_a,
        r_b,
        normal_mass: effective.twist(),
        tangent_mass: effective.tangent(r_a.into(), r_b.into()),
        ..PointRow::default()
    }
}
