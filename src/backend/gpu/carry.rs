//! From the rows of one step to those of the next, on the device.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::shader::{self, Program};
use super::timer::Timer;
use super::{Dispatch, Gpu};
use crate::error::{Error, Result};
use crate::problem::carry::{Carry, NO_ROW, Preload};
use crate::problem::{ContactRow, ImpulseRow, PointRow, StepProblem};

/// The rows that a step left on the device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    contacts: usize,
    points: usize,
    /// Whether the preloads are on the device only, and the separations of the problem are without them.
    preloads: bool,
    /// Whether the problem has everything by now.
    pub fetched: bool,
}

impl Rows {
    /// Those of a problem that just ran.
    pub fn of(problem: &StepProblem, carry: &Carry) -> Self {
        let (contacts, points) = (problem.contacts.len(), problem.points.len());
        Self { contacts, points, preloads: carry.on_device, fetched: false }
    }
}

/// What the programs that carry rows over are given, 48 B. Twin of the WGSL struct `Carry`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct CarryParams {
    /// What preloads follow from.
    pub preload: Preload,
    /// Number of bodies.
    pub body_count: u32,
    /// Number of contacts.
    pub contact_count: u32,
    /// Number of contacts in the step before.
    pub contacts_before: u32,
    /// 1 if a patch follows the points of every contact.
    pub patches: u32,
    /// 1 if the points were sent and are not to be carried.
    pub has_points: u32,
    #[doc(hidden)]
    pub pad: [u32; 3],
}

impl Gpu {
    /// Brings the rows that the last step left to those of `problem`, but for what the programs do that are to run first.
    pub(super) fn carry_over(&mut self, problem: &StepProblem, carry: &Carry, before: Rows) -> Result<Vec<Dispatch>> {
        for (binding, bytes) in super::small_rows_of(problem) {
            self.buffers.update(binding, bytes);
        }
        let params = CarryParams {
            preload: carry.preload,
            body_count: problem.bodies.len() as u32,
            contact_count: problem.contacts.len() as u32,
            contacts_before: before.contacts as u32,
            patches: problem.has_patches().into(),
            has_points: carry.approach.into(),
            ..CarryParams::default()
        };
        self.buffers.update(shader::CARRY, bytemuck::bytes_of(&params));
        let mut first = vec![Dispatch::over(Program::BeginBodies, problem.bodies.len())];
        if problem.contacts.is_empty() {
            return Ok(first);
        }
        if !carry.rows_before.is_empty() {
            check_places(problem, carry, before)?;
            self.send_places(problem, carry, before)?;
            first.push(Dispatch::over(Program::CarryContacts, problem.contacts.len()));
        }
        if carry.approach {
            self.buffers.send(shader::POINTS, bytemuck::cast_slice(&problem.points));
        }
        let separations = &mut self.separations;
        problem.points.par_iter().with_min_len(1024).map(|p| p.separation).collect_into_vec(separations);
        self.buffers.send(shader::SEPARATIONS, bytemuck::cast_slice(separations));
        first.push(Dispatch::over(Program::BeginContacts, problem.contacts.len()));
        Ok(first)
    }

    /// Sends where each row was, and the rows that are new: they stand after those of the step before.
    fn send_places(&mut self, problem: &StepProblem, carry: &Carry, before: Rows) -> Result<()> {
        for (now, then) in CARRIED {
            self.buffers.swap(now, then);
        }
        let (mut contacts, mut points, mut impulses) = (Vec::new(), Vec::new(), Vec::<ImpulseRow>::new());
        let patch = usize::from(problem.has_patches());
        for origin in &carry.computed {
            let contact = &problem.contacts[origin.row as usize];
            let rows = contact.first_point as usize..(contact.first_point + contact.point_count) as usize + patch;
            contacts.push(ContactRow { first_point: (before.points + points.len()) as u32, ..*contact });
            points.extend_from_slice(&problem.points[rows.clone()]);
            impulses.extend_from_slice(&problem.impulses[rows]);
        }
        let mut next = before.contacts as u32;
        let mut place = |(&row_before, contact): (&u32, &ContactRow)| {
            let from = if row_before == NO_ROW { next } else { row_before };
            next += u32::from(row_before == NO_ROW);
            [from, contact.first_point]
        };
        let places: Vec<[u32; 2]> = carry.rows_before.iter().zip(&problem.contacts).map(&mut place).collect();
        let appended: [(u32, usize, &[u8]); 3] = [
            (shader::CONTACTS_BEFORE, before.contacts * size_of::<ContactRow>(), bytemuck::cast_slice(&contacts)),
            (shader::POINTS_BEFORE, before.points * size_of::<PointRow>(), bytemuck::cast_slice(&points)),
            (shader::IMPULSES_BEFORE, before.points * size_of::<ImpulseRow>(), bytemuck::cast_slice(&impulses)),
        ];
        for (binding, kept, bytes) in appended {
            self.buffers.check(binding, kept + bytes.len())?;
        }
        for (binding, kept, bytes) in appended {
            self.buffers.append(binding, kept, bytes);
        }
        self.buffers.send(shader::PLACES, bytemuck::cast_slice(&places));
        self.buffers.send(shader::ORIGINS, bytemuck::cast_slice(&carry.computed));
        self.buffers.reserve(shader::CONTACTS, size_of_val(&problem.contacts[..]));
        self.buffers.reserve(shader::POINTS, size_of_val(&problem.points[..]));
        self.buffers.reserve(shader::IMPULSES, size_of_val(&problem.impulses[..]));
        Ok(())
    }

    /// Brings impulses and preloads of the last step to its problem.
    pub(super) fn fetch_rows(&mut self, problem: &mut StepProblem, rows: Rows) -> Result<()> {
        self.timer.iter_mut().for_each(Timer::begin);
        let encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let StepProblem { contacts, impulses, .. } = &mut *problem;
        let mut wanted = vec![(shader::IMPULSES, bytemuck::cast_slice_mut::<_, u8>(impulses))];
        if rows.preloads {
            wanted.push((shader::CONTACTS, bytemuck::cast_slice_mut(contacts)));
        }
        self.finish(encoder, &mut wanted)?;
        if rows.preloads {
            for contact in &problem.contacts {
                let own = contact.first_point as usize..(contact.first_point + contact.point_count) as usize;
                problem.points[own].iter_mut().for_each(|point| point.separation -= contact.preload);
            }
        }
        self.rows = Some(Rows { fetched: true, ..rows });
        Ok(())
    }
}

/// Refuses places in the step before that were not there: kernels would read other rows in their place.
fn check_places(problem: &StepProblem, carry: &Carry, before: Rows) -> Result<()> {
    let was = |row: u32, rows: usize| row == NO_ROW || (row as usize) < rows;
    let contacts = problem.contacts.len();
    let new = carry.rows_before.iter().filter(|&&row| row == NO_ROW).count();
    let rows = carry.rows_before.len() == contacts && carry.rows_before.iter().all(|&row| was(row, before.contacts));
    let mut origins = carry.computed.iter();
    let computed = new == carry.computed.len()
        && origins.all(|origin| {
            let points = origin.points.iter().all(|&row| was(row, before.points));
            (origin.row as usize) < contacts && was(origin.contact, before.contacts) && points
        });
    match rows && computed {
        true => Ok(()),
        false => Err(Error::input("carry: names rows that were not in the step before")),
    }
}

/// Rows that change their places from step to step, and what holds those of the step before.
const CARRIED: [(u32, u32); 3] = [
    (shader::CONTACTS, shader::CONTACTS_BEFORE),
    (shader::POINTS, shader::POINTS_BEFORE),
    (shader::IMPULSES, shader::IMPULSES_BEFORE),
];
