//! Measures the time of each program by the clock of the device, if the device can write timestamps inside a pass, and
//! the bandwidth of copies.
//!
//! A backend has a timer only on request: the software adapter ends its work at every timestamp, and a step of a tower
//! of ten took 2.6 times as long with timestamps.

use std::time::Duration;

use super::submissions::Submissions;
use super::wgsl::Program;
use crate::error::Result;
use crate::stats::{KernelTime, Stopwatch};

/// Adapter features that a timer needs.
pub(super) const FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);

/// Largest number of timed program runs in one submission: one less than the largest number of queries in a set.
const MOST: u32 = 4095;

/// The name for the time between two submissions.
const PAUSE: &str = "";

/// Timestamps of one step.
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// Length of a tick (ns).
    period: f32,
    /// Name of the program for each run.
    runs: Vec<&'static str>,
}

impl Timer {
    /// Returns `None` if the device has no such clock.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(FEATURES) {
            return None;
        }
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: MOST + 1,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: u64::from(MOST + 1) * wgpu::QUERY_SIZE as u64,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { queries, resolved, period: queue.get_timestamp_period(), runs: Vec::new() })
    }

    /// Discards the times of the last step.
    pub fn begin(&mut self) {
        self.runs.clear();
    }

    /// Records the time before a run of `program`. If a submission has more runs than there are queries, only the first
    /// runs are timed.
    pub fn before(&mut self, pass: &mut wgpu::ComputePass, program: &Program) {
        if self.runs.len() < MOST as usize {
            pass.write_timestamp(&self.queries, self.runs.len() as u32);
            self.runs.push(program.name());
        }
    }

    /// Records the time after the last run of a submission. The time from then to the next submission counts for no
    /// kernel.
    pub fn end(&mut self, pass: &mut wgpu::ComputePass) {
        pass.write_timestamp(&self.queries, self.runs.len() as u32);
        if self.runs.len() < MOST as usize {
            self.runs.push(PAUSE);
        }
    }

    /// Writes the times to a buffer for copying. Returns the buffer and its size (B).
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) -> Option<(&wgpu::Buffer, u64)> {
        if self.runs.is_empty() {
            return None;
        }
        // The last run is a pause without an end time.
        let count = self.runs.len() as u32;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        Some((&self.resolved, u64::from(count) * wgpu::QUERY_SIZE as u64))
    }

    /// Time of each program from the ticks, in the order of the first runs.
    pub fn times(&self, ticks: &[u64]) -> Vec<KernelTime> {
        let mut times: Vec<KernelTime> = Vec::new();
        for (&kernel, ticks) in self.runs.iter().zip(ticks.windows(2)).filter(|(kernel, _)| **kernel != PAUSE) {
            let nanoseconds = ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.period);
            let time = Duration::from_nanos(nanoseconds as u64);
            match times.iter_mut().find(|t| t.kernel == kernel) {
                Some(known) => known.time += time,
                None => times.push(KernelTime { kernel, time, bytes: 0 }),
            }
        }
        times
    }
}

/// Copies a buffer: the kernel with the most bytes for its arithmetic.
const COPY: &str = "
@group(0) @binding(0) var<storage, read> rows: array<vec4u>;
@group(0) @binding(1) var<storage, read_write> copies: array<vec4u>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < arrayLength(&rows); i += groups.x * 64u) { copies[i] = rows[i]; }
}";
/// Workgroups of a copy: more threads than a large GPU runs at a time.
const COPY_GROUPS: u32 = 4096;

/// Least time of all copies (s), and their largest number.
const LEAST_COPYING: f64 = 0.05;
const MAX_COPIES: u32 = 2048;

/// Bytes per second that a kernel reads and writes when it copies a large buffer. It bounds the speed of every sweep. The
/// copy command would not do: on an NVIDIA H200 it reaches 0.85 TB/s, less than some kernels.
///
/// # Errors
/// The device is lost.
pub(super) async fn copy_bandwidth(device: &wgpu::Device, submissions: &mut Submissions) -> Result<f64> {
    // Larger than caches, if the adapter has such buffers.
    let size = device.limits().max_storage_buffer_binding_size.min(256 << 20);
    let [rows, copies] = ["rows", "copies"].map(|name| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("copy"),
        source: wgpu::ShaderSource::Wgsl(COPY.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("copy"),
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: rows.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: copies.as_entire_binding() },
        ],
    });
    let mut seconds = async |count: u32| -> Result<f64> {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        (0..count).for_each(|_| pass.dispatch_workgroups(COPY_GROUPS, 1, 1));
        drop(pass);
        let start = Stopwatch::start();
        submissions.submit(encoder);
        submissions.wait(0).await?;
        Ok(start.elapsed().as_secs_f64())
    };
    // The first copy touches the memory. The difference of two times removes the fixed cost of a submission. Short runs
    // measure a GPU whose clock still rises.
    seconds(1).await?;
    let mut count = 8;
    loop {
        let copying = seconds(1 + count).await? - seconds(1).await?;
        if copying > LEAST_COPYING || count >= MAX_COPIES {
            return Ok(2.0 * f64::from(count) * size as f64 / copying.max(1e-9));
        }
        count *= 4;
    }
}
