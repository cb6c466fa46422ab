//! The pairs of one world, and a separate array with the data of the reuse test: a third of the bytes, and no
//! manifolds.

use std::ops::{Deref, DerefMut};

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::collider::{BodyState, ColliderInfo};
use super::pair::Pair;

/// The pose of a body.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Placed {
    /// Rotation.
    pub rotation: Quat,
    /// Center of mass (m).
    pub center: Vec3,
    /// 1 if the center is the origin of its frame, otherwise 0.
    pub(super) is_centered: f32,
}

impl Placed {
    pub(super) fn of(body: &BodyState) -> Self {
        let is_centered = body.center.to_array().map(f32::to_bits) == body.position.to_array().map(f32::to_bits);
        Self { rotation: body.rotation, center: body.center, is_centered: f32::from(is_centered) }
    }
}

/// Data of a pair for the reuse test: three rows of eight numbers, so that lanes can gather them.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct Track {
    /// Half of the smallest side of the thinner collider (m).
    pub size: f32,
    /// Radius around the origin of body b that contains its collider (m).
    pub reach_b: f32,
    /// Largest distance of the last prediction (m). For a pair that was never computed it is below every other value.
    pub predicted: f32,
    /// 1 if collider a is unbounded, otherwise 0.
    pub unbounded: f32,
    /// 1 if it takes part in the step, otherwise 0.
    pub takes_part: f32,
    pub rest: f32,
    pub bodies: [u32; 2],
    /// The poses of the bodies when the manifolds were computed.
    pub then: [Placed; 2],
}

/// The predicted distance of a pair that was never computed.
pub(super) const NEVER: f32 = f32::NEG_INFINITY;

impl Track {
    pub fn of(pair: &Pair, colliders: &[ColliderInfo]) -> Self {
        let [a, b] = [pair.collider_a, pair.collider_b].map(|c| &colliders[c as usize]);
        Self {
            size: pair.size,
            reach_b: b.reach,
            predicted: NEVER,
            unbounded: f32::from(a.unbounded),
            takes_part: 1.0,
            rest: 0.0,
            bodies: [pair.body_a, pair.body_b],
            then: [Placed::default(); 2],
        }
    }
}

/// Pairs, in the order of discovery.
#[derive(Default)]
pub(super) struct Pairs {
    pub all: Vec<Pair>,
    /// The test data of each.
    pub tracks: Vec<Track>,
}

crate::saved::cloned!(Pairs { all, tracks });

/// A contiguous part of the pairs.
pub(super) struct PairChunk<'a> {
    /// The index of the first one among all pairs.
    pub first: u32,
    pub pairs: &'a mut [Pair],
    pub tracks: &'a mut [Track],
}

/// Number of pairs for one task. The computed pairs among them fill several groups of lanes.
const PAIRS_A_TASK: usize = 2048;

impl Pairs {
    /// Adds pairs of two colliders each. The collider with the larger reach comes first.
    pub fn begin(&mut self, found: &[(u32, u32)], colliders: &[ColliderInfo]) {
        let begin = |&(i, j): &(u32, u32)| {
            let swap = colliders[j as usize].reach > colliders[i as usize].reach;
            let (a, b) = if swap { (j, i) } else { (i, j) };
            Pair::new(a, b, colliders)
        };
        let first = self.all.len();
        self.all.par_extend(found.par_iter().with_min_len(1024).map(begin));
        let new = self.all[first..].par_iter().with_min_len(1024);
        self.tracks.par_extend(new.map(|pair| Track::of(pair, colliders)));
    }

    /// Ends a pair. The last pair takes its index.
    pub fn swap_remove(&mut self, place: usize) -> Pair {
        self.tracks.swap_remove(place);
        self.all.swap_remove(place)
    }

    /// Ends the contacts of a pair. The next detection computes it again.
    pub fn end(&mut self, place: usize) {
        self.all[place].end();
        self.tracks[place].predicted = NEVER;
    }

    /// The poses of the bodies of a pair when its manifolds were computed. Returns `None` if they never were, or if a
    /// body is out of range.
    pub fn computed_at(&self, place: usize) -> Option<&[Placed; 2]> {
        let track = &self.tracks[place];
        (track.predicted != NEVER).then_some(&track.then)
    }

    pub fn par_chunks_mut(&mut self) -> impl IndexedParallelIterator<Item = PairChunk<'_>> {
        let chunks = self.all.par_chunks_mut(PAIRS_A_TASK).zip(self.tracks.par_chunks_mut(PAIRS_A_TASK)).enumerate();
        chunks.map(|(chunk, (pairs, tracks))| PairChunk { first: (chunk * PAIRS_A_TASK) as u32, pairs, tracks })
    }
}

impl Deref for Pairs {
    type Target = [Pair];
    fn deref(&self) -> &[Pair] {
        &self.all
    }
}

impl DerefMut for Pairs {
    fn deref_mut(&mut self) -> &mut [Pair] {
        &mut self.all
    }
}
