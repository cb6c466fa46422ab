//! The command line: output, and messages for bad input.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use drystone_scenes::Scene;
use serde_json::Value;

/// A folder for one test, in which the commands run.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.path().join(name), text).expect("a file");
        self
    }

    fn with_folder(self, name: &str) -> Self {
        std::fs::create_dir(self.path().join(name)).expect("a folder");
        self
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
        command.args(arguments).current_dir(self.path()).env("DRYSTONE_ADAPTER", "none");
        command.output().expect("the command starts")
    }

    /// Standard output of a command that succeeds.
    fn output(&self, arguments: &str) -> String {
        let output = self.run(&arguments.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    fn json(&self, arguments: &str) -> Value {
        let printed = self.output(arguments);
        assert_eq!(printed.lines().count(), 1, "one object on one line");
        serde_json::from_str(&printed).expect("JSON")
    }

    /// The sorted names of the files.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.path()).expect("a folder");
        let mut names: Vec<_> =
            entries.map(|e| e.expect("an entry").file_name().into_string().expect("text")).collect();
        names.sort();
        names
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn array<'a>(value: &'a Value, key: &str) -> &'a Vec<Value> {
    value[key].as_array().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn a_run_reports_on_itself_as_json() {
    let report = Folder::new().json("run pile -p n=27 --steps 40 --json --substeps 3 --set push_limit=2");
    let expected = "scene backend adapter bodies steps dt config step_ms stage_ms manifolds points colors overflow \
        penetration_max penetration_p95 penetration_mean kinetic_energy non_finite first_non_finite";
    let missing: Vec<_> = expected.split_whitespace().filter(|&key| report.get(key).is_none()).collect();
    assert!(missing.is_empty(), "{missing:?} of {:?}", keys(&report));
    assert_eq!((&report["scene"], &report["backend"]), (&"pile".into(), &"cpu".into()));
    assert_eq!((&report["bodies"], &report["steps"], &report["non_finite"]), (&27.into(), &40.into(), &0.into()));
    assert_eq!((&report["config"]["substeps"], &report["config"]["push_limit"]), (&3.into(), &2.0.into()));
    assert_eq!(array(&report, "step_ms").len(), 40);
    let stages: Vec<_> = array(&report, "stage_ms").iter().map(|s| s["stage"].as_str().expect("a name")).collect();
    assert_eq!(stages, ["detect", "color", "prepare", "run", "store"]);
    assert!(report["manifolds"].as_u64() > Some(0) && report["penetration_max"].as_f64() > Some(0.0));
}

#[test]
fn a_run_reports_on_itself_as_rows() {
    let folder = Folder::new();
    let printed = folder.output("run tower --steps 5");
    for part in ["tower, 10 dynamic bodies", "5 of 16.667 ms", "penetration", "mm/s rms"] {
        assert!(printed.contains(part), "{part} is not in: {printed}");
    }
    assert!(folder.files().is_empty());
}

#[test]
fn a_run_counts_what_comes_and_what_its_sensors_see() {
    let folder = Folder::new();
    let scene = "run galton -p n=5 -p rows=2 -p every=12 --steps 1400";
    let ran = folder.json(&format!("{scene} --json"));
    assert_eq!((&ran["bodies"], &ran["came"], &ran["left"]), (&0.into(), &5.into(), &0.into()));
    let counts: Vec<_> = array(&ran, "sensors")
        .iter()
        .map(|sensor| {
            (sensor["sensor"].as_str().expect("a name"), ["entered", "left", "inside"].map(|key| sensor[key].as_u64()))
        })
        .collect();
    assert_eq!(counts.iter().map(|count| count.0).collect::<Vec<_>>(), ["bin 1", "bin 2", "bin 3", "gate"]);
    assert_eq!(counts[3].1, [Some(5), Some(5), Some(0)]);
    assert_eq!(counts[..3].iter().map(|count| count.1[2].expect("a number")).sum::<u64>(), 5);
    assert!(counts[..3].iter().all(|(_, [entered, left, inside])| entered == inside && *left == Some(0)));
    let printed = folder.output(scene);
    for part in ["5 came, 0 left, 5 dynamic bodies at the end", "4: 10 times entered, 5 times left", "all bodies after"]
    {
        assert!(printed.contains(part), "{part} is not in: {printed}");
    }
    let gate = printed.lines().find(|line| line.contains("  gate")).expect("a row for each sensor");
    assert!(gate.trim_end().ends_with("5 entered, 5 left, 0 inside"), "{gate}");
    // Scenes without any have no such rows.
    assert_eq!(folder.json("run tower --steps 1 --json")["came"], Value::Null);
    assert!(!folder.output("run tower --steps 1").contains("sensors"));
}

#[test]
fn backends_are_compared_over_several_worlds() {
    let folder = Folder::new();
    let compared = "compare tower -p n=2 --worlds 3 --vary n --steps 3 --backends reference,cpu";
    let printed = folder.output(compared);
    assert!(
        printed.contains("9 dynamic bodies in 3 worlds") && printed.contains("no difference in any bit"),
        "{printed}"
    );
    assert_eq!(folder.json(&format!("{compared} --json"))["worlds"], 3);
}

#[test]
fn a_run_writes_its_end_as_a_scene_file_that_can_be_run_again() {
    let folder = Folder::new();
    let ran = folder.json("run conveyor --steps 700 --out-scene later.json --json");
    assert_eq!(folder.files(), ["later.json"]);
    let written = std::fs::read_to_string(folder.path().join("later.json")).expect("the file");
    let file: Value = serde_json::from_str(&written).expect("JSON");
    let boxes = array(&file, "bodies").iter().filter(|body| body["name"] == "box").count();
    // 6 boxes came, the sixth after 600 steps, and the first left after 490.
    assert!((3..=5).contains(&boxes), "{boxes} boxes");
    assert_eq!((&file["spawners"][0]["first"], &file["spawners"][0]["every"]), (&20.into(), &120.into()));
    // The program writes the present state: without steps, it writes the same file again.
    folder.output("run later.json --steps 0 --out-scene again.json");
    let again = std::fs::read_to_string(folder.path().join("again.json")).expect("the file");
    let steps = |steps: u32| format!("\"steps\":{steps},");
    assert_eq!(written.replace(&steps(700), ""), again.replace(&steps(0), ""));
    let later = folder.json("run later.json --steps 100 --json");
    assert!(later["penetration_max"].as_f64() < Some(5e-3) && ran["non_finite"] == 0);
    let refused = folder.run(&["run", "tower", "--worlds", "2", "--steps", "1", "--out-scene", "two.json"]);
    let line = text(&refused.stderr);
    assert!(!refused.status.success() && line.contains("--out-scene: a scene file has room for one world"), "{line}");
    assert_eq!(folder.files(), ["again.json", "later.json"]);
}

#[test]
fn every_kth_step_of_every_body_that_is_not_fixed_is_written_as_csv() {
    let folder = Folder::new();
    folder.output("run tower -p n=3 --steps 10 --every 4 --out motion.csv --dt 0.01");
    let written = std::fs::read_to_string(folder.path().join("motion.csv")).expect("the file");
    let mut lines = written.lines();
    assert_eq!(lines.next(), Some("step,time,body,px,py,pz,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz"));
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
    assert!(rows.iter().all(|r| r.len() == 16));
    // Steps 0, 4 and 8 of bodies 1, 2 and 3: body 0 is the floor.
    let which: Vec<_> = rows.iter().map(|r| (r[0], r[2])).collect();
    let expected: Vec<_> = [0.0, 4.0, 8.0].iter().flat_map(|&s| [1.0, 2.0, 3.0].map(|b| (s, b))).collect();
    assert_eq!(which, expected);
    assert!(rows.iter().all(|r| (r[1] - 0.01 * r[0]).abs() < 1e-8), "the time is that of the step");
    assert!((rows[0][4] - 0.5).abs() < 1e-6 && (rows[8][4] - 2.5).abs() < 0.01, "heights are in column py");
}

/// Bad arguments, and texts that the line of the error must contain.
const REFUSED: &[(&[&str], &[&str])] = &[
    (&["run", "nowhere"], &["nowhere", "drystone scenes"]),
    (&["run", "pyle"], &["\"pyle\"", "did you mean \"pile\"?"]),
    (&["run", "pile", "-p", "sead=3"], &["did you mean \"seed\"?", "known: n, jitter, seed, ratio"]),
    (&["run", "pile", "--worlds", "2", "--vary", "sede"], &["\"sede\"", "did you mean \"seed\"?"]),
    (
        &["run", "fixed.json", "--worlds", "1000000000"],
        &["1000000000 worlds of 0 dynamic bodies", "at most 4000000 worlds"],
    ),
    (&["run", "drop", "--dt", "-0.01"], &["--dt -0.01", "1e-9 to 1"]),
    (&["run", "drop", "--dt", "-1e-3"], &["--dt -0.001", "1e-9 to 1"]),
    (&["run", "drop", "--set", "substep=1"], &["did you mean \"substeps\"?", "drystone settings"]),
    (&["run", "drop", "--set", "friction=dics"], &["did you mean \"disc\"?"]),
    (&["run", "near.json"], &["near.json", "body 0", "`positon`", "did you mean \"position\"?", "scenes --schema"]),
    (&["run", "."], &["\".\""]),
    (&["run", "pile", "-p", "m=1"], &["pile", "\"m\"", "jitter"]),
    (&["run", "pile", "-p", "n"], &["pile", "\"n\"", "key=value"]),
    (&["run", "pile", "-p", "n=0"], &["pile", "n = \"0\"", "4000000"]),
    (&["run", "pile", "-p", "n=1.5"], &["n = \"1.5\"", "whole"]),
    (&["run", "pile", "-p", "jitter=nan"], &["jitter", "nan"]),
    (&["run", "drop", "--set", "substeps"], &["--set substeps", "key=value"]),
    (&["run", "drop", "--set", "substep=1"], &["--set substep=1", "unknown", "substeps"]),
    (&["run", "drop", "--set", "substeps=x"], &["--set substeps=x", "u32"]),
    (&["run", "drop", "--set", "substeps=0"], &["substeps = 0", "1 to 4096"]),
    (&["run", "drop", "--set", "contact_frequency=nan"], &["contact_frequency = NaN"]),
    (&["run", "drop", "--set", "friction=cone"], &["friction=cone", "disc"]),
    (&["run", "drop", "--set", "stabilization=baumgarte"], &["stabilization = baumgarte", "relax=0"]),
    (&["run", "drop", "--set", "a\nb=1"], &["a b"]),
    (&["run", "drop", "--substeps", "0"], &["substeps = 0"]),
    (&["run", "drop", "--dt", "0"], &["--dt 0", "1e-9 to 1"]),
    (&["run", "drop", "--dt", "nan"], &["--dt NaN"]),
    (&["run", "drop", "--config", "none.toml"], &["none.toml"]),
    (&["run", "drop", "--config", "torn.toml"], &["torn.toml", "line 2"]),
    (&["run", "drop", "--config", "unknown.toml"], &["unknown.toml", "line 3", "`substep`"]),
    (&["run", "drop", "--config", "range.toml"], &["range.toml", "relax = 5000", "4096"]),
    (&["run", "drop", "--config", "a\nb.toml"], &["a b.toml"]),
    (&["run", "none.json"], &["none.json"]),
    (&["run", "torn.json"], &["torn.json", "line 1"]),
    (&["run", "negative.json"], &["negative.json", "body 1 \"pebble\"", "shapes[0]", "ball of radius -1"]),
    (&["run", "two.json"], &["two.json", "version = 2"]),
    (&["run", "good.json", "-p", "n=1"], &["good.json", "n=1"]),
    (&["run", "good.json", "--out", "nowhere/motion.csv"], &["nowhere/motion.csv"]),
    (&["run", "good.json", "--out", "."], &[".: "]),
    (&["run", "good.json", "--out", "folder"], &["folder: ", "directory"]),
    (&["compare", "drop", "--backends", "reference"], &["--backends", "not 1"]),
    (&["compare", "drop", "--backends", "reference,cpu,cpu"], &["--backends", "not 3"]),
];

const GOOD: &str = r#"{"version": 1, "steps": 3, "bodies": [{"shapes": [{"type": "ball", "radius": 0.5}]}]}"#;

fn folder_of_bad_files() -> Folder {
    let negative = r#"{"version": 1, "bodies": [{"kind": "fixed"}, {"name": "pebble", "shapes": [{"type": "ball", "radius": -1}]}]}"#;
    Folder::new()
        .with("torn.toml", "# settings\nsubsteps = [")
        .with("unknown.toml", "# settings\n\nsubstep = 1\n")
        .with("range.toml", "relax = 5000\n")
        .with("torn.json", r#"{"version": 1, "bodies": ["#)
        .with("negative.json", negative)
        .with("two.json", r#"{"version": 2}"#)
        .with("fixed.json", r#"{"version": 1, "bodies": [{"kind": "fixed"}]}"#)
        .with("near.json", r#"{"version": 1, "bodies": [{"kind": "fixed", "positon": [0, 0, 0]}]}"#)
        .with_folder("folder")
        .with("good.json", GOOD)
}

#[test]
fn bad_input_ends_in_one_line_that_names_it_and_leaves_no_file_behind() {
    let folder = folder_of_bad_files();
    let before = folder.files();
    for &(arguments, named) in REFUSED {
        // With an output file, unless this file is the error.
        let out: &[&str] =
            if arguments[0] == "compare" || arguments.contains(&"--out") { &[] } else { &["--out", "x.csv"] };
        let output = folder.run(&[arguments, out].concat());
        let line = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
        assert_eq!(line.lines().count(), 1, "{arguments:?}: {line}");
        assert!(line.starts_with("drystone: "), "{arguments:?}: {line}");
        for part in named {
            assert!(line.contains(part), "{arguments:?}: {part:?} is not in: {line}");
        }
        assert!(line.len() < 250, "{arguments:?}: {line}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert_eq!(folder.files(), before, "{arguments:?}");
    }
}

/// Good input close to the bad input above, so that the test above can fail.
#[test]
fn good_input_is_not_refused() {
    let folder = folder_of_bad_files().with("good.toml", "relax = 2\nsubsteps = 2\n");
    folder.output("run good.json --out motion.csv");
    assert!(folder.files().contains(&"motion.csv".to_owned()));
    for arguments in [
        "run drop --steps 1 --config good.toml --set substeps=3 --dt 1",
        "run drop --steps 1 --set stabilization=baumgarte --set relax=0",
        "run drop --steps 0",
        "run pile -p n=8 -p jitter=0 --steps 1 --threads 2 --backend cpu",
    ] {
        folder.output(arguments);
    }
}

/// Errors of clap end with code 2 too, and never with a panic.
#[test]
fn usage_errors_end_with_the_same_code() {
    for arguments in [
        "",
        "walk",
        "run",
        "run drop --steps -1",
        "run drop --dt x",
        "run drop --every 0",
        "run drop --backend abacus",
        "run drop --threads 100000",
        "compare drop --backends abacus,cpu",
        "compare drop --exact --plain",
    ] {
        let arguments: Vec<_> = arguments.split_whitespace().collect();
        let output = Folder::new().run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", text(&output.stderr));
        assert!(!text(&output.stderr).contains("panicked"), "{arguments:?}");
    }
}

/// Errors of clap, and texts that their messages must contain.
#[test]
fn a_misspelled_name_and_a_number_out_of_range_have_helpful_messages() {
    let cases: &[(&str, &[&str])] = &[
        ("rnu drop", &["'rnu'", "'run'"]),
        ("report ruels", &["'ruels'", "'rules'"]),
        ("play mzae", &["'mzae'", "'maze'"]),
        ("pile", &["'pile'", "did you mean `drystone run pile`?"]),
        ("pile -p n=3", &["did you mean `drystone run pile`?"]),
        ("run drop --stpes 3", &["'--stpes'", "'--steps'"]),
        ("run drop --preset blanced", &["'blanced'", "'balanced'"]),
        ("run drop --steps -1", &["--steps", "-1 is not in 0.."]),
        ("run drop --substeps -2", &["--substeps", "-2 is not in 0.."]),
        ("run drop --threads -1", &["--threads", "-1 is not in 0..=1024"]),
        ("run drop --max-penetration -1mm", &["must be more than 0"]),
    ];
    for (arguments, named) in cases {
        let output = Folder::new().run(&arguments.split(' ').collect::<Vec<_>>());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        for part in *named {
            assert!(said.contains(part), "{arguments}: {part:?} is not in: {said}");
        }
    }
    let said = text(&Folder::new().run(&["hrad"]).stderr);
    assert!(said.contains("'hard'"), "{said}");
    let said = text(&Folder::new().run(&["walk"]).stderr);
    assert!(!said.contains("similar") && !said.contains("did you mean"), "{said}");
    for (arguments, named) in [
        ("hard --case kapal", "did you mean \"kapla\"?"),
        ("play maze esay --script x", "did you mean \"easy\"?"),
        ("solve none.contacts --tolerance -1", "--tolerance -1: must be more than 0"),
    ] {
        let output = Folder::new().run(&arguments.split(' ').collect::<Vec<_>>());
        assert!(text(&output.stderr).contains(named), "{arguments}: {}", text(&output.stderr));
    }
}

#[test]
fn help_fits_a_hundred_columns_and_short_help_a_page() {
    let folder = Folder::new();
    let commands = folder.output("-h");
    let listed = commands.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| l.starts_with("  "));
    let names: Vec<_> = listed.filter_map(|l| l.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(names.len() >= 11 && names.contains(&"run"), "{names:?}");
    let all = names.into_iter().chain(["play maze", "report rules", "report convergence"]);
    for name in all {
        let pages = ["-h", "--help"].map(|h| folder.output(&format!("{name} {h}")));
        for page in &pages {
            let longest = page.lines().max_by_key(|l| l.chars().count()).expect("a line");
            assert!(longest.chars().count() <= 100, "{name}: {longest}");
        }
        let lines = pages.each_ref().map(|p| p.lines().count());
        assert!(lines[0] <= 45 && lines[0] <= lines[1], "{name}: {lines:?}");
        if name == "run" {
            let headings = ["Arguments:", "Scene:", "Settings of the solver:", "Machine:", "Output:"];
            assert!(headings.iter().all(|h| pages[0].lines().any(|l| l == *h)), "{}", pages[0]);
            assert!(lines[1] > lines[0] + 20, "{lines:?}");
        }
    }
}

#[test]
fn the_settings_are_listed_as_a_file_that_gives_them() {
    let folder = Folder::new();
    let listed = folder.output("settings");
    let of = |arguments: &str, folder: &Folder| folder.json(arguments)["config"].clone();
    let usual = of("run drop --steps 0 --no-sleep --json", &folder);
    for key in keys(&usual) {
        let is_of = |l: &str| l.starts_with(&format!("{key} = ")) || l == format!("[{key}]");
        let line = listed.lines().position(is_of).unwrap_or_else(|| panic!("{key}"));
        assert!(listed.lines().nth(line - 1).is_some_and(|l| l.starts_with("# ") && l.len() > 10), "{key}");
    }
    assert!(listed.contains(" One of none, box, disc."), "{listed}");
    // Rules for comparison come last.
    let (settings, rules) = listed.split_once("\n[rules]\n").expect("a table of rules");
    for key in ["clamping", "friction_order", "manifold_passes", "slip_friction"] {
        let line = format!("\n{key} = ");
        assert!(rules.contains(&line) && !settings.contains(&line), "{key}");
    }
    let folder = folder.with("all.toml", &listed);
    assert_eq!(of("run drop --steps 0 --no-sleep --json --config all.toml", &folder), usual);
    assert!(folder.output("settings --preset fast").contains("\nsubsteps = 4\n"));
}

/// The report of a sleeping world: time of the awake steps, step of falling asleep, and contacts.
#[test]
fn a_run_that_fell_asleep_reports_the_step_and_the_time_before() {
    let folder = Folder::new();
    let report = folder.json("run tower -p n=3 --steps 200 --json");
    let number = |key: &str| report[key].as_u64().unwrap_or_else(|| panic!("{key} in {report}"));
    let (all, first, awake) = (number("all_asleep_step"), number("first_asleep_step"), number("awake_steps"));
    assert!(30 < all && all < 200 && first == all && awake == all, "{first} {all} {awake}");
    assert_eq!((number("asleep"), number("manifolds"), number("points")), (3, 3, 12));
    assert_eq!((array(&report, "step_ms").len(), &report["fastest"]), (200, &Value::Null));
    let ms = |value: &Value| value.as_f64().expect("a time");
    // Steps of a sleeping tower do not count.
    let steps: Vec<f64> = array(&report, "step_ms").iter().map(ms).collect();
    let least = steps[..awake as usize].iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(ms(&report["awake_ms"]["min"]), least);
    assert!(array(&report, "stage_ms").iter().all(|s| ms(&s["median"]) <= ms(&report["awake_ms"]["median"])));

    let printed = folder.output("run tower -p n=3 --steps 200");
    let when = format!("all bodies after {:.2} s", all as f64 / 60.0);
    for part in ["3 manifolds, 12 points", &when, &format!("of {awake} steps with a body awake"), "nothing moves"] {
        assert!(printed.contains(part), "{part} is not in: {printed}");
    }
    assert!(!printed.contains("fastest"), "{printed}");

    // The bodies sleep one after another: the thrown ball still rolls when the stack sleeps.
    let some = folder.output("run throw --steps 350");
    assert!(some.contains("10 of 11 bodies, the first after ") && some.contains("(body 11 \"ball\")"), "{some}");
    let all = folder.output("run drop");
    assert!(all.contains("all bodies after ") && all.contains(", the first after "), "{all}");

    let awake = folder.json("run tower -p n=3 --steps 60 --no-sleep --json");
    assert_eq!((&awake["awake_steps"], &awake["first_asleep_step"]), (&60.into(), &Value::Null));
    assert_eq!((&awake["manifolds"], &awake["points"]), (&3.into(), &12.into()));
    let moving = folder.output("run throw --steps 10 --no-sleep");
    assert!(moving.contains("fastest center ") && moving.contains("mm/s (body "), "{moving}");
}

/// Vulkan's loader loads libwayland, which prints an error without a desktop.
#[test]
fn adapters_are_listed_without_an_error_on_a_machine_without_a_desktop() {
    if std::env::var("DRYSTONE_ADAPTER").is_ok_and(|name| name == "none") {
        return eprintln!("not run: DRYSTONE_ADAPTER=none says that no GPU is wanted");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    let output = command.arg("adapters").env_remove("XDG_RUNTIME_DIR").output().expect("the command starts");
    assert_eq!(text(&output.stderr), "");
    assert!(text(&output.stdout).contains("buffer"), "{}", text(&output.stdout));
}

#[test]
fn an_existing_file_is_replaced_with_a_note() {
    let folder = Folder::new();
    let said = |arguments: &str| {
        let output = folder.run(&arguments.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    let run = "run tower -p n=2 --steps 3 --out motion.csv --save-problem 2:two.contacts";
    assert!(!said(run).contains("replaced"));
    let first = std::fs::read(folder.path().join("motion.csv")).expect("the motion");
    let second = said(run);
    for name in ["motion.csv: replaced", "two.contacts: replaced"] {
        assert!(second.lines().any(|l| l.starts_with(name)), "{name} is not in: {second}");
    }
    assert_eq!(std::fs::read(folder.path().join("motion.csv")).expect("the motion"), first);
    // A refused run leaves the existing file.
    let refused =
        folder.run(&["run", "tower", "--steps", "3", "--out", "motion.csv", "--save-problem", "9:x.contacts"]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(std::fs::read(folder.path().join("motion.csv")).expect("the motion"), first);
    assert_eq!(folder.files(), ["motion.csv", "two.contacts"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_scene_that_does_not_fit_into_memory_is_refused_before_it_is_built() {
    let limited = |arguments: &str| {
        let line = format!("ulimit -v 4000000; exec {} {arguments}", env!("CARGO_BIN_EXE_drystone"));
        Command::new("sh").args(["-c", &line]).env("DRYSTONE_ADAPTER", "none").output().expect("sh")
    };
    for (arguments, named) in [
        ("run pile -p n=4000000", "pile: 4000000 bodies: at least 8.0 GB of memory needed, 4"),
        ("run tower -p n=1 --worlds 4000000", "tower: 4000000 worlds of 2 bodies: at least 16.0 GB"),
        ("bench drum:n=1000000,worlds=4", "4 worlds of 1000001 bodies: at least 8.0 GB"),
    ] {
        let output = limited(arguments);
        let said = text(&output.stderr);
        assert_eq!((output.status.code(), said.lines().count()), (Some(3), 1), "{arguments}: {said}");
        assert!(said.contains(named), "{arguments}: {said}");
    }
    let output = limited("run pile -p n=50 --steps 1");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn a_long_build_is_announced() {
    let output = Folder::new().run(&["run", "joint-grid", "-p", "n=450", "--steps", "0"]);
    assert!(text(&output.stderr).lines().any(|l| l == "building 202500 bodies ..."), "{}", text(&output.stderr));
    let output = Folder::new().run(&["run", "joint-grid", "-p", "n=4", "--steps", "0"]);
    assert!(output.status.success() && !text(&output.stderr).contains("building"));
}

/// A force that would overflow is refused before the first step, by body and field.
#[test]
fn numbers_that_cannot_be_used_are_an_error() {
    let fast = GOOD.replace(r#"{"shapes""#, r#"{"name": "comet", "force": [3e38, 0, 0], "mass": 1e-3, "shapes""#);
    let folder = Folder::new().with("fast.json", &fast);
    let output = folder.run(&["run", "fast.json", "--dt", "1", "--steps", "3", "--json"]);
    assert_eq!((text(&output.stdout).as_str(), output.status.code()), ("", Some(2)));
    let line = "drystone: fast.json: body 0 \"comet\": force = ";
    assert!(text(&output.stderr).lines().any(|l| l.starts_with(line)), "{}", text(&output.stderr));
}

/// A closed standard error, as after `2>&1 | head -0`, does not stop the command.
#[test]
fn a_closed_standard_error_is_no_failure() {
    for (arguments, code) in [
        ("run drop --steps 1", 0),
        ("run tower --steps 1 --max-penetration 1mm", 0),
        ("run sphere-plane --steps 1 --max-penetration 1mm", 0),
        ("run nowhere", 2),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
        command.args(arguments.split(' ')).env("DRYSTONE_ADAPTER", "none");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts");
        drop(child.stderr.take());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", text(&output.stdout));
        assert_eq!(output.stdout.is_empty(), code != 0, "{arguments}");
    }
}

#[test]
fn the_catalogue_is_listed_with_its_parameters() {
    let folder = Folder::new();
    let printed = folder.output("scenes");
    let listed = folder.json("scenes --json");
    assert!(array(&listed, "scenes").len() >= 5);
    for scene in array(&listed, "scenes") {
        let name = scene["name"].as_str().expect("a name");
        assert!(printed.lines().any(|l| l == name), "{name} is not in: {printed}");
        // Every parameter accepts its default.
        let assignments = array(scene, "parameters").iter();
        let assignments = assignments.map(|p| format!("{}={}", p["name"].as_str().expect("a name"), p["default"]));
        Scene::find(name, &assignments.collect::<Vec<_>>()).expect(name);
        for p in array(scene, "parameters") {
            assert!(printed.contains(&format!("-p {}=", p["name"].as_str().expect("a name"))), "{p}");
        }
    }
}

#[test]
fn the_schema_of_scene_files_is_printed() {
    let schema: Value = serde_json::from_str(&Folder::new().output("scenes --schema")).expect("JSON");
    assert_eq!(schema["title"], "Scene");
    assert!(keys(&schema["properties"]).contains(&"bodies"));
}

#[test]
fn adapters_are_listed_as_json_even_if_there_are_none() {
    assert!(array(&Folder::new().json("adapters --json"), "adapters").is_empty());
}

#[test]
fn a_comparison_of_the_reference_and_the_cpu_finds_no_difference() {
    let folder = Folder::new();
    let printed = folder.output("compare drop --steps 3 --backends reference,cpu");
    assert!(printed.lines().any(|l| l == "no difference in any bit"), "{printed}");
    let found = folder.json("compare drop --steps 3 --backends reference,cpu --json");
    assert_eq!((array(&found, "steps").len(), &found["first"]), (3, &Value::Null));
}

#[test]
fn a_bench_is_printed_in_three_forms_and_marks_rows_that_are_slower_than_the_baseline() {
    let folder = Folder::new();
    let bench = "bench tower:n=2 pile:n=4,worlds=2 --turns 2 --threads 1 --backend reference,cpu";
    let measured = folder.json(&format!("{bench} --json"));
    let rows = measured["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 4);
    assert!(rows.iter().all(|r| r["ms"].as_f64() > Some(0.0) && r["hash"].as_str().map(str::len) == Some(16)));
    let csv = folder.output(&format!("{bench} --csv"));
    assert!(csv.lines().count() == 5 && csv.starts_with("scene,hash,backend,"), "{csv}");

    let mut faster = measured.clone();
    for row in faster["rows"].as_array_mut().expect("rows") {
        for key in ["ms", "ms_low", "ms_high"] {
            row[key] = (row[key].as_f64().expect("a time") * 1e-6).into();
        }
    }
    let folder = folder.with("faster.json", &faster.to_string()).with("broken.json", "{}");
    let table = folder.output(&format!("{bench} --baseline faster.json"));
    assert!(table.contains("4 of 4 rows slower beyond the spread"), "{table}");
    let refused = folder.run(&["bench", "tower", "--baseline", "broken.json"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("not what `drystone bench --json` prints"), "{}", text(&refused.stderr));
}

#[test]
fn every_measurement_of_a_bench_is_printed_in_three_forms() {
    let folder = Folder::new();
    for (arguments, rows, column) in [
        ("bench tower:n=2 pile:n=4 --falling --steps 30", 6, "ms_worst"),
        ("bench pyramid:base=4 pyramid:base=5 --growth", 2, "growth"),
        ("bench tower:n=2 --worlds --quick", 3, "of_best"),
        // A rate is a difference of two times, which a busy machine can turn round: the best of some turns counts.
        ("bench pyramid:base=4 --limits --turns 7", 1, "of_triad"),
        ("bench pile:n=27 tower:n=3 --states --turns 2", 2, "bytes_a_body"),
    ] {
        let arguments = format!("{arguments} --threads 1");
        let measured = folder.json(&format!("{arguments} --json"));
        let found = measured["rows"].as_array().expect("rows");
        assert!(found.len() == rows && found.iter().all(|r| r[column].as_f64() > Some(0.0)), "{measured}");
        assert!(measured["machine"]["cores"].as_u64() > Some(0));
        let csv = folder.output(&format!("{arguments} --csv"));
        assert!(csv.lines().count() == rows + 1 && csv.lines().next().is_some_and(|l| l.contains(column)), "{csv}");
        let table = folder.output(&arguments);
        assert!(table.lines().count() == rows + 2 && table.contains(column), "{table}");
    }
    let both = folder.run(&["bench", "--growth", "--limits"]);
    assert!(both.status.code() == Some(2) && text(&both.stderr).contains("cannot be used with"), "{both:?}");
}

/// The number of threads of a run.
#[cfg(target_os = "linux")]
fn threads_of(arguments: &[&str]) -> usize {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments).stdout(Stdio::null()).env("DRYSTONE_ADAPTER", "none");
    let mut run = command.spawn().expect("the command starts");
    let tasks = format!("/proc/{}/task", run.id());
    // The last name of each thread: a new thread has the name of the process.
    let mut names = std::collections::HashMap::new();
    while run.try_wait().expect("the command runs").is_none() {
        for task in std::fs::read_dir(&tasks).into_iter().flatten().flatten() {
            if let Ok(name) = std::fs::read_to_string(task.path().join("comm")) {
                names.insert(task.file_name(), name);
            }
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    // One thread waits for Ctrl-C.
    names.values().filter(|name| name.trim() != "ctrl-c").count()
}

#[test]
#[cfg(target_os = "linux")]
fn so_many_threads_work_as_were_asked_for() {
    for threads in ["1", "3", "6"] {
        let arguments =
            ["run", "pile", "-p", "n=200", "--steps", "120", "--backend", "cpu", "--json", "--threads", threads];
        assert_eq!(threads_of(&arguments).to_string(), threads);
    }
}

#[test]
fn nothing_sleeps_in_a_run_that_is_told_so() {
    let asleep = |more: &str| {
        let report = Folder::new().json(&format!("run tower -p n=2 --steps 120 --json{more}"));
        (report["asleep"].as_u64(), report["manifolds"].as_u64())
    };
    assert_eq!(asleep("").0, Some(2));
    assert_eq!(asleep(" --no-sleep"), (Some(0), Some(2)));
}

#[test]
fn a_length_may_be_given_in_any_unit() {
    let chosen = |length: &str| {
        let output = Folder::new().run(&["run", "tower", "--steps", "1", "--max-penetration", length]);
        assert!(output.status.success(), "{length}: {}", text(&output.stderr));
        text(&output.stderr).lines().find(|l| l.starts_with("substeps")).expect("the choice").to_owned()
    };
    let millimeter = chosen("1mm");
    for same in ["0.1cm", "0.001m", "0.001", "1000um"] {
        assert_eq!(chosen(same), millimeter, "{same}");
    }
    assert_ne!(chosen("0.1mm"), millimeter);
}
