//! Recordings of runs with all that a caller did, run again to the same bits.

use crate::common::state::reference;
use drystone::glam::{Quat, Vec3};
use drystone::stages::backend::CheckedStep;
use drystone::{
    Backend, Body, BodyHandle, BodyKind, Cpu, Groups, Joint, Reference, Result, Shape, Simulation, SolverConfig, World,
};
use drystone_scenes::{Recorder, RecordingIntervals, Replay, Scene};

const DT: f32 = 1.0 / 60.0;
const INTERVALS: RecordingIntervals = RecordingIntervals { hash: 5, state: 20 };

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

fn ground() -> Body {
    Body::fixed().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0)
}

fn towers() -> World {
    let mut world = World::new();
    world.insert(ground());
    for i in 0..15 {
        world.insert(cube(3.0 * (i / 5) as f32, 0.5 + (i % 5) as f32));
    }
    world
}

/// Steps a world 120 times and changes it in every way on its way; the recording, and the simulation at its end.
fn recorded() -> (Vec<u8>, Simulation) {
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.3);
    let mut simulation = Simulation::with(towers(), config, reference()).expect("a world");
    let mut recorder = Recorder::new(Vec::new(), "towers", &mut simulation, INTERVALS).expect("memory");
    let mut kept = None;
    for step in 0..120 {
        let world = &mut simulation.world;
        match step {
            5 => drop(world.remove(world.bodies.handle(3).expect("a cube"))),
            10 => drop(world.insert(cube(0.1, 8.0).named("new"))),
            11 => drop(world.insert(Body::dynamic().shape(Shape::ball(0.4)).position(3.0, 9.0, 0.1))),
            15 => world.bodies[7].linear_velocity = Vec3::new(2.0, 1.0, 0.0),
            20 => world.bodies[8].kind = BodyKind::Fixed,
            25 => world.gravity = Vec3::new(1.0, -8.0, 0.0),
            30 => {
                let [a, b] = [11, 12].map(|i| world.bodies.handle(i).expect("a cube"));
                world.insert_joint(Joint::new(a, 0.5 * Vec3::Y, b, -0.5 * Vec3::Y));
            }
            35 => world.bodies[12].groups = Groups { membership: 2, filter: 3 },
            40 => world.bodies[13].colliders[0].shape = Shape::ball(0.5),
            45 => world.bodies[14].force = Vec3::new(0.0, 5e3, 0.0),
            50 => simulation.set_config(simulation.config().clone().with(|c| c.substeps = 6)).expect("settings"),
            55 => kept = Some(simulation.snapshot()),
            62 => simulation.restore(kept.as_ref().expect("a state")),
            70 => world.bodies[15].material.friction = 0.1,
            75 => {
                world.bodies[1].position += 2.0 * Vec3::Z;
                world.bodies[1].rotation = Quat::from_rotation_y(0.3);
            }
            100 => simulation.wake(simulation.world.bodies.handle(2).expect("a cube")),
            _ => {}
        }
        let dt = if step % 7 == 3 { 0.5 * DT } else { DT };
        recorder.step(&mut simulation, dt).expect("a step");
    }
    (recorder.finish().expect("memory"), simulation)
}

#[test]
fn a_replay_goes_the_same_way_on_any_backend_and_from_any_step() {
    let (bytes, simulation) = recorded();
    let backends: [fn() -> Box<dyn Backend>; 2] = [reference, || Box::new(Cpu::new())];
    for backend in backends {
        let mut replay = Replay::read(&bytes).expect("a recording");
        let mut again = replay.begin(backend()).expect("a beginning");
        assert_eq!((replay.title(), replay.len()), ("towers", 120));
        let mut hashes = vec![again.hash()];
        while replay.step(&mut again).expect("a step").is_some() {
            hashes.push(again.hash());
        }
        assert_eq!(replay.first_difference(), None);
        assert_eq!((hashes.len(), hashes[120]), (121, simulation.hash()));
        assert!((replay.time() - (103.0 + 0.5 * 17.0) / 60.0).abs() < 1e-4, "{}", replay.time());
        for step in [60, 3, 61, 62, 63, 20, 0, 119, 120, 41, 40, 39, 500] {
            replay.seek(&mut again, step).expect("a step");
            assert_eq!(replay.step_number(), step.min(120));
            assert_eq!(again.hash(), hashes[step.min(120) as usize], "step {step}");
        }
        assert_eq!(replay.first_difference(), None);
    }
}

/// A recording of 30 steps, of which the caller does something else before the 11th; and the hash of its end.
fn recorded_with(interrupt: impl Fn(&mut Simulation)) -> (Vec<u8>, u64) {
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::with(towers(), config, reference()).expect("a world");
    let intervals = RecordingIntervals { hash: 1, ..INTERVALS };
    let mut recorder = Recorder::new(Vec::new(), "towers", &mut simulation, intervals).expect("memory");
    for step in 0..30 {
        if step == 10 {
            interrupt(&mut simulation);
        }
        recorder.step(&mut simulation, DT).expect("a step");
    }
    let hash = simulation.hash();
    // Later changes belong to no step.
    simulation.world.bodies[5].position.y += 1.0;
    (recorder.finish().expect("memory"), hash)
}

/// What lasts from step to step is more than the world: the cubes of a simulation that begins anew have no impulses.
#[test]
fn a_simulation_that_another_one_replaced_is_recorded() {
    let begun_anew = |s: &mut Simulation| {
        *s = Simulation::with(s.world.clone(), s.config().clone(), reference()).expect("a world");
    };
    let loaded = |s: &mut Simulation| {
        let mut other = Simulation::with(towers(), s.config().clone(), reference()).expect("a world");
        (0..3).for_each(|_| drop(other.step(DT).expect("a step")));
        *s = Simulation::load(&other.save(), reference()).expect("what was saved");
    };
    let stepped = |s: &mut Simulation| drop(s.step(DT).expect("a step"));
    let recorded = [
        ("nothing", recorded_with(|_| ())),
        ("another", recorded_with(begun_anew)),
        ("a saved one", recorded_with(loaded)),
        ("a step", recorded_with(stepped)),
    ];
    let mut ends = Vec::new();
    for (name, (bytes, end)) in recorded {
        let mut replay = Replay::read(&bytes).expect("a recording");
        let mut again = replay.begin(reference()).expect("a beginning");
        while replay.step(&mut again).expect("a step").is_some() {}
        assert_eq!((replay.first_difference(), again.hash()), (None, end), "{name}");
        ends.push(end);
    }
    ends.sort_unstable();
    ends.dedup();
    assert_eq!(ends.len(), 4, "a way changes nothing");
}

/// Makes a mistake in its 33rd step.
struct Broken(Reference<f32>, u32);

impl Backend for Broken {
    fn name(&self) -> &'static str {
        "broken"
    }

    fn adapter(&self) -> String {
        "makes one mistake".into()
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        self.0.run(problem, passes)?;
        self.1 += 1;
        if self.1 == 33 {
            problem.bodies[9].v[0] += 1e-6;
        }
        Ok(())
    }
}

/// With a hash in every step the step and the body are those of the mistake. With one in every fifth step the mistake has spread by then.
#[test]
fn a_replay_that_goes_another_way_names_the_step_and_the_body() {
    for (hash, expected) in [(1, (33, 32, Some(9), 1)), (5, (35, 30, Some(6), 5))] {
        let config = SolverConfig::default().without_sleep();
        let mut world = towers();
        // A vacancy before the body of the mistake.
        world.remove(world.bodies.handle(2).expect("a cube"));
        let mut simulation = Simulation::with(world, config, reference()).expect("a world");
        let intervals = RecordingIntervals { hash, ..INTERVALS };
        let mut recorder = Recorder::new(Vec::new(), "towers", &mut simulation, intervals).expect("memory");
        (0..50).for_each(|_| drop(recorder.step(&mut simulation, DT).expect("a step")));
        let bytes = recorder.finish().expect("memory");
        let mut replay = Replay::read(&bytes).expect("a recording");
        let mut again = replay.begin(Box::new(Broken(Reference::new(), 0))).expect("a beginning");
        while replay.step(&mut again).expect("a step").is_some() {}
        let first = replay.first_difference().expect("a difference");
        let body = first.body.map(BodyHandle::index);
        assert_eq!((first.step, first.agreed, body, first.bodies), expected);
    }
}

#[test]
fn what_is_no_whole_recording_is_refused_in_one_line() {
    let mut simulation = Simulation::with(towers(), SolverConfig::default(), reference()).expect("a world");
    let mut recorder = Recorder::new(Vec::new(), "towers", &mut simulation, INTERVALS).expect("memory");
    (0..8).for_each(|_| drop(recorder.step(&mut simulation, DT).expect("a step")));
    let bytes = recorder.finish().expect("memory");
    let refusal = |bytes: &[u8]| match Replay::read(bytes) {
        Ok(_) => panic!("it is refused"),
        Err(e) => e.to_string(),
    };
    for end in (0..bytes.len()).step_by(7) {
        let line = refusal(&bytes[..end]);
        assert!(line.starts_with("the recording cannot be replayed: ") && !line.contains('\n'), "{end}: {line}");
    }
    for place in (8..bytes.len()).step_by(11) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x55;
        assert!(refusal(&damaged).starts_with("the recording cannot be replayed: "), "byte {place}");
    }
    assert!(refusal(b"{}").contains("these bytes are not a recording"));
}

#[test]
fn a_world_that_the_caller_leaves_alone_takes_few_bytes_a_step() {
    let scene = Scene::find("pile", &["n=500".into()]).expect("a scene");
    let mut simulation = Simulation::with(scene.world, SolverConfig::default(), reference()).expect("a world");
    let rare = RecordingIntervals { hash: 1000, state: 1000 };
    let mut recorder = Recorder::new(Vec::new(), "pile", &mut simulation, rare).expect("memory");
    let begin = simulation.save().len();
    (0..30).for_each(|_| drop(recorder.step(&mut simulation, DT).expect("a step")));
    let bytes = recorder.finish().expect("memory");
    assert!(bytes.len() < begin + 30 * 64 + 1000, "{} bytes after {begin}", bytes.len());
}
