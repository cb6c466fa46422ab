//! The command as a process, on the processor.

/// Helpers that several modules share.
#[path = "../../../tests/common"]
mod common {
    pub mod contacts;
    pub mod sample;
}

mod cli;
mod ends;
mod families;
mod fclib;
mod hard;
mod memory;
mod play;
mod readme;
mod replay;
mod report;
mod rolling_plate;
mod run_report;
mod settings;
mod shards;
mod soak;
mod solve;
