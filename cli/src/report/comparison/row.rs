//! The measurements of a contender on a scene.

use serde::{Deserialize, Serialize};

use super::contender::Setting;
use drystone::metrics::Penetration;
use drystone::{Error, Result};

/// Steps of a contender in each of its turns.
pub(super) const BLOCK: u32 = 10;

/// Time and errors of one contender on one scene, over the second half of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub scene: String,
    pub hash: String,
    /// Start of the run; only rows of one run have time ratios.
    pub run: String,
    /// As in [`Origin`](super::Origin).
    pub build: String,
    pub commit: String,
    pub machine: String,
    pub threads: usize,
    pub bodies: usize,
    pub steps: u32,
    /// As in [`Setting`]; CSV has no nested fields.
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
    /// Ratio to the first contender in the same blocks: median and quartiles.
    pub ratio: f64,
    pub ratio_low: f64,
    pub ratio_high: f64,
    /// Deepest overlap, the overlap that 95 % of the contacts do not exceed, and the mean: medians over the blocks, but for the first (m).
    pub penetration_max: f64,
    pub penetration_p95: f64,
    pub penetration_mean: f64,
    /// Root mean square speed, median over the blocks (m/s): of the velocities that the engine reports, or of the motion in the last step
    /// of a block, whichever is less. Poses in f32 resolve no less than 0.03 mm/s, and velocities of PhysX's TGS are not those at
    /// which bodies move: 67 mm/s in a pyramid whose boxes move at 0.6 mm/s.
    pub speed_rms: f64,
    /// Largest horizontal distance of a body from its first position, at the end (m).
    pub drift: f64,
    /// Bodies in place at the end; none if the scene does not stand.
    pub in_place: Option<usize>,
    /// Largest distance between the anchors of a joint (m); none without joints.
    pub joint_gap: Option<f64>,
    /// Kinetic and potential energy gained over the whole run (J).
    pub energy_gained: f64,
    pub finite: bool,
    /// The thirds of the run that the contender finished; none in rows that were read from a file.
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
                return Err(Error::input(format!("no ratio of {} to {}: {what} {own}, {others}", names[0], names[1])));
            }
        }
        Ok(self.ratio / other.ratio)
    }

    /// The errors that have the same numbers on every machine.
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

    /// How an error differs from that of the first row with the same setting, of the same scene; nothing if it does not.
    pub(super) fn differs_from(&self, rows: &[Self]) -> Option<String> {
        let first = rows.iter().find(|row| row.setting() == self.setting())?;
        let mut pairs = self.errors().into_iter().zip(first.errors());
        let ((what, own), (_, other)) = pairs.find(|((_, own), (_, other))| own.to_bits() != other.to_bits())?;
        let (scene, setting) = (&self.scene, self.setting().label());
        Some(format!("{scene}, {setting}: {what} {own:e} on {}, and {other:e} on {}", self.machine, first.machine))
    }

    /// Whether all bodies of a scene that stands are in place, and all numbers are finite.
    pub fn holds(&self) -> bool {
        self.finite && self.in_place.is_none_or(|n| n == self.bodies)
    }
}

/// Times of one contender in one third of a run, and errors at its end. CSV has no nested fields, so that each row names its run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WindowRow {
    pub scene: String,
    /// As in [`Row`].
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
    /// Time of a step, without the first of the run: median and largest (ms).
    pub ms: f64,
    pub ms_worst: f64,
    /// Time of the first step of the run (ms).
    pub ms_first: f64,
    /// Time relative to the fastest contender of another engine, as the median over the blocks of the third; none without another engine.
    pub to_best: Option<f64>,
    /// Overlaps (m), speed (m/s), distance from the first positions (m) and bodies in place, as in [`Row`], at the end of the third.
    pub penetration_max: f64,
    pub penetration_mean: f64,
    pub speed_rms: f64,
    pub drift: f64,
    pub in_place: Option<usize>,
}

/// Measurements of one contender.
#[derive(Default)]
pub(super) struct Lane {
    /// Time of each step (ms), of complete blocks with finite bodies.
    pub steps: Vec<f64>,
    /// Errors at the end of the blocks of the second half, and of the last block of each third, with the number of the block.
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
