//! The rows of joints and of their axes. Each joint of the world has one row, in the order of the world, and keeps its
//! impulse there.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::axes;
use super::geometric_stiffness::{StiffnessInertia, add_stiffness_inertia};
use super::joint_sets::{force_of_promised_gap, gap_of_sweeps};
use super::rows::{BodyRow, JointImpulseRow, JointRow, MassRow, Substep, TorqueRow};
use super::{JointSystems, StepProblem};
use crate::config::{JointSolver, SolverConfig};
use crate::constants::{DESCENT_SHARE, HELPS, MAX_TERMS_A_NODE, SLOW_TURN};
use crate::effort::{self, Effort, Interface, JointNeed};
use crate::error::{Result, ensure};
use crate::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE, Islands};
use crate::world::{BodyKind, Joint, JointHandle, World};

/// The joints that have rows, and their colors.
#[derive(Debug, Default)]
pub struct JointRows {
    joints: Vec<Joint>,
    handles: Vec<JointHandle>,
    /// The joints as edges of their graph.
    edges: Vec<Edge>,
    graph: ConstraintGraph,
    /// The coloring of all joints.
    pub coloring: Coloring,
    /// Whether the step sums the impulses of all joints over its substeps.
    pub sums: bool,
    is_colored: bool,
    /// The length of the substeps of each impulse, over that of class 0; 0 without an impulse.
    shares: Vec<f32>,
    /// The first angle of each joint that counts turns, in the last step (rad).
    twists: Vec<Option<f32>>,
    /// The system of each joint that is solved directly; `SWEPT` for the others.
    systems: Vec<u32>,
    /// The length of a substep that the systems were chosen for; `None` before the choice.
    chosen_for: Option<f32>,
    /// The gravity on the bodies of joints at that choice.
    gravity: Vec<Vec3>,
    swept_gap: f32,
    /// The needs of the joints that are left to sweeps.
    left: Vec<LeftToSweeps>,
    /// The gap of each joint after the last step.
    openings: Vec<Opening>,
    /// The rows before the step.
    before: Before,
    /// Stiffness inertia of bodies, in memory that steps reuse.
    stiffness_inertias: Vec<StiffnessInertia>,
}

crate::saved::state!(JointRows {
    joints,
    handles,
    edges,
    coloring,
    is_colored,
    shares,
    twists,
    systems,
    chosen_for,
    gravity,
    swept_gap,
    left,
    openings,
} scratch { graph, sums, before, stiffness_inertias });

/// The need of a joint that is left to sweeps; 0 for other joints.
#[derive(Clone, Copy, Debug)]
struct LeftToSweeps {
    /// The gap with the substeps of the settings, over the promised gap.
    need: f32,
    /// The force that opens the promised gap with these substeps (N).
    force: f32,
}

crate::saved::fields!(LeftToSweeps { need, force });

impl LeftToSweeps {
    const NONE: Self = Self { need: 0.0, force: f32::INFINITY };
}

/// The gap of a joint after a step, relative to the promised gap.
#[derive(Clone, Copy, Debug, Default)]
struct Opening {
    /// The gap with the substeps of the settings.
    need: f32,
    /// For a swept joint the gap after the next step with these substeps, if the joint goes on to open as fast; else 0.
    next: f32,
    /// The gap that shorter substeps did not reduce; 0 if there is none.
    stuck: f32,
}

crate::saved::fields!(Opening { need, next, stuck });

/// The rows that a step changes before it runs, and the gaps of its last try, for a step that is taken again.
#[derive(Debug, Default)]
struct Before {
    impulses: Vec<JointImpulseRow>,
    shares: Vec<f32>,
    twists: Vec<Option<f32>>,
    /// The gaps that the last try of the step left, over the promised gaps; empty before the first try.
    tried: Vec<f32>,
}

/// Stands for the system of a joint that is swept.
const SWEPT: u32 = u32::MAX;

impl JointRows {
    /// Whether the rows are those of the joints of the world.
    pub fn are_of(&self, world: &World) -> bool {
        self.joints == *world.joints && self.handles == world.joints.handles()
    }

    /// The row that a joint had in the last step.
    pub fn row_of(&self, world: &World, joint: JointHandle) -> Option<usize> {
        // Rows keep the order of the joints from before the caller or the step removed some.
        let now = world.joints.index(joint)?;
        let is_here = |&row: &usize| self.handles.get(row) == Some(&joint);
        Some(now).filter(is_here).or_else(|| self.handles.iter().position(|handle| *handle == joint))
    }

    /// The length of a joint's substeps in the last step, over that of class 0.
    pub fn share(&self, row: usize) -> f32 {
        self.shares[row]
    }

    /// Refuses rows with indices beyond the bodies, joints or systems.
    pub(crate) fn check(&self, bodies: usize, problem: &StepProblem) -> Result<()> {
        let count = self.joints.len();
        let lengths = [self.handles.len(), self.edges.len(), self.shares.len(), self.twists.len(), self.openings.len()];
        // The impulses of axes come after those of joints.
        let impulses = problem.joint_impulses.len();
        ensure(lengths == [count; 5] && impulses >= count, || {
            format!("{lengths:?}, {impulses} rows of {count} joints")
        })?;
        let is_body = |&body: &u32| body == IMMOVABLE || (body as usize) < bodies;
        let has_bodies = |joint: &Joint| {
            let (a, b) = joint.indices();
            a < bodies && b.is_none_or(|b| b < bodies)
        };
        let are_bodies = self.edges.iter().all(|edge| is_body(&edge.a) && is_body(&edge.b));
        ensure(are_bodies && self.joints.iter().all(has_bodies), || "a joint names a body beyond the last".into())?;
        let Coloring { order, offsets, .. } = &self.coloring;
        let are_joints = order.iter().all(|&joint| (joint as usize) < count);
        let are_colors = offsets.is_sorted() && offsets.last().is_none_or(|&end| end as usize <= order.len());
        let are_systems = self.systems.iter().all(|&s| s == SWEPT || (s as usize) < problem.systems.len());
        let are_chosen = self.chosen_for.is_none() || [self.systems.len(), self.left.len()] == [count; 2];
        ensure(are_joints && are_colors && are_systems && are_chosen, || {
            "the colors or systems do not match the joints".into()
        })
    }

    /// Forgets the colors of all joints, so that they are colored anew.
    pub fn forget_colors(&mut self) {
        self.edges.iter_mut().for_each(|edge| edge.color = None);
        self.is_colored = false;
    }

    /// Forgets which joints are solved directly, so that they are chosen anew, and how far they are open: other settings
    /// promise another gap.
    pub fn forget_systems(&mut self) {
        self.chosen_for = None;
        self.openings.fill(Opening::default());
    }

    /// Chooses the joints that are solved directly, unless the choice is made already. The choice lasts, because a
    /// swept joint leaves a gap that it closes softly. A later direct solution would gain energy from this gap.
    /// `substep` is the length of a substep (s).
    pub fn choose(&mut self, world: &World, config: &SolverConfig, substep: f32, problem: &mut StepProblem) {
        let is_chosen = self.chosen_for.replace(substep) == Some(substep);
        let felt = || {
            let ends = self.joints.iter().map(Joint::indices);
            ends.flat_map(|(a, b)| [Some(a), b]).flatten().map(|body| world.gravity_at(body))
        };
        if is_chosen && self.gravity.iter().copied().eq(felt()) {
            return;
        }
        self.gravity = felt().collect();
        problem.systems = JointSystems::default();
        self.systems.clear();
        self.systems.resize(self.joints.len(), SWEPT);
        self.swept_gap = 0.0;
        self.left.clear();
        self.left.resize(self.joints.len(), LeftToSweeps::NONE);
        if config.joint_solver == JointSolver::Sweeps {
            return;
        }
        let mut islands = Islands::default();
        islands.reset(world.bodies.len());
        self.edges.iter().filter(|e| e.a != IMMOVABLE && e.b != IMMOVABLE).for_each(|e| islands.join(e.a, e.b));
        let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (joint, edge) in self.edges.iter().enumerate() {
            let body = if edge.a == IMMOVABLE { edge.b } else { edge.a };
            if body != IMMOVABLE {
                members.entry(islands.root(body)).or_default().push(joint as u32);
            }
        }
        for joints in members.into_values() {
            let gap = gap_of_sweeps(&joints, world, config, substep, |joint| self.sides(joint));
            self.swept_gap = self.swept_gap.max(gap);
            self.decide(&joints, gap, (world, config, substep), problem);
        }
    }

    /// Updates the needs of the joints that are left to sweeps, from their impulses in the last substep. `substep` is
    /// the length of a substep of class 0 (s).
    pub fn follow_loads(&mut self, substep: f32, problem: &StepProblem) {
        let rows = self.left.iter_mut().zip(&self.shares).zip(&problem.joint_impulses);
        for ((left, share), impulse) in rows.filter(|((left, share), _)| left.force.is_finite() && **share > 0.0) {
            let borne = Vec3::from(impulse.linear).length() / (share * substep);
            left.need = effort::lasting(borne / left.force, left.need);
        }
    }

    /// Keeps the rows of joints before a step, so that the step can be taken again.
    pub fn keep(&mut self, problem: &StepProblem) {
        let Self { before, shares, twists, .. } = self;
        before.impulses.clone_from(&problem.joint_impulses);
        before.shares.clone_from(shares);
        before.twists.clone_from(twists);
        before.tried.clear();
    }

    /// Returns to the rows of [`Self::keep`].
    pub fn go_back(&mut self, problem: &mut StepProblem) {
        let Self { before, shares, twists, .. } = self;
        problem.joint_impulses.clone_from(&before.impulses);
        shares.clone_from(&before.shares);
        twists.clone_from(&before.twists);
    }

    /// Measures how far the joints are open after the step that `problem` ran. Returns whether an island may need another
    /// class for the step. `gaps_of` gives the gaps of a joint before and after the step.
    ///
    /// Gaps that motion opens fall with the square of the substep. A gap was there before if it does not grow, and a
    /// load that cannot be met holds it open if the shortest substeps leave it. Neither needs shorter substeps.
    pub fn measure(
        &mut self,
        config: &SolverConfig,
        problem: &StepProblem,
        gaps_of: impl Fn(&StepProblem, usize) -> [f64; 2],
    ) -> bool {
        let Self { openings, before: Before { tried, .. }, shares, systems, .. } = self;
        let is_first = tried.is_empty();
        let least_share = Effort::share_of(Effort::highest(config));
        tried.resize(openings.len(), 0.0);
        let mut is_open = false;
        openings.iter_mut().for_each(|opening| (opening.need, opening.next) = (0.0, 0.0));
        for &row in problem.rows_of(&problem.joint_colors()) {
            let row = row as usize;
            let (opening, share) = (&mut openings[row], shares[row]);
            let [before, after] = gaps_of(problem, row).map(|gap| (gap / f64::from(config.max_joint_gap_share)) as f32);
            let was = std::mem::replace(&mut tried[row], after);
            // Nets swing, so they keep the share of the promise that a lower class has to keep.
            let next = if systems[row] == SWEPT { after.max(2.0 * after - before) / DESCENT_SHARE } else { 0.0 };
            opening.next = next / (share * share);
            is_open |= after > 1.0;
            let did_not_help = !is_first && after > HELPS * was;
            let has_grown = after > before && HELPS * after > opening.stuck;
            if after <= 1.0 {
                (opening.need, opening.stuck) = (after / (share * share), 0.0);
            } else if did_not_help && (share <= least_share || !has_grown) {
                opening.stuck = after;
            } else if has_grown {
                // After a try that did not help, the next one has a quarter of the substep.
                let further = if did_not_help { 16.0 } else { 1.0 };
                opening.need = further * after / (share * share);
            }
        }
        is_open
    }

    /// Adds a system for the anchors and locks of some joints, which sweeps would leave open by `gap`, if it is cheap
    /// enough. If not, records that the joints need more substeps.
    fn decide(
        &mut self,
        joints: &[u32],
        gap: f32,
        (world, config, substep): (&World, &SolverConfig, f32),
        problem: &mut StepProblem,
    ) {
        let of_joint = |&joint: &u32| axes::nodes(&self.joints[joint as usize]).map(move |rows| (joint, rows));
        let nodes: Vec<_> = joints.iter().flat_map(of_joint).collect();
        let most_terms = match config.joint_solver {
            JointSolver::Auto => MAX_TERMS_A_NODE * nodes.len(),
            _ => usize::MAX,
        };
        let system = problem.systems.len() as u32;
        if problem.systems.add(&nodes, |joint| self.sides(joint), most_terms) {
            nodes.iter().for_each(|(joint, _)| self.systems[*joint as usize] = system);
        } else {
            for joint in joints.iter().map(|&joint| joint as usize) {
                let need = gap / config.max_joint_gap_share;
                let force = force_of_promised_gap(&self.joints[joint], world, config, substep);
                self.left[joint] = force.map_or(LeftToSweeps::NONE, |force| LeftToSweeps { need, force });
            }
        }
    }

    /// The movable bodies of a joint.
    fn sides(&self, joint: u32) -> [Option<u32>; 2] {
        let Edge { a, b, .. } = self.edges[joint as usize];
        [a, b].map(|body| Some(body).filter(|&body| body != IMMOVABLE))
    }

    /// The largest gap that sweeps would leave in any joint, as a share of its arms; 0 if the settings choose sweeps.
    pub fn swept_gap(&self) -> f32 {
        self.swept_gap
    }

    /// Follows the joints of the world, and returns those that were added, removed or changed.
    ///
    /// A joint keeps its impulse and color at any place in the list, even if its anchors move. It loses them if it
    /// connects other bodies.
    pub fn follow(&mut self, world: &World, problem: &mut StepProblem) -> Vec<Joint> {
        let (before, now) = (std::mem::take(&mut self.joints), &world.joints);
        let place_of: HashMap<JointHandle, usize> = self.handles.drain(..).zip(0..).collect();
        self.handles.extend_from_slice(now.handles());
        let same_bodies =
            |joint: &Joint, i: usize| (before[i].body_a, before[i].body_b) == (joint.body_a, joint.body_b);
        let from =
            |(joint, handle): (&Joint, &JointHandle)| place_of.get(handle).copied().filter(|&i| same_bodies(joint, i));
        let from: Vec<Option<usize>> = now.iter().zip(now.handles()).map(from).collect();
        let edge = |(joint, from): (&Joint, &Option<usize>)| {
            let (a, b) = joint.indices();
            // A joint that holds nothing connects no movable bodies.
            let is_end = |b: usize| world.bodies[b].kind == BodyKind::Dynamic && !joint.holds_nothing();
            let end = |b: usize| if is_end(b) { b as u32 } else { IMMOVABLE };
            let color = from.and_then(|i| self.edges[i].color);
            Edge { a: end(a), b: b.map_or(IMMOVABLE, end), color, rank: 0 }
        };
        let edges: Vec<Edge> = now.iter().zip(&from).map(edge).collect();
        self.is_colored &= edges == self.edges;
        self.chosen_for = None;
        self.edges = edges;
        let old = std::mem::take(&mut problem.joint_impulses);
        // A disabled joint has no impulse.
        let impulse = |(from, joint): (&Option<usize>, &Joint)| {
            from.filter(|_| joint.enabled).and_then(|i| old.get(i).copied()).unwrap_or_default()
        };
        problem.joint_impulses = from.iter().zip(now.iter()).map(impulse).collect();
        // Impulses of axes are kept if the joint has the same axes as before.
        let firsts: Vec<usize> = first_axes(&before).collect();
        for (joint, from) in now.iter().zip(&from) {
            let same = from.filter(|&i| joint.enabled && axes::kinds(&before[i]).eq(axes::kinds(joint)));
            let axis = |k: usize| same.and_then(|i| old.get(before.len() + firsts[i] + k).copied()).unwrap_or_default();
            problem.joint_impulses.extend((0..axes::kinds(joint).count()).map(axis));
        }
        self.shares = from.iter().map(|from| from.map_or(0.0, |i| self.shares[i])).collect();
        self.twists = from.iter().map(|from| from.and_then(|i| self.twists[i])).collect();
        self.openings = from.iter().map(|from| from.map_or(Opening::default(), |i| self.openings[i])).collect();
        let mut ended = vec![true; before.len()];
        from.iter().flatten().for_each(|&i| ended[i] = false);
        let changed = now.iter().zip(&from).filter(|(joint, from)| from.is_none_or(|i| before[i] != **joint));
        let ended = before.iter().zip(&ended).filter(|(_, ended)| **ended);
        let all = changed.map(|(joint, _)| *joint).chain(ended.map(|(joint, _)| *joint)).collect();
        self.joints.extend_from_slice(now);
        all
    }

    /// Gives every joint a color, unless all have one. Joints and contacts share no colors.
    pub fn color(&mut self, world: &World, max_colors: u32) {
        if !self.is_colored {
            self.coloring = self.graph.color(world.bodies.len(), &mut self.edges, max_colors);
            self.is_colored = true;
        }
    }

    /// Whether any joint needs more than class 0 gives.
    pub fn are_above(&self) -> bool {
        self.left.iter().any(|left| left.need > 1.0)
            || self.openings.iter().any(|opening| opening.need.max(opening.next) > 1.0)
    }

    /// The joints that take part, for the effort of their islands. A moving kinematic body counts as a member of the
    /// island that it holds.
    pub fn interfaces(&self, world: &World, asleep: &[bool]) -> impl Iterator<Item = Interface> + Clone {
        let awake = self.joints.iter().enumerate().filter(move |(i, _)| takes_part(world, asleep, *i as u32));
        let end = |body: usize| match world.bodies[body].kind {
            BodyKind::Dynamic => body as u32,
            _ if world.bodies[body].is_driven() => body as u32,
            _ => IMMOVABLE,
        };
        awake.map(move |(i, joint)| {
            let (a, b) = joint.indices();
            let LeftToSweeps { need, force } = self.left.get(i).copied().unwrap_or(LeftToSweeps::NONE);
            let Opening { need: opening, next, stuck } = self.openings[i];
            let need = need.max(next);
            let drives = axes::driving_force(joint, world);
            let need_of_joint = JointNeed { drives, opening, is_stuck: stuck > 0.0 };
            Interface { a: end(a), b: b.map_or(IMMOVABLE, end), need, force, joint: Some(need_of_joint) }
        })
    }

    /// Whether a joint is solved directly, and not swept.
    pub fn is_direct(&self, joint: u32) -> bool {
        self.systems[joint as usize] != SWEPT
    }

    /// Writes the rows of all joints, after those of bodies and contacts. `substep` is the length of a substep of class
    /// 0 (s).
    pub fn write(
        &mut self,
        world: &World,
        asleep: &[bool],
        config: &SolverConfig,
        effort: &Effort,
        substep: f32,
        problem: &mut StepProblem,
    ) {
        problem.joints.clear();
        problem.axes.clear();
        problem.joint_totals.clear();
        problem.turning.clear();
        problem.params.joint_count = world.joints.len() as u32;
        if world.joints.is_empty() {
            return;
        }
        let world_row = world.bodies.len() as u32;
        let (impulses, axis_impulses) = problem.joint_impulses.split_at_mut(world.joints.len());
        let rows = world.joints.iter().zip(impulses).zip(&mut self.shares).zip(&mut self.twists);
        let axes = &mut problem.axes;
        problem.joints.extend(rows.map(|(((joint, impulse), share_before), twist)| {
            let (body_a, body_b) = joint.indices();
            let [anchor_a, mut anchor_b] = world.anchors(joint);
            let arm = |body: usize, anchor: Vec3| (anchor - world.bodies[body].center_of_mass()).to_array();
            let is_movable = |body: usize| world.bodies[body].kind == BodyKind::Dynamic;
            let share = effort.share(body_b.filter(|&b| is_movable(b)).unwrap_or(body_a));
            let before = std::mem::replace(share_before, share);
            if before != share && before > 0.0 {
                impulse.linear = impulse.linear.map(|x| x * (share / before));
            }
            let first_axis = axes.len();
            let (mut frame_a, mut frame_b) = ([0.0; 4], [0.0; 4]);
            if !joint.is_ball() {
                let limit_rate = Substep::new(config, substep * share).joint.bias_rate;
                let mut motion = world.joint_motion(joint);
                let [first, ..] = &joint.angular;
                *twist = first.counts_turns().then(|| first.counted(motion.position[3], *twist));
                motion.position[3] = twist.unwrap_or(motion.position[3]);
                let has_frames = joint.swings() && motion.spin.length() * substep * config.substeps as f32 > SLOW_TURN;
                axes::write(joint, &motion, has_frames, substep * share, limit_rate, axes);
                if has_frames {
                    (frame_a, frame_b) = (motion.frame_a.to_array(), motion.frame_b.to_array());
                }
                if before != share && before > 0.0 {
                    for impulse in &mut axis_impulses[first_axis..axes.len()] {
                        impulse.linear[0] *= share / before;
                    }
                }
            }
            let is_loose = !joint.holds_anchors();
            if is_loose {
                (*impulse, anchor_b) = (JointImpulseRow::default(), anchor_a);
            }
            JointRow {
                is_loose: if is_loose { 1.0 } else { 0.0 },
                first_axis: first_axis as u32,
                axis_count: (axes.len() - first_axis) as u32,
                r_a: arm(body_a, anchor_a),
                body_a: body_a as u32,
                r_b: body_b.map_or([0.0; 3], |b| arm(b, anchor_b)),
                body_b: body_b.map_or(world_row, |b| b as u32),
                gap: (anchor_b - anchor_a).to_array(),
                frame_a,
                frame_b,
                ..JointRow::default()
            }
        }));
        problem.params.axis_count = problem.axes.len() as u32;
        let is_driven = |b: usize| world.bodies[b].kind != BodyKind::Dynamic && world.bodies[b].is_driven();
        let is_measured = |joint: &Joint| {
            let (a, b) = joint.indices();
            joint.can_break() || joint.is_driven() || is_driven(a) || b.is_some_and(is_driven)
        };
        if self.sums || world.joints.iter().any(is_measured) {
            // A joint that does not take part has no load that could break it.
            problem.joint_totals.resize(problem.joint_impulses.len(), JointImpulseRow::default());
        }
        // The inertia of every body with joints turns, so that their impulses conserve angular momentum.
        let taking_part = (0..world.joints.len()).filter(|&joint| takes_part(world, asleep, joint as u32));
        let of_direct = |joint: usize| if self.systems[joint] == SWEPT { 0.0 } else { substep * self.shares[joint] };
        add_stiffness_inertia(
            taking_part.map(|joint| (joint, of_direct(joint))),
            &mut self.stiffness_inertias,
            problem,
        );
        // Locked axes are axes of the world, so the inverse inertia of a body with locked axes does not turn with it.
        problem.turning.retain(|row| !world.bodies[row.body as usize].has_locked_rotation());
        // The world, as a body that nothing moves.
        if world.joints.iter().any(|j| j.body_b.is_none()) {
            problem.bodies.push(BodyRow::AT_REST);
            problem.masses.push(MassRow::default());
            if !problem.torques.is_empty() {
                problem.torques.push(TorqueRow::NONE);
            }
            problem.params.body_count += 1;
        }
        for (i, joint) in world.joints.iter().enumerate().filter(|(_, joint)| axes::has_springs(joint)) {
            axes::tune(joint, i, substep * self.shares[i], world, problem);
        }
    }
}

/// The index of the first axis of each joint.
fn first_axes(joints: &[Joint]) -> impl Iterator<Item = usize> {
    joints.iter().scan(0, |next, joint| {
        let first = *next;
        *next += axes::kinds(joint).count();
        Some(first)
    })
}

/// Whether the step solves a joint of the world. A joint connects bodies of one island, which are asleep together. A
/// joint of two bodies that nothing moves has no block, and a joint that holds nothing has no row.
pub(super) fn takes_part(world: &World, asleep: &[bool], joint: u32) -> bool {
    let joint = &world.joints[joint as usize];
    let (a, b) = joint.indices();
    let rests = |body: usize| asleep.get(body) == Some(&true);
    let moves = |body: usize| world.bodies[body].kind == BodyKind::Dynamic;
    !joint.holds_nothing() && (moves(a) || b.is_some_and(moves)) && !(rests(a) || b.is_some_and(rests))
}
