//! The GPU backend: the passes of a plan as dispatches of one compute pass in one submission.
//!
//! The programs stay inside the limits that every WebGPU implementation offers: at most 8 storage buffers a program, 64 threads a
//! workgroup, no optional features. Only buffers may be as large as the adapter allows.
//!
//! [`Backend::run`] sends all rows of a problem and reads back all rows that the plan changes. [`Backend::step`] goes on from the
//! rows that the step before left on the device (`resident.rs`): it sends the rows that changed and reads back poses and velocities.
//! The impulses stay on the device until the simulation asks for them.
//!
//! A step is one submission and one read-back. The host waits for the read-back: the next step begins with detection, and
//! detection needs the poses of all bodies.

mod adapter;
pub(crate) mod bindings;
mod buffers;
mod dispatch;
mod one_dispatch;
mod pipelines;
pub(crate) mod reflect;
pub(crate) mod resident;
pub(crate) mod rows;
pub(crate) mod spirv_exact;
mod timer;
pub(crate) mod wgsl;

pub use adapter::{AdapterChoice, AdapterSummary, adapters, open_device, open_for_surface};

use std::sync::{Arc, Mutex};

use super::{Backend, CheckedStep};
use crate::error::{Error, Result};
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::carry::Carry;
use crate::problem::{BodyRow, StepProblem};
use crate::stats::{KernelTime, Traffic};
use bindings::Binding;
use buffers::Buffers;
use dispatch::Dispatch;
use pipelines::Pipelines;
use resident::ResidentRows;
use timer::Timer;

/// Rows that a thread of a software adapter goes over. llvmpipe starts every thread of a workgroup anew, which costs it more than the loop
/// to another row: a step of a settled pile of 1,000 takes 13.1 ms with 1 row a thread and 11.7 ms with 4.
const SOFTWARE_ROWS_A_THREAD: u32 = 4;

/// Follows plans on a device through wgpu.
///
/// ```
/// use drystone::{Backend, Gpu, backend::gpu::{AdapterChoice, adapters}};
///
/// // A machine without an adapter gets one clear line.
/// match Gpu::new(AdapterChoice::Best, false) {
///     Ok(gpu) => assert!(gpu.summary() == &adapters()[0] && !gpu.is_exact() && gpu.cut_as_hardware().name() == "gpu"),
///     Err(refusal) => assert!(refusal.to_string().starts_with("no adapter found")),
/// }
/// ```
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    summary: AdapterSummary,
    exact: bool,
    /// Rows that a thread of a dispatch goes over.
    rows_a_thread: u32,
    pipelines: Pipelines,
    buffers: Buffers,
    timer: Option<Timer>,
    times: Vec<KernelTime>,
    traffic: Traffic,
    /// The rows that the last step left, if the next can go on from them.
    rows: Option<ResidentRows>,
    /// Memory that every step uses again.
    separations: Vec<f32>,
    colors: Vec<u32>,
    systems: Vec<u32>,
    states: Vec<BodyRow>,
    /// First error that the device reported outside a call.
    device_error: Arc<Mutex<Option<String>>>,
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
            pipelines: Pipelines::new(device.clone(), exact),
            buffers: Buffers::new(device.clone(), queue.clone(), summary.name.clone()),
            timer: None,
            device,
            queue,
            rows_a_thread: if summary.hardware { 1 } else { SOFTWARE_ROWS_A_THREAD },
            summary,
            exact,
            times: Vec::new(),
            traffic: Traffic::default(),
            rows: None,
            separations: Vec::new(),
            colors: Vec::new(),
            systems: Vec::new(),
            states: Vec::new(),
            device_error,
        })
    }

    /// What it runs on.
    pub fn summary(&self) -> &AdapterSummary {
        &self.summary
    }

    /// Cuts its work as for hardware, so that a software adapter runs the dispatches that hardware runs.
    pub fn cut_as_hardware(mut self) -> Self {
        self.rows_a_thread = 1;
        self
    }

    /// Whether its results are the reference's to the last bit.
    pub fn is_exact(&self) -> bool {
        self.exact
    }

    /// Sends every row, also those that the device has.
    fn send_all(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        self.check(problem, passes)?;
        for (binding, _) in rows::small(problem, &[], &[]) {
            self.buffers.note(binding, &[]);
        }
        self.update_small_rows(problem);
        for (binding, bytes) in rows::of_contacts(problem) {
            self.buffers.send(binding, bytes);
        }
        Ok(())
    }

    /// Sends the small rows that the device does not have yet.
    fn update_small_rows(&mut self, problem: &StepProblem) {
        // One buffer holds where each color begins, and then the rows of the colors.
        let shift = problem.colors.len() as u32;
        self.colors.clear();
        self.colors.extend(problem.colors.iter().map(|begin| begin + shift));
        self.colors.extend_from_slice(&problem.order);
        rows::pack_systems(problem, &mut self.systems);
        for (binding, bytes) in rows::small(problem, &self.colors, &self.systems) {
            self.buffers.update(binding, bytes);
        }
        if !problem.turning.is_empty() {
            // This step turns those on the device.
            self.buffers.note(Binding::Masses, &[]);
        }
    }

    /// Refuses a problem that is too large, before any row is sent. Makes room for the buffers that stay on the device.
    fn check(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        for (binding, bytes) in rows::small(problem, &[], &[]).into_iter().chain(rows::of_contacts(problem)) {
            self.buffers.check(binding, bytes.len())?;
        }
        self.buffers.check(Binding::Colors, size_of::<u32>() * (problem.colors.len() + problem.order.len()))?;
        let accelerated = passes.iter().any(|p| matches!(p.kernel, Kernel::Extrapolate { .. }));
        for (binding, size) in rows::scratch_sizes(problem, accelerated) {
            self.buffers.check(binding, size)?;
            self.buffers.reserve(binding, size);
        }
        Ok(())
    }

    /// The dispatches `first`, then the passes, ready for submission. With `together` the passes of a small world are one dispatch.
    fn encoded(
        &mut self,
        problem: &StepProblem,
        first: Vec<Dispatch>,
        passes: &[Pass],
        together: bool,
    ) -> Result<wgpu::CommandEncoder> {
        let mut all = first;
        let stride = self.device.limits().min_uniform_buffer_offset_alignment as usize;
        // The timer measures each kernel by itself.
        match one_dispatch::of(problem, passes).filter(|_| together && self.timer.is_none()) {
            Some((program, table)) => {
                self.buffers.update(Binding::Passes, bytemuck::cast_slice(&table));
                let (_, rows) = dispatch::of_passes(problem, &passes[..1], stride);
                self.buffers.update(Binding::PassRow, &rows);
                all.push(Dispatch::over(program, 1));
            }
            None => {
                let (dispatches, rows) = dispatch::of_passes(problem, passes, stride);
                self.buffers.update(Binding::PassRow, &rows);
                all.extend(dispatches);
            }
        }
        self.traffic.dispatches = all.len();
        for dispatch in &all {
            self.pipelines.prepare(&dispatch.program, &self.buffers)?;
        }
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        dispatch::encode(&mut encoder, &all, &self.pipelines, self.rows_a_thread, self.timer.as_mut());
        Ok(encoder)
    }

    /// Adds the bytes that kernels moved to their times.
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

    /// Submits, waits, and reads the `wanted` rows back.
    fn finish(&mut self, mut encoder: wgpu::CommandEncoder, wanted: &mut [(Binding, &mut [u8])]) -> Result<()> {
        let times = self.timer.as_ref().and_then(|timer| timer.resolve(&mut encoder));
        let read = self.buffers.read_back(encoder, wanted, times);
        if let Some(message) = self.device_error.lock().expect("no panic holds it").take() {
            return Err(Error::Adapter(format!("{}: {message}", self.summary.name)));
        }
        let ticks = read?;
        self.times = self.timer.as_mut().map(|timer| timer.times(&ticks)).unwrap_or_default();
        let down = wanted.iter().map(|(_, rows)| rows.len() as u64).sum();
        self.traffic = Traffic { up: self.buffers.take_sent(), down, ..self.traffic };
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
        let [mut impulses, mut totals] = [&mut problem.impulses, &mut problem.totals].map(std::mem::take);
        let mut wanted = rows::moved(problem);
        wanted.push((Binding::Impulses, bytemuck::cast_slice_mut(&mut impulses)));
        wanted.push((Binding::Totals, bytemuck::cast_slice_mut(&mut totals)));
        let finished = self.finish(encoder, &mut wanted);
        (problem.impulses, problem.totals) = (impulses, totals);
        finished
    }

    fn step(&mut self, step: CheckedStep, carry: &Carry) -> Result<()> {
        let (problem, passes) = step.into_parts();
        let before = self.rows.take().filter(|_| carry.on_device);
        let goes_on = before.is_some();
        let first = match before {
            Some(before) => {
                self.check(problem, passes)?;
                self.update_small_rows(problem);
                resident::begin(&mut self.buffers, problem, carry, before, &mut self.separations)?
            }
            None => {
                self.send_all(problem, passes)?;
                Vec::new()
            }
        };
        let encoder = self.encoded(problem, first, passes, true)?;
        let (mut sags, mut totals) = (std::mem::take(&mut problem.sags), std::mem::take(&mut problem.totals));
        let mut wanted = rows::moved(problem);
        wanted.push((Binding::Totals, bytemuck::cast_slice_mut(&mut totals)));
        // Else the host computed them.
        if goes_on && !sags.is_empty() {
            wanted.push((Binding::Sags, bytemuck::cast_slice_mut(&mut sags)));
        }
        let finished = self.finish(encoder, &mut wanted);
        (problem.sags, problem.totals) = (sags, totals);
        finished?;
        self.count_bytes(problem, passes);
        for (binding, bytes) in rows::moved(problem) {
            self.buffers.note(binding, bytes);
        }
        // The next step begins with begin_bodies.
        self.states.clear();
        self.states.extend(problem.bodies.iter().map(|b| BodyRow { v: b.v, w: b.w, ..BodyRow::AT_REST }));
        self.buffers.note(Binding::Bodies, bytemuck::cast_slice(&self.states));
        self.rows = Some(ResidentRows::of(problem));
        Ok(())
    }

    fn keeps_rows(&self) -> bool {
        self.rows.is_some()
    }

    fn fetch(&mut self, problem: &mut StepProblem) -> Result<()> {
        let Some(mut rows) = self.rows.filter(|rows| !rows.fetched) else { return Ok(()) };
        self.timer.iter_mut().for_each(Timer::begin);
        let encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let StepProblem { contacts, impulses, .. } = &mut *problem;
        let mut wanted = [
            (Binding::Impulses, bytemuck::cast_slice_mut::<_, u8>(impulses)),
            (Binding::Contacts, bytemuck::cast_slice_mut(contacts)),
        ];
        self.finish(encoder, &mut wanted)?;
        rows.fetched = true;
        self.rows = Some(rows);
        Ok(())
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn time_kernels(&mut self) -> Result<Option<f64>> {
        let bandwidth = timer::copy_bandwidth(&self.device, &self.queue)?;
        self.timer = Timer::new(&self.device, &self.queue);
        Ok(self.timer.as_ref().map(|_| bandwidth))
    }

    fn kernel_times(&self) -> &[KernelTime] {
        &self.times
    }
}
