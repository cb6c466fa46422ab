//! How far joints are open after a step. If a joint opened beyond the promise, the step is taken again with shorter
//! substeps (docs/derivation.md, section 7).

use glam::Vec3;

use crate::kernels::axis::{AxisMotion, Frames, axis_motion};
use crate::kernels::pair::relative_movement;
use crate::kernels::rows::{Axis, Body, Joint, Mass, Pair};
use crate::math::dot3;
use crate::problem::{AxisRow, JointRow, StepProblem};

/// The bodies of a joint after the step.
pub fn pair_of(problem: &StepProblem, joint: &JointRow) -> Pair<f64> {
    let ends = [joint.body_a, joint.body_b].map(|end| end as usize);
    let [a, b] = ends.map(|end| Body::load(&problem.bodies[end]));
    let [mass_a, mass_b] = ends.map(|end| Mass::load(&problem.masses[end]));
    Pair { a, b, mass_a, mass_b, ..Pair::default() }
}

/// A joint with its frames at the present poses. Programs have this long function once.
#[inline(never)]
pub fn frames_of<'a>(pair: &Pair<f64>, joint: &'a Joint<f64>) -> Frames<'a, f64> {
    Frames::of(pair, joint)
}

/// The motion of the bodies of a joint along one of its axes. Programs have this long function once.
#[inline(never)]
pub fn motion_of(pair: &Pair<f64>, frames: &Frames<f64>, axis: &Axis<f64>) -> AxisMotion<f64> {
    axis_motion(pair, frames, axis)
}

/// How far a joint is open before the step and after it: the distance relative to its arms or the angle (rad),
/// whichever number is larger. The length of a rod or rope counts as an arm.
pub fn openings(problem: &StepProblem, row: usize) -> [f64; 2] {
    let row = &problem.joints[row];
    let (joint, pair) = (Joint::<f64>::load(row), pair_of(problem, row));
    let mut squares = [0.0; 2];
    if row.is_loose == 0.0 {
        let now = joint.gap + relative_movement(&pair, joint.r_a, joint.r_b);
        squares = [joint.gap, now].map(|gap| dot3(gap, gap));
    }
    let mut angles = [0.0_f64; 2];
    let frames = frames_of(&pair, &joint);
    let mut arms = [row.r_a, row.r_b].map(|arm| f64::from(Vec3::from(arm).length())).iter().sum::<f64>();
    let axes = &problem.axes[row.first_axis as usize..(row.first_axis + row.axis_count) as usize];
    for axis in axes.iter().filter(|axis| axis.is_limit() || axis.is_lock()) {
        let gaps = [0.0, motion_of(&pair, &frames, &Axis::load(axis)).moved].map(|moved| gap_after(axis, moved));
        if axis.coordinate == AxisRow::SHIFT {
            arms += f64::from(axis.start);
            squares = [0, 1].map(|i| squares[i] + gaps[i] * gaps[i]);
        } else {
            angles = [0, 1].map(|i| angles[i].max(gaps[i].abs()));
        }
    }
    let share = |square: f64| if arms > 0.0 { square.sqrt() / arms } else { 0.0 };
    [0, 1].map(|i| angles[i].max(share(squares[i])))
}

/// The position beyond the limits of an axis after a movement of a, at most 0; for a lock its position (m, rad).
pub fn gap_after(axis: &AxisRow, moved: f64) -> f64 {
    let (place, left) = (f64::from(axis.gap) + moved, f64::from(axis.left) - moved);
    if axis.is_limit() { place.min(left).min(0.0) } else { place }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{BodyRow, MassRow, NO_LIMIT};

    /// A door with an arm of 2 m to its hinge in the world, which a step moves and turns.
    #[test]
    fn a_hinge_is_open_by_its_distance_or_its_angle() {
        let opened = |low: f32, angle: f32| {
            let moved = BodyRow { dp: [0.0, -low, 0.0], ..BodyRow::AT_REST };
            let lock = AxisRow { direction: [0.0, 0.0, 1.0], gap: angle, left: NO_LIMIT, ..AxisRow::default() };
            let joint = JointRow { body_b: 1, r_a: [0.0, 0.0, 2.0], axis_count: 1, ..JointRow::default() };
            let problem = StepProblem {
                bodies: vec![moved, BodyRow::AT_REST],
                masses: vec![MassRow::default(); 2],
                joints: vec![joint],
                axes: vec![lock],
                ..StepProblem::default()
            };
            openings(&problem, 0)
        };
        for (low, angle, [before, after]) in
            [(0.01, 0.0, [0.0, 0.005]), (0.01, 0.02, [0.02, 0.02]), (0.06, 0.02, [0.02, 0.03])]
        {
            let found = opened(low, angle);
            assert!((found[0] - before).abs() < 1e-7 && (found[1] - after).abs() < 1e-7, "{low} {angle}: {found:?}");
        }
    }
}
