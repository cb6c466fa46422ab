//! Steps that go on while other tasks run: the bits of steps that wait on a thread, and futures that are dropped before their end.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use drystone::backend::Running;
use drystone::backend::gpu::{Faults, GpuOptions, Loss};
use drystone::stages::backend::CheckedStep;
use drystone::stages::problem::Carry;
use drystone::{Backend, Gpu, Reference, Result, Simulation, SolverConfig};
use drystone_scenes::Scene;

tests! {
    exact_gpu {
        steps_of_a_device_have_the_bits_of_steps_that_wait,
        a_device_that_is_lost_costs_no_bit,
    }
    no_gpu {
        a_step_has_the_bits_of_one_that_waits,
        a_dropped_step_is_refused_until_the_simulation_goes_back,
    }
}

fn pile(backend: Box<dyn Backend>) -> (Simulation, f32) {
    let scene = Scene::find("pile", &["n=60".into()]).expect("a scene of the catalogue");
    let config = SolverConfig::default().without_sleep();
    (Simulation::with(scene.world, config, backend).expect("good settings"), scene.dt)
}

fn exact(losses: Vec<Loss>) -> Box<dyn Backend> {
    let faults = Faults { losses, ..Faults::default() };
    let options = GpuOptions { exact: true, faults, ..GpuOptions::default() };
    Box::new(pollster::block_on(Gpu::open_async(options)).unwrap_or_else(|e| panic!("{e}")))
}

/// Steps a pile until it touches, by futures; the same on the reference, which waits. Returns the lines of devices that were lost.
fn assert_same_bits(backend: Box<dyn Backend>, steps: u32) -> Vec<String> {
    let ((mut ours, dt), (mut theirs, _)) = (pile(Box::new(Reference::<f32>::new())), pile(backend));
    let mut lines = Vec::new();
    for step in 1..=steps {
        ours.step(dt).expect("the reference runs");
        let stats = pollster::block_on(theirs.step_async(dt)).unwrap_or_else(|e| panic!("step {step}: {e}"));
        lines.extend(stats.fault);
        assert_eq!(ours.hash(), theirs.hash(), "step {step}");
    }
    assert!(ours.manifolds().count() > 20, "bodies touch");
    lines
}

fn a_step_has_the_bits_of_one_that_waits() {
    assert!(assert_same_bits(Box::new(drystone::Cpu::new()), 70).is_empty());
}

fn steps_of_a_device_have_the_bits_of_steps_that_wait() {
    assert!(assert_same_bits(exact(Vec::new()), 70).is_empty());
}

fn a_device_that_is_lost_costs_no_bit() {
    let lines = assert_same_bits(exact(vec![Loss { submission: 60, during: true }]), 70);
    assert!(lines.len() == 1 && lines[0].contains("repeats the step and continues"), "{lines:?}");
}

/// The reference, whose steps pend once before they run.
struct Slow(Reference<f32>);

impl Backend for Slow {
    fn name(&self) -> &'static str {
        "slow"
    }

    fn adapter(&self) -> String {
        "a processor that other tasks use".into()
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        self.0.run_checked(step)
    }

    fn step_async<'a>(&'a mut self, step: CheckedStep<'a>, _: &'a Carry) -> Running<'a> {
        let mut has_pended = false;
        Box::pin(async move {
            std::future::poll_fn(|context| {
                if std::mem::replace(&mut has_pended, true) {
                    return Poll::Ready(());
                }
                context.waker().wake_by_ref();
                Poll::Pending
            })
            .await;
            self.0.run_checked(step)
        })
    }
}

fn a_dropped_step_is_refused_until_the_simulation_goes_back() {
    let ((mut ours, dt), (mut theirs, _)) =
        (pile(Box::new(Reference::<f32>::new())), pile(Box::new(Slow(Reference::new()))));
    let step_both = |ours: &mut Simulation, theirs: &mut Simulation| {
        ours.step(dt).expect("the reference runs");
        pollster::block_on(theirs.step_async(dt)).expect("the other one likewise");
        assert_eq!(ours.hash(), theirs.hash());
    };
    (0..65).for_each(|_| step_both(&mut ours, &mut theirs));
    let before = theirs.snapshot();
    {
        let mut step = pin!(theirs.step_async(dt));
        assert!(step.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending());
    }
    assert_eq!(ours.hash(), theirs.hash(), "a step that was dropped moves nothing");
    let contacts = theirs.contacts().count();
    assert!(contacts > 20, "{contacts} contacts");
    for refusal in [theirs.step(dt), pollster::block_on(theirs.step_async(dt))] {
        let line = refusal.expect_err("a step after one that was dropped").to_string();
        assert_eq!(line, "the future of a step was dropped before it completed: restore a snapshot");
    }
    theirs.restore(&before);
    (0..20).for_each(|_| step_both(&mut ours, &mut theirs));
}
