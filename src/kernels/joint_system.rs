//! All joints of a connected set of bodies, solved at once: S λ = -u by S = L D Lᵀ in blocks of 3 x 3. Doubles of
//! `shaders/lib/joint_system.wgsl` and of the kernels `begin_systems`, `measure_joints`, `solve_joint_systems` and
//! `apply_joint_changes`.
//!
//! A node of a system is up to three rows of one joint: its anchors, its locks and limits to shift along, or those to turn about. Drives are
//! swept (`solve_axes`), and so are limits until they bear an impulse: from then on they hold as locks do. A limit that would pull is left to
//! sweeps again: its row goes, and the system is factored without it. Arms and axes turn with their bodies, and the blocks of S with them: S is factored anew where bodies moved. The
//! order of elimination, the blocks that it fills and the products that each block is made of are lists of the problem (`JointSystems`).

use std::ops::Range;

use super::Rules;
use super::axis::{AxisMotion, NearerLimit, axis_motion, axis_speed, is_lock, select3};
use super::joint::current_anchors;
use super::pair::{relative_movement, relative_velocity};
use super::rows::{Axis, Joint, Mass, Pair, StepParams, Sym3};
use crate::math::{Lane, Quat, Scalar, Vec3, cross3, dot3, larger, reciprocal, turned, vec3};
use crate::problem::{ImpulseNumber, JointSystems, StepProblem};

/// A block of a matrix, by its columns. A fourth number, which nothing reads, makes a column a register.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block<L>([[L; 4]; 3]);

impl<L: Lane> Block<L> {
    /// The block with these columns.
    #[inline(always)]
    pub fn of(x: Vec3<L>, y: Vec3<L>, z: Vec3<L>) -> Self {
        let column = |c: Vec3<L>| [c.x, c.y, c.z, L::default()];
        Self([column(x), column(y), column(z)])
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
        for i in 0..4 {
            sum[i] = x[i] * a + y[i] * b + z[i] * c;
        }
        sum
    }

    /// The diagonal.
    #[inline(always)]
    pub fn diagonal(&self) -> Vec3<L> {
        vec3(self.0[0][0], self.0[1][1], self.0[2][2])
    }

    /// Makes the diagonal larger.
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
            for i in 0..4 {
                column[i] = column[i] + other[i];
            }
        }
        sum
    }

    /// The block of L D below a factored pivot, from that of S.
    #[inline(always)]
    pub fn over(&self, pivot: &Self) -> Self {
        let ([x, y, z], [l_x, l_y, _]) = (&self.0, &pivot.0);
        let mut over = *self;
        for i in 0..4 {
            over.0[1][i] = y[i] - x[i] * l_x[1];
            over.0[2][i] = z[i] - x[i] * l_x[2] - over.0[1][i] * l_y[2];
        }
        over
    }

    /// The block with its columns times three numbers.
    #[inline(always)]
    pub fn with_columns_times(&self, factors: Vec3<L>) -> Self {
        Self::of(self.column(0) * factors.x, self.column(1) * factors.y, self.column(2) * factors.z)
    }

    /// l⁻¹ u of a factored pivot.
    #[inline(always)]
    pub fn forward(&self, u: Vec3<L>) -> Vec3<L> {
        let [x, y, _] = &self.0;
        let second = u.y - x[1] * u.x;
        vec3(u.x, second, u.z - x[2] * u.x - y[2] * second)
    }

    /// l⁻ᵀ u of a factored pivot.
    #[inline(always)]
    pub fn backward(&self, u: Vec3<L>) -> Vec3<L> {
        let [x, y, _] = &self.0;
        let second = u.y - y[2] * u.z;
        vec3(u.x - x[1] * second - x[2] * u.z, second, u.z)
    }

    /// The block times a number.
    #[inline(always)]
    pub fn scaled(&self, factor: L) -> Self {
        let mut scaled = *self;
        scaled.0.iter_mut().flatten().for_each(|x| *x = *x * factor);
        scaled
    }

    /// Less another block.
    #[inline(always)]
    pub fn less(&self, other: &Self) -> Self {
        let mut rest = *self;
        for (column, other) in rest.0.iter_mut().zip(&other.0) {
            for i in 0..4 {
                column[i] = column[i] - other[i];
            }
        }
        rest
    }
}

/// The least pivot of a row, relative to the sum of those of its block in S: rounding of the products that are subtracted from a pivot leaves
/// less. This is 2^-20. A smaller pivot makes corrections too small, never too large.
const LEAST_PIVOT: f64 = 9.536_743_164_062_5e-7;

/// A pivot whose rows had this diagonal in S as l d lᵀ: below the diagonal l, on it 1/d, which is zero in a row that is not there and had a zero
/// in S. Solutions by the inverse would lose as many digits as a pivot is stiffer in one direction than in another: a lever across its
/// hinge 1e5 times.
#[inline(always)]
pub fn factored_pivot<L: Lane>(pivot: &Block<L>, own: Vec3<L>) -> Block<L> {
    let zero = L::constant(0.0);
    let [x, y, z] = [pivot.column(0), pivot.column(1), pivot.column(2)];
    let least = (own.x + own.y + own.z) * L::constant(LEAST_PIVOT);
    let inverse = |d: L, own: L| L::select(zero, reciprocal(larger(d, least)), own.gt(zero));
    let d_x = inverse(x.x, own.x);
    let (l_xy, l_xz) = (x.y * d_x, x.z * d_x);
    let d_y = inverse(y.y - l_xy * x.y, own.y);
    let below = y.z - l_xy * x.z;
    let l_yz = below * d_y;
    let d_z = inverse(z.z - l_xz * x.z - l_yz * below, own.z);
    Block::of(vec3(d_x, l_xy, l_xz), vec3(zero, d_y, l_yz), vec3(zero, zero, d_z))
}

/// An inverse inertia that turned with its body by q since the step began. Kernel `turn_inertias`.
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

/// The anchors of a joint as three rows, along the axes of the world. Their impulses are those on body b.
#[inline(always)]
pub fn anchor_motions<L: Lane>(pair: &Pair<L>, joint: &Joint<L>) -> [AxisMotion<L>; 3] {
    let (zero, less) = (L::constant(0.0), L::constant(-1.0));
    let [r_a, r_b] = current_anchors(pair, joint);
    let motion = |along| AxisMotion { along, about_a: cross3(r_a, along), about_b: cross3(r_b, along), moved: zero };
    [motion(vec3(less, zero, zero)), motion(vec3(zero, less, zero)), motion(vec3(zero, zero, less))]
}

/// The softness of a node whose system is not factored since it began.
const NOT_FACTORED: f64 = -1.0;

/// Up to three rows of a joint while its system is factored. Double of the WGSL struct `JointNode`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointNode<L> {
    /// Along which its rows push a, and the other way b.
    pub along: Block<L>,
    /// About which its rows turn a, and the other way b.
    pub about: [Block<L>; 2],
    /// The turns that unit impulses give a and b, column by column.
    pub turns: [Block<L>; 2],
    /// Inverse masses of a and b.
    pub inv_masses: [L; 2],
    /// The velocity that a row gives way by per impulse; 0 of a rigid joint, `NOT_FACTORED` before it is known.
    pub softness: L,
    /// The right side, then the correction.
    pub right: Vec3<L>,
}

impl<L: Lane> JointNode<L> {
    /// The node of three rows; one that is not there is zero.
    #[inline(always)]
    pub fn of(pair: &Pair<L>, [x, y, z]: &[AxisMotion<L>; 3]) -> Self {
        let [a, b] = [&pair.mass_a, &pair.mass_b];
        let turn = |mass: &Mass<L>, about| mass.inv_inertia.times(about);
        Self {
            along: Block::of_rows(x.along, y.along, z.along),
            about: [Block::of_rows(x.about_a, y.about_a, z.about_a), Block::of_rows(x.about_b, y.about_b, z.about_b)],
            turns: [
                Block::of(turn(a, x.about_a), turn(a, y.about_a), turn(a, z.about_a)),
                Block::of(turn(b, x.about_b), turn(b, y.about_b), turn(b, z.about_b)),
            ],
            inv_masses: [a.inv_mass, b.inv_mass],
            softness: L::constant(NOT_FACTORED),
            right: Vec3::default(),
        }
    }

    /// Takes a row out.
    #[inline(always)]
    fn remove(&mut self, i: usize) {
        let zero = L::default();
        self.along.0.iter_mut().chain(self.about.iter_mut().flat_map(|block| &mut block.0)).for_each(|c| c[i] = zero);
        self.turns.iter_mut().for_each(|turns| turns.0[i] = [zero; 4]);
    }

    /// The block of S in its column and the row of another node, which may be the same. `shared` has bit 2 i + j where side i of this
    /// joint is side j of the other.
    #[inline(always)]
    pub fn coupling(&self, row: &Self, shared: u32) -> Block<L> {
        let shift = row.along.product_with_transpose(&self.along);
        let mut block = Block::default();
        for side in 0..4 {
            if shared & (1 << side) != 0 {
                let (i, j) = (side / 2, side % 2);
                let movement = row.about[j].product(&self.turns[i]).plus(&shift.scaled(self.inv_masses[i]));
                block = if i == j { block.plus(&movement) } else { block.less(&movement) };
            }
        }
        block
    }
}

/// Both sides of a joint, as those of `shared`.
const OWN_SIDES: u32 = 0b1001;

/// The factors of one system. Double of the buffers `joint_nodes` and `joint_blocks`.
pub struct SystemFactors<'a, S> {
    /// Its joints.
    pub nodes: &'a mut [JointNode<S>],
    /// The blocks of L; of a pivot, its own factors.
    pub lower: &'a mut [Block<S>],
    /// The blocks of L D.
    pub upper: &'a mut [Block<S>],
}

/// The places of the nodes and of the blocks of a system.
pub fn places(systems: &JointSystems, system: usize) -> [Range<usize>; 2] {
    let nodes = systems.nodes_of(system);
    let blocks = systems.blocks_of(nodes.start).start..systems.blocks_of(nodes.end - 1).end;
    [nodes, blocks]
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

    /// All of them, node by node and block by block: the nodes, the blocks of L, those of L D.
    #[allow(clippy::type_complexity)]
    pub fn all(&mut self) -> (&mut [JointNode<S>], &mut [Block<S>], &mut [Block<S>]) {
        (&mut self.nodes, &mut self.lower, &mut self.upper)
    }

    /// Those of one system.
    pub fn of(&mut self, systems: &JointSystems, system: usize) -> SystemFactors<'_, S> {
        let [nodes, blocks] = places(systems, system);
        SystemFactors {
            nodes: &mut self.nodes[nodes],
            lower: &mut self.lower[blocks.clone()],
            upper: &mut self.upper[blocks],
        }
    }
}

/// Lets one system begin where its bodies are: writes the rows of its nodes, which the next solution factors. `load` gives a joint with its bodies,
/// `axis` one of its axes. Kernel `begin_systems`.
#[inline(always)]
pub fn begin_system<S: Scalar>(
    systems: &JointSystems,
    system: usize,
    load: impl Fn(usize) -> (Joint<S>, Pair<S>),
    axis: impl Fn(usize, usize) -> Axis<S>,
    factors: SystemFactors<S>,
) {
    let [own, _] = places(systems, system);
    for (node, row) in factors.nodes.iter_mut().zip(&systems.nodes[own]) {
        let joint = row.joint as usize;
        let (loaded, pair) = load(joint);
        let mut motions = [AxisMotion::default(); 3];
        if row.is_of_anchors() {
            motions = anchor_motions(&pair, &loaded);
        } else {
            for (i, k) in row.axes() {
                motions[i] = axis_motion(&pair, &loaded, &axis(joint, k));
            }
        }
        *node = JointNode::of(&pair, &motions);
    }
}

/// Factors one system whose nodes are known.
#[inline(always)]
fn factor_blocks<S: Scalar>(systems: &JointSystems, system: usize, factors: &mut SystemFactors<S>) {
    let SystemFactors { nodes, lower, upper } = factors;
    let [own, blocks] = places(systems, system);
    let (first_node, first_block) = (own.start, blocks.start);
    for node in own {
        let column = systems.blocks_of(node);
        let pivot = column.start - first_block;
        for at in column {
            let row = &systems.blocks[at];
            let at = at - first_block;
            let shared = if at == pivot { OWN_SIDES } else { row.shared };
            let mut block = nodes[node - first_node].coupling(&nodes[row.node as usize - first_node], shared);
            let own = block.diagonal();
            if at == pivot {
                let softness = (own.x + own.y + own.z) * S::from(systems.softness[system]);
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
    let [r_a, r_b] = current_anchors(pair, joint);
    let mut wanted = relative_velocity(rules, pair, r_a, r_b);
    if rules.biased {
        wanted += (joint.gap + relative_movement(pair, joint.r_a, joint.r_b)) * params.joint.bias_rate;
    }
    wanted = select3(wanted, Vec3::default(), joint.is_loose.gt(L::constant(0.0)));
    let Vec3 { x, y, z } = wanted;
    note_lacking(rules, params, pair, larger(larger(larger(x, -x), larger(y, -y)), larger(z, -z)));
    wanted * -params.relaxation
}

/// The velocity that a lock lacks, or a limit that holds as one; none of a drive. Kernel `measure_joints`.
#[inline(always)]
pub fn measure_axis<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    joint: &Joint<L>,
    axis: &Axis<L>,
) -> L {
    let motion = axis_motion(pair, joint, axis);
    let zero = L::constant(0.0);
    let NearerLimit { is_limit, is_upper, gap, apart } = NearerLimit::of(axis, &motion);
    let rate = if rules.biased { params.joint.bias_rate } else { zero };
    // Up to its limit the body goes within this substep.
    let pull = gap * L::select(rate, params.inverse_substep, apart);
    let speed = axis_speed(rules, pair, &motion);
    let wanted = L::select(speed + pull, speed - pull, is_upper);
    let of_lock = L::select(zero, wanted, is_lock(axis));
    note_lacking(rules, params, pair, larger(of_lock, -of_lock));
    L::select(of_lock, wanted, is_limit) * -params.relaxation
}

/// Notes that a velocity above the tolerance is lacking.
#[inline(always)]
fn note_lacking<L: Lane>(rules: Rules, params: &StepParams<L>, pair: &mut Pair<L>, most: L) {
    if rules.measured {
        pair.moving = L::select(pair.moving, L::constant(1.0), most.gt(params.tolerance));
    }
}

/// Solves one system: `joints` is told the corrections, and gives the velocities that joints lack. Kernel `solve_joint_systems`.
#[inline(always)]
pub fn solve_system<S: Scalar>(
    problem: &StepProblem,
    system: usize,
    joints: &mut impl JointChanges<S>,
    mut factors: SystemFactors<S>,
) {
    let systems = &problem.systems;
    let [own, _] = places(systems, system);
    // Sweeps may have let go of limits since the system was factored.
    factors.nodes.iter_mut().for_each(|node| node.right = Vec3::default());
    let is_new = S::default() > factors.nodes[0].softness;
    let mut changed = let_go(problem, system, is_new, joints, &mut factors) || is_new;
    loop {
        if changed {
            factor_blocks(systems, system, &mut factors);
        }
        find_changes(problem, system, joints, &mut factors);
        changed = let_go(problem, system, false, joints, &mut factors);
        if !changed {
            break;
        }
    }
    for (node, row) in factors.nodes.iter().zip(&systems.nodes[own]) {
        let Vec3 { x, y, z } = node.right;
        for (number, change) in problem.numbers_of(row).into_iter().zip([x, y, z]) {
            if let Some(at) = number {
                joints.change(at, change);
            }
        }
    }
}

/// Takes the limits out of one system that hold, and bear no impulse or would pull with the changes that were found; whether there were any. In a
/// system that is new, all hold.
#[inline(always)]
fn let_go<S: Scalar>(
    problem: &StepProblem,
    system: usize,
    is_new: bool,
    joints: &mut impl JointChanges<S>,
    factors: &mut SystemFactors<S>,
) -> bool {
    let systems = &problem.systems;
    let [own, blocks] = places(systems, system);
    let mut any = false;
    for (node, row) in factors.nodes.iter_mut().zip(&systems.nodes[own]) {
        let pivot = factors.lower[row.first_block as usize - blocks.start].diagonal();
        let [held, changes] = [pivot, node.right].map(|Vec3 { x, y, z }| [x, y, z]);
        for (i, number) in problem.numbers_of(row).into_iter().enumerate() {
            let Some(at) = number.filter(|_| row.is_limit(i) && (is_new || held[i] > S::default())) else { continue };
            let before = joints.impulse(at);
            let still_pushes = before * (before + changes[i]) > S::default();
            if !still_pushes {
                node.remove(i);
                any = true;
            }
        }
    }
    any
}

/// Finds the changes of the impulses of one system, the right sides of its nodes.
#[inline(always)]
fn find_changes<S: Scalar>(
    problem: &StepProblem,
    system: usize,
    joints: &mut impl JointChanges<S>,
    factors: &mut SystemFactors<S>,
) {
    let systems = &problem.systems;
    let SystemFactors { nodes, lower, .. } = factors;
    let [own, blocks] = places(systems, system);
    let (first_node, first_block) = (own.start, blocks.start);
    for (node, row) in nodes.iter_mut().zip(&systems.nodes[own.clone()]) {
        let right = problem.numbers_of(row).map(|number| match number {
            Some(at) => joints.lacking(at) - joints.impulse(at) * node.softness,
            None => S::default(),
        });
        node.right = vec3(right[0], right[1], right[2]);
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

/// Corrections and impulses of the joints of a system: numbers of rows of impulses.
pub trait JointChanges<S> {
    /// An impulse so far.
    fn impulse(&mut self, at: ImpulseNumber) -> S;
    /// The velocity that a row lacks.
    fn lacking(&mut self, at: ImpulseNumber) -> S;
    /// Keeps a correction, and adds it to the impulse.
    fn change(&mut self, at: ImpulseNumber, change: S);
}
