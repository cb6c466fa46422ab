//! Tests that need a processor and nothing else.

/// Helpers that several modules share.
#[path = "../common"]
mod common {
    pub mod contacts;
    pub mod counting;
    pub mod efforts;
    pub mod sample;
    pub mod settings;
    pub mod state;

    #[cfg(feature = "gpu")]
    pub use drystone_conform::{passes as kernels, random};
}

#[path = "../laws/mod.rs"]
#[allow(dead_code)]
mod laws;
#[path = "../laws/own.rs"]
mod laws_own;
#[path = "../laws/properties.rs"]
mod laws_properties;

mod allocations;
mod batch;
mod changes;
mod character;
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
