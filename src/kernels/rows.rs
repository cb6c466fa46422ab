//! The rows of a problem in the form that the kernels read: over a lane, without padding.

use crate::math::{Lane, Quat, Scalar, Vec3};
use crate::problem::{
    AxisRow, BodyRow, ContactRow, DampingRow, ImpulseRow, InertiaRow, JointRow, MassRow, MomentumRow, Params, PointRow,
    Softness, Substep,
};
pub use crate::problem::{Mass, Sym3};

/// Twin of the WGSL struct `Body`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body<L> {
    /// Velocity of the center of mass.
    pub v: Vec3<L>,
    /// Angular velocity.
    pub w: Vec3<L>,
    /// Movement since the step began.
    pub dp: Vec3<L>,
    /// Time since the step began.
    pub time: L,
    /// Rotation since the step began.
    pub dq: Quat<L>,
}

/// Velocities of a body without the impulses of this substep; with `Rules::from_start`, those when the step began. Twin
/// of the WGSL struct `Free`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Free<L> {
    /// Velocity of the center of mass.
    pub v: Vec3<L>,
    /// Angular velocity.
    pub w: Vec3<L>,
}

/// Twin of the WGSL struct `Damping`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Damping<L> {
    /// Velocity added to the plain acceleration.
    pub linear_gain: Vec3<L>,
    /// The share of the velocity that is lost.
    pub linear_loss: L,
    /// Angular velocity added in the same way.
    pub angular_gain: Vec3<L>,
    /// The share of the angular velocity that is lost.
    pub angular_loss: L,
}

/// Twin of the WGSL struct `Inertia`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertia<L> {
    /// Principal moments.
    pub principal: Vec3<L>,
    /// One over the moments.
    pub inv_principal: Vec3<L>,
    /// Rotation from the principal axes to the world when the step begins.
    pub frame: Quat<L>,
}

/// Twin of the WGSL struct `Contact`, without the indices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact<L> {
    /// Unit normal from a to b.
    pub normal: Vec3<L>,
    /// First unit tangent.
    pub tangent: Vec3<L>,
    /// Coulomb coefficient.
    pub friction: L,
    /// Restitution.
    pub restitution: L,
    /// Radius of curvature of a's surface.
    pub radius_a: L,
    /// Radius of curvature of b's surface.
    pub radius_b: L,
    /// Compression of its springs while the surfaces just touch.
    pub preload: L,
}

/// Twin of the WGSL struct `Point`, in the order of `PointRow`, which lanes have in memory.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point<L> {
    /// Arm of a.
    pub r_a: Vec3<L>,
    /// Separation when the step begins.
    pub separation: L,
    /// Arm of b.
    pub r_b: Vec3<L>,
    /// Effective mass along the normal; for a patch, about the normal.
    pub normal_mass: L,
    /// Effective mass in the tangential plane.
    pub tangent_mass: L,
    /// Acceleration of b relative to a along the normal.
    pub pull: L,
    /// Slip along the first tangent; with friction per manifold, distance from the patch. See `PointRow`.
    pub slip_1: L,
    /// Slip along the second tangent.
    pub slip_2: L,
}

/// Twin of the WGSL struct `Joint`, without the indices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joint<L> {
    /// Arm of a when the step begins.
    pub r_a: Vec3<L>,
    /// Arm of b when the step begins.
    pub r_b: Vec3<L>,
    /// Anchor of b less anchor of a when the step begins.
    pub gap: Vec3<L>,
    /// 1 if the anchors need not coincide.
    pub is_loose: L,
    /// Rotation of the frame on a when the step begins; zero if no axis is an angle between the frames.
    pub frame_a: Quat<L>,
    /// Rotation of the frame on b when the step begins.
    pub frame_b: Quat<L>,
}

/// Twin of the WGSL struct `Axis`, in the order of `AxisRow`, which lanes have in memory.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis<L> {
    /// Direction when the step begins.
    pub direction: Vec3<L>,
    /// Above 0 a shift, below 0 an angle between two frames that turn, 0 a rotation about the direction.
    pub coordinate: L,
    /// Position of a when the step begins.
    pub gap: L,
    /// Distance of a from its upper limit when the step begins; `NO_LIMIT` of a row that is no limit.
    pub left: L,
    /// Speed of the motor.
    pub speed: L,
    /// Largest impulse in a substep.
    pub max_impulse: L,
    /// Speed in a substep over the gap.
    pub rate: L,
    /// Share of the speed that the row takes away.
    pub mass_scale: L,
    /// Share of the impulse that a spring gives back.
    pub impulse_scale: L,
    /// Value when the step begins, of a swing or a distance.
    pub start: L,
}

/// Twin of the WGSL struct `Impulse`, in its order.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impulse<L> {
    /// Along the normal.
    pub normal: L,
    /// Along the first tangent.
    pub tangent_1: L,
    /// Along the second tangent.
    pub tangent_2: L,
    /// Normal impulse by which the point bounced in this substep; below 0 if it came again at once.
    pub bounce: L,
}

/// One impulse between two accelerated sweeps. Twin of the WGSL struct `ImpulseStep`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImpulseStep<L> {
    /// Its value after the sweep before.
    pub before: Vec3<L>,
    /// Its value at the start of the sweep.
    pub begin: Vec3<L>,
}

/// Twin of the WGSL struct `Momentum`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum<L> {
    /// t_k.
    pub t: L,
    /// (t_k-1 - 1)/t_k.
    pub factor: L,
    /// The smallest f² since the last restart.
    pub square: L,
    /// Number of times that momentum has ended.
    pub restarts: u32,
}

/// Twin of the WGSL struct `Softness`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SoftnessOf<L> {
    /// Wanted velocity over overlap.
    pub bias_rate: L,
    /// Share of the effective mass that acts.
    pub mass_scale: L,
    /// Share of the accumulated impulse that the contact gives back.
    pub impulse_scale: L,
    /// Largest speed at which overlap is pushed out.
    pub push_limit: L,
}

/// Twin of the WGSL struct `Params`, without the counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepParams<L> {
    /// Length of a substep.
    pub substep: L,
    /// One over the length of a substep.
    pub inverse_substep: L,
    /// A slower approach does not bounce.
    pub restitution_threshold: L,
    /// Softness of contacts between movable bodies.
    pub movable: SoftnessOf<L>,
    /// Softness of contacts with a body that cannot move.
    pub fixed: SoftnessOf<L>,
    /// Softness of joints.
    pub joint: SoftnessOf<L>,
    /// Overlap that remains.
    pub slop: L,
    /// Factor on every correction.
    pub relaxation: L,
    /// Corrections that change a relative velocity by less count as zero.
    pub tolerance: L,
}

/// Two bodies that one thread works on. Twin of the WGSL struct `Pair`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair<L> {
    /// The body that the normal points away from.
    pub a: Body<L>,
    /// The body that the normal points to.
    pub b: Body<L>,
    /// Mass of a.
    pub mass_a: Mass<L>,
    /// Mass of b.
    pub mass_b: Mass<L>,
    /// Velocities of a when the step began, if the velocities in `a` are changes.
    pub start_a: Free<L>,
    /// The same for b.
    pub start_b: Free<L>,
    /// 1 once a correction was above the tolerance.
    pub moving: L,
}

/// `load` and `store` of rows: first the vectors and quaternions, then the numbers, then an integer.
macro_rules! stored {
    ($($Kernel:ident as $Row:ident { $($Type:ident: $($field:ident),+;)* [$($number:ident),*] $($same:ident)? })*) => {$(
        impl<S: Scalar> $Kernel<S> {
            /// Loads a row from storage.
            pub fn load(r: &$Row) -> Self {
                Self { $($($field: $Type::load(r.$field),)+)* $($number: S::from(r.$number),)* $($same: r.$same)? }
            }

            /// Stores a row, without indices.
            #[allow(clippy::needless_update)]
            pub fn store(&self) -> $Row {
                $Row {
                    $($($field: self.$field.store(),)+)*
                    $($number: self.$number.to_f32(),)*
                    $($same: self.$same,)?
                    ..bytemuck::Zeroable::zeroed()
                }
            }
        }
    )*};
}

stored! {
    Body as BodyRow { Vec3: v, w, dp; Quat: dq; [time] }
    Damping as DampingRow { Vec3: linear_gain, angular_gain; [linear_loss, angular_loss] }
    Inertia as InertiaRow { Vec3: principal, inv_principal; Quat: frame; [] }
    Contact as ContactRow { Vec3: normal, tangent; [friction, restitution, radius_a, radius_b, preload] }
    Point as PointRow {
        Vec3: r_a, r_b; [separation, normal_mass, tangent_mass, pull, slip_1, slip_2]
    }
    Impulse as ImpulseRow { [normal, tangent_1, tangent_2, bounce] }
    Joint as JointRow { Vec3: r_a, r_b, gap; Quat: frame_a, frame_b; [is_loose] }
    Axis as AxisRow {
        Vec3: direction; [coordinate, gap, left, speed, max_impulse, rate, mass_scale, impulse_scale, start]
    }
    Momentum as MomentumRow { [t, factor, square] restarts }
}

impl<S: Scalar> Mass<S> {
    /// Loads a row from storage.
    pub fn load(r: &MassRow) -> Self {
        Self {
            inv_inertia: Sym3 { x: Vec3::load(r.inv_inertia_x), yz: Vec3::load(r.inv_inertia_yz) },
            inv_mass: S::from(r.inv_mass),
            locks: S::from(r.locks),
            acceleration: Vec3::load(r.acceleration),
        }
    }

    /// Stores a row.
    pub fn store(&self) -> MassRow {
        MassRow {
            inv_inertia_x: self.inv_inertia.x.store(),
            inv_mass: self.inv_mass.to_f32(),
            inv_inertia_yz: self.inv_inertia.yz.store(),
            locks: self.locks.to_f32(),
            acceleration: self.acceleration.store(),
            ..MassRow::default()
        }
    }
}

impl<L: Lane> SoftnessOf<L> {
    /// Loads the numbers from storage, the same in every lane.
    #[inline(always)]
    pub fn load(r: &Softness) -> Self {
        Self {
            bias_rate: L::constant(r.bias_rate.into()),
            mass_scale: L::constant(r.mass_scale.into()),
            impulse_scale: L::constant(r.impulse_scale.into()),
            push_limit: L::constant(r.push_limit.into()),
        }
    }
}

impl<L: Lane> StepParams<L> {
    /// Loads the numbers from storage, the same in every lane.
    #[inline(always)]
    pub fn load(p: &Params, s: &Substep) -> Self {
        Self {
            substep: L::constant(s.length.into()),
            inverse_substep: L::constant(s.inverse_length.into()),
            restitution_threshold: L::constant(p.restitution_threshold.into()),
            movable: SoftnessOf::load(&s.movable),
            fixed: SoftnessOf::load(&s.fixed),
            joint: SoftnessOf::load(&s.joint),
            slop: L::constant(p.slop.into()),
            relaxation: L::constant(p.relaxation.into()),
            tolerance: L::constant(p.tolerance.into()),
        }
    }
}
