//! Direct solution of joint systems on the states of the lanes: sixteen systems of equal structure side by side, or one
//! alone.

#![allow(unsafe_code)]

use std::ops::Range;

use super::bodies::{State, place, wide_body, wide_mass};
use super::lane_layout::{ImpulsePlace, LaneLayout};
use super::lane_rows::SharedImpulses;
use super::partition::{ColorRanges, Partition, PartitionedRows};
use crate::kernels::joint_system::{
    Block, JointFactors, JointNode, SystemFactors, SystemRows, begin_system, solve_system,
};
use crate::kernels::{Axis, Joint, Mass, Pair, Sym3};
use crate::lanes::{Lanes, Portable, Shared, WIDTH, Wide, Work, lanes};
use crate::math::{Lane, Quat, Vec3, vec3};
use crate::problem::{AxisRow, JointRow, JointSystems, StepProblem};

/// With fewer systems of equal structure, they are solved one after another: a column of one system fills a quarter of
/// the lanes.
const MIN_SIDE_BY_SIDE: usize = 4;

/// One system, or several of equal structure.
#[derive(Clone, Copy)]
struct SystemGroup {
    /// The systems, one for each lane. Unused lanes repeat the first one.
    systems: [u32; WIDTH],
    count: usize,
    /// The start of its nodes and blocks among those of all groups that are solved side by side.
    first_node: usize,
    first_block: usize,
}

impl SystemGroup {
    fn new(system: u32) -> Self {
        Self { systems: [system; WIDTH], count: 1, first_node: 0, first_block: 0 }
    }
}

/// The systems of a step, and the places of their joints.
#[derive(Default)]
pub(super) struct SystemLayout {
    rows: PartitionedRows,
    groups: Vec<SystemGroup>,
    /// The groups of each color of each part.
    ranges: ColorRanges,
    /// In the order of impulses: joints, then axes.
    impulses: Vec<ImpulsePlace>,
    /// Those of the rows of each node.
    of_nodes: Vec<[ImpulsePlace; 3]>,
}

impl SystemLayout {
    /// Loads the systems of a problem, and makes room for their factors.
    pub fn load(
        &mut self,
        problem: &StepProblem,
        partition: &Partition,
        joints: &LaneLayout<JointRow>,
        factors: &mut SystemsFactors,
    ) {
        let systems = &problem.systems;
        let part_of = |system: u32| {
            let first = systems.nodes_of(system as usize).start;
            let JointRow { body_a, body_b, .. } = problem.joints[systems.nodes[first].joint as usize];
            partition.of(body_a, body_b)
        };
        self.rows.update(problem, partition, |block| block.systems..block.systems + 1, part_of);
        self.groups.clear();
        self.ranges.reset(problem.system_colors());
        for cell in 0..self.rows.ranges.len() {
            self.ranges.push(self.groups.len());
            self.make_groups(systems, cell);
        }
        self.ranges.push(self.groups.len());
        let (mut nodes, mut blocks) = (0, 0);
        for group in self.groups.iter_mut().filter(|group| group.count > 1) {
            (group.first_node, group.first_block) = (nodes, blocks);
            nodes += systems.nodes_of(group.systems[0] as usize).len();
            blocks += systems.blocks_of_system(group.systems[0] as usize).len();
        }
        factors.reset(systems, nodes, blocks);
        if problem.has_systems() {
            joints.impulse_places(problem, &mut self.impulses);
            self.of_nodes.clear();
            self.of_nodes.extend(systems.nodes.iter().map(|node| {
                problem.numbers_of(node).map(|at| at.map_or_else(ImpulsePlace::default, |at| self.impulses[at.row]))
            }));
        }
    }

    /// Groups the systems of one color of one part.
    fn make_groups(&mut self, systems: &JointSystems, cell: usize) {
        let first = self.groups.len();
        for &system in self.rows.at(cell) {
            let is_like = |group: &&mut SystemGroup| {
                group.count < WIDTH && systems.are_of_one_form([group.systems[0], system].map(|system| system as usize))
            };
            // Neighbors are most similar.
            match self.groups[first..].iter_mut().rev().find(is_like) {
                Some(group) => {
                    group.systems[group.count] = system;
                    group.count += 1;
                }
                None => self.groups.push(SystemGroup::new(system)),
            }
        }
        for i in first..self.groups.len() {
            let SystemGroup { systems, count, .. } = self.groups[i];
            if count < MIN_SIDE_BY_SIDE {
                self.groups[i] = SystemGroup::new(systems[0]);
                self.groups.extend(systems[1..count].iter().map(|&system| SystemGroup::new(system)));
            }
        }
    }

    /// The groups of each color of each part: places for [`SystemWork`].
    pub fn ranges(&self) -> &ColorRanges {
        &self.ranges
    }
}

/// The factors of all systems.
#[derive(Default)]
pub(super) struct SystemsFactors {
    alone: JointFactors<f32>,
    /// For systems that are solved side by side, one number at a time.
    nodes: Vec<Wide>,
    lower: Vec<Wide>,
    upper: Vec<Wide>,
}

impl SystemsFactors {
    /// Makes room for all systems that are solved alone, and for these numbers of nodes and blocks side by side.
    fn reset(&mut self, systems: &JointSystems, nodes: usize, blocks: usize) {
        self.alone.reset(systems);
        self.nodes.resize(nodes * numbers_in::<JointNode<Portable>>(), Wide::default());
        self.lower.resize(blocks * numbers_in::<Block<Portable>>(), Wide::default());
        self.upper.resize(blocks * numbers_in::<Block<Portable>>(), Wide::default());
    }
}

/// The number of sixteen-lane numbers in a value that consists only of them.
const fn numbers_in<T>() -> usize {
    assert!(size_of::<T>().is_multiple_of(size_of::<Wide>()) && align_of::<T>() <= align_of::<Wide>());
    size_of::<T>() / size_of::<Wide>()
}

/// The factors of all systems, shared by threads with different systems.
#[derive(Clone, Copy)]
pub(super) struct SharedFactors<'a> {
    nodes: Shared<'a, JointNode<f32>>,
    lower: Shared<'a, Block<f32>>,
    upper: Shared<'a, Block<f32>>,
    wide_nodes: Shared<'a, Wide>,
    wide_lower: Shared<'a, Wide>,
    wide_upper: Shared<'a, Wide>,
}

impl<'a> SharedFactors<'a> {
    pub fn new(factors: &'a mut SystemsFactors) -> Self {
        let (nodes, lower, upper) = factors.alone.all();
        Self {
            nodes: Shared::new(nodes),
            lower: Shared::new(lower),
            upper: Shared::new(upper),
            wide_nodes: Shared::new(&mut factors.nodes),
            wide_lower: Shared::new(&mut factors.lower),
            wide_upper: Shared::new(&mut factors.upper),
        }
    }

    /// Those of one system.
    ///
    /// # Safety
    /// No other thread has the same system.
    #[inline(always)]
    unsafe fn alone(&self, systems: &JointSystems, system: usize) -> SystemFactors<'a, f32> {
        let (nodes, blocks) = (systems.nodes_of(system), systems.blocks_of_system(system));
        // SAFETY: the caller's promise; systems have nodes and blocks of their own.
        unsafe {
            let (lower, upper) = (self.lower.slice(blocks.clone()), self.upper.slice(blocks));
            SystemFactors { nodes: self.nodes.slice(nodes), lower, upper }
        }
    }

    /// Those of the systems of a group.
    ///
    /// # Safety
    /// No other thread has the same group.
    #[inline(always)]
    unsafe fn side_by_side<L: Lanes>(&self, systems: &JointSystems, group: &SystemGroup) -> SystemFactors<'a, L> {
        let system = group.systems[0] as usize;
        let (nodes, blocks) = (systems.nodes_of(system).len(), systems.blocks_of_system(system).len());
        let nodes = group.first_node..group.first_node + nodes;
        let blocks = group.first_block..group.first_block + blocks;
        // SAFETY: the caller's promise; groups have nodes and blocks of their own. Nodes and blocks of lanes consist of
        // nothing but lanes.
        unsafe {
            SystemFactors {
                nodes: as_lanes(&self.wide_nodes, nodes),
                lower: as_lanes(&self.wide_lower, blocks.clone()),
                upper: as_lanes(&self.wide_upper, blocks),
            }
        }
    }
}

/// Some values among numbers of sixteen lanes.
///
/// # Safety
/// The value consists of lanes and nothing else, and no other thread reads or writes these values.
#[inline(always)]
unsafe fn as_lanes<'a, T>(numbers: &Shared<'a, Wide>, range: Range<usize>) -> &'a mut [T] {
    let each = const { numbers_in::<T>() };
    // SAFETY: the caller's promise. Every number is one of a lane.
    unsafe {
        let own = numbers.slice(range.start * each..range.end * each);
        std::slice::from_raw_parts_mut(own.as_mut_ptr().cast(), range.len())
    }
}

/// A pass over groups of systems.
pub(super) struct SystemWork<'a> {
    /// Whether the pass sets systems up instead of solving them.
    pub begins: bool,
    pub problem: &'a StepProblem,
    pub layout: &'a SystemLayout,
    /// The slots of the bodies of the problem.
    pub slots: &'a [u32],
    pub bodies: Shared<'a, State>,
    pub factors: SharedFactors<'a>,
    pub changes: SharedImpulses<'a>,
    pub impulses: SharedImpulses<'a>,
}

impl Work for SystemWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, range: Range<usize>) {
        let systems = &self.problem.systems;
        for group in &self.layout.groups[range] {
            let system = group.systems[0] as usize;
            if group.count == 1 {
                // SAFETY: tasks have different groups: `Threads::spread_each` cuts their range.
                let factors = unsafe { self.factors.alone(systems, system) };
                self.begin_or_solve(system, &mut Alone { work: self, system }, factors);
            } else {
                // SAFETY: as above.
                let factors = unsafe { self.factors.side_by_side::<L>(systems, group) };
                self.begin_or_solve(system, &mut SideBySide::new(self, group), factors);
            }
        }
    }
}

impl SystemWork<'_> {
    #[inline(always)]
    fn begin_or_solve<L: Lane>(&self, system: usize, rows: &mut impl SystemRows<L>, factors: SystemFactors<L>) {
        let systems = &self.problem.systems;
        if self.begins {
            begin_system(systems, system, rows, factors);
        } else {
            solve_system(systems, system, rows, factors);
        }
    }

    /// The number in the row of a node of the problem, among corrections or impulses.
    ///
    /// SAFETY: `check` guarantees that a joint is in one system, and tasks have different systems.
    #[inline(always)]
    fn number<'c>(&self, rows: &SharedImpulses<'c>, node: usize, row: usize) -> &'c mut f32 {
        let ImpulsePlace { row: at, lane } = self.layout.of_nodes[node][row];
        let component = if self.problem.systems.nodes[node].is_of_anchors() { row } else { 0 };
        // SAFETY: this reaches one lane of the row, and no other task the same lane.
        unsafe { rows.number(at as usize, component, lane as usize) }
    }

    #[inline(always)]
    fn axis_row(&self, node: usize, k: usize) -> &AxisRow {
        let joint = self.problem.systems.nodes[node].joint as usize;
        &self.problem.axes[self.problem.joints[joint].first_axis as usize + k]
    }
}

/// The joints of one system.
struct Alone<'a, 'b> {
    work: &'a SystemWork<'b>,
    system: usize,
}

impl Alone<'_, '_> {
    #[inline(always)]
    fn node(&self, node: usize) -> usize {
        self.work.problem.systems.nodes_of(self.system).start + node
    }
}

impl SystemRows<f32> for Alone<'_, '_> {
    #[inline(always)]
    fn joint(&self, node: usize) -> (Joint<f32>, Pair<f32>) {
        let problem = self.work.problem;
        let row = &problem.joints[problem.systems.nodes[self.node(node)].joint as usize];
        let [(a, mass_a), (b, mass_b)] = [row.body_a, row.body_b].map(|body| {
            let slot = self.work.slots[body as usize] as usize;
            // SAFETY: a system that is being set up writes no body, and no other pass runs at the same time.
            let state = unsafe { &*self.work.bodies.slice(slot..slot + 1).as_ptr() };
            let [xx, xy, xz, inv_mass, yy, yz, zz, locks] = state.mass.0;
            let inv_inertia = Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) };
            (state.load(), Mass { inv_inertia, inv_mass, locks, acceleration: Vec3::default() })
        });
        // No velocity is read.
        (Joint::load(row), Pair { a, b, mass_a, mass_b, ..Pair::default() })
    }

    #[inline(always)]
    fn axis(&self, node: usize, k: usize) -> Axis<f32> {
        Axis::load(self.work.axis_row(self.node(node), k))
    }

    #[inline(always)]
    fn softness(&self) -> f32 {
        self.work.problem.systems.softness[self.system]
    }

    #[inline(always)]
    fn impulse(&self, node: usize, row: usize) -> f32 {
        *self.work.number(&self.work.impulses, self.node(node), row)
    }

    #[inline(always)]
    fn lacking(&self, node: usize, row: usize) -> f32 {
        *self.work.number(&self.work.changes, self.node(node), row)
    }

    #[inline(always)]
    fn set_lacking(&mut self, node: usize, row: usize, lacking: f32) {
        *self.work.number(&self.work.changes, self.node(node), row) = lacking;
    }

    #[inline(always)]
    fn change(&mut self, node: usize, row: usize, change: f32) {
        *self.work.number(&self.work.changes, self.node(node), row) = change;
        *self.work.number(&self.work.impulses, self.node(node), row) += change;
    }
}

/// The joints of the systems of a group.
struct SideBySide<'a, 'b> {
    work: &'a SystemWork<'b>,
    group: &'a SystemGroup,
    /// The first node of each.
    first_nodes: [usize; WIDTH],
}

impl<'a, 'b> SideBySide<'a, 'b> {
    #[inline(always)]
    fn new(work: &'a SystemWork<'b>, group: &'a SystemGroup) -> Self {
        let systems = &work.problem.systems;
        let first_nodes = lanes!(lane => systems.nodes_of(group.systems[lane] as usize).start);
        Self { work, group, first_nodes }
    }

    /// A number of each.
    #[inline(always)]
    fn numbers<L: Lanes>(&self, rows: &SharedImpulses, node: usize, row: usize) -> L {
        L::load(&Wide(lanes!(lane => *self.work.number(rows, self.first_nodes[lane] + node, row))))
    }
}

impl<L: Lanes> SystemRows<L> for SideBySide<'_, '_> {
    #[inline(always)]
    fn joint(&self, node: usize) -> (Joint<L>, Pair<L>) {
        let SystemWork { problem, slots, bodies, .. } = self.work;
        let rows: [&JointRow; WIDTH] =
            lanes!(lane => &problem.joints[problem.systems.nodes[self.first_nodes[lane] + node].joint as usize]);
        let numbers: [&[f32; 24]; WIDTH] = lanes!(lane => bytemuck::cast_ref(rows[lane]));
        // SAFETY: a row has twenty-four numbers.
        let ([ax, ay, az, _, bx, by, bz, _], [gx, gy, gz, is_loose, ..], [fx, fy, fz, fw, x, y, z, w]) = unsafe {
            (
                L::columns(&lanes!(lane => numbers[lane].as_ptr())),
                L::columns(&lanes!(lane => numbers[lane].as_ptr().add(8))),
                L::columns(&lanes!(lane => numbers[lane].as_ptr().add(16))),
            )
        };
        let joint = Joint {
            r_a: vec3(ax, ay, az),
            r_b: vec3(bx, by, bz),
            gap: vec3(gx, gy, gz),
            is_loose,
            frame_a: Quat { axis: vec3(fx, fy, fz), w: fw },
            frame_b: Quat { axis: vec3(x, y, z), w },
        };
        let a = lanes!(lane => place(slots[rows[lane].body_a as usize] as usize));
        let b = lanes!(lane => place(slots[rows[lane].body_b as usize] as usize));
        let states = bodies.as_ptr();
        // SAFETY: the places are those of states. A system that is being set up writes no body, and no other pass runs
        // at the same time.
        let (a, b, mass_a, mass_b) =
            unsafe { (wide_body(states, &a), wide_body(states, &b), wide_mass(states, &a), wide_mass(states, &b)) };
        // No velocity is read.
        (joint, Pair { a, b, mass_a, mass_b, ..Pair::default() })
    }

    #[inline(always)]
    fn axis(&self, node: usize, k: usize) -> Axis<L> {
        let numbers: [&[f32; 12]; WIDTH] =
            lanes!(lane => bytemuck::cast_ref(self.work.axis_row(self.first_nodes[lane] + node, k)));
        // SAFETY: a row has twelve numbers.
        let ([x, y, z, coordinate, gap, left, speed, max_impulse], [.., rate, mass_scale, impulse_scale, start]) = unsafe {
            (
                L::columns(&lanes!(lane => numbers[lane].as_ptr())),
                L::columns(&lanes!(lane => numbers[lane].as_ptr().add(4))),
            )
        };
        let direction = vec3(x, y, z);
        Axis { direction, coordinate, gap, left, speed, max_impulse, rate, mass_scale, impulse_scale, start }
    }

    #[inline(always)]
    fn softness(&self) -> L {
        let softness = &self.work.problem.systems.softness;
        L::load(&Wide(lanes!(lane => softness[self.group.systems[lane] as usize])))
    }

    #[inline(always)]
    fn impulse(&self, node: usize, row: usize) -> L {
        self.numbers(&self.work.impulses, node, row)
    }

    #[inline(always)]
    fn lacking(&self, node: usize, row: usize) -> L {
        self.numbers(&self.work.changes, node, row)
    }

    #[inline(always)]
    fn set_lacking(&mut self, node: usize, row: usize, lacking: L) {
        let lacking = lacking.store();
        for lane in 0..self.group.count {
            *self.work.number(&self.work.changes, self.first_nodes[lane] + node, row) = lacking.0[lane];
        }
    }

    #[inline(always)]
    fn change(&mut self, node: usize, row: usize, change: L) {
        let changes = change.store();
        for lane in 0..self.group.count {
            let node = self.first_nodes[lane] + node;
            *self.work.number(&self.work.changes, node, row) = changes.0[lane];
            *self.work.number(&self.work.impulses, node, row) += changes.0[lane];
        }
    }
}
