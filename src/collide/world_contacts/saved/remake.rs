//! Recomputes manifolds from earlier poses of their bodies.

use rayon::prelude::*;

use super::super::WorldContacts;
use crate::collide::collider::{BodyState, FARTHEST, is_placed};
use crate::collide::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use crate::collide::manifold::Manifold;
use crate::collide::pair::{Pair, PairScratch, Side};
use crate::collide::pairs::{Placed, Track};
use crate::collide::path::ANEW;
use crate::error::{Result, ensure, input};
use crate::lanes::InstructionSet;

/// Pairs that one task recomputes.
const PAIRS_A_TASK: usize = 512;

impl WorldContacts {
    /// Whether the manifolds of a pair can be recomputed, if its colliders and their data are unchanged.
    pub(super) fn is_remade(&self, i: usize) -> bool {
        let then = self.pairs.computed_at(i).filter(|_| self.pairs.tracks[i].predicted != ANEW);
        then.is_some_and(|then| then.iter().all(|place| place.is_centered == 1.0))
            && !self.pairs[i].manifolds.is_empty()
            && !self.pairs[i].is_mended
    }

    /// Whether recomputed manifolds of pairs have the same bits.
    pub(super) fn are_same_again(&self, pairs: &[u32]) -> bool {
        pairs.par_chunks(PAIRS_A_TASK).all(|chunk| {
            let mut same = 0;
            self.make_again(chunk, |k, now| {
                let then = &self.pairs[chunk[k] as usize].manifolds;
                let is_same = now.len() == then.len() && now.iter().zip(then).all(|(now, then)| now.is_as(then));
                same += usize::from(is_same);
            });
            same == chunk.len()
        })
    }

    /// Recomputes the manifolds of these pairs, and assigns their slots. `counts` has the number of manifolds of each
    /// pair.
    pub(super) fn remake(&mut self, wanted: &[u32], counts: &[u32], mut slots: &[u32]) -> Result<()> {
        let can_be = |&i: &u32| {
            let Track { predicted, then, .. } = &self.pairs.tracks[i as usize];
            then.iter().all(|place| is_placed(place.center, place.rotation, FARTHEST)) && *predicted >= 0.0
        };
        ensure(wanted.par_iter().all(can_be), || "a pair was computed where nothing can be".to_owned())?;
        let again = wanted.par_chunks(PAIRS_A_TASK).flat_map_iter(|chunk| {
            let mut all = vec![Vec::new(); chunk.len()];
            self.make_again(chunk, |k, now| all[k] = std::mem::take(now));
            all
        });
        let again: Vec<Vec<Manifold>> = again.collect();
        for ((mut manifolds, &i), &count) in again.into_iter().zip(wanted).zip(counts) {
            let own = slots.split_off(..count as usize).filter(|own| own.len() == manifolds.len());
            let own = own.ok_or_else(|| input!("pair {i} has {} manifolds, not {count}", manifolds.len()))?;
            manifolds.iter_mut().zip(own).for_each(|(manifold, &slot)| manifold.slot = slot);
            self.pairs[i as usize].manifolds = manifolds;
        }
        Ok(())
    }

    /// Recomputes the manifolds of pairs at the earlier poses, and calls `with` on the index of each pair in the chunk
    /// and on its manifolds. Cuboid pairs that do not touch get no call.
    fn make_again(&self, chunk: &[u32], mut with: impl FnMut(usize, &mut Vec<Manifold>)) {
        let Some(&first) = chunk.first() else { return };
        let mut scratch = PairScratch::default();
        let mut again = self.pairs[first as usize].clone();
        let begin = |pair: &Pair, again: &mut Pair| {
            again.clone_from(pair);
            again.manifolds.clear();
        };
        let mut states = Vec::with_capacity(2 * chunk.len());
        let mut cuboids = Vec::with_capacity(chunk.len());
        for (number, &i) in chunk.iter().enumerate() {
            let (pair, track) = (&self.pairs[i as usize], &self.pairs.tracks[i as usize]);
            let state = |&Placed { rotation, center, .. }: &Placed| BodyState {
                rotation,
                center,
                position: center,
                ..BodyState::default()
            };
            states.extend(track.then.iter().map(state));
            let places = [pair.collider_a, pair.collider_b];
            if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
                let bodies = [0, 1].map(|side| (2 * number + side) as u32);
                cuboids.push(CuboidPair {
                    bodies,
                    cuboids: places,
                    prediction: track.predicted,
                    number: number as u32,
                });
            } else {
                begin(pair, &mut again);
                again.compute(self.sides_of(pair, &states[2 * number..]), track.predicted, None, &mut scratch);
                with(number, &mut again.manifolds);
            }
        }
        let set = InstructionSet::default();
        cuboid_contacts(set, &states, &self.cuboids, &cuboids, &mut CuboidScratch::default(), &mut |number, write| {
            let number = number as usize;
            let i = chunk[number] as usize;
            let (pair, track) = (&self.pairs[i], &self.pairs.tracks[i]);
            begin(pair, &mut again);
            again.take_over(self.sides_of(pair, &states[2 * number..]), track.predicted, write, None, &mut scratch);
            with(number, &mut again.manifolds);
        });
    }

    fn sides_of<'a>(&'a self, pair: &Pair, states: &'a [BodyState]) -> [Side<'a>; 2] {
        let side = |collider: u32, state: &'a BodyState| (&self.colliders[collider as usize], state);
        [side(pair.collider_a, &states[0]), side(pair.collider_b, &states[1])]
    }
}
