//! Whether a problem from any source keeps what backends rely on.

use std::fmt::Display;

use super::{JointSystems, StepProblem};
use crate::collide::MAX_POINTS;
use crate::error::{Error, Result};

fn refuse(what: impl Display) -> Result<()> {
    Err(Error::input(format!("step problem: {what}")))
}

impl StepProblem {
    /// Refuses a problem with an index that names no row, with rows of unequal number, or with a color in which a body that can move
    /// occurs twice. The check reads no other numbers: numbers that are not finite are data.
    ///
    /// # Errors
    /// One line that names the row and the field.
    pub fn check(&self) -> Result<()> {
        self.check_counts()?;
        self.check_order()?;
        self.check_bodies()?;
        self.check_points()?;
        self.check_colors()?;
        self.check_systems()
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
            ("params.turning_count", params.turning_count as usize, self.turning.len(), "turning"),
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

    /// The contacts that take part have points of their own, and each its patch after them if there are any.
    fn check_points(&self) -> Result<()> {
        let patch = usize::from(self.has_patches());
        let mut owner = vec![u32::MAX; self.points.len()];
        for &row in self.rows_of(&self.contact_colors()) {
            let contact = &self.contacts[row as usize];
            let (first, count) = (contact.first_point as usize, contact.point_count as usize);
            if !(1..=MAX_POINTS).contains(&count) {
                return refuse(format_args!("contacts[{row}].point_count = {count}: must be 1 to {MAX_POINTS}"));
            }
            let Some(own) = owner.get_mut(first..first + count + patch) else {
                let points = self.points.len();
                return refuse(format_args!(
                    "contacts[{row}].first_point = {first}: {count} points from there, but there are {points}"
                ));
            };
            if let Some(other) = own.iter().find(|&&other| other != u32::MAX) {
                return refuse(format_args!(
                    "contacts[{row}].first_point = {first}: points of contacts[{other}] are there"
                ));
            }
            own.fill(row);
        }
        Ok(())
    }

    fn check_order(&self) -> Result<()> {
        let (colors, order) = (&self.colors, self.order.len());
        let ends = colors.first().zip(colors.last()).map_or([0, 0], |(first, last)| [*first as usize, *last as usize]);
        if ends != [0, order] || !colors.is_sorted() {
            return refuse(format_args!("colors: must ascend from 0 to {order}"));
        }
        let (first_joint, count) = (self.first_joint_color as usize, colors.len().saturating_sub(1));
        if first_joint > count {
            return refuse(format_args!("first_joint_color = {first_joint}, but {count} colors"));
        }
        for (name, rows, count) in [
            ("contact", self.rows_of(&self.contact_colors()), self.contacts.len()),
            ("joint", self.rows_of(&self.joint_colors()), self.joints.len()),
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

    /// The joints of the direct colors are those of the systems that take part, each once; blocks and products are those of their system,
    /// and products come before the block that they are subtracted from.
    fn check_systems(&self) -> Result<()> {
        let JointSystems { active, begins, softness, nodes, blocks, terms } = &self.systems;
        if self.direct_colors as usize > self.joint_colors().len() {
            return refuse(format_args!(
                "direct_colors = {}, but {} of joints",
                self.direct_colors,
                self.joint_colors().len()
            ));
        }
        let ends = begins.first().zip(begins.last()).map_or([0, 0], |(first, last)| [*first as usize, *last as usize]);
        let count = begins.len().saturating_sub(1);
        if ends != [0, nodes.len()] || !begins.is_sorted_by(|a, b| a < b) || softness.len() != count {
            return refuse(format_args!(
                "systems: {count} with {} softnesses, over {} nodes",
                softness.len(),
                nodes.len()
            ));
        }
        let mut end = 0;
        for (node, row) in nodes.iter().enumerate() {
            let own = blocks.get(row.first_block as usize..row.end_block as usize).unwrap_or_default();
            if row.first_block as usize != end || own.first().is_none_or(|pivot| pivot.node as usize != node) {
                return refuse(format_args!(
                    "systems.nodes[{node}]: blocks from {} to {}",
                    row.first_block, row.end_block
                ));
            }
            end = row.end_block as usize;
        }
        for system in 0..count {
            let own = self.systems.nodes_of(system);
            let first = nodes[own.start].first_block;
            for node in own.clone() {
                for at in self.systems.blocks_of(node) {
                    let row = &blocks[at];
                    let products = terms.get(row.first_term as usize..row.end_term as usize);
                    let is_own = |term: &u32| (first..at as u32).contains(term);
                    let is_after = (node..own.end).contains(&(row.node as usize));
                    if !is_after || !products.is_some_and(|products| products.iter().flatten().all(is_own)) {
                        return refuse(format_args!(
                            "systems.blocks[{at}]: node {}, or a product, is of none before",
                            row.node
                        ));
                    }
                }
            }
        }
        let mut direct = self.rows_of(&self.direct_joint_colors()).to_vec();
        direct.sort_unstable();
        let mut solved = Vec::with_capacity(direct.len());
        for &system in active {
            if system as usize >= count {
                return refuse(format_args!("systems.active: {system}, but there are {count}"));
            }
            solved.extend(nodes[self.systems.nodes_of(system as usize)].iter().map(|node| node.joint));
        }
        solved.sort_unstable();
        if solved != direct {
            return refuse("systems: their joints are not those of the direct colors");
        }
        let mut next = 0;
        for (row, turning) in self.turning.iter().enumerate() {
            let (body, bodies) = (turning.body as usize, self.bodies.len());
            if body >= bodies || body < next {
                return refuse(format_args!("turning[{row}]: body {body}: must be less than {bodies}, and ascending"));
            }
            next = body + 1;
        }
        Ok(())
    }

    fn check_colors(&self) -> Result<()> {
        let mut seen = vec![0; self.bodies.len()];
        for color in self.contact_colors().chain(self.joint_colors()) {
            self.check_color(color, &mut seen)?;
        }
        Ok(())
    }

    /// `seen`: one more than the last color that each body that can move is in.
    fn check_color(&self, color: u32, seen: &mut [u32]) -> Result<()> {
        for &row in self.rows_of(&(color..color + 1)) {
            let pair = match color < self.first_joint_color {
                true => [self.contacts[row as usize].body_a, self.contacts[row as usize].body_b],
                false => [self.joints[row as usize].body_a, self.joints[row as usize].body_b],
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
