//! All joints of a connected set of bodies, solved at once: S λ = -u by S = L D Lᵀ in blocks of 3 x 3. Doubles of
//! `shaders/lib/joint_system.wgsl` and of the kernels `factor_joints`, `measure_joints`, `solve_joint_systems` and
//! `apply_joint_changes`.
//!
//! Arms turn with their bodies, and the blocks of S with them: S is factored anew where bodies moved. The order of elimination, the
//! blocks that it fills and the products that each block is made of are lists of the problem (`JointSystems`).

use std::ops::Range;

use super::Rules;
use super::joint::{cofactors, current_anchors};
use super::pair::{apply_impulse, relative_movement, relative_velocity};
use super::rows::{Joint, Mass, Pair, StepParams, Sym3};
use crate::math::{Lane, Quat, Scalar, Vec3, cross3, dot3, larger, reciprocal, turned, vec3};
use crate::problem::JointSystems;

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

    /// Makes the diagonal larger by a share of its mean; returns by how much.
    #[inline(always)]
    pub fn soften(&mut self, share: L) -> L {
        let more = (self.0[0][0] + self.0[1][1] + self.0[2][2]) * share;
        for i in 0..3 {
            self.0[i][i] = self.0[i][i] + more;
        }
        more
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

    /// Subtracts the product of one block with the transpose of another.
    #[inline(always)]
    pub fn subtract_product(&mut self, left: &Self, right: &Self) {
        let [x, y, z] = &right.0;
        for (j, column) in self.0.iter_mut().enumerate() {
            let product = left.combined([x[j], y[j], z[j]]);
            for i in 0..4 {
                column[i] = column[i] - product[i];
            }
        }
    }
}

/// Rounding of the products that a pivot is made of changes its determinant, at a trace of 1 to 2, by 3e-7 a joint; this is 2^-17.
const STIFFENING: f64 = 7.629_394_531_25e-6;

/// The inverse of a pivot. A pivot that rounding may have made indefinite is made stiffer by a little, as in `solve_joint`.
#[inline(always)]
pub fn inverse_pivot<L: Lane>(pivot: &Block<L>) -> Block<L> {
    let [x, y, z] = [pivot.column(0), pivot.column(1), pivot.column(2)];
    let c = cofactors(x, y, z, STIFFENING);
    let inverse = reciprocal(c.determinant) * c.scale;
    Block::of(c.x * inverse, c.y * inverse, c.z * inverse)
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

/// The turn that a unit impulse at the arm r gives a body, axis by axis: I⁻¹ (r x e).
#[inline(always)]
pub fn turn_of_impulse<L: Lane>(m: &Mass<L>, r: Vec3<L>) -> Block<L> {
    let Sym3 { x: Vec3 { x: xx, y: xy, z: xz }, yz: Vec3 { x: yy, y: yz, z: zz } } = m.inv_inertia;
    let (x, y, z) = (vec3(xx, xy, xz), vec3(xy, yy, yz), vec3(xz, yz, zz));
    Block::of(y * r.z - z * r.y, z * r.x - x * r.z, x * r.y - y * r.x)
}

/// The movement of the point at the arm r of a body that unit impulses move by `inv_mass` and turn by `turn`.
#[inline(always)]
pub fn movement_at<L: Lane>(inv_mass: L, turn: &Block<L>, r: Vec3<L>) -> Block<L> {
    let mut movement = Block::of(cross3(turn.column(0), r), cross3(turn.column(1), r), cross3(turn.column(2), r));
    for i in 0..3 {
        movement.0[i][i] = movement.0[i][i] + inv_mass;
    }
    movement
}

/// The sum of two blocks.
#[inline(always)]
fn sum<L: Lane>(a: &Block<L>, b: &Block<L>) -> Block<L> {
    let mut sum = *a;
    for (column, other) in sum.0.iter_mut().zip(&b.0) {
        for i in 0..4 {
            column[i] = column[i] + other[i];
        }
    }
    sum
}

/// One joint of a system while it is factored. Double of the WGSL struct `JointNode`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointNode<L> {
    /// Arms of a and b.
    pub arms: [Vec3<L>; 2],
    /// Their inverse masses.
    pub inv_masses: [L; 2],
    /// The turns that unit impulses at the arms give them.
    pub turns: [Block<L>; 2],
    /// The velocity that it gives way by per impulse, along each axis; 0 of a rigid joint.
    pub softness: L,
    /// The right side, then the correction.
    pub right: Vec3<L>,
}

impl<L: Lane> JointNode<L> {
    /// The joint as it stands now.
    #[inline(always)]
    pub fn of(joint: &Joint<L>, pair: &Pair<L>) -> Self {
        let arms = current_anchors(pair, joint);
        Self {
            arms,
            inv_masses: [pair.mass_a.inv_mass, pair.mass_b.inv_mass],
            turns: [turn_of_impulse(&pair.mass_a, arms[0]), turn_of_impulse(&pair.mass_b, arms[1])],
            softness: L::default(),
            right: Vec3::default(),
        }
    }

    /// Its block of S.
    #[inline(always)]
    pub fn own_block(&self) -> Block<L> {
        let [a, b] = [0, 1].map(|i| movement_at(self.inv_masses[i], &self.turns[i], self.arms[i]));
        sum(&a, &b)
    }

    /// The block of S in its column and the row of another joint. `shared` has bit 2 i + j where side i of this joint is side j of the
    /// other.
    #[inline(always)]
    pub fn coupling(&self, row: &Self, shared: u32) -> Block<L> {
        let mut block = Block::default();
        for side in 0..4 {
            if shared & (1 << side) != 0 {
                let (i, j) = (side / 2, side % 2);
                let mut share = movement_at(self.inv_masses[i], &self.turns[i], row.arms[j]);
                if i != j {
                    share.0.iter_mut().flatten().for_each(|x| *x = -*x);
                }
                block = sum(&block, &share);
            }
        }
        block
    }
}

/// The factors of one system. Double of the buffers `joint_nodes` and `joint_blocks`.
pub struct SystemFactors<'a, S> {
    /// Its joints.
    pub nodes: &'a mut [JointNode<S>],
    /// The blocks of L; of a pivot, its inverse.
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

/// Factors one system; `load` gives a joint with its bodies. Kernel `factor_joints`.
#[inline(always)]
pub fn factor_system<S: Scalar>(
    systems: &JointSystems,
    system: usize,
    load: impl Fn(usize) -> (Joint<S>, Pair<S>),
    factors: SystemFactors<S>,
) {
    let SystemFactors { nodes, lower, upper } = factors;
    let [own, blocks] = places(systems, system);
    let (first_node, first_block) = (own.start, blocks.start);
    for (node, row) in nodes.iter_mut().zip(&systems.nodes[own.clone()]) {
        let (joint, pair) = load(row.joint as usize);
        *node = JointNode::of(&joint, &pair);
    }
    for node in own {
        let column = systems.blocks_of(node);
        let pivot = column.start - first_block;
        for at in column {
            let row = &systems.blocks[at];
            let at = at - first_block;
            let mut block = match at == pivot {
                true => {
                    let mut own = nodes[node - first_node].own_block();
                    nodes[node - first_node].softness = own.soften(S::from(systems.softness[system]));
                    own
                }
                false => nodes[node - first_node].coupling(&nodes[row.node as usize - first_node], row.shared),
            };
            for &[left, right] in systems.terms_of(row) {
                block.subtract_product(&lower[left as usize - first_block], &upper[right as usize - first_block]);
            }
            if at == pivot {
                lower[at] = inverse_pivot(&block);
            } else {
                lower[at] = block.product(&lower[pivot]);
                upper[at] = block;
            }
        }
    }
}

/// The velocity that a joint lacks. Kernel `measure_joints`.
#[inline(always)]
pub fn measure_joint<L: Lane>(rules: Rules, params: &StepParams<L>, pair: &mut Pair<L>, joint: &Joint<L>) -> Vec3<L> {
    let [r_a, r_b] = current_anchors(pair, joint);
    let mut wanted = relative_velocity(rules, pair, r_a, r_b);
    if rules.biased {
        wanted += (joint.gap + relative_movement(pair, joint.r_a, joint.r_b)) * params.joint.bias_rate;
    }
    if rules.measured {
        let Vec3 { x, y, z } = wanted;
        let most = larger(larger(larger(x, -x), larger(y, -y)), larger(z, -z));
        pair.moving = L::select(pair.moving, L::constant(1.0), most.gt(params.tolerance));
    }
    wanted * -params.relaxation
}

/// Solves one system: `change` is told the correction of a joint, and gives the velocity that the joint lacks. Kernel `solve_joint_systems`.
#[inline(always)]
pub fn solve_system<S: Scalar>(
    systems: &JointSystems,
    system: usize,
    joints: &mut impl JointChanges<S>,
    factors: SystemFactors<S>,
) {
    let SystemFactors { nodes, lower, .. } = factors;
    let [own, blocks] = places(systems, system);
    let (first_node, first_block) = (own.start, blocks.start);
    for (node, row) in nodes.iter_mut().zip(&systems.nodes[own.clone()]) {
        let joint = row.joint as usize;
        node.right = joints.lacking(joint) - joints.impulse(joint) * node.softness;
    }
    for node in own.clone() {
        let right = nodes[node - first_node].right;
        for at in systems.blocks_of(node).skip(1) {
            let row = &mut nodes[systems.blocks[at].node as usize - first_node].right;
            *row -= lower[at - first_block].times(right);
        }
    }
    for node in own.rev() {
        let column = systems.blocks_of(node);
        let mut change = lower[column.start - first_block].times(nodes[node - first_node].right);
        for at in column.skip(1) {
            let below = nodes[systems.blocks[at].node as usize - first_node].right;
            change -= lower[at - first_block].transpose_times(below);
        }
        nodes[node - first_node].right = change;
        joints.change(systems.nodes[node].joint as usize, change);
    }
}

/// Corrections and impulses of the joints of a system.
pub trait JointChanges<S> {
    /// Its impulse so far.
    fn impulse(&self, joint: usize) -> Vec3<S>;
    /// The velocity that a joint lacks.
    fn lacking(&self, joint: usize) -> Vec3<S>;
    /// Keeps a correction, and adds it to the impulse of the joint.
    fn change(&mut self, joint: usize, change: Vec3<S>);
}

/// Applies the correction of a joint to its bodies. Kernel `apply_joint_changes`.
#[inline(always)]
pub fn apply_joint_change<L: Lane>(pair: &mut Pair<L>, joint: &Joint<L>, change: Vec3<L>) {
    let [r_a, r_b] = current_anchors(pair, joint);
    apply_impulse(Rules::default(), pair, r_a, r_b, change);
}
