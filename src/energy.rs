//! The laws that constraints change no momentum and add no energy: contacts, joints, their springs, limits and preloads
//! only transfer energy or remove it. First, an island that nothing outside holds gets the momentum that forces gave
//! it. Then a step adds to the kinetic energy of an island at most the work of gravity, forces and drives,
//! the energy that springs of contacts between bodies without joints give back, and energy that the island lost before:
//! 0.1 % of its motion, and what the springs of its swept joints hold. If an island has more, its velocities are reduced
//! to that energy.
//!
//! A constraint with the impulse J that changes velocities from v to v' adds J·(v + v')/2 to the kinetic energy, so
//! work counts at mean velocities. If an island gained energy and its bodies moved further than they could, it was torn
//! apart within the step. That step is refused: the island moves as one rigid body, or stands still if something holds
//! it, and the next step has shorter substeps. Derivation: docs/derivation.md, section 11.

mod island;
mod springs;

use glam::{DVec3, Quat, Vec3};
use rayon::prelude::*;

use crate::config::SolverConfig;
use crate::constants::{LAST_BITS, MAX_ROUNDINGS, MIN_JUMP, REGAINED, ROUNDING};
use crate::effort::Effort;
use crate::error::{Result, ensure};
use crate::graph::Islands;
use crate::math::rotation::{product, unit};
use crate::problem::{BodyRow, JointImpulseRow, JointRow, MassRow, StepProblem, pose_after};
use crate::saved::{Archive, Saved};
use crate::world::{Body, World};
use island::Island;

/// The energy accounts of all islands.
#[derive(Debug, Default)]
pub struct Energy {
    /// The part of its losses that each body can regain (J).
    reserves: Vec<f32>,
    /// The springs of the caller at the joints of each body.
    drive_springs: Vec<DriveSprings>,
    entries: Vec<Entry>,
    /// The islands of contacts and joints, each with its account.
    islands: Islands,
    accounts: Vec<Account>,
    /// The island of each body; [`UNTOUCHED`] for a body without contacts and joints.
    numbers: Vec<u32>,
    /// Whether the islands include the contacts of this step.
    are_known: bool,
    /// The bodies of islands that gained energy, sorted by island.
    members: Vec<(u32, u32)>,
    /// Whether a joint holds each body.
    jointed: Vec<bool>,
    /// Bodies that are new in this step, or that have new joints.
    fresh: Vec<usize>,
}

impl Clone for Energy {
    fn clone(&self) -> Self {
        Self { reserves: self.reserves.clone(), drive_springs: self.drive_springs.clone(), ..Self::default() }
    }

    fn clone_from(&mut self, from: &Self) {
        self.reserves.clone_from(&from.reserves);
        self.drive_springs.clone_from(&from.drive_springs);
        self.are_known = false;
    }
}

/// The energy in springs of the caller (J).
#[derive(Clone, Copy, Debug)]
struct DriveSprings {
    /// At the end of the step before; infinite if it is not known.
    energy: f32,
    /// The part that came from no motion: an angle jumped from half a turn to the other side, or constraints strained a
    /// spring by more than the motion had. Infinite if fixed geometry stopped a body after the step.
    unearned: f32,
}

impl DriveSprings {
    const UNKNOWN: Self = Self { energy: f32::INFINITY, unearned: 0.0 };

    /// The energy that springs give back in a step in which they hold `before` and `after`. They give back at most what
    /// they took.
    fn give_back(&mut self, [before, after]: [f64; 2]) -> f64 {
        let jump = before - f64::from(self.energy);
        if self.unearned.is_infinite() {
            // The stop undid a motion that has its energy.
            *self = Self { energy: after as f32, unearned: 0.0 };
            return before - after - jump.max(0.0);
        }
        self.unearned = self.unearned.min(self.energy);
        if jump > MIN_JUMP * before {
            self.unearned += jump as f32;
        }
        let earned = |energy: f64| (energy - f64::from(self.unearned)).max(0.0);
        let given = earned(before) - earned(after);
        self.energy = after as f32;
        given
    }
}

/// The island of a body without contacts and joints.
const UNTOUCHED: u32 = u32::MAX;

/// The energies of a body, or of an island, in a step (J).
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// Kinetic energy at the start of the step, and at its end.
    before: f64,
    after: f64,
    /// Work of gravity, forces and drives, and of new joints that begin open.
    work: f64,
    /// Energy of springs of the caller at the start of the step, and at its end.
    drive_springs: [f64; 2],
    /// The part of earlier losses that can be regained, and the largest such part from this step on.
    reserve: f64,
    slack: f64,
    /// The part of `slack` that the springs of swept joints hold.
    springs: f64,
    /// Kinetic energy below which motion counts as rest.
    rest: f64,
    /// Energy that rounding of velocities can add in this step.
    rounding: f64,
    /// The longest lever of a joint (m).
    lever: f64,
    /// Whether the caller moved an end of a joint or changed a joint. Bodies then move as far as the joint is open.
    is_strained: bool,
}

/// Common motion of some bodies: mass (kg), momentum before and after (kg m/s), force (N), and mass times displacement
/// (kg m).
#[derive(Clone, Copy, Debug, Default)]
struct Common {
    mass: f64,
    momenta: [DVec3; 2],
    force: DVec3,
    moved: DVec3,
}

impl Common {
    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.force += other.force;
        self.moved += other.moved;
        self.momenta = [0, 1].map(|i| self.momenta[i] + other.momenta[i]);
    }
}

impl Entry {
    /// Energy that the motion lost; below zero if constraints added energy.
    fn left(&self) -> f64 {
        self.before + self.work + self.reserve - self.after
    }

    /// The part of that energy, and of the energy `released` by springs, that the motion can regain.
    fn kept(&self, released: f64) -> f64 {
        (self.left() + released).min(self.slack).max(0.0)
    }

    fn add(&mut self, other: &Self) {
        self.before += other.before;
        self.after += other.after;
        self.work += other.work;
        self.drive_springs = [0, 1].map(|i| self.drive_springs[i] + other.drive_springs[i]);
        self.reserve += other.reserve;
        self.slack += other.slack;
        self.springs += other.springs;
        self.rest += other.rest;
        self.rounding += other.rounding;
        self.lever = self.lever.max(other.lever);
        self.is_strained |= other.is_strained;
    }

    /// Subtracts the common motion of all bodies, which no internal impulse changes.
    fn leave_out(&mut self, Common { mass, momenta, force, moved }: Common) {
        let [before, after] = momenta.map(|momentum| 0.5 * momentum.length_squared() / mass);
        let whole = self.before.max(f64::MIN_POSITIVE);
        (self.before, self.after) = (self.before - before, self.after - after);
        self.work -= force.dot(moved) / mass;
        // Rounding of the total velocity affects the relative motion.
        self.rounding *= (self.before.max(0.0) / whole).sqrt().min(1.0);
        self.slack -= REGAINED * after;
        self.reserve = self.reserve.min(self.slack);
    }
}

/// The account of an island.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    all: Entry,
    /// The sum of the largest reserves of its bodies.
    slack: f64,
    /// The common motion of its bodies, if nothing outside holds them.
    common: Common,
    /// Energy that the springs of its contacts gave back, and energy that they held at the start of the step (J).
    released: f64,
    pushed: f64,
    /// The number of its contacts with an overlap.
    overlaps: u32,
    /// Whether anything outside the island holds it.
    is_held: bool,
    /// Whether it has joints.
    is_jointed: bool,
    is_refused: bool,
    /// The share of their largest reserves that its bodies have.
    share: f64,
}

impl Account {
    /// Energy that constraints added. It is not above 0 if the motion is as slow as rest, or has no more energy than
    /// the springs of contacts can push out.
    fn made(&self) -> f64 {
        self.added().min(self.all.after - self.pushed.max(self.all.rest))
    }

    fn added(&self) -> f64 {
        -(self.all.left() + self.released + self.all.rounding)
    }

    /// Energy that constraints added and that the motion does not have: they moved bodies against forces and springs.
    fn unpaid(&self) -> f64 {
        self.added() - self.made()
    }

    /// The share of the energy in springs of the caller that came from no motion.
    fn unearned(&self) -> f64 {
        let held = self.all.drive_springs[1];
        if held > 0.0 { (self.unpaid() / held).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn is_over(&self) -> bool {
        let made = self.made();
        made > 0.0 || made.is_nan()
    }
}

/// The changes of a step by the law.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taken {
    /// Energy that constraints had added (J).
    pub energy: f64,
    /// Number of islands whose step was refused.
    pub refused: usize,
}

impl Saved for Energy {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.are_known &= !A::READS;
        let bodies = archive.count(self.reserves.len())?;
        self.make_room(bodies);
        archive.runs(bodies, |i, archive| {
            self.reserves[i].walk(archive)?;
            ensure(self.reserves[i] >= 0.0, || format!("body {i} can regain {} J", self.reserves[i]))?;
            let DriveSprings { energy, unearned } = &mut self.drive_springs[i];
            energy.walk(archive)?;
            unearned.walk(archive)?;
            ensure(*energy >= 0.0 && *unearned >= 0.0, || format!("springs of body {i} hold {energy} J, {unearned} J"))
        })
    }
}

impl Energy {
    /// Records that contacts were added or removed.
    pub fn follow_contacts(&mut self) {
        self.are_known = false;
    }

    fn make_room(&mut self, bodies: usize) {
        self.reserves.resize(bodies, 0.0);
        self.drive_springs.resize(bodies, DriveSprings::UNKNOWN);
    }

    /// Updates bodies that were added or removed, or that changed kind, groups or shapes.
    pub fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        self.make_room(world.bodies.len());
        for &i in changed.iter().filter(|&&i| i < world.bodies.len()) {
            self.reserves[i] = 0.0;
            self.fresh.push(i);
        }
    }

    /// Updates the joints of a body that are new or changed.
    pub fn follow_joints_of(&mut self, body: usize) {
        self.fresh.push(body);
    }

    /// Notes the bodies that fixed geometry stopped after the step that `problem` has run. Their joints were measured
    /// before.
    pub fn follow_stops(&mut self, problem: &StepProblem, stopped: &[usize]) {
        stopped.iter().for_each(|&i| self.reserves[i] = 0.0);
        for &row in problem.rows_of(&problem.joint_colors()) {
            let ends = ends(&problem.joints[row as usize]).map(|end| end as usize);
            if ends.iter().any(|end| stopped.contains(end)) {
                for end in ends {
                    if let Some(springs) = self.drive_springs.get_mut(end) {
                        springs.unearned = f32::INFINITY;
                    }
                }
            }
        }
    }

    /// Notes which bodies joints hold in the step that `problem` has run, and returns it.
    pub fn note_jointed(&mut self, problem: &StepProblem) -> &[bool] {
        self.jointed.clear();
        self.jointed.resize(problem.bodies.len(), false);
        let joints = problem.rows_of(&problem.joint_colors()).iter();
        let ends = joints.flat_map(|&j| ends(&problem.joints[j as usize]));
        ends.for_each(|body| self.jointed[body as usize] = true);
        &self.jointed
    }

    /// Applies the law to the step of `dt` seconds that `problem` has run, after [`Self::note_jointed`]. `world` is the
    /// world before the step. `is_teleported` says which bodies the caller moved before it: by that, springs took energy.
    pub fn hold(
        &mut self,
        world: &World,
        problem: &mut StepProblem,
        effort: &mut Effort,
        config: &SolverConfig,
        dt: f32,
        is_teleported: impl Fn(usize) -> bool,
    ) -> Taken {
        self.fresh.extend(self.reserves.len()..world.bodies.len());
        self.make_room(world.bodies.len());
        self.join(world, problem);
        self.keep_momentum(world, problem, effort, dt.into());
        let substep = |body: usize| f64::from(problem.blocks[effort.block_of(body)].substep.length);
        let entry = |(i, body): (usize, &Body)| Entry {
            reserve: self.reserves[i].into(),
            ..entry(body, i, problem, dt.into(), substep(i), lag(&self.jointed, problem, effort, i))
        };
        world.bodies.par_iter().with_min_len(256).enumerate().map(entry).collect_into_vec(&mut self.entries);
        add_levers(&mut self.entries, problem);
        springs::add_springs(&mut self.entries, problem, world, substep);
        self.fresh.sort_unstable();
        // The first rounding of a position may be a gain.
        self.fresh.iter().for_each(|&i| self.entries[i].reserve = self.entries[i].reserve.max(self.entries[i].rest));
        springs::add_springs_at_start(&mut self.entries, problem, world, config, &self.fresh, substep);
        springs::add_work_of_drives(&mut self.entries, problem, world, dt.into(), substep);
        self.add_work_of_drive_springs(problem, is_teleported);
        self.fresh.clear();
        if self.entries.iter().all(|entry| entry.left() + entry.rounding >= entry.springs) {
            let all = self.reserves.iter_mut().zip(&self.entries);
            all.for_each(|(reserve, entry)| *reserve = entry.kept(0.0) as f32);
            return Taken::default();
        }
        self.add_up(world, problem, effort);
        let mut taken = Taken::default();
        if self.accounts.iter().any(Account::is_over) {
            self.add_released(problem, effort);
            taken = self.settle(world, problem, effort, config, dt);
        }
        for account in &mut self.accounts {
            let kept = account.all.kept(account.released);
            account.share = if account.slack > 0.0 { kept / account.slack } else { 0.0 };
        }
        for (i, (reserve, &number)) in self.reserves.iter_mut().zip(&self.numbers).enumerate() {
            let share = self.accounts.get(number as usize).map_or(0.0, |account| account.share);
            *reserve = (share * self.entries[i].slack).max(0.0) as f32;
        }
        taken
    }

    /// Adds the energy that springs of the caller give back. The caller strains them if it moves a body or changes a joint.
    fn add_work_of_drive_springs(&mut self, problem: &StepProblem, is_teleported: impl Fn(usize) -> bool) {
        let is_strained = |i: &usize| is_teleported(*i) || self.fresh.binary_search(i).is_ok();
        for &row in problem.rows_of(&problem.joint_colors()) {
            let ends = ends(&problem.joints[row as usize]).map(|end| end as usize);
            if ends.iter().any(is_strained) {
                for i in ends {
                    let Some(entry) = self.entries.get_mut(i) else { continue };
                    entry.is_strained = true;
                    self.drive_springs[i] = DriveSprings::UNKNOWN;
                }
            }
        }
        for (entry, springs) in self.entries.iter_mut().zip(&mut self.drive_springs) {
            if entry.drive_springs != [0.0; 2] {
                entry.work += springs.give_back(entry.drive_springs);
            }
        }
    }

    /// Finds the islands of bodies that contacts and joints connect.
    fn join(&mut self, world: &World, problem: &StepProblem) {
        let joints = problem.rows_of(&problem.joint_colors());
        if self.are_known && joints.is_empty() {
            return;
        }
        let Self { islands, accounts, numbers, jointed, .. } = self;
        islands.reset(world.bodies.len());
        // First find out whether a fixed or driven body holds each body.
        const HELD: u32 = 0;
        const FREE: u32 = 1;
        numbers.clear();
        numbers.resize(world.bodies.len(), UNTOUCHED);
        let contacts = problem.swept_contacts().map(|c| [c.body_a, c.body_b]);
        for [a, b] in contacts.chain(joints.iter().map(|&j| ends(&problem.joints[j as usize]))) {
            match [can_move(problem, a), can_move(problem, b)] {
                [true, true] => {
                    islands.join(a, b);
                    [a, b].into_iter().for_each(|body| numbers[body as usize] = numbers[body as usize].min(FREE));
                }
                [true, false] => numbers[a as usize] = HELD,
                [false, true] => numbers[b as usize] = HELD,
                [false, false] => {}
            }
        }
        accounts.clear();
        // A root comes before the other bodies of its island.
        for (body, &root) in islands.roots().iter().enumerate() {
            let state = std::mem::replace(&mut numbers[body], UNTOUCHED);
            if state == UNTOUCHED {
                continue;
            }
            if root as usize == body {
                numbers[body] = accounts.len() as u32;
                accounts.push(Account::default());
            } else {
                numbers[body] = numbers[root as usize];
            }
            let account = &mut accounts[numbers[body] as usize];
            // A lock of its axes holds a body from outside.
            account.is_held |= state == HELD || world.bodies[body].has_locked_axis();
            account.is_jointed |= jointed[body];
        }
        self.are_known = joints.is_empty();
    }

    /// Restores the momentum of the islands that nothing holds, and the parabolas of their centers.
    fn keep_momentum(&mut self, world: &World, problem: &mut StepProblem, effort: &Effort, dt: f64) {
        if self.accounts.iter().all(|account| account.is_held) {
            return;
        }
        let is_free = |island: u32| self.accounts.get(island as usize).is_some_and(|account| !account.is_held);
        list_members(&mut self.members, &self.numbers, is_free);
        for members in self.members.chunk_by(|a, b| a.0 == b.0) {
            let mut island = Island { world, problem, members, dt };
            if self.accounts[members[0].0 as usize].is_jointed {
                island.move_with(&island.before());
                island.follow_parabola(&self.jointed, effort);
            } else if island.is_pushed() {
                island.spin_with(&island.before());
            }
        }
    }

    /// Sums the accounts of islands.
    fn add_up(&mut self, world: &World, problem: &StepProblem, effort: &Effort) {
        let Self { accounts, numbers, entries, .. } = self;
        for account in accounts.iter_mut() {
            *account = Account { is_held: account.is_held, ..Account::default() };
        }
        let members = || numbers.iter().enumerate().filter(|(_, number)| **number != UNTOUCHED);
        for (i, &number) in members() {
            let account = &mut accounts[number as usize];
            account.all.add(&entries[i]);
            account.slack += entries[i].slack;
        }
        if accounts.iter().all(|account| account.is_held) {
            return;
        }
        for (i, &number) in members() {
            let account = &mut accounts[number as usize];
            if !account.is_held {
                let lag = lag(&self.jointed, problem, effort, i);
                account.common.add(&common(&world.bodies[i], i, problem, lag));
            }
        }
        let free = accounts.iter_mut().filter(|account| !account.is_held && account.common.mass > 0.0);
        free.for_each(|account| account.all.leave_out(account.common));
    }

    /// Counts overlaps, and adds the energy that the springs of contacts between bodies without joints gave back, in islands
    /// that gained energy. Joints and contacts can push against each other without an end, so springs of jointed bodies give nothing.
    fn add_released(&mut self, problem: &StepProblem, effort: &Effort) {
        for contact in problem.swept_contacts() {
            let [a, b] = [contact.body_a as usize, contact.body_b as usize];
            let body = if can_move(problem, contact.body_a) { a } else { b };
            let account = &mut self.accounts[self.numbers[body] as usize];
            if account.all.left() >= 0.0 {
                continue;
            }
            let first = contact.first_point as usize;
            let mut points = problem.points[first..first + contact.point_count as usize].iter();
            account.overlaps += u32::from(points.any(|point| point.separation < 0.0));
            if !self.jointed[a] && !self.jointed[b] {
                let [before, after] =
                    springs::held_by_contact(problem, contact, &problem.blocks[effort.block_of(body)].substep);
                account.released += before - after;
                account.pushed += before;
            }
        }
        self.accounts.iter_mut().for_each(|account| account.released = account.released.max(0.0));
    }

    /// Removes the energy that constraints added.
    fn settle(
        &mut self,
        world: &World,
        problem: &mut StepProblem,
        effort: &mut Effort,
        config: &SolverConfig,
        dt: f32,
    ) -> Taken {
        let mut taken = Taken::default();
        let is_over = |island: u32| self.accounts.get(island as usize).is_some_and(Account::is_over);
        list_members(&mut self.members, &self.numbers, is_over);
        for members in self.members.chunk_by(|a, b| a.0 == b.0) {
            let account = &mut self.accounts[members[0].0 as usize];
            let (over, unpaid, unearned) = (account.made(), account.unpaid(), account.unearned());
            let Account { all, released, overlaps, is_held, is_refused, .. } = account;
            let mut island = Island { world, problem, members, dt: dt.into() };
            // Stabilization lifts bodies at `push_limit` at most, each overlap those that lie on it.
            let lift = island.weight() * f64::from(config.push_limit * dt) * f64::from(*overlaps + 1);
            taken.energy += if over.is_finite() { over } else { all.after };
            *is_refused = !over.is_finite()
                || (unpaid > lift && !all.is_strained)
                || !island.is_in_reach(all.lever, config.push_limit.into());
            let start = (!*is_held).then(|| island.before());
            let is_whole = !*is_refused && island.brake([over, all.after], start.as_ref());
            for i in island.members() {
                let (springs, [at_start, at_end]) = (&mut self.drive_springs[i], self.entries[i].drive_springs);
                if is_whole {
                    springs.unearned = (f64::from(springs.unearned) + unearned * at_end).min(at_end) as f32;
                } else {
                    springs.energy = at_start as f32;
                }
            }
            let is_finer = *is_refused && effort.refine(island.members());
            if !is_whole {
                island.move_rigidly(*is_held, is_finer);
            }
            taken.refused += usize::from(*is_refused);
            // No energy is left over.
            *released = 0.0;
            all.after += all.left();
        }
        if taken.refused > 0 {
            self.forget_impulses(problem);
        }
        taken
    }

    /// Clears the impulses of joints and contacts in the islands whose step was refused.
    fn forget_impulses(&mut self, problem: &mut StepProblem) {
        let (numbers, accounts) = (&self.numbers, &self.accounts);
        let is_refused = |[a, b]: [u32; 2], problem: &StepProblem| {
            let body = if can_move(problem, a) { a } else { b };
            let account = || accounts.get(numbers[body as usize] as usize);
            can_move(problem, body) && account().is_some_and(|account| account.is_refused)
        };
        for i in 0..problem.joints.len() {
            let joint = problem.joints[i];
            if is_refused(ends(&joint), problem) {
                let axes = problem.joints.len() + joint.first_axis as usize;
                problem.joint_impulses[i] = JointImpulseRow::default();
                problem.joint_impulses[axes..axes + joint.axis_count as usize].fill(JointImpulseRow::default());
            }
        }
    }
}

/// Lists the bodies of some islands, sorted by island.
fn list_members(members: &mut Vec<(u32, u32)>, numbers: &[u32], is_listed: impl Fn(u32) -> bool) {
    members.clear();
    members.extend(numbers.iter().copied().zip(0..).filter(|(island, _)| is_listed(*island)));
    members.sort_unstable();
}

/// Whether constraints can move a body.
fn can_move(problem: &StepProblem, body: u32) -> bool {
    problem.masses.get(body as usize).is_some_and(|mass| mass.inv_mass > 0.0)
}

fn ends(joint: &JointRow) -> [u32; 2] {
    [joint.body_a, joint.body_b]
}

/// Records the levers of joints, and what rounding of their ends can add.
fn add_levers(entries: &mut [Entry], problem: &StepProblem) {
    for &row in problem.rows_of(&problem.joint_colors()) {
        let joint = &problem.joints[row as usize];
        let arms = [joint.r_a, joint.r_b].map(|arm| f64::from(Vec3::from(arm).length()));
        for (end, arm) in ends(joint).into_iter().zip(arms).filter(|(end, _)| can_move(problem, *end)) {
            let mass = &problem.masses[end as usize];
            let rest = weight(mass) * LAST_BITS * arm;
            let entry = &mut entries[end as usize];
            entry.lever = arms.into_iter().fold(entry.lever, f64::max);
            (entry.rest, entry.slack) = (entry.rest + rest, entry.slack + rest);
        }
    }
}

/// The account of a body, with the work of gravity and forces.
fn entry(body: &Body, i: usize, problem: &StepProblem, dt: f64, substep: f64, lag: f64) -> Entry {
    let (row, mass) = (&problem.bodies[i], &problem.masses[i]);
    if mass.inv_mass <= 0.0 {
        return Entry::default();
    }
    let m = f64::from(body.mass.mass);
    let [v, v_0] = [Vec3::from(row.v), body.linear_velocity].map(|v| v.as_dvec3());
    let acceleration = Vec3::from(mass.acceleration);
    let pushed = m * acceleration.as_dvec3().dot(way(body, row, [v_0, v], lag));
    let torque = body.whole_torque();
    let w = Vec3::from(row.w);
    let turned = if torque == Vec3::ZERO { 0.0 } else { f64::from(torque.dot(w + body.angular_velocity)) * (0.5 * dt) };
    let spinning = |rotation: &dyn Fn() -> Quat, w: Vec3| {
        let inertia = body.mass.principal_inertia;
        if inertia.x == inertia.y && inertia.y == inertia.z {
            return 0.5 * f64::from(inertia.x) * w.as_dvec3().length_squared();
        }
        let spin = (product(rotation(), body.mass.principal_frame).inverse() * w).as_dvec3();
        0.5 * (inertia.as_dvec3() * spin * spin).element_sum()
    };
    let before = 0.5 * m * v_0.length_squared() + spinning(&|| body.rotation, body.angular_velocity);
    let after = 0.5 * m * v.length_squared() + spinning(&|| product(turn_of(row), body.rotation), w);
    // The radius of gyration is a measure of size.
    let size = f64::from(body.mass.principal_inertia.min_element() / body.mass.mass).sqrt();
    let last_bits = LAST_BITS * f64::from(body.center_of_mass().length());
    let rest = m * f64::from(acceleration.length()) * (ROUNDING * size + last_bits);
    let slack = REGAINED * after + rest;
    // Gravity causes the same rounding of a velocity in each substep. Short substeps sum changes, which round less.
    // Energy that constraints added does not count.
    let rounding = after.min(before + pushed.max(0.0)) * f64::from(f32::EPSILON) * (dt / substep).min(MAX_ROUNDINGS);
    Entry { before, after, work: pushed + turned, slack, rest, rounding, ..Entry::default() }
}

/// The time by which the places of a body are ahead of its velocities (s). The velocities of jointed bodies belong to the
/// middle of a substep.
fn lag(jointed: &[bool], problem: &StepProblem, effort: &Effort, body: usize) -> f64 {
    if jointed[body] { 0.5 * f64::from(problem.blocks[effort.block_of(body)].substep.length) } else { 0.0 }
}

/// Displacement of a body between the times of its velocities `v_0` and `v`, which its places are ahead of by `lag` (m).
/// It is the displacement between the stored positions, so that the work of a constant force over many steps has no
/// rounding that adds up.
fn way(body: &Body, row: &BodyRow, [v_0, v]: [DVec3; 2], lag: f64) -> DVec3 {
    let [before, after] = if body.mass.center == Vec3::ZERO {
        [body.position, body.position + Vec3::from(row.dp)]
    } else {
        let (position, rotation) = pose_after(body, row);
        [body.center_of_mass(), position + rotation * body.mass.center]
    };
    after.as_dvec3() - before.as_dvec3() - (v - v_0) * lag
}

/// The part of a body in the common motion of its island.
fn common(body: &Body, i: usize, problem: &StepProblem, lag: f64) -> Common {
    let (row, mass) = (&problem.bodies[i], f64::from(body.mass.mass));
    let [v, v_0] = [Vec3::from(row.v), body.linear_velocity].map(|v| v.as_dvec3());
    let force = mass * Vec3::from(problem.masses[i].acceleration).as_dvec3();
    Common { mass, momenta: [mass * v_0, mass * v], force, moved: mass * way(body, row, [v_0, v], lag) }
}

/// The size of the weight and forces of a body (N).
fn weight(mass: &MassRow) -> f64 {
    f64::from(Vec3::from(mass.acceleration).length() / mass.inv_mass)
}

/// Rotation of a body in the step, as its pose will have it.
fn turn_of(row: &BodyRow) -> Quat {
    unit(Quat::from_array(row.dq))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring of 10 J releases 2 J. A wall strains it again, and the next step releases the same 2 J.
    #[test]
    fn a_spring_that_a_stop_strained_gives_nothing_for_that() {
        let mut springs = DriveSprings { energy: 10.0, unearned: 0.0 };
        assert_eq!(springs.give_back([10.0, 8.0]), 2.0);
        springs.unearned = f32::INFINITY;
        assert_eq!(springs.give_back([10.0, 8.0]), 0.0);
        assert_eq!(springs.give_back([8.0, 7.0]), 1.0);
    }
}
