//! The Rust doubles of `shaders/*.wgsl`: same names, same order of operations, over a [`Lane`](crate::math::Lane).
//!
//! `contact` is the double of `shaders/lib/contact.wgsl` and of the kernels that sweep manifolds, `integrate` of those
//! that go over bodies. Branches on data are `select`s; branches on rules are plain `if`s, as overrides are in WGSL.

pub mod contact;
pub mod integrate;
mod rows;

pub use rows::{Body, Contact, Impulse, Inertia, Mass, Pair, Point, SoftnessOf, StepParams, Sym3};
