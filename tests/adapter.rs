//! The command line on a machine without the adapter that is asked for.

use std::process::{Command, Output};

/// Runs the command with an adapter asked for that does not exist.
fn without_adapter(arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).env("DRYSTONE_ADAPTER", "no-such-adapter");
    // Display libraries grumble on standard error without a place for sockets.
    command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.output().expect("the command starts")
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_gpu_that_is_not_there_is_refused_with_what_was_looked_for_and_what_to_install() {
    for arguments in ["run drop --steps 1 --backend gpu", "compare drop --steps 1"] {
        let output = without_adapter(arguments);
        let line = errors(&output);
        assert_eq!(output.status.code(), Some(3), "{line}");
        assert_eq!(line.lines().count(), 1, "{line}");
        for part in ["no adapter found", "DRYSTONE_ADAPTER=no-such-adapter", "Vulkan", "install"] {
            assert!(line.contains(part), "{part} is not in: {line}");
        }
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn auto_goes_on_with_the_cpu_whether_the_scene_is_small_or_large() {
    for (scene, why) in [("drop", "cpu: "), ("pile -p n=5000", "cpu: no hardware GPU found")] {
        let output = without_adapter(&format!("run {scene} --steps 1 --backend auto"));
        let line = errors(&output);
        assert_eq!(output.status.code(), Some(0), "{line}");
        assert!(line.starts_with(why), "{line}");
        assert!(!output.stdout.is_empty());
    }
}

#[test]
fn the_list_of_adapters_says_that_there_is_none() {
    let output = without_adapter("adapters");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "none; everything runs on the CPU\n");
}
