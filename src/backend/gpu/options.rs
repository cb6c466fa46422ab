//! How a device is opened and used.

use std::path::PathBuf;
use std::time::Duration;

use super::adapter::AdapterChoice;

/// How a device is opened and used: [`Gpu::open`](super::Gpu::open).
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
    /// Which adapter to open.
    pub adapter: AdapterChoice,
    /// A part of the name, the API or the driver of the adapter; empty for any.
    pub name: String,
    /// Whether no driver can reassociate or fuse arithmetic, so that results are the reference's to the last bit. An adapter that takes
    /// SPIR-V gets shaders with a decoration that forbids it. Others get WGSL whose sums and products integers steer, which keeps the bits
    /// wherever it was tried; [`conform`](crate::conform) says whether it does here.
    pub exact: bool,
    /// Whether exact mode takes steered WGSL where the adapter takes SPIR-V, too.
    pub steered: bool,
    /// The folder in which pipelines stay from one run to the next, so that later runs compile none; [`BackendKind::open`](crate::backend::BackendKind::open)
    /// and [`choose`](crate::backend::choose) take the variable `DRYSTONE_CACHE`. Vulkan only. A file that was changed is left out.
    pub cache: Option<PathBuf>,
    /// Largest buffer (B); the limit of the adapter counts where it is lower.
    pub buffer_limit: u64,
    /// Most memory that all buffers take together (B).
    pub memory: u64,
    /// Longest that one submission is meant to hold the device (s). A longer plan is cut into several submissions. Watchdogs of drivers
    /// and desktops end work that holds a device for two seconds and more.
    pub submission: Duration,
    /// Whether another device, or the processor, goes on after the device was lost. Else the step fails: so measurements end.
    pub goes_on: bool,
    /// Faults on purpose, for tests.
    pub faults: Faults,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            adapter: AdapterChoice::Best,
            name: String::new(),
            exact: false,
            steered: false,
            cache: None,
            buffer_limit: u64::MAX,
            memory: u64::MAX,
            submission: Duration::from_millis(100),
            goes_on: true,
            faults: Faults::default(),
        }
    }
}

/// Faults on purpose, so that tests can show that checks find them and that runs survive them.
///
/// ```no_run
/// use drystone::Gpu;
/// use drystone::backend::gpu::{Faults, GpuOptions, Loss};
/// use drystone::conform::one_percent_off;
///
/// // The first device is lost while it works on its third submission; the second one stays.
/// let losses = vec![Loss { submission: 3, during: true }];
/// let faults = Faults { shader: Some(one_percent_off), losses };
/// let gpu = Gpu::open(GpuOptions { faults, ..GpuOptions::default() })?;
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Changes the WGSL of the program of this name before it is compiled.
    pub shader: Option<fn(&str, String) -> String>,
    /// When each device that is opened is lost, the first one first; devices beyond the last entry stay.
    pub losses: Vec<Loss>,
}

/// When a device is lost on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// The submission, from 1.
    pub submission: u32,
    /// Whether the device is lost while it works on the submission; else after that.
    pub during: bool,
}
