//! Comparisons of backends of [`drystone`], bit by bit, and checks of an adapter and its driver.
//!
//! - [`compare`](compare::compare) runs a scene on two backends, and names the first step, body and pass that differ.
//! - [`conform`](fn@conform) checks an adapter: kernels on random problems, scenes, limits, long plans, lost devices.
//! - [`passes`], [`random`] and [`difference`] are its parts, for tests of kernels.
//!
//! # Features
//!
//! - `gpu`, the default: the checks of an adapter.
//! - `serde`: results serialize.

#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod compare;
#[cfg(feature = "gpu")]
mod conform;

#[cfg(feature = "gpu")]
pub use conform::{
    Check, ConformOptions, Conformance, Group, Mode, PLAIN_PASS, PLAIN_STEP, Verdict, conform, conform_async,
    difference, one_percent_off, passes, random,
};
