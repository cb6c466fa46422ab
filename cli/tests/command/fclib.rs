//! `drystone export --fclib`, and `drystone solve` of the exported files.
#![cfg(feature = "fclib")]

use std::path::Path;
use std::process::{Command, Output};

use crate::common::contacts::{sweeps_to, tower};
use drystone::config::Method;
use drystone_problems::ContactProblem;
use drystone_problems::solver::Order;

fn run(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder).output().expect("it starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("text")
}

/// Fails unless the program refuses the arguments in one line that names all of `named`.
#[track_caller]
fn refused(folder: &Path, arguments: &str, named: &[&str]) {
    let output = run(folder, arguments);
    let line = text(&output.stderr);
    assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{arguments}: {line}");
    assert!(named.iter().all(|part| line.contains(part)), "{arguments}: {line}");
}

#[test]
fn an_exported_problem_is_the_same_problem() {
    let folder = tempfile::tempdir().expect("a folder");
    let problem = tower(&[1.0, 3.0, 0.5, 2.0]);
    std::fs::write(folder.path().join("tower.contacts"), problem.to_text()).expect("written");
    let output = run(folder.path(), "export tower.contacts --fclib tower.hdf5");
    assert_eq!(text(&output.stdout), "tower.hdf5: 4 bodies, 16 contacts\n", "{}", text(&output.stderr));
    // There are no unfinished files.
    let names = std::fs::read_dir(folder.path()).expect("a folder").map(|e| e.expect("an entry").file_name());
    assert_eq!(names.count(), 2);

    let read = ContactProblem::read(folder.path().join("tower.hdf5")).expect("read");
    assert_eq!(read.name, problem.name);
    for method in [Method::Plain, Method::Accelerated] {
        let sweeps = |p| sweeps_to(p, (method, Order::Contacts), None, &[1e-1, 1e-2, 1e-3], 5000);
        let expected = sweeps(&problem);
        assert!(expected.iter().all(Option::is_some));
        assert_eq!(sweeps(&read), expected, "{method:?}");
    }
    let solved = run(folder.path(), "solve tower.hdf5 --sweeps 8");
    assert!(text(&solved.stdout).starts_with("tower of 4: 4 bodies, 16 contacts"), "{}", text(&solved.stdout));
}

#[test]
fn a_step_of_a_scene_is_exported_and_solved() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = run(folder.path(), "export pile -p n=27 --step 60 --fclib pile.hdf5");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let pile = ContactProblem::read(folder.path().join("pile.hdf5")).expect("read");
    assert!(pile.name == "pile, step 60" && pile.bodies.len() == 27 && pile.contacts.len() > 27, "{}", pile.name);
    let sweeps = sweeps_to(&pile, (Method::Accelerated, Order::Manifolds), None, &[1e-6], 20_000);
    assert!(sweeps[0].is_some(), "{} contacts", pile.contacts.len());
}

#[test]
fn bad_input_ends_in_one_line_that_names_the_file_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("tower.contacts"), tower(&[1.0]).to_text()).expect("written");
    let whole = tower(&[1.0]).to_fclib().expect("written");
    std::fs::write(file("torn.hdf5"), &whole[..whole.len() - 1]).expect("written");
    std::fs::write(file("zeros.hdf5"), [0xff; 64]).expect("written");
    let before = std::fs::read_dir(folder.path()).expect("a folder").count();
    for (arguments, named) in [
        ("export nowhere.contacts --fclib out.hdf5", &["nowhere.contacts"][..]),
        ("export torn.hdf5 --fclib out.hdf5", &["torn.hdf5: not a whole HDF5 file", "bytes"]),
        ("export zeros.hdf5 --fclib out.hdf5", &["zeros.hdf5: neither text nor HDF5"]),
        ("export tower.contacts --fclib nowhere/out.hdf5", &["nowhere/out.hdf5"]),
        ("export tower.contacts --step 3 --fclib out.hdf5", &["tower.contacts", "--step"]),
        ("export tower --fclib out.hdf5", &["tower", "--step N"]),
        ("export twoer --step 3 --fclib out.hdf5", &["twoer", "neither a scene"]),
        ("export chain --step 3 --fclib out.hdf5", &["chain, step 3", "joints"]),
        ("export sphere-plane --step 1 --fclib out.hdf5", &["sphere-plane, step 1: no awake body touches another"]),
        ("solve torn.hdf5", &["torn.hdf5: not a whole HDF5 file"]),
    ] {
        refused(folder.path(), arguments, named);
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), before);
}

/// A file of a local problem: a ball of 2 kg that falls onto the ground, and slides.
fn local(group: &str) -> Vec<u8> {
    let mut file = hdf5_pure::FileBuilder::new();
    let mut local = file.create_group(group);
    local.create_dataset("spacedim").with_i32_data(&[3]);
    let mut w = local.create_group("W");
    for (name, number) in [("m", 3), ("n", 3), ("nz", 3), ("nzmax", 3)] {
        w.create_dataset(name).with_i32_data(&[number]);
    }
    w.create_dataset("p").with_i32_data(&[0, 1, 2]);
    w.create_dataset("i").with_i32_data(&[0, 1, 2]);
    w.create_dataset("x").with_f64_data(&[0.5; 3]);
    local.add_group(w.finish());
    let mut vectors = local.create_group("vectors");
    vectors.create_dataset("q").with_f64_data(&[-1.0, 3.0, 0.0]);
    vectors.create_dataset("mu").with_f64_data(&[0.25]);
    local.add_group(vectors.finish());
    file.add_group(local.finish());
    file.finish().expect("a file")
}

#[test]
fn a_problem_without_bodies_is_solved_in_double_precision_and_refused_on_lanes_and_gpu() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("ball.hdf5"), local("fclib_local")).expect("written");
    std::fs::write(folder.path().join("rolling.hdf5"), local("fclib_local_rolling")).expect("written");
    let output = run(folder.path(), "solve ball.hdf5 --method newton --json");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    // It bears 1/0.5 N s, and friction takes a quarter of that from the slip.
    let impulse = report["impulses"][0].as_array().expect("an impulse");
    for (number, expected) in impulse.iter().zip([2.0, -0.5, 0.0]) {
        assert!((number.as_f64().expect("a number") - expected).abs() < 1e-6, "{report}");
    }
    for method in ["plain", "accelerated"] {
        let output = run(folder.path(), &format!("solve ball.hdf5 --method {method} --tolerance 1e-6 --json"));
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
        assert_eq!((&report["bodies"], &report["contacts"], &report["colors"]), (&0.into(), &1.into(), &1.into()));
        assert!(report["curve"][0]["e_vel"].as_f64() < Some(1e-6), "{report}");
    }
    for (arguments, named) in [
        ("solve ball.hdf5 --backend cpu", &["ball.hdf5: fclib_local: has no bodies", "use --backend f64, not cpu"][..]),
        ("solve ball.hdf5 --backend gpu", &["has no bodies", "use --backend f64, not gpu"]),
        ("solve ball.hdf5 --order manifolds", &["has no bodies", "use --order contacts"]),
        ("solve rolling.hdf5", &["rolling.hdf5: fclib_local_rolling: rolling friction cannot be read"]),
        ("export ball.hdf5 --fclib out.hdf5", &["ball.hdf5: fclib_local: has no bodies, but bodies are needed"]),
    ] {
        refused(folder.path(), arguments, named);
    }
}
