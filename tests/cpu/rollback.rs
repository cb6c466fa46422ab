//! A run that goes back and steps again, and what that asks of memory.

use crate::common::counting;
use drystone::glam::Vec3;
use drystone::{Cpu, Rollback, Simulation, SolverConfig};
use drystone_scenes::Scene;

#[allow(dead_code)]
#[path = "../../examples/rollback.rs"]
mod example;

fn pile(config: &SolverConfig) -> (Simulation, f32) {
    let scene = Scene::find("pile", &["n=200".into()]).expect("the scene");
    (Simulation::with(scene.world, config.clone(), Box::new(Cpu::new())).expect("good settings"), scene.dt)
}

/// The calls that `work` makes for memory.
fn asked(work: impl FnOnce()) -> usize {
    let before = counting::asked();
    work();
    counting::asked() - before
}

/// A push of one box that is told seven steps late, in a pile that falls.
fn late_inputs_give_the_bits_of_inputs_in_time() {
    let push = |simulation: &mut Simulation, step: u32| {
        if step % 20 == 13 {
            simulation.world.bodies[10 + step as usize].linear_velocity += Vec3::new(1.0, 3.0, 0.0);
        }
    };
    let (mut late, dt) = pile(&SolverConfig::default());
    let (mut in_time, _) = pile(&SolverConfig::default());
    let mut rollback = Rollback::new(8);
    let mut differed = false;
    for step in 0..120_u32 {
        push(&mut in_time, step);
        in_time.step(dt).expect("a step");
        rollback.push(&late);
        late.step(dt).expect("a step");
        differed |= late.hash() != in_time.hash();
        if step % 20 == 19 {
            rollback.back(7, &mut late).expect("eight states");
            for again in step - 6..=step {
                rollback.push(&late);
                push(&mut late, again);
                late.step(dt).expect("a step");
            }
            assert_eq!(late.hash(), in_time.hash(), "step {step}");
        }
    }
    assert!(differed && rollback.len() == rollback.capacity());
    let line = rollback.back(9, &mut late).expect_err("eight states only").to_string();
    assert_eq!(line, "cannot go back 9 steps: only 8 states are kept");
    assert_eq!(late.hash(), in_time.hash());
}

/// States of a pile at rest: pushed and gone back to in memory that stands.
fn a_lap_later_nothing_is_allocated(config: &SolverConfig) {
    let (mut simulation, dt) = pile(config);
    (0..400).for_each(|_| drop(simulation.step(dt).expect("a step")));
    let mut rollback = Rollback::new(6);
    let mut lap = |count: usize| {
        let mut of_states = 0;
        for _ in 0..count {
            of_states += asked(|| rollback.push(&simulation));
            simulation.step(dt).expect("a step");
        }
        of_states + asked(|| rollback.back(4, &mut simulation).expect("six states"))
    };
    let first = lap(6);
    let later = (0..10).map(|_| lap(4)).sum::<usize>();
    assert!(first > 100 && later == 0, "{first} and then {later} allocations");
}

#[test]
fn a_run_goes_back_and_on_to_the_same_bits_without_allocations() {
    late_inputs_give_the_bits_of_inputs_in_time();
    for config in [SolverConfig::default(), SolverConfig::default().without_sleep()] {
        counting::in_pool(2, || a_lap_later_nothing_is_allocated(&config));
    }
    example::main().expect("the example runs");
}
