//! Runs all contenders on one scene after another and keeps the rows of finished scenes.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::contender::{Extent, Setting, Team};
use super::duels;
use super::measure::{blocks, measure};
use super::origin::Origin;
use super::page;
use super::row::Row;
use super::solves::{self, SolveRow, solves};
use crate::files;
use crate::report::scene_hash::content_hash;
use crate::report::shard::{Measured, Shard, gathered, last_run, missing};
use drystone::{Error, Result};
use drystone_problems::ContactProblem;
use drystone_scenes::Scene;

// Files of rows in the folder of a report.
const SCENES: &str = "scenes.csv";
const PROBLEMS: &str = "problems.csv";

pub struct Survey<'a> {
    pub scenes: Vec<Scene>,
    /// Times are relative to the first contender of the first team.
    pub teams: Vec<&'a Team<'a>>,
    pub extent: Extent,
    pub problems: Vec<ContactProblem>,
    /// Folder of all files. It is created if needed.
    pub out: PathBuf,
    /// The part to run: scenes first, then problems.
    pub shard: Shard,
}

pub struct Report {
    pub(super) results: Vec<Vec<Row>>,
    pub(super) solves: Vec<Vec<SolveRow>>,
}

impl Survey<'_> {
    /// Runs the scenes and problems that have no rows in the folder, and adds rows after each of them. `progress` gets
    /// the name, the completed work and the total work.
    ///
    /// A scene is finished if one run has rows of every contender, with the same scene, steps, program, machine and
    /// threads.
    pub fn run(&self, origin: &Origin, progress: &mut dyn FnMut(&str, u64, u64)) -> Result<Report> {
        std::fs::create_dir_all(&self.out).map_err(Error::file(&self.out))?;
        let mut table = Table::<Row>::open(self.out.join(SCENES))?;
        let weight = |scene: &Scene| (scene.world.dynamic_count() as u64 + 20) * u64::from(scene.steps);
        let problem_weight = |problem: &ContactProblem| problem.contacts.len() as u64 * 20;
        let (scenes, problems) = (self.own_scenes(), self.own_problems());
        let total = scenes.clone().map(weight).chain(problems.clone().map(problem_weight)).sum();
        let (mut before, mut results) = (0, Vec::new());
        for scene in scenes {
            let teams = self.teams.iter().map(|team| team(scene, self.extent)).collect::<Result<Vec<_>>>()?;
            let mut contenders: Vec<_> = teams.into_iter().flatten().collect();
            let settings: Vec<_> = contenders.iter().map(|c| c.setting()).collect();
            progress(&scene.name, before, total);
            let known = finished(table.rows(), scene, origin, &settings);
            results.push(table.add_unless(known, || {
                let turns = u64::from(blocks(scene.steps)) * contenders.len() as u64;
                let mut turn = 0;
                measure(scene, &mut contenders, origin, &mut || {
                    turn += 1;
                    progress(&scene.name, before + weight(scene) * turn / turns, total);
                })
            })?);
            before += weight(scene);
        }
        let mut table = Table::<SolveRow>::open(self.out.join(PROBLEMS))?;
        let mut all = Vec::new();
        for problem in problems {
            progress(&problem.name, before, total);
            let known = solved(table.rows(), &solves::hash(problem), origin);
            all.push(table.add_unless(known, || solves(problem, origin))?);
            before += problem_weight(problem);
        }
        Ok(Report { results, solves: all })
    }

    fn own_scenes(&self) -> impl Iterator<Item = &Scene> + Clone {
        self.scenes.iter().enumerate().filter(|(k, _)| self.shard.has(*k)).map(|(_, scene)| scene)
    }

    fn own_problems(&self) -> impl Iterator<Item = &ContactProblem> + Clone {
        let numbered = (self.scenes.len()..).zip(&self.problems);
        numbered.filter(|(k, _)| self.shard.has(*k)).map(|(_, problem)| problem)
    }

    /// The report of the rows that shards of this survey left in folders or files, on any machines. Writes these rows
    /// into the folder. If several runs measured a scene, the last run counts, and `different` gets a line for each
    /// error that differs in another run.
    ///
    /// # Errors
    /// A scene or a problem has no rows with this number of threads; rows come from different programs; a file cannot
    /// be read or written.
    pub fn merge(&self, sources: &[PathBuf], threads: usize, different: &mut dyn FnMut(String)) -> Result<Report> {
        let (rows, solved) = (gathered::<Row>(sources, SCENES)?, gathered::<SolveRow>(sources, PROBLEMS)?);
        let (mut results, mut solves, mut without) = (Vec::new(), Vec::new(), Vec::new());
        for scene in &self.scenes {
            let (hash, steps) = (content_hash(scene), super::measure::steps(scene));
            let own = rows.iter().filter(|row| row.hash == hash && row.steps == steps && row.threads == threads);
            let own: Vec<_> = own.cloned().collect();
            own.iter().filter_map(|row| row.differs_from(&own)).for_each(&mut *different);
            let last = last_run(own.iter());
            if last.is_empty() {
                without.push(scene.name.as_str());
            }
            results.push(last);
        }
        for problem in &self.problems {
            let hash = solves::hash(problem);
            let last = last_run(solved.iter().filter(|row| row.hash == hash));
            if last.is_empty() {
                without.push(problem.name.as_str());
            }
            solves.push(last);
        }
        missing(&without)?;
        std::fs::create_dir_all(&self.out).map_err(Error::file(&self.out))?;
        files::write(&self.out.join(SCENES), &files::csv(&results.concat())?)?;
        if !solves.is_empty() {
            files::write(&self.out.join(PROBLEMS), &files::csv(&solves.concat())?)?;
        }
        Ok(Report { results, solves })
    }
}

impl Measured for Row {
    const FIRST: &'static str = "scene";

    fn program(&self) -> [&str; 2] {
        [&self.build, &self.commit]
    }

    fn run(&self) -> [&str; 2] {
        [&self.run, &self.machine]
    }
}

impl Measured for SolveRow {
    const FIRST: &'static str = "problem";

    fn program(&self) -> [&str; 2] {
        [&self.build, &self.commit]
    }

    fn run(&self) -> [&str; 2] {
        [&self.run, &self.machine]
    }
}

/// The rows of `settings` in order, from the last run that has all of them.
fn finished(rows: &[Row], scene: &Scene, origin: &Origin, settings: &[Setting]) -> Option<Vec<Row>> {
    let (hash, steps) = (content_hash(scene), super::measure::steps(scene));
    let Origin { build, commit: _, machine, threads } = origin;
    let of_origin = |row: &&Row| (&row.build, &row.machine, &row.threads) == (build, machine, threads);
    let fit: Vec<_> = rows.iter().filter(of_origin).filter(|row| row.hash == hash && row.steps == steps).collect();
    let of_run = |run: &str| -> Option<Vec<Row>> {
        let of = |setting: &Setting| {
            fit.iter().find(|row| row.run == run && row.setting() == *setting).map(|&row| row.clone())
        };
        settings.iter().map(of).collect()
    };
    fit.iter().rev().find_map(|row| of_run(&row.run))
}

/// The rows of the last run on a problem. Every run has all solvers of its program.
fn solved(rows: &[SolveRow], hash: &str, origin: &Origin) -> Option<Vec<SolveRow>> {
    let fit = |row: &&SolveRow| row.hash == hash && row.build == origin.build && row.machine == origin.machine;
    let last = rows.iter().rfind(fit)?;
    Some(rows.iter().filter(|row| row.run == last.run && row.hash == hash).cloned().collect())
}

/// Rows in a CSV file that grows by blocks.
struct Table<R> {
    path: PathBuf,
    rows: Vec<R>,
}

impl<R: Clone + Serialize + DeserializeOwned> Table<R> {
    /// Reads the rows of a file; a missing file has none.
    fn open(path: PathBuf) -> Result<Self> {
        let rows = if path.exists() { files::rows(&path)? } else { Vec::new() };
        Ok(Self { path, rows })
    }

    /// Returns the block `known`, or makes a block and adds it to the rows and the file.
    fn add_unless(&mut self, known: Option<Vec<R>>, make: impl FnOnce() -> Result<Vec<R>>) -> Result<Vec<R>> {
        if let Some(known) = known {
            return Ok(known);
        }
        let block = make()?;
        self.rows.extend_from_slice(&block);
        files::write(&self.path, &files::csv(&self.rows)?)?;
        files::note_resumed(&self.path);
        Ok(block)
    }

    fn rows(&self) -> &[R] {
        &self.rows
    }
}

impl Report {
    /// The rows of the last run of each scene in the folder.
    pub fn read(folder: &Path) -> Result<Self> {
        let (rows, solved) =
            (Table::<Row>::open(folder.join(SCENES))?, Table::<SolveRow>::open(folder.join(PROBLEMS))?);
        if rows.rows().is_empty() && solved.rows().is_empty() {
            return Err(Error::input(format!("{}: no rows to draw", folder.join(SCENES).display())));
        }
        let results = last_of_each(rows.rows(), |row| (&row.scene, &row.run));
        let solves = last_of_each(solved.rows(), |row| (&row.problem, &row.run));
        Ok(Self { results, solves })
    }

    /// Writes `index.html`, `speed-against-error.svg` and, with other engines, `equal-error.md` into the folder and
    /// returns the path of the page.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let page = page::page(&self.results, &self.solves)?;
        let path = folder.join("index.html");
        files::write(&folder.join("speed-against-error.svg"), page.main.as_bytes())?;
        files::write(&path, page.html.as_bytes())?;
        if let Some(text) = duels::page(&self.results)? {
            files::write(&folder.join("equal-error.md"), text.as_bytes())?;
        }
        Ok(path)
    }
}

/// The rows of the last run of each name, in the order of the first runs. `key` returns name and run.
fn last_of_each<R: Clone>(rows: &[R], key: impl Fn(&R) -> (&String, &String)) -> Vec<Vec<R>> {
    let mut kept: Vec<Vec<R>> = Vec::new();
    for run in rows.chunk_by(|a, b| key(a) == key(b)) {
        match kept.iter_mut().find(|known| key(&known[0]).0 == key(&run[0]).0) {
            Some(known) => *known = run.to_vec(),
            None => kept.push(run.to_vec()),
        }
    }
    kept
}
