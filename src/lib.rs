//! Contact, Coulomb friction and joints between rigid bodies. The solver runs projected sequential impulses over a
//! colored graph of contacts: on the CPU with SIMD lanes and threads, or on wgpu compute shaders.
//!
//! One step is a straight line, [`Simulation::step`]:
//!
//! ```text
//! detect   tree over boxes -> persistent manifolds by parry, at most 4 points  world  -> manifolds   collide
//! color    greedy, deterministic; only bodies that can move count             slots  -> order       graph
//! prepare  arms, masses, separations; impulses stay in their rows             ...    -> StepProblem problem
//! plan     substeps x (velocities, warm start, sweep, positions, relax)       config -> StepPlan    plan
//! run      reference, lanes or GPU: same kernels                               in place              backend
//! store    poses and velocities back                                          -> world              problem
//! ```
//!
//! One step is a value ([`StepProblem`](stages::problem::StepProblem), plain rows) and the order of work is data ([`StepPlan`](stages::plan::StepPlan), a list of passes).
//! Every shader function has a Rust twin of the same name ([`stages::kernels`]), so a test can compare every number
//! that the GPU computes.
//!
//! | To | call |
//! |---|---|
//! | build a world | [`World`], [`Body`], [`Shape`], [`Joint`]; or find a scene of the catalogue or a file in `drystone-scenes` |
//! | choose settings | [`SolverConfig`], [`Preset`](preset::Preset), [`Load`](load::Load) for a limit on the overlap |
//! | choose a backend for the sweeps | [`Cpu`], [`Reference`], `Gpu`, or [`choose`](backend::choose) |
//! | step | [`Simulation::step`], which gives [`StepStats`] |
//! | step many independent worlds | [`batch::Batch`] |
//! | go back, fork, save and load | [`Rollback`], [`Simulation::fork`], [`Simulation::snapshot`], [`Simulation::save`] |
//! | read contacts and impulses | [`Simulation::manifolds`]: [`SolvedManifold`], [`SolvedPoint`] |
//! | ask for bodies on a ray, at a point, in a box | [`Simulation::queries`], [`Queries`](queries::Queries) |
//! | let a character walk | [`Character::walk`] |
//! | get events of contacts, hits, sensors, broken joints | [`Simulation::events`], [`Listen`], [`Body::sensor`] |
//! | measure overlap, speed, drift | [`metrics`] |
//! | record a run and replay it | `drystone-scenes` |
//! | solve one problem without poses, measure residuals | `drystone-problems` |
//! | compare backends, check an adapter and its driver | `drystone-conform` |
//!
//! The stages one by one, which tests and measurements need, are in [`stages`].
//!
//! # Features
//!
//! - `gpu`, the default: the backend on compute shaders. Without it no crate of wgpu is built.
//! - `serde`: settings serialize and deserialize, results serialize.
//! - `schema`: the JSON Schema of settings.

#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod backend;
pub mod batch;
pub mod character;
mod collide;
pub mod config;
mod constants;
mod effort;
mod energy;
mod error;
mod graph;
mod kernels;
mod lanes;
pub mod load;
mod math;
mod memory;
pub mod metrics;
mod names;
mod openings;
mod panics;
mod plan;
pub mod preset;
mod problem;
pub mod queries;
mod random;
mod rest;
mod saved;
mod simulation;
mod sleep;
pub mod stages;
pub mod stats;
mod suggest;
pub mod world;

pub use backend::Backend;
pub use backend::cpu::{Cpu, Reference};
#[cfg(feature = "gpu")]
pub use backend::gpu::Gpu;
pub use character::Character;
pub use config::SolverConfig;
pub use error::{Error, Result};
pub use glam;
pub use simulation::{
    ColliderOf, Contact, ContactHooks, ContactPoint, Event, Hit, Listen, PendingContact, PendingPoint, Rollback,
    Simulation, Snapshot, SolvedManifold, SolvedPoint, Summed,
};
pub use stats::StepStats;
pub use world::{
    Axis, Body, BodyHandle, BodyKind, Bounds, CombineRule, Drive, Groups, Joint, JointHandle, JointMotion, Linear,
    MassProperties, Material, Shape, World,
};

/// The example of the README, compiled and run with the other documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// The example of the page about the library, likewise.
#[cfg(doctest)]
#[doc = include_str!("../docs/library.md")]
pub struct Library;
