//! The crates that a program gets with the library.

use std::collections::BTreeSet;
use std::process::Command;

/// What only the command needs.
const OF_THE_COMMAND: [&str; 9] =
    ["clap", "plotters", "comfy-table", "indicatif", "csv", "toml", "humantime", "cpu-time", "signal-hook"];

/// The names and versions of all crates that are built into the library with these features, the library included.
fn crates(features: &[&str]) -> BTreeSet<String> {
    crates_of("drystone", features)
}

/// The same of another package.
fn crates_of(package: &str, features: &[&str]) -> BTreeSet<String> {
    let mut command = Command::new(env!("CARGO"));
    command.current_dir(crate::ROOT);
    command.args(["tree", "--offline", "--package", package, "--edges", "normal", "--prefix", "none"]).args(features);
    let output = command.output().expect("cargo runs");
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

fn has(crates: &BTreeSet<String>, name: &str) -> bool {
    crates.iter().any(|line| line.split(' ').next() == Some(name))
}

#[test]
fn a_program_takes_few_crates_along_with_the_library() {
    for (features, most) in [(&[][..], 100), (&["--no-default-features"][..], 60)] {
        let crates = crates(features);
        println!("{features:?}: {} crates", crates.len());
        assert!(has(&crates, "drystone") && has(&crates, "parry3d"), "{crates:?}");
        assert!(crates.len() <= most, "{} crates of at most {most}: {crates:?}", crates.len());
    }
}

#[test]
fn no_crate_of_the_command_is_built_into_the_library() {
    let crates = crates(&["--all-features"]);
    assert!(["wgpu", "naga", "schemars"].iter().all(|name| has(&crates, name)), "{crates:?}");
    let found: Vec<_> = OF_THE_COMMAND.iter().filter(|name| has(&crates, name)).collect();
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn without_its_feature_nothing_of_the_gpu_is_built() {
    let found = |package, features: &[&str]| {
        let crates = crates_of(package, features);
        ["wgpu", "wgpu-core", "wgpu-hal", "wgpu-types", "naga", "pollster"].map(|name| has(&crates, name))
    };
    assert_eq!(found("drystone", &[]), [true; 6]);
    assert_eq!(found("drystone", &["--no-default-features", "--features", "schema"]), [false; 6]);
    assert_eq!(found("drystone-cli", &[]), [true; 6]);
    assert_eq!(found("drystone-cli", &["--no-default-features", "--features", "fclib"]), [false; 6]);
}
