//! What runs came to: one run for people and programs, and pages made from many runs.

mod plot;

mod run;

pub use run::{RunReport, StageRow, Trajectory};
