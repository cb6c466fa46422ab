//! The pairs of one world as bytes.

use rayon::prelude::*;

use super::super::WorldContacts;
use super::places::walk_places_then;
use crate::collide::collider::ColliderInfo;
use crate::collide::manifold::{Manifold, NO_SLOT};
use crate::collide::pair::Pair;
use crate::collide::pairs::{NEVER, Pairs, Track};
use crate::error::{Result, ensure, input};
use crate::saved::{Archive, Columns, Saved};
use crate::world::World;

/// The encoding of a pair.
#[derive(Clone, Copy, Default)]
struct Flags {
    is_swapped: bool,
    takes_part: bool,
    /// Sizes and bodies follow from the colliders.
    is_plain: bool,
    /// The manifolds were computed before.
    is_computed: bool,
    /// The manifolds can be recomputed from the rest.
    are_remade: bool,
    /// The number of manifolds; 3 for more than 2.
    manifolds: u8,
}

impl Flags {
    fn walk(&mut self, columns: &mut Columns) -> Result<()> {
        let Self { is_swapped, takes_part, is_plain, is_computed, are_remade, manifolds } = self;
        let all = [is_swapped, takes_part, is_plain, is_computed, are_remade];
        let mut bits = (0..).zip(&all).map(|(k, flag)| u8::from(**flag) << k).sum::<u8>() | *manifolds << 5;
        columns.byte(FLAGS, &mut bits)?;
        *manifolds = bits >> 5 & 3;
        (0..).zip(all).for_each(|(k, flag)| *flag = bits >> k & 1 == 1);
        Ok(())
    }
}

/// The columns of pairs.
const FLAGS: usize = 0;
const FIRST: usize = 1;
const SECOND: usize = 2;
const PREDICTED: usize = 3;
const MANIFOLDS: usize = 4;

/// The encoded form of a pair.
#[derive(Default)]
struct PairRecord {
    flags: Flags,
    /// The colliders, the smaller index first.
    key: (u32, u32),
    predicted: f32,
    manifolds: u32,
}

impl PairRecord {
    /// Writes or reads it. `last` is the first collider of the pair before, and `base` is a guess of the prediction
    /// distance.
    fn walk(&mut self, last: u32, base: [f32; 2], colliders: &[ColliderInfo], columns: &mut Columns) -> Result<()> {
        let Self { flags, key, predicted, manifolds } = self;
        flags.walk(columns)?;
        columns.index(FIRST, &mut key.0, last)?;
        columns.index(SECOND, &mut key.1, key.0)?;
        let both = [key.0, key.1].map(|collider| colliders.get(collider as usize));
        let [Some(a), Some(b)] = both else {
            return Err(input!("a pair is of colliders {key:?} of {}", colliders.len()));
        };
        if flags.is_computed {
            let guess = if flags.is_plain { base[0] * a.size.min(b.size) + base[1] } else { 0.0 };
            columns.near(PREDICTED, predicted, guess)?;
        } else {
            *predicted = NEVER;
        }
        match flags.manifolds {
            3 => columns.index(MANIFOLDS, manifolds, 3),
            count => {
                *manifolds = count.into();
                Ok(())
            }
        }
    }

    /// The pair, without its contacts.
    fn begin(&self, colliders: &[ColliderInfo]) -> (Pair, Track) {
        let (a, b) = if self.flags.is_swapped { (self.key.1, self.key.0) } else { self.key };
        let mut pair = Pair::new(a, b, colliders);
        let mut track = Track::of(&pair, colliders);
        (pair.takes_part, track.takes_part) = (self.flags.takes_part, f32::from(self.flags.takes_part));
        track.predicted = self.predicted;
        // Such a manifold is saved in full, like every other one that cannot be recomputed.
        pair.is_mended = !self.flags.are_remade;
        (pair, track)
    }

    /// Whether its manifolds can be recomputed from the rest.
    fn is_remade(&self) -> bool {
        self.flags.are_remade && self.flags.is_plain && self.flags.is_computed
    }
}

impl WorldContacts {
    pub(super) fn walk_pairs<A: Archive>(
        &mut self,
        are_current: &[bool],
        known: u32,
        world: &World,
        base: [f32; 2],
        archive: &mut A,
    ) -> Result<()> {
        let count = archive.count(self.pairs.len())?;
        let records = archive.chunks(count, MANIFOLDS + 1, |range, columns| {
            let (mut all, mut last) = (Vec::with_capacity(range.len()), 0);
            for i in range {
                let mut record = if columns.reads() { PairRecord::default() } else { self.record(i, are_current) };
                record.walk(last, base, &self.colliders, columns)?;
                last = record.key.0;
                all.push(record);
            }
            Ok(all)
        })?;
        let records: Vec<PairRecord> = records.into_iter().flatten().collect();
        if A::READS {
            self.keys = records.iter().map(|record| record.key).collect();
            let begun = records.par_iter().with_min_len(512).map(|record| record.begin(&self.colliders));
            let (all, tracks) = begun.unzip();
            self.pairs = Pairs { all, tracks };
        }
        for (i, _) in records.iter().enumerate().filter(|(_, record)| !record.flags.is_plain) {
            // The data that a pair copies from its colliders.
            let (pair, track) = (&mut self.pairs.all[i], &mut self.pairs.tracks[i]);
            pair.body_a.walk(archive)?;
            pair.body_b.walk(archive)?;
            pair.size.walk(archive)?;
            track.reach_b.walk(archive)?;
            track.unbounded.walk(archive)?;
            (track.bodies, track.size) = ([pair.body_a, pair.body_b], pair.size);
        }
        let exist = |track: &Track| track.bodies.iter().all(|&body| body < known);
        ensure(self.pairs.tracks.par_iter().with_min_len(512).all(exist), || {
            format!("a pair is of a body beyond the last of {known}")
        })?;
        walk_places_then(&mut self.pairs, known as usize, world, archive)?;
        for (i, record) in records.iter().enumerate().filter(|(_, record)| !record.is_remade()) {
            let manifolds = &mut self.pairs[i].manifolds;
            if A::READS {
                for _ in 0..record.manifolds {
                    let mut own = Manifold::blank();
                    own.walk(archive)?;
                    manifolds.push(own);
                }
            } else {
                manifolds.iter_mut().try_for_each(|own| own.walk(archive))?;
            }
        }
        let (mut remade, mut counts) = (Vec::new(), Vec::new());
        for (i, record) in (0..).zip(&records).filter(|(_, record)| record.is_remade()) {
            remade.push(i);
            counts.push(record.manifolds);
        }
        let slots = self.walk_slots(&remade, &counts, archive)?;
        if A::READS {
            return self.remake(&remade, &counts, &slots);
        }
        debug_assert!(self.are_same_again(&remade), "a manifold does not follow from where its bodies were");
        Ok(())
    }

    fn record(&self, i: usize, are_current: &[bool]) -> PairRecord {
        let (pair, track) = (&self.pairs[i], &self.pairs.tracks[i]);
        let key = self.keys[i];
        let plain = || Track::of(&Pair::new(pair.collider_a, pair.collider_b, &self.colliders), &self.colliders);
        let is_plain = are_current[key.0 as usize] && are_current[key.1 as usize] && is_plain(pair, track, &plain());
        let flags = Flags {
            is_swapped: pair.collider_a > pair.collider_b,
            takes_part: pair.takes_part,
            is_plain,
            is_computed: track.predicted != NEVER,
            are_remade: is_plain && self.is_remade(i),
            manifolds: pair.manifolds.len().min(3) as u8,
        };
        PairRecord { flags, key, predicted: track.predicted, manifolds: pair.manifolds.len() as u32 }
    }

    /// The slots of the manifolds of some pairs; `counts` has the number of each. The saved order is the order of
    /// slots, in which those of one color follow the order of the pairs.
    fn walk_slots<A: Archive>(&self, pairs: &[u32], counts: &[u32], archive: &mut A) -> Result<Vec<u32>> {
        let mut places: Vec<(u32, u32)> = Vec::new();
        if !A::READS {
            let slots = pairs.iter().flat_map(|&i| self.pairs[i as usize].manifolds.iter().map(|own| own.slot));
            places.extend(slots.zip(0..));
            places.par_sort_unstable();
        }
        let count = archive.count(places.len())?;
        let in_all: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        ensure(in_all == count as u64, || format!("{count} slots for {in_all} manifolds"))?;
        let read = archive.chunks(count, 2, |range, columns| {
            let (mut all, mut last) = (Vec::new(), (0_u32, 0_u32));
            for i in range {
                let mut own = places.get(i).copied().unwrap_or_default();
                columns.index(0, &mut own.0, last.0.wrapping_add(1))?;
                columns.index(1, &mut own.1, last.1.wrapping_add(1))?;
                last = own;
                if columns.reads() {
                    all.push(own);
                }
            }
            Ok(all)
        })?;
        let mut slots = vec![None; if A::READS { count } else { 0 }];
        for (slot, manifold) in read.into_iter().flatten() {
            let own = slots.get_mut(manifold as usize).filter(|own| own.is_none());
            *own.ok_or_else(|| input!("manifold {manifold} of {count} has two slots"))? = Some(slot);
        }
        Ok(slots.into_iter().map(|slot| slot.unwrap_or(NO_SLOT)).collect())
    }
}

/// Whether the copied data of a pair is the same as for a new pair.
fn is_plain(pair: &Pair, track: &Track, plain: &Track) -> bool {
    let rest = |track: &Track| [track.size, track.reach_b, track.unbounded].map(f32::to_bits);
    track.bodies == plain.bodies
        && [pair.body_a, pair.body_b] == plain.bodies
        && pair.size.to_bits() == plain.size.to_bits()
        && rest(track) == rest(plain)
}
