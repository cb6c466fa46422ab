//! A tree of boxes with four children a node. It finds overlapping boxes of a world.
//!
//! The tree has no pointers. Boxes are stored in an order in which neighbors are near each other, and node i of a level
//! holds the nodes 4 i to 4 i + 3 of the level below. With parry's tree and a table of pairs, the broad phase of a
//! falling pile of 20,000 boxes took 3.4 times as long.

use glam::{Vec3, Vec4};
use parry3d::bounding_volume::Aabb;
use rayon::prelude::*;

use super::collider::FARTHEST;

/// A box that overlaps no other.
pub(super) const NOWHERE: Aabb = Aabb { mins: Vec3::splat(2.0 * FARTHEST), maxs: Vec3::splat(-2.0 * FARTHEST) };

/// Children of one node.
const WIDTH: usize = 4;
/// Level up to which one thread searches a pair of nodes: 256 boxes each.
const ALONE: usize = 3;
/// If leaves stretch to more than this multiple of their length at the last arrangement, the boxes are arranged again.
const STRETCH: f32 = 1.2;
/// Largest weight of one leaf: a box that flew far away does not represent the others.
const MAX_STRETCH: f32 = 16.0;
/// Capacity of the search stack: three nodes of each level above the leaves (15 levels for 2^32 boxes), and one more.
const WAITING: usize = 64;
/// If one box in this many is far from its arranged place, the boxes are arranged again.
const STRAYS: usize = 8;

/// The tree over the last given boxes.
#[derive(Default)]
pub(super) struct Tree {
    /// The indices of the boxes, in the order of the leaves.
    order: Vec<u32>,
    /// The leaves first, the root last.
    levels: Vec<Vec<Node>>,
    /// The leaves before boxes changed.
    before: Vec<Node>,
    /// Average length of the leaves relative to their boxes, at the last arrangement.
    arranged: f32,
}

crate::saved::cloned!(Tree { order, levels, arranged } scratch { before });

/// Four boxes, side by side.
#[derive(Clone, Copy)]
struct Node {
    mins: [Vec4; 3],
    maxs: [Vec4; 3],
    /// One bit for each box: whether it or a box below it changed.
    changed: u32,
}

impl Node {
    fn new(boxes: [Aabb; WIDTH], changed: u32) -> Self {
        let side = |of: fn(&Aabb) -> Vec3| {
            let [a, b, c, d] = [of(&boxes[0]), of(&boxes[1]), of(&boxes[2]), of(&boxes[3])];
            [0, 1, 2].map(|axis| Vec4::new(a[axis], b[axis], c[axis], d[axis]))
        };
        Self { mins: side(|aabb| aabb.mins), maxs: side(|aabb| aabb.maxs), changed }
    }

    /// The box around its boxes.
    fn around(&self) -> Aabb {
        let mins = Vec3::from(self.mins.map(Vec4::min_element));
        Aabb { mins, maxs: Vec3::from(self.maxs.map(Vec4::max_element)) }
    }

    /// Which of its boxes overlap which boxes of another node. Four bits for the first box, and so on.
    fn overlaps(&self, other: &Self) -> u32 {
        let lane = |lane: usize| {
            let axis = |k: usize| {
                let (min, max) = (Vec4::splat(self.mins[k][lane]), Vec4::splat(self.maxs[k][lane]));
                other.mins[k].cmple(max) & other.maxs[k].cmpge(min)
            };
            (axis(0) & axis(1) & axis(2)).bitmask() << (4 * lane)
        };
        lane(0) | lane(1) | lane(2) | lane(3)
    }

    /// Which of these pairs have a changed box.
    fn changes(&self, other: &Self) -> u32 {
        let lane = |lane: u32| if self.changed >> lane & 1 == 1 { 0xf } else { other.changed } << (4 * lane);
        lane(0) | lane(1) | lane(2) | lane(3)
    }

    /// Sum of the sides of the node's box, divided by the sum of the sides of its children.
    fn stretch(&self) -> f32 {
        let sides = |axis: usize| (self.maxs[axis] - self.mins[axis]).max(Vec4::ZERO);
        let boxes = (sides(0) + sides(1) + sides(2)).element_sum();
        if boxes == 0.0 { 1.0 } else { (length(&self.around()) / boxes).min(MAX_STRETCH) }
    }
}

fn length(aabb: &Aabb) -> f32 {
    (aabb.maxs - aabb.mins).max(Vec3::ZERO).element_sum()
}

impl Tree {
    /// Takes over the boxes. Some of them differ from `before`, and new boxes come after the others.
    pub fn follow(&mut self, boxes: &[Aabb], before: &[Aabb], changed: &[bool]) {
        let is_new = self.order.is_empty();
        self.order.extend(self.order.len() as u32..boxes.len() as u32);
        let changed = |i: usize| changed[i];
        if !is_new {
            self.fit(boxes, changed);
        }
        if is_new || self.stretch() > STRETCH * self.arranged {
            self.arrange(boxes);
            self.fit(boxes, changed);
            self.arranged = self.stretch();
        }
        let then = |i: usize| if changed(i) { before[i] } else { boxes[i] };
        leaves(&self.order, then, |_| false, &mut self.before);
    }

    /// A tree for queries over other boxes, in the order of this one. `strays` of them are not near the box that they
    /// had here.
    pub fn for_boxes(&self, boxes: &[Aabb], strays: usize) -> Self {
        let mut tree = Self { order: self.order.clone(), ..Self::default() };
        tree.order.extend(tree.order.len() as u32..boxes.len() as u32);
        if STRAYS * strays > boxes.len() {
            tree.arrange(boxes);
        }
        tree.fit(boxes, |_| false);
        tree
    }

    /// Sorts the boxes so that those of a node are near each other.
    fn arrange(&mut self, boxes: &[Aabb]) {
        let center = |&i: &u32| (boxes[i as usize].center(), i);
        let mut places: Vec<_> = self.order.par_iter().map(center).collect();
        arrange(&mut places);
        self.order.iter_mut().zip(&places).for_each(|(i, place)| *i = place.1);
    }

    /// Makes the nodes, from the leaves to the root.
    fn fit(&mut self, boxes: &[Aabb], changed: impl Fn(usize) -> bool + Sync) {
        let node = |four: &[Node]| {
            let (mut around, mut bits) = ([NOWHERE; WIDTH], 0);
            for (lane, node) in four.iter().enumerate() {
                around[lane] = node.around();
                bits |= u32::from(node.changed != 0) << lane;
            }
            Node::new(around, bits)
        };
        if self.levels.is_empty() {
            self.levels.push(Vec::new());
        }
        leaves(&self.order, |i| boxes[i], changed, &mut self.levels[0]);
        for level in 1.. {
            if self.levels[level - 1].len() <= 1 {
                break;
            }
            if self.levels.len() == level {
                self.levels.push(Vec::new());
            }
            let (below, above) = self.levels.split_at_mut(level);
            below[level - 1].par_chunks(WIDTH).with_min_len(256).map(node).collect_into_vec(&mut above[0]);
        }
    }

    /// Average length of the leaves relative to their boxes.
    fn stretch(&self) -> f32 {
        let leaves = &self.levels[0];
        leaves.iter().map(Node::stretch).sum::<f32>() / leaves.len() as f32
    }

    /// Visits boxes, the nearer ones of a node first. `bound` takes the lower and upper coordinates of four boxes along
    /// each axis, and returns a lower bound of the result in each. `visit` gets a box with its bound and returns the
    /// new limit: boxes with a larger bound are skipped.
    pub fn nearest(
        &self,
        mut limit: f32,
        bound: impl Fn(&[Vec4; 3], &[Vec4; 3]) -> Vec4,
        mut visit: impl FnMut(u32, f32) -> f32,
    ) {
        if self.order.is_empty() {
            return;
        }
        let (mut waiting, mut count) = ([(0.0, 0, 0); WAITING], 1);
        waiting[0] = (0.0, self.levels.len() - 1, 0);
        while count > 0 {
            count -= 1;
            let (least, level, node) = waiting[count];
            if least > limit {
                continue;
            }
            let node = (node, &self.levels[level][node]);
            let bounds = bound(&node.1.mins, &node.1.maxs).to_array();
            let mut lanes = [0, 1, 2, 3];
            lanes.sort_unstable_by(|&a: &usize, &b| bounds[a].total_cmp(&bounds[b]).then(a.cmp(&b)));
            if level == 0 {
                for lane in lanes {
                    if bounds[lane] <= limit {
                        limit = visit(self.order[WIDTH * node.0 + lane], bounds[lane]);
                    }
                }
                continue;
            }
            // The nearest is popped next.
            for lane in lanes.into_iter().rev().filter(|&lane| bounds[lane] <= limit) {
                waiting[count] = (bounds[lane], level - 1, WIDTH * node.0 + lane);
                count += 1;
            }
        }
    }

    /// Calls `visit` on each box that overlaps a given one. The order depends on the boxes of all earlier steps.
    pub fn visit(&self, aabb: &Aabb, mut visit: impl FnMut(u32)) {
        if !self.order.is_empty() {
            let one = Node::new([*aabb, NOWHERE, NOWHERE, NOWHERE], 0);
            self.visit_node(self.levels.len() - 1, 0, &one, &mut visit);
        }
    }

    fn visit_node(&self, level: usize, node: usize, one: &Node, visit: &mut impl FnMut(u32)) {
        let mut hits = one.overlaps(&self.levels[level][node]) & 0xf;
        while hits != 0 {
            let below = WIDTH * node + hits.trailing_zeros() as usize;
            hits &= hits - 1;
            if level == 0 { visit(self.order[below]) } else { self.visit_node(level - 1, below, one, visit) }
        }
    }

    /// Finds all pairs of boxes that newly overlap and that `accept` accepts. The order depends on the number of
    /// threads.
    pub fn overlaps(&self, accept: &(impl Fn(u32, u32) -> bool + Sync)) -> Vec<(u32, u32)> {
        if self.order.is_empty() { Vec::new() } else { self.overlaps_of(self.levels.len() - 1, [0, 0], accept) }
    }

    /// The same among the boxes of two nodes of one level, or within one node.
    fn overlaps_of(
        &self,
        level: usize,
        nodes: [usize; 2],
        accept: &(impl Fn(u32, u32) -> bool + Sync),
    ) -> Vec<(u32, u32)> {
        let mut found = Vec::new();
        if level <= ALONE {
            self.search(level, nodes, accept, &mut found);
            return found;
        }
        let (mut below, mut count) = ([[0, 0]; WIDTH * WIDTH], 0);
        self.descend(level, nodes, |nodes| {
            below[count] = nodes;
            count += 1;
        });
        let parts = below[..count].par_iter().map(|&nodes| self.overlaps_of(level - 1, nodes, accept));
        parts.reduce(Vec::new, |mut a, mut b| {
            a.append(&mut b);
            a
        })
    }

    /// The same, on one thread.
    fn search(&self, level: usize, nodes: [usize; 2], accept: &impl Fn(u32, u32) -> bool, found: &mut Vec<(u32, u32)>) {
        if level > 0 {
            return self.descend(level, nodes, |nodes| self.search(level - 1, nodes, accept, found));
        }
        self.descend(level, nodes, |[a, b]| {
            let (i, j) = (self.order[a], self.order[b]);
            if accept(i, j) {
                found.push((i.min(j), i.max(j)));
            }
        });
    }

    /// Calls `visit` for the overlapping pairs of boxes of two nodes; in leaves, only for pairs that did not overlap
    /// before.
    fn descend(&self, level: usize, [a, b]: [usize; 2], mut visit: impl FnMut([usize; 2])) {
        let nodes = &self.levels[level];
        let mut hits = nodes[a].overlaps(&nodes[b]) & nodes[a].changes(&nodes[b]);
        if a == b {
            // Visit each pair once: a box in a leaf not with itself, but a node with itself.
            hits &= if level == 0 { 0x08ce } else { 0x8cef };
        }
        if level == 0 && hits != 0 {
            hits &= !self.before[a].overlaps(&self.before[b]);
        }
        while hits != 0 {
            let hit = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            visit([WIDTH * a + hit / WIDTH, WIDTH * b + hit % WIDTH]);
        }
    }
}

/// The leaves over boxes in an order, and which boxes changed.
fn leaves(
    order: &[u32],
    of: impl Fn(usize) -> Aabb + Sync,
    changed: impl Fn(usize) -> bool + Sync,
    leaves: &mut Vec<Node>,
) {
    let leaf = |four: &[u32]| {
        let (mut leaf, mut bits) = ([NOWHERE; WIDTH], 0);
        for (lane, &i) in four.iter().enumerate() {
            leaf[lane] = of(i as usize);
            bits |= u32::from(changed(i as usize)) << lane;
        }
        Node::new(leaf, bits)
    };
    order.par_chunks(WIDTH).with_min_len(256).map(leaf).collect_into_vec(leaves);
}

/// Sorts points so that those of a node are near each other: it halves them across their longest side, down to one
/// leaf. Ties go by index.
fn arrange(places: &mut [(Vec3, u32)]) {
    if places.len() <= WIDTH {
        return;
    }
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mins, maxs) = places.iter().fold(none, |(mins, maxs), place| (mins.min(place.0), maxs.max(place.0)));
    let axis = (maxs - mins).max_position();
    // Both sides get whole nodes of the level below; all but the last are full.
    let mut node = WIDTH;
    while node * WIDTH < places.len() {
        node *= WIDTH;
    }
    let middle = places.len().div_ceil(node) / 2 * node;
    // Boxes of a lattice have many equal coordinates along one axis.
    let by = |k: usize| move |a: &(Vec3, u32), b: &(Vec3, u32)| a.0[(axis + k) % 3].total_cmp(&b.0[(axis + k) % 3]);
    let compare = |a: &_, b: &_| by(0)(a, b).then_with(|| by(1)(a, b)).then_with(|| by(2)(a, b)).then(a.1.cmp(&b.1));
    places.select_nth_unstable_by(middle, compare);
    let (left, right) = places.split_at_mut(middle);
    if left.len() < 1024 {
        arrange(left);
        arrange(right);
    } else {
        rayon::join(|| arrange(left), || arrange(right));
    }
}

#[cfg(test)]
mod tests {
    use parry3d::bounding_volume::BoundingVolume;

    use super::*;
    use crate::random::SplitMix64;

    /// Boxes from 1 cm to 10 m move slowly, jump, appear and disappear. Two of three do not move in a step.
    #[test]
    fn all_pairs_that_begin_to_overlap_are_found_once_on_any_number_of_threads() {
        let pools = [1, 3].map(|count| rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool"));
        let mut random = SplitMix64::new(1);
        let mut next = move || 0.5 * (random.symmetric() as f32 + 1.0);
        for count in [1, 2, 4, 5, 16, 17, 65, 300, 1500] {
            let (mut boxes, mut changed) = (vec![NOWHERE; count], vec![true; count]);
            let (mut trees, mut begun) = ([Tree::default(), Tree::default()], 0);
            for step in 0..12 {
                let before = boxes.clone();
                for (i, aabb) in boxes.iter_mut().enumerate() {
                    changed[i] = step == 0 || next() < 1.0 / 3.0;
                    if changed[i] {
                        let half = Vec3::splat(0.005 * 1000.0_f32.powf(next().powi(4)));
                        let mut place = || 10.0 * next() - 5.0;
                        let anywhere = Vec3::new(place(), place(), place());
                        let goes = step > 0 && step % 4 == 1 && i % 7 == 0;
                        *aabb = if goes { NOWHERE } else { Aabb::from_half_extents(anywhere, half) };
                    }
                }
                let all = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
                let begins = |&(i, j): &(usize, usize)| {
                    boxes[i].intersects(&boxes[j]) && !before[i].intersects(&before[j]) && (i + j) % 5 != 0
                };
                let expected: Vec<_> = all.filter(begins).map(|(i, j)| (i as u32, j as u32)).collect();
                begun += expected.len();
                for (tree, pool) in trees.iter_mut().zip(&pools) {
                    tree.follow(&boxes, &before, &changed);
                    let mut found = pool.install(|| tree.overlaps(&|i, j| (i + j) % 5 != 0));
                    found.sort_unstable();
                    assert_eq!(found, expected, "{count} boxes, step {step}");
                }
            }
            assert!(count < 65 || begun > count, "{count} boxes: only {begun} overlaps began");
        }
    }

    /// The cost of a search, in node comparisons, grows with the stretch of the leaves.
    #[test]
    fn boxes_that_mix_are_arranged_anew_and_boxes_that_fall_together_are_not() {
        let place = |i: usize, step: usize| Vec3::new((i % 10) as f32, (i / 100 + step) as f32, (i / 10 % 10) as f32);
        let cube = |center: Vec3| Aabb::from_half_extents(center, Vec3::splat(0.4));
        let mut tree = Tree::default();
        let mut boxes = vec![NOWHERE; 1000];
        for step in 0..5 {
            let before = boxes.clone();
            boxes = (0..1000).map(|i| cube(place(i, step))).collect();
            let order = tree.order.clone();
            tree.follow(&boxes, &before, &[true; 1000]);
            assert_eq!(tree.order == order, step > 0, "step {step}");
        }
        let (before, well) = (boxes.clone(), tree.stretch());
        boxes = (0..1000).map(|i| cube(place(i * 617 % 1000, 0))).collect();
        tree.follow(&boxes, &before, &[true; 1000]);
        assert!(tree.stretch() < 1.01 * well, "{} after {well}", tree.stretch());
    }
}
