//! `drystone report`: speed against error.

mod contender;
mod html;
mod measure;
mod origin;
mod page;
mod pareto;
mod points;
mod problems;
mod solves;
mod survey;
mod table;

pub use contender::{Contender, Drystone, Extent, Setting, Team};
pub use measure::{Row, blocks, measure};
pub use origin::Origin;
pub use points::{drystone, scene, scenes, substeps};
pub use solves::SolveRow;
pub use survey::{Report, Survey};

#[cfg(test)]
mod tests {
    use super::Row;

    /// A row of an engine with a time and a mean overlap (m); all of one run.
    pub(super) fn row(engine: &str, ms: f64, mean: f64) -> Row {
        Row {
            scene: "scene".into(),
            hash: "hash".into(),
            run: "run".into(),
            build: "build".into(),
            commit: "commit".into(),
            machine: "machine".into(),
            threads: 1,
            bodies: 1,
            steps: 10,
            engine: engine.into(),
            backend: "cpu".into(),
            substeps: 8,
            sweeps: 1,
            method: "plain".into(),
            friction: "disc".into(),
            more: String::new(),
            clock: "processor".into(),
            ms,
            ms_low: ms,
            ms_high: ms,
            ratio: ms,
            ratio_low: ms,
            ratio_high: ms,
            penetration_max: mean,
            penetration_p95: mean,
            penetration_mean: mean,
            speed_rms: 0.0,
            drift: 0.0,
            in_place: Some(1),
            joint_gap: None,
            energy_gained: 0.0,
            finite: true,
        }
    }
}
