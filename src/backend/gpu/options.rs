//! Options for opening and using a device.

use std::path::PathBuf;
use std::time::Duration;

use super::adapter::AdapterChoice;

/// Options for opening and using a device: see [`Gpu::open`](super::Gpu::open).
///
/// ```no_run
/// use drystone::Gpu;
/// use drystone::backend::gpu::GpuOptions;
///
/// let gpu = Gpu::open(GpuOptions { name: "llvmpipe".into(), exact: true, ..GpuOptions::default() })?;
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct GpuOptions {
    /// The adapter to open.
    pub adapter: AdapterChoice,
    /// A part of the name, the API or the driver of the adapter; empty for any.
    pub name: String,
    /// Exact mode: no driver can reassociate or fuse arithmetic, so that results equal the reference to the last bit.
    /// If the adapter accepts SPIR-V, its shaders carry a decoration that forbids both. Otherwise integers guard the
    /// sums and products of the WGSL. That has kept the bits on every tested adapter; `drystone-conform` tests the
    /// adapter of a machine.
    pub exact: bool,
    /// Whether exact mode uses the guarded WGSL even if the adapter accepts SPIR-V.
    pub guarded: bool,
    /// The folder in which compiled pipelines stay from one run to the next, so that later runs do not compile.
    /// [`BackendKind::open`](crate::backend::BackendKind::open) and [`choose`](crate::backend::choose) read the
    /// environment variable `DRYSTONE_CACHE`. Vulkan only. A modified file is ignored.
    pub cache: Option<PathBuf>,
    /// Largest buffer (B). A lower limit of the adapter also applies.
    pub buffer_limit: u64,
    /// Largest total memory of all buffers (B).
    pub memory: u64,
    /// Target for the longest time that one submission holds the device (s). A longer plan is divided into several
    /// submissions. Watchdogs of drivers and desktops end work that holds a device for two seconds or more.
    pub submission: Duration,
    /// Whether another device, or the processor, continues after the device was lost. Otherwise the step fails, which
    /// ends a measurement.
    pub goes_on: bool,
    /// Injected faults, for tests.
    pub faults: Faults,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            adapter: AdapterChoice::Best,
            name: String::new(),
            exact: false,
            guarded: false,
            cache: None,
            buffer_limit: u64::MAX,
            memory: u64::MAX,
            submission: Duration::from_millis(100),
            goes_on: true,
            faults: Faults::default(),
        }
    }
}

/// Injected faults. With them, tests can show that checks find faults and that runs survive them.
///
/// ```no_run
/// use drystone::Gpu;
/// use drystone::backend::gpu::{Faults, GpuOptions, Loss};
/// use drystone_conform::one_percent_off;
///
/// // The first device is lost while it works on its third submission; the second one stays.
/// let losses = vec![Loss { submission: 3, during: true }];
/// let faults = Faults { shader: Some(one_percent_off), losses };
/// let gpu = Gpu::open(GpuOptions { faults, ..GpuOptions::default() })?;
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Modifies the WGSL of the program of this name before compilation.
    pub shader: Option<fn(&str, String) -> String>,
    /// The time of loss for each opened device, in order. Devices beyond the last entry are not lost.
    pub losses: Vec<Loss>,
}

/// The time at which a test loses a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// The number of the submission, from 1.
    pub submission: u32,
    /// Whether the device is lost during the submission; otherwise after it.
    pub during: bool,
}
