//! Updates the contacts of pairs to the present poses. Contacts are reused while the bodies have hardly moved, else
//! they are computed. Pairs are tested sixteen at a time, and cuboid pairs are computed sixteen at a time. Each pair is
//! updated by itself, so the other pairs in a group do not matter.

use std::cell::RefCell;
use std::sync::Mutex;

use super::collider::{BodyState, ColliderInfo, CuboidPlace, Margins};
use super::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use super::flush::Neighbors;
use super::manifold::Manifold;
use super::pair::{Pair, PairScratch, Side, Update};
use super::pairs::{NEVER, PairChunk, Placed};
use super::path::Going;
use super::reuse::{LOST, MOVED, REUSED, ReuseTest, Tested};
use crate::lanes::{InstructionSet, WIDTH, Wide};
use crate::panics::blaming;

/// Input of an update.
pub(super) struct Narrow<'a> {
    pub colliders: &'a [ColliderInfo],
    pub cuboids: &'a [CuboidPlace],
    pub moving: &'a [BodyState],
    pub margins: Margins,
    pub neighbors: Neighbors<'a>,
}

/// A pair that changed.
pub(super) struct Updated {
    /// Its index.
    pub pair: u32,
    pub computed: bool,
    /// Whether the touching subshapes or the number of points changed.
    pub reshaped: bool,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Memory that one thread reuses from chunk to chunk and from step to step.
#[derive(Default)]
struct Scratch {
    pair: PairScratch,
    tests: Vec<Tested>,
    events: Vec<Event>,
    cuboid_pairs: Vec<CuboidPair>,
    cuboids: CuboidScratch,
    /// Events whose contacts are checked against the paths of their bodies. Pairs that move far also keep their earlier
    /// manifolds here.
    going: Vec<(u32, Going, Vec<Manifold>)>,
}

/// A pair for which the test demands a change.
struct Event {
    place: u32,
    changes: bool,
    /// `None` until the update is computed.
    update: Option<Update>,
}

impl Narrow<'_> {
    /// Updates some pairs. Returns the changed pairs in their order.
    pub fn update(&self, chunk: PairChunk) -> Vec<Updated> {
        SCRATCH.with_borrow_mut(|scratch| self.update_with(chunk, scratch))
    }

    fn update_with(&self, chunk: PairChunk, scratch: &mut Scratch) -> Vec<Updated> {
        let PairChunk { first, pairs, tracks } = chunk;
        let Scratch { pair: pair_scratch, tests, events, cuboid_pairs, cuboids, going } = scratch;
        let set = InstructionSet::default();
        tests.clear();
        let test = ReuseTest { tracks, moving: self.moving, margins: self.margins, results: Mutex::new(tests) };
        set.run(&test, 0..tracks.len().div_ceil(WIDTH));
        events.clear();
        cuboid_pairs.clear();
        going.clear();
        for (group, tested) in tests.iter().enumerate() {
            if tested.verdict == Wide([REUSED; WIDTH]) && tested.changes == Wide::default() {
                continue;
            }
            for lane in 0..WIDTH.min(tracks.len() - group * WIDTH) {
                let (verdict, changes) = (tested.verdict.0[lane], tested.changes.0[lane] != 0.0);
                if verdict == REUSED && !changes {
                    continue;
                }
                let place = group * WIDTH + lane;
                let (pair, track) = (&mut pairs[place], &mut tracks[place]);
                let mut update = Some(Update::Reused);
                if pair.is_refused {
                    // The filter ended its manifolds.
                    let had_contacts = !pair.manifolds.is_empty();
                    update = Some(if had_contacts { Update::Reshaped } else { Update::Reused });
                } else if verdict == LOST {
                    pair.end();
                    track.predicted = NEVER;
                    update = Some(Update::Reshaped);
                } else if verdict == MOVED {
                    let bodies = track.bodies.map(|body| &self.moving[body as usize]);
                    let prediction = tested.prediction.0[lane];
                    track.then = bodies.map(Placed::of);
                    track.predicted = prediction;
                    if let Some(goes) = self.going(track) {
                        let before = if goes.is_far() { pair.manifolds.clone() } else { Vec::new() };
                        going.push((events.len() as u32, goes, before));
                    }
                    let places = [pair.collider_a, pair.collider_b];
                    if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
                        let number = events.len() as u32;
                        cuboid_pairs.push(CuboidPair { bodies: track.bodies, cuboids: places, prediction, number });
                        update = None;
                    } else {
                        let bodies = [pair.body_a, pair.body_b];
                        update = Some(blaming(bodies, || {
                            pair.compute(self.sides(pair), prediction, Some(&self.neighbors), pair_scratch)
                        }));
                    }
                }
                events.push(Event { place: place as u32, changes, update });
            }
        }
        cuboid_contacts(set, self.moving, self.cuboids, cuboid_pairs, cuboids, &mut |number, write| {
            let event = &mut events[number as usize];
            let pair = &mut pairs[event.place as usize];
            let prediction = tracks[event.place as usize].predicted;
            event.update =
                Some(pair.take_over(self.sides(pair), prediction, write, Some(&self.neighbors), pair_scratch));
        });
        for (number, goes, before) in going.drain(..) {
            let event = &mut events[number as usize];
            let (pair, track) = (&mut pairs[event.place as usize], &mut tracks[event.place as usize]);
            let update = event.update.unwrap_or_else(|| pair.part());
            let bodies = [pair.body_a, pair.body_b];
            let scratch = (&mut *pair_scratch, &mut *cuboids);
            let far = blaming(bodies, || self.follow_ways(pair, track, (goes, before), scratch));
            event.update = Some(far.unwrap_or(update));
        }
        let finish = |event: &Event| {
            let (pair, track) = (&mut pairs[event.place as usize], &mut tracks[event.place as usize]);
            let update = event.update.unwrap_or_else(|| pair.part());
            if event.changes {
                pair.takes_part = !pair.takes_part;
                track.takes_part = f32::from(pair.takes_part);
            }
            let computed = update != Update::Reused;
            let reshaped = update == Update::Reshaped || event.changes && pair.is_touching();
            Updated { pair: first + event.place, computed, reshaped }
        };
        events.iter().map(finish).collect()
    }

    /// The colliders of a pair, and their bodies.
    fn sides(&self, pair: &Pair) -> [Side<'_>; 2] {
        let side = |c: u32, body: u32| (&self.colliders[c as usize], &self.moving[body as usize]);
        [side(pair.collider_a, pair.body_a), side(pair.collider_b, pair.body_b)]
    }
}
