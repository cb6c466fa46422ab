//! `drystone report`: runs, stored rows, continued reports and pages.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use drystone::{Error, Result, SolverConfig, World};
use drystone_cli::files;
use drystone_cli::report::bench::{FallingRow, GrowthRow, LimitRow, StatesRow, WorldsRow};
use drystone_cli::report::comparison::{
    Contender, Drystone, Extent, Origin, Report, Setting, Survey, Team, WindowRow, scene, scenes as all, tables,
};
use drystone_cli::report::{Shard, performance};
use drystone_scenes::Scene;

/// A page that is not drawn after so long is never drawn, on any machine.
const HANGS: Duration = Duration::from_secs(20 * 60);

/// Drystone with 1, 2 and 4 substeps.
fn three(scene: &Scene, _: Extent) -> Result<Vec<Box<dyn Contender>>> {
    let of = |substeps| {
        let config = SolverConfig::default().with(|c| c.substeps = substeps);
        Ok(Box::new(Drystone::new(scene, "cpu", &config)?) as Box<dyn Contender>)
    };
    [1, 2, 4].into_iter().map(of).collect()
}

/// Small scenes, run for a moment.
fn scenes() -> Vec<Scene> {
    let short = |word: &str| Scene { steps: 20, ..scene(word).expect("a scene of the catalogue") };
    ["tower:n=2", "chain:links=2", "pile:n=8"].map(short).to_vec()
}

fn survey<'a>(team: &'a Team<'a>, out: &Path) -> Survey<'a> {
    Survey {
        scenes: scenes(),
        teams: vec![team],
        extent: Extent::Full,
        problems: Vec::new(),
        out: out.to_owned(),
        shard: Shard::WHOLE,
    }
}

fn origin(build: &str) -> Origin {
    Origin { build: build.into(), commit: "c0ffee".into(), machine: "a machine".into(), threads: 1 }
}

/// Scene and setting of every row, and the runs, in the order of the file.
fn rows(out: &Path) -> (Vec<String>, Vec<String>) {
    let mut reader = csv::Reader::from_path(out.join("scenes.csv")).expect("rows");
    let rows: Vec<drystone_cli::report::comparison::Row> =
        reader.deserialize().collect::<std::result::Result<_, _>>().unwrap();
    let mut runs: Vec<_> = rows.iter().map(|row| row.run.clone()).collect();
    runs.dedup();
    (rows.iter().map(|row| format!("{} {}", row.scene, row.setting().label())).collect(), runs)
}

#[test]
fn a_stopped_report_continues() {
    let whole = tempfile::tempdir().unwrap();
    survey(&three, whole.path()).run(&origin("a"), &mut |_, _, _| ()).unwrap();
    let (wanted, runs) = rows(whole.path());
    assert_eq!((wanted.len(), runs.len()), (9, 3));

    // The third scene fails.
    let folder = tempfile::tempdir().unwrap();
    let asked = Cell::new(0);
    let stops = |scene: &Scene, extent: Extent| {
        asked.set(asked.get() + 1);
        if asked.get() == 3 { Err(Error::input("stop")) } else { three(scene, extent) }
    };
    survey(&stops, folder.path()).run(&origin("a"), &mut |_, _, _| ()).map(|_| ()).unwrap_err();
    let (part, before) = rows(folder.path());
    assert_eq!(part, wanted[..6]);

    let report = survey(&three, folder.path()).run(&origin("a"), &mut |_, _, _| ()).unwrap();
    let (all, after) = rows(folder.path());
    assert_eq!((all, &after[..2]), (wanted.clone(), &before[..]));
    report.write(folder.path()).unwrap();
    let html = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    assert!(after.iter().all(|run| html.contains(run)));

    // No scene is left, and the stored rows give the same page.
    survey(&three, folder.path()).run(&origin("a"), &mut |_, _, _| ()).unwrap();
    assert_eq!(rows(folder.path()).1, after);
    Report::read(folder.path()).unwrap().write(folder.path()).unwrap();
    assert_eq!(std::fs::read_to_string(folder.path().join("index.html")).unwrap(), html);
}

#[test]
fn rows_of_another_scene_program_or_setting_are_not_reused() {
    let folder = tempfile::tempdir().unwrap();
    let run = |scenes: Vec<Scene>, team: &Team, build: &str| {
        let survey = Survey { scenes, ..survey(team, folder.path()) };
        survey.run(&origin(build), &mut |_, _, _| ()).unwrap();
        rows(folder.path()).1.len()
    };
    let first = || scenes()[..1].to_vec();
    assert_eq!(run(first(), &three, "a"), 1);
    assert_eq!(run(first(), &three, "a"), 1);
    assert_eq!(run(first(), &three, "b"), 2, "another program");
    let mut heavier = first();
    heavier[0].world.bodies[1].mass.mass *= 2.0;
    assert_eq!(run(heavier, &three, "a"), 3, "another scene of that name");
    let longer = first().into_iter().map(|scene| Scene { steps: 40, ..scene }).collect();
    assert_eq!(run(longer, &three, "a"), 4, "more steps");
    let more = |scene: &Scene, extent: Extent| {
        let config = SolverConfig::default().with(|c| c.substeps = 3);
        let mut all = three(scene, extent)?;
        all.push(Box::new(Drystone::new(scene, "cpu", &config)?));
        Ok(all)
    };
    assert_eq!(run(first(), &more, "a"), 5, "one more setting");
    assert_eq!(run(first(), &three, "a"), 5, "all of these are there");
}

#[test]
fn a_brief_report_has_all_kinds_of_scenes_of_the_full_one_with_few_bodies() {
    let kinds = |extent| -> BTreeSet<String> {
        let name = |scene: Scene| scene.name.split(':').next().expect("a name").to_owned();
        all(extent).unwrap().into_iter().map(name).collect()
    };
    let wanted = ["tower", "mass-ratio", "chain", "wall", "pile", "pile-mixed", "pyramid"].map(str::to_owned);
    assert_eq!(kinds(Extent::Full), BTreeSet::from(wanted));
    assert_eq!(kinds(Extent::Brief), kinds(Extent::Full));
    assert!(all(Extent::Brief).unwrap().iter().all(|scene| scene.world.dynamic_count() <= 1000));
}

/// The same engine under another name: its rows are reached, but never overtaken for certain.
#[test]
fn a_report_with_another_engine_has_a_page_at_equal_error() {
    struct Named(Drystone);
    impl Contender for Named {
        fn setting(&self) -> Setting {
            Setting { engine: "other".into(), ..self.0.setting() }
        }
        fn step(&mut self) -> Result<()> {
            self.0.step()
        }
        fn world(&mut self) -> &World {
            self.0.world()
        }
    }
    let other = |scene: &Scene, _: Extent| {
        let config = SolverConfig::default().with(|c| c.substeps = 64);
        Ok(vec![Box::new(Named(Drystone::new(scene, "cpu", &config)?)) as Box<dyn Contender>])
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("equal-error.md");
    let alone = survey(&three, folder.path()).run(&origin("a"), &mut |_, _, _| ()).unwrap();
    alone.write(folder.path()).unwrap();
    assert!(!path.exists());
    let both = Survey { teams: vec![&three, &other], ..survey(&three, folder.path()) };
    both.run(&origin("a"), &mut |_, _, _| ()).unwrap().write(folder.path()).unwrap();
    let text = std::fs::read_to_string(path).unwrap();
    // 64 substeps leave less overlap than 4 while boxes settle.
    let wanted = "| pile:n=8 | mean overlap | 1 | other cpu 64x1 |";
    assert!(text.contains(wanted) && text.contains("not reached"), "{text}");
    assert!(
        ["tower:n=2", "chain:links=2", "pile:n=8"].iter().all(|name| text.contains(&format!("## {name}\n"))),
        "{text}"
    );
}

#[test]
fn a_folder_with_other_rows_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenes.csv");
    std::fs::write(&path, "scene,hash\ntower,12\n").unwrap();
    let message =
        survey(&three, folder.path()).run(&origin("a"), &mut |_, _, _| ()).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("scenes.csv: line 2"), "{message}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "scene,hash\ntower,12\n");
    let empty = tempfile::tempdir().unwrap();
    let message = Report::read(empty.path()).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("no rows to draw"), "{message}");
}

/// Extreme numbers in each numeric column of a file: the page is drawn within seconds.
#[test]
fn a_page_is_drawn_of_any_numbers() {
    let folder = tempfile::tempdir().unwrap();
    survey(&three, folder.path()).run(&origin("a"), &mut |_, _, _| ()).unwrap();
    let text = std::fs::read_to_string(folder.path().join("scenes.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let first: Vec<&str> = lines[1].split(',').collect();
    let real = |k: &usize| first[*k].contains(['.', 'e']) && first[*k].parse::<f64>().is_ok();
    let columns: Vec<usize> = (0..first.len()).filter(real).collect();
    assert!(columns.len() >= 10, "{columns:?}");
    for number in ["1.7976931348623157e308", "-1.7976931348623157e308", "4.9e-324", "1e-310", "inf", "NaN", "0.0"] {
        for &column in &columns {
            let mut cells = first.clone();
            cells[column] = number;
            let other = tempfile::tempdir().unwrap();
            let changed = [&lines[..1], &[&cells.join(",")], &lines[2..]].concat().join("\n");
            std::fs::write(other.path().join("scenes.csv"), changed).unwrap();
            let (done, when_done) = mpsc::channel();
            std::thread::spawn(move || {
                let drawn = Report::read(other.path()).and_then(|report| report.write(other.path()));
                done.send(drawn.map(|page| std::fs::metadata(page).unwrap().len())).unwrap();
            });
            let name = lines[0].split(',').nth(column).unwrap();
            let drawn = when_done.recv_timeout(HANGS);
            let length = drawn.unwrap_or_else(|_| panic!("{name} = {number}: not drawn")).unwrap();
            assert!(length < 1_000_000, "{name} = {number}: {length} bytes");
        }
    }
}

/// The figures of a page of performance are those of the rows beside it, and change with them.
#[test]
fn a_page_of_performance_has_the_figures_of_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    let rows = folder.path().join("performance");
    std::fs::create_dir(&rows).unwrap();
    let engines = |name: &str, threads: usize, steps: usize, ms: f64| {
        let row = |(engine, third): (&str, usize)| WindowRow {
            scene: "pile:n=9".into(),
            run: threads.to_string(),
            machine: "a machine".into(),
            commit: "c0ffee".into(),
            threads,
            bodies: 9,
            engine: engine.into(),
            setting: format!("{engine} cpu 8x1{}", if engine == "other" { " 30 Hz" } else { "" }),
            from: third * steps / 3 + 1,
            to: (third + 1) * steps / 3,
            ms: ms * (third + 1) as f64,
            ms_worst: if engine == "drystone" { 1.7 } else { 1.9 } * ms * (third + 1) as f64,
            ms_first: if engine == "drystone" { 2.9 } else { 3.1 } * ms,
            to_best: Some(if engine == "drystone" { 0.411 + 0.01 * third as f64 } else { 1.3 }),
            penetration_mean: if engine == "drystone" { 1e-4 * (third + 1) as f64 } else { 2e-3 },
            ..WindowRow::default()
        };
        let all: Vec<_> =
            ["drystone", "other"].into_iter().flat_map(|e| (0..3).map(move |k| (e, k))).map(row).collect();
        files::write(&rows.join(name), &files::csv(&all).unwrap()).unwrap();
    };
    let write = |name: &str, bytes: Vec<u8>| files::write(&rows.join(name), &bytes).unwrap();
    engines("engines-1.csv", 1, 300, 7.77);
    engines("engines-2.csv", 2, 300, 4.44);
    let falling =
        FallingRow { bodies: 9, threads: 1, from: 1, to: 100, detect: 3.21, ms: 9.0, ..FallingRow::default() };
    write("falling.csv", files::csv(&[falling]).unwrap());
    let growth = |boxes: usize, threads, ns| GrowthRow {
        scene: boxes.to_string(),
        boxes,
        threads,
        ns,
        growth: ns / 20.0,
        bytes_a_box: Some(3456.0),
        ..GrowthRow::default()
    };
    // The smaller island has no row with two threads.
    let islands = [growth(1000, 1, 20.0), growth(100_000, 1, 36.4), growth(100_000, 2, 18.6)];
    write("growth.csv", files::csv(&islands).unwrap());
    let worlds = |scene: &str, worlds, per_second| WorldsRow {
        scene: scene.into(),
        threads: 1,
        worlds,
        per_second,
        ..WorldsRow::default()
    };
    let many = [worlds("tower", 1, 60_321.0), worlds("tower", 16, 190_123.0), worlds("pile", 16, 13_354.0)];
    write("worlds.csv", files::csv(&many).unwrap());
    let states = StatesRow {
        scene: "pile:n=9".into(),
        threads: 2,
        ms: 2.0,
        save: 3.3,
        bytes_a_body: 281.6,
        ..StatesRow::default()
    };
    write("states.csv", files::csv(&[states]).unwrap());
    // One file is missing.
    let message = performance(folder.path()).unwrap_err().to_string();
    assert!(message.contains("limits.csv") && message.lines().count() == 1, "{message}");
    let limits = LimitRow { threads: 1, of_triad: 0.63, of_peak: 0.46, ..LimitRow::default() };
    write("limits.csv", files::csv(&[limits]).unwrap());

    let page = || {
        performance(folder.path()).unwrap();
        std::fs::read_to_string(folder.path().join("performance.md")).unwrap()
    };
    let text = page();
    let in_one_line = text.replace("\n  ", " ").replace('\n', " ");
    for figure in [
        "| 1 thread: ms in each third | to the best other | 2 threads: ms in each third | to the best other | mean \
         overlap mm |",
        "| pile:n=9, 300 | drystone 8x1 | 7.77, 15.5, 23.3 | 0.411, 0.421, 0.431 | 4.44, 8.88, 13.3 | 0.411, 0.421, \
         0.431 | 0.300 |",
        "|  | other 8x1 | 7.77, 15.5, 23.3 |  | 4.44, 8.88, 13.3 |  | 2.00 |",
        "takes between 0.411 and 0.431 times (one thread) and between 0.411 and 0.431 times (2 threads) as long as the \
         fastest other engine; its worst case is pile:n=9, steps 201 to 300.",
        "at most 0.150 times the least of the other engines",
        "takes up to 1.70 times as long (pile:n=9, ",
        "; other engines 1.90), and the first step up to 2.90 times as long (pile:n=9, ",
        "; other engines 3.10). The first step",
        "| 1 to 100 | 9.00 | 3.21 |",
        "| ns per manifold and pass, 1 thread | 2 threads | bytes a box |",
        "| 1000 | 20.0 (1.00) |  | 3456 |",
        "| 100000 | 36.4 (1.82) | 18.6 (0.930) | 3456 |",
        "| 63 % of 0 |",
        " 46 % of 0 |",
        "| scene | threads | 1 world | 16 |",
        "| tower | 1 | 60321 | 190123 |",
        "| pile | 1 |  | 13354 |",
        "| pile:n=9 | 2 | 2.00 | 0 | 0 | 1.65 | 0 | 282 |",
        "Machine: a machine. Commit c0ffee",
        "[one thread](performance/engines-1.csv), [two](performance/engines-2.csv)",
        "## Huge pages",
    ] {
        assert!(in_one_line.contains(figure), "{figure} is missing:\n{text}");
    }
    assert!(!text.contains("short run"));
    let picture = std::fs::read_to_string(rows.join("engines.svg")).unwrap();
    assert!(picture.contains("pile:n=9, threads: 1") && picture.contains("other cpu 8x1"), "{picture}");

    // Rows of a short run are marked, and a file without rows is refused.
    engines("engines-1.csv", 1, 60, 7.77);
    engines("engines-2.csv", 2, 60, 4.44);
    assert!(page().contains("**This is a short run of 60 steps"));
    write("growth.csv", Vec::new());
    let message = performance(folder.path()).unwrap_err().to_string();
    assert!(message.contains("growth.csv: no rows"), "{message}");
}

/// The tables of README.md and docs/speed-vs-error.md have the figures of the rows beside them, and the best ones are
/// bold.
#[test]
fn the_tables_of_the_pages_have_the_figures_of_the_rows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    tables(root, true).unwrap_or_else(|e| panic!("{e}; `drystone report tables` writes them"));

    // A figure, a bold one and a row that are off are found, and written anew.
    let folder = tempfile::tempdir().unwrap();
    let files = ["README.md", "docs/speed-vs-error.md", "docs/report/scenes.csv", "docs/performance/engines-1.csv"];
    for file in files {
        let to = folder.path().join(file);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(root.join(file), to).unwrap();
    }
    for page in &files[..2] {
        let path = folder.path().join(page);
        let text = std::fs::read_to_string(&path).unwrap();
        let inside = text.find("<!-- rows: ").expect("a table");
        let bold = inside + text[inside..].find(" **0").expect("a figure in bold");
        let row = text[..bold].rfind("\n|").unwrap() + 1;
        let end = row + text[row..].find('\n').unwrap() + 1;
        let line = &text[row..end];
        let without_bold = line.replacen("**", "", 2);
        let figure = line.replacen(" **0", " **1", 1);
        for changed in [&*without_bold, &figure, ""] {
            std::fs::write(&path, [&text[..row], changed, &text[end..]].concat()).unwrap();
            let message = tables(folder.path(), true).unwrap_err().to_string();
            assert!(message.contains("but the rows give") && message.lines().count() == 1, "{message}");
            tables(folder.path(), false).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }
}
