//! `drystone play maze` without a window.

use std::process::Command;

use serde_json::Value;

/// The output of the command, or its error.
fn command(arguments: &str) -> Result<String, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("bad.txt"), "S..\n.x.\n..G\n").expect("a file");
    std::fs::write(folder.path().join("script.txt"), "0 0 0\n1 0 9\n").expect("a file");
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../maze");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    let arguments = arguments.replace("MAZE", root);
    let output = command.args(arguments.split(' ')).current_dir(&folder).output().expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    if output.status.success() { Ok(text(output.stdout)) } else { Err(text(output.stderr)) }
}

#[test]
fn the_command_prints_outcome_and_track() {
    let printed = command("play maze easy --script MAZE/tests/maze/easy.txt --json").expect("a game");
    let game: Value = serde_json::from_str(&printed).expect("JSON");
    assert_eq!((&game["outcome"], &game["board"]), (&"goal".into(), &"easy".into()));
    assert!(game["track"].as_array().is_some_and(|t| t.len() > 100 && t[0]["ball"][1].as_f64() > Some(0.014)));
    assert!(game["slip"]["rms"].as_f64() < Some(1e-3));
}

#[test]
fn the_pilot_writes_a_script_that_wins() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("way.txt").display().to_string();
    command(&format!("play maze medium --pilot {path}")).expect("a script");
    let printed = command(&format!("play maze medium --script {path}")).expect("a game");
    assert!(printed.contains("won"), "{printed}");
}

#[test]
fn bad_maps_and_scripts_are_refused_in_one_line_with_line_and_column() {
    for (arguments, parts) in [
        ("play maze bad.txt --script script.txt", ["bad.txt", "line 2, column 2"]),
        ("play maze easy --script script.txt", ["script.txt", "line 2, column 5"]),
        ("play maze easy --script nowhere.txt", ["nowhere.txt", "No such file"]),
        ("play maze hardest --script script.txt", ["hardest", "easy, medium, hard"]),
    ] {
        let message = command(arguments).expect_err(arguments);
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}
