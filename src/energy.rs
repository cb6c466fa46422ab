//! The law that constraints make no energy. Contacts, joints, their springs, limits and preloads only pass energy on or take it: what a step adds
//! to the kinetic energy of an island is at most the work of gravity, of forces and of what the caller drives. Velocities that have more are brought
//! back to that energy; momentum stays where nothing outside holds the island.
//!
//! The work is that at mean velocities: of a constraint whose impulse J changes velocities from v to v', J·(v + v')/2, which is what it adds to
//! the kinetic energy. Springs, preloads and pushes move bodies by velocities that the step takes back before it ends, so that no way that they open
//! counts here; `push_limit` bounds those. Derivation: docs/derivation.md, section 9.

use glam::{DVec3, Quat, Vec3};
use rayon::prelude::*;

use crate::graph::Islands;
use crate::math::rotation::product;
use crate::problem::{ContactRow, StepProblem};
use crate::world::{Body, BodyKind, Drive, World};

/// The share of its kinetic energy that an island may regain of what it lost, and the share of the weight of a body over its size.
const REGAINED: f64 = 1e-3;
const ROUNDING: f64 = 1e-6;

/// What each body may regain (J), and what a step uses.
#[derive(Debug, Default)]
pub struct Energy {
    reserves: Vec<f64>,
    /// What the springs of its joints hold (J).
    stored: Vec<f64>,
    gains: Vec<Gain>,
    islands: Islands,
    accounts: Vec<Account>,
}

crate::saved::cloned!(Energy { reserves, stored } scratch { gains, islands, accounts });

/// The kinetic energy of a body at the end of a step (J), what it has more than loads and drives gave it, and how much of that goes.
#[derive(Clone, Copy, Debug, Default)]
struct Gain {
    kinetic: f64,
    more: f64,
    cap: f64,
    /// What its springs hold, and what is left for them.
    stores: f64,
    left: f64,
}

/// The sums of an island.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    gain: Gain,
    /// Whether anything but its bodies holds it.
    is_held: bool,
}

impl Energy {
    /// Holds the law over the step that `problem` has run; `world` is as the step found it. Returns the energy that it took (J).
    pub fn hold(&mut self, world: &World, problem: &mut StepProblem, substeps: impl Fn(usize) -> u32 + Sync, dt: f32) -> f64 {
        let bodies = world.bodies.len();
        self.reserves.resize(bodies, 0.0);
        self.stored.resize(bodies, 0.0);
        let gain = |(i, body): (usize, &Body)| gain(body, i, problem, f64::from(dt), f64::from(dt) / f64::from(substeps(i)));
        world.bodies.par_iter().with_min_len(256).enumerate().map(gain).collect_into_vec(&mut self.gains);
        self.take_work_of_drives(world, problem, dt);
        self.note_springs(problem, |body| f64::from(dt) / f64::from(substeps(body)));
        for ((gain, stored), reserve) in self.gains.iter_mut().zip(&self.stored).zip(&self.reserves) {
            gain.left = stored + reserve - gain.more;
        }
        let mut taken = 0.0;
        if self.gains.iter().any(|gain| gain.left < gain.stores - 1e-3 * gain.cap) {
            self.join(problem);
            let roots = self.islands.roots();
            for (&root, gain) in roots.iter().zip(&self.gains) {
                let account = &mut self.accounts[root as usize].gain;
                account.kinetic += gain.kinetic;
                account.left += gain.left;
                account.cap += gain.cap;
                account.stores += gain.stores;
            }
            for root in 0..bodies {
                let Account { gain, is_held, .. } = self.accounts[root];
                if gain.left < -1e-3 * gain.cap {
                    taken -= gain.left;
                    let members = roots.iter().enumerate().filter(|(_, r)| **r as usize == root).map(|(i, _)| i);
                    brake(world, problem, members, -gain.left, gain.kinetic, is_held);
                }
            }
            for (i, &root) in roots.iter().enumerate() {
                let Gain { left, stores, cap, .. } = self.accounts[root as usize].gain;
                let all = left.max(0.0).min(stores);
                let rest = (left - all).max(0.0).min(cap);
                let own = self.gains[i];
                self.stored[i] = all * own.stores / stores.max(f64::MIN_POSITIVE);
                self.reserves[i] = rest * own.cap / cap.max(f64::MIN_POSITIVE);
            }
            return taken;
        }
        for ((stored, reserve), gain) in self.stored.iter_mut().zip(&mut self.reserves).zip(&self.gains) {
            *stored = gain.stores;
            *reserve = (gain.left - gain.stores).max(0.0).min(gain.cap);
        }
        taken
    }

    /// What the springs of joints hold now.
    fn note_springs(&mut self, problem: &StepProblem, substep: impl Fn(usize) -> f64) {
        let turned = |q: [f32; 4], u: Vec3| Quat::from_array(q) * u;
        for &row in problem.rows_of(&problem.joint_colors()) {
            let joint = &problem.joints[row as usize];
            let ends = [joint.body_a, joint.body_b].map(|b| b as usize);
            let can_move = ends.map(|b| problem.masses[b].inv_mass > 0.0);
            let Some(&body) = ends.iter().zip(can_move).find(|(_, can)| *can).map(|(b, _)| b) else { continue };
            let h = substep(body);
            let [a, b] = ends.map(|b| &problem.bodies[b]);
            let [r_a, r_b] = [joint.r_a, joint.r_b].map(Vec3::from);
            let moved = (Vec3::from(b.dp) + turned(b.dq, r_b) - r_b) - (Vec3::from(a.dp) + turned(a.dq, r_a) - r_a);
            let mut energy = 0.0;
            if joint.is_loose == 0.0 {
                let gap = Vec3::from(joint.gap) + moved;
                energy += f64::from(Vec3::from(problem.joint_impulses[row as usize].linear).length() * gap.length());
            }
            for k in 0..joint.axis_count as usize {
                let axis = &problem.axes[joint.first_axis as usize + k];
                if axis.mass_scale + axis.impulse_scale > 0.0 { continue; }
                let impulse = problem.joint_impulses[problem.joints.len() + joint.first_axis as usize + k].linear[0];
                let d = Vec3::from(axis.direction);
                let turn = |q: [f32; 4]| 2.0 * Vec3::new(q[0], q[1], q[2]) * q[3].signum();
                let moved = if axis.is_linear > 0.0 { -d.dot(moved) } else { d.dot(turn(a.dq) - turn(b.dq)) };
                let is_limit = axis.left > -5e17;
                let (lower, upper) = (axis.gap + moved, axis.left - moved);
                let gap = if is_limit { if lower > upper { upper.min(0.0) } else { lower.min(0.0) } } else { lower };
                energy += f64::from((impulse * gap).abs());
            }
            let energy = 0.5 * energy / h;
            self.gains[body].stores += energy;
        }
    }

    /// What moving kinematic bodies and the drives of joints gave.
    fn take_work_of_drives(&mut self, world: &World, problem: &StepProblem, dt: f32) {
        let can_move = |body: u32| problem.masses[body as usize].inv_mass > 0.0;
        let is_driven = |body: u32| world.bodies.get(body as usize).is_some_and(|b| b.kind == BodyKind::Kinematic && b.is_driven());
        if !problem.totals.is_empty() {
            for contact in problem.swept_contacts() {
                for (driver, driven, sign) in [(contact.body_a, contact.body_b, 1.0), (contact.body_b, contact.body_a, -1.0)] {
                    if is_driven(driver) && can_move(driven) {
                        let work = sign * work_of_contact(&world.bodies[driver as usize], contact, driver == contact.body_a, problem);
                        self.gains[driven as usize].more -= work.max(0.0);
                    }
                }
            }
        }
        for &row in problem.rows_of(&problem.joint_colors()) {
            let joint = &world.joints[row as usize];
            let drives = joint.linear_axes().iter().chain(&joint.angular).any(|axis| axis.drive != Drive::None);
            let at = &problem.joints[row as usize];
            let ends = [at.body_a, at.body_b];
            let has_driver = ends.iter().any(|&b| is_driven(b));
            if !drives && !has_driver {
                continue;
            }
            let Some(&first) = ends.iter().find(|&&b| can_move(b)) else { continue };
            let body = |b: u32| world.bodies.get(b as usize);
            // Upper bound: the impulse at any speed that its ends had.
            let mut work = 0.0;
            for (end, arm) in [(at.body_a, at.r_a), (at.body_b, at.r_b)] {
                if let Some(b) = body(end).filter(|_| is_driven(end)) {
                    let r = Vec3::from(arm);
                    let v = b.linear_velocity + b.angular_velocity.cross(r);
                    let sign = if end == at.body_b { -1.0 } else { 1.0 };
                    let p = problem.joint_impulse(&problem.joint_totals, row as usize);
                    let t = problem.axis_impulse(&problem.joint_totals, row as usize, false);
                    work += f64::from(sign * (v.dot(p) + b.angular_velocity.dot(t)));
                }
            }
            if drives {
                let axes = &problem.axes[at.first_axis as usize..(at.first_axis + at.axis_count) as usize];
                for (k, axis) in axes.iter().enumerate() {
                    if axis.mass_scale + axis.impulse_scale <= 0.0 {
                        continue;
                    }
                    let impulse = problem.joint_totals[problem.joints.len() + at.first_axis as usize + k].linear[0];
                    let d = Vec3::from(axis.direction);
                    let speed = |v: [Vec3; 2], w: [Vec3; 2]| match axis.is_linear > 0.0 {
                        true => d.dot(v[0] + w[0].cross(Vec3::from(at.r_a)) - v[1] - w[1].cross(Vec3::from(at.r_b))),
                        false => d.dot(w[0] - w[1]),
                    };
                    let start = |b: u32| body(b).map_or([Vec3::ZERO; 2], |b| [b.linear_velocity, b.angular_velocity]);
                    let end = |b: u32| [Vec3::from(problem.bodies[b as usize].v), Vec3::from(problem.bodies[b as usize].w)];
                    let of = |f: &dyn Fn(u32) -> [Vec3; 2]| {
                        let [a, b] = ends.map(f);
                        speed([a[0], b[0]], [a[1], b[1]])
                    };
                    let most = [of(&start), of(&end), axis.speed].into_iter().map(|u| impulse * u).fold(0.0, f32::max);
                    work += f64::from(most);
                }
            }
            let _ = dt;
            self.gains[first as usize].more -= work;
        }
    }

    /// The islands of bodies that contacts and joints hold together.
    fn join(&mut self, problem: &StepProblem) {
        let bodies = self.gains.len();
        self.islands.reset(bodies);
        self.accounts.clear();
        self.accounts.resize(bodies, Account::default());
        let can_move = |body: u32| problem.masses.get(body as usize).is_some_and(|mass| mass.inv_mass > 0.0);
        let contacts = problem.swept_contacts().map(|c| [c.body_a, c.body_b]);
        let joints = problem.rows_of(&problem.joint_colors()).iter().map(|&j| &problem.joints[j as usize]);
        let pairs = contacts.chain(joints.map(|j| [j.body_a, j.body_b]));
        for [a, b] in pairs.clone() {
            if can_move(a) && can_move(b) {
                self.islands.join(a, b);
            }
        }
        for [a, b] in pairs {
            match [can_move(a), can_move(b)] {
                [true, false] => self.accounts[self.islands.root(a) as usize].is_held = true,
                [false, true] => self.accounts[self.islands.root(b) as usize].is_held = true,
                _ => {}
            }
        }
    }
}

/// The gain of a body, of which loads of the caller and gravity did not do the work.
fn gain(body: &Body, i: usize, problem: &StepProblem, dt: f64, substep: f64) -> Gain {
    let (row, mass) = (&problem.bodies[i], &problem.masses[i]);
    if !(mass.inv_mass > 0.0) {
        return Gain::default();
    }
    let m = f64::from(body.mass.mass);
    let [v, w] = [row.v, row.w].map(|u| Vec3::from(u).as_dvec3());
    let [v_0, w_0] = [body.linear_velocity, body.angular_velocity].map(|u| u.as_dvec3());
    let acceleration = Vec3::from(mass.acceleration).as_dvec3();
    let way = Vec3::from(row.dp).as_dvec3() - (v - v_0) * (0.5 * substep);
    let pushed = m * acceleration.dot(way).max(acceleration.dot((v + v_0) * (0.5 * dt)));
    let turned = body.whole_torque().as_dvec3().dot((w + w_0) * (0.5 * dt));
    let turn = product(Quat::from_array(row.dq), body.rotation);
    let principal = (product(turn, body.mass.principal_frame).as_dquat().inverse()) * w;
    let kinetic = 0.5 * (m * v.length_squared() + (body.mass.principal_inertia.as_dvec3() * principal * principal).element_sum());
    let more = kinetic - body.kinetic_energy() - pushed - turned;
    let cap = REGAINED * kinetic + ROUNDING * m * acceleration.length() * f64::from(body.smallest_half_extent());
    Gain { kinetic, more, cap, ..Gain::default() }
}

/// The work of a moving body through a contact, by the impulse of the whole step.
fn work_of_contact(driver: &Body, contact: &ContactRow, is_a: bool, problem: &StepProblem) -> f64 {
    let (t_1, t_2) = contact.tangents();
    let normal = Vec3::from(contact.normal);
    let first = contact.first_point as usize;
    let mut work = 0.0;
    for k in first..first + contact.point_count as usize {
        let (total, point) = (&problem.totals[k], &problem.points[k]);
        let r = Vec3::from(if is_a { point.r_a } else { point.r_b });
        let v = driver.linear_velocity + driver.angular_velocity.cross(r);
        work += f64::from(v.dot(normal * total.normal + t_1 * total.tangent_1 + t_2 * total.tangent_2));
    }
    if problem.has_patches() {
        let k = first + contact.point_count as usize;
        let (total, point) = (&problem.totals[k], &problem.points[k]);
        let r = Vec3::from(if is_a { point.r_a } else { point.r_b });
        let v = driver.linear_velocity + driver.angular_velocity.cross(r);
        work += f64::from(v.dot(t_1 * total.tangent_1 + t_2 * total.tangent_2) + driver.angular_velocity.dot(normal) * total.normal);
    }
    work
}

/// Takes energy out of the motion of some bodies, and no momentum where nothing holds them.
fn brake(world: &World, problem: &mut StepProblem, members: impl Iterator<Item = usize> + Clone, over: f64, kinetic: f64, is_held: bool) {
    let (mut spin, mut drift, mut center) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    let mut rigid = 0.0;
    let place = |problem: &StepProblem, i: usize| (world.bodies[i].center_of_mass() + Vec3::from(problem.bodies[i].dp)).as_dvec3();
    let velocity = |problem: &StepProblem, i: usize| [problem.bodies[i].v, problem.bodies[i].w].map(|u| Vec3::from(u).as_dvec3());
    if !is_held {
        let mut mass = 0.0;
        for i in members.clone() {
            let m = f64::from(world.bodies[i].mass.mass);
            mass += m;
            center += m * place(problem, i);
            drift += m * velocity(problem, i)[0];
        }
        center /= mass;
        drift /= mass;
        let (mut angular, mut inertia) = (DVec3::ZERO, glam::DMat3::ZERO);
        for i in members.clone() {
            let body = &world.bodies[i];
            let m = f64::from(body.mass.mass);
            let r = place(problem, i) - center;
            let [v, w] = velocity(problem, i);
            let turn = product(Quat::from_array(problem.bodies[i].dq), body.rotation);
            let own = body.mass.world_inertia(turn).as_dmat3();
            angular += m * r.cross(v) + own * w;
            let outer = glam::DMat3::from_cols(r * r.x, r * r.y, r * r.z);
            inertia += own + (glam::DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * m;
        }
        spin = inertia.inverse() * angular;
        if !spin.is_finite() {
            spin = DVec3::ZERO;
        }
        rigid = 0.5 * (mass * drift.length_squared() + spin.dot(inertia * spin));
    }
    let inner = kinetic - rigid;
    let scale = if inner > 0.0 { ((inner - over) / inner).max(0.0).sqrt() } else { 1.0 };
    for i in members {
        let carried = [drift + spin.cross(place(problem, i) - center), spin];
        let [v, w] = velocity(problem, i);
        let row = &mut problem.bodies[i];
        row.v = (carried[0] + (v - carried[0]) * scale).as_vec3().to_array();
        row.w = (carried[1] + (w - carried[1]) * scale).as_vec3().to_array();
    }
}
