//! The Rust doubles of `shaders/*.wgsl`: same names, same order of operations, over a [`Lane`](crate::math::Lane).
//!
//! `pair`, `contact`, `friction` and `joint` are the doubles of the files of that name in `shaders/lib` and of the kernels that sweep
//! constraints. `integrate` holds the doubles of kernels over bodies, `convergence` and `momentum` those between sweeps. Branches on
//! data are `select`s; branches on rules are plain `if`s, here and in WGSL.

pub mod axis;
pub mod contact;
pub mod convergence;
pub mod friction;
pub mod integrate;
pub mod joint;
pub mod joint_system;
mod kernel_rows;
pub mod momentum;
pub mod pair;
pub(crate) mod rows;

pub use kernel_rows::KernelRows;
pub use rows::{
    Axis, Body, Contact, Damping, Free, Impulse, ImpulseStep, Inertia, Joint, Mass, Momentum, Pair, Point, SoftnessOf,
    StepParams, Sym3,
};

use crate::config::FrictionRule;

/// The rules of one kernel. Twin: the struct `Rules` of `shaders/lib/rules.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rules {
    /// Whether overlap and gaps are removed.
    pub biased: bool,
    /// How friction is modelled.
    pub friction: FrictionRule,
    /// Whether friction acts once a manifold.
    pub patch: bool,
    /// Whether friction comes before the normals.
    pub friction_first: bool,
    /// Whether the sum of the normal impulses is clamped, and not every correction.
    pub accumulated: bool,
    /// Whether any surface is round.
    pub round: bool,
    /// Whether the points of a manifold are solved together before each by itself.
    pub as_one: bool,
    /// How often a manifold is swept before the next one, 1 or more.
    pub passes: u8,
    /// Whether surfaces slip by themselves, as a belt does: friction at points is then against `slip_1` and `slip_2`, a
    /// velocity added to that of the bodies (m/s). With box or disc friction only.
    pub driven: bool,
    /// Whether corrections are held against the tolerance.
    pub measured: bool,
    /// Whether velocities of bodies are changes since the step began.
    pub from_start: bool,
    /// Whether every body that can move has the same moment of inertia about all axes.
    pub isotropic: bool,
    /// Whether any surface bounces: points then keep the largest normal impulse of the step.
    pub bounces: bool,
    /// Whether joints have axes. Shaders with and without them are made of different files.
    pub axes: bool,
}

impl Default for Rules {
    /// Relax sweeps of flat, frictionless contacts.
    fn default() -> Self {
        Self {
            biased: false,
            friction: FrictionRule::None,
            patch: false,
            friction_first: false,
            accumulated: true,
            round: false,
            as_one: false,
            driven: false,
            passes: 1,
            measured: false,
            from_start: false,
            isotropic: false,
            bounces: false,
            axes: false,
        }
    }
}

impl Rules {
    /// The rules of a warm start: where friction acts, and nothing else.
    pub fn of_warm_start(self) -> Self {
        Self { friction: self.friction, patch: self.patch, isotropic: self.isotropic, ..Self::default() }
    }

    /// The rules of joints.
    pub fn of_joints(self) -> Self {
        let Self { biased, measured, from_start, axes, .. } = self;
        Self { biased, measured, from_start, axes, ..Self::default() }
    }

    /// How many of a manifold's rows are contact points; the patch is not.
    #[inline(always)]
    pub fn contact_points(self, rows: usize) -> usize {
        if self.patch { rows - 1 } else { rows }
    }
}
