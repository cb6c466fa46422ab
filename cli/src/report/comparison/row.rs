//! The measurements of a contender on a scene.

use serde::{Deserialize, Serialize};

use super::contender::Setting;
use drystone::metrics::Penetration;
use drystone::{Error, Result};

/// Steps of a contender in one turn.
pub(super) const BLOCK: u32 = 10;

/// Time and errors of one contender on one scene, over the second half of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub scene: String,
    pub hash: String,
    /// Start of the run. Time ratios exist only between rows of one run.
    pub run: String,
    /// This field and the next two are as in [`Origin`](super::Origin).
    pub build: String,
    pub commit: String,
    pub machine: String,
    pub threads: usize,
    pub bodies: usize,
    pub steps: u32,
    /// This field and the next six are as in [`Setting`]; CSV has no nested fields.
    pub engine: String,
    pub backend: String,
    pub substeps: u32,
    pub sweeps: u32,
    pub method: String,
    pub friction: String,
    pub more: String,
    /// `processor` or `wall` time, as in [`Clock`](crate::report::rounds::Clock).
    pub clock: String,
    /// Time of a step: median and quartiles over the blocks (ms).
    pub ms: f64,
    pub ms_low: f64,
    pub ms_high: f64,
    /// Time ratio to the first contender in the same blocks: median and quartiles.
    pub ratio: f64,
    pub ratio_low: f64,
    pub ratio_high: f64,
    /// Deepest overlap, 95th percentile and mean (m): the largest deepest overlap over the blocks, and medians of the
    /// others.
    pub penetration_max: f64,
    pub penetration_p95: f64,
    pub penetration_mean: f64,
    /// Root mean square speed (m/s), median over the blocks. In each block it is the smaller of two speeds: that of the
    /// velocities that the engine reports, and that of the motion in the last step. Poses in f32 resolve no less than
    /// 0.03 mm/s. The velocities of PhysX's TGS differ from the motion: 67 mm/s in a pyramid whose boxes move at 0.6
    /// mm/s.
    pub speed_rms: f64,
    /// Largest horizontal distance of a body from its initial position, at the end (m).
    pub drift: f64,
    /// Number of bodies in place at the end; `None` if the scene does not stand.
    pub in_place: Option<usize>,
    /// Largest distance between the anchors of a joint (m); `None` without joints.
    pub joint_gap: Option<f64>,
    /// Kinetic and potential energy gained over the whole run (J).
    pub energy_gained: f64,
    pub finite: bool,
    /// The thirds of the run that the contender finished; empty in rows that were read from a file.
    #[serde(skip)]
    pub windows: Vec<WindowRow>,
}

impl Row {
    pub fn setting(&self) -> Setting {
        let Self { engine, backend, substeps, sweeps, method, friction, more, .. } = self.clone();
        Setting { engine, backend, substeps, sweeps, method, friction, more }
    }

    pub fn time_ratio(&self, other: &Self) -> Result<f64> {
        for (what, own, others) in [
            ("run", &self.run, &other.run),
            ("scene hash", &self.hash, &other.hash),
            ("machine", &self.machine, &other.machine),
        ] {
            if own != others {
                let names = [self, other].map(|row| format!("{} on {}", row.setting().label(), row.scene));
                return Err(Error::input(format!(
                    "cannot compare {} with {}: {what} {own} and {others} differ",
                    names[0], names[1]
                )));
            }
        }
        Ok(self.ratio / other.ratio)
    }

    /// The errors that are equal on every machine.
    fn errors(&self) -> [(&'static str, f64); 7] {
        [
            ("deepest overlap", self.penetration_max),
            ("95 % overlap", self.penetration_p95),
            ("mean overlap", self.penetration_mean),
            ("speed", self.speed_rms),
            ("drift", self.drift),
            ("gap of joints", self.joint_gap.unwrap_or(0.0)),
            ("energy gained", self.energy_gained),
        ]
    }

    /// The difference of an error from that of the first row with the same setting, for the same scene; `None` if all
    /// errors are equal.
    pub(super) fn differs_from(&self, rows: &[Self]) -> Option<String> {
        let first = rows.iter().find(|row| row.setting() == self.setting())?;
        let mut pairs = self.errors().into_iter().zip(first.errors());
        let ((what, own), (_, other)) = pairs.find(|((_, own), (_, other))| own.to_bits() != other.to_bits())?;
        let (scene, setting) = (&self.scene, self.setting().label());
        Some(format!("{scene}, {setting}: {what} {own:e} on {}, and {other:e} on {}", self.machine, first.machine))
    }

    /// Whether all bodies of a standing scene are in place, and all numbers are finite.
    pub fn holds(&self) -> bool {
        self.finite && self.in_place.is_none_or(|n| n == self.bodies)
    }
}

/// Times of one contender in one third of a run, and errors at its end. CSV has no nested fields, so each row names its
/// run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WindowRow {
    pub scene: String,
    /// This field and the next five are as in [`Row`].
    pub hash: String,
    pub run: String,
    pub commit: String,
    pub machine: String,
    pub threads: usize,
    pub bodies: usize,
    pub engine: String,
    pub setting: String,
    pub clock: String,
    /// The first and the last step of the third, counted from 1.
    pub from: usize,
    pub to: usize,
    /// Time of a step: median and largest, without the first step of the run (ms).
    pub ms: f64,
    pub ms_worst: f64,
    /// Time of the first step of the run (ms).
    pub ms_first: f64,
    /// Time relative to the fastest contender of another engine: the median over the blocks of the third. `None`
    /// without another engine.
    pub to_best: Option<f64>,
    /// Overlaps (m), speed (m/s), distance from the initial positions (m) and bodies in place at the end of the third,
    /// as in [`Row`].
    pub penetration_max: f64,
    pub penetration_mean: f64,
    pub speed_rms: f64,
    pub drift: f64,
    pub in_place: Option<usize>,
}

/// Measurements of one contender.
#[derive(Default)]
pub(super) struct Lane {
    /// Time of each step (ms), for complete blocks with finite bodies.
    pub steps: Vec<f64>,
    /// Errors with the index of their block: at the end of each block of the second half, and of the last block of each
    /// third.
    pub errors: Vec<(usize, Errors)>,
    pub finite: bool,
}

#[derive(Default)]
pub(super) struct Errors {
    pub penetration: Penetration,
    pub speed: f64,
    pub drift: f64,
    pub in_place: Option<usize>,
    pub gap: f64,
}
