//! Contacts in groups of sixteen lanes: from the rows of a problem, and back.

#![allow(unsafe_code)]

use std::ops::Range;

use super::crew::Crew;
use super::parts::{Begins, Dealt, Parts};
use super::shared::Shared;
use super::sweep::place;
use super::wide::{Lanes, Portable, WIDTH, Wide};
use crate::kernels::Step;
use crate::kernels::momentum::{StepLength, extrapolate, step_length};
use crate::math::{Lane, Vec3, vec3};
use crate::problem::{ContactRow, ImpulseRow, PointRow, StepProblem};

/// Sixteen contacts of one color with as many points each.
#[derive(Clone, Copy, Default)]
pub(super) struct Group {
    pub a: Bodies,
    pub b: Bodies,
    /// Rows of the problem that the lanes hold; `NO_ROW` where there is none.
    rows: [u32; WIDTH],
    pub contact: [Wide; 11],
    /// Where its points begin, in `points` and `impulses`.
    pub first_point: u32,
    /// Points, the patch included.
    pub points: u32,
}

/// What a lane without a constraint holds.
pub(super) const NO_ROW: u32 = u32::MAX;

/// Sixteen bodies.
#[derive(Clone, Copy, Default)]
pub(super) struct Bodies {
    /// Where their states are.
    pub places: [u32; WIDTH],
    /// Which of them can move, a bit a lane.
    pub movable: u16,
}

impl Bodies {
    /// Puts a body of a problem into a lane, or nobody: one more than the problem has.
    pub fn set(&mut self, lane: usize, body: usize, problem: &StepProblem, slots: &[u32]) {
        self.places[lane] = place(slots[body] as usize);
        self.movable |= u16::from(problem.masses.get(body).is_some_and(|m| m.inv_mass > 0.0)) << lane;
    }
}

/// The contacts of a problem, part by part, and color by color in each.
#[derive(Default)]
pub(super) struct Groups {
    pub all: Vec<Group>,
    /// Where the groups of each color of each part are.
    pub begins: Begins,
    dealt: Dealt,
    /// Contacts of each color of each part with one to four points, and its first group and point.
    counts: Vec<[usize; 4]>,
    firsts: Vec<(usize, u32)>,
    pub points: Vec<[Wide; 12]>,
    /// What accelerated sweeps leave for each other, kept from one run to the next.
    steps: Vec<Step<Portable>>,
}

impl Groups {
    /// Takes over the contacts of a problem.
    pub fn load(&mut self, problem: &StepProblem, parts: &Parts, impulses: &mut Vec<[Wide; 4]>, crew: &Crew) {
        self.deal(problem, parts, crew);
        let count = self.all.last().map_or(0, |g| g.first_point + g.points) as usize;
        self.points.resize(count, [Wide::default(); 12]);
        impulses.resize(count, [Wide::default(); 4]);
        let (points, impulses) = (Shared::new(&mut self.points), Shared::new(impulses));
        let (len, all) = (self.all.len(), Shared::new(&mut self.all));
        crew.spread(0..len, &|range| {
            // SAFETY: tasks have different groups: `Crew::spread` cuts their range.
            for group in unsafe { all.slice(range) } {
                let rows = group.first_point as usize..(group.first_point + group.points) as usize;
                // SAFETY: `deal` gives each group points of its own.
                let (points, impulses) = unsafe { (points.slice(rows.clone()), impulses.slice(rows)) };
                group.fill(problem, &parts.slots, points, impulses);
            }
        });
    }

    /// Gives the impulses back.
    pub fn store(&self, problem: &mut StepProblem, impulses: &[[Wide; 4]], crew: &Crew) {
        let (contacts, to_problem) = (&problem.contacts, Shared::new(&mut problem.impulses));
        crew.spread(0..self.all.len(), &|range| {
            for group in &self.all[range] {
                for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                    let to = contacts[row as usize].first_point as usize;
                    for k in 0..group.points as usize {
                        let wide = &impulses[group.first_point as usize + k];
                        let [normal, tangent_1, tangent_2, peak] = [0, 1, 2, 3].map(|i| wide[i].0[lane]);
                        // SAFETY: `deal` puts each contact into one lane of one group, and `CheckedStep` holds that contacts
                        // have different points.
                        unsafe { to_problem.write(to + k, ImpulseRow { normal, tangent_1, tangent_2, peak }) };
                    }
                }
            }
        });
    }

    /// Goes on with all impulses.
    pub fn extrapolate(&mut self, first: bool, factor: f32, impulses: &mut [[Wide; 4]], crew: &Crew) {
        let len = impulses.len();
        self.steps.resize(len, Step::default());
        let factor = Portable::constant(factor.into());
        let (impulses, steps) = (Shared::new(impulses), Shared::new(&mut self.steps));
        crew.spread(0..len, &|range| {
            // SAFETY: tasks have different impulses: `Crew::spread` cuts their range.
            let (impulses, steps) = unsafe { (impulses.slice(range.clone()), steps.slice(range)) };
            for (impulse, step) in impulses.iter_mut().zip(steps) {
                let Vec3 { x, y, z } = extrapolate(first, factor, components(impulse), step);
                [impulse[0], impulse[1], impulse[2]] = [x.store(), y.store(), z.store()];
            }
        });
    }

    /// How far the last sweep moved the impulse of each point of the problem.
    pub fn measure_step(
        &self,
        problem: &StepProblem,
        impulses: &[[Wide; 4]],
        lengths: &mut [StepLength<f32>],
        crew: &Crew,
    ) {
        let lengths = Shared::new(lengths);
        crew.spread(0..self.all.len(), &|range| {
            for group in &self.all[range] {
                for k in 0..group.points as usize {
                    let at = group.first_point as usize + k;
                    let StepLength { square, along } = step_length(components(&impulses[at]), &self.steps[at]);
                    let (square, along) = (square.store(), along.store());
                    for (lane, &row) in group.rows.iter().enumerate().filter(|r| *r.1 != NO_ROW) {
                        let to = problem.contacts[row as usize].first_point as usize + k;
                        // SAFETY: as in `store`.
                        unsafe { lengths.write(to, StepLength { square: square.0[lane], along: along.0[lane] }) };
                    }
                }
            }
        });
    }

    /// Deals the contacts of each color of each part out to groups by their number of points. Groups stand in the order of their
    /// first rows, so that what is beside each other in the world stays so.
    fn deal(&mut self, problem: &StepProblem, parts: &Parts, crew: &Crew) {
        let (contacts, colors) = (&problem.contacts, problem.contact_colors());
        self.begins.clear(colors.len());
        self.dealt.update(problem, colors, parts.count, |row| parts.of(contacts[row].body_a, contacts[row].body_b));
        // Patches stand in the problem whether a pass asks for them or not.
        let patch = u32::from(problem.has_patches());
        let count_of = |row: u32| contacts[row as usize].point_count as usize - 1;
        let (dealt, cells) = (&self.dealt, self.dealt.cells());
        self.counts.resize(cells, [0; 4]);
        let counts = Shared::new(&mut self.counts);
        crew.spread_parts(0..cells, &|range| {
            for cell in range {
                let mut count = [0; 4];
                dealt.rows(cell).iter().for_each(|&row| count[count_of(row)] += 1);
                // SAFETY: tasks have different cells: `Crew::spread_parts` cuts their range.
                unsafe { counts.write(cell, count) };
            }
        });
        let (mut groups, mut points) = (0, 0);
        self.firsts.clear();
        for counts in &self.counts {
            self.begins.push(groups);
            self.firsts.push((groups, points));
            for (rows, each) in counts.iter().zip(1..) {
                groups += rows.div_ceil(WIDTH);
                points += rows.div_ceil(WIDTH) as u32 * (each + patch);
            }
        }
        self.begins.push(groups);
        self.all.resize(groups, Group::default());
        let (firsts, all) = (&self.firsts, Shared::new(&mut self.all));
        crew.spread_parts(0..cells, &|range| {
            for cell in range {
                let (mut next, mut next_point) = firsts[cell];
                // The group of each number of points that is being filled.
                let (mut open, mut filled) = ([0; 4], [0; 4]);
                for &row in dealt.rows(cell) {
                    let k = count_of(row);
                    let lane = filled[k] % WIDTH;
                    if lane == 0 {
                        (open[k], next) = (next, next + 1);
                    }
                    // SAFETY: the groups of a cell begin where those of the cell before end, and tasks have different cells.
                    let group = unsafe { &mut all.slice(open[k]..open[k] + 1)[0] };
                    if lane == 0 {
                        (group.first_point, group.points) = (next_point, k as u32 + 1 + patch);
                        next_point += group.points;
                        group.rows = [NO_ROW; WIDTH];
                    }
                    group.rows[lane] = row;
                    filled[k] += 1;
                }
            }
        });
    }

    /// The points of some neighboring groups.
    pub fn points_of(&self, groups: Range<usize>) -> Range<usize> {
        let first = |group: usize| self.all.get(group).map_or(self.points.len(), |group| group.first_point as usize);
        first(groups.start)..first(groups.end)
    }
}

impl Group {
    /// Lanes without a contact hold one of nobody with nobody.
    fn fill(&mut self, problem: &StepProblem, slots: &[u32], points: &mut [[Wide; 12]], impulses: &mut [[Wide; 4]]) {
        let nobody = problem.bodies.len() as u32;
        let nothing = ContactRow { body_a: nobody, body_b: nobody, first_point: NO_ROW, ..ContactRow::default() };
        (self.a, self.b) = (Bodies::default(), Bodies::default());
        let (no_point, no_impulse) = (PointRow::default(), ImpulseRow::default());
        for lane in 0..WIDTH {
            let c = problem.contacts.get(self.rows[lane] as usize).unwrap_or(&nothing);
            self.a.set(lane, c.body_a as usize, problem, slots);
            self.b.set(lane, c.body_b as usize, problem, slots);
            let ([nx, ny, nz], [tx, ty, tz]) = (c.normal, c.tangent);
            let header = [nx, ny, nz, tx, ty, tz, c.friction, c.restitution, c.radius_a, c.radius_b, c.preload];
            set_lane(&mut self.contact, lane, &header);
            for (k, (point, impulse)) in points.iter_mut().zip(impulses.iter_mut()).enumerate() {
                let from = c.first_point as usize + k;
                set_lane(point, lane, bytemuck::cast_ref(problem.points.get(from).unwrap_or(&no_point)));
                set_lane(impulse, lane, bytemuck::cast_ref(problem.impulses.get(from).unwrap_or(&no_impulse)));
            }
        }
    }
}

/// The normal and the tangents of sixteen impulses.
fn components(impulse: &[Wide; 4]) -> Vec3<Portable> {
    let [normal, tangent_1, tangent_2, _] = impulse.each_ref().map(Portable::load);
    vec3(normal, tangent_1, tangent_2)
}

/// Writes one lane of some rows.
#[inline(always)]
pub(super) fn set_lane<const N: usize>(rows: &mut [Wide; N], lane: usize, values: &[f32; N]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row.0[lane] = *value;
    }
}
