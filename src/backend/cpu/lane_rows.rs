//! Points and impulses of the lanes, separated by use: a sweep streams only the numbers that it reads.
//!
//! A biased sweep without friction reads the first eight numbers of a point and its normal impulse. Friction reads one
//! more number and the two tangential impulses. The lanes hold relative accelerations, slips and bounces only if
//! a pass uses them.

#![allow(unsafe_code)]

use std::ops::Range;

use super::constraint::AxisRows;
use crate::kernels::contact::PointRows;
use crate::kernels::{Axis, Impulse, Joint, Point};
use crate::lanes::{Lanes, Shared, Wide};
use crate::math::{Quat, Vec3, vec3};

/// Loads lanes without a closure: a closure would be compiled for the plain instruction set.
macro_rules! loaded {
    ($numbers:expr; $($i:literal)*) => {{
        let numbers = $numbers;
        [$(L::load(&numbers[$i])),*]
    }};
}

/// The numbers of points, or of the axes of joints, in the order of their rows.
#[derive(Default)]
pub(super) struct LanePoints {
    /// Arms, separation, normal mass; the first eight numbers of an axis.
    pub arms: Vec<[Wide; 8]>,
    /// Tangent mass; the ninth number of an axis.
    pub tangent_masses: Vec<Wide>,
    /// Relative acceleration and slip; the last three numbers of an axis. Empty if no pass reads them.
    pub others: Vec<[Wide; 3]>,
}

/// Impulses, in the order of their rows.
#[derive(Default)]
pub(super) struct LaneImpulses {
    pub normals: Vec<Wide>,
    /// Along both tangents.
    pub tangents: Vec<[Wide; 2]>,
    /// The bounces; empty if no pass keeps them.
    pub bounces: Vec<Wide>,
}

impl LanePoints {
    pub fn resize(&mut self, count: usize, has_others: bool) {
        self.arms.resize(count, Default::default());
        self.tangent_masses.resize(count, Default::default());
        self.others.resize(if has_others { count } else { 0 }, Default::default());
    }

    pub fn shared(&mut self) -> SharedPoints<'_> {
        let Self { arms, tangent_masses, others } = self;
        SharedPoints {
            arms: Shared::new(arms),
            tangent_masses: Shared::new(tangent_masses),
            others: Shared::new(others),
        }
    }

    /// Bytes that a sweep reads, with or without friction. No sweep reads the last numbers.
    pub fn bytes(&self, has_friction: bool) -> usize {
        size_of_val(&self.arms[..]) + if has_friction { size_of_val(&self.tangent_masses[..]) } else { 0 }
    }
}

impl LaneImpulses {
    pub fn resize(&mut self, count: usize, has_bounces: bool) {
        self.normals.resize(count, Default::default());
        self.tangents.resize(count, Default::default());
        self.bounces.resize(if has_bounces { count } else { 0 }, Default::default());
    }

    pub fn shared(&mut self) -> SharedImpulses<'_> {
        let Self { normals, tangents, bounces } = self;
        SharedImpulses { normals: Shared::new(normals), tangents: Shared::new(tangents), bounces: Shared::new(bounces) }
    }

    /// Normal impulse and friction, and the bounce or zero.
    #[inline(always)]
    pub fn numbers(&self, i: usize) -> [&Wide; 4] {
        let [one, two] = &self.tangents[i];
        [&self.normals[i], one, two, if self.bounces.is_empty() { &ZERO } else { &self.bounces[i] }]
    }

    /// The three components of sixteen impulses.
    pub fn components<L: Lanes>(&self, i: usize) -> Vec3<L> {
        vec3(L::load(&self.normals[i]), L::load(&self.tangents[i][0]), L::load(&self.tangents[i][1]))
    }

    /// Bytes that a sweep reads and writes, with or without friction.
    pub fn bytes(&self, has_friction: bool) -> usize {
        size_of_val(&self.normals[..]) + if has_friction { size_of_val(&self.tangents[..]) } else { 0 }
    }
}

const ZERO: Wide = Wide([0.0; crate::lanes::WIDTH]);

/// Points, shared by threads with different ones.
#[derive(Clone, Copy)]
pub(super) struct SharedPoints<'a> {
    arms: Shared<'a, [Wide; 8]>,
    tangent_masses: Shared<'a, Wide>,
    others: Shared<'a, [Wide; 3]>,
}

/// Impulses, shared by threads with different ones.
#[derive(Clone, Copy)]
pub(super) struct SharedImpulses<'a> {
    normals: Shared<'a, Wide>,
    tangents: Shared<'a, [Wide; 2]>,
    bounces: Shared<'a, Wide>,
}

impl<'a> SharedPoints<'a> {
    /// Some points, to write in place.
    ///
    /// # Safety
    /// No other thread reads or writes them meanwhile.
    #[inline(always)]
    pub unsafe fn slice(&self, range: Range<usize>) -> OwnPoints<'a> {
        // SAFETY: the caller's promise.
        unsafe {
            OwnPoints {
                arms: self.arms.slice(present(&self.arms, &range)),
                tangent_masses: self.tangent_masses.slice(present(&self.tangent_masses, &range)),
                others: self.others.slice(present(&self.others, &range)),
            }
        }
    }
}

impl<'a> SharedImpulses<'a> {
    /// Some impulses, to write in place.
    ///
    /// # Safety
    /// Those of [`SharedPoints::slice`].
    #[inline(always)]
    pub unsafe fn slice(&self, range: Range<usize>) -> OwnImpulses<'a> {
        // SAFETY: the caller's promise.
        unsafe {
            OwnImpulses {
                bounces: self.bounces.slice(present(&self.bounces, &range)),
                normals: self.normals.slice(range.clone()),
                tangents: self.tangents.slice(range),
            }
        }
    }

    /// The component `k` of one lane.
    ///
    /// # Safety
    /// No other thread reads or writes it meanwhile.
    #[inline(always)]
    pub unsafe fn number(&self, i: usize, k: usize, lane: usize) -> &'a mut f32 {
        let wide = match k {
            0 => self.normals.as_ptr().wrapping_add(i),
            _ => self.tangents.as_ptr().cast::<Wide>().wrapping_add(2 * i + k - 1),
        };
        // SAFETY: the caller's promise. This reaches one lane, and no other.
        unsafe { &mut *wide.cast::<f32>().add(lane) }
    }
}

/// The range, or an empty one if nothing is stored.
#[inline(always)]
fn present<T: Copy>(rows: &Shared<T>, range: &Range<usize>) -> Range<usize> {
    if rows.is_empty() { 0..0 } else { range.clone() }
}

/// Points of one thread.
pub(super) struct OwnPoints<'a> {
    pub arms: &'a mut [[Wide; 8]],
    pub tangent_masses: &'a mut [Wide],
    pub others: &'a mut [[Wide; 3]],
}

/// Impulses of one thread.
pub(super) struct OwnImpulses<'a> {
    pub normals: &'a mut [Wide],
    pub tangents: &'a mut [[Wide; 2]],
    pub bounces: &'a mut [Wide],
}

impl OwnPoints<'_> {
    /// Writes one lane of a point.
    pub fn set_lane(&mut self, k: usize, lane: usize, numbers: &[f32; 12]) {
        let [arms @ .., tangent_mass, pull, slip_1, slip_2] = numbers;
        let arms: &[f32; 8] = arms;
        self.arms[k].iter_mut().zip(arms).for_each(|(wide, number)| wide.0[lane] = *number);
        self.tangent_masses[k].0[lane] = *tangent_mass;
        if let Some(others) = self.others.get_mut(k) {
            others.iter_mut().zip([pull, slip_1, slip_2]).for_each(|(wide, number)| wide.0[lane] = *number);
        }
    }
}

impl OwnImpulses<'_> {
    /// Writes sixteen impulses.
    #[inline(always)]
    pub fn set(&mut self, k: usize, [normal, tangent_1, tangent_2, bounce]: [Wide; 4]) {
        (self.normals[k], self.tangents[k]) = (normal, [tangent_1, tangent_2]);
        if let Some(own) = self.bounces.get_mut(k) {
            *own = bounce;
        }
    }

    /// Writes one lane.
    pub fn set_lane(&mut self, k: usize, lane: usize, [normal, tangent_1, tangent_2, bounce]: &[f32; 4]) {
        self.normals[k].0[lane] = *normal;
        [self.tangents[k][0].0[lane], self.tangents[k][1].0[lane]] = [*tangent_1, *tangent_2];
        if let Some(own) = self.bounces.get_mut(k) {
            own.0[lane] = *bounce;
        }
    }

    /// Changes the three components.
    #[inline(always)]
    pub fn set_components<L: Lanes>(&mut self, k: usize, Vec3 { x, y, z }: Vec3<L>) {
        (self.normals[k], self.tangents[k]) = (x.store(), [y.store(), z.store()]);
    }

    /// The three components of sixteen impulses.
    #[inline(always)]
    pub fn components<L: Lanes>(&self, k: usize) -> Vec3<L> {
        self.impulse::<L>(k).components()
    }

    /// Sixteen impulses. The bounces are zero if no pass keeps them.
    #[inline(always)]
    pub fn impulse<L: Lanes>(&self, k: usize) -> Impulse<L> {
        let [tangent_1, tangent_2] = loaded!(&self.tangents[k]; 0 1);
        let bounce = match self.bounces.get(k) {
            Some(bounce) => L::load(bounce),
            None => L::constant(0.0),
        };
        Impulse { normal: L::load(&self.normals[k]), tangent_1, tangent_2, bounce }
    }
}

/// The points of a group and their impulses.
pub(super) struct GroupRows<'a> {
    pub points: OwnPoints<'a>,
    pub impulses: OwnImpulses<'a>,
}

impl<L: Lanes> PointRows<L> for GroupRows<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.impulses.normals.len()
    }
    #[inline(always)]
    fn point(&self, k: usize) -> Point<L> {
        let [ax, ay, az, separation, bx, by, bz, normal_mass] = loaded!(&self.points.arms[k]; 0 1 2 3 4 5 6 7);
        let [pull, slip_1, slip_2] = match self.points.others.get(k) {
            Some(others) => loaded!(others; 0 1 2),
            None => [L::constant(0.0); 3],
        };
        Point {
            r_a: vec3(ax, ay, az),
            separation,
            r_b: vec3(bx, by, bz),
            normal_mass,
            tangent_mass: L::load(&self.points.tangent_masses[k]),
            pull,
            slip_1,
            slip_2,
        }
    }
    #[inline(always)]
    fn impulse(&self, k: usize) -> Impulse<L> {
        self.impulses.impulse(k)
    }
    #[inline(always)]
    fn set_normal(&mut self, k: usize, normal: L) {
        self.impulses.normals[k] = normal.store();
    }
    #[inline(always)]
    fn set_friction(&mut self, k: usize, tangent_1: L, tangent_2: L) {
        self.impulses.tangents[k] = [tangent_1.store(), tangent_2.store()];
    }
    #[inline(always)]
    fn set_bounce(&mut self, k: usize, bounce: L) {
        self.impulses.bounces[k] = bounce.store();
    }
}

impl GroupRows<'_> {
    /// A joint from its arms, gap and looseness, and from its frames in the place of its anchors. Without axes it has no
    /// frames.
    #[inline(always)]
    pub fn joint<L: Lanes>(&self, header: &[Wide; 11]) -> Joint<L> {
        let [ax, ay, az, bx, by, bz, gx, gy, gz, is_loose] = loaded!(header; 0 1 2 3 4 5 6 7 8 9);
        let (mut frame_a, mut frame_b) = (Quat::default(), Quat::default());
        if let (Some(arms), Some(others)) = (self.points.arms.first(), self.points.others.first()) {
            let [fx, fy, fz, fw] = loaded!(arms; 4 5 6 7);
            let [y, z, w] = loaded!(others; 0 1 2);
            frame_a = Quat { axis: vec3(fx, fy, fz), w: fw };
            frame_b = Quat { axis: vec3(L::load(&self.points.tangent_masses[0]), y, z), w };
        }
        Joint { r_a: vec3(ax, ay, az), r_b: vec3(bx, by, bz), gap: vec3(gx, gy, gz), is_loose, frame_a, frame_b }
    }
}

/// The axes of a joint come after its anchors.
impl<L: Lanes> AxisRows<L> for GroupRows<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.points.arms.len().saturating_sub(1)
    }
    #[inline(always)]
    fn axis(&self, k: usize) -> Axis<L> {
        let [x, y, z, coordinate, gap, left, speed, max_impulse] = loaded!(&self.points.arms[k + 1]; 0 1 2 3 4 5 6 7);
        let [mass_scale, impulse_scale, start] = loaded!(&self.points.others[k + 1]; 0 1 2);
        let rate = L::load(&self.points.tangent_masses[k + 1]);
        let direction = vec3(x, y, z);
        Axis { direction, coordinate, gap, left, speed, max_impulse, rate, mass_scale, impulse_scale, start }
    }
    #[inline(always)]
    fn impulse(&self, k: usize) -> L {
        L::load(&self.impulses.normals[k + 1])
    }
    #[inline(always)]
    fn set_impulse(&mut self, k: usize, impulse: L) {
        self.impulses.normals[k + 1] = impulse.store();
    }
}
