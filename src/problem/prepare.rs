//! From bodies and manifolds to rows: arms, effective masses, impulses carried over.

use glam::Vec3;
use rayon::prelude::*;

use super::StepProblem;
use super::carry::{Carry, NO_POINT, Preload, Written};
use super::contacts::{Writer, point_before};
use super::follow::StepScale;
use super::layout::{
    BodyRow, ContactRow, ConvergenceRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow, MomentumRow,
    Params, PointRow, Softness, points_a_slot,
};
use super::slots::{Slots, Write};
use super::softness::softness;
use crate::collide::{Detector, MAX_POINTS};
use crate::config::{Friction, FrictionAt, FrictionRule, SolverConfig, Stabilization};
use crate::graph::{Coloring, ConstraintGraph, Edge};
use crate::math::Lane;
use crate::world::{BallJoint, Body, BodyKind, World};

/// Which manifold and which joint has which rows of a problem, and what follows from it.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    pub(super) slots: Slots,
    graph: ConstraintGraph,
    /// The coloring of this step's contacts.
    pub coloring: Coloring,
    /// Whether every manifold has a row for friction of its own.
    patches: bool,
    /// Separation of each point when its manifold was computed, [`MAX_POINTS`] a slot (m).
    computed: Vec<f32>,
    /// The joints that the rows are of, in the order of the world, and as edges of their graph.
    pub(super) joints: Vec<BallJoint>,
    pub(super) joint_edges: Vec<Edge>,
    pub(super) are_joints_colored: bool,
    joint_coloring: Coloring,
    /// What impulses and preloads of the last step are proportional to; none before the first.
    pub(super) scale: Option<StepScale>,
    /// How the rows of contacts follow from those of the step before.
    pub carry: Carry,
}

/// Bodies that one task prepares at least.
const CHUNK: usize = 256;

impl Prepared {
    /// Gives rows to manifolds that began since, and takes those of manifolds that ended.
    pub fn follow(&mut self, world: &World, detector: &mut Detector) {
        self.slots.follow(world, detector);
    }

    /// Gives every manifold that takes part a color; one that has a color keeps it.
    pub fn color(&mut self, world: &World, max_colors: u32) {
        let members: Vec<u32> = self.slots.taking_part().collect();
        self.coloring = self.graph.color_members(world.bodies.len(), &mut self.slots.edges, &members, max_colors);
    }

    /// Whether so many rows are new that it pays to sort all by [`Self::sort_slots`]. A device that has rows cannot follow that.
    pub fn are_slots_unsorted(&self) -> bool {
        self.slots.are_unsorted()
    }

    /// Puts the rows of contacts into the order of the sweeps.
    pub fn sort_slots(&mut self, detector: &mut Detector, problem: &mut StepProblem) {
        let from = self.slots.sort(&self.coloring.order, detector);
        self.coloring.order = (0..self.coloring.order.len() as u32).collect();
        let stride = points_a_slot(self.patches);
        if !problem.contacts.is_empty() {
            problem.contacts = moved(&problem.contacts, &from, 1);
            (0..).zip(&mut problem.contacts).for_each(|(i, contact)| contact.first_point = i * stride as u32);
            problem.points = moved(&problem.points, &from, stride);
            problem.impulses = moved(&problem.impulses, &from, stride);
            self.computed = moved(&self.computed, &from, MAX_POINTS);
        }
    }

    /// The color of the contact in a row.
    pub fn color_of(&self, row: u32) -> Option<u8> {
        self.slots.edges[row as usize].color
    }

    /// Gives every joint a color, unless all have theirs; joints and contacts share none.
    pub fn color_joints(&mut self, world: &World, max_colors: u32) {
        if !self.are_joints_colored {
            self.joint_coloring = self.graph.color(world.bodies.len(), &mut self.joint_edges, max_colors);
            self.are_joints_colored = true;
        }
    }

    /// Writes the rows of a step of `dt` seconds into `problem`. Bodies that are `asleep` stand in them as bodies that nothing moves.
    pub fn prepare(
        &mut self,
        world: &World,
        asleep: &[bool],
        detector: &Detector,
        config: &SolverConfig,
        dt: f32,
        problem: &mut StepProblem,
    ) {
        prepare_bodies(world, asleep, config, problem);
        self.scale = Some(StepScale::new(config, dt));
        let patches = config.friction_at == FrictionAt::Manifold && config.friction != Friction::None;
        self.lay_out(patches, problem);
        let h = dt / config.substeps as f32;
        problem.params = Params {
            substep: h,
            inverse_substep: 1.0 / h,
            restitution_threshold: config.restitution_threshold,
            inertia_count: problem.inertias.len() as u32,
            movable: contact_softness(config, h, 1.0),
            fixed: contact_softness(config, h, config.fixed_contact_frequency_ratio),
            joint: joint_softness(config, h),
            body_count: problem.bodies.len() as u32,
            point_count: problem.points.len() as u32,
            slop: if config.stabilization == Stabilization::Baumgarte { config.slop } else { 0.0 },
            relaxation: config.relaxation,
            tolerance: config.tolerance,
            patches: patches.into(),
            ..Params::default()
        };
        problem.convergence = ConvergenceRow::default();
        problem.momentum = MomentumRow::default();
        problem.order.clone_from(&self.coloring.order);
        problem.colors.clone_from(&self.coloring.offsets);
        problem.first_joint_color = self.coloring.color_count() as u32;
        self.prepare_joints(world, asleep, problem);
        self.prepare_contacts(world, detector, config, dt, problem);
    }

    /// Makes room for the rows of all slots. Where friction acts at other places than before, it begins without impulses.
    fn lay_out(&mut self, patches: bool, problem: &mut StepProblem) {
        let (count, stride) = (self.slots.all.len(), points_a_slot(patches));
        if patches != self.patches {
            let before = std::mem::take(&mut problem.impulses);
            problem.impulses.resize(problem.contacts.len() * stride, ImpulseRow::default());
            for (now, before) in problem.impulses.chunks_mut(stride).zip(before.chunks(points_a_slot(self.patches))) {
                for (now, before) in now.iter_mut().zip(&before[..MAX_POINTS]) {
                    now.normal = before.normal;
                }
            }
            for (now, contact) in problem.impulses.chunks_mut(stride).zip(&problem.contacts) {
                now[contact.point_count as usize..].fill(ImpulseRow::default());
            }
            self.patches = patches;
        }
        problem.contacts.resize(count, ContactRow::default());
        problem.points.resize(count * stride, PointRow::default());
        problem.impulses.resize(count * stride, ImpulseRow::default());
        self.computed.resize(count * MAX_POINTS, 0.0);
    }

    fn prepare_joints(&mut self, world: &World, asleep: &[bool], problem: &mut StepProblem) {
        problem.joints.clear();
        problem.joint_impulses.resize(world.joints.len(), JointImpulseRow::default());
        problem.params.joint_count = world.joints.len() as u32;
        if world.joints.is_empty() {
            return;
        }
        // A joint holds bodies of one island, which are asleep together.
        let rests = |body: usize| asleep.get(body) == Some(&true);
        let moves = |body: usize| world.bodies[body].kind == BodyKind::Dynamic;
        let is_awake = |i: u32| {
            let joint = &world.joints[i as usize];
            // One of two bodies that nothing moves has no block to solve.
            (moves(joint.body_a) || joint.body_b.is_some_and(moves))
                && !(rests(joint.body_a) || joint.body_b.is_some_and(rests))
        };
        let contacts = problem.order.len();
        for color in self.joint_coloring.offsets.windows(2) {
            let own = &self.joint_coloring.order[color[0] as usize..color[1] as usize];
            problem.order.extend(own.iter().filter(|&&i| is_awake(i)));
            problem.colors.push(problem.order.len() as u32);
        }
        if problem.order.len() == contacts {
            problem.colors.truncate(problem.first_joint_color as usize + 1);
        }
        let world_row = world.bodies.len() as u32;
        problem.joints.extend(world.joints.iter().map(|joint| {
            let [anchor_a, anchor_b] = world.anchors(joint);
            let arm = |body: usize, anchor: Vec3| (anchor - world.bodies[body].center_of_mass()).to_array();
            JointRow {
                r_a: arm(joint.body_a, anchor_a),
                body_a: joint.body_a as u32,
                r_b: joint.body_b.map_or([0.0; 3], |b| arm(b, anchor_b)),
                body_b: joint.body_b.map_or(world_row, |b| b as u32),
                gap: (anchor_b - anchor_a).to_array(),
                ..JointRow::default()
            }
        }));
        // The world, as a body that nothing moves.
        if world.joints.iter().any(|j| j.body_b.is_none()) {
            problem.bodies.push(BodyRow::AT_REST);
            problem.masses.push(MassRow::default());
            problem.params.body_count += 1;
        }
    }

    fn prepare_contacts(
        &mut self,
        world: &World,
        detector: &Detector,
        config: &SolverConfig,
        dt: f32,
        problem: &mut StepProblem,
    ) {
        self.carry.approach =
            config.friction_rule() == FrictionRule::Slip || world.bodies.iter().any(|b| b.material.restitution > 0.0);
        self.carry.preload = Preload {
            movable_compliance: problem.params.movable.compliance(),
            fixed_compliance: problem.params.fixed.compliance(),
            share: 1.0 - 1.0 / (1.0 + config.preload_rate * dt),
            warm_start: config.warm_start.into(),
        };
        self.note_written(detector);
        let StepProblem { bodies, masses, contacts, points, impulses, params, .. } = problem;
        let Self { slots, carry, patches, computed, .. } = self;
        let (substep, patches) = (params.substep, *patches);
        let writer = Writer { world, detector, config, substep, bodies, masses, carry, patches };
        writer.write(&slots.all, contacts, points, impulses, computed);
        slots.all.iter_mut().for_each(|slot| slot.write = Write::Separations);
    }

    /// Notes which rows are written again, for a device that has the others.
    fn note_written(&mut self, detector: &Detector) {
        self.carry.written.clear();
        if !self.carry.on_device {
            return;
        }
        let again = (0..).zip(&self.slots.all).filter(|(_, slot)| slot.write != Write::Separations);
        self.carry.written.extend(again.map(|(row, slot)| {
            let manifold = &detector.pair(slot.world, slot.pair).manifolds[slot.manifold as usize];
            let mut points_before = if slot.write == Write::New { Written::NEW } else { [NO_POINT; MAX_POINTS] };
            for ((k, point), before) in manifold.points().iter().enumerate().zip(&mut points_before) {
                *before = point_before(slot.write, k, point).unwrap_or(*before);
            }
            Written { row, points_before }
        }));
    }
}

/// The rows of slots, `stride` each, that were at these places; those of slots without rows are left as they come.
fn moved<T: Copy + Default>(rows: &[T], from: &[u32], stride: usize) -> Vec<T> {
    let mut moved = vec![T::default(); from.len() * stride];
    for (to, &from) in moved.chunks_mut(stride).zip(from) {
        if let Some(rows) = rows.chunks(stride).nth(from as usize) {
            to.copy_from_slice(rows);
        }
    }
    moved
}

/// How overlap is removed, for contacts of `ratio` times the frequency.
pub(super) fn contact_softness(config: &SolverConfig, h: f32, ratio: f32) -> Softness {
    match config.stabilization {
        Stabilization::Soft => {
            softness(config.contact_frequency / h * ratio, config.contact_damping, h, config.push_limit)
        }
        Stabilization::Baumgarte => Softness::rigid(config.baumgarte / h, config.push_limit),
        Stabilization::None => Softness::rigid(0.0, config.push_limit),
    }
}

fn joint_softness(config: &SolverConfig, h: f32) -> Softness {
    match config.stabilization {
        Stabilization::Soft => softness(config.joint_frequency / h, config.joint_damping, h, config.push_limit),
        _ => contact_softness(config, h, 1.0),
    }
}

fn prepare_bodies(world: &World, asleep: &[bool], config: &SolverConfig, problem: &mut StepProblem) {
    let rests = |i: usize| asleep.get(i) == Some(&true);
    let state = |(i, b): (usize, &Body)| {
        let moves = b.kind != BodyKind::Fixed && !rests(i);
        let velocity = |v: Vec3| if moves { v.to_array() } else { [0.0; 3] };
        BodyRow { v: velocity(b.linear_velocity), w: velocity(b.angular_velocity), ..BodyRow::AT_REST }
    };
    world.bodies.par_iter().with_min_len(CHUNK).enumerate().map(state).collect_into_vec(&mut problem.bodies);
    let mass = |(i, b): (usize, &Body)| {
        if b.kind != BodyKind::Dynamic || rests(i) {
            return MassRow::default();
        }
        let i = b.mass.world_inverse_inertia(b.rotation);
        MassRow {
            inv_inertia_x: [i.x_axis.x, i.x_axis.y, i.x_axis.z],
            inv_inertia_yz: [i.y_axis.y, i.y_axis.z, i.z_axis.z],
            inv_mass: 1.0 / b.mass.mass,
            acceleration: (world.gravity + b.force / b.mass.mass).to_array(),
            ..MassRow::default()
        }
    };
    world.bodies.par_iter().with_min_len(CHUNK).enumerate().map(mass).collect_into_vec(&mut problem.masses);
    problem.inertias.clear();
    if config.gyroscopic {
        let turns = |b: &Body| b.kind == BodyKind::Dynamic && b.mass.is_anisotropic();
        let row = |(i, b): (usize, &Body)| {
            let unit = b.mass.principal_inertia.max_element().inverse_power();
            let principal = b.mass.principal_inertia * unit;
            InertiaRow {
                principal: principal.to_array(),
                body: i as u32,
                inv_principal: principal.recip().to_array(),
                frame: (b.rotation * b.mass.principal_frame).to_array(),
                ..InertiaRow::default()
            }
        };
        problem.inertias.extend(world.bodies.iter().enumerate().filter(|&(i, b)| turns(b) && !rests(i)).map(row));
    }
}
