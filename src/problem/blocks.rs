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

/// Islands that take substeps of one length, by their colors, 104 B. No constraint connects movable bodies of two
/// blocks.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Block {
    /// Substeps in a step.
    pub substeps: u32,
    /// Length of a substep, and the coefficients that follow from it.
    pub substep: Substep,
    /// First color of the contacts, and one past the last.
    pub contacts: [u32; 2],
    /// The first color of struck contacts, whose points are solved together.
    pub struck: u32,
    /// The first color of contacts that jam, which are swept several times each.
    pub jamming: u32,
    /// First color of the joints, and one past the last.
    pub joints: [u32; 2],
    /// The first color of joints that are solved directly and not swept.
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
    /// The colors of the six kinds of rows: contacts, joints, bodies, rows of unequal moments of inertia, systems of
    /// joints, and rows of turning inertia.
    pub fn colors(&self) -> [Range<u32>; 6] {
        let ([c, c_end], [j, j_end]) = (self.contacts, self.joints);
        let [bodies, inertias, systems, turning] =
            [self.bodies, self.inertias, self.systems, self.turning].map(|color| color..color + 1);
        [c..c_end, j..j_end, bodies, inertias, systems, turning]
    }

    /// The colors of contacts that are swept once, of struck contacts, and of contacts that jam.
    pub fn contacts_by_kind(&self) -> [Range<u32>; 3] {
        let [first, end] = self.contacts;
        [first..self.struck, self.struck..self.jamming, self.jamming..end]
    }

    /// Colors of the joints that are swept.
    pub fn swept_joints(&self) -> Range<u32> {
        self.joints[0]..self.direct
    }

    /// Colors of the joints that are solved directly.
    pub fn direct_joints(&self) -> Range<u32> {
        self.direct..self.joints[1]
    }
}

/// Lays out the rows that passes go over, after all rows are written: contacts, joints, bodies, rows of inertia,
/// systems of joints, and rows of turning inertia. Each kind goes block by block.
pub fn lay_out(
    world: &World,
    asleep: &[bool],
    config: &SolverConfig,
    effort: &Effort,
    dt: f32,
    (contacts, joints): (&ContactRows, &JointRows),
    problem: &mut StepProblem,
) {
    let StepProblem {
        order,
        colors,
        blocks,
        bodies,
        inertias,
        contacts: rows,
        joints: joint_rows,
        systems,
        turning,
        ..
    } = problem;
    order.clear();
    colors.clear();
    colors.push(0);
    let count = effort.block_count();
    blocks.clear();
    blocks.extend((0..count).map(|block| {
        let substeps = config.substeps << effort.class_of_block(block);
        Block { substeps, substep: Substep::new(config, dt / substeps as f32), ..Block::default() }
    }));
    let block_of = |body: u32| if count == 1 { 0 } else { effort.block_of(body as usize) };
    let is_dynamic = |body: u32| world.bodies.get(body as usize).is_some_and(|b| b.kind == BodyKind::Dynamic);
    let block_of_pair = |[a, b]: [u32; 2]| block_of(if is_dynamic(a) { a } else { b });
    if count == 1 && !contacts.impacts().any() && !contacts.any_jamming(rows) {
        order.extend_from_slice(&contacts.coloring.order);
        colors.clone_from(&contacts.coloring.offsets);
        blocks[0].contacts = [0, contacts.coloring.color_count() as u32];
        (blocks[0].struck, blocks[0].jamming) = (blocks[0].contacts[1], blocks[0].contacts[1]);
    } else {
        for (i, block) in blocks.iter_mut().enumerate() {
            let is_of =
                |row: u32| count == 1 || block_of_pair([rows[row as usize].body_a, rows[row as usize].body_b]) == i;
            let jams = contacts.jams(rows);
            let is_struck = |row: u32| contacts.impacts().is_struck(row) && !jams(row);
            let is_swept_once = |row: u32| is_of(row) && !jams(row) && !is_struck(row);
            let [first, struck] = deal_colors(&contacts.coloring, order, colors, is_swept_once);
            let [_, jamming] = deal_colors(&contacts.coloring, order, colors, |row| is_of(row) && is_struck(row));
            let [_, end] = deal_colors(&contacts.coloring, order, colors, |row| is_of(row) && jams(row));
            (block.contacts, block.struck, block.jamming) = ([first, end], struck, jamming);
        }
    }
    // The movable bodies of a joint, or of a system, belong to one island.
    let is_of = |joint: u32, block: usize| {
        let row = &joint_rows[joint as usize];
        takes_part(world, asleep, joint) && block_of_pair([row.body_a, row.body_b]) == block
    };
    for (i, block) in blocks.iter_mut().enumerate() {
        let of_kind = |is_direct: bool| move |joint: u32| joints.is_direct(joint) == is_direct && is_of(joint, i);
        let [first, direct] = deal_colors(&joints.coloring, order, colors, of_kind(false));
        let [_, end] = deal_colors(&joints.coloring, order, colors, of_kind(true));
        (block.joints, block.direct) = ([first, end], direct);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..bodies.len() as u32).filter(|&body| block_of(body) == i);
        block.bodies = push_color(order, colors, own);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..).zip(&*inertias).filter(|(_, row)| block_of(row.body) == i).map(|(row, _)| row);
        block.inertias = push_color(order, colors, own);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let first_joint = |system: u32| systems.nodes[systems.nodes_of(system as usize).start].joint;
        let own = (0..systems.len() as u32).filter(|&system| is_of(first_joint(system), i));
        block.systems = push_color(order, colors, own);
    }
    for (i, block) in blocks.iter_mut().enumerate() {
        let own = (0..).zip(&*turning).filter(|(_, row)| block_of(row.body) == i).map(|(row, _)| row);
        block.turning = push_color(order, colors, own);
    }
}

/// Makes a color of some rows, and returns its number.
fn push_color(order: &mut Vec<u32>, colors: &mut Vec<u32>, rows: impl Iterator<Item = u32>) -> u32 {
    order.extend(rows);
    colors.push(order.len() as u32);
    colors.len() as u32 - 2
}

/// Adds the wanted rows of a coloring, color by color, and leaves out colors without any. Returns the first color and
/// one past the last.
fn deal_colors(
    coloring: &Coloring,
    order: &mut Vec<u32>,
    colors: &mut Vec<u32>,
    is_wanted: impl Fn(u32) -> bool,
) -> [u32; 2] {
    let first = colors.len() as u32 - 1;
    for color in coloring.offsets.windows(2) {
        let begin = order.len();
        let rows = coloring.order[color[0] as usize..color[1] as usize].iter().copied();
        order.extend(rows.filter(|&row| is_wanted(row)));
        if order.len() > begin {
            colors.push(order.len() as u32);
        }
    }
    [first, colors.len() as u32 - 1]
}
