//! The pipelines of programs, compiled at first use.

use std::collections::HashMap;
use std::path::Path;

use super::bindings::Binding;
use super::buffers::Buffers;
use super::kept::KeptPipelines;
use super::reflect::Reflected;
#[cfg(not(target_family = "wasm"))]
use super::spirv_exact;
use super::wgsl::{ENTRY_POINT, Program, Target};
use super::wgsl_exact::exact_wgsl;
use crate::error::Result;
use crate::problem::PassRow;

/// The form in which the driver gets shaders.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Shaders {
    /// As WGSL, which the driver may reassociate.
    Plain,
    /// As SPIR-V that forbids reassociation, with or without float controls.
    #[cfg(not(target_family = "wasm"))]
    Spirv(bool),
    /// As WGSL with guarded arithmetic.
    Guarded,
}

/// The pipelines of a device.
pub(super) struct Pipelines {
    device: wgpu::Device,
    shaders: Shaders,
    /// Injected shader faults ([`Faults`](super::Faults)).
    fault: Option<fn(&str, String) -> String>,
    compiled: HashMap<Program, Compiled>,
    kept: Option<KeptPipelines>,
}

/// Compiled pipelines stay for the next run.
impl Drop for Pipelines {
    fn drop(&mut self) {
        if let Some(kept) = self.kept.as_ref().filter(|_| !self.compiled.is_empty()) {
            // Without the file, the next run compiles again.
            let _ = kept.write();
        }
    }
}

/// One pipeline.
pub(super) struct Compiled {
    pub pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// Bindings of the pipeline, in the order of their numbers.
    bindings: Vec<Binding>,
    pub bind_group: wgpu::BindGroup,
    /// Generation of the buffers in the bind group.
    generation: u64,
}

impl Compiled {
    /// Whether it processes colors: their range is at a different offset for each dispatch.
    pub fn has_pass_row(&self) -> bool {
        self.bindings.contains(&Binding::PassRow)
    }
}

impl Pipelines {
    /// `folder` keeps pipelines from run to run, if wgpu supports it.
    pub fn new(
        device: wgpu::Device,
        shaders: Shaders,
        fault: Option<fn(&str, String) -> String>,
        folder: Option<&Path>,
    ) -> Self {
        Self {
            kept: folder.and_then(|folder| KeptPipelines::open(&device, folder)),
            device,
            shaders,
            fault,
            compiled: HashMap::new(),
        }
    }

    /// A prepared pipeline.
    pub fn get(&self, program: &Program) -> &Compiled {
        &self.compiled[program]
    }

    /// Compiles a program once, and binds it to the present buffers.
    pub fn prepare(&mut self, program: &Program, target: Target, buffers: &Buffers) -> Result<()> {
        if let Some(compiled) = self.compiled.get_mut(program) {
            if compiled.generation != buffers.generation {
                compiled.bind_group = bind(&self.device, buffers, &compiled.layout, &compiled.bindings);
                compiled.generation = buffers.generation;
            }
            return Ok(());
        }
        let (name, mut source) = (program.name(), program.source(target));
        if let Some(fault) = self.fault {
            source = fault(name, source);
        }
        let mut reflected = Reflected::new(name, &source)?;
        if self.shaders == Shaders::Guarded {
            source = exact_wgsl(&reflected, &source);
            // Includes the buffer with the guard number.
            reflected = Reflected::new(name, &source)?;
        }
        let layout = layout(&self.device, &reflected);
        let module = match self.shaders {
            #[cfg(not(target_family = "wasm"))]
            Shaders::Spirv(float_controls) => spirv_exact::shader_module(&self.device, &reflected, float_controls)?,
            _ => self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            }),
        };
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(ENTRY_POINT),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: self.kept.as_ref().map(KeptPipelines::cache),
        });
        let bindings = reflected.bindings;
        let bind_group = bind(&self.device, buffers, &layout, &bindings);
        let compiled = Compiled { pipeline, layout, bindings, bind_group, generation: buffers.generation };
        self.compiled.insert(program.clone(), compiled);
        Ok(())
    }
}

fn layout(device: &wgpu::Device, reflected: &Reflected) -> wgpu::BindGroupLayout {
    let entry = |&binding: &Binding| {
        let ty = match reflected.space(binding) {
            naga::AddressSpace::Storage { access } => {
                wgpu::BufferBindingType::Storage { read_only: !access.contains(naga::StorageAccess::STORE) }
            }
            _ => wgpu::BufferBindingType::Uniform,
        };
        wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: binding.has_offset(), min_binding_size: None },
            count: None,
        }
    };
    let entries: Vec<_> = reflected.bindings.iter().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}

fn bind(
    device: &wgpu::Device,
    buffers: &Buffers,
    layout: &wgpu::BindGroupLayout,
    bindings: &[Binding],
) -> wgpu::BindGroup {
    let entry = |&binding: &Binding| {
        let size = binding.has_offset().then(|| wgpu::BufferSize::new(size_of::<PassRow>() as u64)).flatten();
        let buffer = wgpu::BufferBinding { buffer: buffers.get(binding), offset: 0, size };
        wgpu::BindGroupEntry { binding: binding as u32, resource: wgpu::BindingResource::Buffer(buffer) }
    };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
