//! All settings of the solver in one plain struct. The feature `serde` reads and writes it.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::error::{Result, ensure};

mod rules;

pub use rules::{
    Clamping, ComparisonRules, Friction, FrictionAt, FrictionOrder, FrictionRule, FrictionSweeps, JointSolver, Method,
    Stabilization,
};

/// Settings of one step of the solver. The defaults hold every standing scene of the catalogue.
///
/// ```
/// use drystone::SolverConfig;
///
/// let config = SolverConfig::default().with(|c| c.substeps = 32);
/// config.check()?;
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// ```
/// use drystone::SolverConfig;
/// use drystone::config::{Friction, FrictionRule, Method, check_step_length};
///
/// let config = SolverConfig::default().with(|c| (c.friction, c.method) = (Friction::Box, Method::Accelerated));
/// assert_eq!(config.friction_rule(), FrictionRule::Box);
/// // A contact of a cube of 1 m sags by 7.5 mm at most.
/// assert!((config.promised_sag(0.5) - 0.0075).abs() < 1e-6);
/// let wrong = config.with(|c| c.substeps = 0);
/// assert_eq!(wrong.check_ranges().expect_err("no substeps").to_string(), "substeps = 0: must be 1 to 4096");
/// assert!(check_step_length(1.0 / 60.0).is_ok() && check_step_length(0.0).is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields, default))]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[non_exhaustive]
pub struct SolverConfig {
    /// Substeps of one step, 1 or more: the smallest number that an island takes. Errors fall with the square of this
    /// number, and time grows with it.
    pub substeps: u32,
    /// Largest number of substeps that an island takes. An island takes `substeps`, twice, four times, ... that number:
    /// the fewest that keep its contacts within `max_penetration` and `max_penetration_share`. If this is `substeps` or
    /// less, all islands take the same number. Accelerated sweeps, and sweeps that end by a tolerance, process all
    /// islands together, and all islands then take `substeps`.
    pub max_substeps: u32,
    /// Deepest overlap of a contact under a lasting load, before its preload lifts it (m); 0 leaves the limit to
    /// `max_penetration_share`.
    pub max_penetration: f32,
    /// The same limit, relative to the smallest half extent of the thinner shape; the lower limit counts.
    pub max_penetration_share: f32,
    /// Biased sweeps in a substep, 1 or more.
    pub iterations: u32,
    /// Sweeps without bias in a substep, after the positions have moved. They remove the velocity that the bias added.
    pub relax: u32,
    /// How the sweeps of a substep follow each other.
    pub method: Method,
    /// How overlap is removed.
    pub stabilization: Stabilization,
    /// Share of the overlap that Baumgarte stabilization removes in a substep, 0 to 1.
    pub baumgarte: f32,
    /// Overlap that Baumgarte stabilization does not remove (m).
    pub slop: f32,
    /// Factor on every correction: under-relaxation below 1, over-relaxation up to 2. 1 is safe everywhere.
    pub relaxation: f32,
    /// The sweeps of a substep end when no correction changes a relative velocity by more than this (m/s); 0 never ends
    /// them early. `iterations` and `relax` are then the largest numbers of sweeps.
    pub tolerance: f32,
    /// Contact stiffness: the frequency of the undamped contact spring times the substep length. The default 0.125 is
    /// 60 Hz with 8 substeps at 60 steps a second. A higher value reduces the overlap (as its square), but bodies
    /// rattle more. Measured with 8 substeps on a pyramid of 325 boxes without preload, rms speed at rest and mean
    /// overlap: 0.125 gives 0.02 mm/s and 0.51 mm, 0.1875 gives 0.02 mm/s and 0.23 mm, 0.25 gives 52 mm/s. A box under
    /// 1000 times its mass already rattles at 0.1875. Source: Catto, "Solver2D", 2024; the factor of Box2D 3.1.
    pub contact_frequency: f32,
    /// Damping ratio of the contact spring.
    pub contact_damping: f32,
    /// Frequency of the springs of contacts with fixed and kinematic bodies, relative to that of other contacts.
    pub fixed_contact_frequency_ratio: f32,
    /// Rate at which the overlap of soft contacts at rest is removed (1/s); 0 leaves the overlap. The preload of a
    /// loaded contact is the overlap that the load would cause. Measured with 8 substeps, deepest overlap of a wall of
    /// 400 bricks: 2.57 mm without and 0.11 mm with preload, at the same speed at rest and the same drift.
    pub preload_rate: f32,
    /// Largest speed at which overlap is pushed out (m/s).
    pub push_limit: f32,
    /// Friction rule.
    pub friction: Friction,
    /// Where friction acts.
    pub friction_at: FrictionAt,
    /// Which sweeps solve friction.
    pub friction_sweeps: FrictionSweeps,
    /// Largest gap of a joint, relative to its arms, and largest angle that it may be off (rad). A step that opens a joint
    /// further is taken again with more substeps. If sweeps would leave a larger gap in a net, the net takes more
    /// substeps.
    pub max_joint_gap_share: f32,
    /// How joints are solved. `auto` solves all joints of a connected set of bodies at once if that takes time in
    /// proportion to their number, as in chains, trees and single loops. It sweeps nets. Motors and springs are always
    /// swept. Measured with 8 substeps on a chain of 100 links with 1000 times the mass of a link at its end: the gap
    /// is 0.22 of a link with sweeps, and 5e-5 of a link at once.
    pub joint_solver: JointSolver,
    /// Joint stiffness: frequency of the undamped joint spring times the substep length.
    pub joint_frequency: f32,
    /// Damping ratio of the joint spring.
    pub joint_damping: f32,
    /// Whether a step starts from the impulses of the step before.
    pub warm_start: bool,
    /// Approach speed below which bodies do not bounce (m/s).
    pub restitution_threshold: f32,
    /// Whether the gyroscopic torque of unequal moments of inertia is integrated (implicit midpoint).
    pub gyroscopic: bool,
    /// Distance of two surfaces at which they already have a contact, relative to the smallest half extent of the
    /// thinner shape. The distance that the bodies approach in one step is added: up to twice that half extent, or all
    /// of it before a half-space. Bodies that approach further, or pass beside each other, get the contact at the place
    /// where their paths meet, and no contact if the paths do not meet.
    pub speculative_margin: f32,
    /// Relative displacement of two bodies below which their manifold is reused, relative to the smallest half extent
    /// of the thinner shape; 0 computes every manifold anew.
    pub recycle_distance: f32,
    /// Time for which bodies that touch or are joined have to be slower than `sleep_speed` before they fall asleep
    /// together (s); 0 lets no body sleep. Sleeping bodies cost next to nothing and keep every bit of their state until
    /// something disturbs them.
    pub sleep_after: f32,
    /// Speed of the fastest point of a body below which the body is slow (m/s). A pile of 5,000 falls asleep 7 s after
    /// it came to rest, with a mean overlap of 0.166 mm instead of 0.161 mm awake. At 5 mm/s a few rattling bodies keep
    /// it awake.
    pub sleep_speed: f32,
    /// Colors with fewer constraints than this are swept one after another in one workgroup, instead of one dispatch
    /// each.
    pub fuse_colors_below: u32,
    /// Colors for contacts between movable bodies, 1 to 64. A contact without a color is solved sequentially and
    /// counted as overflow.
    pub max_colors: u32,
    /// Rules for comparison.
    pub rules: ComparisonRules,
}

crate::saved::fields!(SolverConfig {
    substeps,
    max_substeps,
    max_penetration,
    max_penetration_share,
    iterations,
    relax,
    method,
    stabilization,
    baumgarte,
    slop,
    relaxation,
    tolerance,
    contact_frequency,
    contact_damping,
    fixed_contact_frequency_ratio,
    preload_rate,
    push_limit,
    friction,
    friction_at,
    friction_sweeps,
    max_joint_gap_share,
    joint_solver,
    joint_frequency,
    joint_damping,
    warm_start,
    restitution_threshold,
    gyroscopic,
    speculative_margin,
    recycle_distance,
    sleep_after,
    sleep_speed,
    fuse_colors_below,
    max_colors,
    rules,
});

/// Default of [`SolverConfig::fuse_colors_below`].
pub(crate) const FUSE_BELOW: u32 = 256;

/// Shortest step (s). In a shorter step, no motion can be distinguished from rest in single precision.
pub const SHORTEST_STEP: f32 = 1e-9;
/// Longest step (s).
pub const LONGEST_STEP: f32 = 1.0;

/// Refuses a step length outside of [`SHORTEST_STEP`] to [`LONGEST_STEP`], or NaN.
///
/// # Errors
/// One line has the length and the range.
pub fn check_step_length(dt: f32) -> Result<()> {
    let message = || format!("dt = {dt}: must be {SHORTEST_STEP:e} to {LONGEST_STEP} seconds");
    ensure((SHORTEST_STEP..=LONGEST_STEP).contains(&dt), message)
}

impl Default for SolverConfig {
    fn default() -> Self {
        Self {
            substeps: 8,
            max_substeps: 1024,
            max_penetration: 0.0,
            max_penetration_share: 0.015,
            iterations: 1,
            relax: 1,
            method: Method::Plain,
            stabilization: Stabilization::Soft,
            baumgarte: 0.2,
            slop: 0.001,
            relaxation: 1.0,
            tolerance: 0.0,
            contact_frequency: 0.125,
            contact_damping: 10.0,
            fixed_contact_frequency_ratio: 2.0,
            preload_rate: 1.0,
            push_limit: 3.0,
            friction: Friction::Disc,
            friction_at: FrictionAt::Points,
            friction_sweeps: FrictionSweeps::Relax,
            max_joint_gap_share: 2.5e-3,
            joint_solver: JointSolver::Auto,
            joint_frequency: 0.25,
            joint_damping: 2.0,
            warm_start: true,
            restitution_threshold: 1.0,
            gyroscopic: true,
            speculative_margin: 0.04,
            recycle_distance: 0.02,
            sleep_after: 0.5,
            sleep_speed: 1e-2,
            fuse_colors_below: FUSE_BELOW,
            max_colors: 64,
            rules: ComparisonRules::default(),
        }
    }
}

impl SolverConfig {
    /// These settings with some changes. A later version can have more settings, so a program changes single settings
    /// and does not list all.
    ///
    /// ```
    /// let config = drystone::SolverConfig::default().with(|c| c.substeps = 32);
    /// assert_eq!(config.substeps, 32);
    /// ```
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// The same settings without sleep, for measurements and comparisons.
    ///
    /// ```
    /// assert_eq!(drystone::SolverConfig::default().without_sleep().sleep_after, 0.0);
    /// ```
    pub fn without_sleep(self) -> Self {
        Self { sleep_after: 0.0, ..self }
    }

    /// Deepest overlap that a contact may have under a lasting load (m). `size` is the smallest half extent of the
    /// thinner shape (m).
    pub fn promised_sag(&self, size: f32) -> f32 {
        let share = self.max_penetration_share * size;
        if self.max_penetration > 0.0 { share.min(self.max_penetration) } else { share }
    }

    /// The friction rule that these settings select.
    pub fn friction_rule(&self) -> FrictionRule {
        match self.friction {
            Friction::None => FrictionRule::None,
            _ if self.rules.slip_friction => FrictionRule::Slip,
            Friction::Box => FrictionRule::Box,
            Friction::Disc => FrictionRule::Disc,
        }
    }

    /// Refuses values that no step can use, and settings that contradict each other.
    ///
    /// # Errors
    /// One line names the settings, their values and a remedy.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let (rule, relax) = (self.stabilization, self.relax);
        ensure(rule == Stabilization::Soft || relax == 0, || {
            format!("stabilization = {rule} with relax = {relax}: relax sweeps belong to soft contacts; set relax=0")
        })?;
        if self.rules.clamping == Clamping::PerCorrection {
            let refused = |why: &str| format!("rules.clamping = per-correction with {why}");
            ensure(rule != Stabilization::Soft, || {
                refused(
                    "stabilization = soft: a soft contact acts on the accumulated impulse; set stabilization=baumgarte or none",
                )
            })?;
            ensure(self.method == Method::Plain, || {
                refused("method = accelerated: momentum acts on accumulated impulses; set method=plain")
            })?;
        }
        Ok(())
    }

    /// Refuses values out of their ranges, even if the settings contradict each other.
    ///
    /// # Errors
    /// One line names the setting, its value and the range.
    pub fn check_ranges(&self) -> Result<()> {
        let tolerance = self.tolerance;
        ensure(!(tolerance > 0.0 && self.iterations == 0), || {
            format!("tolerance = {tolerance} with iterations = 0: no sweep would be tested")
        })?;
        for (name, value, least, most) in [
            ("substeps", self.substeps, 1, 4096),
            ("max_substeps", self.max_substeps, 1, 4096),
            ("iterations", self.iterations, 1, 4096),
            ("relax", self.relax, 0, 4096),
            ("rules.manifold_passes", self.rules.manifold_passes.into(), 1, 16),
            ("max_colors", self.max_colors, 1, 64),
        ] {
            ensure((least..=most).contains(&value), || format!("{name} = {value}: must be {least} to {most}"))?;
        }
        for (name, value, least, most) in [
            ("max_penetration", self.max_penetration, 0.0, 1e3),
            ("max_penetration_share", self.max_penetration_share, 1e-6, 1e3),
            ("max_joint_gap_share", self.max_joint_gap_share, 1e-9, 1e3),
            ("baumgarte", self.baumgarte, 0.0, 1.0),
            ("slop", self.slop, 0.0, 1e3),
            ("relaxation", self.relaxation, 1e-3, 2.0),
            ("tolerance", self.tolerance, 0.0, 1e3),
            ("joint_frequency", self.joint_frequency, 1e-6, 0.5),
            ("joint_damping", self.joint_damping, 0.0, 1e6),
            ("contact_frequency", self.contact_frequency, 1e-6, 0.5),
            ("contact_damping", self.contact_damping, 0.0, 1e6),
            ("fixed_contact_frequency_ratio", self.fixed_contact_frequency_ratio, 1e-3, 1e3),
            ("preload_rate", self.preload_rate, 0.0, 1e3),
            ("push_limit", self.push_limit, 0.0, 1e9),
            ("restitution_threshold", self.restitution_threshold, 0.0, 1e9),
            ("speculative_margin", self.speculative_margin, 0.0, 1e3),
            ("sleep_after", self.sleep_after, 0.0, 1e6),
            ("sleep_speed", self.sleep_speed, 0.0, 1e3),
            ("recycle_distance", self.recycle_distance, 0.0, 1e3),
        ] {
            ensure((least..=most).contains(&value), || format!("{name} = {value}: must be {least} to {most}"))?;
        }
        Ok(())
    }
}
