//! The tools around drystone: the command line, reports, benchmarks, hard cases, pictures and the window of a game.

#![deny(unsafe_code)]

pub mod adapter;
pub mod commands;
pub mod files;
pub mod hard;
pub mod report;
pub mod settings;
pub mod soak;
#[cfg(feature = "view")]
pub mod view;
