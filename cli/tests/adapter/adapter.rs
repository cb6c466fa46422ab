//! The command line and the tests on a machine without the requested adapter.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::gpu::{self, Need};
use drystone::backend::gpu::AdapterSummary;

tests! {
    no_gpu {
        a_gpu_that_is_not_there_is_refused_with_the_request_and_the_package_to_install,
        auto_takes_the_cpu_for_small_and_large_scenes,
        the_list_of_adapters_says_that_there_is_none,
        a_test_fails_on_an_adapter_that_lacks_an_ability,
        a_test_is_ignored_only_by_request,
        without_vulkan_tests_of_exact_mode_fail_and_name_the_adapter,
        without_an_adapter_the_tests_that_need_one_are_ignored_and_counted,
        tests_of_a_gpu_stand_in_binaries_that_can_ignore_them_and_every_test_there_is_run,
    }
    any_gpu {
        adapters_are_listed_with_their_abilities,
    }
    exact_gpu {
        exact_mode_opens_where_the_adapter_has_it,
    }
}

/// Runs the command with a requested adapter that does not exist.
fn without_adapter(arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split(' ')).env("DRYSTONE_ADAPTER", "no-such-adapter");
    // Without a folder for sockets, display libraries print errors.
    command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.output().expect("the command starts")
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn a_gpu_that_is_not_there_is_refused_with_the_request_and_the_package_to_install() {
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

fn auto_takes_the_cpu_for_small_and_large_scenes() {
    for (scene, why) in [("drop", "cpu: "), ("pile -p n=5000", "cpu: no hardware GPU found")] {
        let output = without_adapter(&format!("run {scene} --steps 1 --backend auto"));
        let line = errors(&output);
        assert_eq!(output.status.code(), Some(0), "{line}");
        assert!(line.starts_with(why), "{line}");
        assert!(!output.stdout.is_empty());
    }
}

fn the_list_of_adapters_says_that_there_is_none() {
    let output = without_adapter("adapters");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "no adapters; everything runs on the CPU\n");
}

fn adapters_are_listed_with_their_abilities() {
    let found = gpu::plain().summary().clone();
    let output = Command::new(env!("CARGO_BIN_EXE_drystone")).args(["adapters", "--json"]).output().expect("it starts");
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let first = listed["adapters"][0].as_object().expect("an adapter");
    assert_eq!(
        Vec::from_iter(first.keys()),
        ["api", "buffer_limit", "driver", "hardware", "kind", "name", "takes_spirv"]
    );
    assert_eq!((&first["name"], &first["takes_spirv"]), (&found.name.into(), &found.takes_spirv.into()));
}

fn exact_mode_opens_where_the_adapter_has_it() {
    assert!(gpu::exact().is_exact() && !gpu::plain().is_exact());
}

/// An adapter of OpenGL, which has neither exact mode nor a clock.
fn opengl() -> AdapterSummary {
    AdapterSummary {
        name: "llvmpipe".into(),
        api: "Gl".into(),
        driver: "4.5".into(),
        kind: "software",
        hardware: false,
        takes_spirv: false,
        clock: false,
        buffer_limit: 1 << 27,
    }
}

fn a_test_fails_on_an_adapter_that_lacks_an_ability() {
    let vulkan = AdapterSummary { api: "Vulkan".into(), takes_spirv: true, clock: true, ..opengl() };
    for need in [Need::Adapter, Need::Exact, Need::Clock] {
        let line = need.refusal(None).expect("there is no adapter");
        assert!(line.contains("an adapter, and there is none") && line.contains("DRYSTONE_ADAPTER=none"), "{line}");
        assert_eq!(need.refusal(Some(&vulkan)), None);
    }
    assert_eq!(Need::Adapter.refusal(Some(&opengl())), None);
    for (need, word) in [(Need::Exact, "exact"), (Need::Clock, "clock")] {
        let line = need.refusal(Some(&opengl())).expect("OpenGL lacks it");
        let ending = format!("which llvmpipe (Gl, software; 4.5) lacks; DRYSTONE_WITHOUT={word} ignores such tests");
        assert!(line.ends_with(&ending) && line.lines().count() == 1, "{line}");
    }
}

fn a_test_is_ignored_only_by_request() {
    let ignored = |adapter, without| {
        [Need::Adapter, Need::Exact, Need::Clock]
            .map(|need| need.left_out(adapter, without).expect("known words").is_some())
    };
    assert_eq!(ignored("", ""), [false, false, false]);
    // The name of an adapter leaves out nothing.
    assert_eq!(ignored("llvmpipe", ""), [false, false, false]);
    assert_eq!(ignored("none", ""), [true, true, true]);
    assert_eq!(ignored("", "exact"), [false, true, false]);
    assert_eq!(ignored("", "clock, exact"), [false, true, true]);
    let line = Need::Adapter.left_out("", "exakt").expect_err("an unknown word");
    assert!(line.contains("\"exakt\" is unknown"), "{line}");
}

/// Runs the tests of this binary whose names contain `filter`, with these environment variables and no others of drystone.
fn tests_run(filter: &str, environment: &[(&str, &str)]) -> (bool, String) {
    let mut command = Command::new(std::env::current_exe().expect("this binary"));
    command.args([filter, "--test-threads=1"]).env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command.env_remove("DRYSTONE_ADAPTER").env_remove("DRYSTONE_WITHOUT").envs(environment.iter().copied());
    let output = command.output().expect("the tests start");
    (output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned() + &errors(&output))
}

/// The two names of the list of drivers in Vulkan's loader.
const WITHOUT_VULKAN: [(&str, &str); 2] = [("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];
/// A test of this binary that needs exact mode.
const OF_EXACT_MODE: &str = "exact_mode_opens_where";

fn without_vulkan_tests_of_exact_mode_fail_and_name_the_adapter() {
    let (passed, text) = tests_run(OF_EXACT_MODE, &WITHOUT_VULKAN);
    assert!(!passed && text.contains("0 passed; 1 failed; 0 ignored"), "{text}");
    // The adapter is an OpenGL driver if there is one.
    assert!(
        text.contains("this test needs exact mode, which") || text.contains("an adapter, and there is none"),
        "{text}"
    );
    let opted_out = [&WITHOUT_VULKAN[..], &[("DRYSTONE_WITHOUT", "exact")]].concat();
    let (passed, text) = tests_run(OF_EXACT_MODE, &opted_out);
    assert!(passed && text.contains("0 passed; 0 failed; 1 ignored"), "{text}");
    assert!(text.contains("DRYSTONE_WITHOUT=exact: 1 of 1 tests are ignored"), "{text}");
}

fn without_an_adapter_the_tests_that_need_one_are_ignored_and_counted() {
    let names = "adapters_are_listed_with_their_abilities";
    let (passed, text) = tests_run(names, &[("DRYSTONE_ADAPTER", "none")]);
    assert!(passed && text.contains("0 passed; 0 failed; 1 ignored"), "{text}");
    let (passed, text) = tests_run(names, &[("DRYSTONE_ADAPTER", "no-such-adapter")]);
    assert!(!passed && text.contains("0 passed; 1 failed; 0 ignored"), "{text}");
    assert!(text.contains("this test needs an adapter, and there is none"), "{text}");
}

/// Binaries with `harness = false` run only the tests in their lists; a test with cargo's attribute would not run.
fn tests_of_a_gpu_stand_in_binaries_that_can_ignore_them_and_every_test_there_is_run() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    every_test_is_run(own, &own.join("tests"));
    let tests = own.with_file_name("tests");
    every_test_is_run(&tests, &tests);
}

/// Checks the tests in `folder`, of the package in `root`.
fn every_test_is_run(root: &Path, folder: &Path) {
    let manifest: toml::Table =
        std::fs::read_to_string(root.join("Cargo.toml")).expect("it is there").parse().expect("TOML");
    let own: Vec<&str> = manifest["test"]
        .as_array()
        .expect("a list")
        .iter()
        .filter(|test| test.get("harness").and_then(toml::Value::as_bool) == Some(false))
        .map(|test| test["name"].as_str().expect("a name"))
        .collect();
    let (mut harnessed, mut others) = (0, 0);
    for folder in entries(folder).into_iter().filter(|path| path.join("main.rs").is_file()) {
        let name = folder.file_name().expect("a name").to_string_lossy();
        if own.contains(&&*name) {
            let main = std::fs::read_to_string(folder.join("main.rs")).expect("text");
            for file in entries(&folder).into_iter().filter(|path| !path.ends_with("main.rs")) {
                let module = file.file_stem().expect("a name").to_string_lossy();
                let (has, _) = words_of(&file);
                assert!(has("tests! {") && !has("#[test]"), "{name}/{module}: tests of this file go into its list");
                assert!(main.contains(&format!(" {module}::tests(),")), "{name}/main.rs does not run {module}");
                harnessed += 1;
            }
        } else {
            for file in sources(&folder) {
                let (has, text) = words_of(&file);
                let opened = ["Gpu::new(", "gpu::plain()", "gpu::exact()"].iter().find(|what| text.contains(**what));
                assert!(
                    !has("tests! {") && opened.is_none(),
                    "{}: a test of a GPU needs `harness = false` in Cargo.toml",
                    file.display()
                );
                others += 1;
            }
        }
    }
    assert!(harnessed > own.len() && others > 10, "{own:?}: {harnessed} and {others}");
}

/// Whether a line of a file begins with some words, and its text.
fn words_of(file: &Path) -> (impl Fn(&str) -> bool, String) {
    let text = std::fs::read_to_string(file).expect("text");
    let lines: Vec<_> = text.lines().map(|line| line.trim_start().to_owned()).collect();
    (move |what: &str| lines.iter().any(|line| line.starts_with(what)), text)
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect()
}

/// All files of Rust in a folder and in those in it.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let of_entry = |path: PathBuf| if path.is_dir() { sources(&path) } else { vec![path] };
    entries(folder).into_iter().flat_map(of_entry).filter(|path| path.extension().is_some_and(|e| e == "rs")).collect()
}
