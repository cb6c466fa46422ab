//! `drystone conform`: lines, files and exit codes.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

tests! {
    any_gpu {
        a_fit_adapter_ends_with_0_and_one_that_is_wrong_with_1_in_lines_junit_and_json,
    }
    no_gpu {
        an_adapter_that_is_not_there_ends_with_3_and_bad_arguments_with_2,
    }
}

fn drystone(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).current_dir(folder).env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.output().expect("the command starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("text")
}

fn a_fit_adapter_ends_with_0_and_one_that_is_wrong_with_1_in_lines_junit_and_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let checks = "conform --plain --short --group kernels,limits --name integrate_velocities,end_changes,large";
    for (more, code, failed) in [("", 0, 0), (" --perturb", 1, 3)] {
        let output = drystone(folder.path(), &format!("{checks} --junit a.xml --json a.json{more}"));
        let printed = text(&output.stdout);
        assert_eq!(output.status.code(), Some(code), "{printed}{}", text(&output.stderr));
        assert_eq!(printed.lines().count(), 3, "{printed}");
        assert_eq!(printed.lines().filter(|line| line.starts_with("failed ")).count(), failed, "{printed}");
        let summary = text(&output.stderr).lines().find(|line| line.contains(" passed, ")).expect("a summary");
        assert!(summary.ends_with(&format!("{} passed, {failed} failed", 3 - failed)), "{summary}");
        let json = std::fs::read(folder.path().join("a.json")).expect("a file");
        let json: Value = serde_json::from_slice(&json).expect("JSON");
        assert_eq!((&json["passed"], &json["failed"]), (&(3 - failed).into(), &failed.into()), "{json}");
        assert_eq!(json["checks"][2]["group"], "limits");
        let xml = std::fs::read_to_string(folder.path().join("a.xml")).expect("a file");
        assert!(xml.contains(&format!("tests=\"3\" failures=\"{failed}\"")), "{xml}");
        assert_eq!(xml.matches("<failure message=").count(), failed, "{xml}");
        assert_eq!(xml.matches("<testcase classname=\"plain.kernels\"").count(), 2, "{xml}");
    }
}

fn an_adapter_that_is_not_there_ends_with_3_and_bad_arguments_with_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases = [
        ("conform --adapter no-such-adapter", 3, "no-such-adapter"),
        ("conform --group colors", 2, "colors"),
        ("conform --exact --plain", 2, "--plain"),
    ];
    for (arguments, code, part) in cases {
        let output = drystone(folder.path(), arguments);
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{errors}");
        assert!(errors.contains(part) && output.stdout.is_empty(), "{errors}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
}
