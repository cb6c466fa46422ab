//! The rows of contacts as bytes.
//!
//! Slots follow from the manifolds that have them, and rows from manifolds, materials and masses. Only what may have changed since they were
//! written is saved as it is: effective masses of bodies with unequal moments, which turned, most of all. Builds for tests write the other
//! rows again when they are saved, too, and compare all bits. What is left are impulses, preloads, and how deep contacts sag and sagged.

use rayon::prelude::*;

use super::super::bodies::mass_row;
use super::super::carry::Carry;
use super::super::prepare::{ComputedRow, PoseRow};
use super::super::rows::{ContactRow, ImpulseRow, MassRow, PointRow};
use super::super::slots::{FREE, Slot, Slots, Write};
use super::super::write::{Chosen, SLOTS_A_TASK, SlotRows, Writer};
use super::super::{StepProblem, StepScale, points_a_slot};
use super::{ContactRows, Materials};
use crate::collide::{Detector, MAX_POINTS, NO_SLOT};
use crate::config::{FrictionRule, SolverConfig};
use crate::effort::Effort;
use crate::error::{Result, ensure};
use crate::graph::{Edge, IMMOVABLE, lay_out};
use crate::saved::{Archive, Saved};
use crate::world::{Body, BodyKind, MassProperties, Material, World};

/// How the rows of a slot are written.
#[derive(Clone, Copy)]
#[repr(u8)]
enum Rows {
    /// They follow from the rest.
    Remade,
    /// But for effective masses.
    Masses,
    /// As they are.
    All,
}

/// The rows of neighboring slots, in memory of their own.
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
    /// Writes all that lasts with the rows of contacts of the problem, or reads it. The slots are those of the manifolds of the detector; the
    /// settings are those that the rows were written for.
    pub(crate) fn walk<A: Archive>(
        &mut self,
        world: &World,
        detector: &Detector,
        (config, scale, surfaces): (&SolverConfig, Option<&StepScale>, &[(MassProperties, Material)]),
        effort: &Effort,
        problem: &mut StepProblem,
        archive: &mut A,
    ) -> Result<()> {
        let Self {
            slots,
            graph: _,
            coloring,
            patches,
            computed,
            poses: _,
            jams,
            classes,
            materials,
            new_bodies: _,
            sums: _,
            carry: _,
        } = self;
        patches.walk(archive)?;
        materials.walk(archive)?;
        let is_taken = walk_slots(slots, detector, archive)?;
        walk_same(coloring, || lay_out(&slots.edges, &slots.taking_part().collect::<Vec<_>>()), archive)?;
        walk_same(classes, || effort.classes().to_vec(), archive)?;
        let (count, stride) = (slots.all.len(), points_a_slot(*patches));
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
        let writer = Writer {
            world,
            detector,
            config,
            effort,
            effort_changes: false,
            substep: 0.0,
            bodies: &[],
            masses: &masses,
            poses: &poses,
            carry: &carry,
            brings_impulses: false,
            patches: *patches,
            may_jam: materials.unwrap_or_else(|| Materials::of(world)).may_jam,
        };
        let slips = rule == FrictionRule::Slip && !*patches;
        let task = |first: usize| {
            let own = first..(first + SLOTS_A_TASK).min(count);
            let mut buffers = Buffers::new(own.len(), stride);
            let slots = &slots.all[own.clone()];
            let mut own_taken = is_taken[own.clone()].iter();
            let chosen = Chosen::of(slots, |_| *own_taken.next().expect("one a slot") && all_there);
            writer.write_rows(first, slots, &chosen, &mut buffers.slot_rows());
            (own, buffers)
        };
        let firsts: Vec<usize> = (0..count).step_by(SLOTS_A_TASK).collect();
        let mut kinds = Vec::new();
        if !A::READS {
            let of_slot = |slot: &Slot| {
                let pair = detector.pair(slot.world, slot.pair);
                let bodies = [pair.body_a, pair.body_b].map(|body| body as usize);
                let is_same = |&body: &usize| {
                    let now = world.bodies.get(body);
                    now.is_some_and(|b| {
                        surfaces.get(body) == Some(&(b.mass, b.material)) && b.kind == detector.kinds()[body]
                    })
                };
                let turns = |&body: &usize| masses[body].inv_mass > 0.0 && !has_equal_moments(&world.bodies[body]);
                match all_there && bodies.iter().any(turns) {
                    // Rows of contacts that rest are written again before they are swept.
                    _ if !slot.takes_part && all_there => Rows::Remade,
                    _ if slot.write != Write::Separations || !all_there || !bodies.iter().all(is_same) => Rows::All,
                    true => Rows::Masses,
                    false => Rows::Remade,
                }
            };
            kinds.extend(
                slots.all.iter().zip(&is_taken).map(|(slot, taken)| if *taken { of_slot(slot) } else { Rows::All }),
            );
            debug_assert!(
                firsts.iter().all(|&first| {
                    let (own, now) = task(first);
                    own.clone().filter(|&i| is_taken[i] && slots.all[i].takes_part).all(|i| {
                        let points = &points[i * stride..(i + 1) * stride];
                        now.rows(i - own.start, slips, (&contacts[i], points, &computed[i], jams[i])) as u8
                            <= kinds[i] as u8
                    })
                }),
                "a row does not follow from its manifold"
            );
        } else {
            kinds.resize(count, Rows::All);
            for (own, buffers) in firsts.par_iter().map(|&first| task(first)).collect::<Vec<_>>() {
                contacts[own.clone()].copy_from_slice(&buffers.contacts);
                points[own.start * stride..own.end * stride].copy_from_slice(&buffers.points);
                computed[own.clone()].copy_from_slice(&buffers.computed);
                jams[own].copy_from_slice(&buffers.jams);
            }
        }
        let movable = |body: u32| masses.get(body as usize).is_some_and(|mass| mass.inv_mass > 0.0);
        for i in (0..count).filter(|&i| is_taken[i]) {
            let (slot, contact, sag) = (&mut slots.all[i], &mut contacts[i], &mut sags[i]);
            let points = &mut points[i * stride..(i + 1) * stride];
            let pair = detector.pair(slot.world, slot.pair);
            let usual_share = effort.share(if movable(pair.body_a) { pair.body_a } else { pair.body_b } as usize);
            // Most preloads of a heap are 0.
            const PRELOAD: [u32; 2] = [0, (-0.0_f32).to_bits()];
            let preload = PRELOAD.iter().position(|&bits| bits == contact.preload.to_bits()).unwrap_or(2);
            let has = [sag.to_bits() != 0, slot.need.to_bits() != 0, contact.substep_share != usual_share];
            let mut bits =
                (2..).zip(has).fold(kinds[i] as u8 | (preload as u8) << 5, |bits, (k, has)| bits | u8::from(has) << k);
            bits.walk(archive)?;
            let [has_sag, has_need, has_share] = [2, 3, 4].map(|k| bits >> k & 1 == 1);
            let preload = PRELOAD.get(usize::from(bits >> 5 & 3));
            let rows = bits & 3;
            if rows == Rows::Masses as u8 {
                let count = contact.point_count as usize + usize::from(*patches);
                for point in &mut points[..count] {
                    point.normal_mass.walk(archive)?;
                    point.tangent_mass.walk(archive)?;
                }
                jams[i].walk(archive)?;
            } else if rows == Rows::All as u8 {
                contact.walk(archive)?;
                let of_bodies = [contact.body_a, contact.body_b].iter().all(|&body| (body as usize) < bodies);
                let fits = of_bodies
                    && contact.point_count as usize <= MAX_POINTS
                    && contact.first_point as usize == i * stride;
                ensure(fits, || format!("row {i} has other bodies or points"))?;
                let count = contact.point_count as usize + usize::from(*patches);
                points[..count].iter_mut().try_for_each(|point| point.walk(archive))?;
                computed[i].walk(archive)?;
                jams[i].walk(archive)?;
            }
            let count = contact.point_count as usize;
            let impulses = &mut impulses[i * stride..][..count + usize::from(*patches)];
            walk_impulses(impulses, archive)?;
            if A::READS {
                (*sag, slot.need, contact.substep_share) = (0.0, 0.0, usual_share);
            }
            match preload {
                Some(&bits) => contact.preload = f32::from_bits(bits),
                None => contact.preload.walk(archive)?,
            }
            if has_share {
                contact.substep_share.walk(archive)?;
            }
            let share = contact.substep_share;
            if has_sag {
                let pressed = impulses[..count].iter().map(|impulse| impulse.normal).sum();
                let bodies = [contact.body_a, contact.body_b].map(|body| body as usize);
                let [a, b] = bodies.map(|body| masses.get(body).map_or(0.0, |mass| mass.inv_mass));
                let in_heap = bodies.iter().any(|&body| effort.is_in_heap(body));
                let yields = scale.map_or(0.0, |scale| scale.yielding(a > 0.0 && b > 0.0, in_heap, pressed));
                archive.near(sag, yields * share * (a + b))?;
            }
            if has_need {
                archive.near(&mut slot.need, *sag / (share * share * config.promised_sag(slot.size)))?;
            }
        }
        Ok(())
    }
}

impl Buffers {
    /// How a slot is to be written, for its rows as they are.
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
        // How far apart surfaces are, and their velocities, every step writes anew; and where friction has the direction of the slip, all of it.
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

/// Whether no rotation changes the inverse inertia of a body.
fn has_equal_moments(body: &Body) -> bool {
    let moments = body.mass.principal_inertia;
    moments.x == moments.y && moments.y == moments.z
}

/// Writes what is most of the time as `usual` makes it, or reads it.
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

/// Impulses, three bits each for those that are zero, whose friction has either sign. How large they were within a step ends with it.
fn walk_impulses<A: Archive>(impulses: &mut [ImpulseRow], archive: &mut A) -> Result<()> {
    const LOADED: u64 = 4;
    let signed = |bit: u64| if bit == 0 { 0.0_f32 } else { -0.0 };
    let empty = |kind: u64| ImpulseRow {
        tangent_1: signed(kind & 1),
        tangent_2: signed(kind >> 1 & 1),
        ..ImpulseRow::default()
    };
    let bits_of = |impulse: &ImpulseRow| [impulse.normal, impulse.tangent_1, impulse.tangent_2].map(f32::to_bits);
    let kind =
        |impulse: &ImpulseRow| (0..LOADED).find(|&kind| bits_of(&empty(kind)) == bits_of(impulse)).unwrap_or(LOADED);
    let mut kinds = impulses.iter().rev().fold(0, |kinds, impulse| kinds << 3 | kind(impulse));
    archive.number(&mut kinds)?;
    for (k, impulse) in impulses.iter_mut().enumerate() {
        let kind = kinds >> (3 * k) & 7;
        if A::READS {
            *impulse = empty(kind);
        }
        if kind >= LOADED {
            impulse.normal.walk(archive)?;
            impulse.tangent_1.walk(archive)?;
            impulse.tangent_2.walk(archive)?;
        }
    }
    Ok(())
}

/// A slot by its index, with what of it does not follow from its manifold.
type OtherSlot = (u32, (Write, (bool, (f32, Edge))));

/// Slots and edges, which are those of the manifolds of the detector; whether each has one.
fn walk_slots<A: Archive>(slots: &mut Slots, detector: &Detector, archive: &mut A) -> Result<Vec<bool>> {
    let Slots { all, edges, colliders, free, taken } = slots;
    let count = archive.count(all.len())?;
    let kinds = detector.kinds();
    let none = (FREE, Edge { a: IMMOVABLE, b: IMMOVABLE, color: None, rank: 0 });
    let (mut settled, mut is_taken) = (vec![none; count], vec![false; count]);
    if A::READS {
        colliders.resize(count, [0; 2]);
    }
    for (place, pair) in detector.placed_pairs() {
        for (k, manifold) in (0..).zip(&pair.manifolds).filter(|(_, manifold)| manifold.slot != NO_SLOT) {
            let i = manifold.slot as usize;
            ensure(is_taken.get(i) == Some(&false), || format!("two contacts in slot {i} of {count}"))?;
            (settled[i], is_taken[i]) = (Slots::settled(kinds, place, pair, k), true);
            colliders[i] = pair.colliders;
        }
    }
    // What waits for the next step, and what the last one left otherwise.
    let mut others: Vec<OtherSlot> = Vec::new();
    if A::READS {
        (*all, *edges) = settled.into_iter().unzip();
    } else {
        let is_other = |&i: &usize| {
            let ((slot, edge), (now, has)) = (settled[i], (&all[i], &edges[i]));
            let same_slot =
                (now.write, now.takes_part, now.size.to_bits()) == (slot.write, slot.takes_part, slot.size.to_bits());
            is_taken[i] && !(same_slot && (has.a, has.b, has.rank) == (edge.a, edge.b, edge.rank))
        };
        let other = |i: usize| (i as u32, (all[i].write, (all[i].takes_part, (all[i].size, edges[i]))));
        others.extend((0..count).filter(is_other).map(other));
    }
    others.walk(archive)?;
    for (i, (write, (takes_part, (size, edge)))) in others {
        let exist = [edge.a, edge.b].iter().all(|&body| body == IMMOVABLE || (body as usize) < kinds.len());
        ensure(exist && (i as usize) < count, || format!("slot {i} of {count} is of other bodies"))?;
        let slot = &mut all[i as usize];
        (slot.write, slot.takes_part, slot.size, edges[i as usize]) = (write, takes_part, size, edge);
    }
    walk_colors(edges, archive)?;
    free.walk(archive)?;
    taken.walk(archive)?;
    let mut is_used = is_taken.clone();
    for &i in &*free {
        ensure(is_used.get(i as usize) == Some(&false), || format!("slot {i} of {count} is not free"))?;
        is_used[i as usize] = true;
    }
    ensure(is_used.iter().all(|used| *used), || "a slot is neither taken nor free".to_owned())?;
    Ok(is_taken)
}

/// Colors, in runs of slots that have the same one.
fn walk_colors<A: Archive>(edges: &mut [Edge], archive: &mut A) -> Result<()> {
    let mut rest = edges;
    while let Some(first) = rest.first() {
        let (mut color, all) = (first.color, rest.len());
        let mut run = rest.iter().take_while(|edge| edge.color == color).count();
        color.walk(archive)?;
        run.walk(archive)?;
        ensure(run > 0 && run <= all, || format!("{run} of {all} slots have a color"))?;
        let (own, others) = rest.split_at_mut(run);
        own.iter_mut().for_each(|edge| edge.color = color);
        rest = others;
    }
    Ok(())
}
