//! Joints that are solved at once: the order in which they are eliminated, and the blocks and products of their factors.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

/// Connected sets of joints, each solved at once by S = L D Lᵀ, in blocks of 3 x 3.
#[derive(Debug, Default, PartialEq)]
pub struct JointSystems {
    /// Where the nodes of each system begin, and where the last end.
    pub begins: Vec<u32>,
    /// Softness of the joints of each system, relative to the trace of their own blocks.
    pub softness: Vec<f32>,
    /// The joints of each system, in the order of their elimination.
    pub nodes: Vec<NodeRow>,
    /// The blocks of L, column by column: first the pivot, then those below it.
    pub blocks: Vec<BlockRow>,
    /// The products that are subtracted from a block: of a block of L with the transpose of a block of L D.
    pub terms: Vec<[u32; 2]>,
}

crate::saved::state!(JointSystems { begins, softness, nodes, blocks, terms });

/// One joint of a system and its column of L, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct NodeRow {
    /// The joint.
    pub joint: u32,
    /// Its pivot, the first block of its column.
    pub first_block: u32,
    /// One past the last block of its column.
    pub end_block: u32,
    #[doc(hidden)]
    pub pad: u32,
}

crate::saved::fields!(NodeRow { joint, first_block, end_block, pad });

/// One block of L, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BlockRow {
    /// The node whose row it is in.
    pub node: u32,
    /// Bit 2 i + j: side i of the joint of the column is the same body as side j of the joint of the row.
    pub shared: u32,
    /// Its first product.
    pub first_term: u32,
    /// One past its last product.
    pub end_term: u32,
}

crate::saved::fields!(BlockRow { node, shared, first_term, end_term });

impl JointSystems {
    /// The nodes of a system.
    pub fn nodes_of(&self, system: usize) -> Range<usize> {
        self.begins[system] as usize..self.begins[system + 1] as usize
    }

    /// The blocks of the column of a node.
    pub fn blocks_of(&self, node: usize) -> Range<usize> {
        self.nodes[node].first_block as usize..self.nodes[node].end_block as usize
    }

    /// The products of a block.
    pub fn terms_of(&self, block: &BlockRow) -> &[[u32; 2]] {
        &self.terms[block.first_term as usize..block.end_term as usize]
    }

    /// Number of systems.
    pub fn len(&self) -> usize {
        self.begins.len().saturating_sub(1)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Forgets all systems.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds the system of some joints, if its factors have at most `most_terms` products. `sides` are the bodies of a joint that can
    /// move.
    pub fn add(&mut self, joints: &[u32], sides: impl Fn(u32) -> [Option<u32>; 2], most_terms: usize) -> bool {
        let Some(columns) = eliminated(joints, &sides, most_terms) else { return false };
        if self.begins.is_empty() {
            self.begins.push(0);
        }
        let base = self.nodes.len() as u32;
        let mut place = vec![0; joints.len()];
        columns.iter().zip(base..).for_each(|((local, _), at)| place[*local as usize] = at);
        // The blocks, column by column, rows ascending.
        for (local, below) in &columns {
            let first_block = self.blocks.len() as u32;
            let node = place[*local as usize];
            let own = BlockRow { node, ..BlockRow::default() };
            let mut rows: Vec<BlockRow> = below
                .iter()
                .map(|&row| {
                    let shared = shared_sides(sides(joints[*local as usize]), sides(joints[row as usize]));
                    BlockRow { node: place[row as usize], shared, ..BlockRow::default() }
                })
                .collect();
            rows.sort_unstable_by_key(|row| row.node);
            self.blocks.push(own);
            self.blocks.append(&mut rows);
            let end_block = self.blocks.len() as u32;
            self.nodes.push(NodeRow { joint: joints[*local as usize], first_block, end_block, pad: 0 });
        }
        self.begins.push(self.nodes.len() as u32);
        self.softness.push(if has_loops(joints, &sides) { LOOP_SOFTNESS } else { 0.0 });
        self.add_terms(base as usize);
        true
    }

    /// The products of the blocks of the last system, whose nodes begin at `base`.
    fn add_terms(&mut self, base: usize) {
        let first_block = self.nodes[base].first_block as usize;
        let mut terms = vec![Vec::new(); self.blocks.len() - first_block];
        for node in base..self.nodes.len() {
            let below = self.blocks_of(node).skip(1);
            for right in below.clone() {
                let column = self.blocks[right].node as usize;
                for left in right..self.blocks_of(node).end {
                    let row = self.blocks[left].node;
                    let own = self.blocks_of(column);
                    let at = own.start + self.blocks[own].partition_point(|block| block.node < row);
                    terms[at - first_block].push([left as u32, right as u32]);
                }
            }
        }
        for (block, terms) in self.blocks[first_block..].iter_mut().zip(terms) {
            block.first_term = self.terms.len() as u32;
            self.terms.extend(terms);
            block.end_term = self.terms.len() as u32;
        }
    }
}

/// Softness of joints in loops. Loops may hold each other more than once, as the joints of a sheet that lies in a plane do: S is singular
/// then, and no impulse follows from it. 2^-14 / 3 gives way by 0.04 mm at 1/480 s where 300 times the mass of a ball hangs on it.
const LOOP_SOFTNESS: f32 = 6.103_515_6e-5 / 3.0;

/// Whether more joints than needed hold the bodies together.
fn has_loops(joints: &[u32], sides: &impl Fn(u32) -> [Option<u32>; 2]) -> bool {
    let mut bodies: Vec<u32> = joints.iter().flat_map(|&joint| sides(joint)).flatten().collect();
    bodies.sort_unstable();
    bodies.dedup();
    // One joint of a tree may hold it to the world.
    joints.len() > bodies.len()
        || joints.iter().filter(|&&joint| sides(joint).iter().flatten().count() == 2).count() >= bodies.len()
}

/// The bits of `BlockRow::shared`.
fn shared_sides(column: [Option<u32>; 2], row: [Option<u32>; 2]) -> u32 {
    let mut bits = 0;
    for (i, a) in column.iter().enumerate() {
        for (j, b) in row.iter().enumerate() {
            if a.is_some() && a == b {
                bits |= 1 << (2 * i + j);
            }
        }
    }
    bits
}

/// Joints in the order of their elimination, each with those that come after it and that its column of L has blocks for. None if there
/// are more than `most_terms` products.
///
/// The joint with the fewest neighbors comes next, and of several the one that has waited longest: the ends of a chain in turn, so that
/// a processor works on two recurrences side by side.
fn eliminated(
    joints: &[u32],
    sides: &impl Fn(u32) -> [Option<u32>; 2],
    most_terms: usize,
) -> Option<Vec<(u32, Vec<u32>)>> {
    let mut of_body: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for (local, &joint) in joints.iter().enumerate() {
        sides(joint).into_iter().flatten().for_each(|body| of_body.entry(body).or_default().push(local as u32));
    }
    let mut neighbors = vec![BTreeSet::new(); joints.len()];
    let mut terms = 0;
    for own in of_body.values() {
        terms += own.len() * own.len() / 2;
        if terms > most_terms {
            return None;
        }
        for &a in own {
            neighbors[a as usize].extend(own.iter().copied().filter(|&b| b != a));
        }
    }
    let mut waiting = vec![VecDeque::new(); joints.len()];
    (0..joints.len()).for_each(|i| waiting[neighbors[i].len()].push_back(i as u32));
    let mut is_done = vec![false; joints.len()];
    let mut columns = Vec::with_capacity(joints.len());
    let (mut terms, mut least) = (0, 0);
    while columns.len() < joints.len() {
        let Some(next) = waiting[least].pop_front() else {
            least += 1;
            continue;
        };
        let degree = neighbors[next as usize].len();
        if is_done[next as usize] || degree != least {
            continue;
        }
        is_done[next as usize] = true;
        terms += degree * (degree + 1) / 2;
        if terms > most_terms {
            return None;
        }
        let below: Vec<u32> = std::mem::take(&mut neighbors[next as usize]).into_iter().collect();
        for &i in &below {
            let own = &mut neighbors[i as usize];
            own.remove(&next);
            own.extend(below.iter().copied().filter(|&j| j != i));
            let degree = own.len();
            waiting[degree].push_back(i);
            least = least.min(degree);
        }
        columns.push((next, below));
    }
    Some(columns)
}
