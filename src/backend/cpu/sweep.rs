//! The inner loops of the lanes: what one task does to some groups of eight.

#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::groups::Group;
use super::lane8::{Lane8, Portable, Row8};
use super::shared::Shared;
use crate::kernels::contact::{restitute_contact, solve_contact, warm_start};
use crate::kernels::integrate::{integrate_positions, integrate_velocities};
use crate::kernels::momentum::extrapolated;
use crate::kernels::{Body, Contact, Free, Impulse, Mass, Pair, Point, SoftnessOf, StepParams, Sym3};
use crate::math::{Quat, Vec3, vec3};
use crate::plan::Kernel;
use crate::problem::{Params, Softness};

/// Velocities of a body, and its movement: v . w . and dp . dq.
#[derive(Clone, Copy, Default)]
pub(super) struct State {
    pub velocity: Row8,
    pub movement: Row8,
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

    /// Takes over the velocities.
    pub fn store_velocity(&mut self, body: &Body<f32>) {
        self.velocity = velocity_row(body.v, body.w);
    }
}

/// Two velocities in a row.
pub(super) fn velocity_row(v: Vec3<f32>, w: Vec3<f32>) -> Row8 {
    Row8([v.x, v.y, v.z, 0.0, w.x, w.y, w.z, 0.0])
}

/// The masses that a row of eight numbers holds.
pub(super) fn load_mass(row: &Row8) -> Mass<f32> {
    let [xx, xy, xz, inv_mass, yy, yz, zz, _] = row.0;
    Mass { inv_inertia: Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) }, inv_mass, acceleration: Vec3::default() }
}

/// An array of eight, without a closure: a closure would be compiled for the plain instruction set.
macro_rules! eight {
    ($lane:ident => $value:expr) => {
        [
            {
                let $lane = 0;
                $value
            },
            {
                let $lane = 1;
                $value
            },
            {
                let $lane = 2;
                $value
            },
            {
                let $lane = 3;
                $value
            },
            {
                let $lane = 4;
                $value
            },
            {
                let $lane = 5;
                $value
            },
            {
                let $lane = 6;
                $value
            },
            {
                let $lane = 7;
                $value
            },
        ]
    };
}

/// What a processor can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstructionSet {
    /// What every processor of its kind has.
    Portable,
    /// Eight numbers in one register of an x86-64 processor. Only [`InstructionSet::best`] makes it, after it has asked.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl InstructionSet {
    /// The best that this processor has.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2",
        }
    }
}

/// Enters the function of a work that was compiled for an instruction set.
macro_rules! enter {
    ($self:ident, $instructions:ident, $range:ident) => {
        match $instructions {
            InstructionSet::Portable => $self.run_on::<Portable>($range),
            // SAFETY: `InstructionSet::best` asked the processor.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => unsafe { $self.run_avx2($range) },
        }
    };
}

/// A pass over bodies.
pub(super) struct BodyWork<'a> {
    pub kernel: Kernel,
    pub params: &'a Params,
    pub bodies: Shared<'a, State>,
    pub free: Shared<'a, Row8>,
    pub accelerations: &'a [Row8],
}

impl BodyWork<'_> {
    /// Does groups of eight bodies; no other task has the same.
    pub fn run(&self, instructions: InstructionSet, groups: Range<usize>) {
        enter!(self, instructions, groups)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2(&self, groups: Range<usize>) {
        self.run_on::<super::lane8::avx2::Avx2>(groups);
    }

    #[inline(always)]
    fn run_on<L: Lane8>(&self, groups: Range<usize>) {
        let params = wide_params::<L>(self.params);
        for group in groups {
            let bodies: [usize; 8] = eight!(lane => 8 * group + lane);
            // SAFETY: tasks have different groups, and so different bodies.
            let states = unsafe { read_states(&self.bodies, bodies) };
            let mut body = wide_body::<L>(&states);
            if let Kernel::IntegrateVelocities { carry } = self.kernel {
                let [x, y, z, ..] = L::transposed(eight!(lane => L::load(&self.accelerations[bodies[lane]])));
                let mass = Mass { acceleration: vec3(x, y, z), ..Mass::default() };
                // SAFETY: as above.
                let rows = unsafe { self.free.slice(bodies[0]..bodies[0] + 8) };
                let [vx, vy, vz, _, wx, wy, wz, _] = L::transposed(eight!(lane => L::load(&rows[lane])));
                let mut free = Free { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz) };
                integrate_velocities(carry, &params, &mass, &mut body, &mut free);
                let (v, w, zero) = (free.v, free.w, L::constant(0.0));
                let freed = L::transposed([v.x, v.y, v.z, zero, w.x, w.y, w.z, zero]);
                for (row, lane) in rows.iter_mut().zip(freed) {
                    *row = lane.store();
                }
            } else {
                integrate_positions(&params, &mut body);
            }
            let (velocities, movements) = (velocity_rows(&body), movement_rows(&body));
            for (lane, &i) in bodies.iter().enumerate() {
                let state = State { velocity: velocities[lane].store(), movement: movements[lane].store() };
                // SAFETY: as above.
                unsafe { self.bodies.write(i, state) };
            }
        }
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
    // SAFETY: tasks have different bodies.
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
    pub masses: &'a [Row8],
    pub groups: &'a [Group],
    pub points: &'a [[Row8; 12]],
    pub impulses: Shared<'a, [Row8; 4]>,
    /// Set if a correction was above the tolerance.
    pub moving: &'a AtomicBool,
}

impl ContactWork<'_> {
    /// Does some groups; no other task has the same.
    pub fn run(&self, instructions: InstructionSet, groups: Range<usize>) {
        enter!(self, instructions, groups)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2(&self, groups: Range<usize>) {
        self.run_on::<super::lane8::avx2::Avx2>(groups);
    }

    #[inline(always)]
    fn run_on<L: Lane8>(&self, groups: Range<usize>) {
        let params = wide_params::<L>(self.params);
        for group in groups {
            self.sweep::<L>(&params, &self.groups[group]);
        }
    }

    #[inline(always)]
    fn sweep<L: Lane8>(&self, params: &StepParams<L>, group: &Group) {
        let (a, b): ([usize; 8], [usize; 8]) =
            (eight!(lane => group.body_a[lane] as usize), eight!(lane => group.body_b[lane] as usize));
        // SAFETY: a body that this color writes is in this group only; the others nobody writes.
        let (state_a, state_b) = unsafe { (read_states(&self.bodies, a), read_states(&self.bodies, b)) };
        let mut pair = Pair {
            a: wide_body::<L>(&state_a),
            b: wide_body::<L>(&state_b),
            mass_a: wide_mass::<L>(self.masses, a),
            mass_b: wide_mass::<L>(self.masses, b),
            moving: L::constant(0.0),
        };
        let rules = self.kernel.rules().unwrap_or_default();
        let rows = group.first_point as usize..(group.first_point + group.points) as usize;
        // Used where they lie: copied, they are most of what a sweep moves.
        // SAFETY: the rows of lanes are `repr(C)` and hold nothing else; the impulses of a group are its own.
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
        self.store_velocities(a, &pair.a, &state_a, &pair.mass_a);
        self.store_velocities(b, &pair.b, &state_b, &pair.mass_b);
        if rules.measured && pair.moving.store().0.iter().any(|&m| m > 0.0) {
            self.moving.store(true, Ordering::Relaxed);
        }
    }

    /// Writes the bodies that can move.
    #[inline(always)]
    fn store_velocities<L: Lane8>(&self, bodies: [usize; 8], body: &Body<L>, states: &[State; 8], mass: &Mass<L>) {
        let rows = velocity_rows(body);
        let inv_mass = mass.inv_mass.store();
        for (lane, &i) in bodies.iter().enumerate() {
            if inv_mass.0[lane] > 0.0 {
                let state = State { velocity: rows[lane].store(), ..states[lane] };
                // SAFETY: in one color a body that can move is in one lane of one group.
                unsafe { self.bodies.write(i, state) };
            }
        }
    }
}

/// # Safety
/// Nobody writes these bodies meanwhile.
#[inline(always)]
unsafe fn read_states(bodies: &Shared<State>, indices: [usize; 8]) -> [State; 8] {
    // SAFETY: the caller's promise.
    unsafe { eight!(lane => bodies.read(indices[lane])) }
}

#[inline(always)]
fn wide_body<L: Lane8>(states: &[State; 8]) -> Body<L> {
    let [vx, vy, vz, _, wx, wy, wz, _] = L::transposed(eight!(lane => L::load(&states[lane].velocity)));
    let [px, py, pz, _, qx, qy, qz, qw] = L::transposed(eight!(lane => L::load(&states[lane].movement)));
    Body { v: vec3(vx, vy, vz), w: vec3(wx, wy, wz), dp: vec3(px, py, pz), dq: Quat { axis: vec3(qx, qy, qz), w: qw } }
}

#[inline(always)]
fn velocity_rows<L: Lane8>(body: &Body<L>) -> [L; 8] {
    let (v, w, zero) = (body.v, body.w, L::constant(0.0));
    L::transposed([v.x, v.y, v.z, zero, w.x, w.y, w.z, zero])
}

#[inline(always)]
fn movement_rows<L: Lane8>(body: &Body<L>) -> [L; 8] {
    let (p, q) = (body.dp, body.dq);
    L::transposed([p.x, p.y, p.z, L::constant(0.0), q.axis.x, q.axis.y, q.axis.z, q.w])
}

#[inline(always)]
fn wide_mass<L: Lane8>(masses: &[Row8], bodies: [usize; 8]) -> Mass<L> {
    let [xx, xy, xz, inv_mass, yy, yz, zz, _] = L::transposed(eight!(lane => L::load(&masses[bodies[lane]])));
    Mass { inv_inertia: Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) }, inv_mass, acceleration: Vec3::default() }
}

/// Rows of eight as rows of lanes, in the same order.
///
/// # Safety
/// `T` is `repr(C)` and holds `N` lanes and nothing else.
#[inline(always)]
unsafe fn as_lanes<T, const N: usize>(rows: &[[Row8; N]]) -> &[T] {
    const { assert!(size_of::<T>() == size_of::<[Row8; N]>() && align_of::<T>() <= align_of::<Row8>()) };
    // SAFETY: the caller's promise; a lane is eight numbers.
    unsafe { std::slice::from_raw_parts(rows.as_ptr().cast(), rows.len()) }
}

/// The same, to write.
///
/// # Safety
/// As above.
#[inline(always)]
unsafe fn as_lanes_mut<T, const N: usize>(rows: &mut [[Row8; N]]) -> &mut [T] {
    const { assert!(size_of::<T>() == size_of::<[Row8; N]>() && align_of::<T>() <= align_of::<Row8>()) };
    // SAFETY: as above.
    unsafe { std::slice::from_raw_parts_mut(rows.as_mut_ptr().cast(), rows.len()) }
}

/// Once a task, so that closures do no harm.
#[inline(always)]
fn wide_params<L: Lane8>(p: &Params) -> StepParams<L> {
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
