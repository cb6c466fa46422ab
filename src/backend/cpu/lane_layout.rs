//! Converts the rows of a problem to groups of sixteen lanes, and back.

#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;

use super::constraint::{Constraint, MAX_IMPULSES};
use super::lane_group::{LaneGroup, NO_ROW};
use super::lane_rows::{LaneImpulses, LanePoints};
use super::partition::{ColorRanges, Partition, PartitionedRows};
use super::threads::Threads;
use super::transfer::{BodyPlace, Load, Store};
use crate::kernels::ImpulseStep;
use crate::kernels::momentum::{StepLength, extrapolate, step_length};
use crate::lanes::{InstructionSet, Lanes, Portable, Shared, WIDTH};
use crate::math::Lane;
use crate::problem::StepProblem;

/// The place of the impulse of a joint in the lanes.
#[derive(Clone, Copy, Default)]
pub(super) struct ImpulsePlace {
    /// The index of its sixteen impulses.
    pub row: u32,
    pub lane: u32,
}

/// The optional numbers of a step that some passes use.
#[derive(Clone, Copy)]
pub(super) struct Uses {
    /// Bounces of points.
    pub bounces: bool,
    /// Relative accelerations and slips of points.
    pub pull_or_slip: bool,
}

/// The contacts, or the joints, of a problem, part by part and color by color.
#[derive(Default)]
pub(super) struct LaneLayout<C> {
    pub groups: Vec<LaneGroup>,
    /// The groups of each color of each part.
    pub ranges: ColorRanges,
    rows: PartitionedRows,
    /// For each color of each part: the number of constraints by number of points, and its first group and impulse.
    counts: Vec<[usize; MAX_IMPULSES]>,
    firsts: Vec<(usize, u32)>,
    /// State of accelerated sweeps.
    steps: Vec<ImpulseStep<Portable>>,
    constraint: PhantomData<C>,
}

impl<C: Constraint> LaneLayout<C> {
    /// Loads the constraints of a problem and the impulses that passes use.
    pub fn load(
        &mut self,
        problem: &StepProblem,
        partition: &Partition,
        places: &[BodyPlace],
        (points, impulses): (&mut LanePoints, &mut LaneImpulses),
        uses: Uses,
        (instructions, threads): (InstructionSet, &Threads),
    ) {
        self.make_groups(problem, partition, threads);
        let count = self.groups.last().map_or(0, |group| group.impulses().end);
        points.resize(if C::are_with_points(problem) { count } else { 0 }, uses.pull_or_slip);
        impulses.resize(count, uses.bounces);
        let len = self.groups.len();
        let work = Load::<C> {
            problem,
            places,
            groups: Shared::new(&mut self.groups),
            points: points.shared(),
            impulses: impulses.shared(),
            constraint: PhantomData,
        };
        threads.spread(0..len, &|range| instructions.run(&work, range));
    }

    /// Loads sums of impulses, in the layout of the impulses.
    pub fn load_sums(&self, problem: &StepProblem, from: &[[f32; 4]], sums: &mut LaneImpulses, threads: &Threads) {
        sums.resize(self.groups.last().map_or(0, |group| group.impulses().end), true);
        let (rows, sums) = (C::rows(problem), sums.shared());
        threads.spread(0..self.groups.len(), &|range| {
            for group in &self.groups[range] {
                // SAFETY: `LaneLayout::make_groups` gives each group impulses of its own.
                let mut own = unsafe { sums.slice(group.impulses()) };
                for k in 0..group.count as usize {
                    for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                        own.set_lane(k, lane, &from[C::impulse(rows, row, k)]);
                    }
                }
            }
        });
    }

    /// Stores impulses, or their sums, in the rows of the constraints `rows`.
    pub fn store(
        &self,
        rows: &[C],
        impulses: &LaneImpulses,
        to: &mut [[f32; 4]],
        (instructions, threads): (InstructionSet, &Threads),
    ) {
        let work = Store { rows, groups: &self.groups, impulses, to: Shared::new(to) };
        threads.spread(0..self.groups.len(), &|range| instructions.run(&work, range));
    }

    /// Extrapolates all impulses.
    pub fn extrapolate(&mut self, first: bool, factor: f32, impulses: &mut LaneImpulses, threads: &Threads) {
        let len = impulses.normals.len();
        self.steps.resize(len, ImpulseStep::default());
        let factor = Portable::constant(factor.into());
        let (impulses, steps) = (impulses.shared(), Shared::new(&mut self.steps));
        threads.spread(0..len, &|range| {
            // SAFETY: tasks have different impulses: `Threads::spread` cuts their range.
            let (mut impulses, steps) = unsafe { (impulses.slice(range.clone()), steps.slice(range)) };
            for (k, step) in steps.iter_mut().enumerate() {
                impulses.set_components(k, extrapolate(first, factor, impulses.components(k), step));
            }
        });
    }

    /// Measures the change of each impulse of the problem in the last sweep.
    pub fn measure_step(
        &self,
        problem: &StepProblem,
        impulses: &LaneImpulses,
        lengths: &mut [StepLength<f32>],
        threads: &Threads,
    ) {
        let (rows, lengths) = (C::rows(problem), Shared::new(lengths));
        threads.spread(0..self.groups.len(), &|range| {
            for group in &self.groups[range] {
                for (k, i) in group.impulses().enumerate() {
                    let StepLength { square, along } = step_length(impulses.components(i), &self.steps[i]);
                    let (square, along) = (square.store(), along.store());
                    for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                        let to = C::impulse(rows, row, k);
                        // SAFETY: as in `store`.
                        unsafe { lengths.write(to, StepLength { square: square.0[lane], along: along.0[lane] }) };
                    }
                }
            }
        });
    }

    /// Groups the constraints of each color of each part by their number of points. Groups are in the order of their
    /// first rows, so that neighbors in the world stay neighbors.
    fn make_groups(&mut self, problem: &StepProblem, partition: &Partition, threads: &Threads) {
        let (all, colors) = (C::rows(problem), problem.colors_of(C::own_colors));
        self.ranges.reset(colors.clone());
        self.rows.update(problem, partition, C::own_colors, |row| {
            let [a, b] = all[row as usize].bodies();
            partition.of(a, b)
        });
        // The problem has patches, whether a pass uses them or not.
        let patch = u32::from(C::HAS_POINTS && problem.has_patches());
        let kind_of = |row: u32| all[row as usize].points() as usize - 1;
        let (rows, cells) = (&self.rows, self.rows.ranges.len());
        self.counts.resize(cells, [0; MAX_IMPULSES]);
        let counts = Shared::new(&mut self.counts);
        threads.spread_each(0..cells, &|range| {
            for cell in range {
                let mut count = [0; MAX_IMPULSES];
                rows.at(cell).iter().for_each(|&row| count[kind_of(row)] += 1);
                // SAFETY: tasks have different cells: `Threads::spread_each` cuts their range.
                unsafe { counts.write(cell, count) };
            }
        });
        let (mut groups, mut impulses) = (0, 0);
        self.firsts.clear();
        for counts in &self.counts {
            self.ranges.push(groups);
            self.firsts.push((groups, impulses));
            for (rows, points) in counts.iter().zip(1..) {
                groups += rows.div_ceil(WIDTH);
                impulses += rows.div_ceil(WIDTH) as u32 * (points + patch);
            }
        }
        self.ranges.push(groups);
        self.groups.resize(groups, LaneGroup::default());
        let (firsts, groups) = (&self.firsts, Shared::new(&mut self.groups));
        threads.spread_each(0..cells, &|range| {
            for cell in range {
                let (mut next, mut next_impulse) = firsts[cell];
                // For each number of points: the group with free lanes, and the number of used lanes.
                let (mut open, mut taken) = ([0; MAX_IMPULSES], [0; MAX_IMPULSES]);
                for &row in rows.at(cell) {
                    let kind = kind_of(row);
                    let lane = taken[kind] % WIDTH;
                    if lane == 0 {
                        (open[kind], next) = (next, next + 1);
                    }
                    // SAFETY: the groups of a cell begin where those of the cell before end, and tasks have different
                    // cells.
                    let group = unsafe { &mut groups.slice(open[kind]..open[kind] + 1)[0] };
                    if lane == 0 {
                        (group.first, group.count) = (next_impulse, kind as u32 + 1 + patch);
                        next_impulse += group.count;
                        group.rows = [NO_ROW; WIDTH];
                    }
                    group.rows[lane] = row;
                    taken[kind] += 1;
                }
            }
        });
    }

    /// The place of the first impulse of each of `count` rows.
    pub fn impulse_places(&self, problem: &StepProblem, places: &mut Vec<ImpulsePlace>) {
        let rows = C::rows(problem);
        places.resize(C::impulses(problem).len(), ImpulsePlace::default());
        for group in &self.groups {
            for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                for (k, at) in group.impulses().enumerate().take(rows[row as usize].points() as usize) {
                    places[C::impulse(rows, row, k)] = ImpulsePlace { row: at as u32, lane: lane as u32 };
                }
            }
        }
    }

    /// The impulses of neighboring groups.
    pub fn impulses_of(&self, groups: Range<usize>) -> Range<usize> {
        let groups = &self.groups[groups];
        groups.first().map_or(0..0, |first| first.impulses().start..groups[groups.len() - 1].impulses().end)
    }
}
