//! The adapter for runs.

/// The best adapter of this machine.
pub struct Adapter {
    /// Its name, API and driver.
    pub name: String,
    /// Whether it is a hardware GPU.
    pub hardware: bool,
    /// Whether exact mode uses SPIR-V on it.
    pub takes_spirv: bool,
}

/// The best adapter, or `None` if there is none or this build lacks the feature `gpu`.
pub fn best() -> Option<Adapter> {
    #[cfg(feature = "gpu")]
    return drystone::backend::gpu::adapters().into_iter().next().map(|found| Adapter {
        name: found.to_string(),
        hardware: found.hardware,
        takes_spirv: found.takes_spirv,
    });
    #[cfg(not(feature = "gpu"))]
    None
}
