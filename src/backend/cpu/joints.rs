//! Joints in groups of sixteen lanes, color by color.

use super::groups::{Bodies, NO_ROW, set_lane};
use super::parts::{Begins, Dealt, Parts};
use super::wide::{WIDTH, Wide};
use crate::problem::{JointRow, StepProblem};

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
    /// Where the groups of each color of each part are, from the first color of joints.
    pub begins: Begins,
    dealt: Dealt,
}

impl JointGroups {
    /// Takes over the joints of a problem.
    pub fn load(&mut self, problem: &StepProblem, parts: &Parts) {
        let (joints, colors) = (&problem.joints, problem.joint_colors());
        self.all.clear();
        self.begins.clear(colors.len());
        self.dealt.update(problem, colors, parts.count, |row| parts.of(joints[row].body_a, joints[row].body_b));
        for cell in 0..self.dealt.cells() {
            self.begins.push(self.all.len());
            self.all
                .extend(self.dealt.rows(cell).chunks(WIDTH).map(|rows| JointGroup::of(problem, &parts.slots, rows)));
        }
        self.begins.push(self.all.len());
    }
}

impl JointGroup {
    /// Lanes without a joint hold one of nobody with nobody.
    fn of(problem: &StepProblem, slots: &[u32], rows: &[u32]) -> Self {
        let nobody = problem.bodies.len() as u32;
        let nothing = JointRow { body_a: nobody, body_b: nobody, ..JointRow::default() };
        let mut group =
            Self { a: Bodies::default(), b: Bodies::default(), rows: [NO_ROW; WIDTH], joint: [Wide::default(); 9] };
        group.rows[..rows.len()].copy_from_slice(rows);
        for lane in 0..WIDTH {
            let joint = problem.joints.get(group.rows[lane] as usize).unwrap_or(&nothing);
            group.a.set(lane, joint.body_a as usize, problem, slots);
            group.b.set(lane, joint.body_b as usize, problem, slots);
            let ([ax, ay, az], [bx, by, bz], [gx, gy, gz]) = (joint.r_a, joint.r_b, joint.gap);
            set_lane(&mut group.joint, lane, &[ax, ay, az, bx, by, bz, gx, gy, gz]);
        }
        group
    }
}
