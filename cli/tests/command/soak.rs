//! `drystone soak`: rows as they are measured, and a verdict.

use std::process::{Command, Output};

fn run(folder: &tempfile::TempDir, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder.path()).output().expect("the command starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

#[test]
fn a_soaked_world_leaves_rows_and_a_verdict() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = run(&folder, "soak shaken --steps 4000 --out rows.csv");
    let printed = text(&ran.stdout);
    assert!(printed.starts_with("shaken, 4000 steps\n  ") && printed.contains("kinetic energy"), "{printed}");
    let rows = std::fs::read_to_string(folder.path().join("rows.csv")).expect("rows");
    assert_eq!(rows.lines().count(), 101);
    let (header, last) = (rows.lines().next().expect("a header"), rows.lines().last().expect("a row"));
    assert!(header.starts_with("scene,step,ms,resident,state,") && last.starts_with("shaken,4000,"), "{header} {last}");
    // The rows alone give the same verdict.
    let judged = run(&folder, "soak --rows rows.csv");
    assert_eq!((text(&judged.stdout), judged.status.code()), (printed, ran.status.code()));
}

#[test]
fn a_world_that_grows_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&folder, "soak waking --steps 100 --out rows.csv");
    let rows = std::fs::read_to_string(folder.path().join("rows.csv")).expect("rows");
    let grown = |k: usize, row: &str| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        // The bytes of the saved state.
        cells[4] = (1000 + 10 * k).to_string();
        cells.join(",")
    };
    let planted: Vec<String> =
        rows.lines().enumerate().map(|(k, row)| if k == 0 { row.to_owned() } else { grown(k, row) }).collect();
    std::fs::write(folder.path().join("grown.csv"), planted.join("\n")).expect("rows");
    let judged = run(&folder, "soak --rows grown.csv");
    assert_eq!(judged.status.code(), Some(2));
    assert!(text(&judged.stdout).contains("FAIL  bytes of the saved state"), "{}", text(&judged.stdout));
    assert_eq!(text(&judged.stderr), "drystone: not level: waking\n");
}

#[test]
fn an_unknown_world_is_one_line_before_anything_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = run(&folder, "soak drum dram --out rows.csv");
    let message = text(&ran.stderr);
    assert_eq!((ran.status.code(), message.lines().count()), (Some(2), 1), "{message}");
    assert!(message.contains("dram") && !folder.path().join("rows.csv").exists(), "{message}");
}
