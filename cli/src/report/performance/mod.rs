//! `drystone report performance`: a table, a picture, and one paragraph for each finding, from rows that other commands
//! measured.

mod engines;
mod findings;

use std::path::Path;

use serde::de::DeserializeOwned;

use super::bench::{FallingRow, GrowthRow, LimitRow, StatesRow, WorldsRow};
use super::comparison::WindowRow;
use crate::files;
use drystone::{Error, Result};

/// The rows in the folder of the page, by file.
struct Rows {
    engines: Vec<WindowRow>,
    falling: Vec<FallingRow>,
    growth: Vec<GrowthRow>,
    worlds: Vec<WorldsRow>,
    limits: Vec<LimitRow>,
    states: Vec<StatesRow>,
}

/// Files of `drystone-peers --thirds`, one for each number of threads: Rapier has separate builds for one thread and
/// for several.
const ENGINES: [&str; 2] = ["engines-1.csv", "engines-2.csv"];

/// Number of steps of the longest run on a full page.
const FULL: usize = 300;

impl Rows {
    fn read(folder: &Path) -> Result<Self> {
        Ok(Self {
            engines: [rows(folder, ENGINES[0])?, rows(folder, ENGINES[1])?].concat(),
            falling: rows(folder, "falling.csv")?,
            growth: rows(folder, "growth.csv")?,
            worlds: rows(folder, "worlds.csv")?,
            limits: rows(folder, "limits.csv")?,
            states: rows(folder, "states.csv")?,
        })
    }

    /// The machine and the program of the rows, and whether their runs are shorter than those of a full page.
    fn origin(&self) -> String {
        let first = &self.engines[0];
        let steps = self.engines.iter().map(|row| row.to).max().unwrap_or(0);
        let short = if steps < FULL {
            format!("**This is a short run of {steps} steps, to see that the page is made; its figures are rough.** ")
        } else {
            String::new()
        };
        format!("{short}Machine: {}. Commit {}, {}.", first.machine, first.commit, first.run)
    }
}

/// The rows of a file, at least one.
fn rows<R: DeserializeOwned>(folder: &Path, name: &str) -> Result<Vec<R>> {
    let path = folder.join(name);
    let rows: Vec<R> = files::rows(&path)?;
    if rows.is_empty() {
        return Err(Error::input(format!("{}: no rows; `benches/performance` measures them", path.display())));
    }
    Ok(rows)
}

/// Writes `performance.md` and `performance/engines.svg` into a directory, from the CSV files in its folder
/// `performance`.
pub fn performance(directory: &Path) -> Result<()> {
    let folder = directory.join("performance");
    let rows = Rows::read(&folder)?;
    let [one, two] = ENGINES;
    let page = [
        include_str!("../performance_head.md"),
        &format!("\n{}\nRows: [one thread](performance/{one}), [two](performance/{two}).\n\n", rows.origin()),
        &engines::table(&rows.engines),
        "\n![time of a step over the run, by scene](performance/engines.svg)\n",
        &findings::findings(&rows),
        include_str!("../performance_tail.md"),
    ];
    files::write(&folder.join("engines.svg"), engines::picture(&rows.engines).as_bytes())?;
    files::write(&directory.join("performance.md"), page.concat().as_bytes())
}
