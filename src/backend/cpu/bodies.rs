//! The states of bodies for the lanes, and the passes over bodies.

#![allow(unsafe_code)]

use std::ops::Range;

use crate::kernels::integrate::{
    begin_changes, damp_velocities, end_changes, integrate_gyroscopic, integrate_positions, integrate_slow_gyroscopic,
    integrate_torque, integrate_velocities, start_of,
};
use crate::kernels::joint_system::turned_inertia;
use crate::kernels::momentum::extrapolated;
use crate::kernels::{Body, Damping, Free, Inertia, Mass, StepParams, Sym3};
use crate::lanes::{Lanes, Row8, Shared, WIDTH, Work, lanes, row_at};
use crate::math::{Lane, Quat, Vec3, vec3};
use crate::plan::Kernel;
use crate::problem::{BodyRow, InertiaRow, Params, StepProblem, Substep, TorqueRow};

/// The state of a body, and its mass in sweeps.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub(super) struct State {
    /// v . w .
    pub velocity: Row8,
    /// dp, time, dq
    pub movement: Row8,
    /// Inverse inertia xx xy xz, inverse mass, inverse inertia yy yz zz, locks.
    pub mass: Row8,
}

/// The offset of a body's state, in units of 8 bytes.
pub(super) fn place(body: usize) -> u32 {
    u32::try_from(body * size_of::<State>() / 8).expect("fewer than 268 million bodies")
}

impl State {
    /// Converts to the body of a kernel.
    #[inline(always)]
    pub fn load(&self) -> Body<f32> {
        body(self.velocity.0, self.movement.0)
    }
}

/// The body of a kernel from the numbers of a state.
#[inline(always)]
fn body<L>(velocity: [L; 8], [px, py, pz, time, qx, qy, qz, qw]: [L; 8]) -> Body<L> {
    let Free { v, w } = free_body(velocity);
    Body { v, w, dp: vec3(px, py, pz), time, dq: Quat { axis: vec3(qx, qy, qz), w: qw } }
}

/// Free velocities from the numbers of a row.
#[inline(always)]
fn free_body<L>([vx, vy, vz, _, wx, wy, wz, _]: [L; 8]) -> Free<L> {
    Free { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz) }
}

/// The numbers of a row of velocities.
#[inline(always)]
fn velocity_numbers<L: Lane>(v: Vec3<L>, w: Vec3<L>) -> [L; 8] {
    let zero = L::constant(0.0);
    [v.x, v.y, v.z, zero, w.x, w.y, w.z, zero]
}

/// Loads some bodies of a problem. Each task has its own bodies, here and below.
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
        let [turn_x, turn_y, turn_z] = problem.torques.get(i).unwrap_or(&TorqueRow::NONE).angular_acceleration;
        // SAFETY: tasks have different bodies (`in_groups` cuts their range), and `Partition::give_slots` gives each a
        // slot of its own.
        unsafe {
            states.write(slots[i] as usize, state);
            accelerations.write(slots[i] as usize, Row8([x, y, z, 0.0, turn_x, turn_y, turn_z, 0.0]));
        }
    }
}

/// Stores some bodies.
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
    pub substep: &'a Substep,
    pub bodies: Shared<'a, State>,
    /// v . w . of each body: without the impulses of the substep, or at the start of the step.
    pub free: Shared<'a, Row8>,
    /// Acceleration, then angular acceleration.
    pub accelerations: &'a [Row8],
    /// Rows of damping; empty if no body is damped.
    pub dampings: &'a [Row8],
}

impl Work for BodyWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = StepParams::<L>::load(self.params, self.substep);
        for group in groups {
            let range = WIDTH * group..WIDTH * (group + 1);
            // SAFETY: tasks have different groups of slots: `Threads::spread` cuts their range.
            let states = unsafe { self.bodies.slice(range.clone()) };
            // SAFETY: `NEIGHBORS` are the places of the sixteen states of the slice.
            let mut body = unsafe { wide_body::<L>(states.as_ptr(), &NEIGHBORS) };
            let accelerations = &self.accelerations[range.clone()];
            let dampings = self.dampings.get(range.clone());
            // SAFETY: as above.
            let rows = unsafe { self.free.slice(range) };
            // SAFETY: `NEIGHBORING_ROWS` are the places of the sixteen rows of the slice.
            let mut free = free_body(unsafe { L::gathered(rows.as_ptr(), &NEIGHBORING_ROWS) });
            match self.kernel {
                Kernel::IntegrateVelocities { warm_start, from_start } => {
                    // SAFETY: as above.
                    let [x, y, z, ..] = unsafe { L::gathered(accelerations.as_ptr(), &NEIGHBORING_ROWS) };
                    let mass = Mass { acceleration: vec3(x, y, z), ..Mass::default() };
                    integrate_velocities(warm_start, from_start, &params, &mass, &mut body, &mut free);
                    if !from_start {
                        rows.copy_from_slice(&velocity_rows(free.v, free.w));
                    }
                }
                Kernel::IntegrateTorques { from_start } => {
                    // SAFETY: as above.
                    let [_, _, _, _, x, y, z, _] = unsafe { L::gathered(accelerations.as_ptr(), &NEIGHBORING_ROWS) };
                    integrate_torque(from_start, &params, vec3(x, y, z), &mut body, &mut free);
                    if !from_start {
                        rows.copy_from_slice(&velocity_rows(free.v, free.w));
                    }
                }
                Kernel::DampVelocities { from_start } => {
                    let dampings = dampings.expect("a row of damping for each body");
                    // SAFETY: as above.
                    let [x, y, z, linear_loss, turn_x, turn_y, turn_z, angular_loss] =
                        unsafe { L::gathered(dampings.as_ptr(), &NEIGHBORING_ROWS) };
                    let (linear_gain, angular_gain) = (vec3(x, y, z), vec3(turn_x, turn_y, turn_z));
                    let damping = Damping { linear_gain, linear_loss, angular_gain, angular_loss };
                    damp_velocities(from_start, &damping, &mut body, &mut free);
                    if !from_start {
                        rows.copy_from_slice(&velocity_rows(free.v, free.w));
                    }
                }
                Kernel::BeginChanges => {
                    // SAFETY: `NEIGHBORS` are the places of the sixteen states of the slice.
                    let mass = unsafe { wide_mass::<L>(states.as_ptr(), &NEIGHBORS) };
                    begin_changes(&mass, &mut body, &mut free);
                    rows.copy_from_slice(&velocity_rows(free.v, free.w));
                }
                Kernel::EndChanges => end_changes(&mut body, &free),
                Kernel::IntegratePositions { from_start } => {
                    integrate_positions(from_start, &params, &mut body, &free);
                    for (state, movement) in states.iter_mut().zip(movement_rows(&body)) {
                        state.movement = movement;
                    }
                    continue;
                }
                kernel => unreachable!("{kernel} goes over other rows"),
            }
            for (state, velocity) in states.iter_mut().zip(velocity_rows(body.v, body.w)) {
                state.velocity = velocity;
            }
        }
    }
}

/// Up to sixteen rows of a list with the slots of their bodies: the places of the states and the addresses of the rows.
/// The last group repeats its first row.
#[inline(always)]
fn group_of<T>(rows: &[(u32, T)], group: usize) -> (&[(u32, T)], [u32; WIDTH], [*const T; WIDTH]) {
    let rows = &rows[WIDTH * group..rows.len().min(WIDTH * (group + 1))];
    let mut places = [place(rows[0].0 as usize); WIDTH];
    let mut addresses = [&raw const rows[0].1; WIDTH];
    for ((place_of, address), (slot, row)) in places.iter_mut().zip(&mut addresses).zip(rows) {
        (*place_of, *address) = (place(*slot as usize), row);
    }
    (rows, places, addresses)
}

/// Rotates the inertia of some bodies in systems of joints. The list has their slots, and their inertia at the start of
/// the step.
pub(super) struct TurningWork<'a> {
    pub rows: &'a [(u32, Row8)],
    pub bodies: Shared<'a, State>,
}

impl Work for TurningWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        for group in groups {
            let (rows, places, begin) = group_of(self.rows, group);
            // SAFETY: the places are those of states that no other task has. A row is at each of the addresses.
            let (body, [xx, xy, xz, inv_mass, yy, yz, zz, zero]) = unsafe {
                (wide_body::<L>(self.bodies.as_ptr(), &places), L::columns(&lanes!(lane => begin[lane].cast())))
            };
            let Sym3 { x, yz } = turned_inertia(Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) }, body.dq);
            let turned = L::scattered([x.x, x.y, x.z, inv_mass, yz.x, yz.y, yz.z, zero]);
            for ((slot, _), mass) in rows.iter().zip(turned) {
                // SAFETY: as above.
                unsafe { self.bodies.slice(*slot as usize..*slot as usize + 1)[0].mass = mass };
            }
        }
    }
}

/// The principal inertia of a body with unequal moments: moments . their inverses . frame, then zeros.
pub(super) fn spin_rows(row: &InertiaRow) -> [Row8; 2] {
    let InertiaRow { principal: [x, y, z], inv_principal: [inv_x, inv_y, inv_z], frame, .. } = *row;
    let [qx, qy, qz, qw] = frame;
    [Row8([x, y, z, 0.0, inv_x, inv_y, inv_z, 0.0]), Row8([qx, qy, qz, qw, 0.0, 0.0, 0.0, 0.0])]
}

/// The inertia of a kernel from the numbers of [`spin_rows`].
#[inline(always)]
fn inertia<L>([px, py, pz, _, kx, ky, kz, _]: [L; 8], [qx, qy, qz, qw, ..]: [L; 8]) -> Inertia<L> {
    let frame = Quat { axis: vec3(qx, qy, qz), w: qw };
    Inertia { principal: vec3(px, py, pz), inv_principal: vec3(kx, ky, kz), frame }
}

/// Changes the spins of some bodies with unequal moments of inertia. The list has their slots and [`spin_rows`].
pub(super) struct SpinWork<'a> {
    pub from_start: bool,
    pub params: &'a Params,
    pub substep: &'a Substep,
    pub rows: &'a [(u32, [Row8; 2])],
    pub bodies: Shared<'a, State>,
    pub free: Shared<'a, Row8>,
}

impl Work for SpinWork<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = StepParams::<L>::load(self.params, self.substep);
        for group in groups {
            let (rows, places, addresses) = group_of(self.rows, group);
            // SAFETY: the places are those of states that no other task has, and each state has a row of `free`. Two
            // rows are at each of the addresses.
            let (mut body, mut free, moments, frame) = unsafe {
                (
                    wide_body::<L>(self.bodies.as_ptr(), &places),
                    wide_free::<L>(self.free.as_ptr(), &places),
                    L::columns(&lanes!(lane => addresses[lane].cast())),
                    L::columns(&lanes!(lane => addresses[lane].cast::<Row8>().add(1).cast())),
                )
            };
            let inertia = inertia(moments, frame);
            let is_slow = integrate_slow_gyroscopic(self.from_start, &params, &inertia, &mut body, &mut free);
            let is_slow = L::select(L::constant(0.0), L::constant(1.0), is_slow).store();
            let (velocities, movements) = (velocity_rows(body.v, body.w), movement_rows(&body));
            let free = velocity_rows(free.v, free.w);
            for (lane, (slot, row)) in rows.iter().enumerate() {
                if is_slow.0[lane] > 0.0 {
                    let slot = *slot as usize;
                    // SAFETY: as above.
                    unsafe {
                        let state = &mut self.bodies.slice(slot..slot + 1)[0];
                        (state.velocity, state.movement) = (velocities[lane], movements[lane]);
                        self.free.slice(slot..slot + 1)[0] = free[lane];
                    }
                } else {
                    self.integrate_fast(*slot as usize, row);
                }
            }
        }
    }
}

impl SpinWork<'_> {
    /// Changes the spin of a fast body.
    #[cold]
    #[inline(never)]
    fn integrate_fast(&self, slot: usize, [moments, frame]: &[Row8; 2]) {
        let inertia = inertia(moments.0, frame.0);
        // SAFETY: `Work::over` has this slot to itself.
        let (state, row) =
            unsafe { (&mut self.bodies.slice(slot..slot + 1)[0], &mut self.free.slice(slot..slot + 1)[0]) };
        let (mut body, mut free) = (state.load(), free_body(row.0));
        integrate_gyroscopic(
            self.from_start,
            &StepParams::load(self.params, self.substep),
            &inertia,
            &mut body,
            &mut free,
        );
        state.velocity = Row8(velocity_numbers(body.v, body.w));
        state.movement = Row8(movement_numbers(&body));
        *row = Row8(velocity_numbers(free.v, free.w));
    }
}

/// Extrapolates the velocities of some bodies, and keeps the previous ones.
pub(super) fn extrapolate_velocities(
    first: bool,
    factor: f32,
    bodies: &Shared<State>,
    before: &Shared<Row8>,
    range: Range<usize>,
) {
    // SAFETY: tasks have different slots: `Threads::spread` cuts their range.
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

/// The places of sixteen adjacent bodies.
const NEIGHBORS: [u32; WIDTH] = lanes!(lane => (lane * size_of::<State>() / 8) as u32);

/// The places of sixteen adjacent rows.
const NEIGHBORING_ROWS: [u32; WIDTH] = lanes!(lane => (lane * size_of::<Row8>() / 8) as u32);

/// Sixteen bodies at the given places.
///
/// # Safety
/// The places are those of states, and no thread writes them meanwhile.
#[inline(always)]
pub(super) unsafe fn wide_body<L: Lanes>(states: *const State, places: &[u32; WIDTH]) -> Body<L> {
    // SAFETY: the caller's promise.
    let (velocity, movement) = unsafe {
        (L::gathered(&raw const (*states).velocity, places), L::gathered(&raw const (*states).movement, places))
    };
    body(velocity, movement)
}

/// The masses of sixteen bodies at the given places.
///
/// # Safety
/// Those of [`wide_body`].
#[inline(always)]
pub(super) unsafe fn wide_mass<L: Lanes>(states: *const State, places: &[u32; WIDTH]) -> Mass<L> {
    // SAFETY: the caller's promise.
    let [xx, xy, xz, inv_mass, yy, yz, zz, locks] = unsafe { L::gathered(&raw const (*states).mass, places) };
    let inv_inertia = Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) };
    Mass { inv_inertia, inv_mass, locks, acceleration: Vec3::default() }
}

/// The velocities of sixteen bodies at the start of the step, in rows at the places of their states.
///
/// # Safety
/// Those of [`wide_body`], and `free` has a row for each state.
#[inline(always)]
pub(super) unsafe fn wide_start<L: Lanes>(free: *const Row8, places: &[u32; WIDTH], mass: &Mass<L>) -> Free<L> {
    // SAFETY: the caller's promise.
    start_of(mass, &unsafe { wide_free(free, places) })
}

/// The rows of `free` of sixteen bodies at the places of their states.
///
/// # Safety
/// Those of [`wide_body`], and `free` has a row for each state.
#[inline(always)]
pub(super) unsafe fn wide_free<L: Lanes>(free: *const Row8, places: &[u32; WIDTH]) -> Free<L> {
    // SAFETY: the caller's promise.
    free_body(unsafe { L::gathered(free, &lanes!(lane => places[lane] / ROWS_A_STATE)) })
}

/// The row of `free` of the body whose state has this place.
///
/// # Safety
/// `free` has a row for each state.
#[inline(always)]
pub(super) unsafe fn free_row(free: *mut Row8, place: u32) -> *mut Row8 {
    // SAFETY: the caller's promise.
    unsafe { row_at(free.cast_const(), place / ROWS_A_STATE).cast_mut() }
}

/// Number of rows that a state takes.
const ROWS_A_STATE: u32 = (size_of::<State>() / size_of::<Row8>()) as u32;

#[inline(always)]
pub(super) fn velocity_rows<L: Lanes>(v: Vec3<L>, w: Vec3<L>) -> [Row8; WIDTH] {
    L::scattered(velocity_numbers(v, w))
}

#[inline(always)]
pub(super) fn movement_rows<L: Lanes>(body: &Body<L>) -> [Row8; WIDTH] {
    L::scattered(movement_numbers(body))
}

/// The numbers of a row of movements.
#[inline(always)]
fn movement_numbers<L: Lane>(body: &Body<L>) -> [L; 8] {
    let (p, q) = (body.dp, body.dq);
    [p.x, p.y, p.z, body.time, q.axis.x, q.axis.y, q.axis.z, q.w]
}
