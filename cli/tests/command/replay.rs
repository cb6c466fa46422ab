//! `drystone run --record` and `drystone replay`.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn drystone(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder).env("DRYSTONE_ADAPTER", "none");
    command.output().expect("the command starts")
}

fn replayed(folder: &Path, arguments: &str) -> Value {
    let output = drystone(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

fn refusal(folder: &Path, arguments: &str) -> String {
    let output = drystone(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments}");
    String::from_utf8(output.stderr).expect("text")
}

#[test]
fn a_recorded_run_goes_the_same_way_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let run = drystone(at, "run drum --steps 40 --backend cpu --record drum.rec --hash-every 8 --state-every 16");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let all = replayed(at, "replay drum.rec --backend reference --json");
    assert_eq!((&all["title"], &all["steps"], &all["first"]), (&"drum".into(), &40.into(), &Value::Null));
    assert_eq!(replayed(at, "replay drum.rec --from 35 --json")["hash"], all["hash"]);
    assert_ne!(replayed(at, "replay drum.rec --to 35 --json")["hash"], all["hash"]);
    // A damaged state is found before anything runs.
    let mut bytes = std::fs::read(at.join("drum.rec")).expect("the recording");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(at.join("bad.rec"), bytes).expect("a file");
    let line = refusal(at, "replay bad.rec");
    assert!(line.starts_with("drystone: bad.rec: the recording cannot be replayed: "), "{line}");
    assert!(refusal(at, "replay drum.rec --from 41").contains("ends after step 40"));
    assert!(refusal(at, "run drum --steps 2 --record missing/drum.rec").contains("missing/drum.rec"));
    assert!(!at.join("missing").exists());
}
