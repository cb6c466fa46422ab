//! Runs all contenders on one scene after another; what is finished is kept and not run again.

use std::path::{Path, PathBuf};

use super::contender::{Contender, Extent, Setting, Team};
use super::measure::{Row, blocks, measure};
use super::origin::Origin;
use super::page;
use super::solves::{self, SolveRow, solves};
use super::table::Table;
use crate::files;
use drystone::{ContactProblem, Error, Result, Scene};

/// What is run, and where it is written.
pub struct Survey<'a> {
    /// The scenes.
    pub scenes: Vec<Scene>,
    /// Who takes part. The first contender of the first team is what times are related to.
    pub teams: Vec<&'a Team<'a>>,
    /// How much is run.
    pub extent: Extent,
    /// Contact problems that drystone's ways to sweep are compared on.
    pub problems: Vec<ContactProblem>,
    /// Folder that everything is written into; made if need be.
    pub out: PathBuf,
}

/// Rows of one survey, ready to be drawn.
pub struct Report {
    results: Vec<Vec<Row>>,
    solves: Vec<Vec<SolveRow>>,
}

impl Survey<'_> {
    /// Runs what is not in the folder's `scenes.csv` already, and adds it there after each scene. `progress` is told what runs, how much is done, and how much
    /// there is in all.
    ///
    /// A scene counts as finished if one run has rows of every contender, on the same scene for as many steps, by the same program
    /// on the same machine with as many threads.
    pub fn run(&self, origin: &Origin, progress: &mut dyn FnMut(&str, u64, u64)) -> Result<Report> {
        std::fs::create_dir_all(&self.out).map_err(Error::file(&self.out))?;
        let mut table = Table::<Row>::open(scenes_path(&self.out))?;
        let weight = |scene: &Scene| (scene.world.dynamic_count() as u64 + 20) * u64::from(scene.steps);
        let problem_weight = |problem: &ContactProblem| problem.contacts.len() as u64 * 20;
        let total = self.scenes.iter().map(weight).chain(self.problems.iter().map(problem_weight)).sum();
        let (mut before, mut results) = (0, Vec::new());
        for scene in &self.scenes {
            let mut contenders = self.contenders(scene)?;
            let settings: Vec<_> = contenders.iter().map(|c| c.setting()).collect();
            progress(&scene.name, before, total);
            let rows = match finished(table.rows(), scene, origin, &settings) {
                Some(rows) => rows,
                None => {
                    let turns = u64::from(blocks(scene.steps)) * contenders.len() as u64;
                    let mut turn = 0;
                    let mut after_block = || {
                        turn += 1;
                        let done = before + weight(scene) * turn / turns;
                        progress(&scene.name, done, total);
                    };
                    let rows = measure(scene, &mut contenders, origin, &mut after_block)?;
                    table.add(rows.clone())?;
                    rows
                }
            };
            results.push(rows);
            before += weight(scene);
        }
        let mut table = Table::<SolveRow>::open(problems_path(&self.out))?;
        let mut all = Vec::new();
        for problem in &self.problems {
            progress(&problem.name, before, total);
            let rows = match solved(table.rows(), &solves::hash(problem), origin) {
                Some(rows) => rows,
                None => {
                    let rows = solves(problem, origin)?;
                    table.add(rows.clone())?;
                    rows
                }
            };
            all.push(rows);
            before += problem_weight(problem);
        }
        Ok(Report { results, solves: all })
    }

    fn contenders(&self, scene: &Scene) -> Result<Vec<Box<dyn Contender>>> {
        let of_each = self.teams.iter().map(|team| team(scene, self.extent)).collect::<Result<Vec<_>>>()?;
        Ok(of_each.into_iter().flatten().collect())
    }
}

/// The rows of `settings`, in their order, of the last run that has all of them.
fn finished(rows: &[Row], scene: &Scene, origin: &Origin, settings: &[Setting]) -> Option<Vec<Row>> {
    let (hash, steps) = (scene.content_hash(), super::measure::steps(scene));
    let fit = |row: &&Row| {
        let Origin { build, commit: _, machine, threads } = origin;
        row.hash == hash
            && row.steps == steps
            && row.build == *build
            && row.machine == *machine
            && row.threads == *threads
    };
    let fit: Vec<_> = rows.iter().filter(fit).collect();
    let of_run = |run: &str| -> Option<Vec<Row>> {
        let of = |setting: &Setting| {
            fit.iter().find(|row| row.run == run && row.setting() == *setting).map(|&row| row.clone())
        };
        settings.iter().map(of).collect()
    };
    fit.iter().rev().find_map(|row| of_run(&row.run))
}

/// The rows of the last run on a problem; all solvers of a program are in each.
fn solved(rows: &[SolveRow], hash: &str, origin: &Origin) -> Option<Vec<SolveRow>> {
    let fit = |row: &&SolveRow| row.hash == hash && row.build == origin.build && row.machine == origin.machine;
    let last = rows.iter().rfind(fit)?;
    Some(rows.iter().filter(|row| row.run == last.run && row.hash == hash).cloned().collect())
}

fn problems_path(folder: &Path) -> PathBuf {
    folder.join("problems.csv")
}

fn scenes_path(folder: &Path) -> PathBuf {
    folder.join("scenes.csv")
}

impl Report {
    /// The last run of each scene that the folder has.
    pub fn read(folder: &Path) -> Result<Self> {
        let (rows, solved) =
            (Table::<Row>::open(scenes_path(folder))?, Table::<SolveRow>::open(problems_path(folder))?);
        if rows.rows().is_empty() && solved.rows().is_empty() {
            return Err(Error::input(format!("{}: no rows to draw", scenes_path(folder).display())));
        }
        let results = last_of_each(rows.rows(), |row| (&row.scene, &row.run));
        let solves = last_of_each(solved.rows(), |row| (&row.problem, &row.run));
        Ok(Self { results, solves })
    }

    /// Writes `index.html` and `speed-against-error.svg` into the folder, and says where the page is.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let page = page::page(&self.results, &self.solves)?;
        let path = folder.join("index.html");
        files::write(&folder.join("speed-against-error.svg"), page.main.as_bytes())?;
        files::write(&path, page.html.as_bytes())?;
        Ok(path)
    }
}

/// Rows of one run after another, of which the last of each name is kept, where the first was. `key` is name and run.
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
