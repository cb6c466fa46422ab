//! The inner loop of the lanes: a pass over groups of sixteen constraints.

#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bodies::{State, free_row, movement_rows, velocity_rows, wide_body, wide_free, wide_mass, wide_start};
use super::constraint::{Constraint, sweep_contact, sweep_joint};
use super::lane_group::{BodyLanes, LaneGroup};
use super::lane_rows::{GroupRows, OwnImpulses, SharedImpulses, SharedPoints};
use crate::config::FrictionRule;
use crate::kernels::contact::{begin_bounces, end_bounces, sum_impulse};
use crate::kernels::{Body, Contact, Free, Impulse, Pair, Rules, StepParams};
use crate::lanes::{Lanes, Row8, Shared, WIDTH, Wide, Work, row_at};
use crate::plan::Kernel;
use crate::problem::{Params, Substep};

/// The kernels of most sweeps: over flat contacts without restitution, in the default settings.
const BIASED: Kernel = Kernel::SolveContacts(Rules { biased: true, ..Rules::PLAIN });
const RELAX: Kernel = Kernel::SolveContacts(Rules { friction: FrictionRule::Disc, ..Rules::PLAIN });
/// The same, where every movable body has equal moments of inertia.
const BIASED_CUBES: Kernel = Kernel::SolveContacts(Rules { biased: true, isotropic: true, ..Rules::PLAIN });
const RELAX_CUBES: Kernel =
    Kernel::SolveContacts(Rules { friction: FrictionRule::Disc, isotropic: true, ..Rules::PLAIN });

/// A pass over the groups of one color. `AS_ONE` is for kernels that treat the points of a manifold as one: their code
/// would take registers from the other sweeps.
pub(super) struct Sweep<'a, C, const AS_ONE: bool> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub substep: &'a Substep,
    pub bodies: Shared<'a, State>,
    pub free: Shared<'a, Row8>,
    pub groups: &'a [LaneGroup],
    pub points: SharedPoints<'a>,
    pub impulses: SharedImpulses<'a>,
    pub constraint: PhantomData<C>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

impl<C: Constraint, const AS_ONE: bool> Work for Sweep<'_, C, AS_ONE> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        // Each kernel of most sweeps is compiled for its rules: numbers that these rules do not use take no registers.
        // Without them a page loads 20 kB less, and its steps take 2 to 8 % longer.
        let is_compiled = C::HAS_POINTS && !AS_ONE && !cfg!(target_arch = "wasm32");
        match self.kernel {
            BIASED if is_compiled => self.sweep_all::<L>(BIASED, groups),
            RELAX if is_compiled => self.sweep_all::<L>(RELAX, groups),
            BIASED_CUBES if is_compiled => self.sweep_all::<L>(BIASED_CUBES, groups),
            RELAX_CUBES if is_compiled => self.sweep_all::<L>(RELAX_CUBES, groups),
            kernel => self.sweep_all::<L>(kernel, groups),
        }
    }
}

impl<C: Constraint, const AS_ONE: bool> Sweep<'_, C, AS_ONE> {
    #[inline(always)]
    fn sweep_all<L: Lanes>(&self, kernel: Kernel, groups: Range<usize>) {
        let params = StepParams::<L>::load(self.params, self.substep);
        for group in groups {
            self.sweep(kernel, &params, &self.groups[group]);
        }
    }

    #[inline(always)]
    fn sweep<L: Lanes>(&self, kernel: Kernel, params: &StepParams<L>, group: &LaneGroup) {
        let states = self.bodies.as_ptr();
        // SAFETY: `Load::take_bodies` looked up the slot of every lane. `CheckedStep` guarantees that a movable body
        // occurs once in a color, so no other task of this color reads or writes it. No task writes a body that cannot
        // move.
        let mut pair = unsafe { wide_pair::<L>(states, &group.a, &group.b) };
        if kernel.is_from_start() {
            let free = self.free.as_ptr();
            // SAFETY: as above, and each state has a row of `free`, which no sweep writes.
            unsafe {
                pair.start_a = wide_start(free, &group.a.places, &pair.mass_a);
                pair.start_b = wide_start(free, &group.b.places, &pair.mass_b);
            }
        }
        if AS_ONE && kernel.moves_bodies() && !kernel.is_from_start() {
            let free = self.free.as_ptr();
            // SAFETY: as above, and no other task of this color writes the rows of these bodies.
            unsafe {
                begin_bounces(&pair.mass_a, &mut pair.a, &wide_free(free, &group.a.places));
                begin_bounces(&pair.mass_b, &mut pair.b, &wide_free(free, &group.b.places));
            }
        }
        let own = group.impulses();
        // Use impulses and rows in place: copies were most of the memory traffic of a sweep.
        // SAFETY: `LaneLayout::make_groups` gives each group impulses and points of its own.
        let mut rows =
            unsafe { GroupRows { points: self.points.slice(own.clone()), impulses: self.impulses.slice(own) } };
        if C::HAS_POINTS {
            // SAFETY: `Contact` is `repr(C)` and holds lanes only.
            let contact: &Contact<L> = unsafe { as_lanes(&group.header) };
            sweep_contact(kernel, AS_ONE, params, &mut pair, contact, &mut rows);
        } else {
            let joint = rows.joint::<L>(&group.header);
            let mut impulse = rows.impulses.components(0);
            sweep_joint(kernel, params, &mut pair, &joint, &mut impulse, &mut rows);
            rows.impulses.set_components(0, impulse);
        }
        // SAFETY: as above.
        unsafe {
            if AS_ONE && kernel.moves_bodies() {
                self.end_bounces(kernel, &group.a, &mut pair.a);
                self.end_bounces(kernel, &group.b, &mut pair.b);
            }
            store_velocities(states, &group.a, &pair.a);
            store_velocities(states, &group.b, &pair.b);
        }
        if kernel.is_measured() && pair.moving.store().0.iter().any(|&m| m > 0.0) {
            self.moving.store(true, Ordering::Relaxed);
        }
    }

    /// Stores the movements of bodies that may have bounced, and the bounces in the velocities without impulses. The
    /// states still have the velocities before.
    ///
    /// # Safety
    /// That of [`store_velocities`], and each state has a row of `free` that no other task uses meanwhile.
    #[inline(always)]
    unsafe fn end_bounces<L: Lanes>(&self, kernel: Kernel, bodies: &BodyLanes, body: &mut Body<L>) {
        let BodyLanes { places, movable, .. } = *bodies;
        let (states, rows) = (self.bodies.as_ptr(), self.free.as_ptr());
        let movements = movement_rows(body);
        if !kernel.is_from_start() {
            // SAFETY: the caller's promise.
            let (before, mut free) = unsafe { (wide_body::<L>(states, &places), wide_free::<L>(rows, &places)) };
            end_bounces([before.v, before.w], body, &mut free);
            let velocities = velocity_rows(free.v, free.w);
            for lane in (0..WIDTH).filter(|lane| movable & (1 << lane) != 0) {
                // SAFETY: the caller's promise.
                unsafe { free_row(rows, places[lane]).write(velocities[lane]) };
            }
        }
        for lane in (0..WIDTH).filter(|lane| movable & (1 << lane) != 0) {
            // SAFETY: the caller's promise.
            unsafe {
                row_at((&raw mut (*states).movement).cast_const(), places[lane]).cast_mut().write(movements[lane])
            };
        }
    }
}

/// Clears some impulses. Each task has its own.
pub(super) fn clear_impulses(impulses: &SharedImpulses, range: Range<usize>) {
    // SAFETY: tasks have different parts, and `LaneLayout::impulses_of` gives each part impulses of its own.
    let OwnImpulses { normals, tangents, bounces: _ } = unsafe { impulses.slice(range) };
    normals.fill(Wide::default());
    tangents.fill([Wide::default(); 2]);
}

/// Adds some impulses to their sums.
pub(super) struct Sums<'a> {
    pub is_first: bool,
    pub impulses: SharedImpulses<'a>,
    pub totals: SharedImpulses<'a>,
}

impl Work for Sums<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, range: Range<usize>) {
        let count = range.len();
        // SAFETY: tasks have different ranges, and no pass runs at the same time.
        let (impulses, mut totals) = unsafe { (self.impulses.slice(range.clone()), self.totals.slice(range)) };
        for k in 0..count {
            let (now, mut total): (Impulse<L>, Impulse<L>) = (impulses.impulse(k), totals.impulse(k));
            sum_impulse(self.is_first, &now, &mut total);
            totals.set_components(k, total.components());
            totals.bounces[k] = total.bounce.store();
        }
    }
}

/// Sixteen pairs of bodies.
///
/// # Safety
/// The places are those of states, and no thread writes them meanwhile.
#[inline(always)]
unsafe fn wide_pair<L: Lanes>(states: *const State, a: &BodyLanes, b: &BodyLanes) -> Pair<L> {
    // SAFETY: the caller's promise.
    unsafe {
        Pair {
            a: wide_body::<L>(states, &a.places),
            b: wide_body::<L>(states, &b.places),
            mass_a: wide_mass::<L>(states, &a.places),
            mass_b: wide_mass::<L>(states, &b.places),
            start_a: Free::default(),
            start_b: Free::default(),
            moving: L::constant(0.0),
        }
    }
}

/// Writes the velocities of the movable bodies.
///
/// # Safety
/// The places are those of states, and no other thread uses those that can move meanwhile.
#[inline(always)]
unsafe fn store_velocities<L: Lanes>(states: *mut State, bodies: &BodyLanes, body: &Body<L>) {
    let BodyLanes { places, movable, has_locks } = *bodies;
    if movable == 0 {
        return;
    }
    let rows = velocity_rows(body.v, body.w);
    for lane in 0..WIDTH {
        // Almost always all are movable.
        if movable == u16::MAX || movable & (1 << lane) != 0 {
            // SAFETY: the caller's promise.
            unsafe { row_at((&raw mut (*states).velocity).cast_const(), places[lane]).cast_mut().write(rows[lane]) };
        }
    }
    if has_locks {
        // SAFETY: the caller's promise.
        unsafe { keep_locks(states, places, movable) };
    }
}

/// Stops movable bodies along their locked axes. It is not inline: the sweeps of worlds without locks would take
/// longer.
///
/// # Safety
/// That of [`store_velocities`].
#[cold]
#[inline(never)]
unsafe fn keep_locks(states: *mut State, places: [u32; WIDTH], movable: u16) {
    for lane in (0..WIDTH).filter(|lane| movable & (1 << lane) != 0) {
        // SAFETY: the caller's promise.
        let (locks, velocity) = unsafe {
            let mass = row_at(&raw const (*states).mass, places[lane]).read();
            (mass.0[7], &mut *row_at((&raw mut (*states).velocity).cast_const(), places[lane]).cast_mut())
        };
        for axis in (0..3).filter(|axis| locks as u32 & (1 << axis) != 0) {
            velocity.0[axis] = 0.0;
        }
    }
}

/// Sixteen-lane numbers as a value of lanes, in the same order.
///
/// # Safety
/// `T` is `repr(C)` and holds `N` lanes and nothing else.
#[inline(always)]
unsafe fn as_lanes<T, const N: usize>(numbers: &[Wide; N]) -> &T {
    const { assert!(size_of::<T>() == size_of::<[Wide; N]>() && align_of::<T>() <= align_of::<Wide>()) };
    // SAFETY: the caller's promise; a lane is sixteen numbers.
    unsafe { &*std::ptr::from_ref(numbers).cast() }
}
