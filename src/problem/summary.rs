//! Common facts about the contacts of a step, from one pass over their rows.

use rayon::prelude::*;

use super::{ContactRow, StepProblem};

/// The facts about the contacts that take part that plans, counts of points and counts of bytes need.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContactSummary {
    /// Whether any contact has friction.
    pub friction: bool,
    /// Whether any contact has a round surface, whose radius is in its row.
    pub round: bool,
    /// Number of points before each color, then of all points.
    pub points: Vec<usize>,
}

const CONTACTS_A_TASK: usize = 2048;

impl ContactSummary {
    /// The summary of the contacts that take part in a step.
    pub fn of(problem: &StepProblem) -> Self {
        let mut all = Self { points: vec![0], ..Self::default() };
        for color in problem.contact_colors() {
            let rows = problem.rows_of(&(color..color + 1)).par_chunks(CONTACTS_A_TASK);
            let (friction, round, points) = rows
                .map(|rows| rows.iter().map(|&row| of_contact(&problem.contacts[row as usize])).fold(NONE, and))
                .reduce(|| NONE, and);
            all.friction |= friction;
            all.round |= round;
            all.points.push(all.points[all.points.len() - 1] + points);
        }
        all
    }

    /// Points of all contacts.
    pub fn point_count(&self) -> usize {
        self.points.last().copied().unwrap_or(0)
    }
}

/// Facts about some contacts: friction, round surfaces, number of points.
type Of = (bool, bool, usize);

const NONE: Of = (false, false, 0);

fn of_contact(c: &ContactRow) -> Of {
    (c.friction > 0.0, c.radius_a > 0.0 || c.radius_b > 0.0, c.point_count as usize)
}

fn and(x: Of, y: Of) -> Of {
    (x.0 | y.0, x.1 | y.1, x.2 + y.2)
}
