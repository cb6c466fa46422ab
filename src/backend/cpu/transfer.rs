//! Copies rows of a problem into lanes, and impulses back: sixteen rows at a time, number by number.

#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;

use super::constraint::Constraint;
use super::lane_group::{LaneGroup, NO_ROW};
use super::lane_rows::{LaneImpulses, OwnImpulses, OwnPoints, SharedImpulses, SharedPoints};
use crate::lanes::{Lanes, Row8, Shared, WIDTH, Wide, Work, lanes};
use crate::problem::StepProblem;

/// The place of a body's state, and whether the body is movable and has locked axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BodyPlace {
    pub place: u32,
    pub is_movable: bool,
    pub has_locks: bool,
}

/// Loads the rows of groups.
pub(super) struct Load<'a, C> {
    pub problem: &'a StepProblem,
    /// One for each body, then the placeholder.
    pub places: &'a [BodyPlace],
    pub groups: Shared<'a, LaneGroup>,
    pub points: SharedPoints<'a>,
    pub impulses: SharedImpulses<'a>,
    pub constraint: PhantomData<C>,
}

/// Stores the impulses of groups.
pub(super) struct Store<'a, C> {
    pub rows: &'a [C],
    pub groups: &'a [LaneGroup],
    pub impulses: &'a LaneImpulses,
    pub to: Shared<'a, [f32; 4]>,
}

impl<C: Constraint> Work for Load<'_, C> {
    #[inline(always)]
    fn over<L: Lanes>(&self, range: Range<usize>) {
        // SAFETY: tasks have different groups: `Threads::spread` cuts their range.
        for group in unsafe { self.groups.slice(range) } {
            let own = group.impulses();
            // SAFETY: `LaneLayout::make_groups` gives each group impulses and points of its own.
            let (points, impulses) = unsafe { (self.points.slice(own.clone()), self.impulses.slice(own)) };
            self.take_bodies(group);
            if group.is_full() && (C::HAS_POINTS || points.arms.is_empty()) {
                self.take_full::<L>(group, points, impulses);
            } else {
                self.take_some(group, points, impulses);
            }
        }
    }
}

impl<C: Constraint> Load<'_, C> {
    fn take_bodies(&self, group: &mut LaneGroup) {
        let placeholder = self.places.len() as u32 - 1;
        let bodies_of = |row: u32| C::rows(self.problem).get(row as usize).map_or([placeholder; 2], C::bodies);
        let bodies = group.rows.map(bodies_of);
        for (lanes, side) in [&mut group.a, &mut group.b].into_iter().zip(0..) {
            let places = bodies.map(|bodies| self.places[bodies[side] as usize]);
            lanes.places = places.map(|body| body.place);
            lanes.movable = places.iter().rev().fold(0, |bits, body| bits << 1 | u16::from(body.is_movable));
            lanes.has_locks = places.iter().any(|body| body.has_locks);
        }
    }

    /// Loads a row into each lane.
    #[inline(always)]
    fn take_full<L: Lanes>(&self, group: &mut LaneGroup, points: OwnPoints, mut impulses: OwnImpulses) {
        let rows = C::rows(self.problem);
        let own: [&C; WIDTH] = lanes!(lane => &rows[group.rows[lane] as usize]);
        // The header is in the first sixteen numbers.
        let numbers: [&[f32]; WIDTH] = lanes!(lane => &bytemuck::cast_slice(std::slice::from_ref(own[lane]))[..16]);
        let (low, high) = (first_eight::<L>(&numbers), last_eight::<L>(&numbers));
        for (wide, at) in group.header.iter_mut().zip(C::HEADER) {
            *wide = if at < 8 { low[at] } else { high[at - 8] };
        }
        let firsts: [usize; WIDTH] = lanes!(lane => C::impulse(rows, group.rows[lane], 0));
        for (k, arms) in points.arms.iter_mut().enumerate() {
            let all: &[[f32; 12]] = bytemuck::cast_slice(&self.problem.points);
            let rows: [&[f32]; WIDTH] = lanes!(lane => &all[firsts[lane] + k][..]);
            *arms = first_eight::<L>(&rows);
            let [.., tangent_mass, pull, slip_1, slip_2] = last_eight::<L>(&rows);
            points.tangent_masses[k] = tangent_mass;
            if let Some(others) = points.others.get_mut(k) {
                *others = [pull, slip_1, slip_2];
            }
        }
        let all = C::impulses(self.problem);
        if group.count == 1 {
            for (lane, &first) in firsts.iter().enumerate() {
                impulses.set_lane(0, lane, &all[first]);
            }
            return;
        }
        for k in pairs_of(group.count as usize) {
            let pairs: [&[f32]; WIDTH] = lanes!(lane => all[firsts[lane] + k..firsts[lane] + k + 2].as_flattened());
            let [a, b, c, d, e, f, g, h] = first_eight::<L>(&pairs);
            impulses.set(k, [a, b, c, d]);
            impulses.set(k + 1, [e, f, g, h]);
        }
    }

    /// Empty lanes hold zeros.
    fn take_some(&self, group: &mut LaneGroup, mut points: OwnPoints, mut impulses: OwnImpulses) {
        let rows = C::rows(self.problem);
        let all_impulses = C::impulses(self.problem);
        for (lane, row) in group.rows.into_iter().enumerate() {
            let constraint = rows.get(row as usize);
            let header = constraint.map_or([0.0; 11], |constraint| {
                let numbers: &[f32] = bytemuck::cast_slice(std::slice::from_ref(constraint));
                C::HEADER.map(|at| numbers[at])
            });
            set_lane(&mut group.header, lane, &header);
            for k in 0..points.arms.len() {
                let numbers = constraint.and_then(|constraint| constraint.point(self.problem, k));
                points.set_lane(k, lane, numbers.unwrap_or(&[0.0; 12]));
            }
            for k in 0..group.count as usize {
                let numbers = constraint.and_then(|_| all_impulses.get(C::impulse(rows, row, k)));
                impulses.set_lane(k, lane, numbers.unwrap_or(&[0.0; 4]));
            }
        }
    }
}

impl<C: Constraint> Work for Store<'_, C> {
    #[inline(always)]
    fn over<L: Lanes>(&self, range: Range<usize>) {
        for group in &self.groups[range] {
            let own = group.impulses();
            if !group.is_full() || own.len() == 1 || !C::HAS_POINTS {
                for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                    for (k, i) in own.clone().enumerate() {
                        let numbers = self.impulses.numbers(i).map(|number| number.0[lane]);
                        // SAFETY: `LaneLayout::make_groups` puts each constraint into one lane of one group, and
                        // `CheckedStep` guarantees that constraints have different impulses.
                        unsafe { self.write(C::impulse(self.rows, row, k), &numbers) };
                    }
                }
                continue;
            }
            let firsts: [usize; WIDTH] = lanes!(lane => C::impulse(self.rows, group.rows[lane], 0));
            for k in pairs_of(own.len()) {
                let [a, b, c, d] = self.impulses.numbers(own.start + k);
                let [e, f, g, h] = self.impulses.numbers(own.start + k + 1);
                let pairs = L::scattered([
                    L::load(a),
                    L::load(b),
                    L::load(c),
                    L::load(d),
                    L::load(e),
                    L::load(f),
                    L::load(g),
                    L::load(h),
                ]);
                for (Row8(pair), first) in pairs.iter().zip(firsts) {
                    let (one, two) = pair.as_chunks().0.split_at(1);
                    // SAFETY: as above.
                    unsafe {
                        self.write(first + k, &one[0]);
                        self.write(first + k + 1, &two[0]);
                    }
                }
            }
        }
    }
}

impl<C: Constraint> Store<'_, C> {
    /// Writes an impulse. The bounces stay unchanged if the lanes have none.
    ///
    /// # Safety
    /// No other task has the same one.
    #[inline(always)]
    unsafe fn write(&self, i: usize, numbers: &[f32; 4]) {
        // SAFETY: the caller's promise.
        let to = unsafe { &mut self.to.slice(i..i + 1)[0] };
        let count = if self.impulses.bounces.is_empty() { 3 } else { 4 };
        to[..count].copy_from_slice(&numbers[..count]);
    }
}

/// First indices of pairs of neighboring impulses that cover all `count`, two or more. The last pair can overlap the
/// one before.
#[inline(always)]
fn pairs_of(count: usize) -> impl Iterator<Item = usize> {
    (0..count).step_by(2).map(move |k| k.min(count - 2))
}

/// The first eight numbers of sixteen rows, number by number.
#[inline(always)]
fn first_eight<L: Lanes>(rows: &[&[f32]; WIDTH]) -> [Wide; 8] {
    let addresses = lanes!(lane => rows[lane][..8].as_ptr());
    // SAFETY: eight numbers are there, and borrowed.
    stored(unsafe { L::columns(&addresses) })
}

#[inline(always)]
fn last_eight<L: Lanes>(rows: &[&[f32]; WIDTH]) -> [Wide; 8] {
    let addresses = lanes!(lane => rows[lane][rows[lane].len() - 8..].as_ptr());
    // SAFETY: as above.
    stored(unsafe { L::columns(&addresses) })
}

/// Without a closure, which would be compiled for the plain instruction set.
#[inline(always)]
fn stored<L: Lanes>([a, b, c, d, e, f, g, h]: [L; 8]) -> [Wide; 8] {
    [a.store(), b.store(), c.store(), d.store(), e.store(), f.store(), g.store(), h.store()]
}

/// Writes one lane of some rows.
#[inline(always)]
fn set_lane<const N: usize>(rows: &mut [Wide; N], lane: usize, values: &[f32; N]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row.0[lane] = *value;
    }
}
