//! The scenes of `hashes.txt` have the same hashes on every backend, for any number of threads and lanes.
//!
//! `UPDATE_GOLDEN=1 cargo test --test golden reference` writes the file again; `tests/platforms` runs the scenes on other platforms.

use std::path::Path;

use drystone::{Backend, Cpu, Reference, Simulation, SolverConfig, World};
use drystone_scenes::Scene;

mod scenes;
mod table;

use scenes::all;
use table::{Row, differences, rows, text};

/// The file, as it was when this test was compiled.
const HASHES: &str = include_str!("hashes.txt");

/// The rows of all scenes on some backend, in a pool of so many threads.
fn rows_on(mut backend: Box<dyn Backend>, threads: usize) -> Vec<Row> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| {
        let scenes = all();
        let mut rows = Vec::with_capacity(scenes.len());
        for scene in scenes {
            let (row, back) = scene.run(backend, |_| {});
            backend = back;
            rows.push(row);
        }
        rows
    })
}

#[track_caller]
fn assert_golden(what: &str, found: &[Row]) {
    let golden = rows(HASHES).expect("a file of hashes");
    let different = differences(&golden, found);
    let hint = "if the numbers are meant to change: UPDATE_GOLDEN=1 cargo test --test golden reference";
    assert!(different.is_empty(), "{what}:\n{}\n{hint}", different.join("\n"));
}

#[test]
fn the_reference_has_the_golden_hashes() {
    let found = rows_on(Box::new(Reference::<f32>::new()), 1);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/hashes.txt");
        return std::fs::write(path, text(&found)).expect("the file can be written");
    }
    assert_golden("reference", &found);
}

#[test]
fn every_instruction_set_has_the_golden_hashes() {
    for cpu in Cpu::each() {
        let name = cpu.adapter();
        assert_golden(&name, &rows_on(Box::new(cpu), 1));
    }
    // `the_sets_that_are_tried_are_those_that_the_processor_has` in tests/cpu/lanes.rs names the sets that the processor lacks.
}

#[test]
fn any_number_of_threads_has_the_golden_hashes() {
    for threads in [2, 3, 7] {
        assert_golden(&format!("{threads} threads"), &rows_on(Box::new(Cpu::new()), threads));
    }
    assert_golden("reference, 3 threads", &rows_on(Box::new(Reference::<f32>::new()), 3));
}

/// The hashes see what a backend computes, and not only where the bodies began.
#[test]
fn double_precision_has_other_hashes() {
    let golden = rows(HASHES).expect("a file of hashes");
    let found = rows_on(Box::new(Reference::<f64>::new()), 1);
    let different = differences(&golden, &found);
    assert!(different.len() > 35, "{different:?}");
}

#[test]
fn the_file_has_the_scenes_and_no_two_runs_alike() {
    let golden = rows(HASHES).expect("a file of hashes");
    assert_eq!(text(&golden), HASHES);
    let names: Vec<_> = golden.iter().map(|row| row.scene.as_str()).collect();
    assert_eq!(names, all().iter().map(|scene| scene.name).collect::<Vec<_>>());
    let hashes: std::collections::HashSet<u64> = golden.iter().map(|row| row.hash).collect();
    assert!(golden.len() >= 30 && hashes.len() == golden.len());
}

#[test]
fn one_bit_and_one_missing_scene_are_named() {
    let golden = rows(HASHES).expect("a file of hashes");
    let mut found = golden.clone();
    assert_eq!(differences(&golden, &found), [""; 0]);
    found[3].hash ^= 1 << 63;
    found[5].steps += 1;
    let gone = found.remove(7).scene;
    found.push(Row { scene: "new".into(), steps: 1, hash: 2 });
    let named: Vec<String> =
        differences(&golden, &found).iter().map(|line| line.split(':').next().unwrap().into()).collect();
    assert_eq!(named, [golden[3].scene.clone(), golden[5].scene.clone(), "new".into(), gone]);
}

#[test]
fn a_line_that_is_no_row_is_refused() {
    for line in ["pile 120", "pile 120 0123 4", "pile many 0123", "pile 120 xyz"] {
        assert!(rows(line).is_err_and(|why| why.contains(line)), "{line}");
    }
}

/// A setting that differs by one unit in its last place, and a body whose place does, change the hash.
#[test]
fn the_last_bit_of_a_setting_and_of_a_place_change_the_hash() {
    let pile = |change: fn(&mut SolverConfig, &mut World)| {
        let (mut config, mut world) = (SolverConfig::default(), Scene::find_spec("pile:n=12").expect("a pile").world);
        change(&mut config, &mut world);
        let mut simulation = Simulation::with(world, config, Box::new(Reference::<f32>::new())).expect("a pile");
        (0..60).for_each(|_| drop(simulation.step(1.0 / 60.0).expect("a step")));
        simulation.hash()
    };
    let same = pile(|_, _| {});
    assert_eq!(same, pile(|_, _| {}));
    assert_ne!(same, pile(|config, _| config.contact_damping = config.contact_damping.next_up()));
    assert_ne!(
        same,
        pile(|_, world| {
            let x = &mut world.bodies.iter_mut().next_back().expect("a box").position.x;
            *x = x.next_up();
        })
    );
}
