//! What runs came to: one run for people and programs, and pages made from many runs.

mod plot;
//mod rules;
mod run;

//pub use rules::{RUNS, RulesReport, rules};
pub use run::{RunReport, StageRow, Trajectory};
