//! Joints that are solved directly: the order of their elimination, and the blocks and products of their factors.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::constants::{AXIS_SOFTNESS, LOOP_SOFTNESS};

/// Connected sets of joints. Each is solved directly by S = L D Lᵀ, in blocks of 3 x 3.
#[derive(Debug, Default, PartialEq)]
pub struct JointSystems {
    /// The start of the nodes of each system, and the end of the last.
    pub begins: Vec<u32>,
    /// Softness of the joints of each system, relative to the trace of each diagonal block.
    pub softness: Vec<f32>,
    /// The rows of each system in the order of their elimination. A node has up to three rows of a joint.
    pub nodes: Vec<NodeRow>,
    /// The blocks of L, column by column: first the pivot, then the blocks below it.
    pub blocks: Vec<BlockRow>,
    /// The products that are subtracted from a block. Each multiplies a block of L by the transpose of a block of L D.
    pub terms: Vec<[u32; 2]>,
}

crate::saved::state!(JointSystems { begins, softness, nodes, blocks, terms });

/// Up to three rows of a joint, with their column of L, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct NodeRow {
    /// The joint.
    pub joint: u32,
    /// Its pivot, the first block of its column.
    pub first_block: u32,
    /// One past the last block of its column.
    pub end_block: u32,
    /// Its rows: [`NodeRow::ANCHORS`], or a byte for each row. The byte is 0 if the row is missing. Otherwise it is 1
    /// plus the number of an axis of the joint, with the bit `NodeRow::LIMIT` for a limit.
    pub rows: u32,
}

crate::saved::fields!(NodeRow { joint, first_block, end_block, rows });

/// The place of one impulse of a joint or of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImpulseNumber {
    /// The row of `joint_impulses`.
    pub row: usize,
    /// Its component, 0 to 2.
    pub component: usize,
}

impl NodeRow {
    /// The rows of a node that keeps anchors together.
    pub const ANCHORS: u32 = u32::MAX;

    /// The bit of a row that is a limit. A limit takes part only while its impulse is not zero.
    const LIMIT: u32 = 0x80;

    /// The rows of a node of up to three axes: the number of each, and whether it is a limit.
    pub fn rows_of(axes: &[(u32, bool)]) -> u32 {
        let row = |&(axis, is_limit): &(u32, bool)| axis + 1 + if is_limit { Self::LIMIT } else { 0 };
        axes.iter().zip(0..3).map(|(axis, i)| row(axis) << (8 * i)).sum()
    }

    /// Whether row i is a limit.
    pub fn is_limit(&self, i: usize) -> bool {
        !self.is_of_anchors() && self.rows >> (8 * i) & Self::LIMIT != 0
    }

    /// Whether any row is a limit.
    pub fn has_limits(&self) -> bool {
        (0..3).any(|i| self.is_limit(i))
    }

    /// Whether row i is there.
    pub fn has_row(&self, i: usize) -> bool {
        self.rows >> (8 * i) & 0xff != 0
    }

    /// Whether the node keeps anchors together.
    pub fn is_of_anchors(&self) -> bool {
        self.rows == Self::ANCHORS
    }

    /// The axes of the node: the row, and the number of the axis among those of the joint.
    pub fn axes(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let rows = if self.is_of_anchors() { 0 } else { self.rows };
        (0..3).filter_map(move |i| Some((i, (rows >> (8 * i) & (Self::LIMIT - 1)).checked_sub(1)? as usize)))
    }
}

/// One block of L, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BlockRow {
    /// The node of its row of L.
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

    /// The blocks of a system.
    pub fn blocks_of_system(&self, system: usize) -> Range<usize> {
        let nodes = self.nodes_of(system);
        self.blocks_of(nodes.start).start..self.blocks_of(nodes.end - 1).end
    }

    /// Whether two systems have nodes of the same kinds, and factors with the same blocks and products. Such systems
    /// can be solved side by side.
    pub fn are_of_one_form(&self, [one, other]: [usize; 2]) -> bool {
        let [nodes, other_nodes] = [one, other].map(|system| self.nodes_of(system));
        let [blocks, other_blocks] = [one, other].map(|system| self.blocks_of_system(system));
        if nodes.len() != other_nodes.len() || blocks.len() != other_blocks.len() {
            return false;
        }
        let [node, block] = [(&nodes, &other_nodes), (&blocks, &other_blocks)]
            .map(|(one, other)| (other.start as u32).wrapping_sub(one.start as u32));
        nodes.zip(other_nodes).all(|(one, other)| {
            let (one, other) = (&self.nodes[one], &self.nodes[other]);
            one.rows == other.rows && one.first_block.wrapping_add(block) == other.first_block
        }) && blocks.zip(other_blocks).all(|(one, other)| {
            let (one, other) = (&self.blocks[one], &self.blocks[other]);
            let [terms, other_terms] = [one, other].map(|row| self.terms_of(row));
            let is_same = |(a, b): (&[u32; 2], &[u32; 2])| a.map(|a| a.wrapping_add(block)) == *b;
            one.node.wrapping_add(node) == other.node
                && one.shared == other.shared
                && terms.len() == other_terms.len()
                && terms.iter().zip(other_terms).all(is_same)
        })
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

    /// Whether there are no systems.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Forgets all systems.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds the system of some nodes, each a joint with rows ([`NodeRow::rows`]), if its factors have at most
    /// `most_terms` products and it has any nodes. Returns whether it did. `sides` are the movable bodies of a joint.
    /// Nodes of one joint must be neighbors.
    pub fn add(&mut self, nodes: &[(u32, u32)], sides: impl Fn(u32) -> [Option<u32>; 2], most_terms: usize) -> bool {
        let sides = |node: u32| sides(nodes[node as usize].0);
        let Some(columns) = eliminated(nodes.len(), &sides, most_terms).filter(|columns| !columns.is_empty()) else {
            return false;
        };
        if self.begins.is_empty() {
            self.begins.push(0);
        }
        let base = self.nodes.len() as u32;
        let mut place = vec![0; nodes.len()];
        columns.iter().zip(base..).for_each(|((local, _), at)| place[*local as usize] = at);
        // The blocks of L, column by column, with ascending rows.
        for (local, below) in &columns {
            let first_block = self.blocks.len() as u32;
            let node = place[*local as usize];
            let own = BlockRow { node, ..BlockRow::default() };
            let mut rows: Vec<BlockRow> = below
                .iter()
                .map(|&row| {
                    let shared = shared_sides(sides(*local), sides(row));
                    BlockRow { node: place[row as usize], shared, ..BlockRow::default() }
                })
                .collect();
            rows.sort_unstable_by_key(|row| row.node);
            self.blocks.push(own);
            self.blocks.append(&mut rows);
            let end_block = self.blocks.len() as u32;
            let (joint, rows) = nodes[*local as usize];
            self.nodes.push(NodeRow { joint, first_block, end_block, rows });
        }
        self.begins.push(self.nodes.len() as u32);
        let firsts: Vec<_> = (0..nodes.len()).filter(|&i| i == 0 || nodes[i - 1].0 != nodes[i].0).collect();
        let joints: Vec<_> = firsts.into_iter().map(|node| sides(node as u32)).collect();
        self.softness.push(match nodes.iter().all(|node| node.1 == NodeRow::ANCHORS) {
            _ if has_loops(&joints) => LOOP_SOFTNESS,
            true => 0.0,
            false => AXIS_SOFTNESS,
        });
        self.add_terms(base as usize);
        true
    }

    /// Adds the products of the blocks of the last system, whose nodes begin at `base`.
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

/// Whether the bodies have more joints than they need. `joints` has the movable bodies of each joint.
fn has_loops(joints: &[[Option<u32>; 2]]) -> bool {
    let mut bodies: Vec<u32> = joints.iter().flatten().flatten().copied().collect();
    bodies.sort_unstable();
    bodies.dedup();
    // One joint may connect a tree to the world.
    joints.len() > bodies.len()
        || joints.iter().filter(|sides| sides.iter().flatten().count() == 2).count() >= bodies.len()
}

/// The bits of `BlockRow::shared`, for the sides of two joints.
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

/// The nodes in the order of their elimination, each with the later nodes that have a block in its column of L. `None`
/// if there are more than `most_terms` products. `sides` are the movable bodies of a node.
///
/// The node with the fewest neighbors comes next; of several, the one that has waited longest. In a chain this takes
/// nodes from both ends in turn, so a processor works on two recurrences side by side.
fn eliminated(
    count: usize,
    sides: &impl Fn(u32) -> [Option<u32>; 2],
    most_terms: usize,
) -> Option<Vec<(u32, Vec<u32>)>> {
    let mut of_body: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for node in 0..count as u32 {
        sides(node).into_iter().flatten().for_each(|body| of_body.entry(body).or_default().push(node));
    }
    let mut neighbors = vec![BTreeSet::new(); count];
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
    let mut waiting = vec![VecDeque::new(); count];
    (0..count).for_each(|i| waiting[neighbors[i].len()].push_back(i as u32));
    let mut is_done = vec![false; count];
    let mut columns = Vec::with_capacity(count);
    let (mut terms, mut least) = (0, 0);
    while columns.len() < count {
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
