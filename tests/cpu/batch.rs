//! A batch: the bits of a world depend on its scene, settings and inputs alone, a state is exact, and a world that fails stops alone.

use std::cell::Cell;

use drystone::batch::{Batch, Column, Run, State, drives, write};
use drystone::glam::Vec3;
use drystone::{BodyHandle, BodyKind, Cpu, Joint, Listen, Result, Simulation, SolverConfig, World};
use drystone_problems::batch::Measure;
use drystone_problems::step_with_residuals;
use drystone_scenes::{CATALOGUE, Scene};

use crate::common::sample::one_in;
use crate::common::state::joint_impulses;

const SCENES: [(&str, &[&str]); 5] = [
    ("tower", &["n=5"]),
    ("pile", &["n=27"]),
    ("bridge", &["planks=6", "boxes=2"]),
    ("drop", &[]),
    ("drawbridge", &[]),
];

fn scene(name: &str, parameters: &[&str]) -> Scene {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    Scene::find(name, &parameters).expect("the scene")
}

/// A batch of equal worlds.
fn batch_of(scene: &Scene, config: &SolverConfig, count: usize) -> Result<Batch> {
    Batch::of(&scene.world, scene.dt, config, count)
}

/// Changes a world before a step, by the number of the world.
fn push(world: usize, step: u64, bodies: &mut World) {
    if step % 20 == 7 {
        let last = bodies.bodies.len() - 1;
        bodies.bodies[last].apply_impulse(Vec3::new(50.0 * world as f32, 20.0, 0.0));
    }
}

/// The hash of a world alone after each step.
fn alone(scene: &Scene, config: &SolverConfig, world: usize, steps: u64) -> Vec<u64> {
    let mut simulation = Simulation::with(scene.world.clone(), config.clone(), Box::new(Cpu::new())).expect("a world");
    let mut step = |step| {
        push(world, step, &mut simulation.world);
        simulation.step(scene.dt).expect("a step");
        simulation.hash()
    };
    (0..steps).map(&mut step).collect()
}

/// The hashes of some worlds after each step.
fn hashes(batch: &mut Batch, worlds: &[usize], steps: u64) -> Vec<Vec<u64>> {
    let tasks = worlds.iter().map(|&world| (world, (world, Vec::new()))).collect();
    let all = std::sync::Mutex::new(vec![Vec::new(); batch.len()]);
    let run = Run { steps, ..Run::default() };
    let before = |(world, _): &(usize, Vec<u64>), step, bodies: &mut World| {
        push(*world, step, bodies);
        Ok(())
    };
    let failed = batch.run(run, tasks, before, |(world, own), step, member| {
        own.push(member.hash());
        if step + 1 == steps {
            all.lock().expect("no panic")[*world] = std::mem::take(own);
        }
    });
    assert!(failed.expect("good worlds").is_empty());
    all.into_inner().expect("no panic")
}

#[test]
fn a_world_has_the_bits_of_the_world_alone() {
    let scenes: Vec<Scene> = SCENES.iter().map(|(name, parameters)| scene(name, parameters)).collect();
    let configs = [SolverConfig::default(), SolverConfig::default().with(|c| c.substeps = 4)];
    // Every scene with both settings, and a world of each pair whatever stands beside it.
    for (worlds, threads) in [(1, 1), (1, 2), (7, 1), (7, 2), (7, 3), (12, 2)] {
        let kind = |k: usize| (&scenes[k % scenes.len()], &configs[k % configs.len()]);
        let mut batch =
            Batch::new((0..worlds).map(kind).map(|(scene, config)| (&scene.world, scene.dt, config.clone())))
                .expect("worlds")
                .on_threads(threads)
                .expect("threads");
        let chosen: Vec<usize> = (0..worlds).collect();
        let of_all = hashes(&mut batch, &chosen, 60);
        for (k, of_one) in of_all.iter().enumerate() {
            let (scene, config) = kind(k);
            assert_eq!(*of_one, alone(scene, config, k, 60), "{}, world {k} of {worlds} on {threads}", scene.name);
            assert_eq!((batch.world(k).steps(), batch.threads()), (60, threads));
        }
    }
}

/// Sixteen worlds whose steps run as one, in other states each: every scene of the catalogue that is small enough, with torques, damping and listeners in some.
#[test]
fn worlds_that_run_as_one_have_the_bits_of_each_alone() {
    let listen = Listen { contacts: true, ..Listen::default() };
    let disturb = |world: usize, step: u64, bodies: &mut World| {
        let movable = bodies.bodies.iter().rposition(|body| body.kind == BodyKind::Dynamic);
        let Some(body) = movable.filter(|_| step == 3 * world as u64) else { return };
        let push = bodies.bodies[body].mass.mass * (0.2 + 0.05 * world as f32);
        bodies.bodies[body].apply_impulse(Vec3::new(push, 0.5 * push, -0.3 * push));
        if world % 5 == 4 {
            bodies.bodies[body].torque = Vec3::new(0.0, push, 0.1 * push);
        }
        if world % 5 == 2 {
            (bodies.bodies[body].linear_damping, bodies.bodies[body].angular_damping) = (0.3, 0.1 * world as f32);
        }
    };
    let mut tried = 0;
    for entry in CATALOGUE.iter().step_by(one_in(2)) {
        let scene = entry.build(&[]).expect("a scene");
        if scene.world.bodies.len() > 150 || !scene.spawners.is_empty() || !scene.leaving.is_empty() {
            continue;
        }
        tried += 1;
        let configs = [SolverConfig::default(), SolverConfig::default().without_sleep()];
        let config = |world: usize| &configs[usize::from(world % 4 == 3)];
        let mut batch =
            Batch::new((0..16).map(|world| (&scene.world, scene.dt, config(world).clone()))).expect("worlds");
        batch = batch.on_threads(1).expect("a thread");
        let listens = |world: usize| world % 8 == 6;
        for world in (0..16).filter(|&world| listens(world)) {
            batch.world_mut(world).simulation_mut().listen(listen).expect("a listener");
        }
        let tasks = (0..16).map(|world| (world, (world, Vec::new()))).collect();
        let seen = std::sync::Mutex::new(vec![Vec::new(); 16]);
        let before = |own: &(usize, Vec<u64>), step, bodies: &mut World| {
            disturb(own.0, step, bodies);
            Ok(())
        };
        let run = Run { steps: 60, ..Run::default() };
        let failed = batch.run(run, tasks, before, |(world, hashes), step, member| {
            hashes.push(member.hash());
            if step == 59 {
                seen.lock().expect("no panic")[*world] = std::mem::take(hashes);
            }
        });
        assert!(failed.expect("worlds").is_empty());
        let seen = seen.into_inner().expect("no panic");
        for (world, hashes) in seen.iter().enumerate() {
            let mut one =
                Simulation::with(scene.world.clone(), config(world).clone(), Box::new(Cpu::new())).expect("one");
            if listens(world) {
                one.listen(listen).expect("a listener");
            }
            for (step, hash) in hashes.iter().enumerate() {
                disturb(world, step as u64, &mut one.world);
                one.step(scene.dt).expect("a step");
                assert_eq!(one.hash(), *hash, "{}, world {world}, step {step}", entry.name);
            }
        }
    }
    assert!(tried > 20 / one_in(2), "{tried} scenes");
}

/// Teleports, and bodies taken out and put in again, did not give the bits of a fresh world.
#[test]
fn a_reset_gives_the_bits_of_a_fresh_world_and_leaves_the_others() {
    for (name, parameters) in SCENES {
        let scene = scene(name, parameters);
        for config in [SolverConfig::default(), SolverConfig::default().without_sleep()] {
            for at in [32, 37, 200] {
                let mut batch = batch_of(&scene, &config, 3).expect("worlds").on_threads(2).expect("threads");
                hashes(&mut batch, &[0, 1, 2], at);
                let others = [batch.world(0).hash(), batch.world(2).hash()];
                batch.reset(&[1]).expect("a world");
                assert_eq!([batch.world(0).hash(), batch.world(2).hash()], others);
                assert_eq!((batch.world(1).steps(), batch.world(1).time()), (0, 0.0));
                let again = &hashes(&mut batch, &[1], 90)[1];
                assert_eq!(*again, alone(&scene, &config, 1, 90), "{name}, reset at {at}");
                assert_eq!([batch.world(0).hash(), batch.world(2).hash()], others, "they were not named");
            }
        }
    }
}

#[test]
fn a_state_goes_on_to_the_same_bits_in_another_world_and_as_bytes() {
    for (name, parameters) in SCENES {
        let scene = scene(name, parameters);
        let mut batch = batch_of(&scene, &SolverConfig::default(), 3).expect("worlds");
        hashes(&mut batch, &[0, 1, 2], 37);
        let state = batch.world(0).state();
        assert_eq!((state.hash(), state.steps()), (batch.world(0).hash(), 37));
        let bytes = state.save();
        batch.restore(1, &state).expect("a world");
        let mut loaded = Batch::of_states([State::load(&bytes).expect("bytes")]).expect("a world");
        let go_on = |batch: &mut Batch, world: usize| {
            batch.step(60, &[world]).expect("a world");
            (batch.world(world).hash(), batch.world(world).steps(), batch.world(world).time().to_bits())
        };
        let first = go_on(&mut batch, 0);
        assert_eq!(go_on(&mut batch, 1), first, "{name}, restored");
        assert_eq!(go_on(&mut loaded, 0), first, "{name}, loaded");
        assert_ne!(go_on(&mut batch, 2).0, first.0, "{name}: that one was pushed otherwise");
        loaded.reset(&[0]).expect("a world");
        assert_eq!(loaded.world(0).state().save(), bytes, "{name}: the loaded state is the start");
    }
}

#[test]
fn a_world_that_fails_stops_alone_as_it_was_before_the_step() {
    let scene = scene("pile", &["n=27"]);
    let config = SolverConfig::default();
    type Fault = fn(&mut World);
    let faults: [(&str, Fault); 3] = [
        ("force", |world| world.bodies[3].force.x = f32::NAN),
        ("cannot go on", |world| {
            world.bodies[3].linear_velocity.y = 9.0;
            panic!("cannot go on")
        }),
        ("gravity", |world| world.gravity.y = f32::INFINITY),
    ];
    for (what, fault) in faults {
        let mut batch = batch_of(&scene, &config, 4).expect("worlds").on_threads(2).expect("threads");
        batch.step(20, &[0, 1, 2, 3]).expect("worlds");
        let run = Run { steps: 30, ..Run::default() };
        let tasks = (0..4).map(|world| (world, world)).collect();
        let before = |own: &usize, step, world: &mut World| {
            if *own == 2 && step == 11 {
                fault(world);
            }
            Ok(())
        };
        assert_eq!(batch.run(run, tasks, before, |_, _, _| {}).expect("worlds"), [2]);
        let error = batch.world(2).error().expect("why");
        assert!(error.contains(what) && !error.contains('\n'), "{error}");
        let steps: Vec<u64> = batch.worlds().iter().map(|member| member.steps()).collect();
        assert_eq!(steps, [50, 50, 31, 50], "{what}");
        // To the last bit, contacts and all: it goes on as one that never failed.
        assert!(batch.step(19, &[2]).expect("a world").is_empty(), "{what}");
        assert_eq!(batch.world(2).hash(), batch.world(0).hash(), "{what}");
        assert!(batch.world(2).error().is_none());
    }
}

#[test]
fn worlds_that_are_not_there_or_not_in_order_move_nothing() {
    let mut batch = batch_of(&scene("tower", &[]), &SolverConfig::default(), 3).expect("worlds");
    for (worlds, line) in [
        (&[0, 3][..], "world 3: must be less than 3"),
        (&[1, 0], "world 0: worlds must be ascending"),
        (&[1, 1], "world 1: worlds must be ascending"),
    ] {
        assert_eq!(batch.step(1, worlds).expect_err("refused").to_string(), line);
    }
    assert!(batch.worlds().iter().all(|member| member.steps() == 0));
    assert!(batch_of(&scene("tower", &[]), &SolverConfig::default(), 0).is_err());
    let two = Scene::find_worlds("tower", &[], 2, None).expect("worlds");
    assert!(batch_of(&two, &SolverConfig::default(), 1).is_err(), "two worlds beside each other");
    let bytes = batch.world(0).state().save();
    for cut in [0, 7, 30, 36, 50, bytes.len() - 1] {
        assert!(State::load(&bytes[..cut]).is_err(), "{cut} bytes");
    }
    for at in 0..bytes.len().min(60) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        assert!(State::load(&damaged).is_err(), "byte {at}");
    }
}

#[test]
fn a_run_that_is_stopped_leaves_every_world_between_two_steps() {
    let mut batch = batch_of(&scene("pile", &["n=27"]), &SolverConfig::default().without_sleep(), 3).expect("worlds");
    let asked = Cell::new(0);
    let stop = || {
        asked.set(asked.get() + 1);
        asked.get() == 2
    };
    let run = Run { steps: u64::MAX, stop: Some(&stop), ..Run::default() };
    let tasks = (0..3).map(|world| (world, ())).collect();
    assert!(batch.run(run, tasks, |_, _, _| Ok(()), |_, _, _| {}).expect("worlds").is_empty());
    for member in batch.worlds() {
        let mut same = Batch::of_states([State::clone(member.start())]).expect("a world");
        same.step(member.steps(), &[0]).expect("a world");
        assert!(member.steps() > 0 || batch.threads() < 3);
        assert_eq!(same.world(0).hash(), member.hash());
    }
}

#[test]
fn drives_are_set_without_a_loss_of_impulses() {
    let scene = scene("drawbridge", &[]);
    let names: Vec<_> = drives(&scene.world).map(|drive| drive.name).collect();
    assert_eq!(names, ["joint 1: deck - tower", "joint 2: deck - tower"]);
    let mut batch = batch_of(&scene, &SolverConfig::default(), 2).expect("worlds");
    batch.step(40, &[0, 1]).expect("worlds");
    let mut ctrl = [0.0; 3];
    batch.world(0).read(Column::Control, &mut ctrl);
    assert!(ctrl[2].is_nan() && ctrl[0].is_finite() && ctrl[1].is_finite(), "two drives: {ctrl:?}");
    // Other numbers for a step, and back: the joint holds as it did.
    for more in [1e-3, 0.0] {
        batch.world_mut(0).write(Column::Control, &[ctrl[0] + more, ctrl[1] + more]).expect("two drives");
        batch.step(1, &[0, 1]).expect("worlds");
    }
    let impulses = |world: usize| joint_impulses(batch.world(world).simulation());
    let impulse = |world: usize| impulses(world).iter().map(|impulse| impulse.length()).sum::<f32>();
    assert_ne!(batch.world(0).hash(), batch.world(1).hash());
    assert!((impulse(0) / impulse(1) - 1.0).abs() < 0.05, "{} and {} N s", impulse(0), impulse(1));
    assert!(write(&mut World::new(), Column::JointSpeed, &[]).is_err());
}

#[test]
fn contacts_and_measures_do_not_depend_on_neighbors_and_threads() {
    let scene = scene("pile", &["n=27"]);
    let listen = Listen { contacts: true, impulses: true, hits_above: Some(0.5) };
    let of = |worlds: usize, threads: usize| {
        let mut batch = batch_of(&scene, &SolverConfig::default(), worlds).expect("worlds");
        batch = batch.on_threads(threads).expect("threads");
        batch.worlds_mut().iter_mut().for_each(|world| world.simulation_mut().listen(listen).expect("a listener"));
        let all: Vec<usize> = (0..worlds).collect();
        hashes(&mut batch, &all, 50);
        let last = worlds - 1;
        let measures = Measure::values(Measure::ALL, batch.world(last)).map(f64::to_bits);
        let events = batch.events(&[last]).expect("a world").into_iter();
        let events: Vec<_> = events
            .map(|event| (event.kind, event.bodies.map(|body| body.map(BodyHandle::index)), event.value.to_bits()))
            .collect();
        (batch.contacts(&[last]).expect("a world"), events, measures)
    };
    let pushed = of(4, 1);
    let (contacts, ..) = &pushed;
    assert!(contacts.bodies.len() > 20, "{} contacts", contacts.bodies.len());
    assert!(contacts.impulse.iter().any(|impulse| impulse[1] > 0.0));
    let sorted = |pairs: &[[u32; 2]]| pairs.is_sorted_by_key(|[a, b]| (*a.min(b), *a.max(b)));
    assert!(sorted(&contacts.bodies));
    assert_eq!(pushed, of(4, 2));
    assert_ne!(pushed.0, of(3, 2).0, "another world is pushed otherwise");
}

#[test]
fn residuals_are_those_of_the_next_step_and_the_world_stays_as_it_is() {
    let measures = [Measure::ResidualVelocity, Measure::ResidualCone, Measure::ResidualDissipation];
    let scene = scene("pile", &["n=27"]);
    let of = |substeps: u32| {
        let config = SolverConfig::default().with(|c| (c.substeps, c.max_substeps) = (substeps, substeps));
        let mut batch = batch_of(&scene, &config, 2).expect("worlds");
        assert!(batch.step(40, &[0, 1]).expect("worlds").is_empty());
        let before = batch.world(0).hash();
        let values = Measure::values(measures, batch.world(0));
        assert_eq!(batch.world(0).hash(), before);
        let mut simulation = batch.world(0).simulation().fork(Box::new(Cpu::new()));
        let residuals = step_with_residuals(&mut simulation, scene.dt).expect("a step");
        assert_eq!(values, [residuals.e_vel, residuals.cone, residuals.diss]);
        batch.step(5, &[0, 1]).expect("worlds");
        assert_eq!(batch.world(0).hash(), batch.world(1).hash(), "a measure changes nothing");
        values
    };
    let [velocity, cone, dissipation] = of(8);
    assert!(velocity > 0.0 && velocity < 0.5 && cone.is_finite() && dissipation.is_finite(), "{velocity}");
    let jointed = batch_of(&self::scene("drawbridge", &[]), &SolverConfig::default(), 1).expect("a world");
    assert!(Measure::values(measures, jointed.world(0)).iter().all(|value| value.is_nan()));
}

#[test]
fn asleep_a_world_has_no_residuals() {
    let mut batch = batch_of(&scene("tower", &["n=2"]), &SolverConfig::default(), 1).expect("a world");
    batch.step(300, &[0]).expect("a world");
    let [asleep, velocity] = Measure::values([Measure::Asleep, Measure::ResidualVelocity], batch.world(0));
    assert_eq!((asleep, velocity), (2.0, 0.0));
}

#[test]
fn a_mass_is_scaled_from_that_of_the_start_and_no_other_changes() {
    let mut batch = batch_of(&scene("tower", &["n=3"]), &SolverConfig::default(), 2).expect("worlds");
    let first = batch.world(0).simulation().world.bodies[2].mass;
    for scale in [0.3, 7.0, 2.0] {
        let mut scales = [0.0; 4];
        batch.world(1).read(Column::MassScale, &mut scales);
        scales[2] = scale;
        batch.world_mut(1).write(Column::MassScale, &scales).expect("a mass");
    }
    let bodies = &batch.world(1).simulation().world.bodies;
    assert_eq!(
        (bodies[2].mass.mass, bodies[2].mass.principal_inertia),
        (2.0 * first.mass, 2.0 * first.principal_inertia)
    );
    assert_eq!((bodies[1].mass, bodies[0].mass.mass), (first, 0.0));
    for bad in [0.0, -1.0, 1e30, f32::NAN] {
        let error = batch.world_mut(1).write(Column::MassScale, &[1.0, 1.0, bad, 1.0]).expect_err("no mass");
        assert!(error.to_string().contains("mass_scale"), "{error}");
    }
    assert!(batch.step(30, &[0, 1]).expect("worlds").is_empty());
    assert_ne!(batch.world(0).hash(), batch.world(1).hash());
    batch.reset(&[1]).expect("a world");
    assert_eq!(batch.world(1).simulation().world.bodies[2].mass, first);
}

#[test]
fn a_joint_that_breaks_leaves_its_columns_empty() {
    let mut scene = scene("sphere-plane", &[]);
    let ball = scene.world.bodies.handle(1).expect("a ball");
    scene.world.insert_joint(Joint::to_world(ball, Vec3::ZERO, Vec3::new(0.0, 2.5, 0.0)).breaking_at(1.0));
    let mut batch = batch_of(&scene, &SolverConfig::default(), 1).expect("a world");
    assert!(batch.step(1, &[0]).expect("a world").is_empty());
    let event = batch.events(&[0]).expect("a world")[0];
    assert!(event.kind == "broke" && event.value > 1.0, "{event:?}");
    let mut speed = [0.0; 6];
    batch.world(0).read(Column::JointSpeed, &mut speed);
    assert!(speed.iter().all(|x| x.is_nan()));
}

/// A backend that counts its steps.
struct Counting(std::sync::Arc<std::sync::atomic::AtomicUsize>, Cpu);

impl drystone::Backend for Counting {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> String {
        self.1.adapter()
    }

    fn run_checked(&mut self, step: drystone::stages::backend::CheckedStep) -> Result<()> {
        self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.1.run_checked(step)
    }
}

/// Worlds of any size with equal rules are one problem on a backend that the caller chose.
#[test]
fn equal_worlds_are_one_problem_of_a_chosen_backend() {
    let config = SolverConfig::default().without_sleep();
    let piles = [scene("pile", &["n=300"]), scene("pile", &["n=300", "seed=5"])];
    let worlds = || piles.iter().cycle().take(6).map(|scene| (&scene.world, scene.dt, config.clone()));
    let steps = std::sync::Arc::default();
    let chosen = Box::new(Counting(std::sync::Arc::clone(&steps), Cpu::new()));
    let mut together = Batch::new(worlds()).and_then(|batch| batch.on_backend(chosen)).expect("good worlds");
    let mut apart = Batch::new(worlds()).expect("good worlds");
    let all = [0, 1, 2, 3, 4, 5];
    assert_eq!(hashes(&mut together, &all, 20), hashes(&mut apart, &all, 20));
    // In the first step all fall, and friction begins in all worlds within a step or two of each other.
    let steps = steps.load(std::sync::atomic::Ordering::Relaxed);
    assert!((20..30).contains(&steps), "{steps} steps of the backend");
}
