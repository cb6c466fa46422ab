//! The window and files of pictures.

mod open;
mod output;
mod panel;
mod recorded;
pub mod window;

pub use output::Output;
pub use recorded::recorded;
