//! Every choice of the solver, in one plain struct: what `--set`, `--config` and the library all speak.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// How friction is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FrictionRule {
    /// No tangential impulse. Taken by itself where every contact of a scene has mu = 0.
    None,
    /// Tangential impulse inside the disc of radius mu times the normal impulse: Coulomb's cone, exactly.
    #[default]
    Disc,
}

/// Which sweeps of a substep solve friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FrictionSweeps {
    /// The biased sweeps and the relax sweeps.
    All,
    /// The relax sweeps only: the push-out of the biased sweep then drags nothing along.
    #[default]
    Relax,
}

/// Settings of one step of the solver. The defaults hold every standing scene of the catalogue.
///
/// ```
/// let mut config = drystone::SolverConfig::default();
/// config.set("substeps=8")?;
/// assert_eq!(config.substeps, 8);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverConfig {
    /// Substeps of one step, 1 or more. Errors fall with their square, time grows with them.
    pub substeps: u32,
    /// Biased sweeps a substep, 1 or more.
    pub iterations: u32,
    /// Sweeps without bias a substep, after the positions moved: they take out the velocity that the bias put in.
    pub relax: u32,
    /// Contact stiffness: frequency of the undamped contact spring times the substep length, so that it is 30 Hz for
    /// 4 substeps at 60 steps a second. More sinks less (as its square) and rattles more; 0.125 is quiet everywhere it
    /// was measured, 0.25 is the largest that is safe. Source: Catto, "Solver2D", 2024; the factor of Box2D 3.1.
    pub contact_frequency: f32,
    /// Damping ratio of the contact spring.
    pub contact_damping: f32,
    /// Frequency of contacts with fixed and kinematic bodies, relative to the others.
    pub fixed_contact_frequency_ratio: f32,
    /// Fastest that overlap is pushed out [m/s].
    pub push_limit: f32,
    /// Friction rule.
    pub friction: FrictionRule,
    /// Which sweeps solve friction.
    pub friction_sweeps: FrictionSweeps,
    /// Whether a step starts from the impulses of the step before.
    pub warm_start: bool,
    /// Approach slower than this does not bounce [m/s].
    pub restitution_threshold: f32,
    /// Whether free rotation of unequal moments of inertia is integrated (implicit midpoint).
    pub gyroscopic: bool,
    /// How far apart surfaces are when a contact is already made, relative to the smallest half extent of the thinner
    /// shape. The distance that the bodies approach in one step is added.
    pub speculative_margin: f32,
    /// A manifold is reused while its bodies moved relative to each other by less than this, relative to the smallest
    /// half extent of the thinner shape; 0 computes every manifold anew.
    pub recycle_distance: f32,
    /// Colors smaller than this are swept one after another in one workgroup instead of one dispatch each.
    pub fuse_colors_below: u32,
    /// Colors for contacts between bodies that can move, 1 to 64. A contact that finds none is solved sequentially
    /// and counted as overflow.
    pub max_colors: u32,
}

impl Default for SolverConfig {
    fn default() -> Self {
        Self {
            substeps: 8,
            iterations: 1,
            relax: 1,
            contact_frequency: 0.125,
            contact_damping: 10.0,
            fixed_contact_frequency_ratio: 2.0,
            push_limit: 3.0,
            friction: FrictionRule::Disc,
            friction_sweeps: FrictionSweeps::Relax,
            warm_start: true,
            restitution_threshold: 1.0,
            gyroscopic: true,
            speculative_margin: 0.04,
            recycle_distance: 0.02,
            fuse_colors_below: 256,
            max_colors: 64,
        }
    }
}

impl SolverConfig {
    /// Reads settings from a TOML file; what it leaves out takes its default.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, names an unknown setting or gives one an impossible value.
    pub fn from_toml_file(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
        let config: Self = toml::from_str(&text).map_err(|e| Error::input(one_line(&path.display(), &e)))?;
        config.check().map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
        Ok(config)
    }

    /// Changes one setting, written `key=value` as in TOML; bare words need no quotes.
    ///
    /// # Errors
    /// No `=`, an unknown key, or a value that does not fit.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment
            .split_once('=')
            .ok_or_else(|| Error::input(format!("--set {assignment}: write it as key=value")))?;
        let (key, value) = (key.trim(), value.trim());
        let mut table = toml::Table::try_from(&*self).expect("a config is a table");
        let parse = |text: &str| toml::from_str::<toml::Table>(&format!("value = {text}")).ok();
        let parsed = parse(value).or_else(|| parse(&format!("{value:?}"))).and_then(|mut t| t.remove("value"));
        let mut parsed = parsed.ok_or_else(|| Error::input(format!("--set {assignment}: cannot read the value")))?;
        // A whole number is a fine value for a real setting.
        if let (Some(toml::Value::Float(_)), toml::Value::Integer(i)) = (table.get(key), &parsed) {
            parsed = toml::Value::Float(*i as f64);
        }
        table.insert(key.to_owned(), parsed);
        let changed: Self = table
            .try_into()
            .map_err(|e: toml::de::Error| Error::input(format!("--set {assignment}: {}", first_line(&e))))?;
        changed.check().map_err(|e| Error::input(format!("--set {assignment}: {e}")))?;
        *self = changed;
        Ok(())
    }

    /// Refuses values that no step can be made of.
    ///
    /// # Errors
    /// One line that names the setting, its value and its range.
    pub fn check(&self) -> Result<()> {
        let refuse =
            |name: &str, value: f64, range: &str| Err(Error::input(format!("{name} = {value}: must be {range}")));
        for (name, value) in [("substeps", self.substeps), ("iterations", self.iterations)] {
            if value == 0 || value > 4096 {
                return refuse(name, value.into(), "1 to 4096");
            }
        }
        if self.relax > 4096 {
            return refuse("relax", self.relax.into(), "0 to 4096");
        }
        if !(1..=64).contains(&self.max_colors) {
            return refuse("max_colors", self.max_colors.into(), "1 to 64");
        }
        for (name, value, least, most) in [
            ("contact_frequency", self.contact_frequency, 1e-6, 0.5),
            ("contact_damping", self.contact_damping, 0.0, 1e6),
            ("fixed_contact_frequency_ratio", self.fixed_contact_frequency_ratio, 1e-3, 1e3),
            ("push_limit", self.push_limit, 0.0, 1e9),
            ("restitution_threshold", self.restitution_threshold, 0.0, 1e9),
            ("speculative_margin", self.speculative_margin, 0.0, 1e3),
            ("recycle_distance", self.recycle_distance, 0.0, 1e3),
        ] {
            if !(least..=most).contains(&value) {
                return refuse(name, value.into(), &format!("{least} to {most}"));
            }
        }
        Ok(())
    }
}

fn one_line(place: &dyn std::fmt::Display, e: &toml::de::Error) -> String {
    format!("{place}: {}", first_line(e))
}

/// The message of a TOML error without its drawing of the text.
fn first_line(e: &toml::de::Error) -> String {
    e.message().lines().collect::<Vec<_>>().join(" ")
}
