//! The GPU backend: the passes of a plan as dispatches of one compute pass in one submission.
//!
//! Stays inside the limits that every WebGPU implementation offers (at most 8 storage buffers a kernel, 64 threads a
//! workgroup, no optional features), except for the size of buffers, which are asked for as large as the adapter has them.
//!
//! [`Backend::run`] takes a problem as a value: everything is sent, and everything that the plan changes comes back.
//! [`Backend::step`] goes on from the rows that the step before left on the device (`carry.rs`): what changed is sent, poses and
//! velocities come back, and the impulses stay until somebody asks.
//!
//! A step is one submission and one read-back, and is waited for: detection, with which the next step begins, asks for the
//! poses of all bodies, so that nothing is left to be done meanwhile.

mod adapter;
mod buffers;
pub(crate) mod carry;
mod exact;
mod programs;
mod read_back;
pub(crate) mod shader;
mod timer;
mod whole;

pub use adapter::{AdapterChoice, AdapterSummary, adapters, open_for_surface};

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::{Backend, CheckedStep};
use crate::error::{Error, Result};
use crate::kernels::momentum::{CHUNK, StepLength};
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::carry::Carry;
use crate::problem::{BodyRow, PassColors, StepProblem};
use crate::stats::{KernelTime, Traffic};
use buffers::Buffers;
use carry::Rows;
use programs::Programs;
use read_back::ReadBack;
use shader::{BINDINGS, Program, SCRATCH, SCRATCH_ROW, WORKGROUP};
use timer::Timer;

/// Opens the adapter that `choice` finds, for drawing.
///
/// # Errors
/// No such adapter, or it cannot be opened.
pub fn open_device(choice: AdapterChoice) -> Result<(wgpu::Device, wgpu::Queue, AdapterSummary)> {
    let (adapter, summary) = adapter::find(choice)?;
    let (device, queue) = adapter::open(&adapter, false)?;
    Ok((device, queue, summary))
}

/// Follows plans on a device through wgpu.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    summary: AdapterSummary,
    exact: bool,
    programs: Programs,
    buffers: Buffers,
    read_back: ReadBack,
    timer: Option<Timer>,
    times: Vec<KernelTime>,
    traffic: Traffic,
    /// What the last step left, if the next can go on from it.
    rows: Option<Rows>,
    /// Memory that is used again.
    separations: Vec<f32>,
    colors: Vec<u32>,
    states: Vec<BodyRow>,
    /// First error that the device reported outside a call.
    device_error: Arc<Mutex<Option<String>>>,
}

/// A program, how many workgroups run it, and where the colors stand that it goes over.
struct Dispatch {
    program: Program,
    workgroups: u32,
    colors: u32,
}

impl Dispatch {
    /// Enough workgroups for every row, up to the limit of a dispatch, beyond which each thread takes several.
    fn over(program: Program, rows: usize) -> Self {
        Self { program, workgroups: (rows as u32).div_ceil(WORKGROUP).clamp(1, 65_535), colors: 0 }
    }
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
            programs: Programs::new(device.clone(), exact),
            buffers: Buffers::new(device.clone(), queue.clone(), summary.name.clone()),
            timer: None,
            read_back: ReadBack::new(device.clone(), queue.clone()),
            device,
            queue,
            summary,
            exact,
            times: Vec::new(),
            traffic: Traffic::default(),
            rows: None,
            separations: Vec::new(),
            colors: Vec::new(),
            states: Vec::new(),
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

    /// Sends every row, whatever the device has.
    fn send_all(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        self.check(problem, passes)?;
        for (binding, _) in small_rows_of(problem, &[]) {
            self.buffers.note(binding, &[]);
        }
        self.update_small_rows(problem);
        for (binding, bytes) in contact_rows_of(problem) {
            self.buffers.send(binding, bytes);
        }
        Ok(())
    }

    /// Sends those of the small rows that the device does not have yet.
    fn update_small_rows(&mut self, problem: &StepProblem) {
        // Colors begin in the same buffer, after themselves.
        let shift = problem.colors.len() as u32;
        self.colors.clear();
        self.colors.extend(problem.colors.iter().map(|begin| begin + shift));
        self.colors.extend_from_slice(&problem.order);
        for (binding, bytes) in small_rows_of(problem, &self.colors) {
            self.buffers.update(binding, bytes);
        }
    }

    /// Refuses a problem that is too large, before anything of it is sent.
    fn check(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        for (binding, bytes) in small_rows_of(problem, &[]).into_iter().chain(contact_rows_of(problem)) {
            self.buffers.check(binding, bytes.len())?;
        }
        self.buffers.check(shader::COLORS, size_of::<u32>() * (problem.colors.len() + problem.order.len()))?;
        let accelerated = passes.iter().any(|p| matches!(p.kernel, Kernel::Extrapolate { .. }));
        for (binding, size) in ((BINDINGS.len() - SCRATCH) as u32..).zip(scratch_sizes(problem, accelerated)) {
            self.buffers.check(binding, size)?;
            self.buffers.reserve(binding, size);
        }
        Ok(())
    }

    /// Some programs and then the passes, ready to be submitted; the passes of a small world `together`, in one dispatch.
    fn encoded(
        &mut self,
        problem: &StepProblem,
        first: Vec<Dispatch>,
        passes: &[Pass],
        together: bool,
    ) -> Result<wgpu::CommandEncoder> {
        let mut all = first;
        // Apart where each kernel is to be timed.
        match whole::of(problem, passes).filter(|_| together && self.timer.is_none()) {
            Some((program, passes)) => {
                self.buffers.update(shader::PASSES, bytemuck::cast_slice(&passes));
                all.push(Dispatch::over(program, 1));
            }
            None => {
                let stride = self.device.limits().min_uniform_buffer_offset_alignment as usize;
                let (pass_colors, offsets) = color_ranges(passes, stride);
                self.buffers.update(shader::PASS_COLORS, &pass_colors);
                let of_pass = |(pass, &colors): (&Pass, &u32)| Dispatch { colors, ..dispatch_of(problem, pass) };
                all.extend(passes.iter().zip(&offsets).map(of_pass));
            }
        }
        self.traffic.dispatches = all.len();
        for dispatch in &all {
            self.programs.prepare(&dispatch.program, &self.buffers)?;
        }
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode(&mut encoder, &all);
        Ok(encoder)
    }

    /// Adds to the times of the kernels what they moved.
    fn count_bytes(&mut self, problem: &StepProblem, passes: &[Pass]) {
        if self.times.is_empty() {
            return;
        }
        let plan = StepPlan { passes: passes.to_vec() };
        let bytes: Vec<u64> = plan.bytes_of_passes(problem).collect();
        for time in &mut self.times {
            let own = passes.iter().zip(&bytes).filter(|(pass, _)| pass.kernel.name() == time.kernel);
            time.bytes = own.map(|(_, bytes)| bytes).sum();
        }
    }

    /// Bytes a second that the device reads and writes when it copies a large buffer: the limit of every sweep.
    ///
    /// # Errors
    /// The device is lost.
    pub fn copy_bandwidth(&mut self) -> Result<f64> {
        // Larger than caches are, where the adapter has such buffers.
        let size = (self.device.limits().max_storage_buffer_binding_size).min(256 << 20);
        let buffer = || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("bandwidth"),
                size,
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let (from, to) = (buffer(), buffer());
        let mut seconds = |copies: u32| -> Result<f64> {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            (0..copies).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size));
            let start = std::time::Instant::now();
            self.finish(encoder, &mut [])?;
            Ok(start.elapsed().as_secs_f64())
        };
        // The difference leaves out what a submission costs.
        seconds(1)?;
        let (few, many) = (seconds(2)?, seconds(10)?);
        Ok(2.0 * 8.0 * size as f64 / (many - few).max(1e-9))
    }

    fn encode(&mut self, encoder: &mut wgpu::CommandEncoder, all: &[Dispatch]) {
        let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        self.timer.iter_mut().for_each(Timer::begin);
        for run in all.chunk_by(|a, b| a.program == b.program) {
            if let Some(timer) = &mut self.timer {
                timer.before(&mut compute, &run[0].program);
            }
            let compiled = self.programs.get(&run[0].program);
            compute.set_pipeline(&compiled.pipeline);
            for dispatch in run {
                let offsets: &[u32] = if compiled.has_colors() { &[dispatch.colors] } else { &[] };
                compute.set_bind_group(0, &compiled.bind_group, offsets);
                compute.dispatch_workgroups(dispatch.workgroups, 1, 1);
            }
        }
        if let Some(timer) = &mut self.timer {
            timer.end(&mut compute);
        }
    }

    /// Submits, brings the `wanted` rows back, and waits for it.
    fn finish(&mut self, mut encoder: wgpu::CommandEncoder, wanted: &mut [(u32, &mut [u8])]) -> Result<()> {
        let times = self.timer.as_ref().and_then(|timer| timer.resolve(&mut encoder));
        let read = self.read_back.submit(encoder, &self.buffers, wanted, times);
        if let Some(message) = self.device_error.lock().expect("no panic holds it").take() {
            return Err(Error::Adapter(format!("{}: {message}", self.summary.name)));
        }
        let ticks = read.map_err(|e| Error::Adapter(format!("the device was lost: {e}")))?;
        self.times = self.timer.as_mut().map(|timer| timer.times(&ticks)).unwrap_or_default();
        let down = wanted.iter().map(|(_, rows)| rows.len() as u64).sum();
        self.traffic = Traffic { up: self.buffers.take_sent(), down, ..self.traffic };
        Ok(())
    }

    /// Runs a step whose rows stay on the device, and brings back what moved.
    fn follow(&mut self, problem: &mut StepProblem, passes: &[Pass], carry: &Carry) -> Result<()> {
        let first = match self.rows.take().filter(|_| carry.on_device) {
            Some(before) => {
                self.check(problem, passes)?;
                self.carry_over(problem, carry, before)?
            }
            None => {
                self.send_all(problem, passes)?;
                Vec::new()
            }
        };
        let encoder = self.encoded(problem, first, passes, true)?;
        self.finish(encoder, &mut moved_rows_of(problem))?;
        self.count_bytes(problem, passes);
        for (binding, bytes) in moved_rows_of(problem) {
            self.buffers.note(binding, bytes);
        }
        // The next step begins with begin_bodies.
        self.states.clear();
        self.states.extend(problem.bodies.iter().map(|b| BodyRow { v: b.v, w: b.w, ..BodyRow::AT_REST }));
        self.buffers.note(shader::BODIES, bytemuck::cast_slice(&self.states));
        self.rows = Some(Rows::of(problem));
        Ok(())
    }
}

impl Backend for Gpu {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn adapter(&self) -> String {
        format!("{}{}", self.summary, if self.exact { ", exact" } else { "" })
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        self.rows = None;
        self.send_all(problem, passes)?;
        let encoder = self.encoded(problem, Vec::new(), passes, false)?;
        let mut impulses = std::mem::take(&mut problem.impulses);
        let mut wanted = moved_rows_of(problem);
        wanted.push((shader::IMPULSES, bytemuck::cast_slice_mut(&mut impulses)));
        let finished = self.finish(encoder, &mut wanted);
        problem.impulses = impulses;
        finished
    }

    fn step(&mut self, step: CheckedStep, carry: &Carry) -> Result<()> {
        let (problem, passes) = step.into_parts();
        self.follow(problem, passes, carry)
    }

    fn keeps_rows(&self) -> bool {
        self.rows.is_some()
    }

    fn fetch(&mut self, problem: &mut StepProblem) -> Result<()> {
        match self.rows {
            Some(rows) if !rows.fetched => self.fetch_rows(problem, rows),
            _ => Ok(()),
        }
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn time_kernels(&mut self) -> Result<Option<f64>> {
        let bandwidth = self.copy_bandwidth()?;
        self.timer = Timer::new(&self.device, &self.queue);
        Ok(self.timer.as_ref().map(|_| bandwidth))
    }

    fn kernel_times(&self) -> &[KernelTime] {
        &self.times
    }
}

/// Rows of which a step changes little.
fn small_rows_of<'a>(problem: &'a StepProblem, colors: &'a [u32]) -> [(u32, &'a [u8]); 9] {
    [
        (shader::PARAMS, bytemuck::bytes_of(&problem.params)),
        (shader::BODIES, bytemuck::cast_slice(&problem.bodies)),
        (shader::MASSES, bytemuck::cast_slice(&problem.masses)),
        (shader::INERTIAS, bytemuck::cast_slice(&problem.inertias)),
        (shader::COLORS, bytemuck::cast_slice(colors)),
        (shader::JOINTS, bytemuck::cast_slice(&problem.joints)),
        (shader::JOINT_IMPULSES, bytemuck::cast_slice(&problem.joint_impulses)),
        (shader::CONVERGENCE, bytemuck::bytes_of(&problem.convergence)),
        (shader::MOMENTUM, bytemuck::bytes_of(&problem.momentum)),
    ]
}

/// Rows that follow the contacts: most of a problem.
fn contact_rows_of(problem: &StepProblem) -> [(u32, &[u8]); 3] {
    [
        (shader::CONTACTS, bytemuck::cast_slice(&problem.contacts)),
        (shader::POINTS, bytemuck::cast_slice(&problem.points)),
        (shader::IMPULSES, bytemuck::cast_slice(&problem.impulses)),
    ]
}

/// Rows that the processor asks for after every step.
fn moved_rows_of(problem: &mut StepProblem) -> Vec<(u32, &mut [u8])> {
    vec![
        (shader::BODIES, bytemuck::cast_slice_mut(&mut problem.bodies)),
        (shader::JOINT_IMPULSES, bytemuck::cast_slice_mut(&mut problem.joint_impulses)),
        (shader::CONVERGENCE, bytemuck::bytes_of_mut(&mut problem.convergence)),
        (shader::MOMENTUM, bytemuck::bytes_of_mut(&mut problem.momentum)),
    ]
}

/// Bytes of the buffers that stay on the device: all but the first are for accelerated sweeps.
fn scratch_sizes(problem: &StepProblem, accelerated: bool) -> [usize; SCRATCH] {
    let (bodies, impulses) = (problem.bodies.len(), if accelerated { problem.impulse_count() } else { 0 });
    let before = if accelerated { bodies } else { 0 };
    let sums = size_of::<StepLength<f32>>() * impulses.div_ceil(CHUNK);
    [SCRATCH_ROW * bodies, SCRATCH_ROW * before, SCRATCH_ROW * impulses, sums]
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

/// One workgroup sweeps several colors, one after another; else there are enough for every row.
fn dispatch_of(problem: &StepProblem, pass: &Pass) -> Dispatch {
    let rows = match pass.kernel {
        Kernel::IntegrateVelocities { .. } | Kernel::IntegratePositions => problem.bodies.len(),
        Kernel::IntegrateGyroscopic => problem.inertias.len(),
        Kernel::ClearImpulses => problem.rows_of(&pass.colors).len(),
        Kernel::Extrapolate { .. } => problem.bodies.len().max(problem.impulse_count()),
        // A workgroup a chunk.
        Kernel::MeasureStep => problem.impulse_count().div_ceil(CHUNK) * WORKGROUP as usize,
        Kernel::BeginSweep { .. } | Kernel::UpdateMomentum => 1,
        _ if pass.colors.len() > 1 => 1,
        _ => problem.rows_of(&pass.colors).len(),
    };
    Dispatch::over(Program::Pass(pass.kernel), rows)
}
