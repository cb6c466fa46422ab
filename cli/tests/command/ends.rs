//! Commands that end before their end: a full disk, a closed pipe, a signal. One line says what is left.
#![cfg(unix)]

use std::collections::BTreeSet;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder for one test, in which the commands run.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command
            .current_dir(self.0.path())
            .env("DRYSTONE_ADAPTER", "none")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn drystone(&self, arguments: &str) -> Command {
        let mut command = self.command(env!("CARGO_BIN_EXE_drystone"));
        command.args(arguments.split(' '));
        command
    }

    /// The sorted names of the files.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).expect("a folder").map(|e| e.expect("an entry").file_name());
        let mut names: Vec<_> = entries.map(|name| name.into_string().expect("text")).collect();
        names.sort();
        names
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("a file")
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("a file");
    }
}

/// The last line of standard error, and the exit code.
fn last(output: &Output) -> (String, Option<i32>) {
    let said = String::from_utf8_lossy(&output.stderr);
    let own: Vec<&str> = said.lines().filter(|line| line.starts_with("drystone: ")).collect();
    assert!(own.len() <= 1, "more than one line: {said}");
    (said.lines().last().unwrap_or_default().to_owned(), output.status.code())
}

/// Commands that print tables, CSV or JSON, with the files that they need.
const PRINTING: [&str; 15] = [
    "scenes",
    "scenes --json",
    "scenes --schema",
    "settings",
    "adapters",
    "adapters --json",
    "run drop --steps 1",
    "run drop --steps 1 --json",
    "compare drop --steps 1 --backends reference,cpu",
    "solve two.contacts --sweeps 4",
    "solve two.contacts --sweeps 4 --json",
    "bench tower:n=2 --turns 1 --csv",
    "hard --case H7",
    "soak --rows rows.csv",
    "replay drop.recording",
];

fn with_inputs() -> Folder {
    let folder = Folder::new();
    for arguments in [
        "run tower -p n=2 --steps 2 --save-problem 2:two.contacts",
        "run drop --steps 2 --record drop.recording",
        "soak waking --steps 100 --out rows.csv",
    ] {
        folder.drystone(arguments).output().expect("the command starts");
    }
    assert_eq!(folder.files(), ["drop.recording", "rows.csv", "two.contacts"]);
    folder
}

#[test]
fn a_command_ends_when_nobody_reads_what_it_prints() {
    let folder = with_inputs();
    for arguments in PRINTING {
        // Nobody reads from the start: a fast command would print all before its reader could go.
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let child = folder.drystone(arguments).stdout(writer).spawn().expect("the command starts");
        let (line, code) = last(&child.wait_with_output().expect("it ends"));
        assert_eq!(
            (line.as_str(), code),
            ("drystone: the reader of standard output is gone", Some(141)),
            "{arguments}"
        );
    }
    // Work that nobody reads is not gone on with: the case after the first line cannot be printed, and no other case has rows.
    let script = format!("{} hard --out cases.csv | head -1", env!("CARGO_BIN_EXE_drystone"));
    let output = folder.command("sh").args(["-c", &script]).output().expect("sh");
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 1);
    let rows = folder.read("cases.csv");
    let cases: BTreeSet<_> = rows.lines().skip(1).filter_map(|row| row.split(',').next()).collect();
    assert!((1..4).contains(&cases.len()), "{cases:?}");
    // The message names the files that were written before.
    let mut child = folder.drystone("run drop --steps 2 --out motion.csv").spawn().expect("the command starts");
    drop(child.stdout.take());
    let (line, _) = last(&child.wait_with_output().expect("it ends"));
    assert_eq!(line, "drystone: the reader of standard output is gone; kept motion.csv");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_under_standard_output_is_one_line() {
    let folder = with_inputs();
    for arguments in PRINTING {
        let full = File::options().write(true).open("/dev/full").expect("a device that is full");
        let (line, code) = last(&folder.drystone(arguments).stdout(full).output().expect("the command starts"));
        assert_eq!(line, "drystone: standard output: No space left on device (os error 28)", "{arguments}");
        assert_eq!(code, Some(2), "{arguments}");
    }
}

/// Files may have 4096 bytes, in place of a full disk, which needs rights to make one.
#[test]
fn a_file_that_does_not_fit_leaves_the_old_one_and_no_half() {
    for (arguments, name) in [
        ("run pile -p n=64 --steps 100 --out kept.csv", "kept.csv"),
        ("run pile -p n=64 --steps 10 --out-scene kept.json", "kept.json"),
        ("run pile -p n=64 --steps 100 --record kept.recording", "kept.recording"),
        ("run pile -p n=64 --steps 100 --no-sleep --save-problem 90:kept.contacts", "kept.contacts"),
        ("export pile -p n=64 --step 90 --fclib kept.hdf5", "kept.hdf5"),
        ("report --quick --scene tower:n=2 --steps 30 --out .", "scenes.csv"),
    ] {
        for old in [None, Some("of before\n")] {
            let folder = Folder::new();
            if name != "scenes.csv" {
                old.into_iter().for_each(|text| folder.write(name, text));
            }
            let before = folder.files();
            // 512 bytes each, in any shell that keeps the standard.
            let limited = format!("ulimit -f 8; exec {} {arguments}", env!("CARGO_BIN_EXE_drystone"));
            let output = folder.command("sh").args(["-c", &limited]).output().expect("sh");
            let (line, code) = last(&output);
            assert_eq!(code, Some(2), "{arguments}: {line}");
            let of_file =
                line.strip_prefix("drystone: ").is_some_and(|rest| rest.contains(&format!("{name}: File too large")));
            assert!(of_file, "{arguments}: {line}");
            let left = if before.is_empty() { "was not written" } else { "is as before" };
            assert!(line.ends_with(&format!("{name} {left}")), "{arguments}: {line}");
            assert_eq!(folder.files(), before, "{arguments}");
            before.iter().for_each(|name| assert_eq!(folder.read(name), "of before\n"));
        }
    }
}

#[test]
fn rows_that_do_not_fit_leave_whole_rows() {
    let folder = Folder::new();
    let limited =
        format!("ulimit -f 8; exec {} soak waking --steps 100 --out rows.csv", env!("CARGO_BIN_EXE_drystone"));
    let (line, code) = last(&folder.command("sh").args(["-c", &limited]).output().expect("sh"));
    assert!(line.contains("rows.csv: File too large") && line.ends_with("; kept rows.csv"), "{line}");
    assert_eq!(code, Some(2));
    let rows = folder.read("rows.csv");
    let commas: Vec<_> = rows.lines().map(|line| line.matches(',').count()).collect();
    assert!(rows.ends_with('\n') && commas.len() > 20 && commas.iter().all(|count| *count == commas[0]), "{rows}");
}

/// A command that is not ready after so long hangs, on any machine.
const HANGS: Duration = Duration::from_secs(20 * 60);

/// Waits until a command is as far as it should be, sends it a signal, and waits for its end.
fn stopped(mut child: Child, signal: &str, is_ready: impl Fn() -> bool) -> Output {
    let begin = Instant::now();
    while !is_ready() {
        assert!(child.try_wait().expect("a child").is_none(), "it ended by itself");
        assert!(begin.elapsed() < HANGS, "it is never ready");
        std::thread::sleep(Duration::from_millis(2));
    }
    let sent = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    child.wait_with_output().expect("it ends")
}

/// Whether any file whose name ends so is longer than this.
fn has(folder: &Path, name: &str, bytes: u64) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut named = entries.filter(|entry| entry.file_name().to_string_lossy().ends_with(name));
    named.any(|entry| entry.metadata().is_ok_and(|data| data.len() > bytes))
}

#[test]
fn a_signal_ends_a_run_with_the_old_files_and_a_line() {
    let endless = "run pile -p n=64 --steps 10000000 --no-sleep";
    for (signal, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        for (option, name) in [("--out", "motion.csv"), ("--record", "pile.recording")] {
            for old in [false, true] {
                let folder = Folder::new();
                if old {
                    folder.write(name, "of before\n");
                }
                let before = folder.files();
                let child = folder.drystone(&format!("{endless} {option} {name}")).spawn().expect("the command starts");
                let output = stopped(child, signal, || has(folder.0.path(), name, 20_000));
                let left = if old { "is as before" } else { "was not written" };
                let (line, code) = last(&output);
                assert_eq!(
                    (line, code),
                    (format!("drystone: stopped by SIG{signal}; {name} {left}"), Some(128 + number))
                );
                assert_eq!(folder.files(), before);
                before.iter().for_each(|name| assert_eq!(folder.read(name), "of before\n"));
            }
        }
    }
}

#[test]
fn a_signal_ends_commands_that_print_or_add_rows() {
    let folder = Folder::new();
    // Begun: rows come every second or so.
    folder.write("rows.csv", "of before\n");
    let child = folder.drystone("soak rain --steps 400000 --out rows.csv").spawn().expect("the command starts");
    let output = stopped(child, "INT", || {
        std::thread::sleep(Duration::from_millis(500));
        true
    });
    assert_eq!(last(&output), ("drystone: stopped by SIGINT; rows.csv is as before".into(), Some(130)));
    assert_eq!(folder.read("rows.csv"), "of before\n");
    let child = folder.drystone("soak rain --steps 20000 --out rows.csv").spawn().expect("the command starts");
    let output = stopped(child, "TERM", || folder.read("rows.csv").lines().count() > 2);
    assert_eq!(last(&output), ("drystone: stopped by SIGTERM; kept rows.csv".into(), Some(143)));
    let rows = folder.read("rows.csv");
    assert!(rows.starts_with("scene,step,") && rows.ends_with('\n'), "{rows}");
    assert_eq!(folder.files(), ["rows.csv"]);

    let printed = File::create(folder.path("printed")).expect("a file");
    let child = folder.drystone("hard").stdout(printed).spawn().expect("the command starts");
    let output = stopped(child, "TERM", || has(folder.0.path(), "printed", 0));
    assert_eq!(last(&output), ("drystone: stopped by SIGTERM".into(), Some(143)));
}

#[test]
fn a_report_that_is_stopped_says_so_and_goes_on() {
    let folder = Folder::new();
    let all = "report --quick --scene tower:n=2 --scene pile:n=64 --steps 60 --out report";
    let child = folder.drystone(all).spawn().expect("the command starts");
    let output = stopped(child, "TERM", || folder.path("report/scenes.csv").exists());
    let (line, code) = last(&output);
    let kept =
        "drystone: stopped by SIGTERM; kept report/scenes.csv; the same command continues from report/scenes.csv";
    assert_eq!((line.as_str(), code), (kept, Some(143)));
    let first = folder.read("report/scenes.csv");
    assert!(
        first.lines().skip(1).all(|row| row.starts_with("tower:n=2,")) && !folder.path("report/index.html").exists()
    );
    let output = folder.drystone(all).output().expect("the command starts");
    assert!(output.status.success(), "{}", last(&output).0);
    let rows = folder.read("report/scenes.csv");
    assert!(rows.starts_with(&first) && rows.lines().any(|row| row.starts_with("pile:n=64,")), "{rows}");
    assert!(folder.path("report/index.html").exists());
}

#[test]
fn two_outputs_of_one_name_are_refused() {
    let folder = Folder::new();
    let output = folder.drystone("run drop --steps 2 --out both --record ./both").output().expect("the command starts");
    let (line, code) = last(&output);
    assert!(line.contains("both: two outputs have this name") && code == Some(2), "{line}");
    assert!(folder.files().is_empty());
}
