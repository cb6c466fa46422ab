//! Programs as pipelines, compiled when they are first asked for.

use std::collections::HashMap;

use super::buffers::Buffers;
use super::exact;
use super::shader::{self, PASS_COLORS, Program};
use crate::error::Result;
use crate::problem::PassColors;

/// The pipelines of a device.
pub(super) struct Programs {
    device: wgpu::Device,
    exact: bool,
    compiled: HashMap<Program, Compiled>,
}

/// One pipeline.
pub(super) struct Compiled {
    pub pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// Bindings that it uses, ascending.
    bindings: Vec<u32>,
    pub bind_group: wgpu::BindGroup,
    /// Of the buffers in the bind group.
    generation: u64,
}

impl Compiled {
    /// Whether it goes over colors, whose range stands at a dynamic offset.
    pub fn has_colors(&self) -> bool {
        self.bindings.contains(&PASS_COLORS)
    }
}

impl Programs {
    pub fn new(device: wgpu::Device, exact: bool) -> Self {
        Self { device, exact, compiled: HashMap::new() }
    }

    /// One that was prepared.
    pub fn get(&self, program: &Program) -> &Compiled {
        &self.compiled[program]
    }

    /// Compiles a program if it is not yet, and binds it to the buffers that there are.
    pub fn prepare(&mut self, program: &Program, buffers: &Buffers) -> Result<()> {
        if let Some(compiled) = self.compiled.get_mut(program) {
            if compiled.generation != buffers.generation {
                compiled.bind_group = bind(&self.device, buffers, &compiled.layout, &compiled.bindings);
                compiled.generation = buffers.generation;
            }
            return Ok(());
        }
        let (name, source, constants) = (program.name(), program.source(), program.constants());
        let reflected = shader::Reflected::new(&source, name, &constants)?;
        let layout = shader::layout(&self.device, &reflected);
        let module = if self.exact {
            exact::shader_module(&self.device, &reflected)?
        } else {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
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
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions {
                // In exact mode they are part of the SPIR-V already.
                constants: if self.exact { &[] } else { &constants },
                ..Default::default()
            },
            cache: None,
        });
        let bindings = reflected.bindings;
        let bind_group = bind(&self.device, buffers, &layout, &bindings);
        let compiled = Compiled { pipeline, layout, bindings, bind_group, generation: buffers.generation };
        self.compiled.insert(program.clone(), compiled);
        Ok(())
    }
}

fn bind(device: &wgpu::Device, buffers: &Buffers, layout: &wgpu::BindGroupLayout, bindings: &[u32]) -> wgpu::BindGroup {
    let entry = |&binding: &u32| {
        let size = (binding == PASS_COLORS).then(|| wgpu::BufferSize::new(size_of::<PassColors>() as u64)).flatten();
        let buffer = wgpu::BufferBinding { buffer: buffers.get(binding), offset: 0, size };
        wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::Buffer(buffer) }
    };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
