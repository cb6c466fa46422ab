//! The inner loops of the lanes: what one task does to some groups of sixteen.

#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::groups::{Bodies, Group, NO_ROW};
use super::joints::JointGroup;
use super::shared::Shared;
use super::wide::{Lanes, Portable, Row8, WIDTH, Wide, lanes, row_at};
use crate::kernels::contact::{restitute_contact, solve_contact, warm_start};
use crate::kernels::integrate::{integrate_gyroscopic, integrate_positions, integrate_velocities};
use crate::kernels::joint::{solve_joint, warm_start_joint};
use crate::kernels::momentum::extrapolated;
use crate::kernels::{
    Body, Contact, Free, Impulse, Inertia, Joint, Mass, Pair, Point, Rules, SoftnessOf, StepParams, Sym3,
};
use crate::math::{Quat, Vec3, vec3};
use crate::plan::Kernel;
use crate::problem::{BodyRow, Params, Softness, StepProblem};

/// All that sweeps know of a body.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub(super) struct State {
    /// v . w .
    pub velocity: Row8,
    /// dp . dq
    pub movement: Row8,
    /// Inverse inertia xx xy xz, inverse mass, inverse inertia yy yz zz .
    pub mass: Row8,
}

/// Where a body's state begins, in units of 8 bytes.
pub(super) fn place(body: usize) -> u32 {
    u32::try_from(body * size_of::<State>() / 8).expect("fewer than 268 million bodies")
}

impl State {
    /// As one body.
    pub fn load(&self) -> Body<f32> {
        let ([vx, vy, vz, _, wx, wy, wz, _], [px, py, pz, _, qx, qy, qz, qw]) = (self.velocity.0, self.movement.0);
        Body {
            v: vec3(vx, vy, vz),
            w: vec3(wx, wy, wz),
            dp: vec3(px, py, pz),
            dq: Quat { axis: vec3(qx, qy, qz), w: qw },
        }
    }
}

/// Two velocities in a row.
fn velocity_row(v: Vec3<f32>, w: Vec3<f32>) -> Row8 {
    Row8([v.x, v.y, v.z, 0.0, w.x, w.y, w.z, 0.0])
}

/// What a processor can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstructionSet {
    /// What every processor of its kind has.
    Portable,
    /// Eight numbers in one register of an x86-64 processor. Only [`InstructionSet::each`] makes it, after it has asked.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Sixteen numbers in one register; the same holds.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl InstructionSet {
    /// Those that this processor has, the best last.
    pub fn each() -> impl DoubleEndedIterator<Item = Self> {
        let has = |set: &Self| match set {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => std::arch::is_x86_feature_detected!("avx512f"),
        };
        let known = [
            Self::Portable,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512,
        ];
        known.into_iter().filter(has)
    }

    /// The best that this processor has.
    pub fn best() -> Self {
        Self::each().next_back().unwrap_or(Self::Portable)
    }

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "AVX-512",
        }
    }
}

/// What is done to groups of sixteen, over whatever lanes.
pub(super) trait Work: Sync {
    /// Does some groups. To be inlined: what is not loses the instruction set.
    fn over<L: Lanes>(&self, groups: Range<usize>);
}

impl InstructionSet {
    /// Does some groups of a work; no other task has the same.
    pub fn run(self, work: &impl Work, groups: Range<usize>) {
        match self {
            Self::Portable => work.over::<Portable>(groups),
            // SAFETY: `InstructionSet::each` asked the processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { run_avx2(work, groups) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { run_avx512(work, groups) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: &impl Work, groups: Range<usize>) {
    work.over::<super::wide::Avx2>(groups);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn run_avx512(work: &impl Work, groups: Range<usize>) {
    work.over::<super::wide::Avx512>(groups);
}

/// Takes over some bodies of a problem; no other task has the same.
pub(super) fn load_bodies(
    problem: &StepProblem,
    slots: &[u32],
    range: Range<usize>,
    states: &Shared<State>,
    accelerations: &Shared<Row8>,
) {
    let row = |from: &[f32]| Row8(std::array::from_fn(|i| from[i]));
    for i in range {
        let body: &[f32; 16] = bytemuck::cast_ref(&problem.bodies[i]);
        let mass: &[f32; 12] = bytemuck::cast_ref(&problem.masses[i]);
        let state = State { velocity: row(&body[..8]), movement: row(&body[8..]), mass: row(&mass[..8]) };
        let [x, y, z] = problem.masses[i].acceleration;
        // SAFETY: tasks have different bodies (`in_groups` cuts their range), and `Parts::give_slots` gives each a slot of its own.
        unsafe {
            states.write(slots[i] as usize, state);
            accelerations.write(slots[i] as usize, Row8([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0]));
        }
    }
}

/// Gives some bodies back; no other task has the same.
pub(super) fn store_bodies(states: &[State], slots: &[u32], range: Range<usize>, rows: &Shared<BodyRow>) {
    for i in range {
        let State { velocity, movement, .. } = &states[slots[i] as usize];
        let both = [velocity.0, movement.0];
        // SAFETY: tasks have different bodies: `in_groups` cuts their range.
        unsafe { rows.write(i, bytemuck::cast(both)) };
    }
}

/// A pass over bodies.
pub(super) struct BodyWork<'a> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub bodies: Shared<'a, State>,
    /// v . w . of each without the impulses of the substep.
    pub free: Shared<'a, Row8>,
    pub accelerations: &'a [Row8],
}

impl Work for BodyWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = wide_params::<L>(self.params);
        for group in groups {
            let range = WIDTH * group..WIDTH * (group + 1);
            // SAFETY: tasks have different groups of slots: `Crew::spread` cuts their range.
            let states = unsafe { self.bodies.slice(range.clone()) };
            // SAFETY: `NEIGHBORS` are the places of the sixteen states of the slice.
            let mut body = unsafe { wide_body::<L>(states.as_ptr(), &NEIGHBORS) };
            if let Kernel::IntegrateVelocities { carry } = self.kernel {
                let accelerations = &self.accelerations[range.clone()];
                // SAFETY: as above.
                let rows = unsafe { self.free.slice(range) };
                // SAFETY: `NEIGHBORING_ROWS` are the places of the sixteen rows of each slice.
                let (acceleration, free) = unsafe {
                    (
                        L::gathered(accelerations.as_ptr(), &NEIGHBORING_ROWS),
                        L::gathered(rows.as_ptr(), &NEIGHBORING_ROWS),
                    )
                };
                let ([x, y, z, ..], [vx, vy, vz, _, wx, wy, wz, _]) = (acceleration, free);
                let mass = Mass { acceleration: vec3(x, y, z), ..Mass::default() };
                let mut free = Free { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz) };
                integrate_velocities(carry, &params, &mass, &mut body, &mut free);
                rows.copy_from_slice(&velocity_rows(free.v, free.w));
            } else {
                integrate_positions(&params, &mut body);
                for (state, movement) in states.iter_mut().zip(movement_rows(&body)) {
                    state.movement = movement;
                }
            }
            for (state, velocity) in states.iter_mut().zip(velocity_rows(body.v, body.w)) {
                state.velocity = velocity;
            }
        }
    }
}

/// Forgets the impulses of some points; no other task has the same.
pub(super) fn clear_impulses(impulses: &Shared<[Wide; 4]>, points: Range<usize>) {
    // SAFETY: tasks have different parts, and `Groups::points_of` gives each part points of its own.
    for impulse in unsafe { impulses.slice(points) } {
        impulse[..3].fill(Wide::default());
    }
}

/// Turns the spins of some bodies with unequal moments of inertia, given with their slots; no other task has the same.
pub(super) fn integrate_spins(
    params: &Params,
    inertias: &[(usize, Inertia<f32>)],
    bodies: &Shared<State>,
    free: &Shared<Row8>,
) {
    let params = StepParams::load(params);
    for (slot, inertia) in inertias {
        // SAFETY: one task has all spins of a part, and `Parts::give_slots` gives each part slots of its own.
        let (state, row) = unsafe { (&mut bodies.slice(*slot..slot + 1)[0], &mut free.slice(*slot..slot + 1)[0]) };
        let (mut body, [vx, vy, vz, _, wx, wy, wz, _]) = (state.load(), row.0);
        let mut free = Free { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz) };
        integrate_gyroscopic(&params, inertia, &mut body, &mut free);
        state.velocity = velocity_row(body.v, body.w);
        *row = velocity_row(free.v, free.w);
    }
}

/// Goes on with the velocities of some bodies, and remembers where they were; no other task has the same.
pub(super) fn extrapolate_velocities(
    first: bool,
    factor: f32,
    bodies: &Shared<State>,
    before: &Shared<Row8>,
    range: Range<usize>,
) {
    // SAFETY: tasks have different slots: `Crew::spread` cuts their range.
    let (bodies, before) = unsafe { (bodies.slice(range.clone()), before.slice(range)) };
    for (body, before) in bodies.iter_mut().zip(before) {
        let now = body.velocity;
        if !first {
            for (x, before) in body.velocity.0.iter_mut().zip(&before.0) {
                *x = extrapolated(*x, *before, factor);
            }
        }
        *before = now;
    }
}

/// A pass over the groups of one color.
pub(super) struct ContactWork<'a> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub bodies: Shared<'a, State>,
    pub groups: &'a [Group],
    pub points: &'a [[Wide; 12]],
    pub impulses: Shared<'a, [Wide; 4]>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

impl Work for ContactWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = wide_params::<L>(self.params);
        for group in groups {
            self.sweep::<L>(&params, &self.groups[group]);
        }
    }
}

impl ContactWork<'_> {
    #[inline(always)]
    fn sweep<L: Lanes>(&self, params: &StepParams<L>, group: &Group) {
        let states = self.bodies.as_ptr();
        // SAFETY: `Bodies::set` looked up the slot of every lane. A body that can move occurs once in a color (`CheckedStep` holds
        // that), so that no other task of this color reads or writes it; no task writes a body that cannot move.
        let mut pair = unsafe { wide_pair::<L>(states, &group.a, &group.b) };
        let rules = self.kernel.rules().unwrap_or_default();
        let rows = group.first_point as usize..(group.first_point + group.points) as usize;
        // Used where they lie: copied, they are most of what a sweep moves.
        // SAFETY: `Contact`, `Point` and `Impulse` are `repr(C)` and hold lanes only; `Groups::deal` gives each group points, and so
        // impulses, of its own.
        let (contact, points, impulses) = unsafe {
            let contact: &[Contact<L>] = as_lanes(std::slice::from_ref(&group.contact));
            let points: &[Point<L>] = as_lanes(&self.points[rows.clone()]);
            let impulses: &mut [Impulse<L>] = as_lanes_mut(self.impulses.slice(rows));
            (&contact[0], points, impulses)
        };
        match self.kernel {
            Kernel::WarmStart(_) => warm_start(rules, &mut pair, contact, points, impulses),
            Kernel::SolveContacts(_) => solve_contact(rules, params, &mut pair, contact, points, impulses),
            _ => restitute_contact(rules, params, &mut pair, contact, points, impulses),
        }
        // SAFETY: as above.
        unsafe { store_pair(states, &group.a, &group.b, &pair) };
        note_moving(rules, &pair, self.moving);
    }
}

/// A pass over the joints of one color.
pub(super) struct JointWork<'a> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub bodies: Shared<'a, State>,
    pub groups: &'a [JointGroup],
    /// In the order of the problem.
    pub impulses: Shared<'a, Vec3<f32>>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

impl Work for JointWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = wide_params::<L>(self.params);
        for group in groups {
            self.sweep::<L>(&params, &self.groups[group]);
        }
    }
}

impl JointWork<'_> {
    #[inline(always)]
    fn sweep<L: Lanes>(&self, params: &StepParams<L>, group: &JointGroup) {
        let states = self.bodies.as_ptr();
        // SAFETY: as of contacts.
        let mut pair = unsafe { wide_pair::<L>(states, &group.a, &group.b) };
        // SAFETY: `Joint` is `repr(C)` and holds lanes only.
        let joint: &Joint<L> = unsafe { &as_lanes(std::slice::from_ref(&group.joint))[0] };
        let mut rows = [Wide::default(); 3];
        for (lane, &row) in group.rows.iter().enumerate().filter(|(_, row)| **row != NO_ROW) {
            // SAFETY: `JointGroups::load` puts each joint into one lane of one group, and tasks have different groups.
            let impulse = unsafe { self.impulses.slice(row as usize..row as usize + 1) }[0];
            (rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]) = (impulse.x, impulse.y, impulse.z);
        }
        let mut impulse = vec3(L::load(&rows[0]), L::load(&rows[1]), L::load(&rows[2]));
        let rules = self.kernel.rules().unwrap_or_default();
        if matches!(self.kernel, Kernel::WarmStartJoints) {
            warm_start_joint(&mut pair, joint, impulse);
        } else {
            solve_joint(rules, params, &mut pair, joint, &mut impulse);
            let rows = [impulse.x.store(), impulse.y.store(), impulse.z.store()];
            for (lane, &row) in group.rows.iter().enumerate().filter(|(_, row)| **row != NO_ROW) {
                // SAFETY: as above.
                unsafe { self.impulses.write(row as usize, vec3(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane])) };
            }
        }
        // SAFETY: as of contacts.
        unsafe { store_pair(states, &group.a, &group.b, &pair) };
        note_moving(rules, &pair, self.moving);
    }
}

/// Says so if a lane was corrected by more than the tolerance.
#[inline(always)]
fn note_moving<L: Lanes>(rules: Rules, pair: &Pair<L>, moving: &AtomicBool) {
    if rules.measured && pair.moving.store().0.iter().any(|&m| m > 0.0) {
        moving.store(true, Ordering::Relaxed);
    }
}

/// The places of sixteen bodies that stand beside each other.
const NEIGHBORS: [u32; WIDTH] = lanes!(lane => (lane * size_of::<State>() / 8) as u32);

/// The places of sixteen rows that stand beside each other.
const NEIGHBORING_ROWS: [u32; WIDTH] = lanes!(lane => (lane * size_of::<Row8>() / 8) as u32);

/// # Safety
/// The bodies are there, and nobody writes them meanwhile; the same below.
#[inline(always)]
unsafe fn wide_pair<L: Lanes>(states: *const State, a: &Bodies, b: &Bodies) -> Pair<L> {
    // SAFETY: the caller's promise.
    unsafe {
        Pair {
            a: wide_body::<L>(states, &a.places),
            b: wide_body::<L>(states, &b.places),
            mass_a: wide_mass::<L>(states, &a.places),
            mass_b: wide_mass::<L>(states, &b.places),
            moving: L::constant(0.0),
        }
    }
}

/// Writes what can move of a pair.
///
/// # Safety
/// The bodies are there, and nobody else uses those that can move meanwhile.
#[inline(always)]
unsafe fn store_pair<L: Lanes>(states: *mut State, a: &Bodies, b: &Bodies, pair: &Pair<L>) {
    // SAFETY: the caller's promise.
    unsafe {
        store_velocities(states, a, &pair.a);
        store_velocities(states, b, &pair.b);
    }
}

/// # Safety
/// As above.
#[inline(always)]
unsafe fn wide_body<L: Lanes>(states: *const State, places: &[u32; WIDTH]) -> Body<L> {
    // SAFETY: the caller's promise.
    let (velocity, movement) = unsafe {
        (L::gathered(&raw const (*states).velocity, places), L::gathered(&raw const (*states).movement, places))
    };
    let ([vx, vy, vz, _, wx, wy, wz, _], [px, py, pz, _, qx, qy, qz, qw]) = (velocity, movement);
    Body { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz), dp: vec3(px, py, pz), dq: Quat { axis: vec3(qx, qy, qz), w: qw } }
}

/// # Safety
/// As above.
#[inline(always)]
unsafe fn wide_mass<L: Lanes>(states: *const State, places: &[u32; WIDTH]) -> Mass<L> {
    // SAFETY: the caller's promise.
    let [xx, xy, xz, inv_mass, yy, yz, zz, _] = unsafe { L::gathered(&raw const (*states).mass, places) };
    Mass { inv_inertia: Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) }, inv_mass, acceleration: Vec3::default() }
}

/// Writes the velocities of those that can move.
///
/// # Safety
/// As of [`store_pair`].
#[inline(always)]
unsafe fn store_velocities<L: Lanes>(states: *mut State, bodies: &Bodies, body: &Body<L>) {
    let Bodies { places, movable } = *bodies;
    if movable == 0 {
        return;
    }
    let rows = velocity_rows(body.v, body.w);
    for lane in 0..WIDTH {
        // Almost always all of them.
        if movable == u16::MAX || movable & (1 << lane) != 0 {
            // SAFETY: the caller's promise.
            unsafe { row_at((&raw mut (*states).velocity).cast_const(), places[lane]).cast_mut().write(rows[lane]) };
        }
    }
}

#[inline(always)]
fn velocity_rows<L: Lanes>(v: Vec3<L>, w: Vec3<L>) -> [Row8; WIDTH] {
    let zero = L::constant(0.0);
    L::scattered([v.x, v.y, v.z, zero, w.x, w.y, w.z, zero])
}

#[inline(always)]
fn movement_rows<L: Lanes>(body: &Body<L>) -> [Row8; WIDTH] {
    let (p, q) = (body.dp, body.dq);
    L::scattered([p.x, p.y, p.z, L::constant(0.0), q.axis.x, q.axis.y, q.axis.z, q.w])
}

/// Rows of sixteen as rows of lanes, in the same order.
///
/// # Safety
/// `T` is `repr(C)` and holds `N` lanes and nothing else.
#[inline(always)]
unsafe fn as_lanes<T, const N: usize>(rows: &[[Wide; N]]) -> &[T] {
    const { assert!(size_of::<T>() == size_of::<[Wide; N]>() && align_of::<T>() <= align_of::<Wide>()) };
    // SAFETY: the caller's promise; a lane is sixteen numbers.
    unsafe { std::slice::from_raw_parts(rows.as_ptr().cast(), rows.len()) }
}

/// The same, to write.
///
/// # Safety
/// As above.
#[inline(always)]
unsafe fn as_lanes_mut<T, const N: usize>(rows: &mut [[Wide; N]]) -> &mut [T] {
    const { assert!(size_of::<T>() == size_of::<[Wide; N]>() && align_of::<T>() <= align_of::<Wide>()) };
    // SAFETY: as above.
    unsafe { std::slice::from_raw_parts_mut(rows.as_mut_ptr().cast(), rows.len()) }
}

/// Once a task, so that closures do no harm.
#[inline(always)]
fn wide_params<L: Lanes>(p: &Params) -> StepParams<L> {
    let c = |x: f32| L::constant(x.into());
    let softness = |s: &Softness| SoftnessOf {
        bias_rate: c(s.bias_rate),
        mass_scale: c(s.mass_scale),
        impulse_scale: c(s.impulse_scale),
        push_limit: c(s.push_limit),
    };
    StepParams {
        substep: c(p.substep),
        inverse_substep: c(p.inverse_substep),
        restitution_threshold: c(p.restitution_threshold),
        movable: softness(&p.movable),
        fixed: softness(&p.fixed),
        joint: softness(&p.joint),
        slop: c(p.slop),
        relaxation: c(p.relaxation),
        tolerance: c(p.tolerance),
    }
}
