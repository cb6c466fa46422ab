//! The Rust twins of `shaders/*.wgsl`: same names, same order of operations, over a [`Lane`](crate::math::Lane).
//!
//! `pair`, `contact`, `friction` and `joint` are the twins of the files of the same names in `shaders/lib`, and of the
//! kernels that sweep constraints. `integrate` has the twins of kernels over bodies, and `convergence` and `momentum`
//! those of kernels between sweeps. Branches on data are `select`s with few exceptions, and branches on rules are plain
//! `if`s, here and in WGSL.

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
    /// Whether sweeps remove overlap and gaps.
    pub biased: bool,
    /// The model of friction.
    pub friction: FrictionRule,
    /// Whether a row for the whole manifold, the patch, follows the rows of its points. Friction acts there once for
    /// each manifold, unless the contact `rolls`.
    pub patch: bool,
    /// Whether the patch resists rolling and spinning; friction then acts at the points. Requires patches.
    pub rolls: bool,
    /// Whether friction comes before the normal impulses.
    pub friction_first: bool,
    /// Whether the sum of the normal impulses is clamped; otherwise each correction is.
    pub accumulated: bool,
    /// Whether any surface is round.
    pub round: bool,
    /// Whether the points of a manifold are solved together before each is solved alone.
    pub as_one: bool,
    /// Number of sweeps over a manifold before the next one, at least 1.
    pub passes: u8,
    /// Whether surfaces move by themselves, as a belt does. Friction then also opposes `slip_1` and `slip_2` of its row,
    /// velocities relative to the bodies (m/s). Requires box or disc friction.
    pub driven: bool,
    /// Whether corrections are compared with the tolerance.
    pub measured: bool,
    /// Whether velocities of bodies are changes since the step began.
    pub from_start: bool,
    /// Whether every movable body has the same moment of inertia about all axes, and no locked axis.
    pub isotropic: bool,
    /// Whether any surface bounces. Points then keep the largest normal impulse of the step.
    pub bounces: bool,
    /// Whether joints have axes. Shaders with and without axes consist of different files.
    pub axes: bool,
}

impl Default for Rules {
    /// [`Rules::PLAIN`].
    fn default() -> Self {
        Self::PLAIN
    }
}

impl Rules {
    /// Relax sweeps of flat, frictionless contacts.
    pub const PLAIN: Self = Self {
        biased: false,
        friction: FrictionRule::None,
        patch: false,
        rolls: false,
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
    };

    /// The rules of a warm start, which needs only those of friction and inertia.
    pub fn of_warm_start(self) -> Self {
        let Self { friction, patch, rolls, isotropic, .. } = self;
        Self { friction, patch, rolls, isotropic, ..Self::default() }
    }

    /// The rules of restitution.
    pub fn of_restitution(self) -> Self {
        let Self { patch, round, from_start, isotropic, .. } = self;
        Self { patch, round, from_start, isotropic, ..Self::default() }
    }

    /// The rules of joints.
    pub fn of_joints(self) -> Self {
        let Self { biased, measured, from_start, axes, .. } = self;
        Self { biased, measured, from_start, axes, ..Self::default() }
    }

    /// Whether friction acts once for each manifold, at its patch.
    #[inline(always)]
    pub fn is_at_patch(self) -> bool {
        self.patch && !self.rolls
    }

    /// Number of contact points among the rows of a manifold. The patch does not count.
    #[inline(always)]
    pub fn contact_points(self, rows: usize) -> usize {
        if self.patch { rows - 1 } else { rows }
    }
}
