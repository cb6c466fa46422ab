//! Joints in groups of sixteen lanes, color by color.

use std::ops::Range;

use super::groups::{Bodies, NO_ROW};
use super::wide::{WIDTH, Wide};
use crate::problem::StepProblem;

/// Sixteen joints of one color.
#[derive(Clone, Copy)]
pub(super) struct JointGroup {
    pub a: Bodies,
    pub b: Bodies,
    /// Rows of the problem that the lanes hold; [`NO_ROW`] where there is none.
    pub rows: [u32; WIDTH],
    /// Arms and gap.
    pub joint: [Wide; 9],
}

/// The joints of a problem.
#[derive(Default)]
pub(super) struct JointGroups {
    pub all: Vec<JointGroup>,
    /// Where the groups of each color begin, from the first color of joints.
    pub colors: Vec<u32>,
}

impl JointGroups {
    /// Takes over the joints of a problem.
    pub fn load(&mut self, problem: &StepProblem) {
        self.all.clear();
        self.colors.clear();
        for color in problem.joint_colors() {
            self.colors.push(self.all.len() as u32);
            let rows = problem.rows_of(&(color..color + 1));
            let groups = rows.clone().step_by(WIDTH).map(|first| first..rows.end.min(first + WIDTH));
            self.all.extend(groups.map(|rows| JointGroup::of(problem, rows)));
        }
        self.colors.push(self.all.len() as u32);
    }
}

impl JointGroup {
    /// Lanes without a joint hold one of nobody with nobody.
    fn of(problem: &StepProblem, mut rows: Range<usize>) -> Self {
        let nobody = problem.bodies.len();
        let mut group =
            Self { a: Bodies::default(), b: Bodies::default(), rows: [NO_ROW; WIDTH], joint: [Wide::default(); 9] };
        for lane in 0..WIDTH {
            let Some(row) = rows.next() else {
                group.a.set(lane, nobody, problem);
                group.b.set(lane, nobody, problem);
                continue;
            };
            let joint = &problem.joints[row];
            group.rows[lane] = row as u32;
            group.a.set(lane, joint.body_a as usize, problem);
            group.b.set(lane, joint.body_b as usize, problem);
            let numbers = [joint.r_a, joint.r_b, joint.gap].into_iter().flatten();
            group.joint.iter_mut().zip(numbers).for_each(|(wide, x)| wide.0[lane] = x);
        }
        group
    }
}
