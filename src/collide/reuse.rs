//! Tests sixteen pairs at a time whether their manifolds can be reused: if the bodies hardly moved since they were
//! computed.

use std::ops::Range;
use std::sync::Mutex;

use super::collider::{BodyState, Margins, POSE, VELOCITY};
use super::lane_pose::{Pose, Turn, backwards, length, negative, product};
use super::pairs::Track;
use crate::lanes::{Lanes, WIDTH, Wide, Work, columns};
use crate::math::{Quat, dot3, select3, vec3};

/// Squared sine of half the largest rotation of either body of a reused manifold: 0.03 rad. Normals stay as computed,
/// so bodies that turn together can see gravity at an angle up to this. At 0.01 rad, an arch that opens a little is
/// computed again during that motion, and one of 17 stones, 0.12 of its radius thick, falls with 8 substeps.
const RECYCLE_TURN: f32 = 2.25e-4;

/// The same if one body is kinematic and keeps turning: 0.002 rad. At 0.1 rad a block on a slowly tilting board slipped
/// 1.6 degrees late, and a ball lost a quarter of its path.
const RECYCLE_TURN_KINEMATIC: f32 = 1e-6;

/// Largest rotation of a body in a step for which contacts with planes are predicted over the body's whole path (rad).
/// The rod at 1000 rad/s (H7) turns by 17 rad.
const MAX_FORESEEN_TURN: f32 = 0.5;

/// Results of the test for sixteen pairs.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) struct Tested {
    /// One of the three values below.
    pub verdict: Wide,
    /// Whether the pair starts or stops taking part.
    pub changes: Wide,
    pub prediction: Wide,
}

/// The manifolds stay as they are.
pub(super) const REUSED: f32 = 0.0;
/// The manifolds have to be computed.
pub(super) const MOVED: f32 = 1.0;
/// A body is out of range for computation.
pub(super) const LOST: f32 = 2.0;

/// Tests which pairs are reused, and records the motion of their bodies.
pub(super) struct ReuseTest<'a> {
    pub tracks: &'a [Track],
    pub moving: &'a [BodyState],
    pub margins: Margins,
    pub results: Mutex<&'a mut Vec<Tested>>,
}

impl Work for ReuseTest<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let mut results = self.results.lock().expect("no other thread has it");
        for group in groups {
            let (mut which, mut bodies) = ([0; WIDTH], [[0; WIDTH]; 2]);
            for lane in 0..WIDTH {
                let place = (group * WIDTH + lane).min(self.tracks.len() - 1);
                which[lane] = place as u32;
                bodies[0][lane] = self.tracks[place].bodies[0];
                bodies[1][lane] = self.tracks[place].bodies[1];
            }
            results.push(self.test::<L>(&which, &bodies));
        }
    }
}

impl ReuseTest<'_> {
    /// The verdicts on sixteen pairs.
    #[inline(always)]
    fn test<L: Lanes>(&self, which: &[u32; WIDTH], bodies: &[[u32; WIDTH]; 2]) -> Tested {
        let (zero, one, two) = (L::constant(0.0), L::constant(1.0), L::constant(2.0));
        let number = L::constant;
        let track = columns::<L, _>(self.tracks, 0, which);
        let then_a = Pose::of(columns::<L, _>(self.tracks, 1, which));
        let then_b = Pose::of(columns::<L, _>(self.tracks, 2, which));
        let now_a = columns::<L, _>(self.moving, POSE, &bodies[0]);
        let now_b = columns::<L, _>(self.moving, POSE, &bodies[1]);
        let v_a = columns::<L, _>(self.moving, VELOCITY, &bodies[0]);
        let v_b = columns::<L, _>(self.moving, VELOCITY, &bodies[1]);
        let [size, reach_b, predicted, unbounded, takes_part, ..] = track;
        let kinematic = L::larger(now_a[7], now_b[7]);
        let (now_a, now_b) = (Pose::of(now_a), Pose::of(now_b));
        let dt = number(f64::from(self.margins.dt));

        let v = vec3(v_b[0], v_b[1], v_b[2]) - vec3(v_a[0], v_a[1], v_a[2]);
        let w_b = vec3(v_b[3], v_b[4], v_b[5]);
        let w = w_b - vec3(v_a[3], v_a[4], v_a[5]);
        let approach = length(v) + reach_b * length(w);
        let base = number(f64::from(self.margins.speculative)) * size + number(f64::from(self.margins.fall));
        // A contact with a plane is valid at any distance. Other far contacts would stop bodies that pass by. Arms stay
        // the same within a step.
        let is_far_seen = L::and(unbounded.gt(zero), number(f64::from(MAX_FORESEEN_TURN)).gt(length(w_b) * dt));
        let farthest = L::select(two * size, number(f64::from(f32::MAX)), is_far_seen);
        let prediction = base + L::smaller(approach * dt, farthest);

        let (turn_a, turn_b) =
            (turn_since(now_a.rotation, then_a.rotation), turn_since(now_b.rotation, then_b.rotation));
        // Displacement of any touching point of b relative to a. 2 |vector part| is the angle, if small.
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
        let verdict = L::select(number(f64::from(REUSED)), verdict, activity.gt(zero));
        let is_awake = L::select(zero, one, activity.gt(one));
        let changes = (is_awake - takes_part) * (is_awake - takes_part);
        Tested { verdict: verdict.store(), changes: changes.store(), prediction: prediction.store() }
    }
}

/// Rotation from `then` to `now`, the shorter way around.
#[inline(always)]
fn turn_since<L: Lanes>(now: Quat<L>, then: Quat<L>) -> Quat<L> {
    let turn = product(now, backwards(then));
    let is_long = L::constant(0.0).gt(turn.w);
    Quat { axis: select3(turn.axis, negative(turn.axis), is_long), w: L::select(turn.w, -turn.w, is_long) }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::collide::pairs::{NEVER, Placed};
    use crate::collide::testing::Random;
    use crate::lanes::InstructionSet;

    impl Random {
        fn body(&mut self) -> BodyState {
            let rotation = self.rotation();
            let at = 3.0 * self.vector();
            let [v, w] = [self.vector(), self.vector() * 10.0_f32.powf(3.0 * self.next())];
            let activity = (1.49 * (self.next() + 1.0)) as u32 as f32;
            let [kinematic, in_range] = [self.next() > 0.8, self.next() > -0.95].map(f32::from);
            BodyState {
                rotation,
                center: at,
                kinematic,
                v,
                w,
                in_range,
                activity,
                position: at,
                gravity_scale: 1.0,
                pull: glam::Vec3::ZERO,
                tied: 0.0,
            }
        }

        /// The pose of a body a little earlier.
        fn before(&mut self, body: &BodyState) -> Placed {
            let scale = 10.0_f32.powf(-2.5 + self.next());
            let turn = Quat::from_scaled_axis(self.vector() * scale) * if self.next() > 0.0 { 1.0 } else { -1.0 };
            let center = body.center + self.vector() * scale;
            Placed::of(&BodyState { rotation: turn * body.rotation, center, ..*body })
        }
    }

    /// The verdict on one pair and its prediction, with glam.
    fn of_one(track: &Track, [a, b]: [&BodyState; 2], margins: Margins) -> (f32, f32) {
        let size = track.size;
        let approach = (b.v - a.v).length() + track.reach_b * (b.w - a.w).length();
        let base = margins.speculative * size + margins.fall;
        let is_far_seen = track.unbounded != 0.0 && b.w.length() * margins.dt < MAX_FORESEEN_TURN;
        let farthest = if is_far_seen { f32::MAX } else { 2.0 * size };
        let prediction = base + (approach * margins.dt).min(farthest);
        let since = |now: &BodyState, then: &Placed| {
            let turn = now.rotation * then.rotation.conjugate();
            if turn.w < 0.0 { -turn } else { turn }
        };
        let [then_a, then_b] = &track.then;
        let (turn_a, turn_b) = (since(a, then_a), since(b, then_b));
        let carried = then_b.center - then_a.center;
        let shift = (b.center - a.center) - (turn_a * carried);
        let turn = turn_a.conjugate() * turn_b;
        let moved = shift.length() + 2.0 * turn.xyz().length() * track.reach_b;
        let turned = turn_a.xyz().length_squared().max(turn_b.xyz().length_squared());
        let most = if a.kinematic + b.kinematic > 0.0 { RECYCLE_TURN_KINEMATIC } else { RECYCLE_TURN };
        let is_reused = moved < margins.recycle * size && turned < most && prediction <= track.predicted + 0.5 * base;
        let verdict = match (a.activity.max(b.activity) > 0.0, a.in_range.min(b.in_range) > 0.0) {
            (false, _) => REUSED,
            (true, false) => LOST,
            _ if is_reused => REUSED,
            _ => MOVED,
        };
        (verdict, prediction)
    }

    #[test]
    fn sixteen_pairs_are_tested_as_one_is() {
        let mut random = Random(1);
        let margins = Margins { speculative: 0.02, recycle: 0.02, fall: 0.003, dt: 1.0 / 60.0, substep: 1.0 / 480.0 };
        let moving: Vec<BodyState> = (0..300).map(|_| random.body()).collect();
        let track = |place: u32| {
            let mut body = |_| (149.5 * (random.next() + 1.0)) as u32;
            let bodies = [body(0), body(1)];
            let then = bodies.map(|body| random.before(&moving[body as usize]));
            let [size, reach_b] = [1.1, 1.5].map(|least| least + random.next());
            let predicted = if place.is_multiple_of(7) { NEVER } else { 1.0 + random.next() };
            let [unbounded, takes_part] = [random.next() > 0.5, random.next() > 0.0].map(f32::from);
            Track { size, reach_b, predicted, unbounded, takes_part, rest: 0.0, bodies, then }
        };
        // The last group is not full.
        let tracks: Vec<Track> = (0..16 * 500 + 5).map(track).collect();
        let mut seen = [0; 3];
        for set in InstructionSet::each() {
            let mut tests = Vec::new();
            let test = ReuseTest { tracks: &tracks, moving: &moving, margins, results: Mutex::new(&mut tests) };
            set.run(&test, 0..tracks.len().div_ceil(WIDTH));
            for (place, track) in tracks.iter().enumerate() {
                let bodies = track.bodies.map(|body| &moving[body as usize]);
                let (verdict, prediction) = of_one(track, bodies, margins);
                let (tested, lane) = (&tests[place / WIDTH], place % WIDTH);
                let what = format!("{}, pair {place}", set.name());
                assert_eq!(tested.verdict.0[lane], verdict, "{what}");
                assert_eq!(tested.prediction.0[lane].to_bits(), prediction.to_bits(), "{what}");
                let is_awake = bodies.iter().any(|body| body.activity == 2.0);
                assert_eq!(tested.changes.0[lane] != 0.0, is_awake != (track.takes_part != 0.0), "{what}");
                seen[verdict as usize] += 1;
            }
        }
        assert!(seen.iter().all(|&count| count > 300), "{seen:?} reused, moved, lost");
    }
}
