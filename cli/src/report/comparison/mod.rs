//! `drystone report`: speed against error.

mod contender;
mod duels;
mod html;
mod measure;
mod origin;
mod page;
mod pareto;
mod points;
mod problems;
mod row;
mod solves;
mod survey;
mod tables;
mod windows;

pub use contender::{Contender, Drystone, Extent, Setting, Team};
pub use measure::{blocks, measure};
pub use origin::Origin;
pub(super) use origin::fnv;
pub use points::{drystone, scene, scenes, substeps};
pub use row::{Row, WindowRow};
pub use solves::SolveRow;
pub use survey::{Report, Survey};
pub use tables::tables;

#[cfg(test)]
mod tests {
    use super::Row;

    /// A row of an engine with a time and a mean overlap (m). All rows are of one run.
    pub(super) fn row(engine: &str, ms: f64, mean: f64) -> Row {
        let [scene, hash, run] = ["scene", "hash", "run"].map(str::to_owned);
        let (penetration_max, penetration_p95, penetration_mean) = (mean, mean, mean);
        Row {
            scene,
            hash,
            run,
            bodies: 1,
            engine: engine.into(),
            ms,
            ratio: ms,
            penetration_max,
            penetration_p95,
            penetration_mean,
            in_place: Some(1),
            finite: true,
            ..Row::default()
        }
    }
}
