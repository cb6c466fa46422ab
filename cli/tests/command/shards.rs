//! Surveys in parts: four processes, one of which is killed and run again, come to what one process comes to.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn drystone(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drystone"));
    command.args(arguments.split_whitespace()).current_dir(folder).env("DRYSTONE_ADAPTER", "none");
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    drystone(folder, arguments).output().expect("the command starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

fn succeeds(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn refused(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments}: {}", text(&output.stdout));
    text(&output.stderr).lines().last().unwrap_or_default().to_owned()
}

/// The cells of a row, as they stand in the file.
fn split(line: &str) -> Vec<String> {
    let (mut cells, mut quoted) = (vec![String::new()], false);
    for c in line.chars() {
        quoted ^= c == '"';
        if c == ',' && !quoted { cells.push(String::new()) } else { cells.last_mut().expect("a cell").push(c) }
    }
    cells
}

fn column(text: &str, name: &str) -> Vec<String> {
    let mut rows = text.lines().map(split);
    let column = rows.next().expect("a header").iter().position(|cell| cell == name).expect(name);
    rows.map(|row| row[column].clone()).collect()
}

/// The rows of a file, without the columns that tell when and how fast something ran.
fn cells(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let rows: Vec<Vec<String>> = text.lines().map(split).collect();
    let is_time = |name: &str| name == "run" || name.starts_with("ms") || name.starts_with("ratio");
    let kept: Vec<usize> = (0..rows[0].len()).filter(|&k| !is_time(&rows[0][k])).collect();
    assert!(kept.len() < rows[0].len() && rows.iter().all(|row| row.len() == rows[0].len()));
    rows.iter().map(|row| kept.iter().map(|&k| row[k].clone()).collect()).collect()
}

/// A process without rows after so long hangs, on any machine.
const HANGS: Duration = Duration::from_secs(20 * 60);

/// Waits for the first rows of a process, and kills it as a machine that loses its power would.
fn kill_after_first_rows(mut child: Child, rows: &Path) {
    let begin = Instant::now();
    while !rows.exists() {
        assert!(child.try_wait().expect("a child").is_none(), "it ended by itself");
        assert!(begin.elapsed() < HANGS, "no rows");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("a child");
    child.wait().expect("it ends");
}

/// Runs four shards at a time, the second of which is killed after its first rows and run again; gives its rows before and after.
fn in_four(folder: &Path, shard: impl Fn(usize) -> String, rows_of_second: &str) -> [String; 2] {
    let mut children: Vec<Child> = (1..=4).map(|i| drystone(folder, &shard(i)).spawn().expect("it starts")).collect();
    let path = folder.join(rows_of_second);
    kill_after_first_rows(children.remove(1), &path);
    let before = std::fs::read_to_string(&path).expect("rows");
    for child in children {
        let output = child.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    succeeds(folder, &shard(2));
    [before, std::fs::read_to_string(&path).expect("rows")]
}

#[test]
fn a_report_of_four_processes_is_that_of_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // The second shard has the second scene and the sixth.
    let scenes = ["tower:n=2", "chain:links=2", "tower:n=3", "pile:n=8", "mass-ratio", "pile:n=64"];
    let survey = scenes.map(|scene| format!(" --scene {scene}")).concat();
    let survey = format!("report --quick --steps 60{survey}");
    succeeds(folder, &format!("{survey} --out whole"));
    let rows = |i: usize| format!("{survey} --out parts --shard {i}/4");
    let [before, after] = in_four(folder, rows, "parts/shard-2-of-4/scenes.csv");
    assert!(before.lines().skip(1).all(|row| row.starts_with("chain:links=2,")), "killed too late: {before}");
    assert!(after.starts_with(&before) && after.contains("\npile:n=64,"), "{after}");
    let shards = "parts/shard-1-of-4 parts/shard-2-of-4 parts/shard-3-of-4 parts/shard-4-of-4/scenes.csv";
    let printed = succeeds(folder, &format!("{survey} --out parts --merge {shards}"));
    assert_eq!(printed, "parts/index.html\n");
    let [whole, parts] = ["whole", "parts"].map(|name| folder.join(name));
    assert_eq!(cells(&parts.join("scenes.csv")), cells(&whole.join("scenes.csv")));
    assert!(parts.join("index.html").exists() && parts.join("speed-against-error.svg").exists());

    // A shard that is missing, and one that was killed, are named.
    let line = refused(
        folder,
        &format!("{survey} --out less --merge parts/shard-1-of-4 parts/shard-3-of-4 parts/shard-4-of-4"),
    );
    assert!(line.contains("no rows of chain:links=2, pile:n=64"), "{line}");
    std::fs::write(folder.join("killed.csv"), before).expect("rows");
    let line = refused(
        folder,
        &format!("{survey} --out less --merge killed.csv parts/shard-1-of-4 parts/shard-3-of-4 parts/shard-4-of-4"),
    );
    assert!(line.contains("no rows of pile:n=64:") && !folder.join("less").exists(), "{line}");

    // Rows of another machine: errors are compared, times are not put in one ratio.
    let own = std::fs::read_to_string(parts.join("shard-1-of-4/scenes.csv")).expect("rows");
    let machine = &column(&own, "machine")[0];
    let later =
        own.replace(machine, "\"another, machine\"").replace(&column(&own, "run")[0], "2999-01-01T00:00:00.000000Z");
    std::fs::write(folder.join("elsewhere.csv"), &later).expect("rows");
    let merge = format!("{survey} --out both --merge elsewhere.csv {shards}");
    let output = run(folder, &merge);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    let both = std::fs::read_to_string(folder.join("both/scenes.csv")).expect("rows");
    let of_scene = |scene: &str| {
        both.lines()
            .filter(|row| row.starts_with(scene))
            .map(|row| row.contains("another, machine"))
            .collect::<Vec<_>>()
    };
    let elsewhere = of_scene("tower:n=2,");
    assert!(!elsewhere.is_empty() && elsewhere.iter().all(|&is| is) && of_scene("pile:n=64,").iter().all(|&is| !is));
    let mut lines: Vec<Vec<String>> = later.lines().map(split).collect();
    let overlap = lines[0].iter().position(|cell| cell == "penetration_mean").expect("a column");
    lines[1][overlap] = "0.125".into();
    let planted: Vec<String> = lines.iter().map(|cells| cells.join(",")).collect();
    std::fs::write(folder.join("elsewhere.csv"), planted.join("\n")).expect("rows");
    let said = text(&run(folder, &merge).stderr);
    assert!(said.starts_with("tower:n=2, drystone cpu ") && said.lines().count() == 1, "{said}");
    assert!(
        said.contains(": mean overlap ") && said.contains("1.25e-1") && said.contains("another, machine"),
        "{said}"
    );

    // Rows of another program are refused.
    let (commit, build) = (&column(&own, "commit")[0], &column(&own, "build")[0]);
    std::fs::write(folder.join("elsewhere.csv"), own.replace(commit, "c0ffee").replace(build, "0123456789abcdef"))
        .expect("rows");
    let line = refused(folder, &merge);
    assert!(
        line.contains("elsewhere.csv has rows of commit c0ffee, program 0123456789abcdef")
            && line.contains("only rows of one program"),
        "{line}"
    );
}

#[test]
fn hard_cases_of_four_processes_are_those_of_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // The second shard has H7 and the towers, which take longer.
    let cases = "hard --case H1 --case H7 --case H9 --case H10 --case H12 --case H2 --preset fast";
    let printed = succeeds(folder, &format!("{cases} --out whole.csv"));
    let shard = |i: usize| format!("{cases} --out part-{i}.csv --shard {i}/4");
    let [before, after] = in_four(folder, shard, "part-2.csv");
    assert!(before.lines().skip(1).all(|row| row.starts_with("H7,")), "killed too late: {before}");
    assert!(after.starts_with(&before) && after.contains("\nH2,"), "{after}");
    let files = "part-1.csv part-2.csv part-3.csv part-4.csv";
    assert_eq!(succeeds(folder, &format!("{cases} --out merged.csv --merge {files}")), printed);
    assert_eq!(cells(&folder.join("merged.csv")), cells(&folder.join("whole.csv")));
    let line = refused(folder, &format!("{cases} --merge part-1.csv part-3.csv part-4.csv"));
    assert!(line.contains("no rows of H7, H2: run their shards"), "{line}");
    // Rows of other settings are none of these.
    let line = refused(folder, &format!("{} --merge {files}", cases.replace("fast", "balanced")));
    assert!(line.contains("no rows of H1, H7, "), "{line}");
}
