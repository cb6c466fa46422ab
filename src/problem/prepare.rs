//! From bodies and manifolds to rows: arms, effective masses, impulses carried over.

use glam::Vec3;
use rayon::prelude::*;

use super::StepProblem;
use super::carry::{Carry, NO_ROW, Origin, Preload};
use super::contacts::{Chunk, ContactRows, Source, Writer};
use super::follow::StepScale;
use super::layout::{
    BodyRow, ContactRow, ConvergenceRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow, MomentumRow,
    Params, PointRow, Softness,
};
use super::softness::softness;
use crate::collide::Detector;
use crate::config::{FrictionAt, FrictionRule, SolverConfig, Stabilization};
use crate::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
use crate::math::Lane;
use crate::world::{BallJoint, Body, BodyKind, World};

/// Where each row came from: what carries rows over from step to step, and gives impulses back to manifolds.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// The contacts in the order of the pairs.
    pub(super) sources: Vec<Source>,
    /// Where each contact's row is.
    pub(super) row_of: Vec<u32>,
    /// The contacts for the graph, in the order of the pairs.
    pub(super) edges: Vec<Edge>,
    /// The coloring of this step's contacts.
    pub coloring: Coloring,
    /// Whether every manifold has a row for friction of its own.
    pub(super) patches: bool,
    /// The detection whose manifolds the rows are of.
    pub(super) seen: u64,
    /// Separation of each point when its manifold was computed, in the order of the rows (m).
    pub(super) computed: Vec<f32>,
    /// The rows of the step before, where they have to move.
    before: ContactRows,
    sources_before: Vec<Source>,
    edges_before: Vec<Edge>,
    /// The joints that the rows are of, in the order of the world, and as edges of their graph.
    pub(super) joints: Vec<BallJoint>,
    pub(super) joint_edges: Vec<Edge>,
    pub(super) are_joints_colored: bool,
    joint_coloring: Coloring,
    /// What impulses and preloads of the last step are proportional to; none before the first.
    pub(super) scale: Option<StepScale>,
    /// How the rows of contacts follow from those of the step before.
    pub carry: Carry,
    /// Which joint each row is of: those of bodies that are awake.
    pub(super) joint_rows: Vec<u32>,
    /// Impulse of each joint at the end of the step before.
    pub(super) joint_impulses: Vec<Vec3>,
}

/// Bodies that one task prepares at least.
const CHUNK: usize = 256;

impl Prepared {
    /// Gives every manifold a color. A manifold that is reused keeps its own; where nothing else touches than in the step
    /// before, all stay as they are.
    pub fn color(&mut self, world: &World, detector: &mut Detector, graph: &mut ConstraintGraph, max_colors: u32) {
        if detector.reshaped_in() <= self.seen {
            return;
        }
        std::mem::swap(&mut self.sources, &mut self.sources_before);
        std::mem::swap(&mut self.edges, &mut self.edges_before);
        self.sources.clear();
        self.edges.clear();
        let movable = |body: u32| if world.bodies[body as usize].kind == BodyKind::Dynamic { body } else { IMMOVABLE };
        for (part, pairs) in detector.pairs_mut().enumerate() {
            for (i, pair) in pairs.iter_mut().enumerate().filter(|(_, pair)| !pair.rests) {
                let before = pair.contact as usize;
                pair.contact = self.sources.len() as u32;
                for k in 0..pair.manifolds.len() {
                    let (source, edge) = if pair.computed_in > self.seen {
                        let manifold = &pair.manifolds[k];
                        let points = manifold.points().len() as u32;
                        let source = Source { world: 0, pair: 0, manifold: k as u32, points, row_before: None };
                        let [a, b] = [pair.body_a, pair.body_b].map(movable);
                        (source, Edge { a, b, color: manifold.color, rank: pair.rank() })
                    } else {
                        let row_before = Some(self.row_of[before + k]);
                        (Source { row_before, ..self.sources_before[before + k] }, self.edges_before[before + k])
                    };
                    self.sources.push(Source { world: part as u32, pair: i as u32, ..source });
                    self.edges.push(edge);
                }
            }
        }
        self.coloring = graph.color(world.bodies.len(), &mut self.edges, max_colors);
        self.row_of.resize(self.sources.len(), 0);
        for (row, &contact) in self.coloring.order.iter().enumerate() {
            self.row_of[contact as usize] = row as u32;
        }
    }

    /// Impulse of each joint on its body b at the end of the last step, world axes (N s).
    pub fn joint_impulses(&self) -> &[Vec3] {
        &self.joint_impulses
    }

    /// Gives every joint a color; joints and contacts share none.
    pub fn color_joints(&mut self, world: &World, graph: &mut ConstraintGraph, max_colors: u32) {
        if !self.are_joints_colored {
            self.joint_coloring = graph.color(world.bodies.len(), &mut self.joint_edges, max_colors);
            self.are_joints_colored = true;
        }
    }

    /// Writes the rows of a step of `dt` seconds into `problem`. Who is `asleep` stands in them as one that nothing moves.
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
            slop: if config.stabilization == Stabilization::Baumgarte { config.slop } else { 0.0 },
            relaxation: config.relaxation,
            tolerance: config.tolerance,
            ..Params::default()
        };
        problem.convergence = ConvergenceRow::default();
        problem.momentum = MomentumRow::default();
        problem.colors.clone_from(&self.coloring.offsets);
        problem.first_joint_color = problem.colors.len() as u32;
        self.patches = config.friction_at == FrictionAt::Manifold && config.friction != FrictionRule::None;
        self.prepare_joints(world, asleep, problem);
        self.prepare_contacts(world, detector, config, dt, problem);
        problem.params.point_count = problem.points.len() as u32;
        problem.params.joint_count = problem.joints.len() as u32;
    }

    fn prepare_joints(&mut self, world: &World, asleep: &[bool], problem: &mut StepProblem) {
        problem.joints.clear();
        problem.joint_impulses.clear();
        self.joint_rows.clear();
        // A joint holds bodies of one island, which are asleep together.
        let rests = |body: usize| asleep.get(body) == Some(&true);
        let moves = |body: usize| world.bodies[body].kind == BodyKind::Dynamic;
        let is_awake = |i: u32| {
            let joint = &world.joints[i as usize];
            // One of two bodies that nothing moves has no block to solve.
            (moves(joint.body_a) || joint.body_b.is_some_and(moves))
                && !(rests(joint.body_a) || joint.body_b.is_some_and(rests))
        };
        for color in self.joint_coloring.offsets.windows(2) {
            problem.colors.push(self.joint_rows.len() as u32);
            let own = &self.joint_coloring.order[color[0] as usize..color[1] as usize];
            self.joint_rows.extend(own.iter().filter(|&&i| is_awake(i)));
        }
        if self.joint_rows.is_empty() {
            problem.colors.truncate(problem.first_joint_color as usize);
            return;
        }
        problem.colors.push(self.joint_rows.len() as u32);
        let world_row = world.bodies.len() as u32;
        for &i in &self.joint_rows {
            let joint = &world.joints[i as usize];
            let [anchor_a, anchor_b] = world.anchors(joint);
            let arm = |body: usize, anchor: Vec3| (anchor - world.bodies[body].center_of_mass()).to_array();
            problem.joints.push(JointRow {
                r_a: arm(joint.body_a, anchor_a),
                body_a: joint.body_a as u32,
                r_b: joint.body_b.map_or([0.0; 3], |b| arm(b, anchor_b)),
                body_b: joint.body_b.map_or(world_row, |b| b as u32),
                gap: (anchor_b - anchor_a).to_array(),
                ..JointRow::default()
            });
            let linear = self.joint_impulses[i as usize].to_array();
            problem.joint_impulses.push(JointImpulseRow { linear, ..JointImpulseRow::default() });
        }
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
        let reshaped = detector.reshaped_in() > self.seen;
        if reshaped {
            self.before.exchange(problem, &mut self.computed);
            let total = self.lay_out(problem);
            problem.points.resize(total, PointRow::default());
            problem.impulses.resize(total, ImpulseRow::default());
            self.computed.resize(total, 0.0);
        }
        self.carry.approach =
            config.friction == FrictionRule::Slip || world.bodies.iter().any(|b| b.material.restitution > 0.0);
        self.carry.preload = Preload {
            movable_compliance: problem.params.movable.compliance(),
            fixed_compliance: problem.params.fixed.compliance(),
            share: 1.0 - 1.0 / (1.0 + config.preload_rate * dt),
            warm_start: config.warm_start.into(),
        };
        if self.carry.on_device {
            self.note_rows_before(detector);
        }
        let writer = Writer {
            world,
            detector,
            config,
            substep: problem.params.substep,
            bodies: &problem.bodies,
            masses: &problem.masses,
            carry: &self.carry,
            patches: self.patches,
            seen: self.seen,
            sources: &self.sources,
            before: reshaped.then_some(&self.before),
        };
        writer.write(Chunk {
            order: &self.coloring.order,
            contacts: &mut problem.contacts,
            points: &mut problem.points,
            impulses: &mut problem.impulses,
            computed: &mut self.computed,
        });
        self.seen = detector.detections();
    }

    /// Notes where the rows of each contact were in the step before.
    fn note_rows_before(&mut self, detector: &Detector) {
        let Carry { rows_before, computed, .. } = &mut self.carry;
        rows_before.clear();
        computed.clear();
        let reshaped = detector.reshaped_in() > self.seen;
        if !reshaped && detector.computed_in() <= self.seen {
            return;
        }
        for (row, &contact) in (0..).zip(&self.coloring.order) {
            let source = &self.sources[contact as usize];
            let pair = detector.pair(source.world, source.pair);
            if pair.computed_in > self.seen {
                let manifold = &pair.manifolds[source.manifold as usize];
                let mut origin = Origin { row, contact: manifold.row_before.unwrap_or(NO_ROW), points: [NO_ROW; 4] };
                for (before, point) in origin.points.iter_mut().zip(manifold.points()) {
                    *before = point.row_before.unwrap_or(NO_ROW);
                }
                computed.push(origin);
                rows_before.push(NO_ROW);
            } else {
                rows_before.push(if reshaped { source.row_before.unwrap_or(NO_ROW) } else { row });
            }
        }
        // What was computed touches nothing.
        if !reshaped && computed.is_empty() {
            rows_before.clear();
        }
    }

    /// Where the points of each contact begin; returns how many rows they are.
    fn lay_out(&self, problem: &mut StepProblem) -> usize {
        let order = &self.coloring.order;
        problem.contacts.resize(order.len(), ContactRow::default());
        let mut total = 0;
        for (row, &contact) in problem.contacts.iter_mut().zip(order) {
            row.first_point = total;
            row.point_count = self.sources[contact as usize].points;
            total += row.point_count + u32::from(self.patches);
        }
        total as usize
    }
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
