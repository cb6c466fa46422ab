//! The contacts of pairs, brought to where the bodies are: reused while the bodies hardly moved, else computed. Sixteen pairs at a time are
//! tested, and those of cuboids are computed as many at a time; each pair is updated by itself, so that it does not matter with which others.

use std::ops::Range;
use std::sync::Mutex;

use super::collider::{BodyState, ColliderInfo, CuboidPlace, Margins, POSE, VELOCITY};
use super::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use super::lane_pose::{Pose, Turn, backwards, choose, length, negative, product};
use super::pair::{Motion, Pair, PairScratch, Side, Update};
use super::pairs::{NEVER, PairChunk, Placed, Track};
use crate::backend::cpu::simd::{InstructionSet, Lanes, Row8, WIDTH, Wide, Work, columns};
use crate::math::{Quat, dot3, vec3};

/// Square of the sine of half the angle that either body of a reused manifold may have turned: 0.03 rad. Normals stay as they were
/// computed, so this is how far bodies that turn together may see gravity from the wrong side. At 0.01 rad arches that open a little
/// are computed anew while they do, and one of 17 stones, 0.12 of its radius thick, falls with 8 substeps.
const RECYCLE_TURN: f32 = 2.25e-4;

/// The same where one of them is kinematic, and turns on and on: 0.002 rad. At 0.1 rad a block on a board that tilted slowly
/// slipped 1.6 degrees late, and a ball lost a quarter of its way.
const RECYCLE_TURN_KINEMATIC: f32 = 1e-6;

/// Largest turn of a body in a step with which planes are seen as far ahead as the body gets (rad). The rod of 1000 rad/s (H7) turns by 17.
const MOST_FORESEEN_TURN: f32 = 0.5;

/// What an update reads.
pub(super) struct Narrow<'a> {
    pub colliders: &'a [ColliderInfo],
    pub cuboids: &'a [CuboidPlace],
    pub moving: &'a [BodyState],
    pub margins: Margins,
}

/// A pair that is not as it was.
pub(super) struct Updated {
    /// Its place.
    pub pair: u32,
    pub computed: bool,
    /// Whether what touches, or with how many points, is other than before.
    pub reshaped: bool,
}

/// Memory that one thread reuses from chunk to chunk.
#[derive(Default)]
pub(super) struct Scratch {
    pair: PairScratch,
    tests: Vec<Tested>,
    events: Vec<Event>,
    cuboid_pairs: Vec<CuboidPair>,
    cuboids: CuboidScratch,
}

/// What the test says of sixteen pairs.
#[derive(Clone, Copy, Default, PartialEq)]
struct Tested {
    /// One of the three numbers below.
    verdict: Wide,
    /// Whether the pair takes part from now on or no longer does.
    changes: Wide,
    prediction: Wide,
    /// Whether a body of the pair is not still.
    moves: Wide,
}

/// The manifolds stay as they are.
const REUSED: f32 = 0.0;
/// They are to be computed.
const MOVED: f32 = 1.0;
/// A body is where nothing can be computed.
const LOST: f32 = 2.0;

/// A pair that the test found not to stay as it is.
struct Event {
    place: u32,
    changes: bool,
    /// None until it is computed.
    update: Option<Update>,
}

impl Narrow<'_> {
    /// Updates some pairs; returns those that are not as they were, in their order.
    pub fn update(&self, chunk: PairChunk, scratch: &mut Scratch) -> Vec<Updated> {
        let PairChunk { first, pairs, tracks, motions } = chunk;
        let Scratch { pair: pair_scratch, tests, events, cuboid_pairs, cuboids } = scratch;
        tests.clear();
        let results = Mutex::new((&mut *tests, &mut *motions));
        let test = ReuseTest { tracks, moving: self.moving, margins: self.margins, results };
        InstructionSet::default().run(&test, 0..tracks.len().div_ceil(WIDTH));
        events.clear();
        cuboid_pairs.clear();
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
                if verdict == LOST {
                    pair.end();
                    track.predicted = NEVER;
                    update = Some(Update::Reshaped);
                } else if verdict == MOVED {
                    let bodies = track.bodies.map(|body| &self.moving[body as usize]);
                    let prediction = tested.prediction.0[lane];
                    track.then = bodies.map(Placed::of);
                    track.predicted = prediction;
                    motions[place] = Motion::default();
                    let places = [pair.collider_a, pair.collider_b];
                    if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
                        let number = events.len() as u32;
                        cuboid_pairs.push(CuboidPair { bodies: track.bodies, cuboids: places, prediction, number });
                        update = None;
                    } else {
                        update = Some(pair.compute(self.sides(pair), prediction, pair_scratch));
                        track.has_manifolds = f32::from(!pair.manifolds.is_empty());
                    }
                }
                events.push(Event { place: place as u32, changes, update });
            }
        }
        cuboid_contacts(self.moving, self.cuboids, cuboid_pairs, cuboids, |number, write| {
            let event = &mut events[number as usize];
            let pair = &mut pairs[event.place as usize];
            let prediction = tracks[event.place as usize].predicted;
            event.update = Some(pair.take_over(self.sides(pair), prediction, write, pair_scratch));
        });
        let finish = |event: &Event| {
            let (pair, track) = (&mut pairs[event.place as usize], &mut tracks[event.place as usize]);
            let update = event.update.unwrap_or_else(|| pair.part());
            track.has_manifolds = f32::from(!pair.manifolds.is_empty());
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

/// Tests which pairs are reused, and notes how the bodies of those moved.
struct ReuseTest<'a> {
    tracks: &'a [Track],
    moving: &'a [BodyState],
    margins: Margins,
    results: Mutex<(&'a mut Vec<Tested>, &'a mut [Motion])>,
}

impl Work for ReuseTest<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let mut results = self.results.lock().expect("no other thread has it");
        let (tests, motions) = &mut *results;
        for group in groups {
            let (mut which, mut bodies) = ([0; WIDTH], [[0; WIDTH]; 2]);
            for lane in 0..WIDTH {
                let place = (group * WIDTH + lane).min(self.tracks.len() - 1);
                which[lane] = place as u32;
                bodies[0][lane] = self.tracks[place].bodies[0];
                bodies[1][lane] = self.tracks[place].bodies[1];
            }
            let (tested, rows) = self.test::<L>(&which, &bodies);
            tests.push(tested);
            for (lane, place) in (group * WIDTH..self.tracks.len().min((group + 1) * WIDTH)).enumerate() {
                if self.tracks[place].has_manifolds != 0.0
                    && tested.verdict.0[lane] == REUSED
                    && tested.moves.0[lane] != 0.0
                {
                    motions[place] = Motion::of(&rows[0][lane], &rows[1][lane]);
                }
            }
        }
    }
}

impl ReuseTest<'_> {
    /// The verdict on sixteen pairs, and the rows of their motions.
    #[inline(always)]
    fn test<L: Lanes>(&self, which: &[u32; WIDTH], bodies: &[[u32; WIDTH]; 2]) -> (Tested, [[Row8; WIDTH]; 2]) {
        let (zero, one, two) = (L::constant(0.0), L::constant(1.0), L::constant(2.0));
        let number = L::constant;
        let track = columns::<L, _>(self.tracks, 0, which);
        let then_a = Pose::of(columns::<L, _>(self.tracks, 1, which));
        let then_b = Pose::of(columns::<L, _>(self.tracks, 2, which));
        let now_a = columns::<L, _>(self.moving, POSE, &bodies[0]);
        let now_b = columns::<L, _>(self.moving, POSE, &bodies[1]);
        let v_a = columns::<L, _>(self.moving, VELOCITY, &bodies[0]);
        let v_b = columns::<L, _>(self.moving, VELOCITY, &bodies[1]);
        let [size, reach_b, predicted, unbounded, _, takes_part, ..] = track;
        let kinematic = L::larger(now_a[7], now_b[7]);
        let (now_a, now_b) = (Pose::of(now_a), Pose::of(now_b));
        let dt = number(f64::from(self.margins.dt));

        let v = vec3(v_b[0], v_b[1], v_b[2]) - vec3(v_a[0], v_a[1], v_a[2]);
        let w_b = vec3(v_b[3], v_b[4], v_b[5]);
        let w = w_b - vec3(v_a[3], v_a[4], v_a[5]);
        let approach = length(v) + reach_b * length(w);
        let base = number(f64::from(self.margins.speculative)) * size + number(f64::from(self.margins.fall));
        // A contact with a plane is true however far away it is seen; with others it would stop what passes by. Arms stay the same within a step.
        let is_far_seen = L::and(unbounded.gt(zero), number(f64::from(MOST_FORESEEN_TURN)).gt(length(w_b) * dt));
        let farthest = L::select(two * size, number(f64::from(f32::MAX)), is_far_seen);
        let prediction = base + L::smaller(approach * dt, farthest);

        let (turn_a, turn_b) =
            (turn_since(now_a.rotation, then_a.rotation), turn_since(now_b.rotation, then_b.rotation));
        // How far any point of b that can touch moved as seen from a. 2 |vector part| is the angle, if small.
        let carried = then_b.at - then_a.at;
        let apart = now_b.at - now_a.at;
        let shift = apart - Turn::of(turn_a).of_vector(carried);
        let turn = product(backwards(turn_a), turn_b);
        let moved = length(shift) + two * length(turn.axis) * reach_b;
        let turned = L::larger(dot3(turn_a.axis, turn_a.axis), dot3(turn_b.axis, turn_b.axis));
        let most = number(f64::from(RECYCLE_TURN));
        let most = L::select(most, number(f64::from(RECYCLE_TURN_KINEMATIC)), kinematic.gt(zero));
        let is_still_near = L::and((number(f64::from(self.margins.recycle)) * size).gt(moved), most.gt(turned));
        let is_new = L::select(zero, one, prediction.gt(predicted + number(0.5) * base));
        let is_reused = L::and(is_still_near, one.gt(is_new));

        // The more awake of the two bodies.
        let activity = L::larger(v_a[7], v_b[7]);
        let in_range = L::smaller(v_a[6], v_b[6]);
        let verdict = L::select(number(f64::from(MOVED)), number(f64::from(REUSED)), is_reused);
        let verdict = L::select(number(f64::from(LOST)), verdict, in_range.gt(zero));
        let moves = L::select(zero, one, activity.gt(zero));
        let verdict = L::select(number(f64::from(REUSED)), verdict, activity.gt(zero));
        let is_awake = L::select(zero, one, activity.gt(one));
        let changes = (is_awake - takes_part) * (is_awake - takes_part);
        let tested = Tested {
            verdict: verdict.store(),
            changes: changes.store(),
            prediction: prediction.store(),
            moves: moves.store(),
        };
        let drift = apart - carried;
        let (a, b) = (turn_a.axis, turn_b.axis);
        let first = L::scattered([a.x, a.y, a.z, turn_a.w, drift.x, drift.y, drift.z, zero]);
        let second = L::scattered([b.x, b.y, b.z, turn_b.w, zero, zero, zero, zero]);
        (tested, [first, second])
    }
}

/// Rotation from `then` to `now`, by the shorter way.
#[inline(always)]
fn turn_since<L: Lanes>(now: Quat<L>, then: Quat<L>) -> Quat<L> {
    let turn = product(now, backwards(then));
    let is_long = L::constant(0.0).gt(turn.w);
    Quat { axis: choose(turn.axis, negative(turn.axis), is_long), w: L::select(turn.w, -turn.w, is_long) }
}
