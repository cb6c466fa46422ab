//! The rows of contacts as bytes.
//!
//! The slots follow from the manifolds, and the rows from manifolds, materials and masses. A row is saved as it is only
//! if these may have changed since it was written. In most cases only the effective masses have changed, of bodies with
//! unequal moments that turned. Builds for tests also write the other rows again when they save, and compare all bits.
//! The rest of the saved state is impulses, preloads, sags and needs.

mod loads;
mod slots;

use rayon::prelude::*;

use super::super::bodies::mass_row;
use super::super::carry::Carry;
use super::super::prepare::{ComputedRow, PoseRow};
use super::super::rows::{ContactRow, ImpulseRow, MassRow, PointRow};
use super::super::slots::Write;
use super::super::write::{SLOTS_A_TASK, SelectedSlots, SlotRows, Writer};
use super::super::{StepProblem, StepScale, points_a_slot};
use super::{ContactRows, Materials};
use crate::collide::{Detector, MAX_POINTS};
use crate::config::{FrictionRule, SolverConfig};
use crate::effort::Effort;
use crate::error::{Result, ensure};
use crate::graph::lay_out;
use crate::saved::{Archive, Saved};
use crate::world::{Body, BodyKind, Surface, World};
use loads::{COLUMNS, Rows, SlotLoads, Sources};
use slots::walk_slots;

/// The rows of neighboring slots, in their own memory.
struct Buffers {
    contacts: Vec<ContactRow>,
    points: Vec<PointRow>,
    impulses: Vec<ImpulseRow>,
    computed: Vec<ComputedRow>,
    sags: Vec<f32>,
    jams: Vec<bool>,
}

impl Buffers {
    fn new(slots: usize, stride: usize) -> Self {
        Self {
            contacts: vec![ContactRow::default(); slots],
            points: vec![PointRow::default(); slots * stride],
            impulses: vec![ImpulseRow::default(); slots * stride],
            computed: vec![ComputedRow::default(); slots],
            sags: vec![0.0; slots],
            jams: vec![false; slots],
        }
    }

    fn slot_rows(&mut self) -> SlotRows<'_> {
        let Self { contacts, points, impulses, computed, sags, jams } = self;
        SlotRows { contacts, points, impulses, computed, sags, jams }
    }
}

impl ContactRows {
    /// Writes the lasting state of the rows of contacts of the problem, or reads it. The slots are those of the
    /// manifolds of the detector. The settings are those at the time when the rows were written.
    pub(crate) fn walk<A: Archive>(
        &mut self,
        world: &World,
        detector: &Detector,
        (config, scale, surfaces): (&SolverConfig, Option<&StepScale>, &[Surface]),
        effort: &Effort,
        problem: &mut StepProblem,
        archive: &mut A,
    ) -> Result<()> {
        let Self {
            slots,
            graph: _,
            coloring,
            layout,
            computed,
            poses: _,
            jams,
            impacts: _,
            classes,
            materials,
            new_bodies: _,
            before: _,
            hooked,
            sums: _,
            carry: _,
        } = self;
        layout.walk(archive)?;
        materials.walk(archive)?;
        let is_taken = walk_slots(slots, detector, archive)?;
        hooked.walk(archive)?;
        ensure(hooked.len() <= slots.all.len(), || {
            format!("materials of {} contacts, of {}", hooked.len(), slots.all.len())
        })?;
        walk_same(coloring, || lay_out(&slots.edges, &slots.taking_part().collect::<Vec<_>>()), archive)?;
        walk_same(classes, || effort.classes().to_vec(), archive)?;
        let (count, stride) = (slots.all.len(), points_a_slot(layout.patches));
        let offsets = coloring.offsets.is_sorted()
            && coloring.offsets.last().is_none_or(|&end| end as usize <= coloring.order.len());
        let fits = offsets && coloring.order.iter().all(|&row| (row as usize) < count);
        ensure(fits, || format!("a color with a row beyond the last of {count}"))?;
        let mut written = problem.contacts.len();
        written.walk(archive)?;
        ensure(written == count || written == 0, || format!("{written} rows of {count}"))?;
        if written == 0 {
            return Ok(());
        }
        if A::READS {
            problem.contacts.resize(count, ContactRow::default());
            problem.points.resize(count * stride, PointRow::default());
            problem.impulses.resize(count * stride, ImpulseRow::default());
            problem.sags.resize(count, 0.0);
            computed.resize(count, ComputedRow::default());
            jams.resize(count, false);
            problem.params.point_count = problem.points.len() as u32;
        }
        let StepProblem { contacts, points, impulses, sags, .. } = problem;
        let mass = |body: usize| {
            if world.bodies[body].kind == BodyKind::Dynamic {
                mass_row(&world.bodies[body])
            } else {
                MassRow::default()
            }
        };
        let bodies = detector.kinds().len();
        let all_there = bodies <= world.bodies.len();
        let masses: Vec<MassRow> =
            (0..if all_there { bodies } else { 0 }).into_par_iter().with_min_len(256).map(mass).collect();
        let poses = vec![PoseRow::default(); masses.len()];
        let rule = config.friction_rule();
        let carry = Carry { tangents: matches!(rule, FrictionRule::Box | FrictionRule::Disc), ..Carry::default() };
        let facts = materials.unwrap_or_else(|| Materials::of(world)).and(hooked);
        let writer = Writer {
            world,
            detector,
            config,
            effort,
            effort_changes: false,
            bodies: &[],
            masses: &masses,
            poses: &poses,
            carry: &carry,
            brings_impulses: false,
            layout: *layout,
            hooked,
            may_jam: facts.may_jam,
            locked: facts.locked,
        };
        let slips = rule == FrictionRule::Slip && !layout.patches;
        let task = |first: usize| {
            let own = first..(first + SLOTS_A_TASK).min(count);
            let mut buffers = Buffers::new(own.len(), stride);
            let slots = &slots.all[own.clone()];
            let mut own_taken = is_taken[own.clone()].iter();
            let chosen = SelectedSlots::of(slots, |_| *own_taken.next().expect("one a slot") && all_there);
            writer.write_rows(first, slots, &chosen, &mut buffers.slot_rows());
            (own, buffers)
        };
        let firsts: Vec<usize> = (0..count).step_by(SLOTS_A_TASK).collect();
        let mut kinds: Vec<Rows>;
        if !A::READS {
            let of_slot = |i: usize| {
                let slot = &slots.all[i];
                if !is_taken[i] {
                    return Rows::All;
                }
                let pair = detector.pair(slot.world, slot.pair);
                let bodies = [pair.body_a, pair.body_b].map(|body| body as usize);
                let is_same = |&body: &usize| {
                    let now = world.bodies.get(body);
                    now.is_some_and(|b| surfaces.get(body) == Some(&b.surface()) && b.kind == detector.kinds()[body])
                };
                let turns = |&body: &usize| masses[body].inv_mass > 0.0 && !has_equal_moments(&world.bodies[body]);
                match all_there && bodies.iter().any(turns) {
                    // Slips have the rotations that bodies had when they were written.
                    _ if layout.driven => Rows::All,
                    // Rows of contacts at rest are written again before they are swept.
                    _ if !slot.takes_part && all_there => Rows::Remade,
                    _ if slot.write != Write::Separations || !all_there || !bodies.iter().all(is_same) => Rows::All,
                    true => Rows::Masses,
                    false => Rows::Remade,
                }
            };
            kinds = (0..count).into_par_iter().with_min_len(1024).map(of_slot).collect();
            debug_assert!(
                firsts.iter().all(|&first| {
                    let (own, now) = task(first);
                    own.clone().filter(|&i| is_taken[i] && slots.all[i].takes_part).all(|i| {
                        let points = &points[i * stride..(i + 1) * stride];
                        now.rows(i - own.start, slips, (&contacts[i], points, &computed[i], jams[i])) <= kinds[i]
                    })
                }),
                "a row does not follow from its manifold"
            );
        } else {
            kinds = vec![Rows::Remade; count];
            for (own, buffers) in firsts.par_iter().map(|&first| task(first)).collect::<Vec<_>>() {
                contacts[own.clone()].copy_from_slice(&buffers.contacts);
                points[own.start * stride..own.end * stride].copy_from_slice(&buffers.points);
                computed[own.clone()].copy_from_slice(&buffers.computed);
                jams[own].copy_from_slice(&buffers.jams);
            }
        }
        let mut as_they_are: Vec<u32> =
            (0..count).filter(|&i| is_taken[i] && kinds[i] == Rows::All).map(|i| i as u32).collect();
        as_they_are.walk(archive)?;
        for i in as_they_are.into_iter().map(|i| i as usize) {
            ensure(is_taken.get(i) == Some(&true), || format!("row {i} of {count} has no contact"))?;
            kinds[i] = Rows::All;
            let contact = &mut contacts[i];
            contact.walk(archive)?;
            let of_bodies = [contact.body_a, contact.body_b].iter().all(|&body| (body as usize) < bodies);
            let fits =
                of_bodies && contact.point_count as usize <= MAX_POINTS && contact.first_point as usize == i * stride;
            ensure(fits, || format!("row {i} has other bodies or points"))?;
            let own = contact.point_count as usize + usize::from(layout.patches);
            points[i * stride..][..own].iter_mut().try_for_each(|point| point.walk(archive))?;
            computed[i].walk(archive)?;
            jams[i].walk(archive)?;
        }
        let sources = Sources { detector, effort, config, scale, masses: &masses };
        let loads = archive.chunks(count, COLUMNS, |range, columns| {
            let mut all = Vec::new();
            for i in range.filter(|&i| is_taken[i]) {
                let (slot, contact) = (&slots.all[i], &contacts[i]);
                let mut own = SlotLoads { rows: kinds[i], ..SlotLoads::default() };
                let count = contact.point_count as usize + usize::from(layout.patches);
                if !columns.reads() {
                    let rows = i * stride..i * stride + count;
                    own = SlotLoads {
                        sag: sags[i],
                        need: slot.need,
                        preload: contact.preload,
                        share: contact.substep_share,
                        jams: jams[i],
                        ..own
                    };
                    own.impulses[..count].copy_from_slice(&impulses[rows.clone()]);
                    let masses = points[rows].iter().map(|point| [point.normal_mass, point.tangent_mass]);
                    own.masses.iter_mut().zip(masses).for_each(|(own, masses)| *own = masses);
                }
                own.walk(slot, contact, count, &sources, columns)?;
                if columns.reads() {
                    all.push((i, own));
                }
            }
            Ok(all)
        })?;
        for (i, own) in loads.into_iter().flatten() {
            let contact = &mut contacts[i];
            let count = contact.point_count as usize + usize::from(layout.patches);
            (sags[i], slots.all[i].need, contact.preload, contact.substep_share) =
                (own.sag, own.need, own.preload, own.share);
            impulses[i * stride..][..count].copy_from_slice(&own.impulses[..count]);
            if own.rows == Rows::Masses {
                jams[i] = own.jams;
                for (point, [normal, tangent]) in points[i * stride..][..count].iter_mut().zip(own.masses) {
                    (point.normal_mass, point.tangent_mass) = (normal, tangent);
                }
            }
        }
        Ok(())
    }
}

impl Buffers {
    /// How a slot is to be saved, given its present rows.
    fn rows(
        &self,
        i: usize,
        slips: bool,
        (contact, points, computed, jams): (&ContactRow, &[PointRow], &ComputedRow, bool),
    ) -> Rows {
        let now = ContactRow { preload: contact.preload, substep_share: contact.substep_share, ..self.contacts[i] };
        let patch = points.len() - MAX_POINTS;
        let count = contact.point_count as usize + patch;
        let own = points[..count].iter().zip(&self.points[i * points.len()..]);
        // Every step writes separations and approach velocities anew, and with slip friction also slips and tangential
        // masses.
        let slip = |point: &PointRow| if slips { [0; 2] } else { [point.slip_1, point.slip_2].map(f32::to_bits) };
        let arms = |point: &PointRow| ([point.r_a, point.r_b].map(|r| r.map(f32::to_bits)), slip(point));
        let masses =
            |point: &PointRow| [point.normal_mass, if slips { 0.0 } else { point.tangent_mass }].map(f32::to_bits);
        let is_same = bytemuck::bytes_of(contact) == bytemuck::bytes_of(&now)
            && bytemuck::bytes_of(computed) == bytemuck::bytes_of(&self.computed[i])
            && own.clone().all(|(then, now)| arms(then) == arms(now));
        match own.clone().all(|(then, now)| masses(then) == masses(now)) && jams == self.jams[i] {
            _ if !is_same => Rows::All,
            true => Rows::Remade,
            false => Rows::Masses,
        }
    }
}

/// Whether a body has the same inverse inertia in every rotation.
fn has_equal_moments(body: &Body) -> bool {
    let moments = body.mass.principal_inertia;
    moments.x == moments.y && moments.y == moments.z
}

/// Writes a value, or reads it. A value equal to `usual` takes a flag only.
fn walk_same<T: Saved + PartialEq, A: Archive>(
    value: &mut T,
    usual: impl FnOnce() -> T,
    archive: &mut A,
) -> Result<()> {
    let usual = usual();
    let mut is_usual = *value == usual;
    is_usual.walk(archive)?;
    if !is_usual {
        return value.walk(archive);
    }
    *value = usual;
    Ok(())
}
