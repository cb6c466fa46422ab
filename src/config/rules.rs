//! Values of settings, and rules for comparison.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::names::named;
use crate::saved::{fields, kinds};

/// The friction rule of a setting.
///
/// ```
/// use drystone::{SolverConfig, config::Friction};
///
/// assert_eq!(SolverConfig::default().friction, Friction::Disc);
/// let smooth = SolverConfig::default().with(|c| c.friction = Friction::None);
/// assert!(smooth.check().is_ok());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum Friction {
    /// No tangential impulse.
    None,
    /// Two orthogonal directions, each with its own limit: up to 41 % too strong between them.
    Box,
    /// The tangential impulse stays inside the disc of radius mu times the normal impulse: Coulomb's cone, exactly.
    #[default]
    Disc,
}

kinds!(Friction { None, Box, Disc });

/// The friction rule that a kernel applies: one of [`Friction`], or the rule for comparison
/// [`ComparisonRules::slip_friction`].
///
/// ```
/// use drystone::{SolverConfig, config::FrictionRule};
///
/// assert_eq!(SolverConfig::default().friction_rule(), FrictionRule::Disc);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FrictionRule {
    /// [`Friction::None`], also where every contact of a scene has mu = 0.
    None,
    /// [`ComparisonRules::slip_friction`].
    Slip,
    /// [`Friction::Box`].
    Box,
    /// [`Friction::Disc`].
    #[default]
    Disc,
}

/// Where friction acts.
///
/// ```
/// use drystone::{SolverConfig, config::FrictionAt};
///
/// let config = SolverConfig::default().with(|c| c.friction_at = FrictionAt::Manifold);
/// assert!(config.check().is_ok() && config != SolverConfig::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum FrictionAt {
    /// At every contact point, limited by that point's normal impulse.
    #[default]
    Points,
    /// Once per manifold: at the middle of its points, and as a torque about the normal. The limit is the sum of its
    /// normal impulses. Cheaper.
    Manifold,
}

kinds!(FrictionAt { Points, Manifold });

/// Order of normals and friction within a manifold.
///
/// In the standing scenes, both orders agree in overlap and speed at rest to a few percent. Towers drift a little less
/// with normals first (zigzag of 20: 33 mm instead of 38 mm in 10 s), and walls with friction first (3.4 mm instead of
/// 5.7 mm).
///
/// ```
/// use drystone::{SolverConfig, config::FrictionOrder};
///
/// let config = SolverConfig::default().with(|c| c.rules.friction_order = FrictionOrder::FrictionFirst);
/// assert!(config.check().is_ok());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum FrictionOrder {
    /// Normals, then friction within the cone that they span: the order of the course sheet.
    #[default]
    NormalsFirst,
    /// Friction within the cone of the sweep before, then normals.
    FrictionFirst,
}

kinds!(FrictionOrder { NormalsFirst, FrictionFirst });

/// The impulse that is kept non-negative.
///
/// ```
/// use drystone::{SolverConfig, config::Clamping};
///
/// // Soft contacts need their sums.
/// let config = SolverConfig::default().with(|c| c.rules.clamping = Clamping::PerCorrection);
/// assert!(config.check().is_err());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum Clamping {
    /// Every single correction. Impulses start at zero in each substep, and no later correction can reduce an earlier
    /// one that was too large: misaligned stacks fall.
    PerCorrection,
    /// The sum of all corrections.
    #[default]
    Accumulated,
}

kinds!(Clamping { PerCorrection, Accumulated });

/// How the solver removes overlap.
///
/// ```
/// use drystone::{SolverConfig, config::Stabilization};
///
/// let config = SolverConfig::default().with(|c| (c.stabilization, c.relax) = (Stabilization::Baumgarte, 0));
/// assert!(config.check().is_ok() && config.with(|c| c.relax = 1).check().is_err());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum Stabilization {
    /// Not at all: overlap grows.
    None,
    /// By a target velocity that removes a share of the overlap in each substep (Baumgarte), above a slop and up to a
    /// speed limit.
    Baumgarte,
    /// By a damped spring, integrated implicitly; relax sweeps remove the velocity of the spring.
    #[default]
    Soft,
}

kinds!(Stabilization { None, Baumgarte, Soft });

named!(Stabilization { None = "none", Baumgarte = "baumgarte", Soft = "soft", });

/// How joints are solved.
///
/// ```
/// use drystone::{SolverConfig, config::JointSolver};
///
/// let swept = SolverConfig::default().with(|c| c.joint_solver = JointSolver::Sweeps);
/// assert!(swept.check().is_ok() && SolverConfig::default().joint_solver == JointSolver::Auto);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum JointSolver {
    /// At once if the factors stay sparse, else by sweeps.
    #[default]
    Auto,
    /// One after another, like contacts.
    Sweeps,
    /// All joints of a connected set of bodies at once, at any cost; motors and springs by sweeps.
    Direct,
}

kinds!(JointSolver { Auto, Sweeps, Direct });

named!(JointSolver { Auto = "auto", Sweeps = "sweeps", Direct = "direct", });

/// Which sweeps of a substep solve friction.
///
/// ```
/// use drystone::{SolverConfig, config::FrictionSweeps};
///
/// let all = SolverConfig::default().with(|c| c.friction_sweeps = FrictionSweeps::All);
/// assert!(all.check().is_ok() && SolverConfig::default().friction_sweeps == FrictionSweeps::Relax);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum FrictionSweeps {
    /// The biased sweeps and the relax sweeps.
    All,
    /// The relax sweeps only. The push-out of the biased sweeps then drags no body along.
    #[default]
    Relax,
}

kinds!(FrictionSweeps { All, Relax });

/// How the sweeps of a substep follow each other.
///
/// ```
/// use drystone::{SolverConfig, config::Method};
///
/// let config = SolverConfig::default().with(|c| (c.method, c.iterations) = (Method::Accelerated, 8));
/// assert!(config.check().is_ok());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub enum Method {
    /// One after another: projected Gauss-Seidel.
    #[default]
    Plain,
    /// With Nesterov's momentum, and a restart as soon as steps grow. The first two sweeps are plain, so at least three
    /// sweeps are needed for a gain.
    Accelerated,
}

kinds!(Method { Plain, Accelerated });

named!(Method { Plain = "plain", Accelerated = "accelerated", });

/// Rules for comparison with the literature (docs/rules.md). No scene needs a value other than the default.
///
/// ```
/// use drystone::{SolverConfig, config::{Clamping, ComparisonRules}};
///
/// assert_eq!(ComparisonRules::default().clamping, Clamping::Accumulated);
/// let twice = SolverConfig::default().with(|c| c.rules.manifold_passes = 2);
/// assert!(twice.check().is_ok());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields, default))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub struct ComparisonRules {
    /// Order of normals and friction within a manifold.
    pub friction_order: FrictionOrder,
    /// Whether friction at a point acts in one direction only, that of its slip at the start of the step; a body at
    /// rest then creeps. It replaces the rules box and disc.
    pub slip_friction: bool,
    /// Impulse that is kept non-negative: the sum of the corrections, or each correction.
    pub clamping: Clamping,
    /// Number of times that a sweep visits a manifold before the next manifold, 1 to 16. With 2, fewer but longer
    /// sweeps are needed.
    pub manifold_passes: u8,
}

fields!(ComparisonRules { friction_order, slip_friction, clamping, manifold_passes });

impl Default for ComparisonRules {
    fn default() -> Self {
        Self {
            friction_order: FrictionOrder::NormalsFirst,
            slip_friction: false,
            clamping: Clamping::Accumulated,
            manifold_passes: 1,
        }
    }
}
