//! The adapter that runs are made on.

/// The best adapter of this machine.
pub struct Adapter {
    /// Its name, API and driver.
    pub name: String,
    /// Whether it is a GPU, and not software.
    pub hardware: bool,
    /// Whether exact mode runs on it by SPIR-V.
    pub takes_spirv: bool,
}

/// The best adapter; none where there is none, or in a build without the feature `gpu`.
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
