//! Runs all scenes with all contenders, one race after another; what is finished is kept and not run again.

use std::path::{Path, PathBuf};

use super::contender::{Contender, Extent, Setting, Team};
use super::origin::Origin;
use super::page;
use super::race::{Row, blocks, race};
use super::table::Table;
use crate::error::{Error, Result};
use crate::files;
use crate::scenes::Scene;

/// What is run, and where it is written.
pub struct Survey<'a> {
    /// The scenes.
    pub scenes: Vec<Scene>,
    /// Who takes part. The first contender of the first team is what times are related to.
    pub teams: Vec<&'a Team<'a>>,
    /// How much is run.
    pub extent: Extent,
    /// Folder that everything is written into; made if need be.
    pub out: PathBuf,
}

/// How far a survey is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What is running.
    pub what: &'a str,
    /// How much is done, in some unit.
    pub done: u64,
    /// How much there is.
    pub total: u64,
}

/// Races of one survey, ready to be drawn.
pub struct Report {
    races: Vec<Vec<Row>>,
}

impl Survey<'_> {
    /// Runs what is not in the folder's `scenes.csv` already, and adds it there after each race.
    ///
    /// A race counts as finished if one run has rows of every contender, on the same scene for as many steps, by the same program
    /// on the same machine with as many threads.
    ///
    /// # Errors
    /// The folder cannot be written, holds other files of these names, or a contender gives up.
    pub fn run(&self, origin: &Origin, progress: &mut dyn FnMut(&Progress)) -> Result<Report> {
        std::fs::create_dir_all(&self.out).map_err(Error::file(&self.out))?;
        let mut table = Table::<Row>::open(scenes_path(&self.out))?;
        let weight = |scene: &Scene| (scene.world.dynamic_count() as u64 + 20) * u64::from(scene.steps);
        let total = self.scenes.iter().map(weight).sum();
        let (mut before, mut races) = (0, Vec::new());
        for scene in &self.scenes {
            let mut contenders = self.contenders(scene)?;
            let settings: Vec<_> = contenders.iter().map(|c| c.setting()).collect();
            progress(&Progress { what: &scene.name, done: before, total });
            let rows = match finished(table.rows(), scene, origin, &settings) {
                Some(rows) => rows,
                None => {
                    let turns = u64::from(blocks(scene.steps)) * contenders.len() as u64;
                    let mut turn = 0;
                    let mut after_block = || {
                        turn += 1;
                        let done = before + weight(scene) * turn / turns;
                        progress(&Progress { what: &scene.name, done, total });
                    };
                    let rows = race(scene, &mut contenders, origin, &mut after_block)?;
                    table.add(rows.clone())?;
                    rows
                }
            };
            races.push(rows);
            before += weight(scene);
        }
        Ok(Report { races })
    }

    fn contenders(&self, scene: &Scene) -> Result<Vec<Box<dyn Contender>>> {
        let of_each = self.teams.iter().map(|team| team(scene, self.extent)).collect::<Result<Vec<_>>>()?;
        Ok(of_each.into_iter().flatten().collect())
    }
}

/// The rows of `settings`, in their order, of the last run that has all of them.
fn finished(rows: &[Row], scene: &Scene, origin: &Origin, settings: &[Setting]) -> Option<Vec<Row>> {
    let (hash, steps) = (scene.content_hash(), super::race::steps(scene));
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

fn scenes_path(folder: &Path) -> PathBuf {
    folder.join("scenes.csv")
}

impl Report {
    /// The last race of each scene that the folder has.
    ///
    /// # Errors
    /// There are no rows in it, or they cannot be read.
    pub fn read(folder: &Path) -> Result<Self> {
        let table = Table::<Row>::open(scenes_path(folder))?;
        let mut races: Vec<Vec<Row>> = Vec::new();
        for race in table.rows().chunk_by(|a, b| (&a.run, &a.hash) == (&b.run, &b.hash)) {
            match races.iter_mut().find(|known| known[0].scene == race[0].scene) {
                Some(known) => *known = race.to_vec(),
                None => races.push(race.to_vec()),
            }
        }
        if races.is_empty() {
            return Err(Error::input(format!("{}: no rows to draw", scenes_path(folder).display())));
        }
        Ok(Self { races })
    }

    /// Writes `index.html` and `speed-against-error.svg` into the folder, and says where the page is.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let page = page::page(&self.races)?;
        let path = folder.join("index.html");
        files::write(&folder.join("speed-against-error.svg"), page.main.as_bytes())?;
        files::write(&path, page.html.as_bytes())?;
        Ok(path)
    }
}
