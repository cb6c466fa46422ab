//! Rows that stay on the device, and their update from one step to the next.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::bindings::Binding;
use super::buffers::Buffers;
use super::dispatch::Dispatch;
use super::rows;
use super::wgsl::Program;
use crate::collide::MAX_POINTS;
use crate::error::{Error, Result};
use crate::problem::carry::{Carry, NO_POINT, Preload};
use crate::problem::{ContactRow, StepProblem};

// The shader writes no impulse to a point whose earlier index is `MAX_POINTS` or more.
const _: () = assert!(NO_POINT as usize == MAX_POINTS);

/// Smallest number of contacts for a thread.
const MIN_CONTACTS: usize = 1024;

/// The rows that a step left on the device.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResidentRows {
    /// Sizes of the rows of contacts, in the order of `rows::of_contacts` (B).
    sizes: [usize; 4],
}

impl ResidentRows {
    /// The rows of a problem that just ran.
    pub fn of(problem: &StepProblem) -> Self {
        Self { sizes: rows::of_contacts(problem).map(|(_, rows)| rows.len()) }
    }
}

/// Parameters of the programs that begin a step, 48 B. Twin of the WGSL struct of this name.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ResidentParams {
    /// Parameters of preloads.
    pub preload: Preload,
    /// Number of bodies.
    pub body_count: u32,
    /// Number of active contacts.
    pub contact_count: u32,
    /// The start of their rows in the buffer of the colors.
    pub order: u32,
    /// Number of contacts whose rows the host recomputed.
    pub written_count: u32,
    /// 1 if the host sent all points.
    pub has_points: u32,
    /// 1 if friction at points has two directions.
    pub tangents: u32,
    /// Always 0, but shader compilers do not know it: for exact mode in WGSL.
    pub zero: u32,
    #[doc(hidden)]
    pub pad: u32,
}

/// The manifold of a contact with rewritten rows, 48 B. Twin of the WGSL struct of this name.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct WrittenContact {
    /// Unit normal from a to b, world axes.
    pub normal: [f32; 3],
    /// Coulomb coefficient.
    pub friction: f32,
    /// Restitution.
    pub restitution: f32,
    /// Radius of curvature of a's surface (m).
    pub radius_a: f32,
    /// Radius of curvature of b's surface (m).
    pub radius_b: f32,
    /// Length of its substeps relative to that of class 0.
    pub substep_share: f32,
    /// One body.
    pub body_a: u32,
    /// The other one.
    pub body_b: u32,
    /// Its number of points.
    pub point_count: u32,
    #[doc(hidden)]
    pub pad: u32,
}

impl WrittenContact {
    fn of(contact: &ContactRow) -> Self {
        let &ContactRow { normal, friction, restitution, radius_a, radius_b, substep_share, .. } = contact;
        let &ContactRow { body_a, body_b, point_count, .. } = contact;
        Self { normal, friction, restitution, radius_a, radius_b, substep_share, body_a, body_b, point_count, pad: 0 }
    }
}

/// Sends the changes since the step before, and returns the programs that update its rows to those of `problem`.
/// `separations` is reusable memory.
pub(super) async fn begin(
    buffers: &mut Buffers,
    problem: &StepProblem,
    carry: &Carry,
    before: ResidentRows,
    separations: &mut Vec<[f32; MAX_POINTS]>,
) -> Result<Vec<Dispatch>> {
    let swept = problem.rows_of(&problem.contact_colors());
    let params = ResidentParams {
        preload: carry.preload,
        body_count: problem.bodies.len() as u32,
        contact_count: swept.len() as u32,
        order: problem.colors.len() as u32,
        written_count: carry.written.len() as u32,
        has_points: carry.sends_points().into(),
        tangents: carry.tangents.into(),
        ..ResidentParams::default()
    };
    buffers.update(Binding::Resident, bytemuck::bytes_of(&params))?;
    let mut programs = vec![Dispatch::over(Program::BeginBodies, problem.bodies.len())];
    if problem.contacts.is_empty() {
        return Ok(programs);
    }
    for ((binding, rows), kept) in rows::of_contacts(problem).into_iter().zip(before.sizes) {
        buffers.grow(binding, kept, rows.len()).await?;
    }
    if !carry.written.is_empty() {
        send_written(buffers, problem, carry)?;
        programs.push(Dispatch::over(Program::WriteContacts, carry.written.len()));
    }
    if carry.sends_points() {
        buffers.send(Binding::Points, bytemuck::cast_slice(&problem.points))?;
    }
    let of_contact = |&row: &u32| {
        let first = problem.contacts[row as usize].first_point as usize;
        std::array::from_fn(|k| problem.points[first + k].separation)
    };
    swept.par_iter().with_min_len(MIN_CONTACTS).map(of_contact).collect_into_vec(separations);
    buffers.send(Binding::Separations, bytemuck::cast_slice(separations))?;
    programs.push(Dispatch::over(Program::BeginContacts, swept.len()));
    Ok(programs)
}

/// Sends the recomputed manifolds; the device computes their rows.
fn send_written(buffers: &mut Buffers, problem: &StepProblem, carry: &Carry) -> Result<()> {
    if carry.written.iter().any(|written| written.row as usize >= problem.contacts.len()) {
        return Err(Error::input("contacts written again: a row does not exist"));
    }
    let written = || carry.written.par_iter().with_min_len(MIN_CONTACTS).map(|own| &problem.contacts[own.row as usize]);
    let contacts: Vec<WrittenContact> = written().map(WrittenContact::of).collect();
    let arms_of = |contact: &ContactRow| -> [[[f32; 3]; 2]; MAX_POINTS] {
        let first = contact.first_point as usize;
        std::array::from_fn(|k| [problem.points[first + k].r_a, problem.points[first + k].r_b])
    };
    let arms: Vec<_> = written().map(arms_of).collect();
    let rows: [(Binding, &[u8]); 3] = [
        (Binding::Written, bytemuck::cast_slice(&carry.written)),
        (Binding::WrittenContacts, bytemuck::cast_slice(&contacts)),
        (Binding::WrittenArms, bytemuck::cast_slice(&arms)),
    ];
    for (binding, bytes) in rows {
        buffers.check(binding, bytes.len())?;
    }
    rows.into_iter().try_for_each(|(binding, bytes)| buffers.send(binding, bytes))
}
