//! The rows of a [`StepProblem`](super::StepProblem), with the same layout in Rust and WGSL.
//!
//! The size of every row is a multiple of 16 bytes. Each row has a twin in `shaders/lib/types.wgsl`, and
//! `tests/cpu/shaders.rs` compares the offset of every field by reflection.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::collide::MAX_POINTS;
use crate::math;
use crate::math::effective_mass::tangent_of;

/// State of one body, which a step changes, 64 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BodyRow {
    /// Velocity of the center of mass (m/s).
    pub v: [f32; 3],
    #[doc(hidden)]
    pub pad_v: f32,
    /// Angular velocity, world axes (rad/s).
    pub w: [f32; 3],
    #[doc(hidden)]
    pub pad_w: f32,
    /// Movement of the center of mass since the step began (m).
    pub dp: [f32; 3],
    /// Time since the step began (s).
    pub time: f32,
    /// Rotation since the step began, x y z w.
    pub dq: [f32; 4],
}

impl BodyRow {
    /// A body that does not move.
    pub const AT_REST: Self =
        Self { v: [0.0; 3], pad_v: 0.0, w: [0.0; 3], pad_w: 0.0, dp: [0.0; 3], time: 0.0, dq: [0.0, 0.0, 0.0, 1.0] };
}

/// Velocities of one body without the impulses of this substep, 32 B. A backend keeps them between passes. No step
/// needs those of the step before, so they are not part of a problem.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FreeRow {
    /// Velocity of the center of mass (m/s).
    pub v: [f32; 3],
    #[doc(hidden)]
    pub pad_v: f32,
    /// Angular velocity, world axes (rad/s).
    pub w: [f32; 3],
    #[doc(hidden)]
    pub pad_w: f32,
}

/// Inverse mass and inertia of one body, 48 B. All zero for a body that cannot be pushed.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MassRow {
    /// Inverse inertia about the center of mass, world axes (1/(kg m²)); xx xy xz.
    pub inv_inertia_x: [f32; 3],
    /// Inverse mass (1/kg).
    pub inv_mass: f32,
    /// Inverse inertia; yy yz zz.
    pub inv_inertia_yz: [f32; 3],
    /// The world axes along which nothing moves the body: the sum of 1 for x, 2 for y and 4 for z.
    pub locks: f32,
    /// Gravity plus force over mass (m/s²).
    pub acceleration: [f32; 3],
    #[doc(hidden)]
    pub pad_end: f32,
}

/// Effect of the torque on one body, 16 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TorqueRow {
    /// Inverse inertia when the step begins, times torque, world axes (rad/s²).
    pub angular_acceleration: [f32; 3],
    #[doc(hidden)]
    pub pad: f32,
}

impl TorqueRow {
    /// The row of a body without torque. Adding negative zero changes no bit of any number, not even of negative zero.
    pub const NONE: Self = Self { angular_acceleration: [-0.0; 3], pad: 0.0 };
}

/// Effect of damping on one body in a substep, 32 B. Besides the plain acceleration, a velocity v changes by the gain
/// minus the loss times v.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DampingRow {
    /// Velocity that gravity and force add besides the plain acceleration, because it does not decay for the whole
    /// substep (m/s).
    pub linear_gain: [f32; 3],
    /// The share of the velocity that is lost, 0 to 1; 0 without linear damping.
    pub linear_loss: f32,
    /// Angular velocity that the torque adds in the same way (rad/s).
    pub angular_gain: [f32; 3],
    /// The share of the angular velocity that is lost, 0 to 1.
    pub angular_loss: f32,
}

/// Principal inertia of one body whose moments differ, 48 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct InertiaRow {
    /// Principal moments of inertia, divided by the power of two (kg m²) in the largest. Only their ratios matter. The
    /// scale keeps products with spins within single precision.
    pub principal: [f32; 3],
    /// The body.
    pub body: u32,
    /// One over the principal moments.
    pub inv_principal: [f32; 3],
    #[doc(hidden)]
    pub pad: f32,
    /// Rotation from the principal axes to the world when the step begins, x y z w.
    pub frame: [f32; 4],
}

/// One manifold: the contact of two bodies at up to four points with one normal, 64 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ContactRow {
    /// Unit normal from a to b, world axes.
    pub normal: [f32; 3],
    /// Coulomb coefficient mu.
    pub friction: f32,
    /// First unit tangent; the second is normal x tangent.
    pub tangent: [f32; 3],
    /// Restitution.
    pub restitution: f32,
    /// The body that the normal points away from.
    pub body_a: u32,
    /// The body that the normal points to.
    pub body_b: u32,
    /// Index of its first point in `points` and `impulses`.
    pub first_point: u32,
    /// Number of its points, 1 to 4. With friction per manifold one more row follows them: the patch. Its arms are the
    /// means of the points' arms, its normal mass is that of the twist about the normal, and its normal impulse is that
    /// of the twist. With rolling or spinning friction, the row after the points has only angular impulses: about the
    /// normal and about both tangents.
    pub point_count: u32,
    /// Radius of curvature of a's surface at the contact, 0 if flat or sharp (m). A round body turns beneath its
    /// contact.
    pub radius_a: f32,
    /// Radius of curvature of b's surface (m).
    pub radius_b: f32,
    /// Compression of the springs of a soft contact while the surfaces just touch (m). The contact acts on the
    /// separation less the preload.
    pub preload: f32,
    /// Length of its substeps over that of class 0, a power of two (docs/derivation.md). Impulses are proportional to
    /// it.
    pub substep_share: f32,
}

crate::saved::fields!(ContactRow {
    normal,
    friction,
    tangent,
    restitution,
    body_a,
    body_b,
    first_point,
    point_count,
    radius_a,
    radius_b,
    preload,
    substep_share,
});

impl ContactRow {
    /// A row with only a normal and its tangents.
    pub fn framed(normal: Vec3) -> Self {
        let tangent = tangent_of(math::Vec3::<f32>::load(normal.to_array()));
        Self { normal: normal.to_array(), tangent: tangent.store(), ..Self::default() }
    }

    /// Whether a body is one of its two.
    pub(crate) fn holds(&self, body: usize) -> bool {
        self.body_a as usize == body || self.body_b as usize == body
    }

    /// The two tangents, which form a right-handed frame with the normal.
    pub fn tangents(&self) -> (Vec3, Vec3) {
        let tangent_1 = Vec3::from_array(self.tangent);
        (tangent_1, Vec3::from_array(self.normal).cross(tangent_1))
    }
}

/// One contact point, 48 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PointRow {
    /// From the center of mass of a to the point when the step begins, world axes (m).
    pub r_a: [f32; 3],
    /// Separation when the step begins, negative when overlapping (m).
    pub separation: f32,
    /// From the center of mass of b to the point (m).
    pub r_b: [f32; 3],
    /// One over the normal entry of G M⁻¹ Gᵀ (kg).
    pub normal_mass: f32,
    /// One over the largest eigenvalue of the tangential 2x2 block of G M⁻¹ Gᵀ; with one slip direction, one over the
    /// entry of this direction (kg).
    pub tangent_mass: f32,
    /// Acceleration of b relative to a along the normal by gravity and forces (m/s²). 0 if no surface bounces.
    pub pull: f32,
    /// Component of the slip direction along the first tangent. With friction per manifold, the distance from the patch
    /// (m). With driven surfaces, the velocity of b's surface relative to a's, beyond that of the bodies (m/s); with
    /// friction per manifold, only the patch has it. On a patch that resists rolling, the lever of spinning friction
    /// (m).
    pub slip_1: f32,
    /// The same along the second tangent. On a patch that resists rolling, the lever of rolling friction (m).
    pub slip_2: f32,
}

crate::saved::fields!(PointRow { r_a, separation, r_b, normal_mass, tangent_mass, pull, slip_1, slip_2 });

/// The inverse inertia of a body of direct joints when the step begins, 32 B. It turns with the body.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TurningRow {
    /// World axes (1/(kg m²)); xx xy xz.
    pub inv_inertia_x: [f32; 3],
    /// The body.
    pub body: u32,
    /// yy yz zz.
    pub inv_inertia_yz: [f32; 3],
    #[doc(hidden)]
    pub pad: f32,
}

/// One joint, which makes the anchors of two bodies coincide or guides the bodies by axes, 96 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct JointRow {
    /// From the center of mass of a to its anchor when the step begins, world axes (m).
    pub r_a: [f32; 3],
    /// One body.
    pub body_a: u32,
    /// From the center of mass of b to its anchor (m).
    pub r_b: [f32; 3],
    /// The other body.
    pub body_b: u32,
    /// Anchor of b less anchor of a when the step begins (m).
    pub gap: [f32; 3],
    /// 1 if the anchors need not coincide. In this case the arm of b ends at the anchor of a.
    pub is_loose: f32,
    /// Index of its first axis in `axes`.
    pub first_axis: u32,
    /// Number of its axes, up to `MAX_AXES`.
    pub axis_count: u32,
    #[doc(hidden)]
    pub pad: [u32; 2],
    /// Rotation of the frame of the joint on a when the step begins, x y z w; zero for a joint whose axes have no
    /// [`AxisRow::coordinate`] below 0. The sign is such that a's rotation in the frame on b has w >= 0.
    pub frame_a: [f32; 4],
    /// Rotation of the frame on b.
    pub frame_b: [f32; 4],
}

/// Most rows of axes of one joint: six axes, each with bounds and a drive.
pub const MAX_AXES: usize = 12;

/// [`AxisRow::left`] of rows that are no limits. Limits this far away, and infinite limits, are never reached (m, rad).
pub const NO_LIMIT: f32 = -1e18;

/// One axis along which or about which a joint holds, limits or drives body a against body b, 48 B. Its impulse on a is
/// the first number of a row of `joint_impulses`. The rows of axes follow those of all joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AxisRow {
    /// Direction when the step begins, world axes. It turns with b. Its length is 1, or a little more for the angle
    /// about a first axis that is turned aside.
    pub direction: [f32; 3],
    /// [`AxisRow::SHIFT`] along the axis, [`AxisRow::TURN`] about it, or [`AxisRow::angle`] between frames that both turn.
    pub coordinate: f32,
    /// Position of a when the step begins, above its lower limit or beyond its target (m, rad).
    pub gap: f32,
    /// Distance of a from its upper limit when the step begins (m, rad); [`NO_LIMIT`] of a row that is no limit.
    pub left: f32,
    /// Speed of the motor (m/s, rad/s).
    pub speed: f32,
    /// Largest impulse in a substep (N s, N m s).
    pub max_impulse: f32,
    /// Ratio of the speed in a substep to the gap (1/s), for bounds of an axis with a drive. For a spring, ratio of the
    /// impulse in a substep to the gap (N s/m, N m s/rad).
    pub rate: f32,
    /// Share of the speed that a drive takes away in a substep, 1 for a motor. Bounds have 1 on an axis with a drive,
    /// and 0 on other axes.
    pub mass_scale: f32,
    /// Share of the impulse that a spring gives back; 0 for other rows.
    pub impulse_scale: f32,
    /// Value when the step begins: of [`AxisRow::angle`] (rad); of an axis that joins the anchors, their distance (m);
    /// otherwise 0.
    pub start: f32,
}

impl AxisRow {
    /// A translation along a direction that turns with b.
    pub const SHIFT: f32 = 1.0;
    /// A rotation about a direction that turns with b, for a joint whose first axis does not swing, or whose bodies hardly
    /// turn against each other in the step.
    pub const TURN: f32 = 0.0;

    /// One of the coordinates of a rotation, by its number in `Angles`.
    pub fn angle(number: usize) -> f32 {
        -1.0 - number as f32
    }

    /// Whether the row is a limit, with two different bounds.
    pub fn is_limit(&self) -> bool {
        self.left > 0.5 * NO_LIMIT
    }

    /// Whether the row is a lock: neither a limit nor a drive.
    pub fn is_lock(&self) -> bool {
        self.left < 0.5 * NO_LIMIT && self.mass_scale + self.impulse_scale < 0.5
    }
}

/// The impulse of one joint on its body b, accumulated, 16 B (N s).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct JointImpulseRow {
    /// World axes.
    pub linear: [f32; 3],
    #[doc(hidden)]
    pub pad: f32,
}

crate::saved::fields!(JointImpulseRow { linear, pad });

/// Whether sweeps still move anything, 16 B. The sweeps of a step with a tolerance write it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ConvergenceRow {
    /// 1 if a correction of this sweep was above the tolerance.
    pub moving: u32,
    /// 1 if the remaining sweeps of this substep are skipped.
    pub done: u32,
    /// Sweeps that were not skipped in the whole step.
    pub sweeps: u32,
    /// Sweeps of the plan in the whole step.
    pub planned: u32,
}

/// How far accelerated sweeps extrapolate, 16 B. It is written between sweeps.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MomentumRow {
    /// 1 without momentum. It grows with every sweep that does not end momentum.
    pub t: f32,
    /// Extrapolation of the next sweep, as a share of the last step; 0 after a restart.
    pub factor: f32,
    /// Squared norm of the smallest change that a sweep made to all impulses since momentum last began (N² s²).
    pub square: f32,
    /// Number of times that momentum ended in the whole step.
    pub restarts: u32,
}

/// The impulses of one point, accumulated over the sweeps of the substeps, 16 B (N s).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ImpulseRow {
    /// Along the normal, on b.
    pub normal: f32,
    /// Along the first tangent, on b.
    pub tangent_1: f32,
    /// Along the second tangent, on b.
    pub tangent_2: f32,
    /// Along the normal, on b, by the bounce of this substep; below 0 if the point came again at once after it bounced.
    pub bounce: f32,
}

crate::saved::fields!(ImpulseRow { normal, tangent_1, tangent_2, bounce });

/// Coefficients of a soft contact over one substep, 16 B. Derivation: `problem::softness`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Softness {
    /// Ratio of the wanted velocity to the overlap (1/s).
    pub bias_rate: f32,
    /// Share of the effective mass that acts.
    pub mass_scale: f32,
    /// Share of the accumulated impulse that the contact gives back.
    pub impulse_scale: f32,
    /// Largest speed at which overlap is pushed out (m/s).
    pub push_limit: f32,
}

impl Softness {
    /// A rigid constraint with a target velocity of `bias_rate` times the overlap.
    pub fn rigid(bias_rate: f32, push_limit: f32) -> Self {
        Self { bias_rate, mass_scale: 1.0, impulse_scale: 0.0, push_limit }
    }

    /// Ratio of the overlap at rest to the impulse of a substep, times the effective mass (s); 0 for a rigid
    /// constraint.
    pub fn compliance(&self) -> f32 {
        if self.impulse_scale > 0.0 { self.impulse_scale / (self.mass_scale * self.bias_rate) } else { 0.0 }
    }
}

/// Parameters for every body and contact of a step, 52 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// A slower approach does not bounce (m/s).
    pub restitution_threshold: f32,
    /// Overlap that sweeps leave (m).
    pub slop: f32,
    /// Factor on every correction.
    pub relaxation: f32,
    /// Corrections that change a relative velocity by less count as zero (m/s).
    pub tolerance: f32,
    /// Number of bodies.
    pub body_count: u32,
    /// Number of points, patches included.
    pub point_count: u32,
    /// Number of joints.
    pub joint_count: u32,
    /// 1 if a patch follows the points of every contact.
    pub patches: u32,
    /// Number of axes of joints.
    pub axis_count: u32,
    /// Always 0. Shader compilers cannot know this, and the exact mode in WGSL relies on it.
    pub zero: u32,
    /// 1 if patches resist rolling and spinning, and friction acts at the points.
    pub rolls: u32,
    /// 1 if some surface moves by itself, as a belt does.
    pub driven: u32,
    /// 1 if a surface with restitution may meet another one faster than the threshold.
    pub bounces: u32,
}

/// The length of the substeps of a block, and the coefficients that follow from it, 56 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Substep {
    /// Length (s).
    pub length: f32,
    /// One over the length (1/s).
    pub inverse_length: f32,
    /// Softness of contacts between movable bodies.
    pub movable: Softness,
    /// Softness of contacts with a body that cannot move.
    pub fixed: Softness,
    /// Softness of joints.
    pub joint: Softness,
}

/// Number of rows in `points` and `impulses` for each slot of a simulation.
pub(crate) fn points_a_slot(patches: bool) -> usize {
    MAX_POINTS + usize::from(patches)
}

/// One pass for a dispatch: consecutive colors, and the substep of their block, 64 B.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PassRow {
    /// First color.
    pub first: u32,
    /// One past the last.
    pub end: u32,
    /// The substep of the block.
    pub substep: Substep,
}
