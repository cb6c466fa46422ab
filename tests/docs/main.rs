//! The documentation, the examples, and the rules that the sources keep.

mod crates;
mod documented;
mod examples;
mod floors;
mod names;
mod pages;
mod platform_functions;

/// The folder of the workspace.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
