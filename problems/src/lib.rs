//! Contact problems at the level of velocities, without poses and without a world: formats, solvers and error measures.
//! This crate builds on [`drystone`], and can extract problems from its steps.
//!
//! | To | call |
//! |---|---|
//! | write, read or build a problem | [`ContactProblem`], [`contacts`] |
//! | extract the problem of a step | [`step_with_contacts`], [`ContactProblem::of_step`] |
//! | measure errors of impulses | [`Residuals`], [`step_with_residuals`], [`batch::Measure`] |
//! | solve by sweeps on any backend | [`Solver`](solver::Solver) |
//! | solve in double precision | [`newton`](solver::newton), [`solution`](solver::solution) |
//!
//! # Features
//!
//! - `fclib`: contact problems in FCLIB's HDF5 files.
//! - `serde`: results serialize.

#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod batch;
pub mod contacts;
pub mod residuals;
pub mod solver;
mod step;

pub use contacts::ContactProblem;
pub use residuals::Residuals;
pub use step::{step_with_contacts, step_with_residuals};
