//! The rows of contacts: written once from a manifold, and carried from step to step while the manifold is reused.
//!
//! Normal, tangents, arms and effective masses of a reused manifold stay, and so do its impulses; only the separations
//! follow the bodies. The bodies of a reused manifold turned by 0.03 rad at most, and unequal moments of inertia turned with
//! them: what that changes in the masses is left out, as it is in the arms.

use glam::{Vec2, Vec3};

use super::StepProblem;
use super::carry::{Carry, preloaded};
use super::effective::{EffectiveMass, InverseMass};
use super::layout::{BodyRow, ContactRow, ImpulseRow, MassRow, PointRow};
use crate::collide::{Detector, Manifold, ManifoldPoint, Motion, Pair};
use crate::config::{FrictionRule, SolverConfig};
use crate::math;
use crate::world::World;

/// Where a contact comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Source {
    /// World of the pair.
    pub world: u32,
    /// Place of the pair among those of its world.
    pub pair: u32,
    /// Which manifold of the pair.
    pub manifold: u32,
    /// How many points it has.
    pub points: u32,
    /// Its row in the step before; none if the manifold was computed since.
    pub row_before: Option<u32>,
}

/// The rows of contacts that belong together.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactRows {
    contacts: Vec<ContactRow>,
    points: Vec<PointRow>,
    impulses: Vec<ImpulseRow>,
    computed: Vec<f32>,
}

impl ContactRows {
    /// Takes the rows of a problem, and gives it memory that it can write new ones to.
    pub fn exchange(&mut self, problem: &mut StepProblem, computed: &mut Vec<f32>) {
        std::mem::swap(&mut self.contacts, &mut problem.contacts);
        std::mem::swap(&mut self.points, &mut problem.points);
        std::mem::swap(&mut self.impulses, &mut problem.impulses);
        std::mem::swap(&mut self.computed, computed);
    }
}

/// Some neighboring contacts with the rows that are theirs.
pub(super) struct Chunk<'a> {
    /// Which contact each row is of.
    pub order: &'a [u32],
    pub contacts: &'a mut [ContactRow],
    pub points: &'a mut [PointRow],
    pub impulses: &'a mut [ImpulseRow],
    /// Separation of each point when its manifold was computed.
    pub computed: &'a mut [f32],
}

impl Chunk<'_> {
    /// The two halves.
    fn split(&mut self) -> [Chunk<'_>; 2] {
        let middle = self.order.len() / 2;
        let points = (self.contacts[middle].first_point - self.contacts[0].first_point) as usize;
        let (order, order_2) = self.order.split_at(middle);
        let (contacts, contacts_2) = self.contacts.split_at_mut(middle);
        let (points_1, points_2) = self.points.split_at_mut(points);
        let (impulses, impulses_2) = self.impulses.split_at_mut(points);
        let (computed, computed_2) = self.computed.split_at_mut(points);
        let half = |order, contacts, points, impulses, computed| Chunk { order, contacts, points, impulses, computed };
        [
            half(order, contacts, points_1, impulses, computed),
            half(order_2, contacts_2, points_2, impulses_2, computed_2),
        ]
    }
}

/// What the pair of a contact says to its rows.
#[derive(Clone, Copy, Default)]
struct Found {
    /// Whether its manifolds were computed since the rows were written.
    is_new: bool,
    motion: Motion,
}

/// Contacts that one task writes at most.
const CHUNK: usize = 256;

/// What the rows of contacts are written from.
pub(super) struct Writer<'a> {
    pub world: &'a World,
    pub detector: &'a Detector,
    pub config: &'a SolverConfig,
    /// Length of a substep (s).
    pub substep: f32,
    pub bodies: &'a [BodyRow],
    pub masses: &'a [MassRow],
    /// What preloads follow from, and whether a device sees to them.
    pub carry: &'a Carry,
    /// Whether a patch follows the points of every contact.
    pub patches: bool,
    /// The detection whose manifolds have rows already.
    pub seen: u64,
    pub sources: &'a [Source],
    /// The rows of the step before, if they do not stand in their places already.
    pub before: Option<&'a ContactRows>,
}

impl Writer<'_> {
    /// Writes all rows, on all threads.
    pub fn write(&self, mut chunk: Chunk) {
        if chunk.order.len() > CHUNK {
            let [first, second] = chunk.split();
            rayon::join(|| self.write(first), || self.write(second));
            return;
        }
        // What is far away in memory first: these reads wait for nothing, and so for each other only.
        let mut found = [Found::default(); CHUNK];
        for (found, &contact) in found.iter_mut().zip(chunk.order) {
            let source = &self.sources[contact as usize];
            let pair = self.detector.pair(source.world, source.pair);
            *found = Found { is_new: pair.computed_in > self.seen, motion: *pair.motion() };
        }
        let patch = usize::from(self.patches);
        let mut next = 0;
        for ((row, &contact), found) in chunk.contacts.iter_mut().zip(chunk.order).zip(&found) {
            let source = &self.sources[contact as usize];
            let own = next..next + source.points as usize + patch;
            next = own.end;
            let (points, impulses) = (&mut chunk.points[own.clone()], &mut chunk.impulses[own.clone()]);
            let computed = &mut chunk.computed[own.clone()];
            if found.is_new {
                let pair = self.detector.pair(source.world, source.pair);
                let manifold = &pair.manifolds[source.manifold as usize];
                self.write_header(row, pair, manifold);
                self.write_points(row, manifold, &found.motion, points, impulses, computed);
            } else {
                if let (Some(before), Some(from)) = (self.before, source.row_before) {
                    let header = &before.contacts[from as usize];
                    *row = ContactRow { first_point: row.first_point, ..*header };
                    let from = header.first_point as usize..header.first_point as usize + own.len();
                    points.copy_from_slice(&before.points[from.clone()]);
                    impulses.copy_from_slice(&before.impulses[from.clone()]);
                    computed.copy_from_slice(&before.computed[from]);
                }
                self.refresh_points(row, &found.motion, points, computed);
            }
            // Where they are on a device, the kernel begin_contacts does this.
            if !self.carry.on_device {
                row.preload = self.preload(row, points, impulses);
                points[..row.point_count as usize].iter_mut().for_each(|point| point.separation -= row.preload);
                let warm_start = self.carry.preload.warm_start != 0;
                impulses
                    .iter_mut()
                    .for_each(|i| *i = if warm_start { ImpulseRow { peak: 0.0, ..*i } } else { ImpulseRow::default() });
            }
        }
    }

    fn write_header(&self, row: &mut ContactRow, pair: &Pair, manifold: &Manifold) {
        let [a, b] = [pair.body_a, pair.body_b].map(|i| &self.world.bodies[i as usize]);
        let material = a.material.combine(b.material);
        *row = ContactRow {
            friction: if self.config.friction == FrictionRule::None { 0.0 } else { material.friction },
            restitution: material.restitution,
            body_a: pair.body_a,
            body_b: pair.body_b,
            first_point: row.first_point,
            point_count: row.point_count,
            radius_a: manifold.radius_a,
            radius_b: manifold.radius_b,
            preload: manifold.preload,
            ..ContactRow::framed(manifold.normal)
        };
    }

    /// Writes the rows of a manifold that was computed anew.
    fn write_points(
        &self,
        row: &ContactRow,
        manifold: &Manifold,
        motion: &Motion,
        points: &mut [PointRow],
        impulses: &mut [ImpulseRow],
        computed: &mut [f32],
    ) {
        let inverse = [row.body_a, row.body_b].map(|i| InverseMass::of(&self.masses[i as usize]));
        let effective = EffectiveMass { inverse: &inverse, row };
        let from = manifold.points();
        for (((p, point), impulse), computed) in from.iter().zip(&mut *points).zip(&mut *impulses).zip(&mut *computed) {
            let tangent_mass = match self.config.friction {
                FrictionRule::Box | FrictionRule::Disc => effective.tangent(p.r_a, p.r_b),
                FrictionRule::None | FrictionRule::Slip => 0.0,
            };
            *computed = p.computed_separation;
            *point = PointRow {
                r_a: p.r_a.to_array(),
                r_b: p.r_b.to_array(),
                normal_mass: effective.normal(p.r_a, p.r_b),
                tangent_mass,
                ..PointRow::default()
            };
            *impulse = carried_over(row, p);
        }
        self.refresh_points(row, motion, points, computed);
        if self.patches {
            let (points, patch) = points.split_at_mut(from.len());
            patch[0] = patch_of(&effective, points);
            impulses[from.len()] = carried_over_patch(row, manifold);
        }
    }

    /// Brings the separations of a manifold to where the bodies are, from those that were computed.
    fn refresh_points(&self, row: &ContactRow, motion: &Motion, points: &mut [PointRow], computed: &[f32]) {
        let movement = motion.along(row.normal, [row.radius_a, row.radius_b]);
        for (point, computed) in points[..row.point_count as usize].iter_mut().zip(computed) {
            point.separation = computed + movement.between(math::Vec3::load(point.r_a), math::Vec3::load(point.r_b));
            self.approach(row, point);
        }
    }

    /// How much a contact is preloaded in this step, by the impulses that it bore in the step before.
    fn preload(&self, row: &ContactRow, points: &[PointRow], impulses: &[ImpulseRow]) -> f32 {
        let both = [row.body_a, row.body_b].iter().all(|&body| self.masses[body as usize].inv_mass > 0.0);
        let (mut pressed, mut mass) = (0.0, 0.0);
        for (point, impulse) in points[..row.point_count as usize].iter().zip(impulses) {
            pressed += impulse.normal;
            mass += point.normal_mass;
        }
        preloaded(&self.carry.preload, row.preload, both, pressed, mass)
    }

    /// What a row knows of the velocities when the step begins: that of the approach where it may bounce, and the direction
    /// of the slip where friction has one only.
    fn approach(&self, row: &ContactRow, point: &mut PointRow) {
        if !self.carry.approach {
            return;
        }
        let (r_a, r_b) = (Vec3::from_array(point.r_a), Vec3::from_array(point.r_b));
        let [a, b] = [row.body_a, row.body_b].map(|i| &self.bodies[i as usize]);
        let masses = [row.body_a, row.body_b].map(|i| &self.masses[i as usize]);
        let velocity = |body: &BodyRow, r: Vec3| Vec3::from_array(body.v) + Vec3::from_array(body.w).cross(r);
        let u = velocity(b, r_b) - velocity(a, r_a);
        let normal = Vec3::from_array(row.normal);
        let [pull_a, pull_b] = masses.map(|m| Vec3::from_array(m.acceleration));
        let pull = (pull_b - pull_a).dot(normal);
        point.approach_velocity =
            velocity_at_impact(u.dot(normal), pull, point.separation, self.substep, row.restitution);
        if self.config.friction == FrictionRule::Slip && !self.patches {
            let (tangent_1, tangent_2) = row.tangents();
            // A point that does not slip yet takes the first tangent.
            let slip = Vec2::new(u.dot(tangent_1), u.dot(tangent_2)).try_normalize().unwrap_or(Vec2::X);
            [point.slip_1, point.slip_2] = slip.to_array();
            let effective = EffectiveMass { inverse: &masses.map(InverseMass::of), row };
            point.tangent_mass = effective.along(r_a, r_b, tangent_1 * slip.x + tangent_2 * slip.y);
        }
    }
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
fn patch_of(effective: &EffectiveMass, points: &mut [PointRow]) -> PointRow {
    let middle = |arm: fn(&PointRow) -> [f32; 3]| {
        points.iter().map(|p| Vec3::from_array(arm(p))).sum::<Vec3>() / points.len() as f32
    };
    let (r_a, r_b) = (middle(|p| p.r_a), middle(|p| p.r_b));
    for p in points {
        p.slip_1 = Vec3::from_array(p.r_a).distance(r_a);
    }
    PointRow {
        r_a: r_a.to_array(),
        r_b: r_b.to_array(),
        normal_mass: effective.twist(),
        tangent_mass: effective.tangent(r_a, r_b),
        ..PointRow::default()
    }
}
