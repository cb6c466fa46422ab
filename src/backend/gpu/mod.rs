//! The GPU backend: the passes of a plan as dispatches of one compute pass in one submission.
//!
//! Stays inside the limits that every WebGPU implementation offers (at most 8 storage buffers a kernel, 64 threads a
//! workgroup, no optional features), except for the size of buffers, which are asked for as large as the adapter has them.

mod adapter;
mod exact;
pub mod shader;

pub use adapter::{AdapterChoice, AdapterSummary, adapters};

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::Backend;
use crate::error::{Error, Result};
use crate::kernels::momentum::CHUNK;
use crate::plan::{Kernel, Pass};
use crate::problem::{ConvergenceRow, MomentumRow, PassColors, StepProblem};
use shader::{BINDINGS, PASS_COLORS, SCRATCH, SCRATCH_ROW, WORKGROUP};

/// Opens the adapter that `choice` finds, for drawing.
///
/// # Errors
/// No such adapter, or it cannot be opened.
#[cfg(feature = "view")]
pub(crate) fn open_device(choice: AdapterChoice) -> Result<(wgpu::Device, wgpu::Queue, AdapterSummary)> {
    let (adapter, summary) = adapter::find(choice)?;
    let (device, queue) = adapter::open(&adapter, false)?;
    Ok((device, queue, summary))
}

#[cfg(feature = "view")]
pub(crate) use adapter::open_for_surface;

/// Follows plans on a device through wgpu.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    summary: AdapterSummary,
    exact: bool,
    kernels: HashMap<Kernel, CompiledKernel>,
    /// One buffer a binding, grown when a problem needs it.
    buffers: Vec<Option<wgpu::Buffer>>,
    read_back: Option<wgpu::Buffer>,
    /// First error that the device reported outside a call.
    device_error: Arc<Mutex<Option<String>>>,
}

struct CompiledKernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// Bindings that it uses, ascending.
    bindings: Vec<u32>,
    /// Valid until a buffer grows.
    bind_group: Option<wgpu::BindGroup>,
}

impl Gpu {
    /// Opens the adapter that `choice` finds. `exact` asks for shaders that no driver may reassociate, so that results
    /// are the reference's to the last bit.
    ///
    /// # Errors
    /// No such adapter; it cannot be opened; or exact shaders are asked of one that cannot take SPIR-V.
    pub fn new(choice: AdapterChoice, exact: bool) -> Result<Self> {
        let (adapter, summary) = adapter::find(choice)?;
        if exact && !summary.exact {
            let name = &summary.name;
            return Err(Error::Adapter(format!("exact mode needs an adapter that takes SPIR-V; {name} does not")));
        }
        let (device, queue) = adapter::open(&adapter, exact)?;
        let device_error = Arc::new(Mutex::new(None));
        let first_error = Arc::clone(&device_error);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            first_error.lock().expect("no panic holds it").get_or_insert(error.to_string());
        }));
        Ok(Self {
            device,
            queue,
            summary,
            exact,
            kernels: HashMap::new(),
            buffers: (0..BINDINGS.len()).map(|_| None).collect(),
            read_back: None,
            device_error,
        })
    }

    /// What it runs on.
    pub fn summary(&self) -> &AdapterSummary {
        &self.summary
    }

    /// Whether its results are the reference's to the last bit.
    pub fn is_exact(&self) -> bool {
        self.exact
    }

    /// Sends the rows; buffers grow where they must.
    fn upload(&mut self, problem: &StepProblem, pass_colors: &[u8], accelerated: bool) -> Result<()> {
        let limit = self.device.limits().max_storage_buffer_binding_size;
        let rows: [&[u8]; BINDINGS.len() - SCRATCH] = [
            bytemuck::bytes_of(&problem.params),
            pass_colors,
            bytemuck::cast_slice(&problem.bodies),
            bytemuck::cast_slice(&problem.masses),
            bytemuck::cast_slice(&problem.inertias),
            bytemuck::cast_slice(&problem.contacts),
            bytemuck::cast_slice(&problem.points),
            bytemuck::cast_slice(&problem.impulses),
            bytemuck::cast_slice(&problem.colors),
            bytemuck::cast_slice(&problem.joints),
            bytemuck::cast_slice(&problem.joint_impulses),
            bytemuck::bytes_of(&problem.convergence),
            bytemuck::bytes_of(&problem.momentum),
        ];
        // Refused before anything is sent.
        for (name, bytes) in BINDINGS.iter().zip(rows) {
            if bytes.len() as u64 > limit {
                let (mib, limit, adapter) = (bytes.len() >> 20, limit >> 20, &self.summary.name);
                return Err(Error::TooLarge(format!(
                    "the {name} of this problem take {mib} MiB; a buffer of {adapter} holds at most {limit} MiB: use --backend cpu"
                )));
            }
        }
        for (binding, size) in (rows.len()..).zip(scratch_sizes(problem, accelerated)) {
            self.reserve(binding, size, limit);
        }
        for (binding, bytes) in rows.into_iter().enumerate() {
            self.reserve(binding, bytes.len() as u64, limit);
            if let (Some(buffer), false) = (&self.buffers[binding], bytes.is_empty()) {
                self.queue.write_buffer(buffer, 0, bytes);
            }
        }
        Ok(())
    }

    fn reserve(&mut self, binding: usize, size: u64, limit: u64) {
        if self.buffers[binding].as_ref().is_some_and(|b| b.size() >= size.max(16)) {
            return;
        }
        let kind = if binding < shader::UNIFORMS { wgpu::BufferUsages::UNIFORM } else { wgpu::BufferUsages::STORAGE };
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(BINDINGS[binding]),
            // Half as much again, so that a growing pile does not mean a new buffer every step.
            size: (size + size / 2).clamp(size.max(256), limit.max(256)).next_multiple_of(16),
            usage: kind | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        self.buffers[binding] = Some(buffer);
        self.kernels.values_mut().for_each(|k| k.bind_group = None);
    }

    fn compile(&mut self, kernel: Kernel) -> Result<()> {
        if let Some(compiled) = self.kernels.get_mut(&kernel) {
            if compiled.bind_group.is_none() {
                compiled.bind_group = Some(bind(&self.device, &self.buffers, compiled));
            }
            return Ok(());
        }
        let source = shader::source(kernel);
        let constants = shader::constants(kernel);
        let reflected = shader::Reflected::new(&source, kernel.name(), &constants)?;
        let layout = shader::layout(&self.device, &reflected);
        let module = if self.exact {
            exact::shader_module(&self.device, &reflected)?
        } else {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(kernel.name()),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        };
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(kernel.name()),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name()),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(kernel.name()),
            compilation_options: wgpu::PipelineCompilationOptions {
                // In exact mode they are part of the SPIR-V already.
                constants: if self.exact { &[] } else { &constants },
                ..Default::default()
            },
            cache: None,
        });
        let mut compiled = CompiledKernel { pipeline, layout, bindings: reflected.bindings, bind_group: None };
        compiled.bind_group = Some(bind(&self.device, &self.buffers, &compiled));
        self.kernels.insert(kernel, compiled);
        Ok(())
    }

    fn encode(&self, problem: &StepProblem, passes: &[Pass], offsets: &[u32]) -> wgpu::CommandEncoder {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let mut last = None;
        for (pass, &offset) in passes.iter().zip(offsets) {
            let kernel = &self.kernels[&pass.kernel];
            if last != Some(pass.kernel) {
                compute.set_pipeline(&kernel.pipeline);
                last = Some(pass.kernel);
            }
            let dynamic: &[u32] = if kernel.bindings.contains(&PASS_COLORS) { &[offset] } else { &[] };
            compute.set_bind_group(0, kernel.bind_group.as_ref(), dynamic);
            compute.dispatch_workgroups(workgroups(problem, pass), 1, 1);
        }
        drop(compute);
        encoder
    }

    /// Copies what the plan changed back and waits for it.
    fn finish(&mut self, problem: &mut StepProblem, mut encoder: wgpu::CommandEncoder) -> Result<()> {
        let mut changed: [(u32, &mut [u8]); 5] = [
            (shader::BODIES, bytemuck::cast_slice_mut(&mut problem.bodies)),
            (shader::IMPULSES, bytemuck::cast_slice_mut(&mut problem.impulses)),
            (shader::JOINT_IMPULSES, bytemuck::cast_slice_mut(&mut problem.joint_impulses)),
            (shader::CONVERGENCE, bytemuck::bytes_of_mut(&mut problem.convergence)),
            (shader::MOMENTUM, bytemuck::bytes_of_mut(&mut problem.momentum)),
        ];
        let size = changed.iter().map(|(_, rows)| rows.len() as u64).sum::<u64>();
        if self.read_back.as_ref().is_none_or(|b| b.size() < size) {
            self.read_back = Some(self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read back"),
                size: (size + size / 2).next_multiple_of(16),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        let read_back = self.read_back.as_ref().expect("made above");
        let mut at = 0;
        for (binding, rows) in &changed {
            let bytes = rows.len() as u64;
            if let (Some(buffer), true) = (&self.buffers[*binding as usize], bytes > 0) {
                encoder.copy_buffer_to_buffer(buffer, 0, read_back, at, bytes);
                at += bytes;
            }
        }
        self.queue.submit([encoder.finish()]);
        let slice = read_back.slice(..size);
        let (sender, receiver) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
        let lost = |e: &dyn std::fmt::Display| Error::Adapter(format!("the device was lost: {e}"));
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(&e))?;
        self.check_device()?;
        receiver.recv().map_err(|e| lost(&e))?.map_err(|e| lost(&e))?;
        {
            let mapped = slice.get_mapped_range().map_err(|e| lost(&e))?;
            let mut rest = &mapped[..];
            for (_, rows) in &mut changed {
                let (own, others) = rest.split_at(rows.len());
                rows.copy_from_slice(own);
                rest = others;
            }
        }
        read_back.unmap();
        Ok(())
    }

    fn check_device(&self) -> Result<()> {
        match self.device_error.lock().expect("no panic holds it").take() {
            Some(message) => Err(Error::Adapter(format!("{}: {message}", self.summary.name))),
            None => Ok(()),
        }
    }
}

impl Backend for Gpu {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn adapter(&self) -> String {
        format!("{}{}", self.summary, if self.exact { ", exact" } else { "" })
    }

    fn run(&mut self, problem: &mut StepProblem, passes: &[Pass]) -> Result<()> {
        let stride = self.device.limits().min_uniform_buffer_offset_alignment as usize;
        let (pass_colors, offsets) = color_ranges(passes, stride);
        let accelerated = passes.iter().any(|p| matches!(p.kernel, Kernel::Extrapolate { .. }));
        self.upload(problem, &pass_colors, accelerated)?;
        for pass in passes {
            self.compile(pass.kernel)?;
        }
        let encoder = self.encode(problem, passes, &offsets);
        self.finish(problem, encoder)
    }

    fn bytes_transferred(&self, problem: &StepProblem) -> u64 {
        let down = size_of_val(&problem.bodies[..])
            + size_of_val(&problem.impulses[..])
            + size_of_val(&problem.joint_impulses[..])
            + size_of::<ConvergenceRow>()
            + size_of::<MomentumRow>();
        let up = down
            + size_of_val(&problem.masses[..])
            + size_of_val(&problem.inertias[..])
            + size_of_val(&problem.contacts[..])
            + size_of_val(&problem.points[..])
            + size_of_val(&problem.joints[..])
            + size_of_val(&problem.colors[..]);
        (up + down) as u64
    }
}

fn bind(device: &wgpu::Device, buffers: &[Option<wgpu::Buffer>], kernel: &CompiledKernel) -> wgpu::BindGroup {
    let entry = |&binding: &u32| {
        let buffer = buffers[binding as usize].as_ref().expect("every buffer is made before a kernel is bound");
        let size = (binding == PASS_COLORS).then(|| wgpu::BufferSize::new(size_of::<PassColors>() as u64)).flatten();
        let resource = wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size });
        wgpu::BindGroupEntry { binding, resource }
    };
    let entries: Vec<_> = kernel.bindings.iter().map(entry).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &kernel.layout, entries: &entries })
}

/// Bytes of the buffers that stay on the device: all but the first are for accelerated sweeps.
fn scratch_sizes(problem: &StepProblem, accelerated: bool) -> [u64; SCRATCH] {
    let (bodies, impulses) = (problem.bodies.len(), if accelerated { problem.impulse_count() } else { 0 });
    let before = if accelerated { bodies } else { 0 };
    let sums = size_of::<f32>() * impulses.div_ceil(CHUNK);
    [SCRATCH_ROW * bodies, SCRATCH_ROW * before, SCRATCH_ROW * impulses, sums].map(|bytes| bytes as u64)
}

/// The distinct color ranges of the passes, `stride` bytes apart, and where each pass finds its own.
fn color_ranges(passes: &[Pass], stride: usize) -> (Vec<u8>, Vec<u32>) {
    let mut bytes = Vec::new();
    let mut known = HashMap::new();
    let mut place = |pass: &Pass| {
        *known.entry(pass.colors.clone()).or_insert_with(|| {
            let at = bytes.len();
            bytes.resize(at + stride, 0);
            let colors = PassColors { first: pass.colors.start, end: pass.colors.end };
            bytes[at..at + size_of::<PassColors>()].copy_from_slice(bytemuck::bytes_of(&colors));
            at as u32
        })
    };
    let offsets = passes.iter().map(&mut place).collect();
    (bytes, offsets)
}

/// Workgroups of a pass: one for several colors, which it sweeps in turn; else enough for every row, up to the limit of a
/// dispatch, beyond which each thread takes several.
fn workgroups(problem: &StepProblem, pass: &Pass) -> u32 {
    let rows = match pass.kernel {
        Kernel::IntegrateVelocities { .. } | Kernel::IntegratePositions => problem.bodies.len(),
        Kernel::IntegrateGyroscopic => problem.inertias.len(),
        Kernel::ClearImpulses => problem.impulses.len(),
        Kernel::Extrapolate { .. } => problem.bodies.len().max(problem.impulse_count()),
        // A workgroup a chunk.
        Kernel::MeasureStep => problem.impulse_count().div_ceil(CHUNK) * WORKGROUP as usize,
        Kernel::BeginSweep { .. } | Kernel::UpdateMomentum => 1,
        _ if pass.colors.len() > 1 => 1,
        _ => problem.rows_of(&pass.colors).len(),
    };
    (rows as u32).div_ceil(WORKGROUP).clamp(1, 65_535)
}
