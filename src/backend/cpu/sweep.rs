//! The inner loop of the lanes: a pass over groups of sixteen constraints.

#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bodies::{State, velocity_rows, wide_body};
use super::constraint::Constraint;
use super::lane_layout::{BodyLanes, LaneGroup, LaneLayout};
use super::shared::Shared;
use super::simd::{Lanes, WIDTH, Wide, Work, row_at};
use crate::kernels::contact::{restitute_contact, solve_contact, warm_start};
use crate::kernels::joint::{solve_joint, warm_start_joint};
use crate::kernels::joint_system::{apply_joint_change, measure_joint};
use crate::kernels::{Body, Contact, Impulse, Joint, Mass, Pair, Point, Rules, StepParams, Sym3};
use crate::math::{Vec3, vec3};
use crate::plan::Kernel;
use crate::problem::{ContactRow, JointRow, Params};

/// A pass over the groups of one color.
pub(super) struct Sweep<'a, C> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub bodies: Shared<'a, State>,
    pub layout: &'a LaneLayout<C>,
    pub impulses: Shared<'a, [Wide; 4]>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

impl<C: Swept> Work for Sweep<'_, C> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        let params = StepParams::<L>::load(self.params);
        for group in groups {
            self.sweep::<L>(&params, &self.layout.groups[group]);
        }
    }
}

impl<C: Swept> Sweep<'_, C> {
    #[inline(always)]
    fn sweep<L: Lanes>(&self, params: &StepParams<L>, group: &LaneGroup) {
        let states = self.bodies.as_ptr();
        // SAFETY: `BodyLanes::set` looked up the slot of every lane. A body that can move occurs once in a color (`CheckedStep`
        // holds that), so that no other task of this color reads or writes it; no task writes a body that cannot move.
        let mut pair = unsafe { wide_pair::<L>(states, &group.a, &group.b) };
        let rules = self.kernel.rules().unwrap_or_default();
        let rows = group.impulses();
        let points = if C::HAS_POINTS { &self.layout.points[rows.clone()] } else { &[] };
        // Impulses and rows are used in place: copies were most of what a sweep moved.
        // SAFETY: `Impulse` is `repr(C)` and holds lanes only; `LaneLayout::make_groups` gives each group impulses of its own.
        let impulses: &mut [Impulse<L>] = unsafe { as_lanes_mut(self.impulses.slice(rows)) };
        C::apply(self.kernel, rules, params, &mut pair, &group.header, points, impulses);
        // SAFETY: as above.
        unsafe { store_pair(states, &group.a, &group.b, &pair) };
        note_moving(rules, &pair, self.moving);
    }
}

/// A constraint that sweeps change.
pub(super) trait Swept: Constraint {
    /// Applies a kernel to sixteen constraints.
    fn apply<L: Lanes>(
        kernel: Kernel,
        rules: Rules,
        params: &StepParams<L>,
        pair: &mut Pair<L>,
        header: &[Wide; 11],
        points: &[[Wide; 12]],
        impulses: &mut [Impulse<L>],
    );
}

impl Swept for ContactRow {
    #[inline(always)]
    fn apply<L: Lanes>(
        kernel: Kernel,
        rules: Rules,
        params: &StepParams<L>,
        pair: &mut Pair<L>,
        header: &[Wide; 11],
        points: &[[Wide; 12]],
        impulses: &mut [Impulse<L>],
    ) {
        // SAFETY: `Contact` and `Point` are `repr(C)` and hold lanes only.
        let (contact, points): (&Contact<L>, &[Point<L>]) =
            unsafe { (&as_lanes(std::slice::from_ref(header))[0], as_lanes(points)) };
        match kernel {
            Kernel::WarmStart(_) => warm_start(rules, pair, contact, points, impulses),
            Kernel::SolveContacts(_) => solve_contact(rules, params, pair, contact, points, impulses),
            _ => restitute_contact(rules, params, pair, contact, points, impulses),
        }
    }
}

impl Swept for JointRow {
    #[inline(always)]
    fn apply<L: Lanes>(
        kernel: Kernel,
        rules: Rules,
        params: &StepParams<L>,
        pair: &mut Pair<L>,
        header: &[Wide; 11],
        _: &[[Wide; 12]],
        impulses: &mut [Impulse<L>],
    ) {
        let [joint @ .., _, _]: &[Wide; 11] = header;
        // SAFETY: `Joint` is `repr(C)` and holds lanes only.
        let joint: &Joint<L> = unsafe { &as_lanes::<_, 9>(std::slice::from_ref(joint))[0] };
        let mut impulse = impulses[0].components();
        match kernel {
            Kernel::WarmStartJoints => return warm_start_joint(pair, joint, impulse),
            Kernel::ApplyJointChanges(_) => return apply_joint_change(pair, joint, impulse),
            Kernel::MeasureJoints(_) => impulse = measure_joint(rules, params, pair, joint),
            _ => solve_joint(rules, params, pair, joint, &mut impulse),
        }
        impulses[0].set_components(impulse);
    }
}

/// Clears some impulses. Each task has its own.
pub(super) fn clear_impulses(impulses: &Shared<[Wide; 4]>, range: Range<usize>) {
    // SAFETY: tasks have different parts, and `LaneLayout::impulses_of` gives each part impulses of its own.
    for impulse in unsafe { impulses.slice(range) } {
        impulse[..3].fill(Wide::default());
    }
}

/// Sets `moving` if the correction of a lane was above the tolerance.
#[inline(always)]
fn note_moving<L: Lanes>(rules: Rules, pair: &Pair<L>, moving: &AtomicBool) {
    if rules.measured && pair.moving.store().0.iter().any(|&m| m > 0.0) {
        moving.store(true, Ordering::Relaxed);
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
            moving: L::constant(0.0),
        }
    }
}

/// Writes what can move of a pair.
///
/// # Safety
/// The places are those of states, and no other thread uses those that can move meanwhile.
#[inline(always)]
unsafe fn store_pair<L: Lanes>(states: *mut State, a: &BodyLanes, b: &BodyLanes, pair: &Pair<L>) {
    // SAFETY: the caller's promise.
    unsafe {
        store_velocities(states, a, &pair.a);
        store_velocities(states, b, &pair.b);
    }
}

/// # Safety
/// As of [`wide_pair`].
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
unsafe fn store_velocities<L: Lanes>(states: *mut State, bodies: &BodyLanes, body: &Body<L>) {
    let BodyLanes { places, movable } = *bodies;
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
