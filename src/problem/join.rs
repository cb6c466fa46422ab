//! Joins the steps of several worlds into one, so that small worlds fill the lanes of a processor together.
//!
//! The rows of one world follow those of another, and each color holds the rows of this color of all worlds. Each world
//! gets the same bits as alone: no row names a body of another world, colors keep their order, and a step joins others
//! only if its plan has the same rules as the joint plan.

use std::ops::Range;

use super::{
    Block, BlockRow, ContactRow, InertiaRow, JointRow, JointSystems, NodeRow, Params, StepProblem, Substep, TurningRow,
};
use crate::config::{Method, SolverConfig};

/// The facts about all blocks that decide the rules of a plan, apart from the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Alike {
    friction: bool,
    round: bool,
    /// See [`StepProblem::parts`].
    parts: [bool; 7],
    /// With all counts zero.
    params: Params,
}

impl Alike {
    /// The facts of a step; `None` if its sweeps depend on all islands together.
    pub fn of(config: &SolverConfig, problem: &StepProblem) -> Option<Self> {
        if config.tolerance > 0.0 || config.method != Method::Plain {
            return None;
        }
        let (mut friction, mut round) = (false, false);
        for &row in problem.rows_of(&problem.contact_colors()) {
            let contact = &problem.contacts[row as usize];
            friction |= contact.friction > 0.0;
            round |= contact.radius_a > 0.0 || contact.radius_b > 0.0;
        }
        Some(Self {
            friction,
            round,
            parts: problem.parts(),
            params: Params { body_count: 0, point_count: 0, joint_count: 0, axis_count: 0, ..problem.params },
        })
    }
}

/// The facts that decide the rules of one block.
#[derive(Clone, Copy, PartialEq)]
struct BlockKind {
    substeps: u32,
    substep: Substep,
    isotropic: bool,
    has_contacts: bool,
    has_joints: bool,
    has_bodies: bool,
}

impl BlockKind {
    fn of(problem: &StepProblem, block: &Block) -> Self {
        let [contacts, joints, bodies, ..] = block.colors();
        let bodies = problem.rows_of(&bodies);
        Self {
            substeps: block.substeps,
            substep: block.substep,
            isotropic: problem.moves_alike(bodies),
            has_contacts: !contacts.is_empty(),
            has_joints: !joints.is_empty(),
            has_bodies: !bodies.is_empty(),
        }
    }
}

/// Where the rows of a world begin among the rows of all worlds.
#[derive(Clone, Copy, Default)]
struct Begin {
    bodies: u32,
    inertias: u32,
    contacts: u32,
    points: u32,
    joints: u32,
    axes: u32,
    systems: u32,
    nodes: u32,
    blocks: u32,
    terms: u32,
    turning: u32,
}

impl Begin {
    fn after(self, problem: &StepProblem) -> Self {
        let count = |rows: usize| rows as u32;
        Self {
            bodies: self.bodies + count(problem.bodies.len()),
            inertias: self.inertias + count(problem.inertias.len()),
            contacts: self.contacts + count(problem.contacts.len()),
            points: self.points + count(problem.points.len()),
            joints: self.joints + count(problem.joints.len()),
            axes: self.axes + count(problem.axes.len()),
            systems: self.systems + count(problem.systems.len()),
            nodes: self.nodes + count(problem.systems.nodes.len()),
            blocks: self.blocks + count(problem.systems.blocks.len()),
            terms: self.terms + count(problem.systems.terms.len()),
            turning: self.turning + count(problem.turning.len()),
        }
    }
}

/// Writes several similar steps into one, and reuses its memory.
pub(crate) fn join(problems: &[&mut StepProblem], all: &mut StepProblem) {
    all.clone_from(&StepProblem::default());
    let mut begins = Vec::with_capacity(problems.len());
    let mut begin = Begin::default();
    for problem in problems {
        begins.push(begin);
        push_rows(problem, begin, all);
        begin = begin.after(problem);
    }
    // Impulses of axes come after those of all joints.
    for problem in problems {
        all.joint_impulses.extend_from_slice(&problem.joint_impulses[problem.joints.len()..]);
        all.joint_totals.extend(problem.joint_totals.iter().skip(problem.joints.len()));
    }
    lay_out(problems, &begins, all);
}

/// Hands the results of a backend back to each world.
pub(crate) fn part(all: &StepProblem, problems: &mut [&mut StepProblem]) {
    let mut begin = Begin::default();
    let joints = problems.iter().map(|problem| problem.joints.len()).sum();
    let mut axes: usize = joints;
    for problem in problems {
        take(&mut problem.bodies, &all.bodies, begin.bodies);
        take(&mut problem.impulses, &all.impulses, begin.points);
        take(&mut problem.totals, &all.totals, begin.points);
        for (own, of_all) in
            [(&mut problem.joint_impulses, &all.joint_impulses), (&mut problem.joint_totals, &all.joint_totals)]
        {
            let of_joints = problem.joints.len().min(own.len());
            let (own_joints, own_axes) = own.split_at_mut(of_joints);
            take(own_joints, of_all, begin.joints);
            take(own_axes, of_all, axes as u32);
        }
        axes += problem.joint_impulses.len() - problem.joints.len();
        (problem.convergence, problem.momentum) = (all.convergence, all.momentum);
        begin = begin.after(problem);
    }
}

fn take<T: Copy>(own: &mut [T], all: &[T], begin: u32) {
    if !own.is_empty() {
        own.copy_from_slice(&all[begin as usize..begin as usize + own.len()]);
    }
}

/// Adds the rows of a world, with indices into the rows of all worlds.
fn push_rows(one: &StepProblem, begin: Begin, all: &mut StepProblem) {
    all.params = Params {
        body_count: all.params.body_count + one.params.body_count,
        point_count: all.params.point_count + one.params.point_count,
        joint_count: all.params.joint_count + one.params.joint_count,
        axis_count: all.params.axis_count + one.params.axis_count,
        ..one.params
    };
    (all.convergence, all.momentum) = (one.convergence, one.momentum);
    all.bodies.extend_from_slice(&one.bodies);
    all.masses.extend_from_slice(&one.masses);
    all.torques.extend_from_slice(&one.torques);
    all.dampings.extend_from_slice(&one.dampings);
    all.points.extend_from_slice(&one.points);
    all.impulses.extend_from_slice(&one.impulses);
    all.totals.extend_from_slice(&one.totals);
    all.sags.extend_from_slice(&one.sags);
    all.axes.extend_from_slice(&one.axes);
    all.joint_impulses.extend_from_slice(&one.joint_impulses[..one.joints.len()]);
    all.joint_totals.extend(one.joint_totals.iter().take(one.joints.len()));
    let body = |body: u32| body + begin.bodies;
    all.inertias.extend(one.inertias.iter().map(|row| InertiaRow { body: body(row.body), ..*row }));
    all.turning.extend(one.turning.iter().map(|row| TurningRow { body: body(row.body), ..*row }));
    all.contacts.extend(one.contacts.iter().map(|row| ContactRow {
        body_a: body(row.body_a),
        body_b: body(row.body_b),
        first_point: row.first_point + begin.points,
        ..*row
    }));
    all.joints.extend(one.joints.iter().map(|row| JointRow {
        body_a: body(row.body_a),
        body_b: body(row.body_b),
        first_axis: row.first_axis + begin.axes,
        ..*row
    }));
    push_systems(&one.systems, begin, &mut all.systems);
}

fn push_systems(one: &JointSystems, begin: Begin, all: &mut JointSystems) {
    if one.is_empty() {
        return;
    }
    // The end of the systems before is the start of these.
    all.begins.pop();
    all.begins.extend(one.begins.iter().map(|node| node + begin.nodes));
    all.softness.extend_from_slice(&one.softness);
    all.nodes.extend(one.nodes.iter().map(|node| NodeRow {
        joint: node.joint + begin.joints,
        first_block: node.first_block + begin.blocks,
        end_block: node.end_block + begin.blocks,
        ..*node
    }));
    all.blocks.extend(one.blocks.iter().map(|block| BlockRow {
        node: block.node + begin.nodes,
        first_term: block.first_term + begin.terms,
        end_term: block.end_term + begin.terms,
        ..*block
    }));
    all.terms.extend(one.terms.iter().map(|term| term.map(|block| block + begin.blocks)));
}

/// A block, with the index of its world.
type Of<'a> = (usize, &'a Block);

/// Joins blocks with the same rules into one.
fn lay_out(problems: &[&mut StepProblem], begins: &[Begin], all: &mut StepProblem) {
    let mut kinds: Vec<(BlockKind, Vec<Of>)> = Vec::new();
    for (world, problem) in problems.iter().enumerate() {
        for block in &problem.blocks {
            let kind = BlockKind::of(problem, block);
            match kinds.iter_mut().find(|known| known.0 == kind) {
                Some((_, members)) => members.push((world, block)),
                None => kinds.push((kind, vec![(world, block)])),
            }
        }
    }
    let StepProblem { order, colors, blocks, .. } = all;
    colors.push(0);
    let mut push = |members: &[Of], range: fn(&Block) -> Range<u32>, begin: fn(&Begin) -> u32| {
        let most = members.iter().map(|(_, block)| range(block).len() as u32).max().unwrap_or(0);
        for color in 0..most {
            for (world, block) in members.iter().filter(|(_, block)| color < range(block).len() as u32) {
                let own = range(block).start + color;
                let first = begin(&begins[*world]);
                order.extend(problems[*world].rows_of(&(own..own + 1)).iter().map(|row| row + first));
            }
            colors.push(order.len() as u32);
        }
        colors.len() as u32 - 1
    };
    let contacts = |begin: &Begin| begin.contacts;
    let joints = |begin: &Begin| begin.joints;
    let mut end = 0;
    blocks.extend(kinds.iter().map(|(kind, _)| Block {
        substeps: kind.substeps,
        substep: kind.substep,
        ..Block::default()
    }));
    for (block, (_, members)) in blocks.iter_mut().zip(&kinds) {
        block.contacts[0] = end;
        block.struck = push(members, |block| block.contacts[0]..block.struck, contacts);
        block.jamming = push(members, |block| block.struck..block.jamming, contacts);
        end = push(members, |block| block.jamming..block.contacts[1], contacts);
        block.contacts[1] = end;
    }
    for (block, (_, members)) in blocks.iter_mut().zip(&kinds) {
        block.joints[0] = end;
        block.direct = push(members, Block::swept_joints, joints);
        end = push(members, Block::direct_joints, joints);
        block.joints[1] = end;
    }
    let mut single = |blocks: &mut [Block],
                      place: fn(&mut Block) -> &mut u32,
                      range: fn(&Block) -> Range<u32>,
                      begin: fn(&Begin) -> u32| {
        for (block, (_, members)) in blocks.iter_mut().zip(&kinds) {
            *place(block) = push(members, range, begin) - 1;
        }
    };
    single(blocks, |block| &mut block.bodies, |block| block.bodies..block.bodies + 1, |begin| begin.bodies);
    single(blocks, |block| &mut block.inertias, |block| block.inertias..block.inertias + 1, |begin| begin.inertias);
    single(blocks, |block| &mut block.systems, |block| block.systems..block.systems + 1, |begin| begin.systems);
    single(blocks, |block| &mut block.turning, |block| block.turning..block.turning + 1, |begin| begin.turning);
}
