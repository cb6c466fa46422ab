//! The window, and picture files.

mod open;
mod output;
mod panel;
mod recorded;
pub mod window;

pub use output::Output;
pub use recorded::recorded;
