//! The commands of README.md and of the pages that it names first run as they are written: a person tries these before all others.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PAGES: [&str; 4] = ["README.md", "docs/pictures.md", "docs/web.md", "docs/many-machines.md"];

/// Commands that cannot run in a test, and why. `arguments_are_known` looks at what can be seen of them.
const NOT_RUN: &[(&str, &str)] = &[
    ("cargo install --path cli --features view", "builds an optimized program and puts it into the home folder"),
    ("./tests/run", "it runs this test"),
    ("web/build", "`.ci/run` runs it: it builds for minutes"),
    ("python3 -m http.server --bind 127.0.0.1 --directory web/dist", "it serves until somebody stops it"),
    ("web/test", "it needs a browser"),
    ("web/test --self-test", "it needs a browser"),
    ("web/measure", "it needs a browser, and engines of others from npm"),
    ("drystone view pile", "it opens a window"),
    ("drystone play maze hard", "it opens a window"),
    ("job=$(sbatch --parsable survey.sh)", "it needs Slurm"),
    (
        "sbatch --dependency=afterok:\"$job\" --wrap 'drystone report --merge report/shard-* --out report'",
        "it needs Slurm",
    ),
    (
        "seq 8 | parallel --jobs 1 --sshlogin a,b,c,d --joblog jobs.log 'drystone hard --shard {}/8 --out /shared/hard-{}.csv'",
        "it needs GNU parallel and four machines",
    ),
    ("parallel --retry-failed --joblog jobs.log", "it needs GNU parallel and four machines"),
    (
        "python -m drystone.shard module:function --runs runs.jsonl --shard 2/4 --out part-2.jsonl",
        "it needs the Python package: python/tests/test_survey.py runs it",
    ),
    (
        "python -m drystone.shard module:function --runs runs.jsonl --merge part-*.jsonl --out rows.jsonl",
        "it needs the Python package: python/tests/test_survey.py runs it",
    ),
];

/// Shorter arguments for a test, which has less work with them; every option stays.
const SHORTER: [(&str, &str); 8] = [
    ("n=5000", "n=20"),
    ("--steps 240", "--steps 3"),
    ("--steps 150", "--steps 4"),
    ("--frames 40", "--frames 2"),
    ("720x540", "72x54"),
    // Both parts of a survey, where the page has one of four.
    ("--shard 2/4 --out report", "--shard 1/2 --out report; drystone report --shard 2/2 --out report"),
    ("--shard 2/4 --out hard-2.csv", "--shard 1/2 --out hard-1.csv; drystone hard --shard 2/2 --out hard-2.csv"),
    ("/shared/", ""),
];

/// Arguments that these commands get besides, the same for all parts of a survey.
const BESIDES: [(&str, &str); 3] = [
    ("drystone report", " --quick --steps 30 --scene tower:n=2 --scene chain:links=2"),
    ("drystone hard", " --case H1 --case H9 --preset fast"),
    ("run pile", " --steps 30"),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace")
}

fn page(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The commands in the fenced blocks of a page: lines of a shell, or a script as a whole.
fn commands(page: &str) -> Vec<String> {
    let mut all = Vec::new();
    for block in page.split("\n```").skip(1).step_by(2) {
        let (language, text) = block.split_once('\n').unwrap_or((block, ""));
        let lines = text.lines().map(|line| line.split("  #").next().unwrap_or_default().trim());
        match language {
            "sh" if text.starts_with("#!") => all.push(text.to_owned()),
            "sh" => all.extend(lines.filter(|line| !line.is_empty()).map(str::to_owned)),
            _ => all.extend(lines.filter_map(|line| line.strip_prefix("$ ")).map(str::to_owned)),
        }
    }
    all
}

/// Whether a command draws, which this build of the program cannot.
fn needs_pictures(command: &str) -> bool {
    !cfg!(feature = "view") && (command.starts_with("drystone render") || command.contains(".png"))
}

/// The command as a test runs it.
fn shortened(command: &str) -> String {
    let mut short = SHORTER.iter().fold(command.to_owned(), |command, (long, short)| command.replace(long, short));
    for (program, besides) in BESIDES {
        let parts: Vec<_> = short.split("; ").map(str::trim_end).collect();
        let add = |part: &&str| if part.contains(program) { format!("{part}{besides}") } else { (*part).to_owned() };
        short = parts.iter().map(add).collect::<Vec<_>>().join("; ");
    }
    short
}

/// A folder for what the commands of a page write, with the program as `drystone`.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        std::fs::create_dir_all(folder.0.path().join("docs/pictures")).expect("a folder");
        std::fs::create_dir(folder.0.path().join("bin")).expect("a folder");
        let program = folder.0.path().join("bin/drystone");
        std::fs::hard_link(env!("CARGO_BIN_EXE_drystone"), &program)
            .or_else(|_| std::fs::copy(env!("CARGO_BIN_EXE_drystone"), &program).map(drop))
            .expect("the program");
        folder
    }

    /// Runs a line of a shell. The program that `cargo run` would build is the one of the tests: another profile takes minutes.
    fn run(&self, line: &str) -> Output {
        let line = match line.strip_prefix("cargo run --release -- ") {
            Some(arguments) => {
                cargo_chooses_the_program();
                format!("drystone {arguments}")
            }
            None => line.to_owned(),
        };
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(self.0.path().join("bin")).chain(std::env::split_paths(&path));
        let path = std::env::join_paths(folders.collect::<Vec<PathBuf>>()).expect("folders");
        let mut command = Command::new("sh");
        command.args(["-ec", &line]).current_dir(self.0.path()).env("PATH", path);
        command.env("SLURM_ARRAY_TASK_ID", "1").env("SLURM_SUBMIT_DIR", self.0.path()).output().expect("a shell")
    }
}

/// The answer of cargo where it has read its arguments, chosen a package and a program, and then asks for a compiler that is not there.
fn without_compiler(arguments: &[&str]) -> String {
    let output = Command::new("cargo").args(arguments).current_dir(root()).env("RUSTC", "no-compiler").output();
    text(&output.expect("cargo").stderr)
}

/// Fails where the packages of the workspace that cargo builds by default have several programs, and none is the default one.
fn cargo_chooses_the_program() {
    let said = without_compiler(&["run", "--release", "--", "run", "pile"]);
    assert!(said.contains("no-compiler"), "cargo run: {said}");
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[cfg(unix)]
#[test]
fn each_command_of_the_first_pages_runs_as_it_is_written() {
    let (mut ran, mut left) = (0, NOT_RUN.to_vec());
    for name in PAGES {
        let folder = Folder::new();
        for command in commands(&page(name)) {
            if let Some((_, why)) = NOT_RUN.iter().find(|(known, _)| *known == command) {
                println!("{name}: not run: {command} ({why})");
                left.retain(|(known, _)| *known != command);
                arguments_are_known(&command);
                continue;
            }
            if needs_pictures(&command) {
                println!("{name}: not run: {command} (this build has no pictures)");
                continue;
            }
            let output = folder.run(&shortened(&command));
            assert!(output.status.success(), "{name}: {command}\n{}", text(&output.stderr));
            ran += 1;
        }
    }
    assert!(left.is_empty(), "no page has: {left:?}");
    assert!(ran >= 7, "{ran} commands");
}

/// Fails where a command that is not run has an option that its program does not know, as far as that is to be seen.
fn arguments_are_known(command: &str) {
    let words: Vec<&str> = command.split_whitespace().collect();
    if let Some(script) = words.first().map(|word| root().join(word)).filter(|path| path.is_file()) {
        let source = std::fs::read_to_string(&script).expect("a script");
        for option in words.iter().filter(|word| word.starts_with("--")) {
            assert!(source.contains(option), "{command}: {} does not know {option}", script.display());
        }
    }
    if words.starts_with(&["cargo", "install"]) {
        // Cargo finds the package and its features.
        let said = without_compiler(&words[1..]);
        assert!(said.contains("no-compiler"), "{command}: {said}");
        let (package, features) = (words[3], words[5]);
        let manifest: toml::Table = page(&format!("{package}/Cargo.toml")).parse().expect("TOML");
        assert!(manifest["features"].get(features).is_some(), "{command}: no feature {features}");
    }
}

/// The table of commands: each option that a row names is an option of a command of that row.
#[test]
fn the_options_in_the_table_of_commands_are_those_of_the_commands() {
    let help = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
        let output = command.args(name.split(' ')).arg("--help").output().expect("it starts");
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let mut checked = 0;
    for row in page("docs/commands.md").lines().filter(|row| row.starts_with("| `drystone ")) {
        let spans: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
        // `drystone report --shard I/N`, `hard --shard I/N`
        let is_command =
            |span: &&&str| span.starts_with("drystone ") || !span.starts_with("--") && span.contains(" --");
        // A command, and the name of a command below it: `drystone report tables`.
        let name = |span: &&str| {
            let words = span.trim_start_matches("drystone ").split(' ');
            let names = words.take_while(|word| word.chars().all(|c| c.is_ascii_lowercase()));
            names.collect::<Vec<_>>().join(" ")
        };
        let names: Vec<String> = spans.iter().filter(is_command).map(name).collect();
        if !cfg!(feature = "view") && names.iter().any(|name| ["render", "view"].contains(&name.as_str())) {
            continue;
        }
        let known: String = names.iter().map(|name| help(name)).collect();
        let words = spans.iter().flat_map(|span| span.split(' '));
        for option in words.filter(|word| word.starts_with("--")) {
            let has = known.split(|c: char| !c.is_alphanumeric() && c != '-').any(|word| word == option);
            assert!(has, "commands.md: {option} is no option of {names:?}: {row}");
            checked += 1;
        }
    }
    assert!(checked >= 15, "{checked} options");
}
