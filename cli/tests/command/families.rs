//! `drystone hard --families`: shares, and seeds that `drystone run` takes.

use std::process::{Command, Output};

use serde_json::Value;

fn run(arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).env("DRYSTONE_ADAPTER", "none").output().expect("the command starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

fn output(arguments: &str) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn json(arguments: &str) -> Value {
    serde_json::from_str(&output(arguments)).expect("JSON")
}

/// Without friction no block stays on a slope, and those that slide are too fast.
#[test]
fn worlds_that_fail_are_printed_as_commands_that_run_them() {
    let printed = output("hard --families 2 --seed 5 --family slopes --set friction=none");
    assert!(
        printed.starts_with("slopes  ") && printed.contains("\n  0 of 2 pass: 0.0 %, 0.0 to 65.8 % with"),
        "{printed}"
    );
    assert_eq!(printed.lines().filter(|line| line.starts_with("    FAIL  ")).count(), 2, "{printed}");
    let commands: Vec<_> = printed.lines().filter_map(|line| line.strip_prefix("  drystone ")).collect();
    assert_eq!(commands, [5, 6].map(|seed| format!("run family:kind=slopes,seed={seed} --no-sleep")));
    let hash = |arguments: &str| json(&format!("{arguments} --steps 3 --json"))["hash"].clone();
    let hashes = [0, 1].map(|k| hash(commands[k]));
    assert!(hashes[0].is_string() && hashes[0] != hashes[1], "{hashes:?}");
    // The same world by parameters.
    assert_eq!(hash("run family -p kind=slopes -p seed=5 --no-sleep"), hashes[0]);
}

/// The parts of two machines have the worlds of one run, and a run goes on after the worlds that are in its file.
#[test]
fn parts_of_a_survey_merge_to_the_whole_and_a_run_continues() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).display().to_string();
    let what = "hard --families 3 --family slopes --family pushed-blocks --set friction=none";
    let part = |k: u32| {
        let out = file(&format!("part-{k}.csv"));
        (output(&format!("{what} --shard {k}/2 --out {out}")), out)
    };
    let [(first, a), (_, b)] = [1, 2].map(part);
    assert!(first.contains("of 2 pass") && first.contains("of 1 pass"), "{first}");
    let whole = output(what);
    let merged = file("all.csv");
    let of_parts = output(&format!("{what} --merge {a} {b} --out {merged}"));
    // Times differ from run to run.
    let without_times = |text: &str| -> Vec<String> {
        text.lines().map(|line| line.split(" confidence").next().unwrap_or_default().to_owned()).collect()
    };
    assert_eq!(without_times(&of_parts), without_times(&whole));
    // All worlds are known: nothing runs, and the times are those of the file.
    assert_eq!(output(&format!("{what} --out {merged}")), of_parts);
    let before = std::fs::read_to_string(&a).expect("rows");
    assert_eq!(output(&format!("{what} --shard 1/2 --out {a}")), first);
    assert_eq!(std::fs::read_to_string(&a).expect("rows"), before);
    let refused = run(&format!("{what} --merge {a}"));
    let line = text(&refused.stderr);
    assert!(refused.status.code() == Some(2) && line.contains("no rows of family:kind=slopes,seed=2"), "{line}");
}

#[test]
fn the_share_as_json_has_every_world_with_its_checks() {
    let all = json("hard --families 3 --family slopes --family pushed-blocks --json");
    assert_eq!((&all["preset"], &all["seed"]), (&"balanced".into(), &1.into()));
    let families = all["families"].as_array().expect("families");
    let names: Vec<_> = families.iter().map(|family| family["family"].as_str().expect("a name")).collect();
    assert_eq!(names, ["slopes", "pushed-blocks"]);
    for family in families {
        assert_eq!(
            (&family["count"], &family["passed"], &family["share"]),
            (&3.into(), &3.into(), &1.0.into()),
            "{family}"
        );
        assert!(family["ms"].as_f64().is_some_and(|ms| ms > 0.0), "{family}");
        let worlds = family["worlds"].as_array().expect("worlds");
        assert_eq!(worlds.iter().map(|world| world["seed"].clone()).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(
            worlds.iter().all(|world| world["checks"].as_array().is_some_and(|checks| checks.len() == 2)),
            "{family}"
        );
    }
}

#[test]
fn what_is_no_family_no_number_or_no_seed_is_refused() {
    for (arguments, word) in [
        ("hard --families 0", "'0'"),
        ("hard --families 2 --family stcks", "'stcks'"),
        ("hard --families 2 --seed one", "'one'"),
        ("hard --families 2 --seed 9007199254740992", "2^53"),
        ("hard --family stacks", "--families <N>"),
        ("run family:kind=stcks", "did you mean \"stacks\"?"),
        ("run family:kind=stacks,seed=-1", "seed = \"-1\": must be a whole number from 0"),
        ("run family:kind=stacks,sede=1", "did you mean \"seed\"?"),
    ] {
        let output = run(arguments);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(word) && !message.contains("panicked"), "{arguments}: {message}");
        assert!(output.stdout.is_empty(), "{arguments}");
    }
}
