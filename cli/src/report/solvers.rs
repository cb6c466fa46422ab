//! The section of docs/convergence.md on other solvers: a table of times, and performance profiles (Dolan and Moré
//! 2002).

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;

use super::plot::{Frame, Look, Scale, Series, svg};
use crate::files;
use drystone::{Error, Result};

/// Name of this library's solver in the table.
const OURS: &str = "drystone";

/// Number of Siconos solvers in the table of solved problems, and in a profile: there are colors for six lines.
const BEST: usize = 5;

/// One solver on one problem, as written by benches/against_siconos.py; without a time if it did not reach the target.
#[derive(Clone, Debug, Deserialize)]
struct Row {
    problem: String,
    form: String,
    contacts: usize,
    solver: String,
    target: String,
    ms: Option<f64>,
    iterations: Option<u64>,
}

/// The section, and the files of the page's folder by their names: numbers of solved problems as CSV, and pictures.
#[derive(Debug)]
pub struct Solvers {
    pub section: String,
    pub folder: Vec<(String, Vec<u8>)>,
}

/// Makes the section from a table.
pub fn solvers(path: &Path) -> Result<Solvers> {
    let wrong = |e: csv::Error| Error::input(format!("{}: {e}", path.display()));
    let rows = csv::Reader::from_path(path).map_err(wrong)?.deserialize().collect::<std::result::Result<Vec<Row>, _>>();
    let rows = rows.map_err(wrong)?;
    if rows.iter().all(|row| row.solver != OURS) {
        return Err(Error::input(format!("{}: no row of {OURS}", path.display())));
    }
    let targets = in_order(rows.iter().map(|row| &row.target));
    let mut section = include_str!("solvers_head.md").to_owned();
    summary(&mut section, &rows, &targets);
    times(&mut section, &rows, &targets);
    let table = solved(&mut section, &rows, &targets)?;
    let mut folder = vec![("solvers.csv".to_owned(), table)];
    section.push_str("\n## Performance profiles\n\n");
    section.push_str("A line shows the share of problems that a solver solves within a multiple of the time of the fastest solver.\n\n");
    for target in &targets {
        let name = format!("profile-{target}.svg");
        let _ = writeln!(
            section,
            "![share of problems over time relative to the fastest, to {target}](convergence/{name})"
        );
        folder.push((name, profile(&rows, target).into_bytes()));
    }
    Ok(Solvers { section, folder })
}

/// Distinct words in the order of their first occurrence.
fn in_order<'a>(words: impl Iterator<Item = &'a String>) -> Vec<&'a str> {
    let mut seen = BTreeSet::new();
    words.map(String::as_str).filter(|word| seen.insert(*word)).collect()
}

/// The row of a solver, if it reached the target.
fn reached<'a>(rows: &'a [Row], problem: &str, solver: &str, target: &str) -> Option<&'a Row> {
    let is = |row: &&Row| row.problem == problem && row.solver == solver && row.target == target;
    rows.iter().find(is).filter(|row| row.ms.is_some())
}

/// The fastest row of another solver.
fn fastest<'a>(rows: &'a [Row], problem: &str, target: &str) -> Option<&'a Row> {
    let others = rows.iter().filter(|r| r.problem == problem && r.target == target && r.solver != OURS);
    others.filter(|r| r.ms.is_some()).min_by(|a, b| a.ms.partial_cmp(&b.ms).expect("times are numbers"))
}

fn summary(section: &mut String, rows: &[Row], targets: &[&str]) {
    let problems = in_order(rows.iter().map(|row| &row.problem));
    section.push_str("\n| error | problems | drystone is faster than every solver of Siconos | drystone does not solve | no solver of Siconos solves |\n");
    section.push_str("|---|--:|--:|--:|--:|\n");
    for target in targets {
        let (mut ahead, mut ours_missing, mut theirs_missing) = (0, 0, 0);
        for problem in &problems {
            let (ours, theirs) = (reached(rows, problem, OURS, target), fastest(rows, problem, target));
            ahead += usize::from(ours.is_some_and(|ours| theirs.is_none_or(|theirs| ours.ms < theirs.ms)));
            ours_missing += usize::from(ours.is_none());
            theirs_missing += usize::from(theirs.is_none());
        }
        let count = problems.len();
        let _ = writeln!(section, "| {target} | {count} | {ahead} | {ours_missing} | {theirs_missing} |");
    }
}

fn times(section: &mut String, rows: &[Row], targets: &[&str]) {
    section.push_str("\nMilliseconds, and iterations (drystone: steps of Newton's method, 0 where sweeps sufficed):\n\n| problem | form | contacts |");
    for target in targets {
        let _ = write!(section, " drystone {target} | fastest of Siconos |");
    }
    section.push_str("\n|---|---|--:|");
    targets.iter().for_each(|_| section.push_str("--:|---|"));
    section.push('\n');
    for problem in in_order(rows.iter().map(|row| &row.problem)) {
        let first = rows.iter().find(|row| row.problem == problem).expect("its name is from a row");
        let _ = write!(section, "| {problem} | {} | {} |", first.form, first.contacts);
        let time = |row: &Row| format!("{:.3} ({})", row.ms.unwrap_or(f64::NAN), row.iterations.unwrap_or(0));
        for target in targets {
            let ours = reached(rows, problem, OURS, target).map_or("-".into(), time);
            let theirs = fastest(rows, problem, target).map_or("-".into(), |r| format!("{} {}", r.solver, time(r)));
            let _ = write!(section, " {ours} | {theirs} |");
        }
        section.push('\n');
    }
}

/// Writes the numbers of problems that drystone and the best other solvers solve. Returns those of all solvers as CSV.
fn solved(section: &mut String, rows: &[Row], targets: &[&str]) -> Result<Vec<u8>> {
    let count = |solver: &str, target: &str, is: fn(&&Row) -> bool| {
        rows.iter().filter(|r| r.solver == solver && r.target == target).filter(is).count()
    };
    let solved = |solver: &str, target: &str| count(solver, target, |r| r.ms.is_some());
    let solvers = in_order(rows.iter().map(|row| &row.solver));
    let mut best: Vec<&str> = solvers.iter().copied().filter(|&solver| solver != OURS).collect();
    best.sort_by_key(|solver| Reverse(targets.iter().map(|target| solved(solver, target)).sum::<usize>()));
    best.truncate(BEST);

    section.push_str(
        "\nThe next table counts solved problems. [solvers.csv](convergence/solvers.csv) has all solvers. Global solvers take only\n\
         global problems.\n\n| solver |",
    );
    targets.iter().for_each(|target| section.push_str(&format!(" {target} |")));
    section.push_str(" of |\n|---|");
    targets.iter().for_each(|_| section.push_str("--:|"));
    section.push_str("--:|\n");
    let head = targets.iter().map(|target| format!("solved_to_{target}"));
    let mut table = vec![std::iter::once("solver".to_owned()).chain(head).chain(["of".to_owned()]).collect::<Vec<_>>()];
    for solver in solvers {
        let mut cells = vec![solver.to_owned()];
        cells.extend(targets.iter().map(|target| solved(solver, target).to_string()));
        cells.push(targets.first().map_or(0, |target| count(solver, target, |_| true)).to_string());
        if solver == OURS || best.contains(&solver) {
            let _ = writeln!(section, "| {} |", cells.join(" | "));
        }
        table.push(cells);
    }
    files::csv(&table)
}

/// Times of a solver relative to the fastest solver of each problem, ascending. Problems that it does not solve are
/// left out.
fn ratios(rows: &[Row], solver: &str, target: &str) -> Vec<f64> {
    let ratio = |problem: &str| {
        let own = reached(rows, problem, solver, target)?.ms?;
        let all = rows.iter().filter(|r| r.problem == problem && r.target == target).filter_map(|r| r.ms);
        Some(own / all.fold(own, f64::min))
    };
    let mut ratios: Vec<_> = in_order(rows.iter().map(|r| &r.problem)).into_iter().filter_map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    ratios
}

fn profile(rows: &[Row], target: &str) -> String {
    let count = in_order(rows.iter().map(|r| &r.problem)).len() as f64;
    let mut others: Vec<_> =
        in_order(rows.iter().map(|r| &r.solver)).into_iter().filter(|&solver| solver != OURS).collect();
    // Sort by solved problems, then by time.
    let rank = |solver: &str| {
        let ratios = ratios(rows, solver, target);
        (Reverse(ratios.len()), ratios.iter().map(|r| r.ln()).sum::<f64>())
    };
    others.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).expect("times are numbers"));
    let line = |(look, solver): (usize, &str)| {
        let share = |(i, ratio): (usize, f64)| (ratio, (i + 1) as f64 / count);
        let line: Vec<_> = ratios(rows, solver, target).into_iter().enumerate().map(share).collect();
        Series { name: solver.into(), look: Look::nth(look), points: Vec::new(), line }
    };
    let lines: Vec<_> = std::iter::once(OURS).chain(others.into_iter().take(BEST)).enumerate().map(line).collect();
    let title = format!("e_vel at most {target}");
    let frame = Frame {
        title: &title,
        x: "time relative to the fastest",
        y: "share of the problems",
        scales: (Scale::Decades, Scale::Share),
        size: (640, 400),
    };
    svg(&frame, &lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "problem,form,contacts,solver,target,ms,iterations,e_vel
a,global,4,NSGS,1e-4,2.0,10,1e-5
a,global,4,ADMM,1e-4,4.0,3,1e-5
a,global,4,drystone,1e-4,0.5,0,1e-5
b,local,9,NSGS,1e-4,1.0,10,1e-5
b,local,9,ADMM,1e-4,,,
b,local,9,drystone,1e-4,2.0,7,1e-5
c,local,9,NSGS,1e-4,,,
c,local,9,ADMM,1e-4,,,
c,local,9,drystone,1e-4,3.0,7,1e-5
";

    fn section(table: &str) -> Result<Solvers> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("table.csv");
        std::fs::write(&path, table).expect("written");
        solvers(&path)
    }

    #[test]
    fn the_section_says_what_was_faster_and_what_nothing_solved() {
        let Solvers { section, folder } = section(TABLE).expect("a section");
        for line in [
            "| 1e-4 | 3 | 2 | 0 | 1 |",
            "| a | global | 4 | 0.500 (0) | NSGS 2.000 (10) |",
            "| c | local | 9 | 3.000 (7) | - |",
            "| ADMM | 1 | 3 |",
        ] {
            assert!(section.contains(line), "{line} is not in: {section}");
        }
        let [(table, counts), (picture, profile)] = &folder[..] else { panic!("{folder:?}") };
        assert_eq!((table.as_str(), picture.as_str()), ("solvers.csv", "profile-1e-4.svg"));
        assert_eq!(String::from_utf8_lossy(counts), "solver,solved_to_1e-4,of\nNSGS,2,3\nADMM,1,3\ndrystone,3,3\n");
        let profile = String::from_utf8_lossy(profile);
        assert!(profile.contains("NSGS") && profile.contains("drystone"));
    }

    #[test]
    fn the_section_counts_for_the_best_solvers_and_the_file_for_all() {
        let more = ["A", "B", "C", "D"].map(|solver| format!("a,global,4,{solver},1e-4,5.0,3,1e-5\n"));
        let Solvers { section, folder } = section(&format!("{TABLE}{}", more.concat())).expect("a section");
        for (solver, is_shown) in [("NSGS", true), ("ADMM", true), ("C", true), ("D", false), ("drystone", true)] {
            let begins = format!("| {solver} | ");
            assert_eq!(section.lines().any(|line| line.starts_with(&begins)), is_shown, "{solver} in {section}");
        }
        assert!(String::from_utf8_lossy(&folder[0].1).contains("\nD,1,1\n"));
    }

    #[test]
    fn ratios_are_those_to_the_fastest_of_each_problem() {
        let rows: Vec<Row> =
            csv::Reader::from_reader(TABLE.as_bytes()).deserialize().map(|row| row.expect("a row")).collect();
        assert_eq!(ratios(&rows, "drystone", "1e-4"), [1.0, 1.0, 2.0]);
        assert_eq!(ratios(&rows, "NSGS", "1e-4"), [1.0, 4.0]);
    }

    #[test]
    fn a_table_without_us_or_with_a_wrong_number_is_refused_in_one_line() {
        for (table, named) in [(TABLE.replace("drystone", "other"), "drystone"), (TABLE.replace("4.0", "x"), "line: 3")]
        {
            let error = section(&table).expect_err("refused").to_string();
            assert!(error.contains(named) && error.contains("table.csv") && error.lines().count() == 1, "{error}");
        }
    }
}
