//! Checks of limits, long plans and lost devices.

use std::time::Duration;

use glam::Vec3;

use super::difference::{differing, largest as largest_difference};
use super::scenes::Warm;
use super::{Failure, Group, Outcome, PLAIN_PASS, PLAIN_STEP, Run, failed};
use crate::compare::BodyDifference;
use drystone::backend::gpu::{Gpu, GpuOptions, Loss};
use drystone::stages::backend::CheckedStep;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{BodyRow, MassRow, Substep};
use drystone::stages::random::SplitMix64;
use drystone::stats::median;
use drystone::{Backend, Body, BodyKind, Cpu, Error, Reference, Result};

/// The longest time that a submission may hold a device. Watchdogs end work after two seconds or more.
const LONGEST: Duration = Duration::from_millis(500);

/// Steps until the boxes of a falling pile of 27 boxes touch.
const LANDED: u32 = 60;

async fn open(options: GpuOptions) -> Result<Box<dyn Backend>> {
    Ok(Box::new(Gpu::open_async(options).await?))
}

/// A pile at rest, small enough for one dispatch. Its boxes get velocities, so that contacts do more than hold.
async fn pile() -> Result<Warm> {
    let mut warm = Warm::of("pile", &["n=27"], LANDED).await?;
    let mut random = SplitMix64::new(3);
    for body in warm.simulation.world.bodies.iter_mut().filter(|body| body.kind == BodyKind::Dynamic) {
        body.linear_velocity += Vec3::from_array([(); 3].map(|()| random.symmetric() as f32));
    }
    Ok(warm)
}

pub(super) async fn check_limits(run: &mut Run<'_>) {
    run.check(Group::Limits, "large buffers", large_buffers).await;
    run.check(Group::Limits, "a buffer beyond the limit is refused", async |run| {
        let options = GpuOptions { buffer_limit: 4096, ..run.gpu_options() };
        refused(run, options).await
    })
    .await;
    run.check(Group::Limits, "an allocation beyond the memory is refused", async |run| {
        let options = GpuOptions { memory: 10_000, ..run.gpu_options() };
        refused(run, options).await
    })
    .await;
}

/// Steps as many bodies as fit into a large buffer.
async fn large_buffers(run: &mut Run<'_>) -> Outcome {
    let gpu = Gpu::open_async(run.gpu_options()).await?;
    let most = gpu.summary().buffer_limit.min(if run.options.short { 16 << 20 } else { 128 << 20 });
    let count = (most as usize / size_of::<MassRow>().max(size_of::<BodyRow>())).min(1 << 21);
    let mut random = SplitMix64::new(7);
    let mut number = || random.symmetric() as f32;
    let bodies = (0..count).map(|_| BodyRow { v: [number(), number(), number()], ..BodyRow::AT_REST }).collect();
    let pull = MassRow { acceleration: [0.3, -9.81, 0.1], inv_mass: 1.0, ..MassRow::default() };
    let mut problem = StepProblem { bodies, masses: vec![pull; count], ..StepProblem::default() };
    problem.params.body_count = count as u32;
    problem.in_one_block(0, Substep { length: 0.013, inverse_length: 1.0 / 0.013, ..Substep::default() });
    let block = &problem.blocks[0];
    let colors = block.bodies..block.bodies + 1;
    let kernels = [
        Kernel::IntegrateVelocities { warm_start: false, from_start: false },
        Kernel::IntegratePositions { from_start: false },
    ];
    let passes = kernels.map(|kernel| Pass { kernel, block: 0, colors: colors.clone() });
    let mut results = [problem.clone(), problem];
    Reference::<f32>::new().run(&mut results[0], &passes)?;
    let mut gpu: Box<dyn Backend> = Box::new(gpu);
    gpu.run_async(CheckedStep::new(&mut results[1], &passes)?).await?;
    let [ours, theirs] = &results;
    let (count_of_numbers, apart) = (differing(ours, theirs), largest_difference(ours, theirs));
    let mib = (count * size_of::<BodyRow>()) >> 20;
    if if run.is_exact() { count_of_numbers > 0 } else { apart > PLAIN_PASS } {
        return failed!("{count} bodies in {mib} MiB: {count_of_numbers} numbers differ, by {apart:.1e}");
    }
    Ok(format!("{count} bodies in {mib} MiB, largest difference {apart:.1e}"))
}

/// Checks that a device with these options refuses a step in one line, and that the processor then runs it.
async fn refused(run: &mut Run<'_>, options: GpuOptions) -> Outcome {
    let mut warm = pile().await?;
    let (mut ours, mut theirs) = (warm.fork(Box::new(Reference::<f32>::new())), warm.fork(open(options).await?));
    let line = match theirs.step().await {
        Err(Error::TooLarge(line)) => line,
        Err(error) => return failed!("{error}"),
        Ok(_) => return failed!("it was not refused"),
    };
    theirs.simulation.set_backend(Box::new(Cpu::new()));
    ours.step().await?;
    theirs.step().await?;
    same_worlds(&ours, &theirs)?;
    // Without these limits the device has room for the same step.
    let mut again = warm.fork(open(run.gpu_options()).await?);
    again.step().await?;
    near(run, &ours, &again)?;
    Ok(line)
}

pub(super) async fn check_long_plans(run: &mut Run<'_>) {
    run.check(Group::LongDispatch, "a plan in several submissions", async |run| {
        let mut warm = pile().await?;
        let options = GpuOptions { submission: Duration::from_micros(50), ..run.gpu_options() };
        let [mut ours, mut whole, mut cut] = [
            Box::new(Reference::<f32>::new()) as Box<dyn Backend>,
            open(run.gpu_options()).await?,
            open(options).await?,
        ]
        .map(|backend| warm.fork(backend));
        let mut submissions = 0;
        for _ in 0..4 {
            for warm in [&mut ours, &mut whole, &mut cut] {
                warm.step().await?;
            }
            submissions = submissions.max(cut.simulation.backend().traffic().submissions);
            same_worlds(&whole, &cut)?;
        }
        if run.is_exact() {
            same_worlds(&ours, &cut)?;
        } else {
            near(run, &ours, &cut)?;
        }
        if submissions > 1 {
            Ok(format!("{submissions} submissions, the same bits as in one"))
        } else {
            failed!("the plan was not split")
        }
    })
    .await;
    run.check(Group::LongDispatch, "no submission takes half a second", async |run| {
        let mut warm = Warm::of("pile", &["n=125"], LANDED).await?;
        let mut config = warm.simulation.config().clone();
        (config.substeps, config.fuse_colors_below) = (if run.options.short { 60 } else { 400 }, 0);
        warm.simulation.set_config(config)?;
        let (mut ours, mut theirs) = (warm.fork(Box::new(Cpu::new())), warm.fork(open(run.gpu_options()).await?));
        ours.step().await?;
        theirs.step().await?;
        if run.is_exact() {
            same_worlds(&ours, &theirs)?;
        }
        let mut traffic = theirs.simulation.backend().traffic();
        // The host measures the time: on a busy machine it sometimes waits.
        for _ in 0..4 {
            if traffic.longest_submission < LONGEST {
                break;
            }
            theirs.step().await?;
            traffic = theirs.simulation.backend().traffic();
        }
        let (submissions, longest, dispatches) = (traffic.submissions, traffic.longest_submission, traffic.dispatches);
        let figure = format!("{dispatches} dispatches in {submissions} submissions, the longest {longest:.1?}");
        if longest < LONGEST { Ok(figure) } else { failed!("{figure}") }
    })
    .await;
}

/// The submission, and whether the device is lost during it or after it.
type Losses = &'static [(u32, bool)];

pub(super) async fn check_losses(run: &mut Run<'_>) {
    // The name of the check, the submission and moment of each loss, and the backend that continues.
    let cases: [(&str, Losses, &str); 3] = [
        ("a device lost between two steps", &[(1, false)], "gpu"),
        ("a device lost during a step", &[(2, true)], "gpu"),
        ("the CPU continues after three lost devices", &[(1, true), (1, false), (1, true)], "cpu"),
    ];
    for (name, losses, goes_on) in cases {
        run.check(Group::DeviceLost, name, async |run| {
            let mut options = run.gpu_options();
            options.faults.losses = losses.iter().map(|&(submission, during)| Loss { submission, during }).collect();
            let mut warm = pile().await?;
            let (mut ours, mut theirs) =
                (warm.fork(Box::new(Reference::<f32>::new())), warm.fork(open(options).await?));
            let mut lines = Vec::new();
            for _ in 0..4 {
                ours.step().await?;
                lines.extend(theirs.step().await?);
                if run.is_exact() {
                    same_worlds(&ours, &theirs)?;
                } else {
                    near(run, &ours, &theirs)?;
                }
            }
            match (lines.first(), theirs.simulation.backend().name()) {
                (None, _) => failed!("the loss was not noticed"),
                (Some(_), name) if name != goes_on => {
                    failed!("{name} continues instead of {goes_on}: {}", lines.join("; "))
                }
                (Some(line), _) => Ok(line.clone()),
            }
        })
        .await;
    }
}

/// Fails unless two runs have the same bits.
fn same_worlds(a: &Warm, b: &Warm) -> std::result::Result<(), Failure> {
    BodyDifference::first(&a.simulation.world, &b.simulation.world).map_or(Ok(()), |first| failed!("{first}"))
}

/// Fails unless a run is as near to the reference as a few steps of plain WGSL are. In exact mode it needs the same
/// bits. The median body counts: if surfaces just touch, rounding decides whether a contact is stiff or soft, and that
/// affects few bodies.
fn near(run: &Run, ours: &Warm, theirs: &Warm) -> std::result::Result<(), Failure> {
    if run.is_exact() {
        return same_worlds(ours, theirs);
    }
    let bodies = ours.simulation.world.bodies.iter().zip(&theirs.simulation.world.bodies);
    let dynamic = bodies.filter(|(body, _)| body.kind == BodyKind::Dynamic);
    let apart = |(a, b): (&Body, &Body)| {
        let velocity = (a.linear_velocity - b.linear_velocity).abs().max_element();
        f64::from(velocity.max((a.angular_velocity - b.angular_velocity).abs().max_element()))
    };
    let (apart, most) = (median(&dynamic.map(apart).collect::<Vec<_>>()), 10.0 * PLAIN_STEP);
    if apart <= most { Ok(()) } else { failed!("the middle body is {apart:.1e} m/s apart, of {most:.0e}") }
}
