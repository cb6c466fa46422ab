//! From the rows of one step to those of the next, on the device.

use bytemuck::{Pod, Zeroable};

use super::shader::{self, Program};
use super::timer::Timer;
use super::{Dispatch, Gpu};
use crate::collide::MAX_POINTS;
use crate::error::{Error, Result};
use crate::problem::carry::{Carry, Preload};
use crate::problem::{ContactRow, ImpulseRow, PointRow, StepProblem};

/// The rows that a step left on the device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    contacts: usize,
    points: usize,
    /// Whether the problem has everything by now.
    pub fetched: bool,
}

impl Rows {
    /// Those of a problem that just ran.
    pub fn of(problem: &StepProblem) -> Self {
        Self { contacts: problem.contacts.len(), points: problem.points.len(), fetched: false }
    }
}

/// What the programs that begin a step are given, 48 B. Twin of the WGSL struct `Carry`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct CarryParams {
    /// What preloads follow from.
    pub preload: Preload,
    /// Number of bodies.
    pub body_count: u32,
    /// Number of contacts that take part.
    pub contact_count: u32,
    /// Where their rows stand in the buffer of the colors.
    pub order: u32,
    /// Number of contacts whose rows were written again.
    pub written_count: u32,
    /// 1 if a patch follows the points of every contact.
    pub patches: u32,
    /// 1 if all points were sent.
    pub has_points: u32,
    #[doc(hidden)]
    pub pad: [u32; 2],
}

impl Gpu {
    /// Brings the rows that the last step left to those of `problem`, but for what the programs do that are to run first.
    pub(super) fn carry_over(&mut self, problem: &StepProblem, carry: &Carry, before: Rows) -> Result<Vec<Dispatch>> {
        self.update_small_rows(problem);
        let swept = problem.rows_of(&problem.contact_colors());
        let params = CarryParams {
            preload: carry.preload,
            body_count: problem.bodies.len() as u32,
            contact_count: swept.len() as u32,
            order: problem.colors.len() as u32,
            written_count: carry.written.len() as u32,
            patches: problem.has_patches().into(),
            has_points: carry.approach.into(),
            ..CarryParams::default()
        };
        self.buffers.update(shader::CARRY, bytemuck::bytes_of(&params));
        let mut first = vec![Dispatch::over(Program::BeginBodies, problem.bodies.len())];
        if problem.contacts.is_empty() {
            return Ok(first);
        }
        let kept: [(u32, usize, usize); 3] = [
            (shader::CONTACTS, before.contacts * size_of::<ContactRow>(), size_of_val(&problem.contacts[..])),
            (shader::POINTS, before.points * size_of::<PointRow>(), size_of_val(&problem.points[..])),
            (shader::IMPULSES, before.points * size_of::<ImpulseRow>(), size_of_val(&problem.impulses[..])),
        ];
        for (binding, kept, size) in kept {
            self.buffers.grow(binding, kept, size);
        }
        if !carry.written.is_empty() {
            self.send_written(problem, carry)?;
            first.push(Dispatch::over(Program::WriteContacts, carry.written.len()));
        }
        if carry.approach {
            self.buffers.send(shader::POINTS, bytemuck::cast_slice(&problem.points));
        }
        self.separations.clear();
        for &row in swept {
            let first = problem.contacts[row as usize].first_point as usize;
            self.separations.extend(problem.points[first..first + MAX_POINTS].iter().map(|point| point.separation));
        }
        self.buffers.send(shader::SEPARATIONS, bytemuck::cast_slice(&self.separations));
        first.push(Dispatch::over(Program::BeginContacts, swept.len()));
        Ok(first)
    }

    /// Sends the rows that were written again.
    fn send_written(&mut self, problem: &StepProblem, carry: &Carry) -> Result<()> {
        if carry.written.iter().any(|written| written.row as usize >= problem.contacts.len()) {
            return Err(Error::input("carry: names contacts that are not there"));
        }
        let stride = MAX_POINTS + usize::from(problem.has_patches());
        let (mut contacts, mut points) = (Vec::new(), Vec::new());
        for written in &carry.written {
            let contact = problem.contacts[written.row as usize];
            let first = contact.first_point as usize;
            contacts.push(contact);
            points.extend_from_slice(&problem.points[first..first + stride]);
        }
        let rows: [(u32, &[u8]); 3] = [
            (shader::WRITTEN, bytemuck::cast_slice(&carry.written)),
            (shader::WRITTEN_CONTACTS, bytemuck::cast_slice(&contacts)),
            (shader::WRITTEN_POINTS, bytemuck::cast_slice(&points)),
        ];
        for (binding, bytes) in rows {
            self.buffers.check(binding, bytes.len())?;
        }
        for (binding, bytes) in rows {
            self.buffers.send(binding, bytes);
        }
        Ok(())
    }

    /// Brings impulses and preloads of the last step to its problem.
    pub(super) fn fetch_rows(&mut self, problem: &mut StepProblem, rows: Rows) -> Result<()> {
        self.timer.iter_mut().for_each(Timer::begin);
        let encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let StepProblem { contacts, impulses, .. } = &mut *problem;
        let mut wanted = [
            (shader::IMPULSES, bytemuck::cast_slice_mut::<_, u8>(impulses)),
            (shader::CONTACTS, bytemuck::cast_slice_mut(contacts)),
        ];
        self.finish(encoder, &mut wanted)?;
        self.rows = Some(Rows { fetched: true, ..rows });
        Ok(())
    }
}
