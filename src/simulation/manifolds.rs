//! The manifolds of a step for callers, with impulses in world axes.

use glam::Vec3;

use super::events::ColliderOf;
use super::stages::{Stages, collider_of};
use crate::collide::{MAX_POINTS, Manifold, NO_SLOT, Pair};
use crate::problem::ImpulseRow;
use crate::world::World;

/// The contact of two bodies over one pair of convex parts, after the last step.
///
/// ```
/// # use drystone::{Body, Listen, Reference, Shape, Simulation, SolverConfig, SolvedManifold, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(6.0).position(0.0, 0.5, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// # simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// # (0..20).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// let manifold: SolvedManifold = simulation.manifolds().next().expect("a ball on the floor");
/// assert_eq!((manifold.b.body, manifold.normal, manifold.points().len()), (ball, Vec3::Y, 1));
/// // 6 kg for a substep of 1/480 s.
/// assert_eq!(manifold.substeps, 8);
/// assert!((manifold.normal_impulse() - 6.0 * 9.81 / 480.0).abs() < 1e-3);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolvedManifold {
    /// The collider that the normal points away from.
    pub a: ColliderOf,
    /// The collider that the normal points to.
    pub b: ColliderOf,
    /// Unit normal from a to b, world axes.
    pub normal: Vec3,
    /// The color of the contact among those of its kind, or `None` if it has no color and is solved alone.
    pub color: Option<u8>,
    /// Compression of the contact springs when the surfaces just touch (m).
    pub preload: f32,
    /// Torsional impulse about the normal, with friction per manifold or spinning friction (N m s).
    pub twist_impulse: f32,
    /// Impulse of rolling friction on b in the last substep, about the tangents, world axes (N m s).
    pub rolling_impulse: Vec3,
    /// Friction impulse on b in the last substep, with friction per manifold, world axes (N s).
    pub friction_impulse: Vec3,
    /// Impulse on b over the whole step: normal and friction of all points, in world axes (N s). It is `None` if the
    /// simulation does not [`listen`](crate::Simulation::listen).
    pub summed: Option<Vec3>,
    /// Substeps of the step. Divide an impulse of one substep by the length of the substep for a force.
    pub substeps: u32,
    points: [SolvedPoint; MAX_POINTS],
    count: usize,
}

/// One contact point, after the last step.
///
/// ```
/// # use drystone::{Body, Listen, Reference, Shape, Simulation, SolverConfig, SolvedPoint, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(6.0).position(0.0, 0.5, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// # simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// # (0..20).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// let manifold = simulation.manifolds().next().expect("a ball on the floor");
/// let SolvedPoint { r_b, separation, normal_impulse, .. } = manifold.points()[0];
/// assert!(r_b.distance(Vec3::Y * -0.5) < 1e-3 && separation.abs() < 1e-3 && normal_impulse > 0.0);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolvedPoint {
    /// On the surface of a, in a's frame (m).
    pub anchor_a: Vec3,
    /// On the surface of b, in b's frame (m).
    pub anchor_b: Vec3,
    /// From the center of mass of a to the point midway between the surfaces, in world axes (m).
    pub r_a: Vec3,
    /// From the center of mass of b to that point (m).
    pub r_b: Vec3,
    /// Distance along the normal at the start of the step, negative for overlap (m).
    pub separation: f32,
    /// Normal impulse on b in the last substep (N s).
    pub normal_impulse: f32,
    /// Friction impulse on b in the last substep, in world axes (N s).
    pub friction_impulse: Vec3,
    /// Impulses of the whole step, or `None` if the simulation does not [`listen`](crate::Simulation::listen).
    pub summed: Option<Summed>,
}

/// The impulses of a step, summed over its substeps.
///
/// ```
/// # use drystone::{Body, Listen, Reference, Shape, Simulation, SolverConfig, Summed, World, glam::Vec3};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(6.0).position(0.0, 0.5, 0.0));
/// # let mut simulation = Simulation::new(world)?;
/// # simulation.listen(Listen { impulses: true, ..Listen::default() })?;
/// # (0..20).try_for_each(|_| simulation.step(1.0 / 60.0).map(drop))?;
/// let manifold = simulation.manifolds().next().expect("a ball on the floor");
/// let Summed { normal, friction } = manifold.points()[0].summed.expect("the simulation listens");
/// assert!((normal - 6.0 * 9.81 / 60.0).abs() < 1e-2 && friction.length() < 1e-3);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summed {
    /// Normal impulse on b (N s).
    pub normal: f32,
    /// Friction impulse on b, world axes (N s).
    pub friction: Vec3,
}

impl SolvedManifold {
    /// The contact points, 1 to 4.
    pub fn points(&self) -> &[SolvedPoint] {
        &self.points[..self.count]
    }

    /// Sum of the normal impulses of its points (N s).
    pub fn normal_impulse(&self) -> f32 {
        self.points().iter().map(|point| point.normal_impulse).sum()
    }
}

/// All manifolds that have rows, in the order of their pairs, without those of bodies that were removed since the step.
pub(super) fn of(stages: &Stages, world: &World) -> impl Iterator<Item = SolvedManifold> + Clone {
    let detector = &stages.detector;
    let is_there = |pair: &&Pair| [pair.body_a, pair.body_b].iter().all(|&body| detector.knows(world, body as usize));
    let pairs = detector.pairs().filter(is_there);
    let all = pairs.flat_map(|pair| pair.manifolds.iter().map(move |manifold| (pair, manifold)));
    let written = all.filter(|(_, manifold)| manifold.slot != NO_SLOT && !manifold.has_ended());
    written.map(move |(pair, manifold)| solved(stages, world, pair, manifold))
}

fn solved(stages: &Stages, world: &World, pair: &Pair, manifold: &Manifold) -> SolvedManifold {
    let Stages { contacts, problem, .. } = stages;
    let contact = &problem.contacts[manifold.slot as usize];
    let (tangent_1, tangent_2) = contact.tangents();
    let friction = |impulse: &ImpulseRow| tangent_1 * impulse.tangent_1 + tangent_2 * impulse.tangent_2;
    let (first, count) = (contact.first_point as usize, contact.point_count as usize);
    let mut points = [SolvedPoint::default(); MAX_POINTS];
    let rows = problem.points[first..first + count].iter().zip(&problem.impulses[first..]);
    for ((point, from), (row, impulse)) in points.iter_mut().zip(manifold.points()).zip(rows) {
        *point = SolvedPoint {
            anchor_a: from.anchor_a,
            anchor_b: from.anchor_b,
            r_a: from.r_a,
            r_b: from.r_b,
            separation: row.separation,
            normal_impulse: impulse.normal,
            friction_impulse: friction(impulse),
            summed: None,
        };
    }
    let mut summed = None;
    if !problem.totals.is_empty() {
        let totals = &problem.totals[first..first + count];
        for (point, total) in points.iter_mut().zip(totals) {
            point.summed = Some(Summed { normal: total.normal, friction: friction(total) });
        }
        summed = Some(problem.total_impulse(contact));
    }
    let patch = if problem.has_patches() { problem.impulses[first + count] } else { ImpulseRow::default() };
    let [a, b] =
        [(pair.body_a, pair.colliders[0]), (pair.body_b, pair.colliders[1])].map(|side| collider_of(world, side));
    SolvedManifold {
        substeps: stages.least_substeps() * (1.0 / contact.substep_share) as u32,
        a,
        b,
        normal: manifold.normal,
        color: contacts.color_of(manifold.slot),
        preload: contact.preload,
        twist_impulse: patch.normal,
        friction_impulse: if problem.has_friction_at_patches() { friction(&patch) } else { Vec3::ZERO },
        rolling_impulse: if problem.has_friction_at_patches() { Vec3::ZERO } else { friction(&patch) },
        summed,
        points,
        count,
    }
}
