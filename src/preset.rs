//! Settings by name. A preset is a promise with numbers, which tests/scenes/presets.rs keeps.

use crate::config::SolverConfig;
use crate::names::named;

/// How much error is paid for with time: the same rules with more or fewer substeps, which measures best of all ways to spend
/// a sweep (docs/speed-vs-error.md).
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
    /// 128 substeps: to hold the others against.
    Reference,
}

named!(Preset { Fast = "fast", Balanced = "balanced", Accurate = "accurate", Reference = "reference", });

/// The figures that a preset holds at 60 steps a second. Cubes are of 1 m and 1000 kg, towers lean by 1 cm to one side and the other in turn.
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
    /// Cubes of a tower that stands for 20 s.
    pub tower: u32,
    /// Density of the top cube of a tower of ten, relative to the others, which stands for 10 s.
    pub heavy_top: f32,
    /// Deepest overlap at any time of 10 s of a tower of five whose cubes begin to fall at 1 mm/s, so that no load is there before (m).
    pub deepest: f64,
    /// The same at the end of them (m).
    pub at_rest: f64,
}

impl Preset {
    /// The settings.
    pub fn config(self) -> SolverConfig {
        let substeps = match self {
            Self::Fast => 4,
            Self::Balanced => 8,
            Self::Accurate => 32,
            Self::Reference => 128,
        };
        SolverConfig { substeps, ..SolverConfig::default() }
    }

    /// The figures that it holds.
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
