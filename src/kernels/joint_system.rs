//! All joints of a connected set of bodies, solved directly: S λ = -u by S = L D Lᵀ in blocks of 3 x 3. Twins of
//! `shaders/lib/joint_system.wgsl` and of the kernels `begin_systems`, `measure_joints`, `solve_joint_systems` and
//! `apply_joint_changes`.
//!
//! A node of a system is up to three rows of one joint: its anchors, its locks and limits of shifts, or those of turns.
//! Drives are swept (`solve_axes`). Limits are swept until they have an impulse, and hold like locks from then on. A
//! limit that would pull returns to the sweeps: the solver takes its impulse back, removes its row, and factors the system
//! without it. Arms and axes turn with their bodies, and the blocks of S with them, so S is factored anew when bodies
//! have moved. The problem lists the order of elimination, the nonzero blocks, and the products in each block
//! (`JointSystems`).

use super::Rules;
use super::axis::{AxisMotion, Frames, NearerLimit, axis_motion, axis_speed, is_lock};
use super::joint::current_anchors;
use super::pair::relative_velocity;
use super::rows::{Axis, Joint, Pair, StepParams, Sym3};
use crate::constants::{MIN_PIVOT, YIELDING};
use crate::math::effective_mass::unlocked;
use crate::math::{Lane, Quat, Scalar, Vec3, cross3, dot3, larger, reciprocal, select3, turned, vec3};
use crate::problem::{JointSystems, NodeRow};

/// A block of a matrix, as three columns. Each column has a fourth number, which nothing reads, so that a column of
/// single numbers fills a register. Only columns of single numbers compute with it ([`Lane::COLUMN`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block<L>([[L; 4]; 3]);

impl<L: Lane> Block<L> {
    /// The block with these columns.
    #[inline(always)]
    pub fn of(x: Vec3<L>, y: Vec3<L>, z: Vec3<L>) -> Self {
        let zero = L::default();
        Self([[x.x, x.y, x.z, zero], [y.x, y.y, y.z, zero], [z.x, z.y, z.z, zero]])
    }

    /// The block with these rows.
    #[inline(always)]
    pub fn of_rows(x: Vec3<L>, y: Vec3<L>, z: Vec3<L>) -> Self {
        Self::of(vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y), vec3(x.z, y.z, z.z))
    }

    /// A column.
    #[inline(always)]
    pub fn column(&self, i: usize) -> Vec3<L> {
        vec3(self.0[i][0], self.0[i][1], self.0[i][2])
    }

    #[inline(always)]
    fn combined(&self, factors: [L; 3]) -> [L; 4] {
        let ([x, y, z], [a, b, c]) = (&self.0, factors);
        let mut sum = [L::default(); 4];
        for i in 0..L::COLUMN {
            sum[i] = x[i] * a + y[i] * b + z[i] * c;
        }
        sum
    }

    /// The diagonal.
    #[inline(always)]
    pub fn diagonal(&self) -> Vec3<L> {
        vec3(self.0[0][0], self.0[1][1], self.0[2][2])
    }

    /// Adds a number to the diagonal.
    #[inline(always)]
    pub fn soften(&mut self, more: L) {
        for i in 0..3 {
            self.0[i][i] = self.0[i][i] + more;
        }
    }

    /// This block times a vector.
    #[inline(always)]
    pub fn times(&self, u: Vec3<L>) -> Vec3<L> {
        let [x, y, z, _] = self.combined([u.x, u.y, u.z]);
        vec3(x, y, z)
    }

    /// The transpose of this block times a vector.
    #[inline(always)]
    pub fn transpose_times(&self, u: Vec3<L>) -> Vec3<L> {
        vec3(dot3(self.column(0), u), dot3(self.column(1), u), dot3(self.column(2), u))
    }

    /// The product with another block.
    #[inline(always)]
    pub fn product(&self, right: &Self) -> Self {
        let mut product = Self::default();
        for (column, [x, y, z, _]) in product.0.iter_mut().zip(right.0) {
            *column = self.combined([x, y, z]);
        }
        product
    }

    /// The product with the transpose of another block.
    #[inline(always)]
    pub fn product_with_transpose(&self, right: &Self) -> Self {
        let mut product = Self::default();
        let [x, y, z] = &right.0;
        for (j, column) in product.0.iter_mut().enumerate() {
            *column = self.combined([x[j], y[j], z[j]]);
        }
        product
    }

    /// The sum with another block.
    #[inline(always)]
    pub fn plus(&self, other: &Self) -> Self {
        let mut sum = *self;
        for (column, other) in sum.0.iter_mut().zip(&other.0) {
            for i in 0..L::COLUMN {
                column[i] = column[i] + other[i];
            }
        }
        sum
    }

    /// The block of L D below a factored pivot. `self` is the block of S, less its products.
    #[inline(always)]
    pub fn over(&self, pivot: &Self) -> Self {
        let ([x, y, z], [l_x, l_y, _]) = (&self.0, &pivot.0);
        let mut over = *self;
        for i in 0..L::COLUMN {
            over.0[1][i] = y[i] - x[i] * l_x[1];
            over.0[2][i] = z[i] - x[i] * l_x[2] - over.0[1][i] * l_y[2];
        }
        over
    }

    /// The block without its columns of locked axes.
    #[inline(always)]
    pub fn unlocked(&self, locks: L) -> Self {
        let one = L::constant(1.0);
        self.with_columns_times(unlocked(locks, vec3(one, one, one)))
    }

    /// The block with its columns scaled by three numbers.
    #[inline(always)]
    pub fn with_columns_times(&self, factors: Vec3<L>) -> Self {
        Self::of(self.column(0) * factors.x, self.column(1) * factors.y, self.column(2) * factors.z)
    }

    /// l⁻¹ u, where this block is a factored pivot.
    #[inline(always)]
    pub fn forward(&self, u: Vec3<L>) -> Vec3<L> {
        let [x, y, _] = &self.0;
        let second = u.y - x[1] * u.x;
        vec3(u.x, second, u.z - x[2] * u.x - y[2] * second)
    }

    /// l⁻ᵀ u, where this block is a factored pivot.
    #[inline(always)]
    pub fn backward(&self, u: Vec3<L>) -> Vec3<L> {
        let [x, y, _] = &self.0;
        let second = u.y - y[2] * u.z;
        vec3(u.x - x[1] * second - x[2] * u.z, second, u.z)
    }

    /// The block scaled by a number.
    #[inline(always)]
    pub fn scaled(&self, factor: L) -> Self {
        let mut scaled = *self;
        for column in &mut scaled.0 {
            for x in &mut column[..L::COLUMN] {
                *x = *x * factor;
            }
        }
        scaled
    }

    /// The difference from another block.
    #[inline(always)]
    pub fn less(&self, other: &Self) -> Self {
        let mut rest = *self;
        for (column, other) in rest.0.iter_mut().zip(&other.0) {
            for i in 0..L::COLUMN {
                column[i] = column[i] - other[i];
            }
        }
        rest
    }
}

/// One over a pivot of at least `least`; 0 for a row whose diagonal was zero in S.
#[inline(always)]
fn inverse_pivot<L: Lane>(pivot: L, own: L, least: L) -> L {
    let zero = L::constant(0.0);
    L::select(zero, reciprocal(larger(pivot, least)), own.gt(zero))
}

/// The factors l d lᵀ of a pivot, whose diagonal in S was `own`. The result has l below the diagonal, and 1/d on it. In
/// a missing row, whose diagonal in S is zero, 1/d is zero. A solution by the inverse would lose precision by the ratio
/// of the stiffnesses of a pivot in different directions, which is 1e5 for a lever and its hinge.
#[inline(always)]
pub fn factored_pivot<L: Lane>(pivot: &Block<L>, own: Vec3<L>) -> Block<L> {
    let zero = L::constant(0.0);
    let [x, y, z] = [pivot.column(0), pivot.column(1), pivot.column(2)];
    let least = (own.x + own.y + own.z) * L::constant(MIN_PIVOT);
    let d_x = inverse_pivot(x.x, own.x, least);
    let (l_xy, l_xz) = (x.y * d_x, x.z * d_x);
    let d_y = inverse_pivot(y.y - l_xy * x.y, own.y, least);
    let below = y.z - l_xy * x.z;
    let l_yz = below * d_y;
    let d_z = inverse_pivot(z.z - l_xz * x.z - l_yz * below, own.z, least);
    Block::of(vec3(d_x, l_xy, l_xz), vec3(zero, d_y, l_yz), vec3(zero, zero, d_z))
}

/// An inverse inertia after the rotation q of its body since the step began. Kernel `turn_inertias`.
#[inline(always)]
pub fn turned_inertia<L: Lane>(begin: Sym3<L>, q: Quat<L>) -> Sym3<L> {
    let Sym3 { x: Vec3 { x: xx, y: xy, z: xz }, yz: Vec3 { x: yy, y: yz, z: zz } } = begin;
    let (x, y, z) = (vec3(xx, xy, xz), vec3(xy, yy, yz), vec3(xz, yz, zz));
    // R A, then R (R A)ᵀ.
    let (x, y, z) = (x + turned(q, x), y + turned(q, y), z + turned(q, z));
    let (p, r, s) = (vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y), vec3(x.z, y.z, z.z));
    let (p, r, s) = (p + turned(q, p), r + turned(q, r), s + turned(q, s));
    Sym3 { x: p, yz: vec3(r.y, r.z, s.z) }
}

/// The anchors of a joint as three rows, along the axes of the world. Their impulses act on body b.
#[inline(always)]
pub fn anchor_motions<L: Lane>(pair: &Pair<L>, joint: &Joint<L>) -> [AxisMotion<L>; 3] {
    let (zero, less) = (L::constant(0.0), L::constant(-1.0));
    let ([r_a, r_b], _) = current_anchors(pair, joint);
    let mut motions = [vec3(less, zero, zero), vec3(zero, less, zero), vec3(zero, zero, less)]
        .map(|along| AxisMotion { along, ..AxisMotion::default() });
    for motion in &mut motions {
        (motion.about_a, motion.about_b) = (cross3(r_a, motion.along), cross3(r_b, motion.along));
    }
    motions
}

/// Marks, as a softness, a node whose system has not been factored since it began.
const NOT_FACTORED: f64 = -1.0;

/// Up to three rows of a joint while its system is factored. Twin of the WGSL struct `JointNode`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointNode<L> {
    /// The directions in which its rows push a, and the opposite of those for b.
    pub along: Block<L>,
    /// The axes about which its rows turn a, and the opposite of those for b.
    pub about: [Block<L>; 2],
    /// The changes of spin of a and b by unit impulses, column by column.
    pub turns: [Block<L>; 2],
    /// Inverse masses of a and b.
    pub inv_masses: [L; 2],
    /// Locked axes of a and b.
    pub locks: [L; 2],
    /// The velocity by which a row yields to a unit impulse; 0 for a rigid joint, `NOT_FACTORED` before it is known.
    pub softness: L,
    /// The right-hand side, then the correction.
    pub right: Vec3<L>,
}

impl<L: Lane> JointNode<L> {
    /// The node of three rows. A missing row is zero.
    #[inline(always)]
    pub fn of(pair: &Pair<L>, [x, y, z]: &[AxisMotion<L>; 3]) -> Self {
        let (a, b) = (pair.mass_a.inv_inertia, pair.mass_b.inv_inertia);
        Self {
            along: Block::of_rows(x.along, y.along, z.along),
            about: [Block::of_rows(x.about_a, y.about_a, z.about_a), Block::of_rows(x.about_b, y.about_b, z.about_b)],
            turns: [
                Block::of(a.times(x.about_a), a.times(y.about_a), a.times(z.about_a)),
                Block::of(b.times(x.about_b), b.times(y.about_b), b.times(z.about_b)),
            ],
            inv_masses: [pair.mass_a.inv_mass, pair.mass_b.inv_mass],
            locks: [pair.mass_a.locks, pair.mass_b.locks],
            softness: L::constant(NOT_FACTORED),
            right: Vec3::default(),
        }
    }

    /// Removes a row where the mask holds.
    #[inline(always)]
    fn remove(&mut self, i: usize, mask: L::Mask) {
        let zero = L::default();
        let [about_a, about_b] = &mut self.about;
        for block in [&mut self.along, about_a, about_b] {
            for column in &mut block.0 {
                column[i] = L::select(column[i], zero, mask);
            }
        }
        for turns in &mut self.turns {
            for number in &mut turns.0[i] {
                *number = L::select(*number, zero, mask);
            }
        }
    }

    /// The block of S in the column of this node and the row of another node, or of the same. `shared` has bit 2 i + j
    /// if side i of this joint is side j of the other.
    #[inline(always)]
    pub fn coupling(&self, row: &Self, shared: u32) -> Block<L> {
        let shift = row.along.product_with_transpose(&self.along);
        let mut block = Block::default();
        for side in 0..4 {
            if shared & (1 << side) != 0 {
                let (i, j) = (side / 2, side % 2);
                let shift = if L::any(self.locks[i].gt(L::constant(0.0))) {
                    row.along.product_with_transpose(&self.along.unlocked(self.locks[i]))
                } else {
                    shift
                };
                let movement = row.about[j].product(&self.turns[i]).plus(&shift.scaled(self.inv_masses[i]));
                block = if i == j { block.plus(&movement) } else { block.less(&movement) };
            }
        }
        block
    }
}

/// The sides that a joint shares with itself, in the bits of `shared`.
const OWN_SIDES: u32 = 0b1001;

/// The factors of one system, or of several systems of the same form side by side. Twin of the buffers `joint_nodes`
/// and `joint_blocks`.
pub struct SystemFactors<'a, L> {
    /// Its nodes.
    pub nodes: &'a mut [JointNode<L>],
    /// The blocks of L. A pivot has its own factors here.
    pub lower: &'a mut [Block<L>],
    /// The blocks of L D.
    pub upper: &'a mut [Block<L>],
}

/// The factors of all systems of a step.
#[derive(Clone, Debug, Default)]
pub struct JointFactors<S> {
    nodes: Vec<JointNode<S>>,
    lower: Vec<Block<S>>,
    upper: Vec<Block<S>>,
}

impl<S: Scalar> JointFactors<S> {
    /// Makes room for all systems.
    pub fn reset(&mut self, systems: &JointSystems) {
        self.nodes.resize(systems.nodes.len(), JointNode::default());
        self.lower.resize(systems.blocks.len(), Block::default());
        self.upper.resize(systems.blocks.len(), Block::default());
    }

    /// The nodes, the blocks of L and the blocks of L D of all systems.
    #[allow(clippy::type_complexity)]
    pub fn all(&mut self) -> (&mut [JointNode<S>], &mut [Block<S>], &mut [Block<S>]) {
        (&mut self.nodes, &mut self.lower, &mut self.upper)
    }

    /// The factors of one system.
    pub fn of(&mut self, systems: &JointSystems, system: usize) -> SystemFactors<'_, S> {
        let (nodes, blocks) = (systems.nodes_of(system), systems.blocks_of_system(system));
        SystemFactors {
            nodes: &mut self.nodes[nodes],
            lower: &mut self.lower[blocks.clone()],
            upper: &mut self.upper[blocks],
        }
    }
}

/// The joints of a system, or of several systems of the same form side by side. Nodes are numbered within the system,
/// and have up to three rows.
pub trait SystemRows<L: Lane> {
    /// The joint of a node, with its bodies.
    fn joint(&self, node: usize) -> (Joint<L>, Pair<L>);
    /// An axis of the joint of a node.
    fn axis(&self, node: usize, k: usize) -> Axis<L>;
    /// The softness of the system.
    fn softness(&self) -> L;
    /// The impulse of a row so far.
    fn impulse(&self, node: usize, row: usize) -> L;
    /// The velocity that a row lacks.
    fn lacking(&self, node: usize, row: usize) -> L;
    /// Stores another velocity that a row lacks.
    fn set_lacking(&mut self, node: usize, row: usize, lacking: L);
    /// Stores a correction, and adds it to the impulse.
    fn change(&mut self, node: usize, row: usize, change: L);
}

/// Begins a system at the present poses of its bodies. It writes the rows of the nodes, and the next solution factors
/// them. `system` is one of the systems side by side. Kernel `begin_systems`.
#[inline(always)]
pub fn begin_system<L: Lane>(
    systems: &JointSystems,
    system: usize,
    rows: &impl SystemRows<L>,
    factors: SystemFactors<L>,
) {
    for (i, row) in systems.nodes[systems.nodes_of(system)].iter().enumerate() {
        let (joint, pair) = rows.joint(i);
        let mut motions = [AxisMotion::default(); 3];
        if row.is_of_anchors() {
            motions = anchor_motions(&pair, &joint);
        } else {
            let frames = Frames::of(&pair, &joint);
            for (at, k) in row.axes() {
                motions[at] = axis_motion(&pair, &frames, &rows.axis(i, k));
            }
        }
        factors.nodes[i] = JointNode::of(&pair, &motions);
    }
}

/// Factors a system after its nodes are written.
#[inline(always)]
fn factor_blocks<L: Lane>(systems: &JointSystems, system: usize, relative_softness: L, factors: &mut SystemFactors<L>) {
    let SystemFactors { nodes, lower, upper } = factors;
    let (first_node, first_block) = (systems.nodes_of(system).start, systems.blocks_of_system(system).start);
    for node in systems.nodes_of(system) {
        let column = systems.blocks_of(node);
        let pivot = column.start - first_block;
        for at in column {
            let row = &systems.blocks[at];
            let at = at - first_block;
            let shared = if at == pivot { OWN_SIDES } else { row.shared };
            let mut block = nodes[node - first_node].coupling(&nodes[row.node as usize - first_node], shared);
            let own = block.diagonal();
            if at == pivot {
                let softness = (own.x + own.y + own.z) * relative_softness;
                nodes[node - first_node].softness = softness;
                block.soften(softness);
            }
            for &[left, right] in systems.terms_of(row) {
                let [left, right] = [left, right].map(|block| block as usize - first_block);
                block = block.less(&lower[left].product_with_transpose(&upper[right]));
            }
            if at == pivot {
                lower[at] = factored_pivot(&block, own);
            } else {
                upper[at] = block.over(&lower[pivot]);
                lower[at] = upper[at].with_columns_times(lower[pivot].diagonal());
            }
        }
    }
}

/// The velocity that the anchors of a joint lack. Kernel `measure_joints`.
#[inline(always)]
pub fn measure_joint<L: Lane>(rules: Rules, params: &StepParams<L>, pair: &mut Pair<L>, joint: &Joint<L>) -> Vec3<L> {
    let ([r_a, r_b], gap) = current_anchors(pair, joint);
    let mut wanted = relative_velocity(rules, pair, r_a, r_b);
    if rules.biased {
        wanted += gap * params.joint.bias_rate;
    }
    wanted = select3(wanted, Vec3::default(), joint.is_loose.gt(L::constant(0.0)));
    let Vec3 { x, y, z } = wanted;
    note_lacking(rules, params, pair, larger(larger(larger(x, -x), larger(y, -y)), larger(z, -z)));
    wanted * -params.relaxation
}

/// The velocity that a lock lacks, or a limit that holds like a lock; 0 for a drive. Kernel `measure_joints`.
#[inline(always)]
pub fn measure_axis<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    frames: &Frames<L>,
    axis: &Axis<L>,
) -> L {
    let motion = axis_motion(pair, frames, axis);
    let zero = L::constant(0.0);
    let NearerLimit { is_limit, is_upper, gap, apart } = NearerLimit::of(axis, &motion);
    let rate = if rules.biased { params.joint.bias_rate } else { zero };
    // A body away from its limit may reach it within this substep.
    let pull = gap * L::select(rate, params.inverse_substep, apart);
    let speed = axis_speed(rules, pair, &motion);
    let wanted = L::select(speed + pull, speed - pull, is_upper);
    let of_lock = L::select(zero, wanted, is_lock(axis));
    note_lacking(rules, params, pair, larger(of_lock, -of_lock));
    L::select(of_lock, wanted, is_limit) * -params.relaxation
}

/// Records that a missing velocity is above the tolerance.
#[inline(always)]
fn note_lacking<L: Lane>(rules: Rules, params: &StepParams<L>, pair: &mut Pair<L>, most: L) {
    if rules.measured {
        pair.moving = L::select(pair.moving, L::constant(1.0), most.gt(params.tolerance));
    }
}

/// Solves a system. `rows` gives the velocities that its joints lack, and takes the corrections. `system` is one of the
/// systems side by side. Kernel `solve_joint_systems`.
#[inline(always)]
pub fn solve_system<L: Lane>(
    systems: &JointSystems,
    system: usize,
    rows: &mut impl SystemRows<L>,
    mut factors: SystemFactors<L>,
) {
    // Sweeps may have let go of limits since the system was factored.
    for node in &mut *factors.nodes {
        node.right = Vec3::default();
    }
    // Systems side by side begin together. A system that keeps all its limits is factored and solved again with the
    // same bits, while others let go of some.
    let is_new = L::any(L::default().gt(factors.nodes[0].softness));
    if !is_new {
        leave_out_free(systems, system, rows, &factors);
    }
    let mut changed = let_go(systems, system, is_new, rows, &mut factors) || is_new;
    loop {
        if changed {
            factor_blocks(systems, system, rows.softness(), &mut factors);
        }
        find_changes(systems, system, rows, &mut factors);
        changed = let_go(systems, system, false, rows, &mut factors);
        if !changed {
            break;
        }
    }
    for (i, row) in systems.nodes[systems.nodes_of(system)].iter().enumerate() {
        let Vec3 { x, y, z } = factors.nodes[i].right;
        let held = held_rows(systems, system, row, &factors);
        for (at, change) in [x, y, z].into_iter().enumerate() {
            if row.is_limit(at) {
                // A limit that was let go loses its impulse.
                rows.change(i, at, L::select(rows.lacking(i, at), change, held[at].gt(L::constant(0.0))));
            } else if row.has_row(at) {
                rows.change(i, at, change);
            }
        }
    }
}

/// The factors of the pivots of a node: above 0 for each row that takes part.
#[inline(always)]
fn held_rows<L: Lane>(systems: &JointSystems, system: usize, row: &NodeRow, factors: &SystemFactors<L>) -> [L; 3] {
    let first_block = systems.blocks_of_system(system).start;
    let Vec3 { x, y, z } = factors.lower[row.first_block as usize - first_block].diagonal();
    [x, y, z]
}

/// Leaves limits that do not hold as sweeps left them.
#[inline(always)]
fn leave_out_free<L: Lane>(
    systems: &JointSystems,
    system: usize,
    rows: &mut impl SystemRows<L>,
    factors: &SystemFactors<L>,
) {
    let zero = L::constant(0.0);
    for (node, row) in systems.nodes[systems.nodes_of(system)].iter().enumerate().filter(|(_, row)| row.has_limits()) {
        let held = held_rows(systems, system, row, factors);
        for i in (0..3).filter(|&i| row.is_limit(i)) {
            rows.set_lacking(node, i, L::select(zero, rows.lacking(node, i), held[i].gt(zero)));
        }
    }
}

/// Takes the impulse `before` of a limit back, where the mask holds: adds the velocities that other rows lose by that to
/// those that they lack.
#[inline(always)]
fn take_back<L: Lane>(
    systems: &JointSystems,
    system: usize,
    (node, i): (usize, usize),
    (before, mask): (L, L::Mask),
    rows: &mut impl SystemRows<L>,
    factors: &SystemFactors<L>,
) {
    let first_node = systems.nodes_of(system).start;
    for column in 0..factors.nodes.len() {
        let blocks = systems.blocks_of(first_node + column);
        for at in blocks.clone() {
            let block = &systems.blocks[at];
            let row = block.node as usize - first_node;
            if column != node && row != node {
                continue;
            }
            let shared = if at == blocks.start { OWN_SIDES } else { block.shared };
            let coupling = factors.nodes[column].coupling(&factors.nodes[row], shared);
            // A closure in place of this loop would be compiled without SIMD instructions.
            let (other, coupled) = if column == node {
                let Vec3 { x, y, z } = coupling.column(i);
                (row, [x, y, z])
            } else {
                (column, [0, 1, 2].map(|k| coupling.0[k][i]))
            };
            for (k, coupled) in coupled.into_iter().enumerate() {
                if systems.nodes[first_node + other].has_row(k) && (other, k) != (node, i) {
                    let lacking = rows.lacking(other, k);
                    rows.set_lacking(other, k, L::select(lacking, lacking + coupled * before, mask));
                }
            }
        }
    }
}

/// Removes from a system the limits that hold but have no impulse, or would pull after the changes found. A limit that
/// would pull loses its impulse: what it kept would push without need. Returns whether there were any. In a new system,
/// all limits hold.
#[inline(always)]
fn let_go<L: Lane>(
    systems: &JointSystems,
    system: usize,
    is_new: bool,
    rows: &mut impl SystemRows<L>,
    factors: &mut SystemFactors<L>,
) -> bool {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let mut any = false;
    for (node, row) in systems.nodes[systems.nodes_of(system)].iter().enumerate().filter(|(_, row)| row.has_limits()) {
        let held = held_rows(systems, system, row, factors);
        let Vec3 { x, y, z } = factors.nodes[node].right;
        let changes = [x, y, z];
        for i in 0..3 {
            if !row.is_limit(i) {
                continue;
            }
            let before = rows.impulse(node, i);
            let still_pushes = (before * (before + changes[i])).gt(zero);
            let holds = if is_new { L::mask(true) } else { held[i].gt(zero) };
            let lets_go = L::select(L::select(zero, one, holds), zero, still_pushes).gt(zero);
            if L::any(lets_go) {
                let pushed = L::and(lets_go, larger(before, -before).gt(zero));
                if L::any(pushed) {
                    take_back(systems, system, (node, i), (before, pushed), rows, factors);
                }
                rows.set_lacking(node, i, L::select(rows.lacking(node, i), -before, lets_go));
                factors.nodes[node].remove(i, lets_go);
                any = true;
            }
        }
    }
    any
}

/// Finds the changes of the impulses of a system, and stores them as the right-hand sides of its nodes.
#[inline(always)]
fn find_changes<L: Lane>(
    systems: &JointSystems,
    system: usize,
    rows: &impl SystemRows<L>,
    factors: &mut SystemFactors<L>,
) {
    let SystemFactors { nodes, lower, .. } = factors;
    let (own, first_block) = (systems.nodes_of(system), systems.blocks_of_system(system).start);
    let first_node = own.start;
    for node in own.clone() {
        let (row, i) = (&systems.nodes[node], node - first_node);
        let yielding = nodes[i].softness * L::constant(YIELDING);
        let mut right = [L::default(); 3];
        for (at, right) in right.iter_mut().enumerate() {
            if row.has_row(at) {
                *right = rows.lacking(i, at) - rows.impulse(i, at) * yielding;
            }
        }
        nodes[i].right = vec3(right[0], right[1], right[2]);
    }
    for node in own.clone() {
        let column = systems.blocks_of(node);
        let right = lower[column.start - first_block].forward(nodes[node - first_node].right);
        nodes[node - first_node].right = right;
        for at in column.skip(1) {
            let row = &mut nodes[systems.blocks[at].node as usize - first_node].right;
            *row -= lower[at - first_block].times(right);
        }
    }
    for node in own.rev() {
        let column = systems.blocks_of(node);
        let pivot = &lower[column.start - first_block];
        let mut change = nodes[node - first_node].right * pivot.diagonal();
        for at in column.skip(1) {
            let below = nodes[systems.blocks[at].node as usize - first_node].right;
            change -= lower[at - first_block].transpose_times(below);
        }
        nodes[node - first_node].right = pivot.backward(change);
    }
}
