//! Every choice of the solver, in one plain struct. Feature `serde` reads and writes it.

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
    /// Substeps of one step, 1 or more: the least that an island takes. Errors fall with their square, time grows with them.
    pub substeps: u32,
    /// Most substeps that an island takes. Its contacts keep the promise of `max_penetration` and `max_penetration_share` by twice,
    /// four times, ... `substeps`, as few as do; `substeps` or less gives all islands the same. Accelerated sweeps, and sweeps that end
    /// by a tolerance, go over all islands together, which then take `substeps`.
    pub max_substeps: u32,
    /// Deepest that a contact sags under a lasting load before its preload lifts it (m); 0 leaves it to `max_penetration_share`.
    pub max_penetration: f32,
    /// The same, relative to the smallest half extent of the thinner shape; the lower one counts.
    pub max_penetration_share: f32,
    /// Biased sweeps a substep, 1 or more.
    pub iterations: u32,
    /// Sweeps without bias a substep, after the positions moved: they take out the velocity that the bias put in.
    pub relax: u32,
    /// How these sweeps follow each other.
    pub method: Method,
    /// How overlap is removed.
    pub stabilization: Stabilization,
    /// Share of the overlap that Baumgarte stabilization removes in a substep, 0 to 1.
    pub baumgarte: f32,
    /// Overlap that Baumgarte stabilization leaves alone (m).
    pub slop: f32,
    /// Every correction is multiplied by this: under-relaxed below 1, over-relaxed up to 2. 1 is safe everywhere.
    pub relaxation: f32,
    /// Sweeps of a substep end when no correction changes a relative velocity by more than this (m/s); 0 sweeps on.
    /// `iterations` and `relax` are then the most that are done.
    pub tolerance: f32,
    /// Contact stiffness: frequency of the undamped contact spring times the substep length, so that it is 60 Hz for
    /// 8 substeps at 60 steps a second. More sinks less (as its square) and rattles more. Measured with 8 substeps, rms speed
    /// at rest and mean overlap of a pyramid of 325 boxes without preload: 0.125 gives 0.02 mm/s and 0.51 mm, 0.1875 gives
    /// 0.02 mm/s and 0.23 mm, 0.25 gives 52 mm/s; but 1 under 1000 already rattles at 0.1875. Source: Catto, "Solver2D", 2024;
    /// the factor of Box2D 3.1.
    pub contact_frequency: f32,
    /// Damping ratio of the contact spring.
    pub contact_damping: f32,
    /// Frequency of contacts with fixed and kinematic bodies, relative to the others.
    pub fixed_contact_frequency_ratio: f32,
    /// How fast the overlap of soft contacts at rest is taken out, as a rate (1/s): a contact that bears a load is preloaded by
    /// the overlap that the load would make. 0 leaves it there. Measured with 8 substeps, deepest overlap of a wall of 400 bricks:
    /// 2.57 mm without, 0.11 mm with, at the same speed at rest and drift.
    pub preload_rate: f32,
    /// Fastest that overlap is pushed out (m/s).
    pub push_limit: f32,
    /// Friction rule.
    pub friction: Friction,
    /// Where friction acts.
    pub friction_at: FrictionAt,
    /// Which sweeps solve friction.
    pub friction_sweeps: FrictionSweeps,
    /// Largest gap of a joint, relative to its arms. Nets that sweeps would leave further apart take more substeps, and so do joints whose arms turn
    /// fast.
    pub max_joint_gap_share: f32,
    /// How joints are solved. `auto` solves all joints of a connected set of bodies at once where that costs time in proportion to their number, as
    /// in chains, trees and single loops. It sweeps nets. Motors and springs are swept all the same. Measured with 8 substeps, a chain of 100 links
    /// with 1000 times the mass of a link at its end: gap 0.22 of a link with sweeps, 6e-5 at once.
    pub joint_solver: JointSolver,
    /// Joint stiffness: frequency of the undamped joint spring times the substep length.
    pub joint_frequency: f32,
    /// Damping ratio of the joint spring.
    pub joint_damping: f32,
    /// Whether a step starts from the impulses of the step before.
    pub warm_start: bool,
    /// Approach slower than this does not bounce (m/s).
    pub restitution_threshold: f32,
    /// Whether free rotation of unequal moments of inertia is integrated (implicit midpoint).
    pub gyroscopic: bool,
    /// How far apart surfaces are when a contact is already made, relative to the smallest half extent of the thinner
    /// shape. The distance that the bodies approach in one step is added, up to twice that half extent; before a half-space, all of it.
    /// Bodies that approach further, or pass beside each other, have the contact of the place where their ways meet, and none where the ways do not.
    pub speculative_margin: f32,
    /// A manifold is reused while its bodies moved relative to each other by less than this, relative to the smallest
    /// half extent of the thinner shape; 0 computes every manifold anew.
    pub recycle_distance: f32,
    /// Bodies that touch or are joined fall asleep together once all of them were slower than `sleep_speed` for this long (s);
    /// 0 lets nothing sleep. Asleep they cost next to nothing and stay to the last bit, until something disturbs them.
    pub sleep_after: f32,
    /// Speed of the fastest point of a body under which it is slow (m/s). A pile of 5,000 falls asleep 7 s after it came to rest,
    /// with a mean overlap of 0.166 mm where it has 0.161 awake; at 5 mm/s a few that rattle keep it awake.
    pub sleep_speed: f32,
    /// Colors smaller than this are swept one after another in one workgroup instead of one dispatch each.
    pub fuse_colors_below: u32,
    /// Colors for contacts between bodies that can move, 1 to 64. A contact that finds none is solved sequentially
    /// and counted as overflow.
    pub max_colors: u32,
    /// Rules that exist for comparison.
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

/// Colors smaller than this share a workgroup, unless told otherwise.
pub const FUSE_BELOW: u32 = 256;

/// Shortest step (s). Shorter ones move nothing that single precision can tell from rest.
pub const SHORTEST_STEP: f32 = 1e-9;
/// Longest step (s).
pub const LONGEST_STEP: f32 = 1.0;

/// Refuses a length of a step that no step can be made of: less than [`SHORTEST_STEP`], more than [`LONGEST_STEP`], or no number.
///
/// # Errors
/// One line with the length and the range.
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
    /// These settings with some changed. Settings grow with versions, so that a program changes them instead of listing them.
    ///
    /// ```
    /// let config = drystone::SolverConfig::default().with(|c| c.substeps = 32);
    /// assert_eq!(config.substeps, 32);
    /// ```
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// The same settings, but nothing falls asleep: for whatever is measured or compared.
    ///
    /// ```
    /// assert_eq!(drystone::SolverConfig::default().without_sleep().sleep_after, 0.0);
    /// ```
    pub fn without_sleep(self) -> Self {
        Self { sleep_after: 0.0, ..self }
    }

    /// Deepest that a contact may sag under a lasting load (m); `size` is the smallest half extent of the thinner shape (m).
    pub fn promised_sag(&self, size: f32) -> f32 {
        let share = self.max_penetration_share * size;
        if self.max_penetration > 0.0 { share.min(self.max_penetration) } else { share }
    }

    /// The friction rule that these settings come to.
    pub fn friction_rule(&self) -> FrictionRule {
        match self.friction {
            Friction::None => FrictionRule::None,
            _ if self.rules.slip_friction => FrictionRule::Slip,
            Friction::Box => FrictionRule::Box,
            Friction::Disc => FrictionRule::Disc,
        }
    }

    /// Refuses values that no step can be made of, and settings that contradict each other.
    ///
    /// # Errors
    /// One line that names the settings, their values and what to do.
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

    /// Refuses values out of their range, one by one, whether or not they contradict each other.
    ///
    /// # Errors
    /// One line that names the setting, its value and the range.
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
