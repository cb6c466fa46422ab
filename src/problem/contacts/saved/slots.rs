//! The slots of contacts as bytes. Most of them follow from their manifolds.

use super::super::super::slots::{FREE, Slots, Write};
use crate::collide::{Detector, NO_SLOT};
use crate::error::{Result, ensure};
use crate::graph::{Edge, IMMOVABLE};
use crate::saved::{Archive, Saved};

/// The index of a slot, with the fields that do not follow from its manifold.
type OtherSlot = (u32, (Write, (bool, (f32, Edge))));

/// Writes or reads slots and edges. Returns whether each slot has a manifold of the detector.
pub(super) fn walk_slots<A: Archive>(slots: &mut Slots, detector: &Detector, archive: &mut A) -> Result<Vec<bool>> {
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
    // Slots that wait for the next step, or that the last step left in another state.
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

/// Colors, in runs of slots with the same color.
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
