//! Divides bodies and constraints into parts, each for one thread.
//!
//! Islands do not depend on each other. Small islands fill parts that fit into a core's cache, and a thread runs all
//! passes over a part before it takes the next: rows and bodies are fetched once a step instead of once a pass, and no
//! thread waits. After these parts, each block has one part for its larger islands. All threads work on it together,
//! color by color. Bodies that no pass changes are in the last part. Every body and every constraint gets the same
//! passes in the same order, so the result has the same bits for every partition.

use std::ops::Range;

use crate::graph::Islands;
use crate::lanes::WIDTH;
use crate::problem::{Block, BodyRow, MassRow, StepProblem};

/// Number of bodies and constraints in a part: about a megabyte.
const PART: u32 = 4096;
/// All threads work together on islands with more than this.
const LARGE: u32 = 4 * PART;

/// The part of each body, and its slot in the lanes.
#[derive(Default)]
pub(super) struct Partition {
    /// Number of parts.
    pub count: usize,
    /// The block of each part for one thread. The parts for all threads follow, one for each block.
    pub blocks: Vec<u32>,
    /// The slot of each body, then that of the placeholder: a body at rest for empty lanes.
    pub slots: Vec<u32>,
    /// The start of the bodies of each part, in groups of [`WIDTH`] slots, and the end of the last part.
    begins: Vec<u32>,
    of_body: Vec<u32>,
    islands: Islands,
    /// For the root body of each island: its number of bodies and constraints.
    sizes: Vec<u32>,
    /// The next slot of each part.
    next: Vec<u32>,
}

impl Partition {
    /// Divides a problem of more than `undivided` bodies and constraints.
    pub fn update(&mut self, problem: &StepProblem, undivided: usize) {
        let bodies = problem.bodies.len();
        self.of_body.clear();
        self.of_body.resize(bodies, u32::MAX);
        self.blocks.clear();
        if problem.order.len() > undivided {
            self.find_islands(problem);
            (0..problem.blocks.len()).for_each(|block| self.pack_islands(problem, block));
        }
        let first = self.blocks.len() as u32;
        // In a divided problem, the bodies of a constraint determine its part. Bodies that no pass changes are in a
        // part of their own, the last one, unless one part is for all threads.
        let resting = first + problem.blocks.len() as u32;
        let rest_apart = first > 0 && problem.blocks.len() > 1;
        self.count = if rest_apart { resting as usize + 1 } else { resting.max(1) as usize };
        for (own, block) in (first..).zip(&problem.blocks) {
            for &body in problem.rows_of(&block.colors()[2]) {
                let part = &mut self.of_body[body as usize];
                if *part == u32::MAX {
                    *part = if rest_apart && !moves(problem, body) { resting } else { own };
                }
            }
        }
        self.give_slots();
    }

    /// Whether all parts are for all threads, one for each block.
    pub fn is_undivided(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The part of a constraint between two bodies, in a divided problem.
    pub fn of(&self, a: u32, b: u32) -> u32 {
        // A body that impulses cannot move, and that shares no part with its neighbors, is in the last part.
        self.of_body[a as usize].min(self.of_body[b as usize])
    }

    /// The bodies of a part, in groups of slots.
    pub fn bodies(&self, part: usize) -> Range<usize> {
        self.begins[part] as usize..self.begins[part + 1] as usize
    }

    /// The bodies of all parts, in groups of slots.
    pub fn all_bodies(&self) -> Range<usize> {
        0..self.begins[self.count] as usize
    }

    fn find_islands(&mut self, problem: &StepProblem) {
        let ends = ends_of_constraints(problem);
        self.islands.reset(problem.bodies.len());
        self.sizes.clear();
        self.sizes.resize(problem.bodies.len(), 0);
        for [a, b] in ends.clone() {
            if moves(problem, a) && moves(problem, b) {
                self.islands.join(a, b);
            }
        }
        for body in ends.map(|[a, b]| if moves(problem, a) { a } else { b }).chain(0..problem.bodies.len() as u32) {
            self.sizes[self.islands.root(body) as usize] += 1;
        }
    }

    fn pack_islands(&mut self, problem: &StepProblem, block: usize) {
        let mut filled = None;
        for &body in problem.rows_of(&problem.blocks[block].colors()[2]) {
            let root = self.islands.root(body);
            let size = self.sizes[root as usize];
            if size > LARGE || !moves(problem, body) {
                continue;
            }
            // The root of an island is its first body.
            if root == body {
                if filled.is_none_or(|filled| filled + size > PART) {
                    self.blocks.push(block as u32);
                    filled = Some(0);
                }
                filled = filled.map(|filled| filled + size);
                self.of_body[body as usize] = self.blocks.len() as u32 - 1;
            } else {
                self.of_body[body as usize] = self.of_body[root as usize];
            }
        }
    }

    /// Bodies of different parts share no group. All lanes read the placeholder, so it has its own group.
    fn give_slots(&mut self) {
        self.begins.clear();
        self.begins.resize(self.count + 1, 0);
        self.of_body.iter().for_each(|&part| self.begins[part as usize + 1] += 1);
        for part in 0..self.count {
            self.begins[part + 1] = self.begins[part] + self.begins[part + 1].div_ceil(WIDTH as u32);
        }
        self.next.clear();
        self.next.extend(self.begins.iter().map(|begin| begin * WIDTH as u32));
        self.slots.clear();
        self.slots.extend(self.of_body.iter().map(|&part| {
            let slot = &mut self.next[part as usize];
            *slot += 1;
            *slot - 1
        }));
        self.slots.push(self.begins[self.count] * WIDTH as u32);
        self.begins[self.count] += 1;
    }
}

fn ends_of_constraints(problem: &StepProblem) -> impl Iterator<Item = [u32; 2]> + Clone {
    let contacts = problem.swept_contacts().map(|c| [c.body_a, c.body_b]);
    let joints = problem.rows_of(&problem.joint_colors()).iter().map(|&row| &problem.joints[row as usize]);
    contacts.chain(joints.map(|j| [j.body_a, j.body_b]))
}

/// Whether any pass can change a body.
fn moves(problem: &StepProblem, body: u32) -> bool {
    let MassRow { inv_mass, acceleration, .. } = problem.masses[body as usize];
    inv_mass > 0.0 || acceleration != [0.0; 3] || problem.bodies[body as usize] != BodyRow::AT_REST
}

/// Ranges of a list that is sorted by part, then by color.
#[derive(Default)]
pub(super) struct ColorRanges {
    colors: Range<u32>,
    /// The start of each color of each part, and the end of the last.
    starts: Vec<u32>,
}

impl ColorRanges {
    /// Resets the ranges, with these colors in each part.
    pub fn reset(&mut self, colors: Range<u32>) {
        self.colors = colors;
        self.starts.clear();
    }

    /// Sets `start` as the start of the next color of a part, or as the end of the last.
    pub fn push(&mut self, start: usize) {
        self.starts.push(start as u32);
    }

    /// Total number of colors in all parts.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The range of a color of a part.
    pub fn of(&self, part: usize, color: u32) -> Range<usize> {
        self.at(part * self.colors.len() + (color - self.colors.start) as usize)
    }

    /// The range at an index below [`Self::len`].
    pub fn at(&self, i: usize) -> Range<usize> {
        self.starts[i] as usize..self.starts[i + 1] as usize
    }
}

/// Rows of a problem, sorted by part, then by color.
#[derive(Default)]
pub(super) struct PartitionedRows {
    /// Part by part and color by color.
    pub rows: Vec<u32>,
    pub ranges: ColorRanges,
    next: Vec<u32>,
}

impl PartitionedRows {
    /// Sorts the rows of some colors by part. `own` returns the colors of a block, and `part_of` returns the part of a
    /// row of a divided problem.
    pub fn update(
        &mut self,
        problem: &StepProblem,
        partition: &Partition,
        own: impl Fn(&Block) -> Range<u32>,
        part_of: impl Fn(u32) -> u32,
    ) {
        let colors = problem.colors_of(&own);
        let parts = partition.count;
        self.ranges.reset(colors.clone());
        let all = problem.rows_of(&colors);
        let starts = &mut self.ranges.starts;
        if partition.is_undivided() {
            self.rows.clear();
            self.rows.extend_from_slice(all);
            let start = |color: u32| problem.colors[color as usize];
            for block in &problem.blocks {
                let own = own(block);
                starts.extend(colors.clone().map(|color| start(color.clamp(own.start, own.end)) - start(colors.start)));
            }
            starts.push(all.len() as u32);
            return;
        }
        let rows = || {
            colors.clone().flat_map(|color| problem.rows_of(&(color..color + 1)).iter().map(move |&row| (color, row)))
        };
        let range_of = |(color, row)| part_of(row) as usize * colors.len() + (color - colors.start) as usize;
        starts.resize(parts * colors.len() + 1, 0);
        rows().for_each(|row| starts[range_of(row) + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        self.next.clone_from(starts);
        self.rows.resize(all.len(), 0);
        for row in rows() {
            let next = &mut self.next[range_of(row)];
            self.rows[*next as usize] = row.1;
            *next += 1;
        }
    }

    /// The rows of a color of a part, by the index of its range.
    pub fn at(&self, i: usize) -> &[u32] {
        &self.rows[self.ranges.at(i)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::ContactRow;

    /// Movable bodies with these contacts.
    fn problem(bodies: usize, touching: impl Iterator<Item = (u32, u32)>) -> StepProblem {
        let mut problem = StepProblem {
            bodies: vec![BodyRow::AT_REST; bodies],
            masses: vec![MassRow { inv_mass: 1.0, ..MassRow::default() }; bodies],
            contacts: touching.map(|(body_a, body_b)| ContactRow { body_a, body_b, ..ContactRow::default() }).collect(),
            ..StepProblem::default()
        };
        problem.sweep_in_order_of_rows();
        problem
    }

    fn partition(problem: &StepProblem) -> Partition {
        let mut partition = Partition::default();
        partition.update(problem, 0);
        let mut slots = partition.slots.clone();
        slots.sort_unstable();
        assert!(slots.is_sorted_by(|a, b| a < b), "a slot is given twice");
        for (body, &slot) in partition.slots[..problem.bodies.len()].iter().enumerate() {
            let part = partition.of_body[body] as usize;
            assert!(
                partition.bodies(part).contains(&(slot as usize / WIDTH)),
                "body {body} is not among those of its part"
            );
        }
        let placeholder = partition.slots[problem.bodies.len()] as usize / WIDTH;
        let beside = slots.iter().filter(|&&slot| slot as usize / WIDTH == placeholder).count();
        assert_eq!(beside, 1, "the placeholder shares its group");
        partition
    }

    #[test]
    fn small_islands_fill_parts_and_are_not_cut() {
        // Chains of ten: 19 bodies and contacts each.
        let chains = problem(10_000, (0..10_000).filter(|i| i % 10 != 9).map(|i| (i, i + 1)));
        let partition = partition(&chains);
        assert_eq!(partition.count, 1000_usize.div_ceil(PART as usize / 19) + 1);
        assert!(partition.of_body.chunks(10).all(|chain| chain.iter().all(|part| *part == chain[0])));
    }

    #[test]
    fn a_large_island_and_what_stands_still_are_in_the_last_part() {
        let large = LARGE;
        let mut problem = problem(large as usize + 4, (0..large).map(|i| (i, i + 1)).chain([(large + 2, large + 3)]));
        problem.masses[large as usize + 3].inv_mass = 0.0;
        let partition = partition(&problem);
        assert_eq!(partition.count, 2);
        assert!(partition.of_body[..=large as usize].iter().all(|&part| part == 1));
        assert_eq!(partition.of_body[large as usize + 1..], [0, 0, 1]);
        assert_eq!(partition.of(large + 3, large + 2), 0, "what stands still makes no island");
    }

    /// A floor in the first block, under a ball of that block and under a large island of the second.
    #[test]
    fn a_large_island_on_the_floor_of_another_block_keeps_its_constraints() {
        let bodies = LARGE + 4;
        let mut problem = problem(bodies as usize, [(0, 1), (0, 2)].into_iter().chain((3..bodies).map(|i| (i - 1, i))));
        problem.masses[0].inv_mass = 0.0;
        let contacts = problem.contacts.len() as u32;
        let end = contacts + bodies;
        problem.colors = vec![0, 1, contacts, contacts + 2, end, end, end, end, end, end, end];
        let whole = problem.blocks[0];
        problem.blocks = Vec::from([0, 1].map(|i| Block {
            contacts: [i, i + 1],
            struck: i + 1,
            jamming: i + 1,
            joints: [2; 2],
            direct: 2,
            bodies: 2 + i,
            inertias: 4 + i,
            systems: 6 + i,
            turning: 8 + i,
            ..whole
        }));
        let partition = partition(&problem);
        assert_eq!((partition.count, partition.of(0, 1), partition.of(0, 2)), (4, 0, 2));
    }

    #[test]
    fn a_driven_body_makes_an_island_of_what_touches_it() {
        let many = PART;
        let mut problem = problem(many as usize, (1..many).map(|i| (0, i)));
        problem.masses[0].inv_mass = 0.0;
        assert!(partition(&problem).count > 2, "what lies on the floor are many islands");
        problem.bodies[0].w = [0.0, 0.0, 1.0];
        let partition = partition(&problem);
        assert_eq!((partition.count, partition.of_body[0], partition.of_body[many as usize - 1]), (2, 0, 0));
    }

    #[test]
    fn a_small_problem_is_not_divided() {
        let mut partition = Partition::default();
        partition.update(&problem(100, (0..0).map(|i| (i, i))), 100);
        assert_eq!(partition.count, 1);
        assert_eq!(partition.slots, Vec::from_iter(0..100).into_iter().chain([112]).collect::<Vec<u32>>());
    }
}
