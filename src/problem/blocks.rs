//! Blocks: the islands of a step that take substeps of one length.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::StepProblem;
use super::contacts::ContactRows;
use super::joints::{JointRows, takes_part};
use super::rows::Substep;
use crate::config::SolverConfig;
use crate::effort::Effort;
use crate::graph::Coloring;
use crate::world::{BodyKind, World};

/// Islands that take substeps of one length, by their colors, 96 B. No constraint holds bodies of two blocks that can move.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Block {
    /// Substeps of a step.
    pub substeps: u32,
    /// The length of one, and what follows from it.
    pub substep: Substep,
    /// First color of the contacts, and one past the last.
    pub contacts: [u32; 2],
    /// First color of the joints, and one past the last.
    pub joints: [u32; 2],
    /// The first of those colors whose joints are solved at once and not swept.
    pub direct: u32,
    /// The color of the bodies.
    pub bodies: u32,
    /// The color of the rows of unequal moments of inertia.
    pub inertias: u32,
    /// The color of the systems of joints.
    pub systems: u32,
    /// The color of the rows of turning inertia.
    pub turning: u32,
}

impl Block {
    /// The colors of its contacts, its joints, its bodies, its rows of unequal moments of inertia, its systems of joints and its rows of
    /// turning inertia.
    pub fn colors(&self) -> [Range<u32>; 6] {
        let ([c, c_end], [j, j_end]) = (self.contacts, self.joints);
        let [bodies, inertias, systems, turning] =
            [self.bodies, self.inertias, self.systems, self.turning].map(|color| color..color + 1);
        [c..c_end, j..j_end, bodies, inertias, systems, turning]
    }

    /// Colors of the joints that are swept.
    pub fn swept_joints(&self) -> Range<u32> {
        self.joints[0]..self.direct
    }

    /// Colors of the joints that are solved at once.
    pub fn direct_joints(&self) -> Range<u32> {
        self.direct..self.joints[1]
    }
}

/// Lays out the rows that passes go over, after all rows are written: contacts, joints, bodies, rows of inertia, systems of joints and rows
/// of turning inertia, each block by block.
pub fn lay_out(
    world: &World,
    asleep: &[bool],
    config: &SolverConfig,
    effort: &Effort,
    dt: f32,
    (contacts, joints): (&ContactRows, &JointRows),
    problem: &mut StepProblem,
) {
    problem.order.clear();
    problem.colors.clear();
    problem.colors.push(0);
    let count = effort.block_count();
    let mut blocks = std::mem::take(&mut problem.blocks);
    blocks.clear();
    blocks.extend((0..count).map(|block| {
        let substeps = config.substeps << effort.class_of_block(block);
        Block { substeps, substep: Substep::new(config, dt / substeps as f32), ..Block::default() }
    }));
    let block_of = |body: u32| if count == 1 { 0 } else { effort.block_of(body as usize) };
    let is_dynamic = |body: u32| world.bodies.get(body as usize).is_some_and(|b| b.kind == BodyKind::Dynamic);
    let block_of_pair = |[a, b]: [u32; 2]| block_of(if is_dynamic(a) { a } else { b });
    if count == 1 {
        problem.order.extend_from_slice(&contacts.coloring.order);
        problem.colors.clone_from(&contacts.coloring.offsets);
        blocks[0].contacts = [0, contacts.coloring.color_count() as u32];
    } else {
        for (i, block) in blocks.iter_mut().enumerate() {
            block.contacts = deal_colors(&contacts.coloring, problem, |problem, row| {
                let contact = &problem.contacts[row as usize];
                block_of_pair([contact.body_a, contact.body_b]) == i
            });
        }
    }
    // The bodies of a joint that can move are of one island, and those of a system.
    let is_of = |problem: &StepProblem, joint: u32, block: usize| {
        let row = &problem.joints[joint as usize];
        takes_part(world, asleep, joint) && block_of_pair([row.body_a, row.body_b]) == block
    };
    for (i, block) in blocks.iter_mut().enumerate() {
        let of_kind = |is_direct: bool| {
            move |problem: &StepProblem, joint: u32| joints.is_direct(joint) == is_direct && is_of(problem, joint, i)
        };
        let [first, direct] = deal_colors(&joints.coloring, problem, of_kind(false));
        let [_, end] = deal_colors(&joints.coloring, problem, of_kind(true));
        (block.joints, block.direct) = ([first, end], direct);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..problem.bodies.len() as u32).filter(|&body| count == 1 || block_of(body) == i);
        block.bodies = push_color(&mut problem.order, &mut problem.colors, own);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..).zip(&problem.inertias).filter(|(_, row)| block_of(row.body) == i).map(|(row, _)| row);
        block.inertias = push_color(&mut problem.order, &mut problem.colors, own);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let first_joint = |system: u32| problem.systems.nodes[problem.systems.nodes_of(system as usize).start].joint;
        let systems = 0..problem.systems.len() as u32;
        let own: Vec<u32> = systems.filter(|&system| is_of(problem, first_joint(system), i)).collect();
        block.systems = push_color(&mut problem.order, &mut problem.colors, own.into_iter());
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..).zip(&problem.turning).filter(|(_, row)| block_of(row.body) == i).map(|(row, _)| row);
        block.turning = push_color(&mut problem.order, &mut problem.colors, own);
    }
    problem.blocks = blocks;
}

/// Makes a color of some rows; returns its number.
fn push_color(order: &mut Vec<u32>, colors: &mut Vec<u32>, rows: impl Iterator<Item = u32>) -> u32 {
    order.extend(rows);
    colors.push(order.len() as u32);
    colors.len() as u32 - 2
}

/// Adds the colors of a coloring that have wanted rows, with these rows only; returns the first of them and one past the last.
fn deal_colors(
    coloring: &Coloring,
    problem: &mut StepProblem,
    is_wanted: impl Fn(&StepProblem, u32) -> bool,
) -> [u32; 2] {
    let first = problem.colors.len() as u32 - 1;
    for color in coloring.offsets.windows(2) {
        let begin = problem.order.len();
        for &row in &coloring.order[color[0] as usize..color[1] as usize] {
            if is_wanted(problem, row) {
                problem.order.push(row);
            }
        }
        if problem.order.len() > begin {
            problem.colors.push(problem.order.len() as u32);
        }
    }
    [first, problem.colors.len() as u32 - 1]
}
