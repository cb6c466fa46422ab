//! Contact between rigid bodies: graph-colored sequential impulses on wgpu compute shaders, with a CPU reference that
//! follows the same plan.
//!
//! One step is a straight line, [`Simulation::step`]:
//!
//! ```text
//! detect   parry: tree over boxes -> persistent manifolds, at most 4 points   world  -> manifolds   collide
//! color    greedy, deterministic; only bodies that can move count             pairs  -> colors      graph
//! prepare  arms, masses, separations, carried-over impulses                   ...    -> StepProblem problem
//! plan     substeps x (velocities, warm start, sweep, positions, relax)       config -> StepPlan    plan
//! run      reference, lanes or GPU: same kernels                               in place              backend
//! store    poses, velocities, impulses back                                   -> world, manifolds   problem
//! ```
//!
//! A step is a value ([`StepProblem`]: plain rows), the order of work is data ([`StepPlan`]: a list of passes), and every
//! function of a shader has a Rust double of the same name ([`kernels`]), so that every number of the GPU has something
//! to be compared with.
//!
//! One solve by itself, without bodies' poses: a [`ContactProblem`] from a file, swept by a [`solver::Solver`], and what is
//! left of its error in [`residuals::Residuals`].

#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod backend;
pub mod collide;
pub mod compare;
pub mod config;
pub mod contacts;
pub mod error;
pub mod graph;
pub mod kernels;
pub mod load;
pub mod math;
pub mod memory;
pub mod metrics;
mod names;
pub mod plan;
pub mod preset;
pub mod problem;
mod random;
pub mod residuals;
pub mod scenes;
pub mod simulation;
pub mod sleep;
pub mod solver;
pub mod stats;
pub mod suggest;
pub mod world;

pub use backend::Backend;
pub use backend::cpu::{Cpu, Reference};
#[cfg(feature = "gpu")]
pub use backend::gpu::Gpu;
pub use config::SolverConfig;
pub use contacts::ContactProblem;
pub use error::{Error, Result};
pub use glam;
pub use plan::StepPlan;
pub use problem::StepProblem;
pub use scenes::Scene;
pub use simulation::Simulation;
pub use stats::StepStats;
pub use world::{BallJoint, Body, BodyKind, MassProperties, Material, Shape, World};

/// The example of the README, compiled and run with the other documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
