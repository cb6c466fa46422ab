//! The adapters of this machine, and the choice of one.

use std::fmt;

use super::block_on;
use crate::error::{Error, Result};

/// A description of an adapter, for reports.
///
/// ```
/// use drystone::backend::gpu::{AdapterSummary, adapters};
///
/// let hardware: Vec<AdapterSummary> = adapters().into_iter().filter(|adapter| adapter.hardware).collect();
/// println!("{} adapters are hardware", hardware.len());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Its own name.
    pub name: String,
    /// Vulkan, Metal, Dx12 or Gl.
    pub api: String,
    /// Driver and version.
    pub driver: String,
    /// Discrete, integrated, virtual, or software on the processor.
    pub kind: &'static str,
    /// Whether the adapter is hardware.
    pub hardware: bool,
    /// Whether it accepts SPIR-V. In SPIR-V, exact mode can forbid the driver to reassociate.
    pub takes_spirv: bool,
    /// Whether it has a clock to time kernels.
    pub clock: bool,
    /// Largest buffer for a kernel (B).
    pub buffer_limit: u64,
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {}; {})", self.name, self.api, self.kind, self.driver)
    }
}

/// The adapter to open.
///
/// ```
/// use drystone::backend::gpu::{AdapterChoice, adapters, open_device};
///
/// let hardware = adapters().iter().any(|adapter| adapter.hardware);
/// assert_eq!(open_device(AdapterChoice::Hardware).is_ok(), hardware);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AdapterChoice {
    /// The best adapter, in this order: discrete, integrated, virtual, then software.
    Best,
    /// The best adapter that is not software.
    Hardware,
}

/// Advice for a machine without an adapter.
const INSTALL: &str = "install a graphics driver, or the software one: `apt-get install mesa-vulkan-drivers` on Debian and Ubuntu, \
    `dnf install mesa-vulkan-drivers` on Fedora, `pacman -S vulkan-swrast` on Arch";

/// Adapters that can run the kernels, in the order of [`AdapterChoice::Best`].
///
/// The environment variable `DRYSTONE_ADAPTER` selects adapters by a part of their name, API or driver; `none` hides
/// all.
///
/// ```
/// for adapter in drystone::backend::gpu::adapters() {
///     println!("{adapter}");
/// }
/// ```
pub fn adapters() -> Vec<AdapterSummary> {
    block_on(async { Ok(adapters_async().await) }).unwrap_or_default()
}

/// Like [`adapters`], for a web page, where `adapters` finds none.
///
/// ```
/// use drystone::backend::gpu::{adapters, adapters_async};
///
/// assert_eq!(pollster::block_on(adapters_async()), adapters());
/// ```
pub async fn adapters_async() -> Vec<AdapterSummary> {
    found().await.into_iter().map(|(_, summary)| summary).collect()
}

/// The environment variable `DRYSTONE_ADAPTER`; empty if it is not set.
fn wanted() -> String {
    std::env::var("DRYSTONE_ADAPTER").unwrap_or_default()
}

/// The best adapter that `choice` allows and whose summary contains `name`.
pub(super) async fn find(choice: AdapterChoice, name: &str) -> Result<(wgpu::Adapter, AdapterSummary)> {
    let lower = name.to_lowercase();
    let fits = |s: &AdapterSummary| {
        (choice == AdapterChoice::Best || s.hardware) && s.to_string().to_lowercase().contains(&lower)
    };
    found().await.into_iter().find(|(_, s)| fits(s)).ok_or_else(|| {
        let variable = format!("DRYSTONE_ADAPTER={}", wanted());
        let named = match (name, &wanted()[..]) {
            ("", "") => String::new(),
            ("", _) => format!("one that {variable} names, for "),
            (_, "") => format!("one that {name:?} names, for "),
            _ => format!("one that {name:?} and {variable} name, for "),
        };
        Error::Adapter(if cfg!(target_family = "wasm") {
            "no adapter found: this browser does not offer WebGPU to this page".into()
        } else {
            format!("no adapter found; looked for {named}Vulkan, Metal, Direct3D 12 and OpenGL drivers: {INSTALL}")
        })
    })
}

/// Opens the adapter of `choice` for drawing.
///
/// ```
/// use drystone::backend::gpu::{AdapterChoice, adapters, open_device};
///
/// if let Ok((_device, _queue, summary)) = open_device(AdapterChoice::Best) {
///     assert_eq!(summary, adapters()[0]);
/// }
/// ```
///
/// # Errors
/// There is no such adapter, or it cannot be opened.
pub fn open_device(choice: AdapterChoice) -> Result<(wgpu::Device, wgpu::Queue, AdapterSummary)> {
    block_on(async {
        let (adapter, summary) = find(choice, "").await?;
        let (device, queue) = open(&adapter, false).await?;
        Ok((device, queue, summary))
    })
}

async fn found() -> Vec<(wgpu::Adapter, AdapterSummary)> {
    // With `none`, no driver is loaded.
    if wanted().eq_ignore_ascii_case("none") {
        return Vec::new();
    }
    // Try OpenGL only as a last resort: its loaders write messages on machines without a display.
    for backends in [wgpu::Backends::PRIMARY, wgpu::Backends::SECONDARY] {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let usable = usable(&instance, backends).await;
        if !usable.is_empty() {
            return usable;
        }
    }
    Vec::new()
}

/// Adapters of an instance that can run the kernels and whose summary contains the wanted name, best first.
async fn usable(instance: &wgpu::Instance, backends: wgpu::Backends) -> Vec<(wgpu::Adapter, AdapterSummary)> {
    let wanted = wanted().to_lowercase();
    let all = instance.enumerate_adapters(backends).await.into_iter().filter(can_compute);
    let mut usable: Vec<_> = all.map(|adapter| (adapter.clone(), summarize(&adapter))).collect();
    usable.retain(|(_, s)| wanted != "none" && s.to_string().to_lowercase().contains(&wanted));
    usable.sort_by_key(|(a, _)| KINDS.iter().position(|(kind, _)| *kind == a.get_info().device_type));
    usable
}

/// Opens the best adapter that can draw on `window`.
///
/// # Errors
/// There is no such adapter, or it cannot be opened.
pub fn open_for_surface(
    display: Box<dyn wgpu::wgt::WgpuHasDisplayHandle>,
    window: impl Into<wgpu::SurfaceTarget<'static>>,
) -> Result<(wgpu::Surface<'static>, wgpu::Adapter, wgpu::Device, wgpu::Queue)> {
    let none = |why: String| Error::Adapter(format!("no adapter can draw on this display{why}: {INSTALL}"));
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_with_display_handle(display)
    });
    let surface = instance.create_surface(window).map_err(|e| none(format!(" ({e})")))?;
    block_on(async {
        let mut usable = usable(&instance, wgpu::Backends::all()).await.into_iter();
        let (adapter, _) = usable.find(|(a, _)| a.is_surface_supported(&surface)).ok_or_else(|| none(String::new()))?;
        let (device, queue) = open(&adapter, false).await?;
        Ok((surface, adapter, device, queue))
    })
}

fn can_compute(adapter: &wgpu::Adapter) -> bool {
    adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
        && adapter.limits().max_storage_buffers_per_shader_stage >= 8
}

/// Kinds of adapters with their names, best first.
const KINDS: [(wgpu::DeviceType, &str); 5] = [
    (wgpu::DeviceType::DiscreteGpu, "discrete"),
    (wgpu::DeviceType::IntegratedGpu, "integrated"),
    (wgpu::DeviceType::VirtualGpu, "virtual"),
    (wgpu::DeviceType::Other, "unknown kind"),
    (wgpu::DeviceType::Cpu, "software"),
];

fn summarize(adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    let vulkan = info.backend == wgpu::Backend::Vulkan;
    AdapterSummary {
        kind: KINDS.iter().find(|(kind, _)| *kind == info.device_type).map_or("unknown kind", |(_, name)| name),
        hardware: info.device_type != wgpu::DeviceType::Cpu,
        takes_spirv: vulkan && adapter.features().contains(wgpu::Features::PASSTHROUGH_SHADERS),
        clock: adapter.features().contains(super::timer::FEATURES),
        buffer_limit: adapter.limits().max_storage_buffer_binding_size.min(adapter.limits().max_buffer_size),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        api: format!("{:?}", info.backend),
        name: if info.name.is_empty() { "an adapter without a name".into() } else { info.name },
    }
}

/// Opens an adapter; with `spirv`, also for SPIR-V shaders.
pub(super) async fn open(adapter: &wgpu::Adapter, spirv: bool) -> Result<(wgpu::Device, wgpu::Queue)> {
    let offered = adapter.limits();
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("drystone"),
        required_features: if spirv { wgpu::Features::PASSTHROUGH_SHADERS } else { wgpu::Features::empty() }
            | adapter.features() & (super::timer::FEATURES | wgpu::Features::PIPELINE_CACHE),
        // The limits of every WebGPU implementation, except that buffers can be as large as the adapter allows.
        required_limits: wgpu::Limits {
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            ..wgpu::Limits::default()
        },
        ..Default::default()
    };
    let opened = adapter.request_device(&descriptor).await;
    opened.map_err(|e| Error::Adapter(format!("{}: {e}", adapter.get_info().name)))
}
