//! A batch on one device: each world has the bits that it has in a batch on the processor, whatever fails.

use std::sync::Mutex;
use std::time::Duration;

use drystone::backend::gpu::{Faults, GpuOptions, Loss};
use drystone::batch::{Batch, Run};
use drystone::config::Method;
use drystone::glam::Vec3;
use drystone::{Gpu, SolverConfig, World};
use drystone_scenes::Scene;

tests! {
    exact_gpu {
        a_batch_on_a_device_has_the_bits_of_one_on_the_processor,
        a_batch_goes_on_after_its_device_is_lost,
        a_batch_that_outgrows_its_device_goes_on_on_the_processor,
    }
}

/// Worlds of many kinds: with and without joints, contacts, sleep and torques, larger than a group takes, and one whose
/// sweeps depend on all of its islands together.
fn worlds() -> Vec<(Scene, SolverConfig)> {
    let find = |spec: &str| Scene::find_spec(spec).expect("a scene");
    let default = SolverConfig::default();
    let of = |spec: &str, config: &SolverConfig| (find(spec), config.clone());
    vec![
        of("tower:n=5", &default),
        of("tower:n=7", &default),
        of("drawbridge", &default),
        of("pile:n=200", &default),
        of("ragdoll", &default),
        of("tower:n=3", &default.clone().without_sleep()),
        of("pile:n=27", &default.clone().with(|c| c.method = Method::Accelerated)),
        of("chain", &default),
        of("drop", &default),
    ]
}

fn exact(options: GpuOptions) -> Gpu {
    // Losses are counted in submissions, and a plan is cut by time on a busy machine.
    let options = GpuOptions { exact: true, submission: Duration::from_secs(10_000), ..options };
    Gpu::open(options).unwrap_or_else(|e| panic!("{e}"))
}

fn batch(worlds: &[(Scene, SolverConfig)]) -> Batch {
    let worlds = worlds.iter().map(|(scene, config)| (&scene.world, scene.dt, config.clone()));
    Batch::new(worlds).and_then(|batch| batch.on_threads(2)).expect("good worlds")
}

/// The hash of each world after each step, the worlds that failed, and the faults by world and step.
type Ran = (Vec<Vec<u64>>, Vec<usize>, Vec<(usize, u64, String)>);

/// Steps some worlds. World 1 gets a force that is no number in step 12.
fn run(batch: &mut Batch, chosen: &[usize], steps: u64) -> Ran {
    let hashes = Mutex::new(vec![Vec::new(); batch.len()]);
    let faults = Mutex::new(Vec::new());
    let before = |&world: &usize, step, bodies: &mut World| {
        let last = bodies.bodies.len() - 1;
        if step % 9 == 4 {
            bodies.bodies[last].apply_impulse(Vec3::new(20.0 * world as f32, 5.0, 0.0));
        }
        if (world, step) == (1, 12) {
            bodies.bodies[last].force.x = f32::NAN;
        }
        Ok(())
    };
    let tasks = chosen.iter().map(|&world| (world, world)).collect();
    let failed = batch.run(Run { steps, ..Run::default() }, tasks, before, |&mut world, step, member| {
        hashes.lock().expect("no panic")[world].push(member.hash());
        let fault = member.stats().fault.iter().map(|line| (world, step, line.clone()));
        faults.lock().expect("no panic").extend(fault);
    });
    let mut faults = faults.into_inner().expect("no panic");
    faults.sort();
    (hashes.into_inner().expect("no panic"), failed.expect("good worlds"), faults)
}

fn a_batch_on_a_device_has_the_bits_of_one_on_the_processor() {
    let worlds = worlds();
    let chosen = [0, 1, 2, 3, 4, 5, 6, 8];
    let mut ours = batch(&worlds);
    let mut theirs = batch(&worlds).on_backend(Box::new(exact(GpuOptions::default()))).expect("threads");
    assert_eq!((ours.backend(), theirs.backend()), ("cpu", "gpu"));
    let untouched = theirs.world(7).hash();
    let (expected, failed, _) = run(&mut ours, &chosen, 40);
    let (found, failed_there, faults) = run(&mut theirs, &chosen, 40);
    assert_eq!((&failed[..], &failed_there[..], &faults[..]), (&[1][..], &[1][..], &[][..]));
    for (world, (expected, found)) in expected.iter().zip(&found).enumerate() {
        let first = expected.iter().zip(found).position(|(a, b)| a != b);
        assert_eq!((expected.len(), first), (found.len(), None), "world {world}");
        // Where a world stopped, and where one begins that was not named.
        assert_eq!(ours.world(world).hash(), theirs.world(world).hash(), "world {world}");
    }
    assert_eq!((theirs.world(1).steps(), theirs.world(7).hash()), (12, untouched));
}

fn a_batch_goes_on_after_its_device_is_lost() {
    let worlds: Vec<_> = worlds().into_iter().take(5).collect();
    let losses = vec![Loss { submission: 20, during: true }];
    let options = GpuOptions { faults: Faults { losses, ..Faults::default() }, ..GpuOptions::default() };
    let mut ours = batch(&worlds);
    let mut theirs = batch(&worlds).on_backend(Box::new(exact(options))).expect("threads");
    let all = [0, 2, 3, 4];
    let (expected, ..) = run(&mut ours, &all, 30);
    let (found, failed, faults) = run(&mut theirs, &all, 30);
    assert!(expected == found && failed.is_empty(), "{failed:?}");
    // Worlds of other kinds ran in that step before the loss.
    assert!(!faults.is_empty() && faults.iter().all(|fault| fault.1 == faults[0].1), "{faults:?}");
    assert!(faults.iter().all(|(_, _, line)| line.contains("was lost") && line.lines().count() == 1), "{faults:?}");
    assert_eq!((theirs.backend(), theirs.fault()), ("gpu", Some(faults[0].2.as_str())));
    let (_, failed, faults) = run(&mut theirs, &all, 1);
    assert!(failed.is_empty() && faults.is_empty() && theirs.fault().is_none());
}

fn a_batch_that_outgrows_its_device_goes_on_on_the_processor() {
    let worlds: Vec<_> = worlds().into_iter().take(5).collect();
    let options = GpuOptions { buffer_limit: 20_000, ..GpuOptions::default() };
    let mut ours = batch(&worlds);
    let mut theirs = batch(&worlds).on_backend(Box::new(exact(options))).expect("threads");
    let (expected, ..) = run(&mut ours, &[0, 2, 3], 30);
    let (found, failed, faults) = run(&mut theirs, &[0, 2, 3], 30);
    assert!(expected == found && failed.is_empty(), "{failed:?}");
    assert!(!faults.is_empty() && faults.iter().all(|(_, step, _)| *step == faults[0].1), "{faults:?}");
    assert_eq!(theirs.backend(), "cpu");
}
