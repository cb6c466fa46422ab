//! Contact problems in FCLIB's HDF5 files. The global form has bodies, and the local form (`local`) has none:
//!
//! ```text
//! M v = H r + f        u = Hᵀ v + w        three columns of H a contact: normal, two tangents
//! u = W r + q          three rows and columns of W a contact
//! ```
//!
//! A rigid body has six rows: three for the velocity of the center of mass and three for the angular velocity in the
//! body's own axes. The files do not contain the rotation of a body; [`frames`] finds a rotation at which all its
//! contacts have arms. In written files, the axes of each body are the world's, and H and M are entries by row and
//! column.

mod frames;
mod local;
mod table;
#[cfg(test)]
mod tests;

use glam::{DMat3, DVec3};

use super::operator::inverse;
use super::{ContactProblem, FreeBody, LocalProblem, PointContact, Problem, Velocity, is_positive_definite};
use drystone::stages::error::{ensure, input};
use drystone::{Error, Result};
use frames::{Lever, arm, rotation};
use table::{Global, Sparse, Tables};

/// Tolerance between rows that should be opposite or equal, relative to the larger.
const TOLERANCE: f64 = 1e-9;

/// The rows of H of one body in one contact: linear and angular, one for each direction.
#[derive(Clone, Copy, Debug)]
struct Rows {
    body: usize,
    linear: [DVec3; 3],
    angular: [DVec3; 3],
}

impl Problem {
    /// Reads the bytes of an FCLIB file.
    pub(super) fn from_fclib(bytes: Vec<u8>) -> Result<Self> {
        let tables = Tables::open(bytes)?;
        if tables.has("fclib_global") {
            return ContactProblem::from_tables(&tables).map(Self::Bodies);
        }
        if tables.has("fclib_local") {
            return LocalProblem::from_tables(&tables).map(Self::Blocks);
        }
        let rolling = ["fclib_global_rolling", "fclib_local_rolling"].into_iter().find(|group| tables.has(group));
        Err(Error::input(match rolling {
            Some(group) => format!("{group}: rolling friction cannot be read"),
            None => "no group fclib_global or fclib_local: not an FCLIB file".into(),
        }))
    }
}

impl ContactProblem {
    /// Reads the bytes of an FCLIB file with a global problem of rigid bodies in space.
    pub(super) fn from_fclib(bytes: Vec<u8>) -> Result<Self> {
        match Problem::from_fclib(bytes)? {
            Problem::Bodies(problem) => Ok(problem),
            Problem::Blocks(_) => Err(Error::input("fclib_local: has no bodies, but bodies are needed")),
        }
    }

    fn from_tables(tables: &Tables) -> Result<Self> {
        let dimensions = tables.number("fclib_global/spacedim")?;
        ensure(dimensions == 3, || format!("fclib_global/spacedim: {dimensions}: must be 3"))?;
        ensure(!tables.has("fclib_global/G"), || "fclib_global/G: joints cannot be read".into())?;
        let (m, h) = (tables.matrix("fclib_global/M")?, tables.matrix("fclib_global/H")?);
        let blocks = mass_blocks(&m).map_err(|e| e.within("fclib_global/M"))?;
        let contacts = contact_rows(&h, m.rows).map_err(|e| e.within("fclib_global/H"))?;
        let f = tables.reals("fclib_global/vectors/f", m.rows)?;
        let w = tables.reals("fclib_global/vectors/w", h.columns)?;
        let mu = tables.frictions("fclib_global/vectors/mu", contacts.len())?;

        let turns = rotations(blocks.len(), &contacts).map_err(|e| e.within("fclib_global/H"))?;
        let vectors = |numbers: &[f64]| numbers.chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>();
        let free = vectors(&f);
        let body = |(i, block): (usize, &Block)| {
            let turn = turns[i];
            // An asymmetric inertia is valid data: it affects the free velocity, and contacts see its symmetric part.
            let inertia = (block.angular + block.angular.transpose()) * 0.5;
            let free = Velocity {
                linear: free[2 * i] / block.mass,
                angular: turn * (inverse(block.angular) * free[2 * i + 1]),
            };
            FreeBody { mass: block.mass, inertia: turn * inertia * turn.transpose(), free }
        };
        let contact = |((sides, offset), &friction): ((&Sides, DVec3), &f64)| {
            let index = |side: &Option<Rows>| side.map(|s| s.body as u32);
            let arm = |side: &Option<Rows>| side.map_or(DVec3::ZERO, |s| arm(map(&s), turns[s.body]));
            PointContact {
                a: index(&sides.a),
                b: index(&sides.b),
                friction,
                offset,
                frame: sides.frame(),
                r_a: arm(&sides.a),
                r_b: arm(&sides.b),
            }
        };
        Ok(Self {
            name: tables.text("fclib_global/info/title"),
            bodies: blocks.iter().enumerate().map(body).collect(),
            contacts: contacts.iter().zip(vectors(&w)).zip(&mu).map(contact).collect(),
        })
    }

    /// Writes the bytes of an FCLIB file in global form.
    ///
    /// # Errors
    /// The problem is too large for the 32-bit indices of the format.
    pub fn to_fclib(&self) -> Result<Vec<u8>> {
        let mut m = Sparse { rows: 6 * self.bodies.len(), columns: 6 * self.bodies.len(), entries: Vec::new() };
        let mut f = Vec::new();
        for (i, body) in self.bodies.iter().enumerate() {
            (0..3).for_each(|k| m.push(6 * i + k, 6 * i + k, body.mass));
            for (column, axis) in body.inertia.to_cols_array_2d().into_iter().enumerate() {
                (0..3).for_each(|row| m.push(6 * i + 3 + row, 6 * i + 3 + column, axis[row]));
            }
            f.extend((body.mass * body.free.linear).to_array());
            f.extend((body.inertia * body.free.angular).to_array());
        }
        let mut h = Sparse { rows: m.rows, columns: 3 * self.contacts.len(), entries: Vec::new() };
        for (i, contact) in self.contacts.iter().enumerate() {
            for (k, d) in contact.frame.into_iter().enumerate() {
                for (body, arm, d) in [(contact.a, contact.r_a, -d), (contact.b, contact.r_b, d)] {
                    let Some(body) = body.map(|b| b as usize) else { continue };
                    let rows = d.to_array().into_iter().chain(arm.cross(d).to_array());
                    rows.enumerate().for_each(|(row, x)| h.push(6 * body + row, 3 * i + k, x));
                }
            }
        }
        let w = self.contacts.iter().flat_map(|c| c.offset.to_array()).collect();
        let mu = self.contacts.iter().map(|c| c.friction).collect();
        Global { title: &self.name, m, h, f, w, mu }.to_bytes()
    }
}

/// Mass and inertia of one body, in its own axes.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    mass: f64,
    angular: DMat3,
}

/// M of rigid bodies: m 1 and a 3x3 inertia for each.
fn mass_blocks(m: &Sparse) -> Result<Vec<Block>> {
    if m.rows != m.columns || !m.rows.is_multiple_of(6) {
        let (rows, columns) = (m.rows, m.columns);
        return Err(input!("{rows} x {columns}: rigid bodies have 6 rows and columns each"));
    }
    // Check before memory is allocated.
    let (entries, rows) = (m.entries.len(), m.rows);
    ensure(entries >= rows, || format!("{entries} entries for {rows} rows: a mass is missing"))?;
    let mut entries = vec![[[0.0; 6]; 6]; m.rows / 6];
    for &(row, column, x) in m.entries.iter().filter(|e| e.2 != 0.0) {
        let message = || format!("({row}, {column}) couples two bodies: only rigid bodies can be read");
        ensure(row / 6 == column / 6, message)?;
        entries[row / 6][row % 6][column % 6] += x;
    }
    let block = |(i, e): (usize, &[[f64; 6]; 6])| {
        let wrong = |what: String| Err(input!("body {i}: {what}"));
        let mass = e[0][0];
        let axes = || (0..3).flat_map(|row| (0..3).map(move |column| (row, column)));
        let scalar = |(row, column): (usize, usize)| {
            let expected = if row == column { mass } else { 0.0 };
            (e[row][column] - expected).abs() <= TOLERANCE * mass.abs()
        };
        // Velocity and angular velocity are not coupled at a center of mass.
        let apart = |(row, column): (usize, usize)| e[row][column + 3] == 0.0 && e[row + 3][column] == 0.0;
        if !axes().all(|at| scalar(at) && apart(at)) {
            return wrong("its rows are not one mass and an inertia".into());
        }
        let angular = DMat3::from_cols_array_2d(&[3, 4, 5].map(|column| [3, 4, 5].map(|row| e[row][column])));
        if !(mass > 0.0 && is_positive_definite((angular + angular.transpose()) * 0.5)) {
            return wrong(format!("mass {mass:?}, inertia {:?}: must be positive", angular.to_cols_array()));
        }
        Ok(Block { mass, angular })
    };
    entries.iter().enumerate().map(block).collect()
}

/// The two sides of a contact. The frame of b is right-handed, and that of a is its opposite.
#[derive(Clone, Copy, Debug, Default)]
struct Sides {
    a: Option<Rows>,
    b: Option<Rows>,
}

impl Sides {
    fn frame(&self) -> [DVec3; 3] {
        match (self.b, self.a) {
            (Some(b), _) => b.linear,
            (None, Some(a)) => a.linear.map(|d| -d),
            (None, None) => unreachable!("a contact has a body"),
        }
    }
}

/// H of contacts, each between at most two rigid bodies.
fn contact_rows(h: &Sparse, rows: usize) -> Result<Vec<Sides>> {
    if h.rows != rows || !h.columns.is_multiple_of(3) {
        let (found, columns) = (h.rows, h.columns);
        return Err(input!("{found} x {columns}: must have {rows} rows, and 3 columns for each contact"));
    }
    let (entries, columns) = (h.entries.len(), h.columns);
    ensure(entries >= columns, || format!("{entries} entries for {columns} columns: a contact is empty"))?;
    let mut contacts = vec![Vec::<Rows>::new(); h.columns / 3];
    for &(row, column, x) in h.entries.iter().filter(|e| e.2 != 0.0) {
        let (contact, body) = (&mut contacts[column / 3], row / 6);
        let place = contact.iter().position(|r| r.body == body).unwrap_or_else(|| {
            contact.push(Rows { body, linear: [DVec3::ZERO; 3], angular: [DVec3::ZERO; 3] });
            contact.len() - 1
        });
        let half = if row % 6 < 3 { &mut contact[place].linear } else { &mut contact[place].angular };
        half[column % 3][row % 3] += x;
    }
    contacts.iter().enumerate().map(|(i, rows)| sides(rows).map_err(|e| e.within(format!("contact {i}")))).collect()
}

fn sides(rows: &[Rows]) -> Result<Sides> {
    let mut sides = Sides::default();
    for &rows in rows {
        let volume = directions(&rows).determinant();
        ensure(volume != 0.0, || format!("its directions on body {} are in one plane", rows.body))?;
        let side = if volume > 0.0 { &mut sides.b } else { &mut sides.a };
        if let Some(other) = side.replace(rows) {
            let (one, other) = (other.body, rows.body);
            return Err(input!("its directions on bodies {one} and {other} are not opposite"));
        }
    }
    match (sides.a, sides.b) {
        (None, None) => Err(Error::input("has no body")),
        (Some(a), Some(b))
            if (0..3).any(|k| (a.linear[k] + b.linear[k]).length() > TOLERANCE * b.linear[k].length()) =>
        {
            Err(input!("its directions on bodies {} and {} are not opposite", a.body, b.body))
        }
        _ => Ok(sides),
    }
}

/// D: the directions as rows.
fn directions(rows: &Rows) -> DMat3 {
    let [n, t_1, t_2] = rows.linear;
    DMat3::from_cols(n, t_1, t_2).transpose()
}

/// K = D⁻¹ B.
fn map(rows: &Rows) -> DMat3 {
    let [n, t_1, t_2] = rows.angular;
    directions(rows).inverse() * DMat3::from_cols(n, t_1, t_2).transpose()
}

/// The rotation of each body; the identity for a body without contacts.
fn rotations(bodies: usize, contacts: &[Sides]) -> Result<Vec<DMat3>> {
    let mut levers = vec![Vec::new(); bodies];
    for side in contacts.iter().flat_map(|c| [c.a, c.b]).flatten() {
        // The normal points from a to b. The rows of both sides, -n on a and n on b, point into the body.
        levers[side.body].push(Lever { map: map(&side), outward: -side.linear[0] });
    }
    let of = |(i, levers): (usize, &Vec<Lever>)| {
        rotation(levers).ok_or_else(|| input!("body {i}: its angular rows do not follow from lever arms"))
    };
    levers.iter().enumerate().map(of).collect()
}
