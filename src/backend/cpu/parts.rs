//! Which bodies and constraints a thread works on by itself.
//!
//! Nothing that happens to one island depends on another. So small islands are dealt out to parts that fit in a core's cache, and a
//! thread does all passes to a part before it goes on to the next: rows and bodies are fetched once a step and not once a pass, and
//! nobody waits for anybody. Islands that are too large for that, and bodies at rest for good, are the last part, which all threads
//! work on together, color by color. Since every body and every constraint still gets the same passes in the same order, the result
//! is the same to the last bit, whatever the parts are.

use std::ops::Range;

use super::wide::WIDTH;
use crate::graph::Islands;
use crate::problem::{BodyRow, MassRow, StepProblem};

/// How much a part holds, in bodies and constraints: about a megabyte.
const PART: u32 = 4096;
/// Islands with more are worked on by all threads.
const LARGE: u32 = 4 * PART;

/// The part that each body is in, and what follows from it.
#[derive(Default)]
pub(super) struct Parts {
    /// Number of parts, the last, for all threads, included.
    pub count: usize,
    /// Where the lanes have each body, and after the last, nobody.
    pub slots: Vec<u32>,
    /// Where the bodies of each part begin, in groups of slots, and where the last end.
    begins: Vec<u32>,
    of_body: Vec<u32>,
    islands: Islands,
    /// Bodies and constraints of the island whose root each body is.
    sizes: Vec<u32>,
    /// The next slot of each part.
    next: Vec<u32>,
}

impl Parts {
    /// Deals out the bodies of a problem; one of at most `undivided` bodies and constraints is not divided.
    pub fn update(&mut self, problem: &StepProblem, undivided: usize) {
        let bodies = problem.bodies.len();
        self.of_body.clear();
        self.of_body.resize(bodies, u32::MAX);
        self.count = 1;
        if problem.order.len() + bodies > undivided {
            self.find_islands(problem);
            self.pack_islands(problem);
        }
        let last = self.count as u32 - 1;
        self.of_body.iter_mut().for_each(|part| *part = (*part).min(last));
        self.give_slots();
    }

    /// The part of a constraint of two bodies.
    pub fn of(&self, a: u32, b: u32) -> u32 {
        // What cannot move is in the last.
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

    fn pack_islands(&mut self, problem: &StepProblem) {
        let mut filled = 0;
        for body in (0..problem.bodies.len() as u32).filter(|&body| moves(problem, body)) {
            let root = self.islands.root(body);
            let size = self.sizes[root as usize];
            if size > LARGE {
                continue;
            }
            // The root of an island is its first body.
            if root == body {
                if filled > 0 && filled + size > PART {
                    self.count += 1;
                    filled = 0;
                }
                filled += size;
                self.of_body[body as usize] = self.count as u32 - 1;
            } else {
                self.of_body[body as usize] = self.of_body[root as usize];
            }
        }
        self.count += usize::from(filled > 0);
    }

    /// Bodies of different parts share no group, and nobody, whom all lanes read, has one alone.
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

/// Where the things of each color of each part begin, which stand part by part and color by color.
#[derive(Default)]
pub(super) struct Begins {
    colors: usize,
    begins: Vec<u32>,
}

impl Begins {
    /// Begins anew.
    pub fn clear(&mut self, colors: usize) {
        self.colors = colors;
        self.begins.clear();
    }

    /// The next color of a part, or the end, is at `begin`.
    pub fn push(&mut self, begin: usize) {
        self.begins.push(begin as u32);
    }

    /// Those of a color of a part.
    pub fn of_color(&self, part: usize, color: usize) -> Range<usize> {
        let cell = part * self.colors + color;
        self.begins[cell] as usize..self.begins[cell + 1] as usize
    }
}

/// Rows of a problem, part by part and color by color.
#[derive(Default)]
pub(super) struct Dealt {
    rows: Vec<u32>,
    begins: Vec<u32>,
    next: Vec<u32>,
}

impl Dealt {
    /// Deals out the rows of some colors; `part_of` says to which part.
    pub fn update(&mut self, problem: &StepProblem, colors: Range<u32>, parts: usize, part_of: impl Fn(usize) -> u32) {
        let rows = || {
            colors.clone().flat_map(|color| problem.rows_of(&(color..color + 1)).iter().map(move |&row| (color, row)))
        };
        if parts == 1 {
            self.rows.clear();
            self.rows.extend_from_slice(problem.rows_of(&colors));
            self.begins.clear();
            let first = problem.colors.get(colors.start as usize).copied().unwrap_or(0);
            self.begins.extend(colors.clone().map(|color| problem.colors[color as usize] - first));
            self.begins.push(self.rows.len() as u32);
            return;
        }
        let cell =
            |(color, row): (u32, u32)| part_of(row as usize) as usize * colors.len() + (color - colors.start) as usize;
        self.begins.clear();
        self.begins.resize(parts * colors.len() + 1, 0);
        rows().for_each(|row| self.begins[cell(row) + 1] += 1);
        for i in 1..self.begins.len() {
            self.begins[i] += self.begins[i - 1];
        }
        self.next.clone_from(&self.begins);
        self.rows.resize(problem.rows_of(&colors).len(), 0);
        for row in rows() {
            let place = &mut self.next[cell(row)];
            self.rows[*place as usize] = row.1;
            *place += 1;
        }
    }

    /// How many colors of parts there are.
    pub fn cells(&self) -> usize {
        self.begins.len() - 1
    }

    /// The rows of a color of a part.
    pub fn rows(&self, cell: usize) -> &[u32] {
        &self.rows[self.begins[cell] as usize..self.begins[cell + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::ContactRow;

    /// Movable bodies, touching as said.
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

    fn parts(problem: &StepProblem) -> Parts {
        let mut parts = Parts::default();
        parts.update(problem, 0);
        let mut slots = parts.slots.clone();
        slots.sort_unstable();
        assert!(slots.is_sorted_by(|a, b| a < b), "a slot is given twice");
        for (body, &slot) in parts.slots[..problem.bodies.len()].iter().enumerate() {
            let part = parts.of_body[body] as usize;
            assert!(
                parts.bodies(part).contains(&(slot as usize / WIDTH)),
                "body {body} is not among those of its part"
            );
        }
        let nobody = parts.slots[problem.bodies.len()] as usize / WIDTH;
        assert!(slots.iter().filter(|&&slot| slot as usize / WIDTH == nobody).count() == 1, "nobody is not alone");
        parts
    }

    #[test]
    fn small_islands_fill_parts_and_are_not_cut() {
        // Chains of ten: 19 bodies and contacts each.
        let chains = problem(10_000, (0..10_000).filter(|i| i % 10 != 9).map(|i| (i, i + 1)));
        let parts = parts(&chains);
        assert_eq!(parts.count, 1000_usize.div_ceil(PART as usize / 19) + 1);
        assert!(parts.of_body.chunks(10).all(|chain| chain.iter().all(|part| *part == chain[0])));
    }

    #[test]
    fn a_large_island_and_what_stands_still_are_in_the_last_part() {
        let large = LARGE;
        let mut problem = problem(large as usize + 4, (0..large).map(|i| (i, i + 1)).chain([(large + 2, large + 3)]));
        problem.masses[large as usize + 3].inv_mass = 0.0;
        let parts = parts(&problem);
        assert_eq!(parts.count, 2);
        assert!(parts.of_body[..=large as usize].iter().all(|&part| part == 1));
        assert_eq!(parts.of_body[large as usize + 1..], [0, 0, 1]);
        assert_eq!(parts.of(large + 3, large + 2), 0, "what stands still makes no island");
    }

    #[test]
    fn a_driven_body_makes_an_island_of_what_touches_it() {
        let many = PART;
        let mut problem = problem(many as usize, (1..many).map(|i| (0, i)));
        problem.masses[0].inv_mass = 0.0;
        assert!(parts(&problem).count > 2, "what lies on the floor are many islands");
        problem.bodies[0].w = [0.0, 0.0, 1.0];
        let parts = parts(&problem);
        assert_eq!((parts.count, parts.of_body[0], parts.of_body[many as usize - 1]), (2, 0, 0));
    }

    #[test]
    fn a_small_problem_is_not_divided() {
        let mut parts = Parts::default();
        parts.update(&problem(100, (0..0).map(|i| (i, i))), 100);
        assert_eq!(parts.count, 1);
        assert_eq!(parts.slots, Vec::from_iter(0..100).into_iter().chain([112]).collect::<Vec<u32>>());
    }
}
