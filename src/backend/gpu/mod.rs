//! The GPU backend: the passes of a plan become dispatches of one compute pass in one submission.
//!
//! The programs stay within the limits of every WebGPU implementation: at most 8 storage buffers a program, 64 threads
//! a workgroup, no optional features. Only buffers can be as large as the adapter allows.
//!
//! [`Backend::run`] sends all rows of a problem and reads back all rows that the plan changes. [`Backend::step`]
//! continues from the rows of the previous step on the device (`resident.rs`): it sends changed rows and reads back
//! poses, velocities and impulses. A step ends when all its results are on the host. If a device is lost, no state is
//! lost: a failed step leaves the problem unchanged, and another device or the processor repeats it.
//!
//! A step is one submission and one read-back. Hardware gets the submission in parts, and begins while the host encodes
//! the rest. If one submission would hold the device too long, the host waits between several (`submissions.rs`). The host waits for the read-back: the next step begins with detection, and detection needs the
//! poses of all bodies.

mod adapter;
pub(crate) mod bindings;
pub(crate) mod blocking;
mod buffers;
mod dispatch;
mod kept;
mod one_dispatch;
mod options;
mod pipelines;
pub(crate) mod reflect;
pub(crate) mod resident;
pub(crate) mod rows;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod spirv_exact;
mod submissions;
mod timer;
pub(crate) mod wgsl;
pub(crate) mod wgsl_exact;

pub use adapter::{AdapterChoice, AdapterSummary, adapters, adapters_async, open_device, open_for_surface};
pub use options::{Faults, GpuOptions, Loss};

use rayon::prelude::*;

use super::cpu::Cpu;
use super::{Backend, CheckedStep, Running};
use crate::collide::MAX_POINTS;
use crate::error::Result;
use crate::plan::{Kernel, Pass, StepPlan};
use crate::problem::carry::Carry;
use crate::problem::{BodyRow, StepProblem};
use crate::stats::{KernelTime, Traffic};
use bindings::Binding;
use blocking::block_on;
use buffers::Buffers;
use dispatch::Dispatch;
use pipelines::{Pipelines, Shaders};
use resident::ResidentRows;
use submissions::{ROWS_OF_A_DISPATCH, Submissions};
use timer::Timer;
use wgsl::Target;

/// Largest number of devices in one run. After that many losses the processor continues.
const MAX_DEVICES: usize = 3;

/// Runs plans on a device through wgpu.
///
/// ```
/// use drystone::{Backend, Gpu, backend::gpu::{AdapterChoice, GpuOptions, adapters}};
///
/// // A machine without an adapter gets one clear line.
/// match Gpu::open(GpuOptions { adapter: AdapterChoice::Best, ..GpuOptions::default() }) {
///     Ok(gpu) => assert!(gpu.summary() == &adapters()[0] && !gpu.is_exact() && gpu.cut_as_hardware().name() == "gpu"),
///     Err(refusal) => assert!(refusal.to_string().starts_with("no adapter found")),
/// }
/// ```
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    summary: AdapterSummary,
    options: GpuOptions,
    /// Number of devices that were lost before this one.
    lost: usize,
    /// The kind of adapter for which programs are written.
    target: Target,
    pipelines: Pipelines,
    buffers: Buffers,
    submissions: Submissions,
    timer: Option<Timer>,
    times: Vec<KernelTime>,
    traffic: Traffic,
    /// The rows of the last step, if the next step can continue from them.
    rows: Option<ResidentRows>,
    /// Reusable memory of a step.
    separations: Vec<[f32; MAX_POINTS]>,
    colors: Vec<u32>,
    systems: Vec<u32>,
}

impl Gpu {
    /// Opens the adapter of `choice`. With `exact`, no driver can reassociate the arithmetic of shaders
    /// ([`GpuOptions::exact`]), so that results equal the reference to the last bit.
    ///
    /// ```no_run
    /// use drystone::{Gpu, backend::gpu::AdapterChoice};
    ///
    /// assert!(Gpu::new(AdapterChoice::Best, true)?.is_exact());
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is no such adapter, or it cannot be opened.
    pub fn new(choice: AdapterChoice, exact: bool) -> Result<Self> {
        Self::open(GpuOptions { adapter: choice, exact, ..GpuOptions::default() })
    }

    /// Opens an adapter with `options`. This call blocks the thread; a web page uses [`Gpu::open_async`].
    ///
    /// # Errors
    /// Those of [`Gpu::new`].
    pub fn open(options: GpuOptions) -> Result<Self> {
        block_on(Self::open_async(options))
    }

    /// Like [`Gpu::open`], for a web page: other tasks continue meanwhile.
    ///
    /// ```no_run
    /// use drystone::backend::gpu::GpuOptions;
    /// use drystone::{Gpu, Simulation, SolverConfig};
    /// use drystone_scenes::Scene;
    ///
    /// # async fn page() -> drystone::Result<()> {
    /// let gpu = Gpu::open_async(GpuOptions::default()).await?;
    /// let scene = Scene::find("pile", &["n=1000".into()])?;
    /// let mut simulation = Simulation::with(scene.world, SolverConfig::default(), Box::new(gpu))?;
    /// simulation.step_async(scene.dt).await?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`Gpu::new`].
    pub async fn open_async(options: GpuOptions) -> Result<Self> {
        Self::open_after(0, options).await
    }

    /// Opens an adapter after `lost` devices were lost.
    async fn open_after(lost: usize, options: GpuOptions) -> Result<Self> {
        let Faults { shader, losses } = &options.faults;
        let (adapter, summary) = adapter::find(options.adapter, &options.name).await?;
        let loss = losses.get(lost).copied();
        let by_spirv = options.exact && summary.takes_spirv && !options.guarded;
        let shaders = match options.exact {
            #[cfg(not(target_family = "wasm"))]
            true if by_spirv => Shaders::Spirv(spirv_exact::knows_float_controls(&adapter)),
            true => Shaders::Guarded,
            false => Shaders::Plain,
        };
        let (device, queue) = adapter::open(&adapter, by_spirv).await?;
        let name = || summary.name.clone();
        Ok(Self {
            pipelines: Pipelines::new(device.clone(), shaders, *shader, options.cache.as_deref()),
            buffers: Buffers::new(device.clone(), queue.clone(), name(), [options.buffer_limit, options.memory]),
            submissions: Submissions::new(device.clone(), queue.clone(), name(), options.submission, loss),
            timer: None,
            device,
            queue,
            target: if summary.hardware { Target::Hardware } else { Target::Software },
            summary,
            options,
            lost,
            times: Vec::new(),
            traffic: Traffic::default(),
            rows: None,
            separations: Vec::new(),
            colors: Vec::new(),
            systems: Vec::new(),
        })
    }

    /// The adapter.
    pub fn summary(&self) -> &AdapterSummary {
        &self.summary
    }

    /// Writes programs as for hardware, so that a software adapter runs the programs and dispatches of a hardware
    /// adapter.
    pub fn cut_as_hardware(mut self) -> Self {
        self.target = Target::Hardware;
        self
    }

    /// Whether its results equal the reference to the last bit.
    pub fn is_exact(&self) -> bool {
        self.options.exact
    }

    /// Sends every row, even rows that the device already has.
    fn send_all(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        self.check(problem, passes)?;
        for (binding, _) in rows::small(problem, &[], &[]) {
            self.buffers.note(binding, &[]);
        }
        self.update_small_rows(problem)?;
        rows::of_contacts(problem).into_iter().try_for_each(|(binding, bytes)| self.buffers.send(binding, bytes))
    }

    /// Sends small rows that the device does not have yet.
    fn update_small_rows(&mut self, problem: &StepProblem) -> Result<()> {
        // One buffer holds the start of each color, and then the rows of the colors.
        let shift = problem.colors.len() as u32;
        self.colors.clear();
        self.colors.extend(problem.colors.iter().map(|begin| begin + shift));
        self.colors.extend_from_slice(&problem.order);
        rows::pack_systems(problem, &mut self.systems);
        for (binding, bytes) in rows::small(problem, &self.colors, &self.systems) {
            self.buffers.update(binding, bytes)?;
        }
        if !problem.turning.is_empty() {
            // This step rotates those on the device.
            self.buffers.note(Binding::Masses, &[]);
        }
        Ok(())
    }

    /// Refuses a problem that is too large before it sends any row. Makes room for the buffers that stay on the device.
    fn check(&mut self, problem: &StepProblem, passes: &[Pass]) -> Result<()> {
        for (binding, bytes) in rows::small(problem, &[], &[]).into_iter().chain(rows::of_contacts(problem)) {
            self.buffers.check(binding, bytes.len())?;
        }
        self.buffers.check(Binding::Colors, size_of::<u32>() * (problem.colors.len() + problem.order.len()))?;
        let accelerated = passes.iter().any(|p| matches!(p.kernel, Kernel::Extrapolate { .. }));
        for (binding, size) in rows::scratch_sizes(problem, accelerated) {
            self.buffers.check(binding, size)?;
            self.buffers.reserve(binding, size)?;
        }
        Ok(())
    }

    /// Encodes the dispatches `first`, then the passes. Returns them ready for submission with their number of rows.
    /// With `together`, the passes of a small world are one dispatch. If a plan would hold the device too long, this
    /// call submits all but the last part.
    async fn encoded(
        &mut self,
        problem: &StepProblem,
        first: Vec<Dispatch>,
        passes: &[Pass],
        together: bool,
    ) -> Result<(wgpu::CommandEncoder, usize)> {
        let mut all = first;
        let stride = self.device.limits().min_uniform_buffer_offset_alignment as usize;
        // The timer measures each kernel separately. One dispatch cannot be divided, unlike a long plan.
        let work = passes.len() * ROWS_OF_A_DISPATCH;
        let together = together && self.timer.is_none() && work <= self.submissions.room();
        match one_dispatch::of(problem, passes, self.target).filter(|_| together) {
            Some((program, table)) => {
                self.buffers.update(Binding::Passes, bytemuck::cast_slice(&table))?;
                let (_, rows) = dispatch::of_passes(problem, &passes[..1], self.target, stride);
                self.buffers.update(Binding::PassRow, &rows)?;
                all.push(Dispatch { work, ..Dispatch::over(program, 1) });
            }
            None => {
                let (dispatches, rows) = dispatch::of_passes(problem, passes, self.target, stride);
                self.buffers.update(Binding::PassRow, &rows)?;
                all.extend(dispatches);
            }
        }
        self.traffic.dispatches = all.len();
        for dispatch in &all {
            self.pipelines.prepare(&dispatch.program, self.target, &self.buffers)?;
        }
        self.timer.iter_mut().for_each(Timer::begin);
        // A submission must not use a missing buffer.
        self.buffers.settle().await?;
        let mut encode = |part: &[Dispatch]| {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            dispatch::encode(&mut encoder, part, &self.pipelines, self.target, self.timer.as_mut());
            encoder
        };
        let at_once = self.target.dispatches_at_once();
        let mut rest = &all[..];
        loop {
            let (part, later) = rest.split_at(dispatch::first_part(rest, self.submissions.room()));
            let (ahead, last) = part.split_at(part.len().saturating_sub(1) / at_once * at_once);
            ahead.chunks(at_once).for_each(|some| self.submissions.submit(encode(some)));
            let encoder = encode(last);
            let rows = part.iter().map(|dispatch| dispatch.work).sum();
            if later.is_empty() {
                return Ok((encoder, rows));
            }
            self.submissions.submit(encoder);
            self.submissions.wait(rows).await?;
            rest = later;
        }
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

    /// Runs the dispatches `first`, then the passes, and reads back all changed rows.
    async fn run_all(
        &mut self,
        problem: &mut StepProblem,
        first: Vec<Dispatch>,
        passes: &[Pass],
        together: bool,
    ) -> Result<()> {
        let work = self.encoded(problem, first, passes, together).await?;
        self.finish(work, &mut rows::changed(problem)).await
    }

    /// Submits work on `rows` rows, waits, and reads the `wanted` rows back.
    async fn finish(
        &mut self,
        (mut encoder, rows): (wgpu::CommandEncoder, usize),
        wanted: &mut [(Binding, &mut [u8])],
    ) -> Result<()> {
        let times = self.timer.as_ref().and_then(|timer| timer.resolve(&mut encoder));
        let ticks = self.buffers.read_back(&mut self.submissions, (encoder, rows), wanted, times).await?;
        self.times = self.timer.as_mut().map(|timer| timer.times(&ticks)).unwrap_or_default();
        let down = wanted.iter().map(|(_, rows)| rows.len() as u64).sum();
        let (submissions, longest_submission) = self.submissions.take_taken();
        self.traffic = Traffic { up: self.buffers.take_sent(), down, submissions, longest_submission, ..self.traffic };
        Ok(())
    }
}

impl Backend for Gpu {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn adapter(&self) -> String {
        format!("{}{}", self.summary, if self.options.exact { ", exact" } else { "" })
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        block_on(self.run_async(step))
    }

    fn run_async<'a>(&'a mut self, step: CheckedStep<'a>) -> Running<'a> {
        Box::pin(async move {
            let (problem, passes) = step.into_parts();
            self.rows = None;
            self.send_all(problem, passes)?;
            self.run_all(problem, Vec::new(), passes, false).await
        })
    }

    fn step(&mut self, step: CheckedStep, carry: &Carry) -> Result<()> {
        block_on(self.step_async(step, carry))
    }

    fn step_async<'a>(&'a mut self, step: CheckedStep<'a>, carry: &'a Carry) -> Running<'a> {
        Box::pin(async move {
            let (problem, passes) = step.into_parts();
            let before = self.rows.take().filter(|_| carry.on_device);
            let first = match before {
                Some(before) => {
                    self.check(problem, passes)?;
                    self.update_small_rows(problem)?;
                    resident::begin(&mut self.buffers, problem, carry, before, &mut self.separations).await?
                }
                None => {
                    self.send_all(problem, passes)?;
                    Vec::new()
                }
            };
            self.run_all(problem, first, passes, true).await?;
            self.count_bytes(problem, passes);
            for (binding, bytes) in rows::changed(problem) {
                // The host does not compare impulses of contacts with those of the step before.
                if !matches!(binding, Binding::Bodies | Binding::Impulses | Binding::Totals) {
                    self.buffers.note(binding, bytes);
                }
            }
            // The next step begins with begin_bodies.
            let state = |body: &BodyRow| BodyRow { v: body.v, w: body.w, ..BodyRow::AT_REST };
            self.buffers.note_rows(Binding::Bodies, problem.bodies.par_iter().map(state));
            self.rows = Some(ResidentRows::of(problem));
            Ok(())
        })
    }

    fn keeps_rows(&self) -> bool {
        self.rows.is_some()
    }

    fn successor(&mut self) -> Option<Box<dyn Backend>> {
        block_on(async { Ok(self.successor_async().await) }).unwrap_or_default()
    }

    fn successor_async(&mut self) -> Running<'_, Option<Box<dyn Backend>>> {
        Box::pin(async {
            if !self.options.goes_on {
                return None;
            }
            let lost = self.lost + 1;
            let opened =
                if lost < MAX_DEVICES { Self::open_after(lost, self.options.clone()).await.ok() } else { None };
            Some(match opened {
                Some(mut gpu) => {
                    gpu.target = self.target;
                    if self.timer.is_some() {
                        gpu.timer = Timer::new(&gpu.device, &gpu.queue);
                    }
                    Box::new(gpu) as Box<dyn Backend>
                }
                None => Box::new(Cpu::new()),
            })
        })
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn time_kernels(&mut self) -> Result<Option<f64>> {
        let bandwidth = block_on(timer::copy_bandwidth(&self.device, &mut self.submissions))?;
        self.timer = Timer::new(&self.device, &self.queue);
        Ok(self.timer.as_ref().map(|_| bandwidth))
    }

    fn kernel_times(&self) -> &[KernelTime] {
        &self.times
    }
}
