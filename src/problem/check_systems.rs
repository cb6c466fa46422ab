//! Checks that systems of joints keep the rules that backends rely on.

use super::check::refuse;
use super::{JointRow, JointSystems, NodeRow, StepProblem};
use crate::error::Result;

impl StepProblem {
    /// Checks two rules. The systems of a block hold the anchors, locks and limits of the joints of its direct colors,
    /// each once. The blocks and products of a node belong to its system, and products come before the block that they
    /// are subtracted from.
    pub(super) fn check_systems(&self) -> Result<()> {
        let JointSystems { begins, softness, nodes, blocks, terms } = &self.systems;
        let ends = begins.first().zip(begins.last()).map_or([0, 0], |(first, last)| [*first as usize, *last as usize]);
        let count = begins.len().saturating_sub(1);
        if ends != [0, nodes.len()] || !begins.is_sorted_by(|a, b| a < b) || softness.len() != count {
            return refuse(format_args!(
                "systems: {count} with {} softnesses, over {} nodes",
                softness.len(),
                nodes.len()
            ));
        }
        let mut end = 0;
        for (node, row) in nodes.iter().enumerate() {
            let own = blocks.get(row.first_block as usize..row.end_block as usize).unwrap_or_default();
            if row.first_block as usize != end || own.first().is_none_or(|pivot| pivot.node as usize != node) {
                return refuse(format_args!(
                    "systems.nodes[{node}]: blocks from {} to {}",
                    row.first_block, row.end_block
                ));
            }
            end = row.end_block as usize;
        }
        for system in 0..count {
            let own = self.systems.nodes_of(system);
            let first = nodes[own.start].first_block;
            for node in own.clone() {
                for at in self.systems.blocks_of(node) {
                    let row = &blocks[at];
                    let products = terms.get(row.first_term as usize..row.end_term as usize);
                    let is_own = |term: &u32| (first..at as u32).contains(term);
                    let is_after = (node..own.end).contains(&(row.node as usize));
                    if !is_after || !products.is_some_and(|products| products.iter().flatten().all(is_own)) {
                        return refuse(format_args!(
                            "systems.blocks[{at}]: node {}, or a product, is of none before",
                            row.node
                        ));
                    }
                }
            }
        }
        for (i, block) in self.blocks.iter().enumerate() {
            let direct = self.rows_of(&block.direct_joints());
            let [_, _, _, _, own, _] = block.colors();
            let nodes_of = |&system: &u32| &nodes[self.systems.nodes_of(system as usize)];
            let mut wanted: Vec<_> = direct.iter().flat_map(|&joint| self.rows_to_solve(joint)).collect();
            let mut solved: Vec<_> = self.rows_of(&own).iter().flat_map(nodes_of).flat_map(rows_of_node).collect();
            wanted.sort_unstable();
            solved.sort_unstable();
            if solved != wanted {
                return refuse(format_args!(
                    "blocks[{i}]: the rows of its systems are not the anchors, locks and limits of its direct colors"
                ));
            }
        }
        let mut next = 0;
        for (row, turning) in self.turning.iter().enumerate() {
            let (body, bodies) = (turning.body as usize, self.bodies.len());
            if body >= bodies || body < next {
                return refuse(format_args!("turning[{row}]: body {body}: must be less than {bodies}, and ascending"));
            }
            next = body + 1;
        }
        Ok(())
    }

    /// The rows of a joint that systems solve: its anchors as `None`, and its locks and limits as the number of the
    /// axis and whether it is a limit.
    fn rows_to_solve(&self, joint: u32) -> impl Iterator<Item = Solved> {
        let JointRow { first_axis, axis_count, is_loose, .. } = self.joints[joint as usize];
        let axes = &self.axes[first_axis as usize..(first_axis + axis_count) as usize];
        let bounds = axes.iter().enumerate().filter(|(_, axis)| axis.is_lock() || axis.is_limit());
        let bounds = bounds.map(|(k, axis)| Some((k, axis.is_limit())));
        Some(None).filter(|_| is_loose == 0.0).into_iter().chain(bounds).map(move |row| (joint, row))
    }
}

/// A row that systems solve: the joint, and a row of [`StepProblem::rows_to_solve`].
type Solved = (u32, Option<(usize, bool)>);

/// The rows of a node, in the same form.
fn rows_of_node(node: &NodeRow) -> impl Iterator<Item = Solved> + use<> {
    let node = *node;
    let anchors = Some(None).filter(|_| node.is_of_anchors());
    anchors
        .into_iter()
        .chain(node.axes().map(move |(i, k)| Some((k, node.is_limit(i)))))
        .map(move |row| (node.joint, row))
}
