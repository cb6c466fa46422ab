//! The first impulses and preloads of a structure that is built in place.
//!
//! A sweep passes a load on by one contact. A tall structure would therefore sink in and rise again before its foot
//! carries the load. Statics gives the loads before the first step. It goes through the bodies from the top. Each body
//! passes its weight, and the load on it, to the points that it rests on ([`Balance::of`]). A body without a
//! balance of forces is about to fall. It begins without impulses, and so does everything that rests on it.
//!
//! A body is new if it lies still and has only new contacts. In the first step these are all bodies, later those that
//! the caller places. Old bodies beneath them pass the load on, in addition to their own impulses. Derivation:
//! docs/derivation.md.

mod bearing;

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::config::{FrictionRule, SolverConfig, Stabilization};
use crate::constants::{MAX_ROUNDS, MIN_RISE};
use crate::problem::{BodyRow, ContactRow, ContactRows, PointRow, StepProblem};
use crate::world::{Body, World};
use bearing::{Balance, Point, Wrench};

/// Gives impulses and preloads at rest to the contacts of new bodies, and to those that carry them. The rows must be
/// written. `substep` is the length of a substep of class 0 (s). Returns the bodies without a balance of forces that
/// lie on movable bodies.
pub(crate) fn begin(
    world: &World,
    config: &SolverConfig,
    substep: f32,
    contacts: &ContactRows,
    problem: &mut StepProblem,
) -> Vec<u32> {
    let is_weightless = (0..world.world_count()).all(|part| world.gravity_of(part) == Vec3::ZERO);
    if !config.warm_start || is_weightless || !contacts.new_bodies().contains(&true) {
        return Vec::new();
    }
    let mut structure = Structure::new(world, config, substep, contacts, problem);
    if !structure.bearings.is_empty() && (0..MAX_ROUNDS).any(|_| structure.hand_down(contacts.new_bodies(), problem)) {
        structure.write(config, substep, contacts, problem);
    }
    structure.unbalanced
}

/// A contact through which one body supports another.
#[derive(Clone, Copy)]
struct Bearing {
    row: u32,
    upper: u32,
    lower: u32,
    /// 1 if the upper body is b of the row, otherwise -1. The impulses of a row act on b.
    sign: f64,
}

/// The bodies that rest on others, and the contacts that support them.
struct Structure {
    /// The contacts, grouped by upper body.
    bearings: Vec<Bearing>,
    /// The first bearing of each upper body.
    bearings_of: Vec<u32>,
    /// The first point of each bearing.
    points_of: Vec<u32>,
    /// Forces on the upper bodies along the axes of the points (N).
    forces: Vec<[f64; 3]>,
    /// Bodies that begin without impulses.
    falls: Vec<bool>,
    /// The falling bodies without a balance of forces that lie on movable bodies.
    unbalanced: Vec<u32>,
    /// The sag of each body under its own weight in class 0 (m). Surfaces up to this distance apart count as touching.
    /// A gravity scale below 1 counts as 1.
    sags: Vec<f64>,
    has_friction: bool,
}

impl Structure {
    fn new(world: &World, config: &SolverConfig, substep: f32, contacts: &ContactRows, problem: &StepProblem) -> Self {
        let bodies = problem.bodies.len();
        let omega = TAU * f64::from(config.contact_frequency) / f64::from(substep);
        let gravities: Vec<DVec3> = (0..world.world_count()).map(|part| world.gravity_of(part).as_dvec3()).collect();
        let gravity_at = |body: u32| gravities.get(*world.bodies.worlds().get(body as usize)? as usize).copied();
        let sag_of = |(&part, body): (&u32, &Body)| {
            let gravity = gravities[part as usize].length() * f64::from(body.gravity_scale.abs().max(1.0));
            gravity / (omega * omega)
        };
        let sags = world.bodies.worlds().iter().zip(&world.bodies).map(sag_of).collect();
        let bearing = |&row: &u32| {
            let gravity =
                gravity_at(problem.contacts[row as usize].body_a).filter(|gravity| *gravity != DVec3::ZERO)?;
            // A free body reaches this speed in a substep, so a slower body has a support.
            bearing(row, gravity, gravity.length() * f64::from(substep), problem)
        };
        let mut bearings: Vec<Bearing> = contacts.coloring.order.iter().filter_map(bearing).collect();
        bearings.sort_unstable_by_key(|bearing| (bearing.upper, bearing.row));
        let mut bearings_of = vec![0; bodies + 1];
        bearings.iter().for_each(|bearing| bearings_of[bearing.upper as usize + 1] += 1);
        (0..bodies).for_each(|i| bearings_of[i + 1] += bearings_of[i]);
        let mut points_of = vec![0];
        points_of.extend(bearings.iter().scan(0, |end, bearing| {
            *end += problem.contacts[bearing.row as usize].point_count;
            Some(*end)
        }));
        let mut falls = vec![false; bodies];
        for joint in world.joints.iter().filter(|joint| !joint.holds_nothing()) {
            let (a, b) = joint.indices();
            falls[a] = true;
            b.into_iter().for_each(|b| falls[b] = true);
        }
        let forces = vec![[0.0; 3]; points_of[bearings.len()] as usize];
        let has_friction = !matches!(config.friction_rule(), FrictionRule::None | FrictionRule::Slip);
        Self { bearings, bearings_of, points_of, forces, falls, unbalanced: Vec::new(), sags, has_friction }
    }

    fn bearings_of(&self, upper: u32) -> Range<usize> {
        self.bearings_of[upper as usize] as usize..self.bearings_of[upper as usize + 1] as usize
    }

    fn points_of(&self, bearings: Range<usize>) -> Range<usize> {
        self.points_of[bearings.start] as usize..self.points_of[bearings.end] as usize
    }

    /// Writes the points of the bearings of one upper body.
    fn write_points(&self, bearings: Range<usize>, is_new: bool, problem: &StepProblem, points: &mut Vec<Point>) {
        points.clear();
        for bearing in &self.bearings[bearings] {
            let contact = &problem.contacts[bearing.row as usize];
            let reach = self.sags[bearing.upper as usize] * f64::from(contact.substep_share).powi(2);
            let (tangent_1, tangent_2) = contact.tangents();
            let axes = [contact.normal.into(), tangent_1, tangent_2].map(|axis| axis.as_dvec3() * bearing.sign);
            let (rows, impulses) = (points_of_row(contact, &problem.points), points_of_row(contact, &problem.impulses));
            let manifold = points.len() as u32;
            points.extend(rows.iter().zip(impulses).map(|(row, impulse)| Point {
                arm: arms(row, bearing).0,
                axes,
                mass: row.normal_mass.into(),
                friction: if self.has_friction { contact.friction.into() } else { 0.0 },
                manifold,
                bears: if is_new { f64::from(row.separation.abs()) <= reach } else { impulse.normal > 0.0 },
            }));
        }
    }

    /// Passes the weights of new bodies down. Returns false if more bodies fall because they rest on a falling body.
    /// The caller then repeats it without their loads.
    fn hand_down(&mut self, is_new: &[bool], problem: &StepProblem) -> bool {
        let mut loads = vec![Wrench::default(); is_new.len()];
        for ((load, mass), _) in loads.iter_mut().zip(&problem.masses).zip(is_new).filter(|(_, is_new)| **is_new) {
            load.force = Vec3::from_array(mass.acceleration).as_dvec3() / f64::from(mass.inv_mass);
        }
        let is_movable = |body: u32| problem.masses[body as usize].inv_mass > 0.0;
        let mut above = vec![0_u32; is_new.len()];
        self.bearings.iter().for_each(|bearing| above[bearing.lower as usize] += 1);
        let mut ready: Vec<u32> =
            (0..above.len() as u32).filter(|&body| is_movable(body) && above[body as usize] == 0).collect();
        let mut is_done = vec![false; above.len()];
        let (mut balance, mut own_points) = (Balance::default(), Vec::new());
        self.forces.fill([0.0; 3]);
        while let Some(upper) = ready.pop() {
            let body = upper as usize;
            let own = self.bearings_of(upper);
            self.write_points(own.clone(), is_new[body], problem, &mut own_points);
            is_done[body] = true;
            if !self.falls[body] && loads[body] != Wrench::default() {
                match balance.of(&loads[body], &own_points) {
                    Some(forces) => {
                        let points = self.points_of(own.clone());
                        self.forces[points].copy_from_slice(forces);
                    }
                    None => {
                        self.falls[body] = true;
                        if self.bearings[own.clone()].iter().any(|bearing| is_movable(bearing.lower)) {
                            self.unbalanced.push(upper);
                        }
                    }
                }
            }
            let mut points = own_points.iter();
            for i in own {
                let bearing = self.bearings[i];
                let lower = bearing.lower as usize;
                let rows = points_of_row(&problem.contacts[bearing.row as usize], &problem.points);
                for ((force, point), row) in self.forces[self.points_of(i..i + 1)].iter().zip(&mut points).zip(rows) {
                    loads[lower].add(-point.force(force), arms(row, &bearing).1);
                }
                above[lower] -= 1;
                if above[lower] == 0 && is_movable(bearing.lower) {
                    ready.push(bearing.lower);
                }
            }
        }
        // Bodies that support each other in a circle are never ready.
        for (body, is_done) in (0..).zip(is_done) {
            self.falls[body as usize] |= !is_done && is_movable(body);
        }
        !self.let_go()
    }

    /// Lets everything fall that rests on falling bodies, and returns whether there was anything.
    fn let_go(&mut self) -> bool {
        let mut any = false;
        loop {
            let mut more = false;
            for i in 0..self.bearings.len() {
                let Bearing { upper, lower, .. } = self.bearings[i];
                let bears = self.forces[self.points_of(i..i + 1)].iter().any(|force| force[0] > 0.0);
                if bears && self.falls[lower as usize] && !self.falls[upper as usize] {
                    self.falls[upper as usize] = true;
                    more = true;
                }
            }
            any |= more;
            if !more {
                return any;
            }
        }
    }

    /// Adds the impulses of a substep and the preloads to the rows.
    fn write(&self, config: &SolverConfig, substep: f32, contacts: &ContactRows, problem: &mut StepProblem) {
        let has_preloads = config.stabilization == Stabilization::Soft && config.preload_rate > 0.0;
        let is_at_patch = problem.has_friction_at_patches();
        for (i, bearing) in self.bearings.iter().enumerate() {
            let forces = &self.forces[self.points_of(i..i + 1)];
            if forces.iter().all(|force| force[0] == 0.0) {
                continue;
            }
            let are_movable =
                [bearing.upper, bearing.lower].map(|body| problem.masses[body as usize].inv_mass > 0.0) == [true; 2];
            let contact = &mut problem.contacts[bearing.row as usize];
            let length = f64::from(substep * contact.substep_share);
            let rows = points_of_row(contact, &problem.points);
            let first = contact.first_point as usize;
            let (impulses, patch) = problem.impulses[first..].split_at_mut(forces.len());
            let (mut pressed, mut mass, mut apart) = (0.0, 0.0, 0.0);
            for ((impulse, force), row) in impulses.iter_mut().zip(forces).zip(rows) {
                let [normal, tangent_1, tangent_2] = force.map(|force| (force * length) as f32);
                impulse.normal += normal;
                let friction = if is_at_patch { &mut patch[0] } else { impulse };
                friction.tangent_1 += tangent_1;
                friction.tangent_2 += tangent_2;
                pressed += normal;
                mass += row.normal_mass;
                apart += row.normal_mass * row.separation;
            }
            if has_preloads {
                // The preload keeps the present separation.
                let apart = if contacts.new_bodies()[bearing.upper as usize] { apart } else { 0.0 };
                let yielding = contacts.carry.preload.yielding(contact.substep_share, are_movable, pressed);
                contact.preload += (yielding + apart) / mass;
            }
        }
    }
}

/// The contact in a row as a bearing, if one of its bodies lies on the other.
fn bearing(row: u32, gravity: DVec3, slow: f64, problem: &StepProblem) -> Option<Bearing> {
    let contact = &problem.contacts[row as usize];
    let (a, b) = (contact.body_a, contact.body_b);
    let rise = -Vec3::from_array(contact.normal).as_dvec3().dot(gravity.normalize());
    let (upper, lower, sign) = if rise > 0.0 { (b, a, 1.0) } else { (a, b, -1.0) };
    let is_slow = |body: u32, arm: [f32; 3]| {
        let row: &BodyRow = &problem.bodies[body as usize];
        let velocity = Vec3::from_array(row.v) + Vec3::from_array(row.w).cross(Vec3::from_array(arm));
        let most = if problem.masses[body as usize].inv_mass > 0.0 { slow } else { 0.0 };
        f64::from(velocity.length()) <= most
    };
    let point = &problem.points[contact.first_point as usize];
    let bears = rise.abs() >= MIN_RISE && problem.masses[upper as usize].inv_mass > 0.0;
    (bears && is_slow(a, point.r_a) && is_slow(b, point.r_b)).then_some(Bearing { row, upper, lower, sign })
}

/// The arms of a point on the upper and on the lower body.
fn arms(row: &PointRow, bearing: &Bearing) -> (DVec3, DVec3) {
    let [a, b] = [row.r_a, row.r_b].map(|arm| Vec3::from_array(arm).as_dvec3());
    if bearing.sign > 0.0 { (b, a) } else { (a, b) }
}

fn points_of_row<'a, T>(contact: &ContactRow, rows: &'a [T]) -> &'a [T] {
    &rows[contact.first_point as usize..][..contact.point_count as usize]
}
