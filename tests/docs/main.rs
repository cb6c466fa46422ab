//! The documentation, the examples, and the rules that the sources keep.

mod crates;
mod documented;
mod examples;
mod floors;
mod names;
mod pages;
mod platform_functions;
