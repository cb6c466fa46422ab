//! Named settings. A preset promises figures, and tests/scenes/presets.rs checks them.

use crate::config::SolverConfig;
use crate::names::named;

/// A trade-off between error and time. Presets have the same rules with more or fewer substeps: in measurements,
/// substeps are the most efficient use of a sweep (docs/speed-vs-error.md).
///
/// ```
/// use drystone::preset::Preset;
///
/// let accurate: Preset = "accurate".parse().expect("one of four");
/// assert_eq!(accurate.config().substeps, 32);
/// assert!(accurate.promise().deepest < Preset::default().promise().deepest);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum Preset {
    /// 4 substeps: for games and previews.
    Fast,
    /// 8 substeps.
    #[default]
    Balanced,
    /// 32 substeps.
    Accurate,
    /// 128 substeps: for comparison with the others.
    Reference,
}

named!(Preset { Fast = "fast", Balanced = "balanced", Accurate = "accurate", Reference = "reference", });

/// The figures that a preset promises at 60 steps a second. Cubes have 1 m and 1000 kg, and the cubes of a tower are 1
/// cm off to alternating sides.
///
/// ```
/// use drystone::preset::{Preset, Promise};
///
/// let Promise { tower, deepest, .. } = Preset::Balanced.promise();
/// assert_eq!((tower, deepest), (400, 0.5e-3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Promise {
    /// Number of cubes in a tower that stands for 20 s.
    pub tower: u32,
    /// Density of the top cube of a tower of ten, relative to the others. The tower stands for 10 s.
    pub heavy_top: f32,
    /// Deepest overlap during 10 s of a tower of five (m). Its cubes begin to fall at 1 mm/s, so that there is no load
    /// before.
    pub deepest: f64,
    /// Overlap of that tower at the end of the 10 s (m).
    pub at_rest: f64,
}

impl Preset {
    /// The settings of the preset.
    pub fn config(self) -> SolverConfig {
        let substeps = match self {
            Self::Fast => 4,
            Self::Balanced => 8,
            Self::Accurate => 32,
            Self::Reference => 128,
        };
        SolverConfig { substeps, ..SolverConfig::default() }
    }

    /// The promised figures of the preset.
    pub fn promise(self) -> Promise {
        let promise = |tower, heavy_top, deepest, at_rest| Promise { tower, heavy_top, deepest, at_rest };
        match self {
            Self::Fast => promise(400, 1e6, 1.8e-3, 0.02e-3),
            Self::Balanced => promise(400, 1e6, 0.5e-3, 5e-6),
            Self::Accurate => promise(400, 1e6, 0.04e-3, 1e-6),
            Self::Reference => promise(400, 1e6, 0.003e-3, 0.1e-6),
        }
    }
}
