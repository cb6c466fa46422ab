//! What several test files share. Each file uses a part of it.
#![allow(dead_code)]

pub mod contacts;
pub mod gpu;
#[macro_use]
pub mod harness;
pub mod measurement;
pub mod sample;
pub mod state;
pub mod tolerance;

use drystone::Backend;
// The checks of `drystone conform` share them.
#[allow(unused_imports)]
pub use drystone_conform::{difference, passes as kernels, random};

/// Opens the backend that a test runs on.
pub type Open = fn() -> Box<dyn Backend>;
