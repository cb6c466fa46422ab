//! What runs came to: one run for people and programs, its motion, and pages made from many runs.

pub mod bench;
pub mod comparison;
mod convergence;
pub mod hard_cases;
mod plot;
pub mod rounds;
mod rules;
mod run;
mod solve;
mod solvers;
mod trajectory;

pub use convergence::{convergence, problems};
pub use rules::{RUNS, RulesReport, rules};
pub use run::{KernelRow, RunReport, Spread, StageRow, Standing};
pub use solve::{CurveRow, NewtonReport, Reached, SolveReport, SolveSettings};
pub use solvers::{Solvers, solvers};
pub use trajectory::Trajectory;
