//! Reports of single runs, and pages from many runs.

pub mod bench;
pub mod comparison;
mod convergence;
pub mod hard_cases;
pub mod hard_families;
pub mod hard_rows;
#[cfg(feature = "gpu")]
pub mod junit;
pub mod number;
mod performance;
mod plot;
mod prose;
pub mod rounds;
mod rules;
mod run;
mod scene_hash;
mod shard;
mod solve;
mod solvers;
mod trajectory;

pub use convergence::{Convergence, convergence, problem_of_step, problems};
pub use performance::performance;
pub use plot::engine_color;
pub use rules::{RUNS, RulesReport, rules};
pub use run::{KernelRow, RunReport, Spread, StageRow, Standing};
pub use shard::Shard;
pub use solve::{CurveRow, NewtonReport, Reached, SolveReport, SolveSettings};
pub use solvers::{Solvers, solvers};
pub use trajectory::Trajectory;
