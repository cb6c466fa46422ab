//! `drystone solve`: output, and messages for bad input.

use std::process::{Command, Output};

use crate::common::contacts::tower;
use glam::DVec3;
use serde_json::Value;

/// Runs the command in a folder with a tower of ten, a problem whose numbers overflow, and an incomplete file.
fn run(arguments: &str) -> Output {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("tower.contacts"), tower(&[1.0; 10]).to_text()).expect("written");
    let mut fast = tower(&[1.0]);
    fast.bodies[0].free.linear = DVec3::NEG_Z * 1e300;
    std::fs::write(file("fast.contacts"), fast.to_text()).expect("written");
    std::fs::write(file("torn.contacts"), "contacts 1\ntorn\nbodies 1 contacts 1\nb 1 1 0 0 1 0 -1 0 0 0 0 0 0\n")
        .expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.arg("solve").args(arguments.split(' ')).current_dir(folder.path()).output().expect("it starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("text")
}

fn json(arguments: &str) -> Value {
    let output = run(&format!("{arguments} --json"));
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    serde_json::from_str(text(&output.stdout)).expect("one object")
}

fn column<'a>(rows: &'a Value, key: &str) -> Vec<&'a Value> {
    rows.as_array().expect("rows").iter().map(|row| &row[key]).collect()
}

#[test]
fn a_solve_reports_on_itself_as_json() {
    let report = json("tower.contacts --sweeps 100 --method plain --order contacts");
    assert_eq!(
        (&report["problem"], &report["bodies"], &report["contacts"]),
        (&"tower of 10".into(), &10.into(), &40.into())
    );
    assert_eq!(
        (&report["method"], &report["order"], &report["backend"]),
        (&"plain".into(), &"contacts".into(), &"f64".into())
    );
    assert_eq!((&report["colors"], &report["sweeps"]), (&8.into(), &100.into()));
    assert_eq!(column(&report["curve"], "sweeps"), [1, 2, 4, 8, 16, 32, 64, 100]);
    assert_eq!(column(&report["reached"], "sweeps"), [&79.into(), &Value::Null, &Value::Null, &Value::Null]);
    for key in "e_vel e_fclib vmax worst_contact pen_rate compl cone diss eom ms".split(' ') {
        assert!(column(&report["curve"], key).iter().all(|x| x.is_number()), "{key}");
    }
    assert!(report["ms"].as_f64() > Some(0.0));
}

#[test]
fn a_tolerance_ends_the_sweeps() {
    let report = json("tower.contacts --tolerance 1e-2 --order contacts");
    assert_eq!((&report["method"], &report["sweeps"]), (&"accelerated".into(), &47.into()));
    let rounded = json("tower.contacts --tolerance 1e-2 --backend cpu");
    assert!(rounded["sweeps"].as_u64() < Some(60) && rounded["colors"] == 3, "{rounded}");
    assert_eq!(rounded["backend"], "cpu");
    assert!(rounded["adapter"].as_str().is_some_and(|name| name.contains("16 lanes")), "{rounded}");
}

#[test]
fn newtons_method_says_what_ended_it() {
    let report = json("tower.contacts --method newton");
    assert_eq!((&report["method"], &report["backend"]), (&"newton".into(), &"f64".into()));
    assert_eq!((&report["ended"], &report["newton"]), (&"newton".into(), &"reached".into()), "{report}");
    assert!(report["residuals"]["e_vel"].as_f64() <= Some(1e-8), "{report}");
    assert!((5..=20).contains(&report["iterations"].as_u64().expect("a number")), "{report}");
    assert_eq!(report["impulses"].as_array().expect("impulses").len(), 40);
    // What sweeps do in a moment needs no step.
    let rough = json("tower.contacts --method newton --tolerance 0.5");
    assert_eq!(
        (&rough["ended"], &rough["newton"], &rough["iterations"]),
        (&"first-sweeps".into(), &"not-begun".into(), &0.into())
    );
    let output = run("tower.contacts --method newton");
    let printed = text(&output.stdout);
    for part in ["10 bodies, 40 contacts", "newton: ", "steps", "ended by Newton's method"] {
        assert!(printed.contains(part), "{part} is not in: {printed}");
    }
}

#[test]
fn a_solve_reports_on_itself_as_rows() {
    let output = run("tower.contacts --sweeps 64 --order contacts");
    let printed = text(&output.stdout);
    for part in ["10 bodies, 40 contacts, 8 colors", "accelerated", "e_vel < 1e-2 after 47 sweeps", "1e-4 not reached"]
    {
        assert!(printed.contains(part), "{part} is not in: {printed}");
    }
    let rows: Vec<_> = printed.lines().filter(|line| line.trim().starts_with(char::is_numeric)).collect();
    assert_eq!(rows.len(), 7);
    assert!(rows.iter().all(|row| row.split_whitespace().count() == 11), "{printed}");
}

#[test]
fn a_step_of_a_run_is_saved_and_solved() {
    let folder = tempfile::tempdir().expect("a folder");
    let drystone = |arguments: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
        command.args(arguments.split(' ')).current_dir(folder.path()).output().expect("it starts")
    };
    let output = drystone("run pile -p n=40 --steps 90 --no-sleep --save-problem 90:pile.contacts --backend cpu");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let output = drystone("solve pile.contacts --tolerance 1e-6 --json");
    let report: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!((&report["problem"], &report["bodies"]), (&"pile, step 90".into(), &40.into()));
    assert!(report["contacts"].as_u64() > Some(100) && report["reached"][3]["sweeps"].is_number(), "{report}");
    let last = report["curve"].as_array().and_then(|rows| rows.last()).expect("a row");
    assert!(last["e_vel"].as_f64() < Some(1e-6), "{last}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "something half-written stays");

    for (arguments, named) in [
        ("run pile --steps 10 --save-problem 11:x", &["--save-problem 11:x", "1 to 10"][..]),
        ("run pile --steps 10 --save-problem 0:x", &["1 to 10"]),
        ("run chain --steps 10 --save-problem 1:x", &["chain", "joints"]),
        ("run tower --steps 1 --save-problem 1:nowhere/x", &["nowhere/x"]),
    ] {
        let output = drystone(arguments);
        let line = text(&output.stderr).lines().last().expect("a line");
        assert_eq!(output.status.code(), Some(2), "{arguments}: {line}");
        assert!(named.iter().all(|part| line.contains(part)), "{arguments}: {line}");
    }
    for usage in ["run pile --save-problem 3", "run pile --save-problem x:y", "run pile --save-problem 3:"] {
        assert_eq!(drystone(usage).status.code(), Some(2), "{usage}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "what was refused left something");
}

#[test]
fn bad_input_ends_in_one_line_that_names_it() {
    for (arguments, named) in [
        ("nowhere.contacts", &["nowhere.contacts"][..]),
        ("torn.contacts", &["torn.contacts: line 4", "positive definite"]),
        ("tower.contacts --tolerance 0", &["--tolerance 0", "more than 0"]),
        ("tower.contacts --tolerance nan", &["--tolerance NaN"]),
        ("fast.contacts", &["fast.contacts", "finite"]),
        ("fast.contacts --method newton", &["fast.contacts", "finite"]),
        ("tower.contacts --method newton --sweeps 5", &["--sweeps", "not available with --method newton"]),
        ("tower.contacts --method newton --order contacts", &["--order", "not available with --method newton"]),
        ("tower.contacts --method newton --passes 2", &["--passes", "not available with --method newton"]),
        ("tower.contacts --method newton --backend cpu", &["--backend cpu", "newton runs in f64"]),
    ] {
        let output = run(arguments);
        let line = text(&output.stderr);
        assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{arguments}: {line}");
        assert!(named.iter().all(|part| line.contains(part)), "{arguments}: {line}");
    }
    for usage in
        ["tower.contacts --sweeps 0", "tower.contacts --sweeps 5 --tolerance 0.1", "tower.contacts --order random"]
    {
        assert_eq!(run(usage).status.code(), Some(2), "{usage}");
    }
}
