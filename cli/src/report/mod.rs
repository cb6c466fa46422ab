//! What runs came to: one run for people and programs, its motion, and pages made from many runs.

pub mod bench;
mod clock;
mod convergence;
pub mod front;
pub mod hard_cases;
mod plot;
mod rules;
mod run;
mod solve;
mod trajectory;

pub use convergence::{convergence, problems};
pub use rules::{RUNS, RulesReport, rules};
pub use run::{KernelRow, RunReport, Spread, StageRow, Standing};
pub use solve::{CurveRow, Reached, SolveReport, SolveSettings};
pub use trajectory::Trajectory;
