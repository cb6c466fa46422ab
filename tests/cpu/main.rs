//! Tests that need a processor and nothing else.

/// Helpers that several modules share.
#[path = "../common"]
mod common {
    pub mod contacts;
    pub mod counting;
    pub mod efforts;
    #[cfg(feature = "serde")]
    pub mod settings;
    pub mod state;

    #[cfg(feature = "gpu")]
    pub use drystone::stages::conform::{passes as kernels, random};
}

#[cfg(feature = "serde")]
#[path = "../laws/mod.rs"]
#[allow(dead_code)]
mod laws;
#[cfg(feature = "serde")]
#[path = "../laws/own.rs"]
mod laws_own;
#[cfg(feature = "serde")]
#[path = "../laws/properties.rs"]
mod laws_properties;

mod allocations;
mod batch;
mod changes;
#[cfg(feature = "gpu")]
mod character;
#[cfg(feature = "serde")]
mod checked;
mod compare;
mod contacts;
mod derivation;
mod determinism;
mod drops;
mod edges;
mod effort;
mod energy;
mod forged;
mod graph;
mod impacts;
mod inertia;
#[cfg(feature = "serde")]
mod lanes;
mod newton;
mod oracle;
mod passes;
mod plan;
#[cfg(feature = "gpu")]
mod queries;
mod recording;
mod residuals;
mod rest;
mod rollback;
mod rolling;
mod rules;
mod saved;
#[cfg(feature = "gpu")]
mod shaders;
mod short_substeps;
mod sleep;
mod slots;
mod symmetry;
mod thin_bars;
mod world;
mod worlds;
