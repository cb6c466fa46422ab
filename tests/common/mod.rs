//! What several test files share. Each file uses a part of it.
#![allow(dead_code)]

pub mod contacts;
pub mod difference;
pub mod gpu;
#[macro_use]
pub mod harness;
pub mod kernels;
pub mod measurement;
pub mod random;
pub mod tolerance;

use drystone::Backend;

/// Opens the backend that a test runs on.
pub type Open = fn() -> Box<dyn Backend>;
