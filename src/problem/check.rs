//! Checks that a problem from any source keeps the rules that backends rely on.

use std::fmt::Display;

use super::StepProblem;
use super::rows::{JointRow, MAX_AXES};
use crate::collide::MAX_POINTS;
use crate::error::{Error, Result};

pub(super) fn refuse(what: impl Display) -> Result<()> {
    Err(Error::input(format!("step problem: {what}")))
}

/// Makes `count` parts of a row its own, and a patch after them if there is one. `owner` has the row of each part.
fn claim(
    owner: &mut [u32],
    row: u32,
    (first, count, patch): (usize, usize, usize),
    [rows, field, parts]: [&str; 3],
) -> Result<()> {
    let all = owner.len();
    let Some(own) = owner.get_mut(first..first + count + patch) else {
        return refuse(format_args!(
            "{rows}[{row}].{field} = {first}: {count} {parts} from there, but there are {all}"
        ));
    };
    if let Some(other) = own.iter().find(|&&other| other != u32::MAX) {
        return refuse(format_args!("{rows}[{row}].{field} = {first}: overlaps the {parts} of {rows}[{other}]"));
    }
    own.fill(row);
    Ok(())
}

impl StepProblem {
    /// Refuses a problem with an index beyond the rows, with counts that do not match, or with a color that has a
    /// movable body twice. The check reads no other numbers, so numbers that are not finite pass.
    ///
    /// # Errors
    /// One line that names the row and the field.
    pub fn check(&self) -> Result<()> {
        self.check_counts()?;
        self.check_blocks()?;
        self.check_order()?;
        self.check_bodies()?;
        self.check_points()?;
        self.check_axes()?;
        self.check_systems()?;
        self.check_colors()
    }

    /// Checks that the blocks tile the colors: first all contacts, then all joints, all bodies, all rows of inertia,
    /// all systems of joints, and all rows of turning inertia.
    fn check_blocks(&self) -> Result<()> {
        let (colors, order) = (&self.colors, self.order.len());
        let ends = colors.first().zip(colors.last()).map_or([0, 0], |(first, last)| [*first as usize, *last as usize]);
        if ends != [0, order] || !colors.is_sorted() {
            return refuse(format_args!("colors: must ascend from 0 to {order}"));
        }
        let mut next = 0;
        for kind in 0..6 {
            for (i, block) in self.blocks.iter().enumerate() {
                let own = &block.colors()[kind];
                if own.start != next
                    || own.end < own.start
                    || !(block.joints[0]..=block.joints[1]).contains(&block.direct)
                {
                    return refuse(format_args!("blocks[{i}]: colors {own:?}, but the color before is {next}"));
                }
                next = own.end;
            }
        }
        let count = colors.len().saturating_sub(1);
        if next as usize != count {
            return refuse(format_args!("blocks: {next} colors, but there are {count}"));
        }
        Ok(())
    }

    fn check_counts(&self) -> Result<()> {
        let params = &self.params;
        let totals = if self.totals.is_empty() { 0 } else { self.points.len() };
        let joint_totals = if self.joint_totals.is_empty() { 0 } else { self.joint_impulses.len() };
        for (name, rows, wanted, of) in [
            ("masses", self.masses.len(), self.bodies.len(), "bodies"),
            ("impulses", self.impulses.len(), self.points.len(), "points"),
            ("totals", self.totals.len(), totals, "points"),
            ("joint_impulses", self.joint_impulses.len(), self.joints.len() + self.axes.len(), "joints and axes"),
            ("joint_totals", self.joint_totals.len(), joint_totals, "joints and axes"),
            ("params.body_count", params.body_count as usize, self.bodies.len(), "bodies"),
            ("params.point_count", params.point_count as usize, self.points.len(), "points"),
            ("params.joint_count", params.joint_count as usize, self.joints.len(), "joints"),
            ("params.axis_count", params.axis_count as usize, self.axes.len(), "axes"),
        ] {
            if rows != wanted {
                return refuse(format_args!("{name}: {rows}, but {wanted} {of}"));
            }
        }
        let bodies = self.bodies.len();
        for (name, rows) in [("torques", self.torques.len()), ("dampings", self.dampings.len())] {
            if rows > 0 && rows != bodies {
                return refuse(format_args!("{name}: {rows}, but {bodies} bodies"));
            }
        }
        Ok(())
    }

    fn check_bodies(&self) -> Result<()> {
        let bodies = self.bodies.len();
        let contacts = self.rows_of(&self.contact_colors()).iter().map(|&row| {
            let contact = &self.contacts[row as usize];
            ("contacts", row, [contact.body_a, contact.body_b])
        });
        let joints = self.rows_of(&self.joint_colors()).iter().map(|&row| {
            let joint = &self.joints[row as usize];
            ("joints", row, [joint.body_a, joint.body_b])
        });
        for (rows, row, pair) in contacts.chain(joints) {
            if pair.iter().any(|&body| body as usize >= bodies) {
                return refuse(format_args!("{rows}[{row}]: bodies {pair:?}, but there are {bodies}"));
            }
        }
        let mut seen = vec![false; bodies];
        for (row, inertia) in self.inertias.iter().enumerate() {
            match seen.get_mut(inertia.body as usize) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return refuse(format_args!("inertias[{row}]: body {}: occurs twice", inertia.body)),
                None => return refuse(format_args!("inertias[{row}]: body {}, but there are {bodies}", inertia.body)),
            }
        }
        Ok(())
    }

    /// Checks that each contact that takes part has points of its own, followed by its patch if there are patches.
    fn check_points(&self) -> Result<()> {
        let patch = usize::from(self.has_patches());
        let mut owner = vec![u32::MAX; self.points.len()];
        for &row in self.rows_of(&self.contact_colors()) {
            let contact = &self.contacts[row as usize];
            let (first, count) = (contact.first_point as usize, contact.point_count as usize);
            if !(1..=MAX_POINTS).contains(&count) {
                return refuse(format_args!("contacts[{row}].point_count = {count}: must be 1 to {MAX_POINTS}"));
            }
            claim(&mut owner, row, (first, count, patch), ["contacts", "first_point", "points"])?;
        }
        Ok(())
    }

    /// Checks that each joint that takes part has axes of its own.
    fn check_axes(&self) -> Result<()> {
        let mut owner = vec![u32::MAX; self.axes.len()];
        for &row in self.rows_of(&self.joint_colors()) {
            let JointRow { first_axis, axis_count, .. } = self.joints[row as usize];
            if axis_count as usize > MAX_AXES {
                return refuse(format_args!("joints[{row}].axis_count = {axis_count}: must be at most {MAX_AXES}"));
            }
            claim(&mut owner, row, (first_axis as usize, axis_count as usize, 0), ["joints", "first_axis", "axes"])?;
        }
        Ok(())
    }

    fn check_order(&self) -> Result<()> {
        let all = |kind: usize| self.rows_of(&self.colors_of(|block| block.colors()[kind].clone()));
        let (bodies, inertias, systems, turning) = (all(2), all(3), all(4), all(5));
        for (name, rows, count) in [
            ("bodies", bodies, self.bodies.len()),
            ("inertias", inertias, self.inertias.len()),
            ("turning", turning, self.turning.len()),
        ] {
            if rows.len() != count {
                return refuse(format_args!("order: {} {name}, but there are {count}", rows.len()));
            }
        }
        for (name, rows, count) in [
            ("contact", self.rows_of(&self.contact_colors()), self.contacts.len()),
            ("joint", self.rows_of(&self.joint_colors()), self.joints.len()),
            ("body", bodies, self.bodies.len()),
            ("inertia", inertias, self.inertias.len()),
            ("system", systems, self.systems.len()),
            ("turning", turning, self.turning.len()),
        ] {
            let mut seen = vec![false; count];
            for &row in rows {
                match seen.get_mut(row as usize) {
                    Some(seen) if !*seen => *seen = true,
                    Some(_) => return refuse(format_args!("order: {name} {row} occurs twice")),
                    None => return refuse(format_args!("order: {name} {row}, but there are {count}")),
                }
            }
        }
        Ok(())
    }

    /// Checks that no color has a movable body twice, and that no block has a movable body of another block.
    fn check_colors(&self) -> Result<()> {
        let mut block_of = vec![0; self.bodies.len()];
        for (i, block) in self.blocks.iter().enumerate() {
            self.rows_of(&block.colors()[2]).iter().for_each(|&body| block_of[body as usize] = i);
        }
        let mut seen = vec![u32::MAX; self.bodies.len()];
        for (i, block) in self.blocks.iter().enumerate() {
            let [contacts, joints, _, inertias, _, turning] = block.colors();
            for color in contacts.clone().chain(joints) {
                let is_contact = contacts.contains(&color);
                for &row in self.rows_of(&(color..color + 1)) {
                    let pair = match is_contact {
                        true => [self.contacts[row as usize].body_a, self.contacts[row as usize].body_b],
                        false => [self.joints[row as usize].body_a, self.joints[row as usize].body_b],
                    };
                    for body in pair.map(|body| body as usize) {
                        if self.masses[body].inv_mass == 0.0 {
                            continue;
                        }
                        if block_of[body] != i {
                            return refuse(format_args!(
                                "color {color}: body {body} can move, but is not of block {i}"
                            ));
                        }
                        if std::mem::replace(&mut seen[body], color) == color {
                            return refuse(format_args!("color {color}: body {body} can move, but occurs twice"));
                        }
                    }
                }
            }
            let inertias = self.rows_of(&inertias).iter();
            let inertias = inertias.map(|&row| ("inertias", row, self.inertias[row as usize].body));
            let turning = self.rows_of(&turning).iter();
            let turning = turning.map(|&row| ("turning", row, self.turning[row as usize].body));
            for (rows, row, body) in inertias.chain(turning) {
                if block_of[body as usize] != i {
                    return refuse(format_args!("{rows}[{row}]: body {body} is not of block {i}"));
                }
            }
        }
        Ok(())
    }
}
