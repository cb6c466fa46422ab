//! From bodies and manifolds to rows: arms, effective masses, impulses carried over.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::StepProblem;
use super::layout::{BodyRow, ContactRow, ImpulseRow, InertiaRow, MassRow, Params, PointRow};
use super::softness::softness;
use crate::collide::{Manifold, ManifoldPoint, Pair};
use crate::config::{FrictionRule, SolverConfig};
use crate::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
use crate::world::{Body, BodyKind, World};

/// Which manifold each row came from: what `store` needs to give the impulses back.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// (pair, manifold) of each contact, in the order of the pairs.
    pub(super) contacts: Vec<(u32, u32)>,
    /// Where each row's contact stands in `contacts`, and where the contact's row is.
    pub(super) row_of: Vec<u32>,
    edges: Vec<Edge>,
    /// The coloring of this step.
    pub coloring: Coloring,
}

/// Contacts that one task prepares.
const CHUNK: usize = 256;

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

    /// Writes the rows of a step of `dt` seconds into `problem`.
    pub fn prepare(&self, world: &World, pairs: &[Pair], config: &SolverConfig, dt: f32, problem: &mut StepProblem) {
        prepare_bodies(world, config, problem);
        let h = dt / config.substeps as f32;
        let hertz = config.contact_frequency / h;
        let soft = |ratio: f32| softness(hertz * ratio, config.contact_damping, h, config.push_limit);
        problem.params = Params {
            substep: h,
            inverse_substep: 1.0 / h,
            restitution_threshold: config.restitution_threshold,
            inertia_count: problem.inertias.len() as u32,
            movable: soft(1.0),
            fixed: soft(config.fixed_contact_frequency_ratio),
            body_count: problem.bodies.len() as u32,
            ..Params::default()
        };
        problem.colors.clone_from(&self.coloring.offsets);
        self.prepare_contacts(world, pairs, config, problem);
    }

    fn prepare_contacts(&self, world: &World, pairs: &[Pair], config: &SolverConfig, problem: &mut StepProblem) {
        let order = &self.coloring.order;
        let source = |contact: u32| {
            let (i, k) = self.contacts[contact as usize];
            let pair = &pairs[i as usize];
            (pair, &pair.manifolds[k as usize])
        };
        problem.contacts.resize(order.len(), ContactRow::default());
        let mut total = 0;
        for (row, &contact) in problem.contacts.iter_mut().zip(order) {
            row.first_point = total;
            row.point_count = source(contact).1.points().len() as u32;
            total += row.point_count;
        }
        problem.points.resize(total as usize, PointRow::default());
        problem.impulses.resize(total as usize, ImpulseRow::default());

        // Chunks of contacts with the points that belong to them.
        let (mut points, mut impulses) = (&mut problem.points[..], &mut problem.impulses[..]);
        let mut chunks = Vec::with_capacity(order.len().div_ceil(CHUNK));
        for (rows, order) in problem.contacts.chunks_mut(CHUNK).zip(order.chunks(CHUNK)) {
            let count = rows.iter().map(|r| r.point_count as usize).sum();
            let (own_points, own_impulses);
            (own_points, points) = points.split_at_mut(count);
            (own_impulses, impulses) = impulses.split_at_mut(count);
            chunks.push((rows, order, own_points, own_impulses));
        }
        let masses = &problem.masses;
        chunks.into_par_iter().for_each(|(rows, order, points, impulses)| {
            let mut next = 0;
            for (row, &contact) in rows.iter_mut().zip(order) {
                let (pair, manifold) = source(contact);
                let bodies = [pair.body_a, pair.body_b].map(|i| &world.bodies[i as usize]);
                prepare_header(row, pair, manifold, bodies, config);
                let inverse = [pair.body_a, pair.body_b].map(|i| InverseMass::of(&masses[i as usize]));
                for p in manifold.points() {
                    points[next] = prepare_point(row, p, manifold, bodies, &inverse);
                    impulses[next] = if config.warm_start { carried_over(row, p) } else { ImpulseRow::default() };
                    next += 1;
                }
            }
        });
    }
}

fn prepare_bodies(world: &World, config: &SolverConfig, problem: &mut StepProblem) {
    let state = |b: &Body| {
        let moves = b.kind != BodyKind::Fixed;
        let velocity = |v: Vec3| if moves { v.to_array() } else { [0.0; 3] };
        BodyRow {
            v: velocity(b.linear_velocity),
            pad_v: 0.0,
            w: velocity(b.angular_velocity),
            pad_w: 0.0,
            dp: [0.0; 3],
            pad_dp: 0.0,
            dq: [0.0, 0.0, 0.0, 1.0],
        }
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
    row.normal = manifold.normal.to_array();
    row.tangent = manifold.normal.any_orthonormal_vector().to_array();
    row.friction = if config.friction == FrictionRule::None { 0.0 } else { material.friction };
    row.restitution = material.restitution;
    row.body_a = pair.body_a;
    row.body_b = pair.body_b;
}

fn carried_over(row: &ContactRow, p: &ManifoldPoint) -> ImpulseRow {
    let (tangent_1, tangent_2) = tangents(row);
    // Friction that a rule no longer allows is not carried over.
    let friction = if row.friction > 0.0 { p.friction_impulse } else { Vec3::ZERO };
    ImpulseRow {
        normal: p.normal_impulse,
        tangent_1: friction.dot(tangent_1),
        tangent_2: friction.dot(tangent_2),
        peak: 0.0,
    }
}

/// The two tangents of a row.
pub(super) fn tangents(row: &ContactRow) -> (Vec3, Vec3) {
    let tangent_1 = Vec3::from_array(row.tangent);
    (tangent_1, Vec3::from_array(row.normal).cross(tangent_1))
}

/// Inverse mass and inertia of one body.
struct InverseMass {
    mass: f32,
    inertia: Mat3,
}

impl InverseMass {
    fn of(row: &MassRow) -> Self {
        let ([xx, xy, xz], [yy, yz, zz]) = (row.inv_inertia_x, row.inv_inertia_yz);
        Self { mass: row.inv_mass, inertia: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]) }
    }

    /// Share of this body in the entry (d, e) of G M⁻¹ Gᵀ at arm `r`.
    fn entry(&self, r: Vec3, d: Vec3, e: Vec3) -> f32 {
        self.mass * d.dot(e) + r.cross(d).dot(self.inertia * r.cross(e))
    }
}

fn prepare_point(
    row: &ContactRow,
    p: &ManifoldPoint,
    manifold: &Manifold,
    [a, b]: [&Body; 2],
    [inverse_a, inverse_b]: &[InverseMass; 2],
) -> PointRow {
    let normal = manifold.normal;
    let (tangent_1, tangent_2) = tangents(row);
    let (r_a, r_b) = (p.r_a, p.r_b);
    let entry = |d: Vec3, e: Vec3| inverse_a.entry(r_a, d, e) + inverse_b.entry(r_b, d, e);
    let (s_11, s_22, s_12) = (entry(tangent_1, tangent_1), entry(tangent_2, tangent_2), entry(tangent_1, tangent_2));
    let largest = 0.5 * (s_11 + s_22 + ((s_11 - s_22).powi(2) + 4.0 * s_12 * s_12).sqrt());
    let velocity = |body: &Body, r: Vec3| match body.kind {
        BodyKind::Fixed => Vec3::ZERO,
        _ => body.linear_velocity + body.angular_velocity.cross(r),
    };
    PointRow {
        r_a: r_a.to_array(),
        separation: p.separation,
        r_b: r_b.to_array(),
        normal_mass: inverse_or_zero(entry(normal, normal)),
        tangent_mass: inverse_or_zero(largest),
        approach_velocity: (velocity(b, r_b) - velocity(a, r_a)).dot(normal),
        radius_a: manifold.radius_a,
        radius_b: manifold.radius_b,
    }
}

fn inverse_or_zero(x: f32) -> f32 {
    if x > 0.0 { 1.0 / x } else { 0.0 }
}
