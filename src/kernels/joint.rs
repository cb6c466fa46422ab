//! One joint, which keeps the anchors of two bodies together unless axes guide them. Twins of `shaders/lib/joint.wgsl`
//! and of the kernels `warm_start_joints` and `solve_joints`.

use super::Rules;
use super::pair::{apply_impulse, inverse_masses, note_correction, relative_movement, relative_velocity};
use super::rows::{Joint, Mass, Pair, StepParams};
use crate::constants::STIFFENING;
use crate::math::{Lane, Vec3, cross3, dot3, reciprocal, select3, turned, vec3};

/// The present arms, and the present gap from the anchor of a to that of b. Both arms end in the middle of the gap, so
/// that the impulses of a joint have no moment together.
#[inline(always)]
pub fn current_anchors<L: Lane>(pair: &Pair<L>, joint: &Joint<L>) -> ([Vec3<L>; 2], Vec3<L>) {
    let gap = joint.gap + relative_movement(pair, joint.r_a, joint.r_b);
    let half = gap * L::constant(0.5);
    let [r_a, r_b] = [joint.r_a + turned(pair.a.dq, joint.r_a), joint.r_b + turned(pair.b.dq, joint.r_b)];
    ([r_a + half, r_b - half], gap)
}

/// The column for the axis e of one body's contribution to G M⁻¹ Gᵀ: (I⁻¹ (r x e)) x r.
#[inline(always)]
fn turning_column<L: Lane>(m: &Mass<L>, r: Vec3<L>, e: Vec3<L>) -> Vec3<L> {
    cross3(m.inv_inertia.times(cross3(r, e)), r)
}

/// One column of the joint's block of G M⁻¹ Gᵀ: that of the axis e, along which the bodies have this inverse mass.
#[inline(always)]
pub fn joint_column<L: Lane>(pair: &Pair<L>, anchors: [Vec3<L>; 2], e: Vec3<L>, inverse_mass: L) -> Vec3<L> {
    let turning = turning_column(&pair.mass_a, anchors[0], e) + turning_column(&pair.mass_b, anchors[1], e);
    e * inverse_mass + turning
}

/// The parts of the inverse of a symmetric block. Twin of the WGSL struct `Cofactors`.
pub(super) struct Cofactors<L> {
    pub x: Vec3<L>,
    pub y: Vec3<L>,
    pub z: Vec3<L>,
    pub determinant: L,
    /// The factor that scaled the block.
    pub scale: L,
}

/// The cofactors of the symmetric block with these columns. The block is first scaled to a trace of 1 to 2, because the
/// determinant of a block of 1e7 kg would leave single precision.
///
/// A ball of 1 mm at the end of a 1 m arm is 2.5e6 times as hard to move along the arm as perpendicular to it. Rounding
/// makes such a block indefinite. If the determinant is below `stiffening`, this number is added to the diagonal.
/// Corrections along the arm are then too small, never too large.
#[inline(always)]
pub(super) fn cofactors<L: Lane>(x: Vec3<L>, y: Vec3<L>, z: Vec3<L>, stiffening: f64) -> Cofactors<L> {
    let scale = (x.x + y.y + z.z).inverse_power();
    let (mut x, mut y, mut z) = (x * scale, y * scale, z * scale);
    let is_thin = L::constant(stiffening).gt(dot3(x, cross3(y, z)));
    let more = L::select(L::constant(0.0), L::constant(stiffening), is_thin);
    (x.x, y.y, z.z) = (x.x + more, y.y + more, z.z + more);
    let c_x = cross3(y, z);
    Cofactors { x: c_x, y: cross3(z, x), z: cross3(x, y), determinant: dot3(x, c_x), scale }
}

/// Solves the symmetric block with these columns for u, by Cramer's rule.
#[inline(always)]
fn solve_block<L: Lane>(x: Vec3<L>, y: Vec3<L>, z: Vec3<L>, u: Vec3<L>) -> Vec3<L> {
    let c = cofactors(x, y, z, STIFFENING);
    vec3(dot3(c.x, u), dot3(c.y, u), dot3(c.z, u)) * reciprocal(c.determinant) * c.scale
}

/// Applies the carried impulse of a joint. Kernel `warm_start_joints`.
#[inline(always)]
pub fn warm_start_joint<L: Lane>(pair: &mut Pair<L>, joint: &Joint<L>, impulse: Vec3<L>) {
    let ([r_a, r_b], _) = current_anchors(pair, joint);
    apply_impulse(Rules::default(), pair, r_a, r_b, impulse);
}

/// Sweeps one joint. Kernel `solve_joints`.
#[inline(always)]
pub fn solve_joint<L: Lane>(
    rules: Rules,
    params: &StepParams<L>,
    pair: &mut Pair<L>,
    joint: &Joint<L>,
    impulse: &mut Vec3<L>,
) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let (anchors, gap) = current_anchors(pair, joint);
    let m = inverse_masses(pair);
    let x = joint_column(pair, anchors, vec3(one, zero, zero), m.x);
    let y = joint_column(pair, anchors, vec3(zero, one, zero), m.y);
    let z = joint_column(pair, anchors, vec3(zero, zero, one), m.z);

    // The gap is closed softly, or not at all in a relax sweep.
    let before = *impulse;
    let mut wanted = relative_velocity(rules, pair, anchors[0], anchors[1]);
    let (mut mass_scale, mut impulse_scale) = (one, zero);
    if rules.biased {
        wanted += gap * params.joint.bias_rate;
        mass_scale = params.joint.mass_scale;
        impulse_scale = params.joint.impulse_scale;
    }
    let correction = solve_block(x, y, z, wanted) * mass_scale + before * impulse_scale;
    let mut change = correction * -params.relaxation;
    if rules.axes {
        change = select3(change, Vec3::default(), joint.is_loose.gt(zero));
    }
    *impulse = before + change;
    if rules.measured {
        note_correction(rules, params, pair, change.x, reciprocal(x.x));
        note_correction(rules, params, pair, change.y, reciprocal(y.y));
        note_correction(rules, params, pair, change.z, reciprocal(z.z));
    }
    apply_impulse(Rules::default(), pair, anchors[0], anchors[1], change);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::rows::Body;
    use crate::math::Quat;

    /// The centers of the bodies are apart by the difference of the arms if both arms end at one place.
    #[test]
    fn both_arms_of_an_open_joint_end_at_one_place() {
        let joint = Joint {
            r_a: vec3(0.3_f64, 0.1, -0.2),
            r_b: vec3(-0.4, 0.2, 0.1),
            gap: vec3(0.02, -0.05, 0.03),
            ..Joint::default()
        };
        let a = Body { dp: vec3(0.1, 0.2, 0.3), dq: Quat { axis: vec3(0.0, 0.0, 0.6), w: 0.8 }, ..Body::default() };
        let b = Body { dp: vec3(-0.1, 0.1, 0.0), dq: Quat { axis: vec3(0.28, 0.0, 0.0), w: 0.96 }, ..Body::default() };
        let ([r_a, r_b], _) = current_anchors(&Pair { a, b, ..Pair::default() }, &joint);
        let apart = (joint.gap + joint.r_a - joint.r_b) + (b.dp - a.dp);
        let off = (r_a - r_b) - apart;
        assert!(dot3(off, off) < 1e-30, "{off:?}");
    }

    /// Nothing moves along z. 2^-19 is added to the half of the block, whose trace of 2 is scaled to 1.
    #[test]
    fn a_block_that_is_hard_along_one_axis_is_solved_across_it() {
        let solved = solve_block(vec3(1.0_f64, 0.0, 0.0), vec3(0.0, 1.0, 0.0), Vec3::default(), vec3(1.0, -3.0, 0.0));
        assert!((solved.x - 1.0).abs() < 1e-5 && (solved.y + 3.0).abs() < 3e-5, "{solved:?}");
        assert_eq!(solved.z, 0.0);
    }
}
