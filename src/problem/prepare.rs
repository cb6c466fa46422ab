//! Effective masses, separations and preloads of slots, sixteen slots at a time.
//!
//! Memory takes most of the time: each manifold has 160 B of rows and 192 B of points, and two bodies at any place. The
//! former state of a reused manifold is stored in the order of the slots. Reading it from its pair took 36 ns of the 91
//! ns for each manifold.

#![allow(unsafe_code)]

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::carry::{Preload, preloaded};
use super::rows::{ContactRow, ImpulseRow, MassRow, PointRow};
use crate::collide::{MAX_POINTS, Manifold, Placed};
use crate::lanes::{Lanes, Row8, Shared, WIDTH, Wide, Work};
use crate::math::effective_mass::{Frame, Mass, PointKinds, Pose, Sym3, movement_since, point_masses};
use crate::math::{Quat, reciprocal, vec3};

/// Pose of a body, 32 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct PoseRow {
    /// Center of mass (m).
    pub center: [f32; 3],
    pub pad: f32,
    /// Rotation, x y z w.
    pub rotation: [f32; 4],
}

/// The data that a manifold was computed from, 64 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct ComputedRow {
    /// From the center of mass of a to that of b (m).
    apart: [f32; 3],
    pad: f32,
    /// Rotations of a and b, x y z w.
    rotation_a: [f32; 4],
    rotation_b: [f32; 4],
    /// Separations of its points (m).
    separations: [f32; MAX_POINTS],
}

crate::saved::fields!(ComputedRow { apart, pad, rotation_a, rotation_b, separations });

impl ComputedRow {
    pub fn of([a, b]: &[Placed; 2], manifold: &Manifold) -> Self {
        let mut separations = [0.0; MAX_POINTS];
        separations.iter_mut().zip(manifold.points()).for_each(|(to, point)| *to = point.separation);
        Self {
            apart: (b.center - a.center).to_array(),
            pad: 0.0,
            rotation_a: a.rotation.to_array(),
            rotation_b: b.rotation.to_array(),
            separations,
        }
    }
}

/// The rows of the slots that one task prepares, and the tables that it reads.
pub(super) struct Prepare<'a> {
    pub stride: usize,
    pub masses: &'a [MassRow],
    pub poses: &'a [PoseRow],
    pub preload: &'a Preload,
    pub contacts: Shared<'a, ContactRow>,
    pub points: Shared<'a, PointRow>,
    pub impulses: Shared<'a, ImpulseRow>,
    pub computed: &'a [ComputedRow],
    pub sags: Shared<'a, f32>,
    /// Whether any point of a slot jams.
    pub jams: Shared<'a, bool>,
}

/// One kind of preparation over some slots, in ascending order.
pub(super) struct PrepareSlots<'a> {
    pub rows: &'a Prepare<'a>,
    pub slots: &'a [u32],
    pub preparation: Preparation,
}

#[derive(Clone, Copy)]
pub(super) enum Preparation {
    /// The effective masses of points.
    Masses(PointKinds),
    /// The present separations of points, and then preloads and sags from the impulses of the step before.
    Begin { separations: bool, loads: bool },
}

/// Sixteen slots. The last slot also fills the lanes that are left.
struct Group {
    slots: [u32; WIDTH],
    len: usize,
    bodies: [[u32; WIDTH]; 2],
    counts: [u32; WIDTH],
    most: u32,
}

/// Size of a row in units of 8 bytes.
const fn units<T>() -> u32 {
    (size_of::<T>() / 8) as u32
}

impl PrepareSlots<'_> {
    #[inline(always)]
    fn group(&self, group: usize) -> Group {
        let own = &self.slots[WIDTH * group..(WIDTH * (group + 1)).min(self.slots.len())];
        let mut slots = [own[own.len() - 1]; WIDTH];
        slots[..own.len()].copy_from_slice(own);
        let (mut bodies, mut counts, mut most) = ([[0; WIDTH]; 2], [0; WIDTH], 0);
        for lane in 0..WIDTH {
            // SAFETY: tasks have different slots.
            let contact = unsafe { &self.rows.contacts.slice(slots[lane] as usize..slots[lane] as usize + 1)[0] };
            let count = self.rows.masses.len().min(self.rows.poses.len());
            assert!((contact.body_a as usize) < count && (contact.body_b as usize) < count);
            (bodies[0][lane], bodies[1][lane], counts[lane]) = (contact.body_a, contact.body_b, contact.point_count);
            most = most.max(contact.point_count);
        }
        assert!((slots[WIDTH - 1] as usize) < self.rows.computed.len() && most as usize <= MAX_POINTS);
        Group { slots, len: own.len(), bodies, counts, most }
    }

    /// Normal, friction, tangent and restitution of contacts (half 0), or the other half of their rows.
    #[inline(always)]
    fn contacts<L: Lanes>(&self, group: &Group, half: u32) -> [L; 8] {
        let places = places(&group.slots, units::<ContactRow>(), 4 * half);
        // SAFETY: `group` has seen each of these rows, and only this task has them.
        unsafe { L::gathered(self.rows.contacts.as_ptr().cast(), &places) }
    }

    /// Arms, separation and normal mass of the points `k`.
    #[inline(always)]
    fn points<L: Lanes>(&self, group: &Group, k: usize) -> [L; 8] {
        let stride = self.rows.stride as u32 * units::<PointRow>();
        let places = places(&group.slots, stride, k as u32 * units::<PointRow>());
        // SAFETY: a slot has `stride` points, more than `k`, and only this task has them.
        unsafe { L::gathered(self.rows.points.as_ptr().cast(), &places) }
    }

    /// The impulses `k` and `k + 1`.
    #[inline(always)]
    fn impulses<L: Lanes>(&self, group: &Group, k: u32) -> [L; 8] {
        let stride = self.rows.stride as u32 * units::<ImpulseRow>();
        let places = places(&group.slots, stride, k * units::<ImpulseRow>());
        // SAFETY: as for points.
        unsafe { L::gathered(self.rows.impulses.as_ptr().cast(), &places) }
    }

    /// The data that manifolds were computed from, the first or the second half.
    #[inline(always)]
    fn computed<L: Lanes>(&self, group: &Group, half: u32) -> [L; 8] {
        let places = places(&group.slots, units::<ComputedRow>(), 4 * half);
        // SAFETY: slots ascend, and `group` has compared the last with the length.
        unsafe { L::gathered(self.rows.computed.as_ptr().cast(), &places) }
    }

    /// Inverse inertia and inverse mass of some bodies.
    #[inline(always)]
    fn masses<L: Lanes>(&self, bodies: &[u32; WIDTH]) -> Mass<L> {
        let places = places(bodies, units::<MassRow>(), 0);
        // SAFETY: `group` has compared each body with the length.
        let [xx, xy, xz, inv_mass, yy, yz, zz, locks] =
            unsafe { L::gathered(self.rows.masses.as_ptr().cast::<Row8>(), &places) };
        let inv_inertia = Sym3 { x: vec3(xx, xy, xz), yz: vec3(yy, yz, zz) };
        Mass { inv_inertia, inv_mass, locks, acceleration: Default::default() }
    }

    #[inline(always)]
    fn pose<L: Lanes>(&self, bodies: &[u32; WIDTH]) -> Pose<L> {
        let places = places(bodies, units::<PoseRow>(), 0);
        // SAFETY: as for masses.
        let [x, y, z, _, qx, qy, qz, qw] = unsafe { L::gathered(self.rows.poses.as_ptr().cast::<Row8>(), &places) };
        Pose { center: vec3(x, y, z), rotation: Quat { axis: vec3(qx, qy, qz), w: qw } }
    }

    #[inline(always)]
    fn write_masses<L: Lanes>(&self, group: &Group, kinds: PointKinds) {
        let [nx, ny, nz, friction, tx, ty, tz, _] = self.contacts::<L>(group, 0);
        let frame = Frame { normal: vec3(nx, ny, nz), tangent: vec3(tx, ty, tz), friction };
        let (a, b) = (self.masses::<L>(&group.bodies[0]), self.masses::<L>(&group.bodies[1]));
        let mut jammed = [false; WIDTH];
        for k in 0..group.most as usize {
            let [ax, ay, az, _, bx, by, bz, _] = self.points::<L>(group, k);
            let (r_a, r_b) = (vec3(ax, ay, az), vec3(bx, by, bz));
            let masses = point_masses(kinds, &frame, [&a, &b], [r_a, r_b]);
            let (normal, tangent, jamming) = (masses.normal.store(), masses.tangent.store(), masses.jamming.store());
            for (lane, jams) in jammed.iter_mut().enumerate().take(group.len) {
                if k < group.counts[lane] as usize {
                    let at = group.slots[lane] as usize * self.rows.stride + k;
                    // SAFETY: tasks have different slots.
                    let point = unsafe { &mut self.rows.points.slice(at..at + 1)[0] };
                    (point.normal_mass, point.tangent_mass) = (normal.0[lane], tangent.0[lane]);
                    *jams |= jamming.0[lane] > 1.0;
                }
            }
        }
        for (lane, &jams) in jammed.iter().enumerate().take(group.len) {
            // SAFETY: as above.
            unsafe { self.rows.jams.write(group.slots[lane] as usize, jams) };
        }
    }

    #[inline(always)]
    fn begin<L: Lanes>(&self, group: &Group, separations: bool, loads: bool) {
        let zero = L::constant(0.0);
        let [nx, ny, nz, ..] = self.contacts::<L>(group, 0);
        let [_, _, _, _, radius_a, radius_b, before, share] = self.contacts::<L>(group, 1);
        let [ax, ay, az, _, qx, qy, qz, qw] = self.computed::<L>(group, 0);
        let [px, py, pz, pw, s_0, s_1, s_2, s_3] = self.computed::<L>(group, 1);
        let then = [Quat { axis: vec3(qx, qy, qz), w: qw }, Quat { axis: vec3(px, py, pz), w: pw }];
        let poses = [self.pose::<L>(&group.bodies[0]), self.pose::<L>(&group.bodies[1])];
        let movement = movement_since(vec3(nx, ny, nz), [radius_a, radius_b], poses, vec3(ax, ay, az), then);
        let [i_0, _, _, _, i_1, _, _, _] = self.impulses::<L>(group, 0);
        let [i_2, _, _, _, i_3, _, _, _] = self.impulses::<L>(group, 2);
        let (from, impulses) = ([s_0, s_1, s_2, s_3], [i_0, i_1, i_2, i_3]);
        let mut counts = Wide::default();
        for lane in 0..WIDTH {
            counts.0[lane] = group.counts[lane] as f32;
        }
        let counts = L::load(&counts);
        let (mut pressed, mut mass) = (zero, zero);
        for k in 0..group.most as usize {
            let [ax, ay, az, _, bx, by, bz, normal_mass] = self.points::<L>(group, k);
            if separations {
                let now = (from[k] + movement.between(vec3(ax, ay, az), vec3(bx, by, bz))).store();
                for lane in 0..group.len {
                    if k < group.counts[lane] as usize {
                        let at = group.slots[lane] as usize * self.rows.stride + k;
                        // SAFETY: tasks have different slots.
                        unsafe { self.rows.points.slice(at..at + 1)[0].separation = now.0[lane] };
                    }
                }
            }
            let is_there = counts.gt(L::constant(k as f64));
            pressed = L::select(pressed, pressed + impulses[k], is_there);
            mass = L::select(mass, mass + normal_mass, is_there);
        }
        if !loads {
            return;
        }
        let (a, b) = (self.masses::<L>(&group.bodies[0]), self.masses::<L>(&group.bodies[1]));
        let both_movable = L::and(a.inv_mass.gt(zero), b.inv_mass.gt(zero));
        let yields = self.rows.preload.yielding(share, both_movable, pressed);
        let preload = preloaded(self.rows.preload, before, yields * reciprocal(mass)).store();
        let sag = (yields * (a.inv_mass + b.inv_mass)).store();
        for lane in 0..group.len {
            let slot = group.slots[lane] as usize;
            // SAFETY: tasks have different slots.
            unsafe {
                self.rows.contacts.slice(slot..slot + 1)[0].preload = preload.0[lane];
                self.rows.sags.write(slot, sag.0[lane]);
                let own = self.rows.impulses.slice(slot * self.rows.stride..(slot + 1) * self.rows.stride);
                if self.rows.preload.warm_start != 0 {
                    own.iter_mut().for_each(|impulse| impulse.bounce = 0.0);
                } else {
                    own.fill(ImpulseRow::default());
                }
            }
        }
    }
}

impl Work for PrepareSlots<'_> {
    #[inline(always)]
    fn over<L: Lanes>(&self, groups: Range<usize>) {
        for group in groups {
            let group = self.group(group);
            match self.preparation {
                Preparation::Masses(kinds) => self.write_masses::<L>(&group, kinds),
                Preparation::Begin { separations, loads } => self.begin::<L>(&group, separations, loads),
            }
        }
    }
}

/// The places of the rows of a table, in units of 8 bytes.
#[inline(always)]
fn places(rows: &[u32; WIDTH], stride: u32, offset: u32) -> [u32; WIDTH] {
    let mut places = *rows;
    for place in &mut places {
        *place = *place * stride + offset;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::InstructionSet;
    use crate::math::{self, NormalMovement};
    use crate::random::SplitMix64;

    const ALL: PointKinds = PointKinds { tangents: true, jams: true, locked: true };

    const STRIDE: usize = MAX_POINTS + 1;
    const SLOTS: usize = 53;
    const BODIES: usize = 7;
    const PRELOAD: Preload = Preload { movable_compliance: 0.5, fixed_compliance: 0.2, share: 0.1, warm_start: 1 };

    #[derive(Clone, Debug, PartialEq)]
    struct Tables {
        masses: Vec<MassRow>,
        poses: Vec<PoseRow>,
        contacts: Vec<ContactRow>,
        points: Vec<PointRow>,
        impulses: Vec<ImpulseRow>,
        computed: Vec<ComputedRow>,
        sags: Vec<f32>,
        jams: Vec<bool>,
    }

    fn random_tables() -> Tables {
        let mut random = SplitMix64::new(14);
        let mut number = || random.symmetric() as f32;
        let mut rotation =
            |near: [f32; 4]| glam::Quat::from_array(near.map(|x| x + 0.02 * number())).normalize().to_array();
        let rotations: Vec<[f32; 4]> = (0..BODIES).map(|k| rotation([0.3, k as f32, -0.5, 1.0])).collect();
        let before: Vec<[f32; 4]> = rotations.iter().map(|&q| rotation(q)).collect();
        let mut random = SplitMix64::new(15);
        let mut number = || random.symmetric() as f32;
        let mut vector = || [number(), number(), number()];
        let poses = rotations.iter().map(|&rotation| PoseRow { center: vector(), pad: 0.0, rotation }).collect();
        let masses = (0..BODIES).map(|k| {
            let [x, y, z] = vector();
            let movable = if k == 0 { 0.0 } else { 1.0 };
            MassRow {
                inv_inertia_x: [3.0 + x, 0.3 * y, 0.2 * z].map(|i| movable * i),
                inv_inertia_yz: [2.0 + y, 0.1 * x, 4.0 + z].map(|i| movable * i),
                inv_mass: movable * (1.5 + x),
                locks: (k % 8) as f32,
                ..MassRow::default()
            }
        });
        let masses = masses.collect();
        let contacts: Vec<_> = (0..SLOTS as u32)
            .map(|i| ContactRow {
                body_a: i % BODIES as u32,
                body_b: (i * i + i + 1) % BODIES as u32,
                first_point: i * STRIDE as u32,
                point_count: 1 + i % 4,
                friction: 0.1 * (i % 30) as f32,
                radius_a: if i % 5 == 0 { 0.5 } else { 0.0 },
                preload: 0.01,
                substep_share: if i % 3 == 0 { 0.5 } else { 1.0 },
                ..ContactRow::framed(glam::Vec3::from_array(vector()).normalize())
            })
            .collect();
        let computed = contacts.iter().map(|c| {
            let [x, y, z] = vector();
            ComputedRow {
                apart: vector(),
                pad: 0.0,
                rotation_a: before[c.body_a as usize],
                rotation_b: before[c.body_b as usize],
                separations: [x, y, z, x],
            }
        });
        let computed = computed.collect();
        let point = |_| PointRow { r_a: vector(), r_b: vector(), normal_mass: 1.0, ..PointRow::default() };
        let points = (0..SLOTS * STRIDE).map(point).collect();
        let impulse = |_| ImpulseRow { normal: vector()[0].abs(), tangent_1: 0.5, tangent_2: 0.1, bounce: 2.0 };
        let impulses = (0..SLOTS * STRIDE).map(impulse).collect();
        let (sags, jams) = (vec![0.0; SLOTS], vec![false; SLOTS]);
        Tables { masses, poses, contacts, points, impulses, computed, sags, jams }
    }

    fn in_lanes(tables: &mut Tables, slots: &[u32], set: InstructionSet) {
        for preparation in [Preparation::Masses(ALL), Preparation::Begin { separations: true, loads: true }] {
            let rows = Prepare {
                stride: STRIDE,
                masses: &tables.masses,
                poses: &tables.poses,
                preload: &PRELOAD,
                contacts: Shared::new(&mut tables.contacts),
                points: Shared::new(&mut tables.points),
                impulses: Shared::new(&mut tables.impulses),
                computed: &tables.computed,
                sags: Shared::new(&mut tables.sags),
                jams: Shared::new(&mut tables.jams),
            };
            set.run(&PrepareSlots { rows: &rows, slots, preparation }, 0..slots.len().div_ceil(WIDTH));
        }
    }

    /// One slot after another, with the kernels over plain numbers.
    fn one_by_one(tables: &mut Tables, slots: &[u32]) {
        for i in slots.iter().map(|&slot| slot as usize) {
            let contact = &mut tables.contacts[i];
            let load = math::Vec3::<f32>::load;
            let (normal, tangent) = (load(contact.normal), load(contact.tangent));
            let frame = Frame { normal, tangent, friction: contact.friction };
            let bodies = [contact.body_a as usize, contact.body_b as usize];
            let [a, b] = bodies.map(|body| Mass::<f32>::load(&tables.masses[body]));
            let pose = |body: usize| {
                let PoseRow { center, rotation, .. } = tables.poses[body];
                Pose { center: load(center), rotation: Quat::load(rotation) }
            };
            let from = &tables.computed[i];
            let then = [from.rotation_a, from.rotation_b].map(Quat::load);
            let radii = [contact.radius_a, contact.radius_b];
            let movement: NormalMovement<f32> = movement_since(normal, radii, bodies.map(pose), load(from.apart), then);
            let own = i * STRIDE..i * STRIDE + contact.point_count as usize;
            let (mut pressed, mut mass) = (0.0, 0.0);
            for (k, at) in own.enumerate() {
                let point = &mut tables.points[at];
                let (r_a, r_b) = (load(point.r_a), load(point.r_b));
                let masses = point_masses(ALL, &frame, [&a, &b], [r_a, r_b]);
                (point.normal_mass, point.tangent_mass) = (masses.normal, masses.tangent);
                point.separation = from.separations[k] + movement.between(r_a, r_b);
                tables.jams[i] |= masses.jamming > 1.0;
                pressed += tables.impulses[at].normal;
                mass += masses.normal;
            }
            let both = a.inv_mass > 0.0 && b.inv_mass > 0.0;
            let yields = PRELOAD.yielding(contact.substep_share, both, pressed);
            contact.preload = preloaded(&PRELOAD, contact.preload, yields * reciprocal(mass));
            tables.sags[i] = yields * (a.inv_mass + b.inv_mass);
            tables.impulses[i * STRIDE..(i + 1) * STRIDE].iter_mut().for_each(|impulse| impulse.bounce = 0.0);
        }
    }

    #[test]
    fn every_instruction_set_prepares_slots_with_the_bits_of_plain_numbers() {
        // The last group has free lanes, and some slots are left out.
        let slots: Vec<u32> = (0..SLOTS as u32).filter(|i| i % 7 != 2).collect();
        assert!(!slots.len().is_multiple_of(WIDTH));
        let before = random_tables();
        let mut expected = before.clone();
        one_by_one(&mut expected, &slots);
        assert!(expected.jams.contains(&true) && expected.jams.contains(&false));
        assert!(expected.points.iter().all(|p| p.separation.is_finite() && p.tangent_mass.is_finite()));
        assert!(slots.iter().all(|&i| expected.contacts[i as usize].preload != before.contacts[i as usize].preload));
        for set in InstructionSet::each() {
            let mut tables = before.clone();
            in_lanes(&mut tables, &slots, set);
            assert_eq!(tables, expected, "{}", set.name());
        }
    }
}
