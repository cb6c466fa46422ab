//! Whether a problem from any source keeps what backends rely on.

use std::fmt::Display;
use std::ops::Range;

use super::StepProblem;
use crate::collide::MAX_POINTS;
use crate::error::{Error, Result};

fn refuse(what: impl Display) -> Result<()> {
    Err(Error::input(format!("step problem: {what}")))
}

impl StepProblem {
    /// Refuses a problem with an index that names no row, with rows of unequal number, or with a color in which a body that can move
    /// occurs twice. What the numbers are is not looked at: trouble in the numbers is data.
    ///
    /// # Errors
    /// One line that names the row and the field.
    pub fn check(&self) -> Result<()> {
        self.check_counts()?;
        self.check_bodies()?;
        self.check_points()?;
        self.check_colors()
    }

    fn check_counts(&self) -> Result<()> {
        let params = &self.params;
        for (name, rows, wanted, of) in [
            ("masses", self.masses.len(), self.bodies.len(), "bodies"),
            ("impulses", self.impulses.len(), self.points.len(), "points"),
            ("joint_impulses", self.joint_impulses.len(), self.joints.len(), "joints"),
            ("params.body_count", params.body_count as usize, self.bodies.len(), "bodies"),
            ("params.point_count", params.point_count as usize, self.points.len(), "points"),
            ("params.joint_count", params.joint_count as usize, self.joints.len(), "joints"),
            ("params.inertia_count", params.inertia_count as usize, self.inertias.len(), "inertias"),
        ] {
            if rows != wanted {
                return refuse(format_args!("{name}: {rows}, but {wanted} {of}"));
            }
        }
        Ok(())
    }

    fn check_bodies(&self) -> Result<()> {
        let bodies = self.bodies.len();
        let pairs = self.contacts.iter().map(|c| [c.body_a, c.body_b]).enumerate().map(|row| ("contacts", row));
        let joined = self.joints.iter().map(|j| [j.body_a, j.body_b]).enumerate().map(|row| ("joints", row));
        for (rows, (row, pair)) in pairs.chain(joined) {
            if pair.iter().any(|&body| body as usize >= bodies) {
                return refuse(format_args!("{rows}[{row}]: bodies {pair:?}, but there are {bodies}"));
            }
        }
        let mut next = 0;
        for (row, inertia) in self.inertias.iter().enumerate() {
            let body = inertia.body as usize;
            if body >= bodies || body < next {
                return refuse(format_args!("inertias[{row}]: body {body}: must be less than {bodies}, and ascending"));
            }
            next = body + 1;
        }
        Ok(())
    }

    /// The points of the contacts follow one another, and after those of each, its patch if there are any.
    fn check_points(&self) -> Result<()> {
        let patch = usize::from(self.has_patches());
        let mut next = 0;
        for (row, contact) in self.contacts.iter().enumerate() {
            let (first, count) = (contact.first_point as usize, contact.point_count as usize);
            if !(1..=MAX_POINTS).contains(&count) {
                return refuse(format_args!("contacts[{row}].point_count = {count}: must be 1 to {MAX_POINTS}"));
            }
            if first != next {
                return refuse(format_args!(
                    "contacts[{row}].first_point = {first}: must be {next}, after the row before"
                ));
            }
            next += count + patch;
        }
        match self.points.len() == next {
            true => Ok(()),
            false => refuse(format_args!("points: {}, but the contacts have {next}", self.points.len())),
        }
    }

    fn check_colors(&self) -> Result<()> {
        let colors = self.colors.len();
        if self.first_joint_color as usize > colors {
            return refuse(format_args!("first_joint_color = {}, but {colors} colors", self.first_joint_color));
        }
        let (contacts, joints) = self.colors.split_at(self.first_joint_color as usize);
        check_offsets("contacts", contacts, self.contacts.len())?;
        check_offsets("joints", joints, self.joints.len())?;
        let mut seen = vec![0; self.bodies.len()];
        for color in self.contact_colors().chain(self.joint_colors()) {
            let rows = self.rows_of(&(color..color + 1));
            let of_joints = color >= self.first_joint_color;
            self.check_color(color, rows, of_joints, &mut seen)?;
        }
        Ok(())
    }

    /// `seen`: one more than the last color that each body that can move is in.
    fn check_color(&self, color: u32, rows: Range<usize>, of_joints: bool, seen: &mut [u32]) -> Result<()> {
        for row in rows {
            let pair = match of_joints {
                true => [self.joints[row].body_a, self.joints[row].body_b],
                false => [self.contacts[row].body_a, self.contacts[row].body_b],
            };
            for body in pair.map(|body| body as usize).into_iter().filter(|&body| self.masses[body].inv_mass > 0.0) {
                if std::mem::replace(&mut seen[body], color + 1) == color + 1 {
                    return refuse(format_args!("color {color}: body {body} occurs twice, and can move"));
                }
            }
        }
        Ok(())
    }
}

/// Refuses offsets of colors that do not go from 0 to the number of rows without a step back.
fn check_offsets(rows: &str, offsets: &[u32], count: usize) -> Result<()> {
    let ends = offsets.first().zip(offsets.last()).map_or([0, 0], |(first, last)| [*first as usize, *last as usize]);
    match ends == [0, count] && offsets.is_sorted() {
        true => Ok(()),
        false => refuse(format_args!("colors of {rows}: must ascend from 0 to {count}")),
    }
}
