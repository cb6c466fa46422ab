//! From bodies and manifolds to rows: arms, effective masses, impulses carried over.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::StepProblem;
use super::effective::{EffectiveMass, InverseMass};
use super::layout::{
    BodyRow, ContactRow, ConvergenceRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow, MomentumRow, Params,
    PointRow, Softness,
};
use super::softness::softness;
use super::weigh::{middle, weigh};
use crate::collide::{MAX_POINTS, Manifold, ManifoldPoint, Pair, PointMass};
use crate::config::{FrictionAt, FrictionRule, SolverConfig, Stabilization};
use crate::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
use crate::world::{BallJoint, Body, BodyKind, World};

/// Which manifold each row came from: what `store` needs to give the impulses back.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// (pair, manifold) of each contact, in the order of the pairs.
    pub(super) contacts: Vec<(u32, u32)>,
    /// Where each row's contact stands in `contacts`, and where the contact's row is.
    pub(super) row_of: Vec<u32>,
    edges: Vec<Edge>,
    /// The coloring of this step's contacts.
    pub coloring: Coloring,
    /// Whether every manifold has a row for friction of its own.
    pub(super) patches: bool,
    joint_edges: Vec<Edge>,
    pub(super) joint_coloring: Coloring,
    /// Impulse of each joint at the end of the step before.
    pub(super) joint_impulses: Vec<Vec3>,
}

/// Contacts that one task prepares, or pairs that it gives impulses back to.
pub(super) const CHUNK: usize = 256;

impl Prepared {
    /// Gives every manifold of `pairs` a color and remembers it there.
    pub fn color(&mut self, world: &World, pairs: &mut [Pair], graph: &mut ConstraintGraph, max_colors: u32) {
        let movable = |body: u32| if world.bodies[body as usize].kind == BodyKind::Dynamic { body } else { IMMOVABLE };
        self.contacts.clear();
        self.edges.clear();
        for (i, pair) in pairs.iter().enumerate() {
            let (a, b) = (movable(pair.body_a), movable(pair.body_b));
            for (k, manifold) in pair.manifolds.iter().enumerate() {
                self.contacts.push((i as u32, k as u32));
                self.edges.push(Edge { a, b, color: manifold.color });
            }
        }
        self.coloring = graph.color(world.bodies.len(), &mut self.edges, max_colors);
        for (&(i, k), edge) in self.contacts.iter().zip(&self.edges) {
            pairs[i as usize].manifolds[k as usize].color = edge.color;
        }
        self.row_of.clear();
        self.row_of.resize(self.contacts.len(), 0);
        for (row, &contact) in self.coloring.order.iter().enumerate() {
            self.row_of[contact as usize] = row as u32;
        }
    }

    /// Impulse of each joint on its body b at the end of the last step, world axes [N s].
    pub fn joint_impulses(&self) -> &[Vec3] {
        &self.joint_impulses
    }

    /// Gives every joint of the world a color; joints and contacts share none.
    pub fn color_joints(&mut self, world: &World, graph: &mut ConstraintGraph, max_colors: u32) {
        let movable = |b: usize| if world.bodies[b].kind == BodyKind::Dynamic { b as u32 } else { IMMOVABLE };
        self.joint_edges.truncate(world.joints.len());
        let fresh = &world.joints[self.joint_edges.len()..];
        let edge = |j: &BallJoint| Edge { a: movable(j.body_a), b: j.body_b.map_or(IMMOVABLE, movable), color: None };
        self.joint_edges.extend(fresh.iter().map(edge));
        self.joint_coloring = graph.color(world.bodies.len(), &mut self.joint_edges, max_colors);
        self.joint_impulses.resize(world.joints.len(), Vec3::ZERO);
    }

    /// Writes the rows of a step of `dt` seconds into `problem`.
    pub fn prepare(
        &mut self,
        world: &World,
        pairs: &mut [Pair],
        config: &SolverConfig,
        dt: f32,
        problem: &mut StepProblem,
    ) {
        prepare_bodies(world, config, problem);
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
        if !world.joints.is_empty() {
            problem.colors.extend(&self.joint_coloring.offsets);
        }
        self.patches = config.friction_at == FrictionAt::Manifold && config.friction != FrictionRule::None;
        self.prepare_joints(world, problem);
        weigh(pairs, &problem.masses, config.friction, self.patches);
        self.prepare_contacts(world, pairs, config, problem);
        problem.params.point_count = problem.points.len() as u32;
        problem.params.joint_count = problem.joints.len() as u32;
    }

    fn prepare_joints(&self, world: &World, problem: &mut StepProblem) {
        problem.joints.clear();
        problem.joint_impulses.clear();
        let world_row = world.bodies.len() as u32;
        for &i in &self.joint_coloring.order {
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

    fn prepare_contacts(&self, world: &World, pairs: &[Pair], config: &SolverConfig, problem: &mut StepProblem) {
        let order = &self.coloring.order;
        let source = |contact: u32| {
            let (i, k) = self.contacts[contact as usize];
            let pair = &pairs[i as usize];
            (pair, &pair.manifolds[k as usize])
        };
        problem.contacts.resize(order.len(), ContactRow::default());
        let patch = self.patches;
        let mut total = 0;
        for (row, &contact) in problem.contacts.iter_mut().zip(order) {
            row.first_point = total;
            row.point_count = source(contact).1.points().len() as u32;
            total += row.point_count + u32::from(patch);
        }
        problem.points.resize(total as usize, PointRow::default());
        problem.impulses.resize(total as usize, ImpulseRow::default());

        // Chunks of contacts with the points that belong to them.
        let (mut points, mut impulses) = (&mut problem.points[..], &mut problem.impulses[..]);
        let mut chunks = Vec::with_capacity(order.len().div_ceil(CHUNK));
        for (rows, order) in problem.contacts.chunks_mut(CHUNK).zip(order.chunks(CHUNK)) {
            let count = rows.iter().map(|r| r.point_count as usize + usize::from(patch)).sum();
            let (own_points, own_impulses);
            (own_points, points) = points.split_at_mut(count);
            (own_impulses, impulses) = impulses.split_at_mut(count);
            chunks.push((rows, order, own_points, own_impulses));
        }
        let (bodies, masses) = (&problem.bodies, &problem.masses);
        let h = problem.params.substep;
        chunks.into_par_iter().for_each(|(rows, order, points, impulses)| {
            // Headers first: they depend on nothing but their manifold, so the waits for memory overlap.
            for (row, &contact) in rows.iter_mut().zip(order) {
                let (pair, manifold) = source(contact);
                let bodies = [pair.body_a, pair.body_b].map(|i| &world.bodies[i as usize]);
                prepare_header(row, pair, manifold, bodies, config);
            }
            let mut next = 0;
            for (row, &contact) in rows.iter().zip(order) {
                let manifold = source(contact).1;
                let (a, b) = (row.body_a as usize, row.body_b as usize);
                let sides = Sides { bodies: [&bodies[a], &bodies[b]], masses: [&masses[a], &masses[b]] };
                let kept = manifold.masses.unwrap_or_default();
                let end = next + manifold.points().len();
                for ((p, kept), (point, impulse)) in
                    manifold.points().iter().zip(kept).zip(points[next..].iter_mut().zip(&mut impulses[next..]))
                {
                    *point = prepare_point(row, p, kept, &sides, h, config.friction);
                    *impulse = if config.warm_start { carried_over(row, p) } else { ImpulseRow::default() };
                }
                if patch {
                    points[end] = prepare_patch(kept[MAX_POINTS], &mut points[next..end]);
                    impulses[end] =
                        if config.warm_start { carried_over_patch(row, manifold) } else { ImpulseRow::default() };
                }
                next = end + usize::from(patch);
            }
        });
    }
}

/// How overlap is removed, for contacts of `ratio` times the frequency.
fn contact_softness(config: &SolverConfig, h: f32, ratio: f32) -> Softness {
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

fn prepare_bodies(world: &World, config: &SolverConfig, problem: &mut StepProblem) {
    let state = |b: &Body| {
        let moves = b.kind != BodyKind::Fixed;
        let velocity = |v: Vec3| if moves { v.to_array() } else { [0.0; 3] };
        BodyRow { v: velocity(b.linear_velocity), w: velocity(b.angular_velocity), ..BodyRow::AT_REST }
    };
    world.bodies.par_iter().with_min_len(CHUNK).map(state).collect_into_vec(&mut problem.bodies);
    let mass = |b: &Body| {
        if b.kind != BodyKind::Dynamic {
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
    world.bodies.par_iter().with_min_len(CHUNK).map(mass).collect_into_vec(&mut problem.masses);
    problem.inertias.clear();
    if config.gyroscopic {
        let turns = |b: &Body| b.kind == BodyKind::Dynamic && b.mass.is_anisotropic();
        let row = |(i, b): (usize, &Body)| InertiaRow {
            principal: b.mass.principal_inertia.to_array(),
            body: i as u32,
            inv_principal: b.mass.principal_inertia.recip().to_array(),
            frame: (b.rotation * b.mass.principal_frame).to_array(),
            ..InertiaRow::default()
        };
        problem.inertias.extend(world.bodies.iter().enumerate().filter(|(_, b)| turns(b)).map(row));
    }
}

fn prepare_header(row: &mut ContactRow, pair: &Pair, manifold: &Manifold, [a, b]: [&Body; 2], config: &SolverConfig) {
    let material = a.material.combine(b.material);
    *row = ContactRow {
        friction: if config.friction == FrictionRule::None { 0.0 } else { material.friction },
        restitution: material.restitution,
        body_a: pair.body_a,
        body_b: pair.body_b,
        first_point: row.first_point,
        point_count: row.point_count,
        radius_a: manifold.radius_a,
        radius_b: manifold.radius_b,
        ..ContactRow::framed(manifold.normal)
    };
}

fn carried_over(row: &ContactRow, p: &ManifoldPoint) -> ImpulseRow {
    let (tangent_1, tangent_2) = row.tangents();
    // Friction that a rule no longer allows is not carried over.
    let friction = if row.friction > 0.0 { p.friction_impulse } else { Vec3::ZERO };
    ImpulseRow {
        normal: p.normal_impulse,
        tangent_1: friction.dot(tangent_1),
        tangent_2: friction.dot(tangent_2),
        peak: 0.0,
    }
}

fn carried_over_patch(row: &ContactRow, manifold: &Manifold) -> ImpulseRow {
    let (tangent_1, tangent_2) = row.tangents();
    ImpulseRow {
        normal: manifold.twist_impulse,
        tangent_1: manifold.friction_impulse.dot(tangent_1),
        tangent_2: manifold.friction_impulse.dot(tangent_2),
        peak: 0.0,
    }
}

/// The rows of the two bodies of a contact.
struct Sides<'a> {
    bodies: [&'a BodyRow; 2],
    masses: [&'a MassRow; 2],
}

fn prepare_point(
    row: &ContactRow,
    p: &ManifoldPoint,
    kept: PointMass,
    Sides { bodies: [a, b], masses }: &Sides,
    h: f32,
    rule: FrictionRule,
) -> PointRow {
    let (r_a, r_b) = (p.r_a, p.r_b);
    let velocity = |body: &BodyRow, r: Vec3| Vec3::from_array(body.v) + Vec3::from_array(body.w).cross(r);
    let u = velocity(b, r_b) - velocity(a, r_a);
    let normal = Vec3::from_array(row.normal);
    let [pull_a, pull_b] = masses.map(|m| Vec3::from_array(m.acceleration));
    let pull = (pull_b - pull_a).dot(normal);
    let (tangent_1, tangent_2) = row.tangents();
    // A point that does not slip yet takes the first tangent.
    let slip = Vec2::new(u.dot(tangent_1), u.dot(tangent_2)).try_normalize().unwrap_or(Vec2::X);
    let tangent_mass = if rule == FrictionRule::Slip {
        let effective = EffectiveMass { inverse: &masses.map(InverseMass::of), row };
        effective.along(r_a, r_b, tangent_1 * slip.x + tangent_2 * slip.y)
    } else {
        kept.tangent
    };
    PointRow {
        r_a: r_a.to_array(),
        separation: p.separation,
        r_b: r_b.to_array(),
        normal_mass: kept.normal,
        tangent_mass,
        approach_velocity: velocity_at_impact(u.dot(normal), pull, p.separation, h, row.restitution),
        slip_1: slip.x,
        slip_2: slip.y,
    }
}

/// Normal velocity whose opposite, times the restitution `e`, gives back the energy of the approach.
///
/// `vn` is the normal velocity when the step begins, `pull` the relative acceleration along the normal, `gap` the distance
/// still to go and `h` the substep. Two corrections: what the surfaces gain on the way, and that the velocities of the
/// integrator stand half a substep ahead of the parabola that its positions lie on, before the bounce and after it.
/// Without them a perfectly elastic ball that fell 5 m lost 2.3 % of its energy in 20 s at steps of 1 ms.
fn velocity_at_impact(vn: f32, pull: f32, gap: f32, h: f32, e: f32) -> f32 {
    if vn >= 0.0 || e == 0.0 {
        return vn;
    }
    let ahead = 0.5 * pull * h;
    let approach = (vn + ahead).min(0.0);
    let meeting = (approach * approach - 2.0 * (pull * gap).min(0.0)).sqrt();
    -(meeting - ahead / e)
}

/// The row that stands for the friction of all `points`, which learn how far from it they are.
fn prepare_patch(kept: PointMass, points: &mut [PointRow]) -> PointRow {
    let arms = |arm: fn(&PointRow) -> [f32; 3]| middle(points.iter().map(|p| Vec3::from_array(arm(p))));
    let (r_a, r_b) = (arms(|p| p.r_a), arms(|p| p.r_b));
    for p in points.iter_mut() {
        p.slip_1 = Vec3::from_array(p.r_a).distance(r_a);
    }
    PointRow {
        r_a: r_a.to_array(),
        r_b: r_b.to_array(),
        normal_mass: kept.normal,
        tangent_mass: kept.tangent,
        ..PointRow::default()
    }
}
