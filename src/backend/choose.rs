//! The choice of the backend for a scene.

use super::Backend;
use super::cpu::{Cpu, Reference};
#[cfg(feature = "gpu")]
use super::gpu::{AdapterChoice, Gpu, GpuOptions};
use crate::error::Result;
use crate::names::named;

/// The backend that a user requests.
///
/// ```
/// use drystone::backend::BackendChoice;
///
/// assert_eq!("gpu".parse::<BackendChoice>()?, BackendChoice::Gpu);
/// assert_eq!(BackendChoice::default().to_string(), "auto");
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum BackendChoice {
    /// A hardware GPU, if there is one and it is faster for the size of the scene; else the CPU. A few steps of a pile of
    /// that size on both show which is faster.
    #[default]
    Auto,
    /// The compute shaders, on the best available adapter.
    Gpu,
    /// The CPU, with all available threads.
    Cpu,
    /// The CPU reference, one constraint at a time on one thread.
    Reference,
}

named!(BackendChoice { Auto = "auto", Gpu = "gpu", Cpu = "cpu", Reference = "reference", });

/// An implementation of the sweeps.
///
/// ```
/// use drystone::backend::BackendKind;
///
/// assert_eq!(BackendKind::Cpu.open(false)?.name(), "cpu");
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum BackendKind {
    /// The reference in double precision.
    F64,
    /// The reference, one constraint at a time on one thread, in single precision.
    Reference,
    /// Sixteen constraints at a time, in single precision.
    Cpu,
    /// The compute shaders, in single precision.
    Gpu,
}

named!(BackendKind { F64 = "f64", Reference = "reference", Cpu = "cpu", Gpu = "gpu", });

impl BackendKind {
    /// Opens a backend of this kind for measurements: a step fails if its device is lost. `exact` requests a GPU with
    /// the bits of the reference.
    ///
    /// # Errors
    /// There is no adapter.
    pub fn open(self, exact: bool) -> Result<Box<dyn Backend>> {
        Ok(match self {
            Self::F64 => Box::new(Reference::<f64>::new()),
            Self::Reference => Box::new(Reference::<f32>::new()),
            Self::Cpu => Box::new(Cpu::new()),
            Self::Gpu => open_gpu(exact, false)?,
        })
    }
}

/// Scenes with fewer dynamic bodies run on the processor: opening a GPU takes longer than their steps.
const MIN_BODIES: usize = 500;

#[cfg(not(feature = "gpu"))]
const WITHOUT_GPU: &str = "drystone was built without the feature gpu";

/// Opens the backend for a scene of `dynamic_bodies`, and returns the reason in one line.
///
/// `exact` requests a GPU with the bits of the reference.
///
/// ```
/// use drystone::backend::{BackendChoice, choose};
///
/// let (backend, why) = choose(BackendChoice::Auto, 100, false)?;
/// assert_eq!(backend.name(), "cpu");
/// assert_eq!(why, "cpu: 100 dynamic bodies; a GPU is considered from 500 bodies on");
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// # Errors
/// The caller requests a GPU and there is none.
pub fn choose(choice: BackendChoice, dynamic_bodies: usize, exact: bool) -> Result<(Box<dyn Backend>, String)> {
    let cpu = |why: String| -> (Box<dyn Backend>, String) { (Box::new(Cpu::new()), why) };
    match choice {
        BackendChoice::Reference => Ok((Box::new(Reference::<f32>::new()), "reference: requested".into())),
        BackendChoice::Cpu => Ok(cpu("cpu: requested".into())),
        BackendChoice::Gpu => {
            let gpu = open_gpu(exact, true)?;
            let why = format!("gpu: requested; {}", gpu.adapter());
            Ok((gpu, why))
        }
        BackendChoice::Auto if dynamic_bodies < MIN_BODIES => {
            Ok(cpu(format!("cpu: {dynamic_bodies} dynamic bodies; a GPU is considered from {MIN_BODIES} bodies on")))
        }
        BackendChoice::Auto => match fastest(dynamic_bodies, exact)? {
            (Some(gpu), why) => Ok((gpu, format!("gpu: {why}"))),
            (None, why) => Ok(cpu(format!("cpu: {why}"))),
        },
    }
}

/// A hardware GPU if it is faster for a scene of `dynamic_bodies`, and the reason for the decision.
#[cfg(feature = "gpu")]
fn fastest(dynamic_bodies: usize, exact: bool) -> Result<(Option<Box<dyn Backend>>, String)> {
    let Ok(mut gpu) = Gpu::new(AdapterChoice::Hardware, exact) else {
        return Ok((None, "no hardware GPU found; `drystone adapters` lists all adapters".into()));
    };
    let adapter = gpu.adapter();
    let times = super::calibrate::step_times(&mut Cpu::new(), &mut gpu, dynamic_bodies)?;
    let why = format!(
        "{dynamic_bodies} dynamic bodies; a step of a pile of {} takes {:.2} ms on the CPU and {:.2} ms on the GPU; {adapter}",
        times.bodies,
        times.cpu * 1e3,
        times.gpu * 1e3
    );
    let faster = (times.gpu < times.cpu).then(|| Box::new(gpu) as Box<dyn Backend>);
    Ok((faster, why))
}

#[cfg(not(feature = "gpu"))]
fn fastest(_: usize, _: bool) -> Result<(Option<Box<dyn Backend>>, String)> {
    Ok((None, WITHOUT_GPU.into()))
}

#[cfg(feature = "gpu")]
fn open_gpu(exact: bool, goes_on: bool) -> Result<Box<dyn Backend>> {
    let cache = std::env::var_os("DRYSTONE_CACHE").map(Into::into);
    Ok(Box::new(Gpu::open(GpuOptions { exact, goes_on, cache, ..GpuOptions::default() })?))
}

#[cfg(not(feature = "gpu"))]
fn open_gpu(_: bool, _: bool) -> Result<Box<dyn Backend>> {
    Err(crate::error::Error::Adapter(WITHOUT_GPU.into()))
}
