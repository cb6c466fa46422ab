//! Which backend runs a scene.

use super::Backend;
use super::cpu::{Cpu, Reference};
use super::gpu::{AdapterChoice, Gpu};
use crate::error::Result;

/// What a person asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendChoice {
    /// A hardware GPU where there is one and the scene is large enough to pay, else the CPU.
    #[default]
    Auto,
    /// The compute shaders, on the best adapter there is.
    Gpu,
    /// The CPU, with as many threads as there are.
    Cpu,
    /// The CPU reference, one constraint at a time on one thread.
    Reference,
}

/// Dynamic bodies from which `auto` takes a GPU. Below it the dispatches of a step cost more than its sweeps do on a
/// processor: a colored step is some 200 dispatches of 5 to 10 us each.
pub const AUTO_GPU_BODIES: usize = 5_000;

/// Opens the backend for a scene of `dynamic_bodies`, and says in one line what was taken and why.
///
/// `exact` asks a GPU for the reference's bits.
///
/// # Errors
/// A GPU is asked for by name and there is none, or it cannot do what is asked.
pub fn choose(choice: BackendChoice, dynamic_bodies: usize, exact: bool) -> Result<(Box<dyn Backend>, String)> {
    let cpu = |why: String| -> (Box<dyn Backend>, String) { (Box::new(Cpu::new()), why) };
    match choice {
        BackendChoice::Reference => Ok((Box::new(Reference::<f32>::new()), "reference: asked for".into())),
        BackendChoice::Cpu => Ok(cpu("cpu: asked for".into())),
        BackendChoice::Gpu => {
            let gpu = Gpu::new(AdapterChoice::Best, exact)?;
            let why = format!("gpu: asked for; {}", gpu.adapter());
            Ok((Box::new(gpu), why))
        }
        BackendChoice::Auto if dynamic_bodies < AUTO_GPU_BODIES => {
            Ok(cpu(format!("cpu: {dynamic_bodies} dynamic bodies, a GPU pays from {AUTO_GPU_BODIES}")))
        }
        BackendChoice::Auto => match Gpu::new(AdapterChoice::Hardware, exact) {
            Ok(gpu) => {
                let why = format!("gpu: {dynamic_bodies} dynamic bodies and {}", gpu.adapter());
                Ok((Box::new(gpu), why))
            }
            Err(_) => Ok(cpu("cpu: no hardware GPU found (drystone adapters lists what there is)".into())),
        },
    }
}
