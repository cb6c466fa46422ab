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

/// Islands that take substeps of one length, by their colors, 84 B. No constraint holds bodies of two blocks that can move.
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
    /// The color of the bodies.
    pub bodies: u32,
    /// The color of the rows of unequal moments of inertia.
    pub inertias: u32,
}

impl Block {
    /// The colors of its contacts, its joints, its bodies and its rows of unequal moments of inertia.
    pub fn colors(&self) -> [Range<u32>; 4] {
        let ([c, c_end], [j, j_end]) = (self.contacts, self.joints);
        [c..c_end, j..j_end, self.bodies..self.bodies + 1, self.inertias..self.inertias + 1]
    }
}

/// Lays out the rows that passes go over, after all rows are written: contacts, joints, bodies and rows of inertia, each block by block.
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
        let of_row = |problem: &StepProblem, row: u32| {
            let contact = &problem.contacts[row as usize];
            Some(block_of_pair([contact.body_a, contact.body_b]))
        };
        deal_colors(&contacts.coloring, &mut blocks, |block| &mut block.contacts, of_row, problem);
    }
    let of_row = |problem: &StepProblem, row: u32| {
        let joint = &problem.joints[row as usize];
        takes_part(world, asleep, row).then(|| block_of_pair([joint.body_a, joint.body_b]))
    };
    deal_colors(&joints.coloring, &mut blocks, |block| &mut block.joints, of_row, problem);
    for (i, block) in blocks.iter_mut().enumerate() {
        block.bodies = problem.colors.len() as u32 - 1;
        let bodies = 0..problem.bodies.len() as u32;
        problem.order.extend(bodies.filter(|&body| count == 1 || block_of(body) == i));
        problem.colors.push(problem.order.len() as u32);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        block.inertias = problem.colors.len() as u32 - 1;
        let rows = (0..).zip(&problem.inertias);
        problem.order.extend(rows.filter(|(_, row)| block_of(row.body) == i).map(|(row, _)| row));
        problem.colors.push(problem.order.len() as u32);
    }
    problem.blocks = blocks;
}

/// Deals the rows of a coloring to the blocks, each of which keeps the colors that it has rows of. `block_of` has none for a row that takes no
/// part.
fn deal_colors(
    coloring: &Coloring,
    blocks: &mut [Block],
    colors_of: impl Fn(&mut Block) -> &mut [u32; 2],
    block_of: impl Fn(&StepProblem, u32) -> Option<usize>,
    problem: &mut StepProblem,
) {
    for (i, block) in blocks.iter_mut().enumerate() {
        let first = problem.colors.len() as u32 - 1;
        for color in coloring.offsets.windows(2) {
            let begin = problem.order.len();
            for &row in &coloring.order[color[0] as usize..color[1] as usize] {
                if block_of(problem, row) == Some(i) {
                    problem.order.push(row);
                }
            }
            if problem.order.len() > begin {
                problem.colors.push(problem.order.len() as u32);
            }
        }
        *colors_of(block) = [first, problem.colors.len() as u32 - 1];
    }
}
